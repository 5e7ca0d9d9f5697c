//! The spots of a body pair, shape pair by shape pair: from fronts, trees, boxes and known contacts.

use crate::ids::PairSlot;
use crate::limits::REGION_SHAPE_PAIRS_MAX;
use crate::math::{Pose, ROUND, Vec3, relative};
use crate::narrow::Narrow;
use crate::narrow::around::radii_m;
use crate::narrow::compound::PairWalk;
use crate::narrow::contacts::Contact;
use crate::narrow::mesh::{CarriedFront, PlaneScan, Scan, behind};
use crate::narrow::query::{shape_pose, sphere_bound};
use crate::shape::{Cone, Geometry, Mesh, Obb, Shape};
use crate::world::{Body, PlacedShape};

use super::gather::{SPOTS_MAX, push};
use super::pace::Pace;
use super::spot::Spot;
use super::{Approx, FOUND_MAX, Standing, boxes};

/// Spots smaller than this share of the smaller body's radius are not split: that is no more than a sphere around a few
/// of them is too large by.
const ENOUGH: f64 = 0.02;
/// Looks at boxes above the shapes, for each pair of shapes that may be read.
const LOOKS_PER_SHAPE_PAIR: usize = 4;

/// A pair of shapes at this tick's poses.
struct Pair<'a> {
    one: &'a PlacedShape,
    other: &'a PlacedShape,
    /// Of the second seen from the first.
    pos12: Pose,
    /// Bound on the rounding of the bodies' poses, metres.
    slop_m: f64,
    /// Its contacts are known and complete.
    complete: bool,
}

impl Narrow {
    /// Collects the spots of two bodies that are where their poses say.
    pub(super) fn collect(
        &self,
        slot: PairSlot,
        of: &Standing<'_>,
        pace: &mut Pace<'_, '_>,
        approx: &mut Approx,
    ) {
        let Standing { a, b, complete, .. } = *of;
        let rel = relative(&a.pose, &b.pose);
        if find_near((a, b), &rel, pace, approx) {
            for at in 0..approx.near.len() {
                let places = approx.near[at];
                let one = &a.shapes[places.0 as usize];
                let other = &b.shapes[places.1 as usize];
                let size = rel.translation.vector.norm() + reach(one) + reach(other);
                let pair = Pair {
                    one,
                    other,
                    pos12: shape_pose(one, other, &rel),
                    slop_m: 32.0 * ROUND * size,
                    complete,
                };
                let front = self.front_at(slot, places);
                let [of_a, of_b] = radii_m(a, b);
                self.collect_shapes(&pair, front, of_a.min(of_b), pace, approx);
            }
        } else {
            approx.clipped = true;
            push(&mut approx.all, boxes(a, b));
        }
        if complete {
            for contact in self.contacts(slot).0 {
                push(&mut approx.all, found(contact, &rel));
            }
        }
    }

    /// The front of a pair of shapes by their places, if it was ever started.
    fn front_at(&self, slot: PairSlot, places: (u32, u32)) -> Option<&CarriedFront> {
        let memo = self.memos.get(slot.index())?;
        if let Some(compound) = self.compounds.get(memo.compound) {
            return compound.front_of(&self.shelves, places);
        }
        let front = self.shelves.fronts.get(memo.front)?;
        front.is_started().then_some(front)
    }

    fn collect_shapes(
        &self,
        pair: &Pair<'_>,
        front: Option<&CarriedFront>,
        size_m: f64,
        pace: &mut Pace<'_, '_>,
        approx: &mut Approx,
    ) {
        let (one, other) = (&*pair.one.shape, &*pair.other.shape);
        match (&one.geometry, &other.geometry) {
            (Geometry::HalfSpace { normal, offset }, Geometry::Mesh(mesh)) => {
                pair.take_plane(mesh, (*normal, *offset), false, pace, approx);
            }
            (Geometry::Mesh(mesh), Geometry::HalfSpace { normal, offset }) => {
                pair.take_plane(mesh, (*normal, *offset), true, pace, approx);
            }
            (Geometry::Mesh(_), _) | (_, Geometry::Mesh(_)) => {
                if let Some(scan) = Scan::new(one, other, &pair.pos12) {
                    self.take_surfaces(pair, &scan, front, size_m, pace, approx);
                }
            }
            // Its contacts are all there is.
            _ if pair.complete => {}
            _ => {
                if let Some(spot) = pair.convex() {
                    pair.put(spot, approx);
                }
            }
        }
    }

