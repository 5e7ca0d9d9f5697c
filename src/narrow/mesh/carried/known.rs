//! What a front knows of the pair at the pose it is at.

use super::fathom::Fathomed;
use super::store::FrontStore;
use super::{CarriedFront, Containment, Goal, LeafContact};
use crate::math::Interval;

/// What is known at the pose worked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// Least lower end of the leaves queried, and least upper end, metres.
    pub(super) leaf_low: f64,
    pub(super) high: f64,
    pub(super) touches: bool,
    /// A leaf query near zero could not be finished.
    pub(super) blurred: bool,
    /// Contact points are made of leaves that touch: a verdict needs none.
    pub(super) points_wanted: bool,
    /// The last leaves have been asked at this pose.
    pub(super) asked_last: bool,
    /// A walk has set out from leaves that do not touch.
    pub(super) sought: bool,
    /// Bounds of the wholes at this pose, when they were asked for.
    pub(super) floor_m: f64,
    /// The search for contact points that is going on, by its number.
    pub(super) walks: Option<u64>,
    /// Times that the points of the last leaves were cut off.
    pub(super) cuts: u32,
    /// What was done to learn how deep leaves overlap that only just touch.
    pub(super) fathomed: Fathomed,
}

impl Default for Known {
    fn default() -> Self {
        Self {
            leaf_low: f64::INFINITY,
            high: f64::INFINITY,
            touches: false,
            blurred: false,
            points_wanted: false,
            asked_last: false,
            sought: false,
            floor_m: f64::NEG_INFINITY,
            walks: None,
            cuts: 0,
            fathomed: Fathomed::default(),
        }
    }
}

impl CarriedFront {
    /// What is known of the gap at this pose, metres: sound at any interruption.
    #[must_use]
    pub fn interval(&self) -> Interval {
        let high = self.known.high;
        let floor = self.floor_m.max(self.known.floor_m);
        let surfaces = self.surfaces_low();
        let (low, high) = match self.containment() {
            Containment::Open => (floor, high),
            Containment::Outside => (surfaces.max(floor), high),
            Containment::Inside => (floor, -surfaces.max(0.0)),
        };
        Interval::new(low.min(high), high)
    }

    /// Whether 0 in the interval of a reached goal means touching (law 3.4).
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.known.touches || (self.cover.holds_lumped() && !self.known.blurred)
    }

    /// Whether the deepest of the leaves that touch does so also where no point is farther than `off_m` from its place;
    /// false says nothing.
    pub(in crate::narrow::mesh) fn touches_despite(&self, off_m: f64) -> bool {
        let Some(leaf) = self.witness.filter(|_| self.known.touches) else {
            return false;
        };
        let found = leaf.closest;
        if leaf.triangle_a == u32::MAX || leaf.triangle_b == u32::MAX {
            return found.gap.max + off_m < 0.0;
        }
        // Of triangles that cross the depth is known, and no upper end tells it.
        -found.best_m > 4.0 * (off_m + self.at.slop)
    }

    /// The leaves with the least gap met at this pose; where one shape is within the other, with the normal that leads
    /// out.
    #[must_use]
    pub fn witness(&self) -> Option<LeafContact> {
        let witness = self.witness?;
        if self.containment() != Containment::Inside {
            return Some(witness);
        }
        let gap = self.interval();
        // Leaves farther apart than the depth can be are not the way out.
        (-witness.closest.best_m >= gap.min).then(|| witness.way_out(gap))
    }

    /// Points where leaves touch at this pose, [`crate::narrow::mesh::PATCH_POINTS`] of each patch, some twice: none
    /// until `Goal::Contacts` is asked for, those of all leaves once it is reached.
    #[must_use]
    pub fn contacts<'a>(&self, store: &'a FrontStore) -> &'a [LeafContact] {
        self.contacts.all(&store.contacts)
    }

    /// Where one shape is within the other and nothing touches: the leaves that lead out, which then stand for
    /// contacts.
    #[must_use]
    pub fn way_out(&self, store: &FrontStore) -> Option<LeafContact> {
        let within = self.contacts(store).is_empty() && self.interval().max <= 0.0;
        self.witness().filter(|_| within)
    }

    /// A lower bound on the distance of the surfaces, metres; minus infinity while they may touch.
    pub(super) fn surfaces_low(&self) -> f64 {
        if !self.cover.open.is_empty() || self.known.touches {
            return f64::NEG_INFINITY;
        }
        if self.known.blurred {
            return self.known.leaf_low.min(0.0);
        }
        self.cover.low_m().min(self.known.high)
    }

    /// What is known of it at this pose.
    pub(super) fn containment(&self) -> Containment {
        if self.known.touches {
            return Containment::Outside;
        }
        self.shells.state()
    }

    pub(super) fn reached(&self, goal: Goal) -> bool {
        if self.known.touches {
            let all = self.cover.open.is_empty() && !self.cover.has_expired();
            return !self.is_fathoming() && (all || goal < Goal::Contacts);
        }
        if !self.cover.open.is_empty() || self.cover.has_expired() {
            return false;
        }
        if self.known.blurred {
            return true;
        }
        match self.shells.state() {
            Containment::Open => false,
            // The nearest points lead out: only a contact set wants them.
            Containment::Inside if goal < Goal::Contacts => true,
            _ => {
                goal == Goal::Verdict
                    || self.cover.nearest_m() + self.fuzz_m() >= self.known.leaf_low
            }
        }
    }

    /// What cannot be told apart at this pose, metres.
    fn fuzz_m(&self) -> f64 {
        self.at.slop + self.cover.fuzz_m()
    }
}
