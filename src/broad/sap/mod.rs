//! Sweep-and-prune: the ends of all boxes, sorted on each axis and kept across ticks (RTR3 section 17.5).
//!
//! In: which bodies left, came and moved. Out: pairs that may have begun to overlap.
//!
//! * Few bodies moved: each of their ends slides to its new place. Nothing else is touched, so 1 % of the bodies cost 1
//!   % of the work.
//! * Many moved: one pass of insertion sort over each list, in memory order.
//! * Too many ends would pass one another (jumps): sort from scratch and sweep once along the clearest axis. The bound
//!   is on counted swaps, so the worst case is about twice the cheaper way.
//! * A pair begins when a lower end passes an upper one on some axis and the boxes overlap. A pair ends when the boxes
//!   of a moved body no longer overlap; its few stored pairs show that without the lists.
//! * Bodies that come are merged in one pass; their pairs are found by testing every box, or by a sweep.
//! * An axis on which everything overlaps is skipped (`choose`, `partial`).
//!
//! Refused: reporting parted pairs from swaps. With 10,000 bodies that move 1 % of their size an end passes about 18
//! others on each axis, and only about one swap in a hundred concerns a stored pair.

use super::Work;
use super::members::{ASKED, Bounds, CAME, MOVED, Members};
use crate::ids::{BodySlot, PairKey};

mod axis;
mod choose;
mod partial;
mod sweep;

use axis::{Axis, Passing};
use choose::Choice;
use partial::Partial;
use sweep::{Course, Sweep};

/// When one in `MANY_MOVED` bodies moved, the lists are repaired in one pass rather than end by end.
const MANY_MOVED: usize = 8;

/// The sorted lists.
#[derive(Clone, Debug, Default)]
pub(super) struct Sap {
    axes: [Axis; 3],
    choice: Choice,
    partial: Partial,
    sweep: Sweep,
    met: Vec<(BodySlot, BodySlot)>,
    moved: Vec<BodySlot>,
    came: Vec<BodySlot>,
    asked: Vec<BodySlot>,
}

impl Sap {
    /// Bodies with a box left (and may be about to come again).
    pub(super) fn leave(&mut self, left: &[BodySlot], members: &Members) {
        if left.is_empty() {
            return;
        }
        for axis in self.choice.kept().iter().copied() {
            self.axes[axis].leave(left, members);
        }
        for slot in left {
            self.partial.leave(*slot);
        }
    }

    /// Brings the lists up to date and reports pairs that may have begun.
    pub(super) fn update(&mut self, members: &Members, began: &mut Vec<PairKey>, work: &mut Work) {
        self.sort_out(members);
        let bodies = members.bounded().len();
        let bulk = self.came.len() * 4 > bodies;
        let busy = !self.moved.is_empty() || !self.came.is_empty();
        let look = busy && self.choice.looks(bodies) && self.look(bodies);
        if bulk || look || !self.repair(members, work) {
            self.resort(members, work);
        } else {
            self.admit(members, work);
        }
        if let (Some(skipped), [one, other]) = (self.choice.skipped(), self.choice.kept()) {
            self.partial.add(&mut self.met);
            work.tests += self.partial.walk([*one, *other], skipped, members, began);
            if self.partial.len() > Choice::partial_max(bodies) {
                self.choice.keep_all();
                self.resort(members, work);
            }
        }
        began.extend(self.met.drain(..).map(|(a, b)| PairKey::new(a, b)));
        work.partial = self.partial.len() as u64;
        work.axes = std::array::from_fn(|k| self.choice.keeps(k));
    }

    /// Splits the touched bodies into those that came, moved, or are queried.
    fn sort_out(&mut self, members: &Members) {
        self.met.clear();
        self.came.clear();
        self.moved.clear();
        self.asked.clear();
        for slot in members.touched() {
            if !members.is_bounded(*slot) {
                continue;
            }
            if members.has(*slot, CAME) {
                self.came.push(*slot);
            } else if members.has(*slot, MOVED) {
                self.moved.push(*slot);
            }
            if members.has(*slot, ASKED) {
                self.asked.push(*slot);
            }
        }
    }

    /// Counts overlaps on each kept axis; returns whether the axes change.
    fn look(&mut self, bodies: usize) -> bool {
        for axis in self.choice.kept().iter().copied() {
            let pairs = self.axes[axis].crowding();
            self.choice.note_crowding(axis, pairs);
        }
        self.choice.decide(bodies)
    }

