//! Where two shapes may touch, at any pose: pairs of boxes and what they share.
//!
//! In: two shapes of which at least one is a mesh and none a half-space, or a mesh and a half-space, and what a front
//! has not proved. Out: spots that hold all that the two surfaces share, the largest split first while tests last.

use std::collections::BinaryHeap;

use super::placed::Placed;
use super::retest::tree_of;
use super::shared::shared;
use super::side::Side;
use super::{CarriedFront, FrontStore};
use crate::math::{Point, Pose, ROUND, Vec3, f32_up};
use crate::narrow::approx::{Slab, Spot};
use crate::narrow::cover::lanes;
use crate::shape::{BoxId, Cone, Held, Mesh, Obb, Shape};
use crate::simd::obb::LANES;

/// Most shells of a shape that are tested one by one for lying within the other; of more, any may. This many take two
/// microseconds at most.
const SHELLS_ASKED: usize = 64;

/// Two shapes at a pose.
pub(in crate::narrow) struct Scan<'a> {
    shapes: (&'a Shape, &'a Shape),
    sides: (Side<'a>, Side<'a>),
    wholes: [Option<Obb>; 2],
    at: Placed,
}

impl<'a> Scan<'a> {
    /// `None` if one is a half-space.
    pub(in crate::narrow) fn new(a: &'a Shape, b: &'a Shape, pos12: &Pose) -> Option<Self> {
        let sides = (Side::of(a)?, Side::of(b)?);
        Some(Self {
            shapes: (a, b),
            sides,
            wholes: [sides.0.whole(a), sides.1.whole(b)],
            at: Placed::of(a, b, pos12),
        })
    }

    /// Whether `boxes` are a pair of leaves, which cannot be split.
    pub(in crate::narrow) fn is_leaf(&self, (a, b): (BoxId, BoxId)) -> bool {
        let leaf = |side: Side<'_>, id| matches!(side.held(id), Held::Triangle(_));
        leaf(self.sides.0, a) && leaf(self.sides.1, b)
    }

    /// What two boxes share, A's frame.
    pub(in crate::narrow) fn spot(&self, a: BoxId, b: BoxId) -> Option<Spot> {
        let boxes = (a, b);
        if let (Side::Mesh(one), Side::Mesh(other)) = self.sides
            && let (Held::Triangle(i), Held::Triangle(j)) = (one.obb().held(a), other.obb().held(b))
        {
            let in_a = other.triangle(j).map(|p| self.at.to_a(&p));
            if let Some(exact) = shared(&one.triangle(i), &in_a, self.at.slop) {
                return exact.map(|spot| Spot { boxes, ..spot });
            }
        }
        let p = held(&self.sides.0.obb(a, &self.wholes[0]), self.shapes.0.lag_m());
        let q = held(&self.sides.1.obb(b, &self.wholes[1]), self.shapes.1.lag_m());
        let q = Obb {
            centre: self.at.to_a(&q.centre),
            axes: self.at.rotation * q.axes,
            half: q.half,
        };
        let spot = Spot::shared(&p, &q, self.at.slop)?;
        Some(Spot { boxes, ..spot })
    }

    /// What the roots share.
    pub(in crate::narrow) fn whole(&self) -> Option<Spot> {
        self.spot(BoxId::ROOT, BoxId::ROOT)
    }

    /// Visits every pair of boxes that a front has not proved apart at this pose; false: it does not know them.
    pub(in crate::narrow) fn unproved(
        &self,
        front: &CarriedFront,
        store: &FrontStore,
        visit: impl FnMut(BoxId, BoxId),
    ) -> bool {
        if !front.names_boxes_of(self.shapes.0, self.shapes.1) {
            return false;
        }
        let moved_m = front.moved_m(self.shapes.0, self.shapes.1, &self.at.pos12);
        front.unproved(store, moved_m, visit)
    }

    /// The spots of the child boxes of a pair of boxes, except those that are apart. One test.
    pub(in crate::narrow) fn split(&self, boxes: (BoxId, BoxId), mut take: impl FnMut(Spot)) {
        let (side_a, side_b) = self.sides;
        let (a, b) = (
            side_a.obb(boxes.0, &self.wholes[0]),
            side_b.obb(boxes.1, &self.wholes[1]),
        );
        // The larger is split, so that both shrink alike.
        let size = |obb: &Obb| obb.half.iter().map(|h| h * h).sum::<f32>();
        let (pack, part_b) = match (side_a.held(boxes.0), side_b.held(boxes.1)) {
            (Held::Pack(_), Held::Pack(pack)) if size(&b) > size(&a) => (pack, true),
            (Held::Pack(pack), _) => (pack, false),
            (Held::Triangle(_), Held::Pack(pack)) => (pack, true),
            (Held::Triangle(_), Held::Triangle(_)) => return,
        };
        let (one, side) = if part_b { (&a, side_b) } else { (&b, side_a) };
        let Some(held) = side.pack(pack) else { return };
        let gaps: [f64; LANES] = self.at.gaps(one, held, part_b);
        for lane in lanes(held.mask).filter(|lane| gaps[*lane as usize] <= 0.0) {
            let id = BoxId::new(pack, lane);
            let (a, b) = if part_b { (boxes.0, id) } else { (id, boxes.1) };
            if let Some(spot) = self.spot(a, b) {
                take(spot);
            }
        }
    }

