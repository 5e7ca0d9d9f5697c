//! The proofs of a pair: every pair of leaves is covered by exactly one entry at any time, at any pose.
//!
//! In: gaps of boxes at the current pose. Out: the next boxes to open, a sound bound on all of them. An entry is
//! - a [`Group`] of pairs of boxes proved apart by `g` when the pair's path was `M`: it holds while the path is less
//!   than `g + M`, at no cost. The group that expires soonest is on top of a heap, so the heap is the front, the
//!   best-first queue and the bound at once;
//! - an open pair of boxes that may touch;
//! - a group apart at this pose by less than can be carried to another, or a pair of leaves found touching: at the next
//!   pose it is open again;
//! - everything lumped together when there was no room: one expiry for all of it, after which the pair starts over.
//!
//! The user defines what boxes and leaves are: triangles of two meshes (`mesh/carried`), shapes of two bodies
//! (`compound`).

mod drift;
mod entry;
mod validate;
mod wear;

pub(super) use drift::Drift;
pub use entry::Search;
pub(super) use entry::{Group, Open, OpenList, Proved, lanes};
pub(super) use wear::Wear;

use crate::math::{Pose, ROUND};
use crate::shape::BoxId;
use crate::simd::obb::LANES;
use crate::time::Meter;

use super::arena::{Arena, Run};

/// The entries of all pairs.
#[derive(Debug)]
pub(super) struct Entries {
    pub(super) groups: Arena<Group>,
    pub(super) open: Arena<Open>,
}

impl Entries {
    /// Room for at most this many entries of all pairs together.
    pub(super) fn with_room(groups: usize, open: usize) -> Self {
        Self {
            groups: Arena::new(groups),
            open: Arena::new(open),
        }
    }

    /// See `Arena::touch_ahead`.
    pub(super) fn touch_ahead(&mut self, meter: &mut Meter<'_>) {
        self.groups.touch_ahead(meter);
        self.open.touch_ahead(meter);
    }

    /// Bytes of all blocks, free ones included.
    pub(super) fn bytes(&self) -> usize {
        self.groups.bytes() + self.open.bytes()
    }
}

/// The entries of one pair, used with one [`Entries`] until it is released.
#[derive(Debug)]
pub(super) struct Cover {
    pub(super) drift: Drift,
    pub(super) proved: Proved,
    pub(super) open: OpenList,
    /// Groups apart at this pose (their expiry is the gap), but by too little to be certified at another.
    pub(super) passing: Run,
    /// Their least gap, metres; infinite: there are none.
    passing_m: f64,
    /// Leaves found touching at this pose.
    pub(super) touching: Run,
    /// Expiry of the lumped entries; infinite: there are none; minus infinity: an entry found no room at all, and
    /// nothing is proved until the next start.
    lumped_expiry_m: f64,
}

impl Default for Cover {
    fn default() -> Self {
        Self {
            drift: Drift::default(),
            proved: Proved::default(),
            open: OpenList::default(),
            passing: Run::default(),
            passing_m: f64::INFINITY,
            touching: Run::default(),
            lumped_expiry_m: f64::INFINITY,
        }
    }
}

impl Cover {
    /// Forgets everything: at this pose these pairs of roots, which everything is below, are open.
    pub(super) fn start(
        &mut self,
        entries: &mut Entries,
        (pose, search): (&Pose, Search),
        roots: impl Iterator<Item = (BoxId, BoxId)>,
    ) {
        self.drift = Drift::at(pose);
        self.proved.clear();
        self.passing.clear();
        self.passing_m = f64::INFINITY;
        self.open.clear(search);
        self.touching.clear();
        self.lumped_expiry_m = f64::INFINITY;
        for (a, b) in roots {
            self.look_into(entries, Open { low: 0.0, a, b });
        }
    }

    /// Releases its memory.
    pub(super) fn release(&mut self, entries: &mut Entries) {
        self.proved.release(&mut entries.groups);
        entries.groups.release(&mut self.passing);
        self.open.release(&mut entries.open);
        entries.open.release(&mut self.touching);
    }

    /// Entries held, open or proved.
    pub(super) fn len(&self) -> usize {
        self.proved.len() + self.open.len() + self.passing.len() + self.touching.len()
    }

    /// Whether some entries were lumped together.
    pub(super) fn is_lumped(&self) -> bool {
        self.lumped_expiry_m < f64::INFINITY
    }

    /// Whether the lumped entries are no longer proved apart, so that only a new start helps.
    pub(super) fn is_lost(&self) -> bool {
        self.is_lumped() && !self.holds_lumped()
    }

