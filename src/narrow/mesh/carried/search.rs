//! One step of work on a front: a box against a pack, two leaves, or a node of an inside test.

use super::cover::{Group, Open, lanes};
use super::leaves::{LEAF_COST, contact};
use super::store::FrontStore;
use super::{BoxId, CarriedFront, Containment, Goal, Side};
use crate::narrow::mesh::side;
use crate::shape::Held;
use crate::simd::obb::LANES;
use crate::time::Meter;

impl CarriedFront {
    pub(super) fn step(
        &mut self,
        store: &mut FrontStore,
        (a, b): (Side<'_>, Side<'_>),
        goal: Goal,
        meter: &mut Meter<'_>,
    ) {
        let gap_wanted = goal > Goal::Verdict;
        self.steps += 1;
        if gap_wanted && !std::mem::replace(&mut self.known.asked_last, true) {
            self.bound_by_last(a, b);
            meter.charge_weighted(1, LEAF_COST);
        } else if let Some(open) = self.open.pop(&mut store.open) {
            self.expand(store, &open, (a, b), gap_wanted, meter);
        } else if self.has_expired() {
            if let Some(group) = self.proved.pop(&mut store.groups) {
                self.retest(store, &group, (a, b), gap_wanted, meter);
            }
        } else if self.shells.state() == Containment::Open {
            self.shells.step(a, b, &self.at);
            meter.charge(1);
        } else {
            self.refine(store, (a, b), meter);
        }
        self.note_apart();
    }

    /// Where the surfaces are apart, what is known of the insides, and what is asked of them at this pose, holds as
    /// long as they stay so.
    fn note_apart(&mut self) {
        if self.known.touches {
            // Whatever the next pose is, insides must be asked again.
            self.shells_expiry_m = f64::NEG_INFINITY;
            return;
        }
        let low = self.surfaces_low();
        if low <= 0.0 {
            return;
        }
        if self.fresh_len == 0 {
            self.fresh_len = self.len();
            self.fresh_steps = self.steps;
        }
        let expiry_m = self.drift.expiry(low).unwrap_or(f64::NEG_INFINITY);
        self.shells_expiry_m = self.shells_expiry_m.max(expiry_m);
    }

    /// The leaves that were nearest last are near still: their distance spares most others the question.
    fn bound_by_last(&mut self, a: Side<'_>, b: Side<'_>) {
        let Some((leaf_a, leaf_b)) = self.last else {
            return;
        };
        if let (Held::Triangle(i), Held::Triangle(j)) = (a.held(leaf_a), b.held(leaf_b))
            && let Ok(closest) = side::leaf((a, i), (b, j), &self.at, f64::INFINITY)
        {
            // No more than the distance of two points: what else it says is said when its entry's turn comes.
            self.known.high = self.known.high.min(closest.gap.max.max(0.0));
            self.witness = Some(contact((a, i), (b, j), closest));
        }
    }

    /// Replaces an open pair of boxes by smaller ones, or queries two leaves.
    fn expand(
        &mut self,
        store: &mut FrontStore,
        open: &Open,
        (a, b): (Side<'_>, Side<'_>),
        exact: bool,
        meter: &mut Meter<'_>,
    ) {
        let child = match (a.held(open.a), b.held(open.b)) {
            (Held::Triangle(held_a), Held::Triangle(held_b)) => {
                let places = (open.a, open.b);
                self.leaves(store, places, (a, b), f64::NEG_INFINITY, exact, meter);
                if !exact && !self.known.touches {
                    self.seek([held_a, held_b], (a, b), meter);
                }
                return;
            }
            (held_a, held_b) => self.children((open.a, held_a), (open.b, held_b), (a, b)),
        };
        self.test(store, &child, (a, b), f64::NEG_INFINITY);
        meter.charge(1);
    }

    /// The box that stays and the pack that takes the other's place: the larger is parted, so that both shrink alike.
    fn children(
        &self,
        (id_a, held_a): (BoxId, Held),
        (id_b, held_b): (BoxId, Held),
        (a, b): (Side<'_>, Side<'_>),
    ) -> Group {
        let part_b = match (held_a, held_b) {
            (Held::Pack(_), Held::Pack(_)) => {
                b.size(id_b, &self.whole[1]) > a.size(id_a, &self.whole[0])
            }
            (held_a, _) => matches!(held_a, Held::Triangle(_)),
        };
        let (one, parted, side) = if part_b {
            (id_a, held_b, b)
        } else {
            (id_b, held_a, a)
        };
        let pack = match parted {
            Held::Pack(pack) => pack,
            // Not reached: of two leaves none is parted.
            Held::Triangle(_) => 0,
        };
        Group {
            expiry_m: f64::NEG_INFINITY,
            one,
            pack,
            mask: side.pack(pack).map_or(0, |p| p.mask),
            pack_is_b: part_b,
            leaf: false,
        }
    }

