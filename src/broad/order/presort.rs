//! Without candidates: the bodies are sorted anew over some ticks while they stay in their lanes, so that no tick has
//! all the work of laying.
//!
//! In: the boxes of one tick. Out: some ticks later, lanes along the order that they were sorted into.
//!
//! Who comes or jumps away in between belongs elsewhere than it was sorted to, and is seated behind the others.

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

/// Ticks that the bodies are split into blocks in, at most. Measured in the gas of the bench: each then takes a third
/// longer than others; with more ticks no less, for the first one has the boxes and the curve.
pub(super) const SPLIT_TICKS_MAX: usize = 4;
/// A sort may take one in so many of the ticks that an order lasts at its present growth: what is sorted is by so much
/// out of date when it is laid.
const SHARE: f64 = 3.0;

/// An order that is being sorted, or sorted and not laid yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Presort {
    on: bool,
    /// By index in the sort.
    bodies: Vec<BodySlot>,
    /// How many are split into blocks, and how many more in each tick.
    split: usize,
    quota: usize,
    /// The frame of the curve that it is sorted by, where that is a new one: until it is laid, lanes are looked for by
    /// the one before.
    frame: Option<Frame>,
    /// Who came or jumped away since it began; and how many left.
    late: Vec<BodySlot>,
    left: usize,
}

impl Presort {
    /// Room for so many bodies, some of them late.
    pub(super) fn reserve(&mut self, bodies: usize, late: usize) {
        room(&mut self.bodies, bodies);
        room(&mut self.late, late);
    }

    /// Gives back what it is sorted in.
    pub(super) fn give_back(&mut self) {
        self.on = false;
        shed(&mut self.bodies);
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
        self.on &= (self.late.len() + late.len()) * MANY_CAME <= bodies;
        if self.on {
            self.late.extend_from_slice(late);
        }
    }

    /// Notes how many left; where they are many, their blocks would be all but empty.
    pub(super) fn note_left(&mut self, left: usize) {
        self.left += left;
        self.on &= self.left * MANY_CAME <= self.bodies.len();
    }

    /// Sorts some more.
    ///
    /// * `boxes` - those that it began with.
    pub(super) fn go_on(&mut self, sorter: &mut Sorter, boxes: &[[f32; 6]]) {
        self.split = sorter.split_some(boxes, self.split, self.quota);
    }
}

/// Ticks to split the bodies into blocks in; none: in the one that the sort begins in.
///
/// * `most` - how much more than usual is asked before they are laid anew.
/// * `last` - how much the last tick asked.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and few are taken"
)]
pub(super) fn split_ticks(most: f64, last: f64) -> usize {
    ((most / (last * SHARE)) as usize).min(SPLIT_TICKS_MAX)
}

impl Order {
    /// Begins to sort the bodies by the boxes of this tick, which their lanes hold.
    ///
    /// * `ticks` - how many the sort takes after this one.
    pub(super) fn begin_presort(&mut self, ticks: usize) {
        let presort = &mut self.afresh.presort;
        presort.bodies.clear();
        self.boxes.clear();
        // Made by the first sort of many bodies and kept: fresh pages for it are a tenth of a tick.
        room(&mut presort.bodies, self.len);
        room(&mut self.boxes, self.len);
        for (block, live) in self.live.iter().enumerate() {
            for lane in ones(*live) {
                let slot = self.slot_of[block * WIDTH + lane];
                presort.bodies.push(BodySlot(slot));
                // By size, and a swept box is larger.
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
            // To measure from elsewhere is not done with a list.
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

    /// Deals the bodies to blocks in the order that was sorted, by the boxes that their lanes hold, and seats who is
    /// late; `false` where there is no lane for one.
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
        // Who has no lane is not dealt: who left, and who is late.
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
        // Their memory is back before room is made in it.
        (self.sorter, self.boxes) = (sorter, boxes);
        self.afresh.presort = presort;
        self.close_blocks(dealt, tick.members.bounded().len());
        let mut late = std::mem::take(&mut self.afresh.presort.late);
        late.retain(|slot| tick.members.is_bounded(*slot));
        let all = self.seat_all(&late, tick.proxies);
        self.afresh.presort.late = late;
        all
    }

    /// Measures everything from the middle of the boxes: they are taken once more.
    fn look_from_the_middle<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        let now = middle(tick.members.bounded(), tick.proxies);
        let by = std::array::from_fn(|k| now[k] - self.origin[k]);
        self.sorter.frame.shift(by);
        self.origin = now;
        // Who seems to jump by that does not: nobody asks.
        self.level.run(TakeLanes {
            order: self,
            proxies: tick.proxies,
        });
    }

    /// Whoever has a lane is sorted, once, or late: who was neither would keep a lane in blocks that are dealt anew.
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
