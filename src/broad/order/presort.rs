//! Without candidates: the bodies are sorted again over some ticks while they keep their lanes, so that no tick has all
//! the work of a layout.
//!
//! In: the boxes of one tick. Out: some ticks later, lanes along that order.
//!
//! A body that comes or jumps away in between no longer fits the order, and gets a lane after the others.

use super::afresh::FRAME_TICKS;
use super::curve::Frame;
use super::idle::shed;
use super::lay::TakeLanes;
use super::links::room;
use super::place::middle;
use super::sort::{FILL, Sorter};
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, ones, parts};
use crate::broad::members::Members;
use crate::simd::boxes::WIDTH;

/// Most ticks over which bodies are split into blocks. Measured in the gas scene of the bench: each of them then takes
/// a third longer than others; more ticks do not help, for the first one has the boxes and the curve.
pub(super) const SPLIT_TICKS_MAX: usize = 4;
/// A sort may take one in this many of the ticks that an order lasts at its present growth: the sorted order is
/// outdated by that much when it is used.
const SHARE: f64 = 3.0;

/// An order that is being sorted, or is sorted and not used yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Presort {
    on: bool,
    /// By index in the sort.
    bodies: Vec<BodySlot>,
    /// How many bodies are split into blocks, and how many more per tick.
    split: usize,
    quota: usize,
    /// The curve's frame for this sort, if it is a new one: until the layout, lanes are looked up with the old one.
    frame: Option<Frame>,
    /// Bodies that came or jumped away since it began; and how many left.
    late: Vec<BodySlot>,
    left: usize,
}

impl Presort {
    /// Reserves memory for `bodies` bodies and `late` late ones.
    pub(super) fn reserve(&mut self, bodies: usize, late: usize) {
        room(&mut self.bodies, bodies);
        room(&mut self.late, late);
    }

    /// Gives back the memory of the sort.
    pub(super) fn give_back(&mut self) {
        self.on = false;
        shed(&mut self.bodies);
    }

    /// Drops it.
    pub(super) fn stop(&mut self) {
        self.on = false;
    }

    /// Returns whether an order is being sorted, or is sorted.
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    /// Returns whether it is sorted.
    pub(super) fn is_ready(&self) -> bool {
        self.on && self.split == self.bodies.len()
    }

    /// Notes bodies that came or jumped away; if they are many, the order is dropped.
    pub(super) fn note_late(&mut self, late: &[BodySlot], bodies: usize) {
        self.on &= (self.late.len() + late.len()) * MANY_CAME <= bodies;
        if self.on {
            self.late.extend_from_slice(late);
        }
    }

    /// Notes how many left; if they are many, the order is dropped, as its blocks would be nearly empty.
    pub(super) fn note_left(&mut self, left: usize) {
        self.left += left;
        self.on &= self.left * MANY_CAME <= self.bodies.len();
    }

    /// Continues the sort.
    ///
    /// * `boxes` - the boxes that it began with.
    pub(super) fn go_on(&mut self, sorter: &mut Sorter, boxes: &[[f32; 6]]) {
        self.split = sorter.split_some(boxes, self.split, self.quota);
    }
}

/// Ticks over which to split the bodies into blocks; 0: in the tick in which the sort begins.
///
/// * `most` - excess at which bodies are laid out again.
/// * `last` - excess of the last tick.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and few are taken"
)]
pub(super) fn split_ticks(most: f64, last: f64) -> usize {
    ((most / (last * SHARE)) as usize).min(SPLIT_TICKS_MAX)
}

impl Order {
    /// Begins to sort the bodies by the boxes of this tick, as stored in their lanes.
    ///
    /// * `ticks` - how many the sort takes after this one.
    pub(super) fn begin_presort(&mut self, ticks: usize) {
        let presort = &mut self.afresh.presort;
        presort.bodies.clear();
        self.boxes.clear();
        // Allocated by the first sort of many bodies and kept: fresh pages for it cost a tenth of a tick.
        room(&mut presort.bodies, self.len);
        room(&mut self.boxes, self.len);
        for (block, live) in self.live.iter().enumerate() {
            for lane in ones(*live) {
                let slot = self.slot_of[block * WIDTH + lane];
                presort.bodies.push(BodySlot(slot));
                // Classes are by size, and a swept box is larger.
                self.boxes.push(if self.afresh.verlet.on {
                    self.exact[block * WIDTH + lane].corners()
                } else {
                    self.fat[block].get(lane)
                });
            }
        }
        let frame = self.sorter.frame;
        presort.frame = None;
        if self.afresh.framed >= FRAME_TICKS {
            self.sorter.frame = Frame::of(&self.boxes);
            // The origin is not moved while there is a list.
            if self.afresh.verlet.on && !self.sorter.frame.is_near_origin() {
                self.afresh.verlet.adrift = true;
                self.sorter.frame = frame;
                return;
            }
            presort.frame = Some(self.sorter.frame);
        }
        self.sorter.begin(&self.boxes);
        self.sorter.frame = frame;
        presort.on = true;
        presort.split = 0;
        presort.quota = presort.bodies.len().div_ceil(ticks.max(1));
        presort.late.clear();
        presort.left = 0;
        if ticks == 0 {
            presort.go_on(&mut self.sorter, &self.boxes);
        }
    }

