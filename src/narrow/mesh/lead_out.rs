//! The way out of a solid: the nearest place of two surfaces shows where an overlap ends, but not how deep it is.
//!
//! In: the nearest or deepest leaves of a solid mesh and a convex shape that overlap. Out: the same with the normal
//! that leads out of the solid, and the depth of the convex shape's deepest point along it. By its leaf alone, a ball
//! whose centre is inside would be pushed further in, and one that is entirely inside would be only as deep as its
//! surface is near.

use super::side::Side;
use super::{Closest, LeafContact};
use crate::math::{Interval, Point, Pose, Vec3};
use crate::shape::{Mesh, Shape};

/// The way out of the solid; `None`: neither is a solid with a convex shape in it, or the leaf leads out as it is.
pub(in crate::narrow) fn lead_out(
    leaf: &LeafContact,
    (a, b): (&Shape, &Shape),
    pos12: &Pose,
) -> Option<LeafContact> {
    let found = &leaf.closest;
    let sides = (Side::of(a), Side::of(b));
    let led = match sides {
        _ if found.best_m > 0.0 => None,
        (Some(Side::Mesh(mesh)), Some(Side::Convex(convex))) => {
            let deepest =
                |inward: &Vec3| pos12 * convex.support(&pos12.inverse_transform_vector(inward));
            let on = (&found.point_a, leaf.triangle_a);
            way(mesh, on, &found.normal, deepest)
        }
        (Some(Side::Convex(convex)), Some(Side::Mesh(mesh))) => {
            let deepest = |inward: &Vec3| {
                let own = pos12.rotation * inward;
                pos12.inverse_transform_point(&convex.support(&own))
            };
            let on = pos12.inverse_transform_point(&found.point_b);
            let normal = pos12.inverse_transform_vector(&-found.normal);
            way(mesh, (&on, leaf.triangle_b), &normal, deepest).map(|way| Way {
                normal: -(pos12.rotation * way.normal),
                on: pos12 * way.deepest,
                deepest: pos12 * way.on,
                ..way
            })
        }
        _ => None,
    };
    let led = led.filter(|led| led.gap_m < found.best_m)?;
    Some(LeafContact {
        closest: Closest {
            gap: Interval::new(led.gap_m.min(found.gap.min), found.gap.max),
            best_m: led.gap_m,
            normal: led.normal,
            point_a: led.on,
            point_b: led.deepest,
            finished: found.finished,
        },
        ..*leaf
    })
}

/// A way out of a solid.
struct Way {
    /// Unit, out of the solid.
    normal: Vec3,
    /// On the solid's surface, or on its plane at the nearest place.
    on: Point,
    /// The deepest point of the other shape, opposite `on`.
    deepest: Point,
    gap_m: f64,
}

/// The way out, in the solid's frame.
///
/// * `on` - a point of its surface, and the triangle there.
/// * `normal` - unit, from `on` towards the other shape's nearest point, or opposite to that.
/// * `deepest` - the other shape's farthest point along a direction.
fn way(
    mesh: &Mesh,
    (on, triangle): (&Point, u32),
    normal: &Vec3,
    deepest: impl FnOnce(&Vec3) -> Point,
) -> Option<Way> {
    let outward = mesh.face_normal(triangle).filter(|_| mesh.is_solid())?;
    let normal = if outward.dot(normal) < 0.0 {
        -normal
    } else {
        *normal
    };
    let deepest = deepest(&-normal);
    let over = normal.dot(&(deepest - on));
    let beneath = mesh.beneath(triangle, &deepest, &normal, || true);
    let on = beneath.map_or(deepest - normal * over, |(on, _)| on);
    Some(Way {
        normal,
        on,
        deepest,
        gap_m: normal.dot(&(deepest - on)),
    })
}
