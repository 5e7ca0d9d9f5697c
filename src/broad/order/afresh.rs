//! From scratch in each tick: for motion that no fat box holds.
//!
//! In: every box. Out: pairs that began and pairs that parted, as the difference of two sorted lists.
//!
//! Bodies are laid along the curve in blocks of sixteen, each block asks the tree for those behind it that it meets,
//! and what overlaps is the new list. Nothing is learned and nothing is kept but the list, so it costs the same
//! whatever the bodies do: dearer than candidates that last, and cheaper than candidates that never do. Which of the
//! two a tick takes is chosen by counted work (`Gear`).
//!
//! Exact as the rest: boxes are rounded outward, and where rounding could tell otherwise the f64 boxes are asked.

use super::gear::Gear;
use super::links::{room, spare};
use super::place::middle;
use super::sort::Sorter;
use super::{BodySlot, NONE, Order, Proxies, Tick, Work as Done, ones, small};
use crate::broad::members::{ASKED, CAME, Members};
use crate::ids::PairKey;
use crate::simd::boxes::{Boxes16, Down, Lanes, WIDTH, Work, prefetch};

/// Ticks between two looks at where the bodies are and how large, for the frame of the curve: a frame that is out of
/// date costs time, nothing else.
const FRAME_TICKS: u32 = 32;
/// How many bodies ahead boxes are asked for.
const AHEAD: usize = 16;

/// What lasts from tick to tick, and memory kept over calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Afresh {
    /// In use: the order keeps no lanes and no candidates then.
    pub(super) on: bool,
    pub(super) gear: Gear,
    /// Ticks in a row.
    ticks: u32,
    /// Pairs of boxes that overlapped in the last tick, ascending.
    held: Vec<PairKey>,
    /// Those of this one.
    found: Vec<PairKey>,
    /// Ranks of boxes for which rounding leaves it open.
    open: Vec<[u32; 2]>,
    near: Vec<u32>,
    /// Boxes by place among the members.
    boxes: Vec<Down>,
    /// By body: whether it has just left.
    gone: Vec<bool>,
}

impl Order {
    /// Lets go of lanes and candidates; their overlaps stay.
    pub(super) fn begin_afresh(&mut self) {
        self.carry_all();
        let held = &mut self.afresh.held;
        held.clear();
        let carried = self.carried.drain(..);
        held.extend(carried.map(|(one, other)| PairKey::new(BodySlot(one), BodySlot(other))));
        held.sort_unstable();
        self.links.reset(self.live.len());
        self.hits = 0;
        self.entries.clear();
        self.listed = false;
        self.worklist.clear();
        self.afresh.on = true;
        self.afresh.ticks = 0;
    }

    /// Goes back to lanes and candidates: the overlaps wait for a sort of all, which must follow.
    pub(super) fn end_afresh(&mut self) {
        self.afresh.on = false;
        let pairs = self.afresh.held.drain(..).map(PairKey::slots);
        self.carried
            .extend(pairs.map(|(one, other)| (one.0, other.0)));
    }

