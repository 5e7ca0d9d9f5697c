//! Neighbours that share no whole edge: tiles laid in bond, corners that were not welded, doubled sheets.
//!
//! In: a mesh and its sides without a neighbour. Out: for each the faces just beyond it. They are not part of the
//! topology (such a mesh is open); they show where the surface continues.

use super::tree::{Below, NODES_WAITING_MAX};
use super::{Mesh, adjacency::NONE};
use crate::math::Point;

/// Positions along a side at which to look beyond it: near its ends too, because what lies beyond a corner of a tile
/// may begin just there.
const LOOKS: [f64; 5] = [0.01, 0.2, 0.5, 0.8, 0.99];
/// Distance to look beyond a side, as a share of the mesh's radius: narrower cracks are ignored.
const BEYOND: f64 = 1e-6;
/// Most sides without a neighbour of one mesh; with more, none is looked beyond, and a warning says so. Each look takes
/// a microsecond or two: a quarter of a million take as long as reading as many triangles.
const SIDES_MAX: usize = 1 << 18;

/// Most tree nodes visited for all of them: a side of a compact mesh takes some hundreds, one of large triangles that
/// all cross each other takes as many as there are. About a second.
const NODES_MAX: usize = 1 << 28;
/// Testing a face takes as long as visiting this many nodes.
const NODES_PER_FACE: usize = 16;

/// A side, and the faces beyond it; [`NONE`] if there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seam {
    pub(super) side: u32,
    pub(super) faces: [u32; LOOKS.len()],
}

/// The seams of a mesh, by side; `None` if they are too much work.
pub(super) fn find(mesh: &Mesh, twins: &[u32]) -> Option<Vec<Seam>> {
    find_within(mesh, twins, NODES_MAX)
}

fn find_within(mesh: &Mesh, twins: &[u32], nodes_max: usize) -> Option<Vec<Seam>> {
    let open = || (0u32..).zip(twins).filter(|(_, twin)| **twin == NONE);
    if open().nth(SIDES_MAX).is_some() {
        return None;
    }
    let mut left = nodes_max;
    let mut seams = Vec::new();
    for (side, _) in open() {
        let faces = LOOKS.map(|t| mesh.face_beyond(side, t, &mut left).unwrap_or(NONE));
        if left == 0 {
            return None;
        }
        if faces.iter().any(|face| *face != NONE) {
            seams.push(Seam { side, faces });
        }
    }
    Some(seams)
}

impl Mesh {
    /// A face just beyond a side, at a position along it.
    ///
    /// * `left` - nodes that may still be visited; at 0 nothing is reported.
    fn face_beyond(&self, side: u32, t: f64, left: &mut usize) -> Option<u32> {
        let face = side / 3;
        let normal = self.face_normal(face)?;
        let corners = self.triangle(face);
        let (from, to) = (
            corners[(side % 3) as usize],
            corners[((side + 1) % 3) as usize],
        );
        let beyond = BEYOND * self.radius;
        let outward = (to - from).cross(&normal).try_normalize(0.0)?;
        let point = from + (to - from) * t + outward * beyond;

        let nodes = self.tree.nodes();
        let near = point - self.tree.origin();
        let holds = |place: u32| {
            let node = &nodes[place as usize];
            (0..3).all(|k| {
                let (low, high) = (f64::from(node.min[k]), f64::from(node.max[k]));
                low - 2.0 * beyond <= near[k] && near[k] <= high + 2.0 * beyond
            })
        };
        let mut waiting = [0u32; NODES_WAITING_MAX];
        let mut len = 1;
        while len > 0 {
            *left = left.checked_sub(1)?;
            len -= 1;
            let place = waiting[len];
            if !holds(place) {
                continue;
            }
            match nodes[place as usize].below(place) {
                Below::Nodes(left, right) => {
                    waiting[len] = right;
                    waiting[len + 1] = left;
                    len += 2;
                }
                Below::Row(..) => {}
                Below::Triangle(other) if other == face => {}
                Below::Triangle(other) => {
                    *left = left.saturating_sub(NODES_PER_FACE);
                    if self.is_near(other, &point, 2.0 * beyond) {
                        return Some(other);
                    }
                }
            }
        }
        None
    }

    /// Whether a point is within about `metres` of a face that has an area.
    fn is_near(&self, face: u32, point: &Point, metres: f64) -> bool {
        let Some(normal) = self.face_normal(face) else {
            return false;
        };
        let corners = self.triangle(face);
        let off = |k: usize| {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let outward = (to - from).cross(&normal);
            outward.dot(&(point - from)) - metres * outward.norm()
        };
        normal.dot(&(point - corners[0])).abs() <= metres && (0..3).all(|k| off(k) <= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::mesh::tests::sheet;

    #[test]
    fn bug_seams_of_triangles_that_all_lie_across_each_other_are_given_up() {
        let cross = |k: u32| {
            let (sin, cos) = f64::from(k).sin_cos();
            [
                Point::new(cos, sin, 0.0),
                Point::new(-cos, -sin, 0.1),
                Point::new(-sin, cos, -0.1),
            ]
        };
        let vertices = (0..500).flat_map(cross).collect();
        let faces = (0..500).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let soup = Mesh::new(vertices, faces, None).unwrap();
        let twins = soup.adjacency.twins();
        assert!(find_within(&soup, twins, 100_000).is_none());
        // A sheet of sixteen times as many triangles has a border, and enough time for it.
        let sheet = sheet(64);
        assert!(find_within(&sheet, sheet.adjacency.twins(), 100_000).is_some());
    }
}
