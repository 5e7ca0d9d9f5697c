//! The unguarded twin, for reports: plain parry at the same poses, as an application calls it. No scaling, no relative
//! pose first, no certificate: it shows what the guards are worth.
//!
//! In: two shapes as specified, at world poses. Out: one number, which may be wrong.

use std::panic::{AssertUnwindSafe, catch_unwind};

use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::{contact, distance};
use parry3d_f64::shape::{SharedShape, TriMeshFlags};

use crate::math::{Pose, Vec3, to_glam_vec};
use crate::shape::ShapeSpec;

/// The signed gap, metres, as parry reports it: its distance, or minus the depth of its deepest contact.
///
/// * returns - `None`: the pair is not supported, the shape could not be built, or no contact was found for two that
///   are reported to overlap.
#[must_use]
pub fn gap(a: &ShapeSpec, pose_a: &Pose, b: &ShapeSpec, pose_b: &Pose) -> Option<f64> {
    // Its polytopes are known to panic at times; that is an answer, too.
    let told = catch_unwind(AssertUnwindSafe(|| {
        let (one, local_a) = shape(a)?;
        let (other, local_b) = shape(b)?;
        let (at_a, at_b) = (placed(pose_a, &local_a), placed(pose_b, &local_b));
        let apart = distance(&at_a, one.as_ref(), &at_b, other.as_ref())
            .ok()?
            .distance;
        if apart > 0.0 {
            return Some(apart);
        }
        let deepest = contact(&at_a, one.as_ref(), &at_b, other.as_ref(), 0.0).ok()??;
        Some(deepest.dist)
    }));
    told.ok().flatten().filter(|gap| gap.is_finite())
}

fn placed(pose: &Pose, local: &ParryPose) -> ParryPose {
    let q = pose.rotation.as_vector();
    let rotation = Rotation::from_xyzw(q.x, q.y, q.z, q.w);
    let at = to_glam_vec(&pose.translation.vector);
    ParryPose::from_parts(at, rotation) * *local
}

/// A shape, and the pose of its frame in ours: parry's round shapes stand along y.
fn shape(spec: &ShapeSpec) -> Option<(SharedShape, ParryPose)> {
    let here = ParryPose::IDENTITY;
    let upright = ParryPose::from_parts(
        Vector::ZERO,
        Rotation::from_rotation_x(std::f64::consts::FRAC_PI_2),
    );
    let vector = |p: &[f64; 3]| Vector::new(p[0], p[1], p[2]);
    Some(match spec {
        ShapeSpec::Sphere { radius } => (SharedShape::ball(*radius), here),
        ShapeSpec::Box { half_extents: h } => (SharedShape::cuboid(h[0], h[1], h[2]), here),
        ShapeSpec::Capsule {
            radius,
            half_height,
        } => (SharedShape::capsule_z(*half_height, *radius), here),
        ShapeSpec::Cylinder {
            radius,
            half_height,
        } => (SharedShape::cylinder(*half_height, *radius), upright),
        ShapeSpec::Cone {
            radius,
            half_height,
        } => (SharedShape::cone(*half_height, *radius), upright),
        ShapeSpec::Convex { vertices, .. } => {
            let points: Vec<Vector> = vertices.iter().map(vector).collect();
            (SharedShape::convex_hull(&points)?, here)
        }
        ShapeSpec::Triangle {
            vertices: [a, b, c],
        } => (SharedShape::triangle(vector(a), vector(b), vector(c)), here),
        ShapeSpec::Trimesh {
            vertices,
            faces,
            solid,
            ..
        } => {
            let flags = if *solid == Some(false) {
                TriMeshFlags::empty()
            } else {
                TriMeshFlags::ORIENTED
            };
            let points = vertices.iter().map(vector).collect();
            let mesh = SharedShape::trimesh_with_flags(points, faces.clone(), flags).ok()?;
            (mesh, here)
        }
        ShapeSpec::HalfSpace { normal, offset } => {
            let normal = Vec3::from(*normal).normalize();
            let at = ParryPose::from_parts(to_glam_vec(&(normal * *offset)), Rotation::IDENTITY);
            (SharedShape::halfspace(to_glam_vec(&normal)), at)
        }
        ShapeSpec::HeightField { .. } => return None,
    })
}