    /// Finds every overlap and reports what differs from the last tick.
    pub(super) fn update_afresh<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
        let bodies = tick.members.bounded();
        let look_again = self.afresh.ticks.is_multiple_of(FRAME_TICKS);
        if look_again {
            self.origin = middle(bodies.iter().map(|slot| tick.proxies.aabb(*slot)));
        }
        self.level.run(TakeAll {
            order: self,
            bodies,
            proxies: tick.proxies,
        });
        self.lay_along_curve(bodies, look_again);
        work.tests += self.level.run(Sweep { order: self });
        self.ask_open(tick.proxies);
        let Afresh { held, found, .. } = &mut self.afresh;
        found.sort_unstable();
        tell_difference(held, found, tick.began, tick.parted);
        std::mem::swap(held, found);
        tell_asked(held, tick.members, tick.began);
        self.afresh.ticks = self.afresh.ticks.wrapping_add(1);
    }

    /// Bodies left: their pairs are no difference.
    pub(super) fn forget_held(&mut self, left: &[BodySlot]) {
        let Afresh { held, gone, .. } = &mut self.afresh;
        let most = left.iter().map(|slot| slot.index() + 1).max();
        if most.is_some_and(|most| gone.len() < most) {
            gone.resize(most.unwrap_or(0), false);
        }
        left.iter().for_each(|slot| gone[slot.index()] = true);
        let is_gone = |slot: BodySlot| gone.get(slot.index()) == Some(&true);
        held.retain(|key| {
            let (one, other) = key.slots();
            !is_gone(one) && !is_gone(other)
        });
        left.iter().for_each(|slot| gone[slot.index()] = false);
    }

    /// Deals the bodies to blocks along the curve; a class begins with a block of its own.
    ///
    /// * `look_again` - at where they are and how large, for the frame of the curve.
    fn lay_along_curve(&mut self, bodies: &[BodySlot], look_again: bool) {
        self.boxes.clear();
        self.boxes
            .extend(self.afresh.boxes.iter().map(Down::corners));
        if look_again {
            self.sorter.frame(&self.boxes);
        }
        let most = bodies.len() / WIDTH + super::sort::CLASSES_MAX + 1;
        self.slot_of.clear();
        self.exact.clear();
        self.fat.clear();
        self.slot_of.reserve(most * WIDTH);
        self.exact.reserve(most * WIDTH);
        self.fat.reserve(most);
        let (mut lane, mut class) = (WIDTH, u64::MAX);
        for (key, index) in self.sorter.along_curve(&self.boxes) {
            if lane == WIDTH || Sorter::class_of(key) != class {
                (lane, class) = (0, Sorter::class_of(key));
                self.fat.push(Boxes16::EMPTY);
                self.slot_of.resize(self.fat.len() * WIDTH, NONE);
                self.exact.resize(self.fat.len() * WIDTH, Down::EMPTY);
            }
            let block = self.fat.len() - 1;
            let rank = block * WIDTH + lane;
            self.slot_of[rank] = bodies[index as usize].0;
            self.exact[rank] = self.afresh.boxes[index as usize];
            self.fat[block].set(lane, &self.boxes[index as usize]);
            lane += 1;
        }
        self.len = bodies.len();
        self.tree.reserve_blocks(most);
        self.tree.reset(self.fat.len());
        self.tree.reserve();
        // How many overlap differs from tick to tick: room for more is made when their number grows.
        let Afresh {
            held,
            found,
            open,
            near,
            ..
        } = &mut self.afresh;
        spare(found, held.len(), bodies.len());
        room(open, bodies.len());
        room(near, self.fat.len());
    }

    /// Asks the f64 boxes of what rounding leaves open.
    fn ask_open<P: Proxies>(&mut self, proxies: &P) {
        let Afresh { open, found, .. } = &mut self.afresh;
        for ranks in open.drain(..) {
            let [one, other] = ranks.map(|rank| BodySlot(self.slot_of[rank as usize]));
            if proxies.aabb(one).overlaps(proxies.aabb(other)) {
                found.push(PairKey::new(one, other));
            }
        }
    }

    /// The list is that of the boxes; few bodies only, for it looks at every pair.
    pub(super) fn check_afresh<P: Proxies>(
        &self,
        members: &Members,
        proxies: &P,
    ) -> Result<(), String> {
        let bodies = members.bounded();
        if !self.afresh.held.is_sorted_by(|one, other| one < other) {
            return Err("the list of overlaps is not in order".into());
        }
        if bodies.len() > 300 {
            return Ok(());
        }
        for (at, one) in bodies.iter().enumerate() {
            for other in &bodies[at + 1..] {
                let meet = proxies.aabb(*one).overlaps(proxies.aabb(*other));
                let key = PairKey::new(*one, *other);
                if meet != self.afresh.held.binary_search(&key).is_ok() {
                    return Err(format!("the overlap of {key:?} is {meet}, and not held so"));
                }
            }
        }
        Ok(())
    }
}