    /// Possible normals of a contact of two boxes, from A to B, A's frame: along a normal of a face, edge or corner of
    /// A, or opposite to one of B.
    pub(in crate::narrow) fn normals(&self, (a, b): (BoxId, BoxId)) -> Cone {
        let of_b = |mesh: &Mesh| mesh.normals(b).turned(&self.at.rotation).reversed();
        match self.sides {
            (Side::Mesh(one), Side::Mesh(other)) => {
                let both = [one.normals(a), of_b(other)];
                Cone::around(both.into_iter())
            }
            (Side::Mesh(mesh), Side::Convex(_)) => mesh.normals(a),
            (Side::Convex(_), Side::Mesh(mesh)) => of_b(mesh),
            (Side::Convex(_), Side::Convex(_)) => Cone::every(Vec3::z()),
        }
    }

    /// A place that covers all the two share if one can lie entirely within the other, without their surfaces meeting.
    ///
    /// * `front` - of these two; what it knows need not be tested.
    pub(in crate::narrow) fn held(&self, front: Option<&CarriedFront>) -> Option<Spot> {
        let (a, b) = self.shapes;
        let single = self.sides.0.shell_count() == 1 && self.sides.1.shell_count() == 1;
        let known = |f: &CarriedFront| f.holds_none(f.moved_m(a, b, &self.at.pos12), single);
        if front.is_some_and(known) || !(self.can_hold(false) || self.can_hold(true)) {
            return None;
        }
        self.whole()
    }

    /// Whether a connected surface of B (`b_holds`: of A) can lie within the other one.
    fn can_hold(&self, b_holds: bool) -> bool {
        let (outer, inner) = if b_holds {
            ((self.sides.1, self.shapes.1), (self.sides.0, self.shapes.0))
        } else {
            ((self.sides.0, self.shapes.0), (self.sides.1, self.shapes.1))
        };
        let Some(solid) = outer.0.solid() else {
            return false;
        };
        let (_, origin) = tree_of(outer.1, outer.0);
        let to_outer = |p: &Point| {
            if b_holds {
                self.at.to_b(p)
            } else {
                self.at.to_a(p)
            }
        };
        let to_inner = |d: Vec3| {
            if b_holds {
                self.at.rotation * d
            } else {
                self.at.turn_to_b(&d)
            }
        };
        let away = to_outer(&inner.1.centre) - origin;
        let [x, y, z] = [0, 1, 2].map(|k| Vec3::ith(k, 1.0));
        let ahead = away.try_normalize(self.at.slop).unwrap_or(x);
        let directions = [ahead, x, -x, y, -y, z, -z]
            .map(|direction| (direction, solid.extent(&direction)[0] + self.at.slop));
        // A surface with any point outside is not within: each has a point that shows this, or may be within.
        let is_out = |place: usize| {
            directions.iter().any(|(direction, reach)| {
                let point = inner.0.shell_point(place, &to_inner(*direction));
                direction.dot(&(to_outer(&point) - origin)) > *reach
            })
        };
        let count = inner.0.shell_count();
        count > SHELLS_ASKED || !(0..count).all(is_out)
    }
}

/// A mesh and a half-space at a pose: the parts of the boxes behind the plane.
pub(in crate::narrow) struct PlaneScan<'a> {
    mesh: &'a Mesh,
    normal: Vec3,
    offset: f64,
    slop_m: f64,
}

impl<'a> PlaneScan<'a> {
    /// * `normal`, `offset` - of the half-space `normal . x <= offset`, in the mesh's frame.
    /// * `slop_m` - bound on the rounding of the pose.
    pub(in crate::narrow) fn new(mesh: &'a Mesh, normal: Vec3, offset: f64, slop_m: f64) -> Self {
        let size = offset.abs() + mesh.centre().coords.norm() + mesh.radius();
        Self {
            mesh,
            normal,
            offset,
            slop_m: slop_m + 64.0 * ROUND * size,
        }
    }

    fn spot(&self, id: BoxId) -> Option<Spot> {
        let obb = held(&self.mesh.obb().get(id), self.mesh.lag_m());
        let spot = behind(&obb, self.normal, self.offset, self.slop_m)?;
        Some(Spot {
            boxes: (id, BoxId::ROOT),
            ..spot
        })
    }

    /// All that lies behind the plane, mesh's frame; the largest boxes are split while `test` allows it.
    pub(in crate::narrow) fn spots(
        &self,
        heap: &mut BinaryHeap<Spot>,
        mut test: impl FnMut() -> bool,
        mut take: impl FnMut(Spot),
    ) {
        heap.clear();
        heap.extend(self.spot(BoxId::ROOT));
        while let Some(spot) = heap.pop() {
            match self.mesh.obb().held(spot.boxes.0) {
                Held::Pack(pack) if test() => {
                    let mask = self.mesh.obb().packs()[pack as usize].mask;
                    heap.extend(lanes(mask).filter_map(|lane| self.spot(BoxId::new(pack, lane))));
                }
                _ => take(spot),
            }
        }
    }
}

/// A box enlarged to hold the contents of one whose mesh has deformed since it was fitted.
fn held(obb: &Obb, lag_m: f64) -> Obb {
    if lag_m == 0.0 {
        return *obb;
    }
    Obb {
        half: obb.half.map(|half| f32_up(f64::from(half) + lag_m)),
        ..*obb
    }
}

/// The part of a box behind a plane.
pub(in crate::narrow) fn behind(obb: &Obb, normal: Vec3, offset: f64, slop_m: f64) -> Option<Spot> {
    let slab = Slab {
        normal,
        low: f64::NEG_INFINITY,
        high: offset - normal.dot(&obb.centre.coords),
    };
    let size = obb.half.iter().map(|h| f64::from(*h)).sum::<f64>();
    Spot::of(obb, &[slab], size, slop_m)
}
