//! What a front has not proved apart, at whatever pose: where a pair may still touch.

use super::{CarriedFront, Containment, FrontStore, LeafContact, trees_of};
use crate::math::Pose;
use crate::narrow::bent::Bent;
use crate::narrow::mesh::PATCH_POINTS;
use crate::narrow::mesh::placed::moved;
use crate::shape::{BoxId, Shape};

impl CarriedFront {
    /// How far the pair is from the pose and the vertices that the front works at, metres, rounded up; 0: it is there.
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

    /// Whether the boxes that it names are those of the trees that the shapes have now.
    pub(in crate::narrow::mesh) fn names_boxes_of(&self, a: &Shape, b: &Shape) -> bool {
        self.trees == trees_of(a, b)
    }

    /// Visits every pair of boxes that is not proved apart at a pose `moved_m` away from the front's. All that the two
    /// surfaces share at that pose is under these.
    ///
    /// * returns - false where some pairs were lumped together and are not known any more: then nothing is visited.
    pub(in crate::narrow::mesh) fn unproved(
        &self,
        store: &FrontStore,
        moved_m: f64,
        visit: impl FnMut(BoxId, BoxId),
    ) -> bool {
        self.cover.unproved(&store.entries, moved_m, visit)
    }

    /// Contacts found at the front's own pose if it is there, two of each patch; none elsewhere.
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

    /// Whether no surface of the one is known to lie, or can lie, within the other as a whole, at a pose `moved_m` away
    /// from the front's.
    ///
    /// * `single` - each has one connected surface: where the two touch at the front's own pose, neither holds the
    ///   other's. Of several one may touch, and another lie within.
    pub(in crate::narrow::mesh) fn holds_none(&self, moved_m: f64, single: bool) -> bool {
        let outside = self.shells.state() == Containment::Outside
            && self.cover.drift.left_m(self.shells_expiry_m) > moved_m;
        let touches = moved_m == 0.0 && self.known.touches;
        !self.solids || outside || (single && touches)
    }
}