/// Reports what is in one of two ascending lists alone.
fn tell_difference(
    before: &[PairKey],
    now: &[PairKey],
    began: &mut Vec<PairKey>,
    parted: &mut Vec<PairKey>,
) {
    let mut left = before.iter().peekable();
    for key in now {
        while let Some(gone) = left.next_if(|held| *held < key) {
            parted.push(*gone);
        }
        if left.next_if(|held| *held == key).is_none() {
            began.push(*key);
        }
    }
    parted.extend(left);
}

/// Reports every overlap of bodies whose pairs must be looked for, whatever moved.
fn tell_asked(held: &[PairKey], members: &Members, began: &mut Vec<PairKey>) {
    let asked = |slot: BodySlot| members.has(slot, ASKED) && !members.has(slot, CAME);
    if !members.touched().iter().any(|slot| asked(*slot)) {
        return;
    }
    let concerned = held.iter().filter(|key| {
        let (one, other) = key.slots();
        asked(one) || asked(other)
    });
    began.extend(concerned);
}

/// Takes every box.
struct TakeAll<'a, P> {
    order: &'a mut Order,
    bodies: &'a [BodySlot],
    proxies: &'a P,
}

impl<P: Proxies> Work for TakeAll<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let origin = self.order.origin;
        let boxes = &mut self.order.afresh.boxes;
        boxes.clear();
        boxes.reserve(self.bodies.len());
        for (at, slot) in self.bodies.iter().enumerate() {
            if let Some(ahead) = self.bodies.get(at + AHEAD) {
                prefetch(self.proxies.aabb(*ahead));
            }
            let aabb = self.proxies.aabb(*slot);
            let (min, max) = (aabb.min.coords.as_ref(), aabb.max.coords.as_ref());
            boxes.push(lanes.outward(min, max, &origin));
        }
    }
}

/// Finds the overlaps of what was laid; returns how many boxes were compared with a block.
struct Sweep<'a> {
    order: &'a mut Order,
}

impl Work for Sweep<'_> {
    type Out = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let order = self.order;
        let blocks = order.fat.len();
        for block in 0..blocks {
            let bound = lanes.bound(&order.fat[block], u16::MAX);
            order.tree.set(block, bound);
        }
        order.tree.refit(lanes);
        let (mut tests, mut near) = (0, std::mem::take(&mut order.afresh.near));
        order.afresh.found.clear();
        order.afresh.open.clear();
        for block in 0..blocks {
            near.clear();
            let bound = *order.tree.bound(block);
            order
                .tree
                .query_from(lanes, &bound, small(block), &mut near);
            tests += near.len() as u64;
            for (at, other) in near.iter().enumerate() {
                if let Some(next) = near.get(at + 2) {
                    prefetch(&order.fat[*next as usize]);
                }
                tests += order.pair_blocks(lanes, block, *other as usize);
            }
        }
        order.afresh.near = near;
        tests
    }
}

impl Order {
    /// Finds the overlaps of two blocks, or within one; returns how many boxes were compared with a block.
    #[inline(always)]
    fn pair_blocks<L: Lanes>(&mut self, lanes: L, block: usize, other: usize) -> u64 {
        let same = block == other;
        let near = if same {
            u16::MAX
        } else {
            lanes.meets(&self.fat[block], self.tree.bound(other))
        };
        for lane in ones(near) {
            let rank = block * WIDTH + lane;
            let mut meets = lanes.meets(&self.fat[other], &self.exact[rank].corners());
            if same {
                // Each pair once, and none of a body with itself.
                meets &= u16::MAX << lane << 1;
            }
            for lane in ones(meets) {
                self.judge_ranks(lanes, rank, other * WIDTH + lane);
            }
        }
        u64::from(near.count_ones())
    }

    /// Two boxes that meet as they are rounded: surely, or it is open.
    #[inline(always)]
    fn judge_ranks<L: Lanes>(&mut self, lanes: L, rank: usize, other: usize) {
        let (apart, sure) = lanes.parts(&self.exact[rank], &self.exact[other]);
        if sure {
            let slots = [rank, other].map(|rank| BodySlot(self.slot_of[rank]));
            self.afresh.found.push(PairKey::new(slots[0], slots[1]));
        } else if !apart {
            self.afresh.open.push([small(rank), small(other)]);
        }
    }
}
