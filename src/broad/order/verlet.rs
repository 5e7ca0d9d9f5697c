//! A Verlet list: pairs near one another, found at once for some ticks.
//!
//! In: every box. Out: pairs that began and pairs that parted.
//!
//! Without candidates (`afresh`) every tick searches all boxes. Where bodies go on as they came, one search serves
//! several ticks: each box is swept along its motion for so many ticks (`swept`), what meets then is listed, and until
//! the list is made anew a tick takes the boxes and compares what is listed (`near`). A body that leaves its swept box
//! strays: its entries die, it gets another swept box and is looked for alone. Unlike candidates that last (`links`)
//! the list is made for all bodies by one pass of the search, which takes a fraction of what one by one would.
//!
//! Bodies are laid anew in a tick that makes the list anew, in an order that was sorted over the ticks before: entries
//! are found again then, so no overlap is carried from the old lanes to the new.
//!
//! For how many ticks boxes are swept is found by going uphill on counted work, and so is whether a list pays at all
//! (`pace`).
//!
//! Source: Verlet 1967; swept boxes in place of his spheres, so that a list lasts as long for what flies fast.

use super::afresh::{Afresh, FRAME_TICKS};
use super::fatten::outward;
use super::lay::Bound;
use super::links::{room, small, spare};
use super::near::{Found, Near, is_among};
use super::pace::Pace;
use super::presort::SPLIT_TICKS_MAX;
use super::swept::{TakeLaid, sweep};
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, Work as Done, parts};
use crate::ids::PairKey;
use crate::simd::boxes::{Down, LANES, Lanes, Portable, WIDTH, Work};
use crate::wire::BroadMode;

/// The list and what it is made from.
#[derive(Clone, Debug, Default)]
pub(super) struct Verlet {
    /// In use: blocks and tree hold swept boxes then.
    pub(super) on: bool,
    pub(super) entries: Vec<Near>,
    pub(super) found: Vec<Found>,
    /// By block: lanes whose entries die in this tick; and lanes whose entries are new in it.
    pub(super) out: Vec<u16>,
    pub(super) fresh: Vec<u16>,
    /// Ranks of the latter.
    pub(super) strays: Vec<u32>,
    /// By rank: the swept box.
    pub(super) swept: Vec<Down>,
    /// Memory kept over calls.
    blocks: Vec<u32>,
    pub(super) pace: Pace,
}

/// Bodies whose every pair a check looks for.
const FEW: usize = 300;

