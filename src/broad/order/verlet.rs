//! A Verlet list: near pairs, found by one search for several ticks.
//!
//! In: every box. Out: pairs that began and pairs that parted.
//!
//! Without candidates (`afresh`) every tick searches all boxes. Where bodies keep their course, or wander little
//! (`course`), one search serves several ticks: each box is swept for that many (`swept`), overlaps of swept boxes are
//! listed, and until the list is rebuilt a tick takes the boxes and compares the listed pairs (`near`). A body that
//! leaves its swept box strays: its entries die, it gets another swept box and is queried alone. Unlike lasting
//! candidates (`links`) the list is made for all bodies by one search, which takes a fraction of the time of single
//! queries.
//!
//! The next list is made in the last ticks of the current one (`next`), so that no tick has a whole search. Between two
//! lists bodies are laid out again, in an order that was sorted over the ticks before, and the entries are remapped.
//!
//! The number of ticks that a list is used is found by hill climbing on counted work, as is whether lists pay at all
//! (`pace`).
//!
//! Source: Verlet 1967; with swept boxes in place of spheres, so that a list lasts as long for fast bodies.

use super::afresh::Afresh;
use super::bits::each_bit;
use super::cost::list_worth;
use super::course::{Course, Reach};
use super::fatten::outward;
use super::idle::shed;
use super::lay::Bound;
use super::near::{Found, Near, is_among};
use super::pace::{Pace, Phase};
use super::presort::SPLIT_TICKS_MAX;
use super::shares::Shares;
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, Work, parts};
use crate::ids::{PairKey, small};
use crate::simd::boxes::{Down, Kernel, LANES, Lanes, Portable, WIDTH};
use crate::wire::BroadMode;

/// The list and the data it is made from.
#[derive(Clone, Debug, Default)]
pub(super) struct Verlet {
    /// In use: blocks and tree hold swept boxes then.
    pub(super) on: bool,
    pub(super) entries: Vec<Near>,
    pub(super) found: Vec<Found>,
    /// The boxes of bodies whose entries die, during a look.
    pub(super) aside: Vec<Down>,
    /// By block: lanes whose entries die in this tick; and lanes whose entries are new in it.
    pub(super) out: Vec<u16>,
    pub(super) fresh: Vec<u16>,
    /// Ranks of the latter.
    pub(super) strays: Vec<u32>,
    /// By rank: the box to stay in, as an open box (`Down::open`).
    pub(super) swept: Vec<Down>,
    /// The runs of blocks in which the next list is searched.
    pub(super) next: Shares,
    /// By block: lanes whose results are dropped from the search for the next list.
    pub(super) late: Vec<u16>,
    /// Whether all bodies have drifted so far from the origin that it must be moved.
    pub(super) adrift: bool,
    /// Memory kept across calls: blocks, and what of each is near a stray: its first rank, and lanes.
    pub(super) blocks: Vec<u32>,
    pub(super) near: Vec<(u32, u16)>,
    pub(super) pace: Pace,
    pub(super) course: Course,
}

impl Verlet {
    /// Gives the memory of the list back.
    pub(super) fn give_back(&mut self) {
        self.on = false;
        shed(&mut self.entries);
        shed(&mut self.found);
        shed(&mut self.aside);
        shed(&mut self.strays);
        shed(&mut self.swept);
        self.course.give_back();
    }
}

/// Most bodies for which a check tests every pair.
const FEW: usize = 300;

impl Order {
    /// Begins a list if it is likely to cost less than a search in each tick.
    ///
    /// * `tests` - boxes compared with a block in such a search.
    pub(super) fn try_list<P: Proxies>(
        &mut self,
        tests: u64,
        tick: &mut Tick<'_, P>,
        work: &mut Work,
    ) {
        self.ask_course(self.afresh.laid > 1);
        let crowding = self.crowding(self.afresh.verlet.pace.first_ticks());
        let worth = list_worth(self.len, tests);
        let pace = &mut self.afresh.verlet.pace;
        if pace.promises(self.hits, crowding, worth) {
            pace.begin(worth);
            self.begin_list(tick, work);
        }
    }

