//! Neighbours that share no whole edge: tiles laid in bond, corners that were not welded, sheets that are doubled.
//!
//! In: a mesh and its sides that have no neighbour. Out: for each the faces that lie just beyond it. They are no part
//! of the topology (such a mesh is open); they tell where the surface goes on.

use super::tree::{Below, NODES_WAITING_MAX};
use super::{Mesh, adjacency::NONE};
use crate::math::Point;

/// Where along a side is looked beyond it: near its ends too, for what lies beyond a corner of a tile may begin just
/// there.
const LOOKS: [f64; 5] = [0.01, 0.2, 0.5, 0.8, 0.99];
/// How far beyond a side is looked, as a share of the mesh's radius: narrower cracks are none.
const BEYOND: f64 = 1e-6;
/// Sides without a neighbour of one mesh; of more none is looked beyond, and a warning says so. Each look takes a
/// microsecond or two: a quarter of a million are the time of reading as many triangles.
pub(super) const SIDES_MAX: usize = 1 << 18;

/// A side, and faces beyond it; [`NONE`] where there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seam {
    pub(super) side: u32,
    pub(super) faces: [u32; LOOKS.len()],
}

/// The seams of a mesh, by side.
pub(super) fn find(mesh: &Mesh, twins: &[u32]) -> Vec<Seam> {
    let sides = (0u32..).zip(twins).filter(|(_, twin)| **twin == NONE);
    let seam = |(side, _)| {
        let faces = LOOKS.map(|t| mesh.face_beyond(side, t).unwrap_or(NONE));
        let any = faces.iter().any(|face| *face != NONE);
        any.then_some(Seam { side, faces })
    };
    sides.filter_map(seam).collect()
}

impl Mesh {
    /// A face just beyond a side, at a place along it.
    fn face_beyond(&self, side: u32, t: f64) -> Option<u32> {
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
                Below::Triangle(other) if self.is_near(other, &point, 2.0 * beyond) => {
                    return Some(other);
                }
                Below::Triangle(_) => {}
            }
        }
        None
    }

    /// Whether a point is within about so many metres of a face that has an area.
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
