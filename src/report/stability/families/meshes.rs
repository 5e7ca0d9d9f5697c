//! Solid meshes of a cube that have triangles of nearly no height.

use super::kinds::{ANY, STILL, above, ball, box_faces, cuboid, logs, mesh, mesh_cube};
use crate::report::stability::stage::{Actor, Case, Pos};
use crate::shape::ShapeSpec;

/// A cube with one more vertex in its top face, `height_m` away from an edge: the same solid.
fn sliver_cube(height_m: f64) -> ShapeSpec {
    let (mut vertices, mut faces) = box_faces([0.5; 3]);
    // Four triangles around the new vertex replace the two of the top.
    vertices.push([-0.5 + height_m, 0.05, 0.5]);
    faces.retain(|face| face.iter().any(|&corner| corner < 4));
    faces.extend([[4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]]);
    mesh(vertices, faces, true)
}

pub(super) fn slivers() -> Vec<Case> {
    let mut cases = Vec::new();
    for height_m in logs(-12, -1, 1) {
        for gap_m in [1e-3, -1e-3] {
            // Above the sliver itself.
            for (kind, shape, q) in [
                ("sphere", ball(0.2), STILL),
                ("box", cuboid(0.3, 0.2, 0.4), ANY),
                ("mesh", mesh_cube(0.2), ANY),
                ("sliver mesh", sliver_cube(height_m), ANY),
            ] {
                let mut pos = above(0.5, &shape, q, gap_m);
                (pos.t[0], pos.t[1]) = (-0.45, 0.02);
                let lower = (Actor::of(sliver_cube(height_m)), Pos::at([0.0; 3]));
                cases.push(Case::pair(kind, height_m, lower, (Actor::of(shape), pos)));
            }
        }
    }
    cases
}