impl Order {
    /// Lists what is near, from a tick on of which everything is told.
    pub(super) fn begin_list<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
        let blocks = self.live.len();
        let Afresh {
            verlet,
            finds,
            presort,
            ..
        } = &mut self.afresh;
        verlet.on = true;
        presort.stop();
        verlet.pace.begin(finds.tests);
        verlet.swept.clear();
        verlet.swept.resize(blocks * WIDTH, Down::EMPTY);
        for lanes in [&mut verlet.out, &mut verlet.fresh] {
            lanes.clear();
            lanes.resize(blocks, 0);
        }
        self.take_swept(tick.proxies, true);
        let Afresh {
            verlet,
            jumped,
            held,
            ..
        } = &mut self.afresh;
        // They are all new to the list, and none is in its lane.
        verlet.strays.clear();
        verlet.fresh.fill(0);
        jumped.fill(0);
        held.clear();
        self.list_all(tick, work);
    }

    /// Lets go of the list; its overlaps are remembered.
    pub(super) fn end_list(&mut self) {
        self.carry_listed();
        self.afresh.verlet.on = false;
    }

    /// Takes the entries out; writes those that overlap down as two body slots.
    fn carry_listed(&mut self) {
        let entries = &mut self.afresh.verlet.entries;
        for entry in entries.drain(..).filter(|entry| entry.is_hit()) {
            let [one, other] = entry.ranks().map(|rank| self.slot_of[rank]);
            if one != NONE && other != NONE {
                self.carried.push((one, other));
            }
        }
    }

    /// A tick by the list; `false` where it was let go, and bodies are to be laid anew.
    pub(super) fn update_list<P: Proxies>(
        &mut self,
        tick: &mut Tick<'_, P>,
        work: &mut Done,
    ) -> bool {
        let (came, bodies) = (self.homeless.len(), tick.members.bounded().len());
        let pace = &mut self.afresh.verlet.pace;
        let due = pace.is_due();
        // To lay bodies by another frame is not done with a list.
        let reframed = due && pace.is_worn(bodies) && self.afresh.framed >= FRAME_TICKS;
        let ends = came * MANY_CAME > bodies || due && !pace.pays() || reframed;
        if ends {
            self.end_list();
            return false;
        }
        let jumped = self.take_swept(tick.proxies, due);
        // Where all are swept anew, none is looked for alone.
        let strays = if due {
            0
        } else {
            self.afresh.verlet.strays.len() + came
        };
        self.look_listed(0, true, tick);
        let too_many = strays * MANY_CAME > bodies;
        if too_many || !self.seat_anew(jumped, tick) {
            self.afresh.verlet.pace.fail();
            self.end_list();
            return false;
        }
        work.renewed += strays as u64;
        self.afresh.presort.note_late(&self.homeless, bodies);
        self.sweep_seated();
        if !due {
            self.list_strays(tick, work);
            self.presort_listed(bodies);
        } else if self.afresh.presort.is_ready() && !self.lay_listed(tick) {
            return false;
        } else {
            self.list_all(tick, work);
        }
        let Verlet {
            pace,
            entries,
            fresh,
            ..
        } = &mut self.afresh.verlet;
        pace.note_tick(entries.len(), strays, bodies);
        fresh.fill(0);
        work.tests += entries.len() as u64;
        if !due {
            work.way = Some((BroadMode::List, self.afresh.gear.cause));
        }
        true
    }

    /// Who was given a lane in this tick is new there, and nobody knows how it moves.
    fn sweep_seated(&mut self) {
        for at in 0..self.homeless.len() {
            let Some(rank) = self.rank(self.homeless[at]) else {
                continue;
            };
            let (block, lane) = parts(rank);
            let now = self.exact[rank as usize];
            let swept = sweep(&now, &now, 0.0);
            self.fat[block].set(lane, &swept.corners());
            let verlet = &mut self.afresh.verlet;
            verlet.swept[rank as usize] = swept;
            verlet.fresh[block] |= 1 << lane;
            verlet.strays.push(rank);
        }
    }

    /// Lists everything that is near by the swept boxes.
    fn list_all<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
        self.bound_strays();
        let Afresh {
            verlet,
            finds,
            team,
            ..
        } = &mut self.afresh;
        finds.near.clear();
        let lanes = (&mut self.live, &mut self.fat, &mut self.tree);
        team.search(self.level, lanes, finds, true);
        work.tests += finds.tests;
        verlet.pace.note_search(finds.tests);
        std::mem::swap(&mut verlet.entries, &mut finds.near);
        let (entries, blocks) = (verlet.entries.len(), self.live.len());
        spare(&mut verlet.entries, entries, self.len);
        spare(&mut finds.near, entries, self.len);
        room(&mut verlet.found, self.len);
        room(&mut verlet.strays, self.len);
        room(&mut verlet.blocks, blocks);
        finds.spare();
        team.reserve(blocks, self.len);
        self.hits = 0;
        self.look_listed(0, false, tick);
    }

    /// Sorts the bodies some more, where they are to be laid anew when the list is due.
    fn presort_listed(&mut self, bodies: usize) {
        let left = self.afresh.verlet.pace.left(false) as usize - 1;
        let Afresh {
            presort,
            verlet,
            framed,
            ..
        } = &mut self.afresh;
        if presort.is_on() {
            if !presort.is_ready() {
                presort.go_on(&mut self.sorter, &self.boxes);
            }
        } else if *framed < FRAME_TICKS
            && verlet.pace.is_worn(bodies)
            && (1..=SPLIT_TICKS_MAX + 1).contains(&left)
        {
            self.begin_presort(left.saturating_sub(1));
        }
    }

    /// Deals the bodies to blocks in the order that was sorted; whether there was a lane for each.
    fn lay_listed<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> bool {
        // The old lanes go: where not all find a new one, the overlaps are told of by body.
        self.carry_listed();
        // Who is new in his lane, by body too.
        let mut new = std::mem::take(&mut self.afresh.verlet.strays);
        for stray in &mut new {
            *stray = self.slot_of[*stray as usize];
        }
        if !self.lay_presorted(tick) {
            self.afresh.verlet.on = false;
            return false;
        }
        self.carried.clear();
        let blocks = self.live.len();
        let verlet = &mut self.afresh.verlet;
        verlet.pace.note_laid();
        verlet.swept.clear();
        verlet.swept.resize(blocks * WIDTH, Down::EMPTY);
        for lanes in [&mut verlet.out, &mut verlet.fresh] {
            lanes.clear();
            lanes.resize(blocks, 0);
        }
        for slot in new.drain(..) {
            let rank = self.rank_of.get(slot as usize).copied().unwrap_or(NONE);
            if rank != NONE {
                let (block, lane) = parts(rank);
                verlet.fresh[block] |= 1 << lane;
            }
        }
        verlet.strays = new;
        let level = self.level;
        level.run(TakeLaid {
            order: self,
            proxies: tick.proxies,
        });
        true
    }

    /// Brings the bounds of the strays' blocks up to date.
    fn bound_strays(&mut self) {
        let Verlet { strays, blocks, .. } = &mut self.afresh.verlet;
        blocks.clear();
        blocks.extend(strays.iter().map(|rank| small(parts(*rank).0)));
        blocks.sort_unstable();
        blocks.dedup();
        let blocks = std::mem::take(blocks);
        self.level.run(Bound {
            order: self,
            blocks: blocks.iter().map(|block| *block as usize),
        });
        self.afresh.verlet.blocks = blocks;
    }

    /// Looks for what is near the strays, and lists it.
    fn list_strays<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
        for at in 0..self.afresh.verlet.strays.len() {
            let rank = self.afresh.verlet.strays[at] as usize;
            if is_among(&self.live, rank) {
                let swept = self.afresh.verlet.swept[rank].corners();
                self.fat[rank / WIDTH].set(rank % WIDTH, &swept);
            }
        }
        self.bound_strays();
        let listed = self.afresh.verlet.entries.len();
        let level = self.level;
        level.run(Seek { order: self });
        work.tests += self.afresh.verlet.blocks.len() as u64;
        self.look_listed(listed, false, tick);
    }

    /// How many entries overlap.
    pub(super) fn count_listed(&self) -> usize {
        let entries = &self.afresh.verlet.entries;
        entries.iter().filter(|entry| entry.is_hit()).count()
    }

    /// Boxes are stored as they are and lie in their swept ones, which stand in the blocks; no pair is listed twice;
    /// and where there are few bodies, those that overlap are listed so.
    pub(super) fn check_listed<P: Proxies>(
        &self,
        bodies: &[BodySlot],
        proxies: &P,
    ) -> Result<(), String> {
        let Verlet { entries, swept, .. } = &self.afresh.verlet;
        for slot in bodies {
            let Some(rank) = self.rank(*slot) else {
                continue;
            };
            let (block, lane) = parts(rank);
            let stored = outward(Portable, proxies.aabb(*slot), &self.origin);
            let (now, wide) = (&self.exact[rank as usize], &swept[rank as usize]);
            if now.faces.map(f32::to_bits) != stored.faces.map(f32::to_bits) {
                return Err(format!("the stored box of {slot:?} is not its box"));
            }
            let stands = self.fat[block].get(lane).map(f32::to_bits);
            if !Portable.holds(wide, now) || stands != wide.corners().map(f32::to_bits) {
                return Err(format!("{slot:?} has left its swept box"));
            }
        }
        let listed = |hit: bool| {
            let some = entries.iter().filter(move |entry| entry.is_hit() | !hit);
            let pairs = some.map(|entry| {
                let [one, other] = entry.ranks().map(|rank| BodySlot(self.slot_of[rank]));
                PairKey::new(one, other)
            });
            let mut pairs: Vec<PairKey> = pairs.collect();
            pairs.sort_unstable();
            pairs
        };
        if listed(false).windows(2).any(|two| two[0] == two[1]) {
            return Err("a pair is listed twice".into());
        }
        let overlaps = listed(true);
        for (at, one) in bodies.iter().enumerate().take(FEW) {
            for other in &bodies[at + 1..] {
                let meet = proxies.aabb(*one).overlaps(proxies.aabb(*other));
                let key = PairKey::new(*one, *other);
                if meet != overlaps.binary_search(&key).is_ok() {
                    return Err(format!(
                        "the overlap of {key:?} is {meet}, and not listed so"
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Asks the tree for what is near each stray.
struct Seek<'a> {
    order: &'a mut Order,
}

impl Work for Seek<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let order = self.order;
        let mut blocks = std::mem::take(&mut order.afresh.verlet.blocks);
        for at in 0..order.afresh.verlet.strays.len() {
            let rank = order.afresh.verlet.strays[at];
            if !is_among(&order.live, rank as usize) {
                continue;
            }
            let (block, lane) = parts(rank);
            let one = order.fat[block].get(lane);
            blocks.clear();
            order.tree.query(lanes, &one, &mut blocks);
            for other in &blocks {
                let theirs = *other as usize;
                let mut met = lanes.meets(&order.fat[theirs], &one);
                let verlet = &mut order.afresh.verlet;
                // Two strays list each other once, and none itself.
                let first = small(theirs * WIDTH);
                let upto = (rank + 1).saturating_sub(first).min(LANES);
                let before = u16::MAX.checked_shr(LANES - upto).unwrap_or(0);
                met &= !(verlet.fresh[theirs] & before);
                while met != 0 {
                    let near = first + met.trailing_zeros();
                    verlet.entries.push(Near::new(rank, near));
                    met &= met - 1;
                }
            }
        }
        order.afresh.verlet.blocks = blocks;
    }
}
