//! Lines of a batch in which a mesh is a solid: answered as a running daemon answers a gap query.
//!
//! In: the shapes of a line, the pose of B seen from A. Out: an interval with its witness, or `None` if no mesh of the
//! line is a solid. By the engine's own query, so that the two agree.

use std::path::Path;

use super::pieces::TOO_FAR;
use crate::math::{Interval, Point, Pose, Vec3};
use crate::narrow::exact::Closest;
use crate::narrow::gap_between;
use crate::shape::{ShapeSpec, build};
use crate::time::{Meter, SystemClock};
use crate::wire::Verdict;
use crate::world::{Body, Parts, PlacedShape};

/// Beyond this, squares of distances overflow, metres.
const FAR_M: f64 = 1e150;

/// The result for two shapes of which at least one is a solid mesh; A's frame, metres.
pub(super) struct Known {
    pub(super) gap: Interval,
    pub(super) best_m: Option<f64>,
    pub(super) normal: Vec3,
    pub(super) point_a: Point,
    pub(super) point_b: Point,
    pub(super) collides: bool,
}

/// Whether the line declares a mesh to be a solid.
fn is_solid(spec: &ShapeSpec) -> bool {
    let ShapeSpec::Trimesh { solid, .. } = spec else {
        return false;
    };
    *solid == Some(true)
}

/// The gap, if one of the two is a solid mesh.
///
/// * `surfaces` - the result for them as surfaces: gives a place if the query has none.
///
/// # Errors
/// Why it is no solid, or nothing is known of the surfaces.
pub(super) fn gap(
    (a, b): (&ShapeSpec, &ShapeSpec),
    pos12: &Pose,
    surfaces: impl FnOnce() -> Result<Closest, String>,
) -> Result<Option<Known>, String> {
    if !is_solid(a) && !is_solid(b) {
        return Ok(None);
    }
    // The engine is made for scenes, whose coordinates are far smaller.
    let offset_m = |spec: &ShapeSpec| match spec {
        ShapeSpec::HalfSpace { offset, .. } => offset.abs(),
        _ => 0.0,
    };
    if offset_m(a)
        .max(offset_m(b))
        .max(pos12.translation.vector.amax())
        > FAR_M
    {
        return Err(TOO_FAR.to_owned());
    }
    let a = body("a", a, &Pose::identity())?;
    let b = body("b", b, pos12)?;
    let asked = gap_between(&a, &b, 0.0, &mut Meter::unlimited(&SystemClock));
    let Interval { min, max } = asked.gap;
    let collides = asked.verdict == Verdict::Colliding;
    Ok(Some(if let Some(witness) = asked.witness {
        // An estimate is never outside what is proved, and the points are as far apart as it says.
        let best_m = witness.best_m.max(min).min(max);
        let point_b = if (min..=max).contains(&witness.best_m) {
            pos12 * witness.point_b
        } else {
            witness.point_a + witness.normal * best_m
        };
        Known {
            gap: asked.gap,
            best_m: Some(best_m),
            normal: witness.normal,
            point_a: witness.point_a,
            point_b,
            collides,
        }
    } else {
        let surfaces = surfaces()?;
        Known {
            gap: asked.gap,
            best_m: None,
            normal: surfaces.normal,
            point_a: surfaces.point_a,
            point_b: surfaces.point_b,
            collides,
        }
    }))
}

/// A body of one shape; a mesh without a `solid` setting is a surface, as always in a batch.
fn body(what: &str, spec: &ShapeSpec, pose: &Pose) -> Result<Body, String> {
    let surface = |spec: &ShapeSpec| {
        let mut spec = spec.clone();
        if let ShapeSpec::Trimesh { solid, .. } = &mut spec {
            *solid = Some(*solid == Some(true));
        }
        spec
    };
    let built = build(&surface(spec), Path::new(".")).map_err(|e| format!("{what}: {e}"))?;
    let parts = Parts::from([PlacedShape {
        shape: built.shape,
        pose: Pose::identity(),
    }]);
    Ok(Body::of_shapes(parts, pose))
}