    /// Whether the lumped entries, if any, are still proved apart.
    pub(super) fn holds_lumped(&self) -> bool {
        self.drift.left_m(self.lumped_expiry_m) > 0.0
    }

    /// The pair has come to another pose: entries that held only at the previous one are retested.
    pub(super) fn arrive(&mut self, entries: &mut Entries) {
        self.ask_touching_again(entries);
        while let Some(group) = entries.groups.pop(&mut self.passing) {
            self.prove(entries, group.expired());
        }
        self.passing_m = f64::INFINITY;
    }

    /// Leaves that were found touching are opened again.
    pub(super) fn ask_touching_again(&mut self, entries: &mut Entries) {
        while let Some(touching) = entries.open.pop(&mut self.touching) {
            self.look_into(entries, touching);
        }
    }

    /// Sets an anchor at this pose: what is found from here on holds at it exactly.
    pub(super) fn anchor_here(&mut self, entries: &mut Entries, pose: &Pose) {
        if !self.drift.anchor_here(pose) {
            return;
        }
        self.passing_m = f64::INFINITY;
        for at in (0..self.passing.len()).rev() {
            // What does not outlast this pose after all is put back, behind the entries that are still to come.
            if let Some(group) = entries.groups.swap_remove(&mut self.passing, at) {
                self.keep(entries, group, group.expiry_m);
            }
        }
    }

    /// Applies the result of a group's test: pairs that are apart form a group again, pairs that may touch are opened,
    /// the deepest on top.
    ///
    /// * `gaps` - of the group's pairs at this pose, lane by lane.
    /// * `known_m` - a bound that holds for the whole group at this pose.
    pub(super) fn take(
        &mut self,
        entries: &mut Entries,
        group: &Group,
        gaps: [f64; LANES],
        known_m: f64,
    ) {
        let gaps = gaps.map(|gap| gap.max(known_m));
        let (mut apart, mut least) = (0_u8, f64::INFINITY);
        // Entries that would not outlast this pose are opened: smaller boxes are farther apart. Branch-free: which of
        // them are apart is practically random.
        let lasting_m = if known_m > 0.0 {
            f64::NEG_INFINITY
        } else {
            self.drift.lasting_m()
        };
        for (lane, &gap) in gaps.iter().enumerate() {
            let is_apart = (gap > lasting_m) & (group.mask >> lane & 1 == 1);
            apart |= u8::from(is_apart) << lane;
            least = if is_apart { least.min(gap) } else { least };
        }
        let mut deep = [(0.0, 0_u32); LANES];
        let mut count = 0;
        for lane in lanes(group.mask & !apart) {
            let gap = gaps[lane as usize];
            // Insertion sort: the deepest last.
            let mut at = count;
            while at > 0 && deep[at - 1].0 < gap {
                deep[at] = deep[at - 1];
                at -= 1;
            }
            deep[at] = (gap, lane);
            count += 1;
        }
        if apart != 0 {
            let mask = apart;
            self.keep(entries, Group { mask, ..*group }, least);
        }
        for &(low, lane) in &deep[..count] {
            let (a, b) = group.pair(lane);
            self.look_into(entries, Open { low, a, b });
        }
    }

    /// Keeps all of a group except its nearest pair, which is returned with its gap.
    ///
    /// * `gaps` - of the group's pairs at this pose, lane by lane.
    pub(super) fn part_nearest(
        &mut self,
        entries: &mut Entries,
        group: &Group,
        gaps: &[f64; LANES],
    ) -> ((BoxId, BoxId), f64) {
        let (mut nearest, mut rest_m) = (group.mask.trailing_zeros(), f64::INFINITY);
        for lane in lanes(group.mask) {
            if gaps[lane as usize] < gaps[nearest as usize] {
                nearest = lane;
            }
        }
        let mask = group.mask & !(1 << nearest);
        for lane in lanes(mask) {
            rest_m = rest_m.min(gaps[lane as usize]);
        }
        if mask != 0 {
            self.keep(entries, Group { mask, ..*group }, rest_m);
        }
        (group.pair(nearest), gaps[nearest as usize])
    }

