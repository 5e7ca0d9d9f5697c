//! What a front knows of the pair at its pose.

use super::fathom::Fathomed;
use super::store::FrontStore;
use super::{CarriedFront, Containment, Goal, LeafContact};
use crate::math::Interval;

/// What is known at the current pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// Least lower end of the leaves queried, and least upper end, metres.
    pub(super) leaf_low: f64,
    pub(super) high: f64,
    pub(super) touches: bool,
    /// A leaf query near zero could not be finished.
    pub(super) blurred: bool,
    /// Contact points are to be made of leaves that touch: a verdict needs none.
    pub(super) points_wanted: bool,
    /// The last leaves have been queried at this pose.
    pub(super) asked_last: bool,
    /// A walk was started from leaves that do not touch.
    pub(super) sought: bool,
    /// Bound on the gap of the whole shapes at this pose, if it was computed.
    pub(super) floor_m: f64,
    /// The number of the contact point search in progress.
    pub(super) walks: Option<u64>,
    /// How often the search for the points of the last leaves was cut off.
    pub(super) cuts: u32,
    /// Work done to find the depth of leaves that barely touch.
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
    /// Interval of the gap at this pose, metres: sound at any interruption.
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

    /// Whether the deepest of the touching leaves still touches if points are displaced by up to `off_m`; false proves
    /// nothing.
    pub(in crate::narrow::mesh) fn touches_despite(&self, off_m: f64) -> bool {
        let Some(leaf) = self.witness.filter(|_| self.known.touches) else {
            return false;
        };
        let found = leaf.closest;
        if leaf.triangle_a == u32::MAX || leaf.triangle_b == u32::MAX {
            return found.gap.max + off_m < 0.0;
        }
        // For crossing triangles the depth is known, but no upper end shows it.
        -found.best_m > 4.0 * (off_m + self.at.slop)
    }

    /// The leaves with the least gap found at this pose; if one shape is within the other, with the normal that leads
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

    /// Points where leaves touch at this pose, [`crate::narrow::mesh::PATCH_POINTS`] of each patch, with duplicates:
    /// none until `Goal::Contacts` is wanted, those of all leaves once it is reached.
    #[must_use]
    pub fn contacts<'a>(&self, store: &'a FrontStore) -> &'a [LeafContact] {
        self.contacts.all(&store.contacts)
    }

    /// If one shape is within the other and nothing touches: the leaves that lead out, which then replace contacts.
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

    /// Whether one lies within the other, as far as known at this pose.
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
            // The nearest points lead out: only a contact set needs them.
            Containment::Inside if goal < Goal::Contacts => true,
            _ => {
                goal == Goal::Verdict
                    || self.cover.nearest_m() + self.fuzz_m() >= self.known.leaf_low
            }
        }
    }

    /// Gaps closer than this cannot be distinguished at this pose, metres.
    fn fuzz_m(&self) -> f64 {
        self.at.slop + self.cover.fuzz_m()
    }
}
