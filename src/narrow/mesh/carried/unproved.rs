//! What a front has not proved apart at a given pose: where a pair may still touch.

use super::{CarriedFront, Containment, FrontStore, LeafContact, trees_of};
use crate::math::Pose;
use crate::narrow::bent::Bent;
use crate::narrow::mesh::PATCH_POINTS;
use crate::narrow::mesh::placed::moved;
use crate::shape::{BoxId, Shape};

impl CarriedFront {
    /// Distance of the pair from the front's pose and vertices, metres, rounded up; 0: it is there.
    pub(in crate::narrow) fn moved_m(&self, a: &Shape, b: &Shape, pos12: &Pose) -> f64 {
        let by_pose = if self.at.pos12 == *pos12 {
            0.0
        } else {
            moved(a, b, &self.at.pos12, pos12)
        };
        let bent_m = Bent::of_shapes(a, b).since_m(&self.bent);
        if bent_m > 0.0 {
            (by_pose + bent_m).next_up()
        } else {
            by_pose
        }
    }

    /// Whether the boxes that it names belong to the shapes' present trees.
    pub(in crate::narrow::mesh) fn names_boxes_of(&self, a: &Shape, b: &Shape) -> bool {
        self.trees == trees_of(a, b)
    }

    /// Visits every pair of boxes that is not proved apart at a pose `moved_m` away from the front's. All that the two
    /// surfaces share at that pose is below these.
    ///
    /// * returns - false if some pairs were lumped together, so that they are no longer known: then nothing is visited.
    pub(in crate::narrow::mesh) fn unproved(
        &self,
        store: &FrontStore,
        moved_m: f64,
        visit: impl FnMut(BoxId, BoxId),
    ) -> bool {
        self.cover.unproved(&store.entries, moved_m, visit)
    }

    /// Contacts found at the front's own pose, two of each patch; none at another pose.
    pub(in crate::narrow) fn found_at<'a>(
        &'a self,
        store: &'a FrontStore,
        pos12: &Pose,
    ) -> impl Iterator<Item = &'a LeafContact> {
        let here = self.at.pos12 == *pos12;
        let all = if here { self.contacts(store) } else { &[] };
        all.chunks(PATCH_POINTS)
            .flat_map(|patch| patch.iter().take(2))
    }

    /// Whether it is proved that no connected surface of one lies entirely within the other, at a pose `moved_m` away
    /// from the front's.
    ///
    /// * `single` - each has one connected surface: if the two touch at the front's own pose, neither contains the
    ///   other's. Of several surfaces one may touch, and another lie within.
    pub(in crate::narrow::mesh) fn holds_none(&self, moved_m: f64, single: bool) -> bool {
        let outside = self.shells.state() == Containment::Outside
            && self.cover.drift.left_m(self.shells_expiry_m) > moved_m;
        let touches = moved_m == 0.0 && self.known.touches;
        !self.solids || outside || (single && touches)
    }
}