    /// Lists near pairs, after a tick in which everything was reported.
    fn begin_list<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Work) {
        let Afresh {
            verlet,
            presort,
            held,
            ..
        } = &mut self.afresh;
        verlet.on = true;
        presort.stop();
        held.clear();
        let span = verlet.pace.span(true);
        self.clear_lanes();
        self.take_swept(tick.proxies, Phase::Opens, span);
        // They are all new to the list, and none has left its lane.
        let Afresh { verlet, jumped, .. } = &mut self.afresh;
        verlet.strays.clear();
        verlet.entries.clear();
        jumped.fill(0);
        self.open_next(1, work);
        self.take_over(tick.proxies);
        self.note_listed(0, tick);
    }

    /// Drops the list; its overlaps are saved.
    pub(super) fn end_list(&mut self) {
        let verlet = &mut self.afresh.verlet;
        verlet.on = false;
        verlet.course.clear();
        self.carried.reserve(self.hits);
        let overlaps = verlet.entries.drain(..).filter(|entry| entry.is_hit());
        for entry in overlaps {
            let [one, other] = entry.ranks().map(|rank| self.slot_of[rank]);
            if one != NONE && other != NONE {
                self.carried.push((one, other));
            }
        }
    }

    /// A tick with the list; `false` if it was dropped, and bodies must be laid out again.
    pub(super) fn update_list<P: Proxies>(
        &mut self,
        tick: &mut Tick<'_, P>,
        work: &mut Work,
    ) -> bool {
        let (came, bodies) = (self.homeless.len(), tick.members.bounded().len());
        let pace = &mut self.afresh.verlet.pace;
        let phase = pace.phase();
        let opens = phase == Phase::Opens;
        let adrift = std::mem::take(&mut self.afresh.verlet.adrift);
        if came * MANY_CAME > bodies || adrift || opens && !pace.pays() {
            self.end_list();
            return false;
        }
        let ahead = if opens { pace.open() } else { 0 };
        let span = pace.span(false);
        let jumped = self.take_swept(tick.proxies, phase, span);
        let known = self.afresh.verlet.strays.len() + came;
        self.look_listed(0, true, tick);
        if known * MANY_CAME > bodies || !self.seat_anew(jumped, tick) {
            self.afresh.verlet.pace.break_off();
            self.end_list();
            return false;
        }
        self.afresh.presort.note_late(&self.homeless, bodies);
        self.sweep_seated();
        // Includes bodies that jumped, which are new in their lanes.
        let strays = self.afresh.verlet.strays.len();
        work.renewed += strays as u64;
        self.list_strays(tick, work);
        match phase {
            Phase::Opens => self.open_next(ahead, work),
            Phase::Makes => self.search_next(work),
            Phase::Ends => self.take_over(tick.proxies),
            Phase::Lasts if self.afresh.presort.is_ready() => {
                if !self.lay_listed(tick) {
                    self.afresh.verlet.pace.break_off();
                    self.afresh.verlet.on = false;
                    return false;
                }
            }
            Phase::Lasts => {}
        }
        self.presort_listed(phase, bodies);
        self.note_listed(strays, tick);
        work.tests += self.afresh.verlet.entries.len() as u64;
        work.way = Some((BroadMode::List, self.afresh.gear.cause));
        true
    }

    /// Ends a tick with the list.
    fn note_listed<P>(&mut self, strays: usize, tick: &Tick<'_, P>) {
        let bodies = tick.members.bounded().len();
        let Verlet {
            pace,
            entries,
            fresh,
            ..
        } = &mut self.afresh.verlet;
        pace.note_tick(entries.len(), strays, bodies);
        fresh.fill(0);
    }

    /// Clears the data of all lanes.
    pub(super) fn clear_lanes(&mut self) {
        let blocks = self.live.len();
        let Verlet {
            swept,
            out,
            fresh,
            late,
            strays,
            ..
        } = &mut self.afresh.verlet;
        swept.clear();
        swept.resize(blocks * WIDTH, Down::EMPTY);
        for lanes in [out, fresh, late] {
            lanes.clear();
            lanes.resize(blocks, 0);
        }
        strays.clear();
    }

    /// A body that got a lane in this tick is new there, and its motion is unknown.
    fn sweep_seated(&mut self) {
        for at in 0..self.homeless.len() {
            let Some(rank) = self.rank(self.homeless[at]) else {
                continue;
            };
            let (block, lane) = parts(rank);
            let now = self.exact[rank as usize];
            let swept = Reach::NEW.sweep(&now, &now).open();
            self.fat[block].set(lane, &swept.corners());
            let verlet = &mut self.afresh.verlet;
            verlet.swept[rank as usize] = swept;
            verlet.course.forget(block, lane);
            verlet.fresh[block] |= 1 << lane;
            verlet.late[block] |= 1 << lane;
            verlet.strays.push(rank);
        }
    }

    /// Continues the sort of bodies, if they are to be laid out again before the next list begins.
    fn presort_listed(&mut self, phase: Phase, bodies: usize) {
        let Afresh {
            presort, verlet, ..
        } = &mut self.afresh;
        let spare = verlet.pace.spare() as usize;
        if presort.is_on() {
            if !presort.is_ready() {
                presort.go_on(&mut self.sorter, &self.boxes);
            }
        } else if phase == Phase::Lasts && verlet.pace.is_worn(bodies) {
            // One tick for the boxes and the curve, and one for the layout; if there are too few, after the next list.
            let ticks = spare.checked_sub(2).unwrap_or(SPLIT_TICKS_MAX);
            self.begin_presort(ticks.min(SPLIT_TICKS_MAX));
        }
    }

    /// Updates the bounds of the strays' blocks.
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

    /// Searches what is near the strays, and lists it.
    fn list_strays<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Work) {
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

    /// Number of entries that overlap.
    pub(super) fn count_listed(&self) -> usize {
        let entries = &self.afresh.verlet.entries;
        entries.iter().filter(|entry| entry.is_hit()).count()
    }

    /// Checks that boxes are stored unchanged and lie in their swept ones, which are in the blocks; that no pair is
    /// listed twice; and, with few bodies, that overlapping ones are listed as such.
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
            let stands = Down::of(self.fat[block].get(lane)).open();
            if ![&stands, wide]
                .iter()
                .all(|outer| Portable.holds(outer, now))
            {
                return Err(format!("{slot:?} has left its swept box"));
            }
        }
        let listed = |hit: bool| {
            let some = entries.iter().filter(move |entry| entry.is_hit() | !hit);
            let mut pairs: Vec<PairKey> = some.map(|entry| entry.key(&self.slot_of)).collect();
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

/// Queries the tree for what is near each stray.
struct Seek<'a> {
    order: &'a mut Order,
}

