//! Overlapping shapes of revolution on one axis.
//!
//! In: a pair. Out: the gap of the cores when both are segments, cylinders or cones on one line, else `None`.
//!
//! The best direction is then a whole circle of directions, which an expanding polytope could only resolve all around.
//! But the support of the difference depends on the height of the direction alone, and its outline in a half plane is a
//! polygon whose edges come from those of the two outlines: caps, sides and slants.

use super::pair::{CoreGap, Held, Pair};
use crate::math::Vec3;
use crate::shape::Core;

/// Axes this close count as one: what it costs is added to the upper end. (sine of the angle, parts of the size)
const ALIGNED: f64 = 1e-12;

/// Outward normal heights (z of a unit normal) of the outline's edges.
fn edges(core: &Core) -> Option<[f64; 3]> {
    match core {
        Core::Segment { .. } | Core::Cylinder { .. } => Some([1.0, -1.0, 0.0]),
        Core::Cone { radius_m, half_m } => {
            let length = radius_m.hypot(2.0 * half_m);
            Some([1.0, -1.0, radius_m / length])
        }
        _ => None,
    }
}

/// The gap of two overlapping cores on one axis.
pub(super) fn gap(pair: &Pair<'_>) -> Option<CoreGap> {
    let (of_a, of_b) = (edges(pair.a.core())?, edges(pair.b.core())?);
    let axis: Vec3 = pair.rotation.column(2).into_owned();
    let (tilt, off) = (axis.x.hypot(axis.y), pair.at.x.hypot(pair.at.y));
    let loose = 2.0 * tilt * pair.scale + off;
    if tilt > ALIGNED || off > ALIGNED * pair.scale {
        return None;
    }
    let turned = axis.z.signum();
    let mut best = (f64::NEG_INFINITY, Vec3::z());
    // B's outward normals are minus the directions that separate it.
    let heights = of_a.into_iter().chain(of_b.map(|z| -z * turned));
    for z in heights {
        let n = Vec3::new((1.0 - z * z).max(0.0).sqrt(), 0.0, z);
        let value = n.dot(&pair.support(&n).w);
        if value > best.0 {
            best = (value, n);
        }
    }
    let (lower, normal) = best;
    let tangent = Vec3::new(-normal.z, 0.0, normal.x);
    // The features that would touch lie on one line: the middle of what they share.
    let (low_a, high_a) = spread(pair.a.core(), 1.0, 0.0, &normal, &tangent)?;
    let (low_b, high_b) = spread(pair.b.core(), turned, pair.at.z, &-normal, &tangent)?;
    let middle = (low_a.max(low_b) + high_a.min(high_b)) / 2.0;
    let reach = normal.dot(&pair.a.core().support(&normal).0);
    Some(CoreGap {
        lower,
        upper: lower + loose,
        normal,
        point_a: normal * reach + tangent * middle,
        point_b: normal * (reach + lower) + tangent * middle,
        held: Held::default(),
    })
}

/// Extent along `tangent` of what the outline (turned and lifted along z) shows along `dir`.
fn spread(core: &Core, turned: f64, lift: f64, dir: &Vec3, tangent: &Vec3) -> Option<(f64, f64)> {
    let (top, bottom, half_m) = match core {
        Core::Segment { half_m } => (0.0, 0.0, *half_m),
        Core::Cylinder { radius_m, half_m } => (*radius_m, *radius_m, *half_m),
        Core::Cone { radius_m, half_m } => (0.0, *radius_m, *half_m),
        _ => return None,
    };
    let outline = [
        (top, half_m),
        (-top, half_m),
        (bottom, -half_m),
        (-bottom, -half_m),
    ]
    .map(|(x, z)| Vec3::new(x, 0.0, z * turned + lift));
    let most = outline
        .iter()
        .map(|p| p.dot(dir))
        .fold(f64::NEG_INFINITY, f64::max);
    let same = 1e-12 * (half_m + bottom + lift.abs());
    let shown = outline.iter().filter(|p| p.dot(dir) >= most - same);
    Some(
        shown
            .map(|p| p.dot(tangent))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| {
                (low.min(t), high.max(t))
            }),
    )
}