    /// Keeps a group that is apart by `gap` at this pose; if there is no room, only its expiry.
    pub(super) fn keep(&mut self, entries: &mut Entries, group: Group, gap: f64) {
        match self.drift.expiry(gap) {
            Some(expiry_m) => self.prove(entries, Group { expiry_m, ..group }),
            None if gap > 0.0 => {
                self.passing_m = self.passing_m.min(gap);
                let expiry_m = gap;
                let kept = (entries.groups).push(&mut self.passing, Group { expiry_m, ..group });
                self.note_room(kept);
            }
            // Not apart after all: open every pair, so that it stays covered.
            None => {
                for lane in lanes(group.mask) {
                    let (a, b) = group.pair(lane);
                    self.look_into(entries, Open { low: gap, a, b });
                }
            }
        }
    }

    /// Stores a group until it expires.
    fn prove(&mut self, entries: &mut Entries, group: Group) {
        if !self.proved.push(&mut entries.groups, group) {
            self.lumped_expiry_m = self.lumped_expiry_m.min(group.expiry_m);
        }
    }

    /// Stores a pair that may touch.
    pub(super) fn look_into(&mut self, entries: &mut Entries, open: Open) {
        let kept = self.open.push(&mut entries.open, open);
        self.note_room(kept);
    }

    /// Stores a pair of leaves that was found touching at this pose.
    pub(super) fn touch(&mut self, entries: &mut Entries, touching: Open) {
        let kept = entries.open.push(&mut self.touching, touching);
        self.note_room(kept);
    }

    /// An entry that found no room is no longer covered: nothing is proved until the next start.
    fn note_room(&mut self, kept: bool) {
        if !kept {
            self.lumped_expiry_m = f64::NEG_INFINITY;
        }
    }

    /// A lower bound on the gap of all that is proved apart at this pose, metres; minus infinity if some of it is not.
    pub(super) fn low_m(&self) -> f64 {
        let soonest_m = self.proved.soonest_m().min(self.lumped_expiry_m);
        let proved = self.drift.left_m(soonest_m).min(self.passing_m);
        if proved > 0.0 {
            proved
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Whether the soonest group is no longer proved apart.
    pub(super) fn has_expired(&self) -> bool {
        self.nearest_m() <= 0.0
    }

    /// The least bound of the groups that can still be opened, metres.
    pub(super) fn nearest_m(&self) -> f64 {
        self.drift.left_m(self.proved.soonest_m())
    }

    /// Expiries closer together than this cannot be distinguished, metres.
    pub(super) fn fuzz_m(&self) -> f64 {
        16.0 * ROUND * self.drift.path_m
    }

    /// Visits every pair of boxes that is not proved apart at a pose `moved_m` away from the current one. All that the
    /// two share at that pose is below these.
    ///
    /// * returns - false if some pairs were lumped together, so that they are no longer known: then nothing is visited.
    pub(super) fn unproved(
        &self,
        entries: &Entries,
        moved_m: f64,
        mut visit: impl FnMut(BoxId, BoxId),
    ) -> bool {
        if self.drift.left_m(self.lumped_expiry_m) <= moved_m {
            return false;
        }
        for open in self.unsettled(entries) {
            visit(open.a, open.b);
        }
        // For passing groups, the expiry is their gap at this pose.
        let passing = entries.groups.all(&self.passing).iter();
        let passed = passing.filter(|group| group.expiry_m <= moved_m);
        let any = self.nearest_m() <= moved_m;
        let proved = if any {
            entries.groups.all(&self.proved.heap)
        } else {
            &[]
        };
        let expired = (proved.iter()).filter(|group| self.drift.left_m(group.expiry_m) <= moved_m);
        for group in passed.chain(expired) {
            for lane in lanes(group.mask) {
                let (a, b) = group.pair(lane);
                visit(a, b);
            }
        }
        true
    }

    /// Visits every pair of boxes that is covered; `false` if some were lumped together because there was no room.
    pub(super) fn visit_all(&self, entries: &Entries, mut visit: impl FnMut(BoxId, BoxId)) -> bool {
        if self.is_lumped() {
            return false;
        }
        let groups = [&self.proved.heap, &self.passing].map(|run| entries.groups.all(run));
        for group in groups.into_iter().flatten() {
            for lane in lanes(group.mask) {
                let (a, b) = group.pair(lane);
                visit(a, b);
            }
        }
        for open in self.unsettled(entries) {
            visit(open.a, open.b);
        }
        true
    }

    /// Pairs of boxes that may touch, and leaves that do.
    fn unsettled<'a>(&self, entries: &'a Entries) -> impl Iterator<Item = &'a Open> + use<'a> {
        let pairs = [
            self.open.all(&entries.open),
            entries.open.all(&self.touching),
        ];
        pairs.into_iter().flatten()
    }
}
