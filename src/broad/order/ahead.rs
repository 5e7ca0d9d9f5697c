//! Without candidates: the bodies are sorted anew over some ticks while they stay in their lanes, so that no tick has
//! all the work of laying.
//!
//! In: the boxes of one tick. Out: some ticks later, lanes along the order that they were sorted into.
//!
//! Who comes or jumps away in between belongs elsewhere than it was sorted to, and is seated behind the others.

use super::afresh::FRAME_TICKS;
use super::lay::TakeLanes;
use super::links::room;
use super::place::middle;
use super::sort::{FILL, Sorter};
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, ones, parts};
use crate::simd::boxes::WIDTH;

/// Ticks that the bodies are split into blocks in, at most: what a tick has of it is then a tenth of its work.
pub(super) const SPLIT_TICKS_MAX: usize = 4;
/// An order is out of date after as many ticks as the blocks grow in; a share of that is lost by sorting ahead.
const LOST: f64 = 3.0;

/// The order that is sorted ahead, as far as it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Ahead {
    on: bool,
    /// By index in the sort.
    bodies: Vec<BodySlot>,
    /// How many are split into blocks, and how many more in each tick.
    split: usize,
    quota: usize,
    /// Who came or jumped away since it began.
    late: Vec<BodySlot>,
}

impl Ahead {
    /// Room for so many bodies, some of them late.
    pub(super) fn reserve(&mut self, bodies: usize, late: usize) {
        room(&mut self.bodies, bodies);
        room(&mut self.late, late);
    }

    /// Lets go of it.
    pub(super) fn stop(&mut self) {
        self.on = false;
    }

    /// Whether an order is being sorted, or sorted.
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    /// Whether it is sorted.
    pub(super) fn is_ready(&self) -> bool {
        self.on && self.split == self.bodies.len()
    }

    /// Notes who came or jumped away; where they are many, the order is worth nothing.
    pub(super) fn note_late(&mut self, late: &[BodySlot], bodies: usize) {
        if (self.late.len() + late.len()) * MANY_CAME > bodies {
            self.stop();
        } else {
            self.late.extend_from_slice(late);
        }
    }

    /// Sorts some more.
    ///
    /// * `boxes` - those that it began with.
    pub(super) fn go_on(&mut self, sorter: &mut Sorter, boxes: &[[f32; 6]]) {
        if self.on {
            self.split = sorter.split_some(boxes, self.split, self.quota);
        }
    }
}

/// Ticks to split the bodies into blocks in; none: in the one that the sort begins in.
///
/// * `most` - what blocks may have grown until they are laid anew.
/// * `last` - what they grew in the last tick.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and few are taken"
)]
pub(super) fn split_ticks(most: f64, last: f64) -> usize {
    ((most / (last * LOST)) as usize).min(SPLIT_TICKS_MAX)
}

impl Order {
    /// Begins to sort the bodies by the boxes of this tick, which their lanes hold.
    ///
    /// * `ticks` - how many the sort takes after this one.
    pub(super) fn sort_ahead(&mut self, ticks: usize) {
        let ahead = &mut self.afresh.ahead;
        ahead.bodies.clear();
        self.boxes.clear();
        for (block, live) in self.live.iter().enumerate() {
            for lane in ones(*live) {
                let slot = self.slot_of[block * WIDTH + lane];
                ahead.bodies.push(BodySlot(slot));
                self.boxes.push(self.fat[block].get(lane));
            }
        }
        if self.afresh.framed >= FRAME_TICKS {
            self.sorter.frame(&self.boxes);
        }
        self.sorter.begin(&self.boxes);
        ahead.on = true;
        ahead.split = 0;
        ahead.quota = ahead.bodies.len().div_ceil(ticks.max(1));
        ahead.late.clear();
        if ticks == 0 {
            ahead.go_on(&mut self.sorter, &self.boxes);
        }
    }

    /// Deals the bodies to blocks in the order sorted ahead, by the boxes that their lanes hold, and seats who is late;
    /// `false` where there is no lane for one.
    pub(super) fn lay_ahead<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> bool {
        if self.afresh.framed >= FRAME_TICKS {
            self.look_from_the_middle(tick);
        }
        let mut ahead = std::mem::take(&mut self.afresh.ahead);
        ahead.stop();
        // Who has no lane is not dealt: who left, and who is late.
        for slot in &ahead.late {
            self.rank_of[slot.index()] = NONE;
        }
        let (sorter, mut boxes) = (
            std::mem::take(&mut self.sorter),
            std::mem::take(&mut self.boxes),
        );
        let sorted = || {
            sorter
                .sorted()
                .iter()
                .map(|(key, at)| (*key, ahead.bodies[*at as usize]))
        };
        boxes.clear();
        for (_, slot) in sorted() {
            if let Some(rank) = self.rank(slot) {
                let (block, lane) = parts(rank);
                boxes.push(self.fat[block].get(lane));
            }
        }
        self.clear_blocks(tick.members.bounded());
        let mut taken = boxes.iter();
        for (key, slot) in sorted() {
            let one = self.rank(slot).and_then(|_| taken.next());
            self.deal_to(key, FILL, one.map(|one| (slot, one)));
        }
        self.close_blocks(boxes.len());
        (self.sorter, self.boxes) = (sorter, boxes);
        // Its memory is back before room is made in it.
        self.afresh.ahead = ahead;
        self.bound_all(tick.members.bounded().len());
        let mut late = std::mem::take(&mut self.afresh.ahead.late);
        late.retain(|slot| tick.members.is_bounded(*slot));
        let all = self.seat_all(&late, tick.proxies);
        self.afresh.ahead.late = late;
        all
    }

    /// Measures everything from the middle of the boxes: they are taken once more.
    fn look_from_the_middle<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        self.afresh.framed = 0;
        let bodies = tick.members.bounded().iter();
        let now = middle(bodies.map(|slot| tick.proxies.aabb(*slot)));
        self.sorter
            .shift(std::array::from_fn(|k| now[k] - self.origin[k]));
        self.origin = now;
        // Who seems to jump by that does not: nobody asks.
        self.level.run(TakeLanes {
            order: self,
            proxies: tick.proxies,
        });
    }
}