    /// What two surfaces share, or a surface and a convex shape.
    fn take_surfaces(
        &self,
        pair: &Pair<'_>,
        scan: &Scan<'_>,
        front: Option<&CarriedFront>,
        size_m: f64,
        pace: &mut Pace<'_, '_>,
        approx: &mut Approx,
    ) {
        approx.raw.clear();
        let (mut many, mut full) = (0, false);
        let known =
            front.filter(|front| scan.unproved(front, &self.shelves.store, |_, _| many += 1));
        let looked_at = known.filter(|_| pace.allows(many));
        if let Some(front) = looked_at {
            scan.unproved(front, &self.shelves.store, |a, b| {
                let spot = pace.look().then(|| scan.spot(a, b)).flatten();
                let Some(spot) = spot else { return };
                if approx.raw.len() == SPOTS_MAX {
                    full = true;
                    pair.flush(scan, approx);
                }
                approx.raw.push(spot);
            });
            if pace.cut {
                return;
            }
        } else {
            approx.clipped |= known.is_some();
            approx.raw.extend(scan.whole());
        }
        for front in front.into_iter().filter(|_| !pair.complete) {
            for leaf in front.found_at(&self.shelves.store, &pair.pos12) {
                let c = &leaf.closest;
                if approx.found.len() < FOUND_MAX {
                    let spot = Spot::found(&c.point_a, &c.point_b, c.normal, -c.best_m);
                    approx.found.push(pair.place(spot));
                }
            }
        }
        if let Some(spot) = scan.held(front) {
            pair.put(spot.of_any_normal(), approx);
        }
        if full || (pair.complete && looked_at.is_some()) {
            pair.flush(scan, approx);
            return;
        }
        // The largest first, as long as tests are allowed.
        let enough_m = ENOUGH * size_m;
        let Approx { raw, heap, .. } = approx;
        heap.clear();
        heap.extend(raw.drain(..));
        while heap.len() + raw.len() < SPOTS_MAX {
            if heap.peek().is_none_or(|spot| spot.radius_m <= enough_m) {
                break;
            }
            let Some(spot) = heap.pop() else { break };
            if scan.is_leaf(spot.boxes) {
                raw.push(spot);
            } else if pace.test() {
                scan.split(spot.boxes, |part| heap.push(part));
            } else {
                raw.push(spot);
                break;
            }
        }
        raw.extend(heap.drain());
        pair.flush(scan, approx);
    }
}

/// Lists the pairs of shapes whose boxes and balls may touch; false: there are too many, or no looks are left.
fn find_near(
    (a, b): (&Body, &Body),
    rel: &Pose,
    pace: &mut Pace<'_, '_>,
    approx: &mut Approx,
) -> bool {
    let Approx { waiting, near, .. } = approx;
    near.clear();
    let mut walk = PairWalk::new((a, b), rel, waiting);
    let (mut looks, mut whole) = (0, true);
    let mut look = || {
        looks += 1;
        whole = pace.look() && looks <= LOOKS_PER_SHAPE_PAIR * REGION_SHAPE_PAIRS_MAX;
        whole
    };
    while let Some((i, j)) = walk.next(&mut look, |low| low <= 0.0) {
        if sphere_bound(&a.shapes[i as usize], &b.shapes[j as usize], rel) > 0.0 {
            continue;
        }
        if near.len() == REGION_SHAPE_PAIRS_MAX {
            return false;
        }
        near.push((i, j));
    }
    whole
}