    /// Deals the bodies to blocks in the sorted order, by the boxes in their lanes, and gives late bodies a lane;
    /// `false` if one finds none.
    pub(super) fn lay_presorted<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> bool {
        let mut presort = std::mem::take(&mut self.afresh.presort);
        presort.stop();
        if let Some(frame) = presort.frame.take() {
            self.sorter.frame = frame;
            self.afresh.framed = 0;
            if !self.afresh.verlet.on {
                self.look_from_the_middle(tick);
            }
        }
        // A body without a lane is not dealt: those that left, and late ones.
        for slot in &presort.late {
            self.rank_of[slot.index()] = NONE;
        }
        let (sorter, mut boxes) = (
            std::mem::take(&mut self.sorter),
            std::mem::take(&mut self.boxes),
        );
        let sorted = sorter.sorted();
        let sorted = sorted.map(|(key, at)| (key, presort.bodies[at as usize]));
        boxes.clear();
        for (_, slot) in sorted.clone() {
            if let Some(rank) = self.rank(slot) {
                let (block, lane) = parts(rank);
                boxes.push(self.fat[block].get(lane));
            }
        }
        self.clear_blocks(tick.members.bounded());
        let mut taken = boxes.iter();
        for (key, slot) in sorted {
            let one = self.rank(slot).and_then(|_| taken.next());
            self.deal_to(key, FILL, one.map(|one| (slot, one)));
        }
        let dealt = boxes.len();
        // Give this memory back before more is reserved in it.
        (self.sorter, self.boxes) = (sorter, boxes);
        self.afresh.presort = presort;
        self.close_blocks(dealt, tick.members.bounded().len());
        let mut late = std::mem::take(&mut self.afresh.presort.late);
        late.retain(|slot| tick.members.is_bounded(*slot));
        let all = self.seat_all(&late, tick.proxies);
        self.afresh.presort.late = late;
        all
    }

    /// Moves the origin to the middle of the boxes: they are read once more.
    fn look_from_the_middle<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        let now = middle(tick.members.bounded(), tick.proxies);
        let by = std::array::from_fn(|k| now[k] - self.origin[k]);
        self.sorter.frame.shift(by);
        self.origin = now;
        // Bodies that seem to jump because of the new origin do not: the result is ignored.
        self.level.run(TakeLanes {
            order: self,
            proxies: tick.proxies,
        });
    }

    /// Checks that each body with a lane is sorted, once, or late: any other would keep a lane in blocks that are dealt
    /// again.
    pub(super) fn check_presort(&self, members: &Members) -> Result<(), String> {
        let presort = &self.afresh.presort;
        if !presort.on {
            return Ok(());
        }
        let sorted = self.sorter.sorted().map(|(_, at)| at as usize);
        let mut indices: Vec<usize> = sorted.collect();
        indices.sort_unstable();
        let all = presort.bodies.len();
        if !indices.into_iter().eq(0..all) || self.boxes.len() != all || presort.split > all {
            return Err(format!("{all} bodies are sorted ahead, and not each once"));
        }
        let mut known: Vec<u32> = presort.bodies.iter().map(|slot| slot.0).collect();
        known.sort_unstable();
        if known.windows(2).any(|two| two[0] == two[1]) {
            return Err("a body is sorted ahead twice".into());
        }
        known.extend(presort.late.iter().map(|slot| slot.0));
        known.sort_unstable();
        let lost = members.bounded().iter();
        match lost
            .copied()
            .find(|slot| known.binary_search(&slot.0).is_err())
        {
            Some(slot) => Err(format!("{slot:?} is neither sorted ahead nor late")),
            None => Ok(()),
        }
    }
}