    /// The gaps of a group's pairs at this pose.
    fn gaps(&self, group: &Group, (a, b): (Side<'_>, Side<'_>)) -> [f64; LANES] {
        let (one, other) = if group.pack_is_b {
            (a.obb(group.one, &self.whole[0]), b)
        } else {
            (b.obb(group.one, &self.whole[1]), a)
        };
        match other.pack(group.pack) {
            Some(pack) => self.at.gaps(&one, pack, group.pack_is_b),
            None => [f64::NEG_INFINITY; LANES],
        }
    }

    /// Tests a group: what is apart is a group again, what may touch is open, the deepest on top.
    ///
    /// * `known_m` - a bound that holds for all of it at this pose.
    fn test(
        &mut self,
        store: &mut FrontStore,
        group: &Group,
        sides: (Side<'_>, Side<'_>),
        known_m: f64,
    ) {
        let gaps = self.gaps(group, sides).map(|gap| gap.max(known_m));
        let (mut apart, mut least) = (0_u8, f64::INFINITY);
        // What would not outlast this pose is looked into: smaller boxes are farther apart. Without a branch: which of
        // them are apart is as good as random.
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
            // Sorted in: the deepest last.
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
            self.keep(store, Group { mask, ..*group }, least);
        }
        for &(low, lane) in &deep[..count] {
            let (a, b) = group.pair(lane);
            self.look_into(store, Open { low, a, b });
        }
    }

    /// Keeps a group that is apart by `gap` at this pose; where there is no room, only its expiry.
    pub(super) fn keep(&mut self, store: &mut FrontStore, group: Group, gap: f64) {
        match self.drift.expiry(gap) {
            Some(expiry_m) => self.prove(store, Group { expiry_m, ..group }),
            None if gap > 0.0 => {
                self.passing_m = self.passing_m.min(gap);
                let expiry_m = gap;
                let kept = (store.groups).push(&mut self.passing, Group { expiry_m, ..group });
                self.note_room(kept);
            }
            // Not apart after all: every pair stays covered.
            None => {
                for lane in lanes(group.mask) {
                    let (a, b) = group.pair(lane);
                    self.look_into(store, Open { low: gap, a, b });
                }
            }
        }
    }

    /// Takes a group in until it expires.
    pub(super) fn prove(&mut self, store: &mut FrontStore, group: Group) {
        if !self.proved.push(&mut store.groups, group) {
            self.lumped_expiry_m = self.lumped_expiry_m.min(group.expiry_m);
        }
    }

    /// Takes a pair in that may touch.
    pub(super) fn look_into(&mut self, store: &mut FrontStore, open: Open) {
        let kept = self.open.push(&mut store.open, open);
        self.note_room(kept);
    }

    /// What found no room is no longer covered: then nothing is proved until the next start.
    pub(super) fn note_room(&mut self, kept: bool) {
        if !kept {
            self.lumped_expiry_m = f64::NEG_INFINITY;
        }
    }

    /// Tests a group whose proof has expired.
    fn retest(
        &mut self,
        store: &mut FrontStore,
        group: &Group,
        sides: (Side<'_>, Side<'_>),
        exact: bool,
        meter: &mut Meter<'_>,
    ) {
        if group.leaf {
            let pair = group.pair(group.mask.trailing_zeros());
            self.leaves(store, pair, sides, f64::NEG_INFINITY, exact, meter);
        } else {
            self.test(store, group, sides, f64::NEG_INFINITY);
            meter.charge(1);
        }
    }

    /// Looks into the nearest of all groups: best first.
    fn refine(
        &mut self,
        store: &mut FrontStore,
        sides: (Side<'_>, Side<'_>),
        meter: &mut Meter<'_>,
    ) {
        let Some(group) = self.proved.pop(&mut store.groups) else {
            return;
        };
        // What is stored holds at this pose; a new test may be lower by rounding.
        let known_m = self.drift.left_m(group.expiry_m);
        if group.leaf {
            let pair = group.pair(group.mask.trailing_zeros());
            return self.leaves(store, pair, sides, known_m, true, meter);
        }
        let mut gaps = self.gaps(&group, sides);
        for gap in &mut gaps {
            *gap = gap.max(known_m);
        }
        let (mut nearest, mut rest_m) = (group.mask.trailing_zeros(), f64::INFINITY);
        for lane in lanes(group.mask) {
            if gaps[lane as usize] < gaps[nearest as usize] {
                nearest = lane;
            }
        }
        let rest = group.mask & !(1 << nearest);
        for lane in lanes(rest) {
            rest_m = rest_m.min(gaps[lane as usize]);
        }
        if rest != 0 {
            self.keep(
                store,
                Group {
                    mask: rest,
                    ..group
                },
                rest_m,
            );
        }
        let (id_a, id_b) = group.pair(nearest);
        let known_m = gaps[nearest as usize];
        match (sides.0.held(id_a), sides.1.held(id_b)) {
            (Held::Triangle(_), Held::Triangle(_)) => {
                self.leaves(store, (id_a, id_b), sides, known_m, true, meter);
                meter.charge(1);
            }
            (held_a, held_b) => {
                let child = self.children((id_a, held_a), (id_b, held_b), sides);
                self.test(store, &child, sides, known_m);
                meter.charge(2);
            }
        }
    }
}