impl Pair<'_> {
    /// Adds the current spots, with their normals.
    fn flush(&self, scan: &Scan<'_>, approx: &mut Approx) {
        for at in 0..approx.raw.len() {
            let spot = approx.raw[at];
            let cone = scan.normals(spot.boxes);
            self.put(Spot { cone, ..spot }, approx);
        }
        approx.raw.clear();
    }

    /// Adds a spot given in the first shape's frame.
    fn put(&self, spot: Spot, approx: &mut Approx) {
        push(&mut approx.all, self.place(spot));
    }

    /// A spot in the first shape's frame, in A's body frame.
    fn place(&self, spot: Spot) -> Spot {
        let pose = &self.one.pose;
        let turn = pose.rotation.to_rotation_matrix();
        Spot {
            centre: pose * spot.centre,
            radius_m: spot.radius_m + self.slop_m,
            along: pose.rotation * spot.along,
            across_m: spot.across_m + self.slop_m,
            cone: spot.cone.turned(turn.matrix()),
            ..spot
        }
    }

    /// What the boxes of two shapes without meshes share.
    fn convex(&self) -> Option<Spot> {
        let (one, other) = (&*self.one.shape, &*self.other.shape);
        match (&one.geometry, &other.geometry) {
            (Geometry::HalfSpace { normal, offset }, _) => {
                let obb = Spot::placed(&Obb::around(&other.aabb), &self.pos12);
                let spot = behind(&obb, *normal, *offset, self.slop_m)?;
                Some(spot.of_normals(Cone::of(*normal)))
            }
            (_, Geometry::HalfSpace { normal, offset }) => {
                let (normal, offset) = plane_at(&self.pos12, normal, *offset);
                let spot = behind(&Obb::around(&one.aabb), normal, offset, self.slop_m)?;
                Some(spot.of_normals(Cone::of(-normal)))
            }
            _ => {
                let obb = Spot::placed(&Obb::around(&other.aabb), &self.pos12);
                let spot = Spot::shared(&Obb::around(&one.aabb), &obb, self.slop_m)?;
                Some(spot.of_any_normal())
            }
        }
    }

    /// The part of a mesh behind a plane.
    fn take_plane(
        &self,
        mesh: &Mesh,
        (normal, offset): (Vec3, f64),
        is_b: bool,
        pace: &mut Pace<'_, '_>,
        approx: &mut Approx,
    ) {
        let (mesh_from_plane, mesh_from_one) = if is_b {
            (self.pos12, Pose::identity())
        } else {
            (self.pos12.inverse(), self.pos12.inverse())
        };
        let (down, offset) = plane_at(&mesh_from_plane, &normal, offset);
        let to_one = mesh_from_one.inverse();
        let turn = to_one.rotation.to_rotation_matrix();
        // From A to B: into the mesh if the half-space is A.
        let out = if is_b { -down } else { down };
        let mut heap = std::mem::take(&mut approx.heap);
        PlaneScan::new(mesh, down, offset, self.slop_m).spots(
            &mut heap,
            || pace.test(),
            |spot| {
                let seen = Spot {
                    centre: to_one * spot.centre,
                    along: to_one.rotation * spot.along,
                    cone: Cone::of(out).turned(turn.matrix()),
                    ..spot
                };
                self.put(seen, approx);
            },
        );
        approx.heap = heap;
    }
}

/// A contact of the pair's contact set, A's body frame.
fn found(contact: &Contact, rel: &Pose) -> Spot {
    let b = rel * contact.point_b;
    Spot::found(&contact.point_a, &b, contact.normal, -contact.gap_m)
}

/// The plane `normal . x = offset` of a frame at `pose`, in the frame that `pose` refers to.
fn plane_at(pose: &Pose, normal: &Vec3, offset: f64) -> (Vec3, f64) {
    let turned = pose.rotation * normal;
    (turned, offset + turned.dot(&pose.translation.vector))
}

/// Greatest distance of a shape's points from its body's origin, metres; for a half-space, of its frame.
fn reach(placed: &PlacedShape) -> f64 {
    let shape: &Shape = &placed.shape;
    let own = if shape.radius.is_finite() {
        shape.centre.coords.norm() + shape.radius
    } else {
        0.0
    };
    placed.pose.translation.vector.norm() + own
}