    /// Puts moved ends in order; `false` when that takes more than sorting from scratch.
    fn repair(&mut self, members: &Members, work: &mut Work) -> bool {
        let bodies = members.bounded().len();
        let many = self.moved.len() * MANY_MOVED > bodies;
        if many && self.choice.goes_straight() {
            return false;
        }
        let mut allowance = self.choice.allowance(bodies);
        let mut fits = true;
        for axis in self.choice.kept().iter().copied() {
            let others = self.choice.beside(axis);
            let mut passing = Passing {
                bounds: members.all_bounds(),
                test: |a: &Bounds, b: &Bounds| a.meets(b, others[0]) & a.meets(b, others[1]),
                met: &mut self.met,
                allowance,
                tests: 0,
            };
            let list = &mut self.axes[axis];
            let swaps = if many {
                let flags = members.all_flags();
                list.settle_all(axis, |slot| flags[slot.index()] & MOVED != 0, &mut passing)
            } else {
                let mut moved = self.moved.iter();
                moved.try_fold(0, |all, slot| {
                    Some(all + list.settle_one(*slot, axis, &mut passing)?)
                })
            };
            work.tests += passing.tests;
            allowance = passing.allowance;
            let Some(swaps) = swaps else {
                fits = false;
                break;
            };
            work.swaps += swaps;
            self.choice.note_swaps(axis, swaps);
        }
        if many || !fits {
            self.choice.note_repair(fits);
        }
        fits
    }

    /// Adds the bodies that came, and finds the pairs of queried bodies.
    fn admit(&mut self, members: &Members, work: &mut Work) {
        if !self.came.is_empty() {
            for axis in self.choice.kept().iter().copied() {
                self.axes[axis].merge(&self.came, members, axis);
            }
        }
        // While an axis is skipped, the two-axis pairs already cover bodies that are merely queried again.
        let skipped = self.choice.skipped();
        let who = if skipped.is_some() {
            &self.came
        } else {
            &self.asked
        };
        if self
            .choice
            .prefers_sweep(who.len(), members.bounded().len())
        {
            let flag = if skipped.is_some() { CAME } else { ASKED };
            if !self.sweep_all(members, |slot| members.has(slot, flag), work) {
                self.choice.keep_all();
                self.resort(members, work);
            }
            return;
        }
        for slot in who {
            let mine = members.bounds(*slot);
            let meets = |other: &&BodySlot| {
                let theirs = members.bounds(**other);
                (0..3).all(|k| skipped == Some(k) || mine.meets(theirs, k)) && *other != slot
            };
            let found = members.bounded().iter().filter(meets);
            self.met.extend(found.map(|other| (*slot, *other)));
        }
        work.tests += who.len() as u64 * members.bounded().len() as u64;
    }

    /// Sorts every list from scratch and finds the pairs of all touched bodies by one sweep.
    fn resort(&mut self, members: &Members, work: &mut Work) {
        work.rebuilds += 1;
        self.partial.clear();
        loop {
            for axis in 0..3 {
                if self.choice.keeps(axis) {
                    self.axes[axis].sort(members, axis);
                    let pairs = self.axes[axis].crowding();
                    self.choice.note_crowding(axis, pairs);
                } else {
                    self.axes[axis].drop_all();
                }
            }
            self.met.clear();
            let fits = if self.choice.skipped().is_none() {
                self.sweep_all(members, |slot| members.has(slot, MOVED | ASKED), work)
            } else {
                self.sweep_all(members, |_| true, work)
            };
            if fits {
                return;
            }
            self.choice.keep_all();
        }
    }

    /// Sweeps along the clearest axis; `false` when an axis is skipped and the two-axis pairs are too many.
    fn sweep_all(
        &mut self,
        members: &Members,
        asked: impl Fn(BodySlot) -> bool,
        work: &mut Work,
    ) -> bool {
        let along = self.choice.clearest();
        let course = Course {
            axis: &self.axes[along],
            along,
            beside: self.choice.beside(along),
            most: match self.choice.skipped() {
                Some(_) => Choice::partial_max(members.bounded().len()),
                None => usize::MAX,
            },
        };
        let (fits, tests) = self.sweep.run(&course, members, asked, &mut self.met);
        work.tests += tests;
        self.choice.note_sweep(tests);
        fits
    }

    /// Checks the lists and the two-axis pairs.
    pub(super) fn validate(&self, members: &Members) -> Result<(), String> {
        for axis in self.choice.kept().iter().copied() {
            self.axes[axis].validate(members, axis)?;
        }
        match *self.choice.kept() {
            [one, other] => self.partial.validate([one, other], members),
            _ if self.partial.len() == 0 => Ok(()),
            _ => Err("pairs of two axes are kept beside three".into()),
        }
    }
}