impl Kernel for Seek<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let order = self.order;
        let mut blocks = std::mem::take(&mut order.afresh.verlet.blocks);
        let mut near = std::mem::take(&mut order.afresh.verlet.near);
        for at in 0..order.afresh.verlet.strays.len() {
            let rank = order.afresh.verlet.strays[at];
            if !is_among(&order.live, rank as usize) {
                continue;
            }
            let (block, lane) = parts(rank);
            let one = order.fat[block].get(lane);
            blocks.clear();
            order.tree.query(lanes, &one, &mut blocks);
            near.clear();
            // One extra entry: it is read, and its value is not used.
            near.resize(blocks.len() + 1, (0, 0));
            let verlet = &mut order.afresh.verlet;
            let (mut kept, mut pairs) = (0, 0);
            for other in &blocks {
                let theirs = *other as usize;
                let met = lanes.meets(&order.fat[theirs], &one);
                // Two strays list each other once, and none lists itself.
                let first = small(theirs * WIDTH);
                let upto = (rank + 1).saturating_sub(first).min(LANES);
                let before = u16::MAX.checked_shr(LANES - upto).unwrap_or(0);
                let met = met & !(verlet.fresh[theirs] & before);
                near[kept] = (first, met);
                kept += usize::from(met != 0);
                pairs += met.count_ones() as usize;
            }
            let bits = each_bit(&near, pairs, |(_, met)| u64::from(*met));
            let entries = bits.map(|((first, _), lane)| Near::new(rank, first + lane));
            verlet.entries.extend(entries);
        }
        order.afresh.verlet.blocks = blocks;
        order.afresh.verlet.near = near;
    }
}
