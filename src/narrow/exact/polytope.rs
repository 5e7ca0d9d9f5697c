//! A convex polytope that grows: faces with neighbours, and the step that adds a vertex.
//!
//! In: vertices of the Minkowski difference, or three that represent a cap of it. Out: a closed surface and its face
//! nearest to the origin.

mod first;
mod shell;

use super::pair::{Vertex, unit};
use super::simplex::Simplex;
use crate::math::Vec3;

pub use shell::Shell;

/// A triangle of the polytope; corners counter-clockwise seen from outside.
#[derive(Clone, Copy)]
pub(super) struct Face {
    /// Unit, outward; zero when it has no area.
    pub(super) normal: Vec3,
    /// Least dot product of a corner with `normal`: a lower bound on the triangle's distance from the origin. Infinite
    /// if it has no area.
    pub(super) distance: f64,
    pub(super) corners: [Place; 3],
    /// Face across the edge from corner `k` to corner `k + 1`.
    beside: [Place; 3],
    pub(super) alive: bool,
}

const _: () = assert!(size_of::<Face>() == 48, "a query makes some dozens");

/// Index of a vertex or of a face.
type Place = u16;

/// The next corner of a triangle.
const NEXT: [usize; 3] = [1, 2, 0];

/// An edge of the hole around a new vertex: from, to, and the face on its far side.
#[derive(Clone, Copy)]
struct Edge {
    from: Place,
    to: Place,
    outside: Place,
    /// Index of the edge in that face.
    slot: u8,
}

/// Memory of one thread, reused by every query.
#[derive(Default)]
pub(super) struct Polytope {
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<Face>,
    /// Distance of each face, infinite for a dead one: the search for the nearest one reads this.
    distances: Vec<f64>,
    /// By vertex: the vertex that was last added with this one on its rim.
    met: Vec<Place>,
    hole: Vec<Edge>,
    /// Edges to visit: a buried face, and the index of its edge.
    stack: Vec<(Place, u8)>,
}

impl Polytope {
    /// The face nearest to the origin; of equally near ones the first.
    pub(super) fn nearest(&self) -> Option<usize> {
        // The least of eight lanes, then its index: a single deciding comparison instead of one per face.
        let mut lanes = [f64::INFINITY; 8];
        let (whole, rest) = self.distances.as_chunks::<8>();
        for chunk in whole {
            for (least, distance) in lanes.iter_mut().zip(chunk) {
                *least = lesser(*distance, *least);
            }
        }
        let least = (lanes.iter().chain(rest)).fold(f64::INFINITY, |least, d| lesser(*d, least));
        let place = self.distances.iter().position(|d| *d <= least);
        place.filter(|_| least < f64::INFINITY)
    }

    /// Corners of a face.
    pub(super) fn corners(&self, face: &Face) -> [Vertex; 3] {
        face.corners.map(|k| self.vertices[usize::from(k)])
    }

    fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.distances.clear();
        self.met.clear();
    }

    fn put_face(&mut self, corners: [Place; 3], beside: [Place; 3]) {
        let [a, b, c] = corners.map(|k| self.vertices[usize::from(k)].w);
        // The shorter of the edges to the last corner: a sliver keeps its digits.
        let (from_a, from_b) = (c - a, c - b);
        let closer = from_a.norm_squared() <= from_b.norm_squared();
        let edge = if closer { from_a } else { from_b };
        let normal = unit(&(b - a).cross(&edge));
        let distance = normal.map_or(f64::INFINITY, |n| {
            lesser(lesser(n.dot(&a), n.dot(&b)), n.dot(&c))
        });
        self.distances.push(distance);
        self.faces.push(Face {
            normal: normal.unwrap_or_default(),
            distance,
            corners,
            beside,
            alive: true,
        });
    }

    /// Adds `new`: the faces that it sees are removed, their rim is joined to it. False if the surface broke.
    pub(super) fn grow(&mut self, from: usize, new: Vertex, tiny: f64) -> bool {
        let Ok(first) = Place::try_from(from) else {
            return false;
        };
        self.hole.clear();
        self.stack.clear();
        self.bury(from);
        self.stack.extend([(first, 2), (first, 1), (first, 0)]);
        // Flood over the faces that see the new vertex; the flood ends at the rim and visits it in order. Faces in the
        // new vertex's plane are removed too, so that no slivers stay.
        while let Some((place, edge)) = self.stack.pop() {
            let face = &self.faces[usize::from(place)];
            let edge = usize::from(edge);
            let outside = face.beside[edge];
            let (from, to) = (face.corners[edge], face.corners[NEXT[edge]]);
            let other = &self.faces[usize::from(outside)];
            if !other.alive {
                continue;
            }
            // In the other face the edge runs from `to` to `from`.
            let slot: u8 = match other.corners {
                [k, ..] if k == to => 0,
                [_, k, _] if k == to => 1,
                _ => 2,
            };
            let k = usize::from(slot);
            if other.corners[k] != to || other.corners[NEXT[k]] != from {
                return false;
            }
            let sees = other.normal.dot(&new.w) - other.distance > -tiny;
            if sees || other.distance == f64::INFINITY {
                self.bury(usize::from(outside));
                let [after, before] = [[1, 2], [2, 0], [0, 1]][k];
                self.stack.extend([(outside, before), (outside, after)]);
            } else {
                self.hole.push(Edge {
                    from,
                    to,
                    outside,
                    slot,
                });
            }
        }
        self.close(new)
    }

    /// Joins the rim to the new vertex. The rim must be one loop.
    fn close(&mut self, new: Vertex) -> bool {
        let count = self.hole.len();
        let place = |len: usize| Place::try_from(len).ok();
        let (Some(apex), Some(base), Some(end)) = (
            place(self.vertices.len()),
            place(self.faces.len()),
            place(self.faces.len() + count),
        ) else {
            return false;
        };
        if count < 3 {
            return false;
        }
        // Each edge starts where the last one ends, and a corner met twice would pinch the surface.
        let mut from = self.hole[count - 1].to;
        for edge in &self.hole {
            let met = std::mem::replace(&mut self.met[usize::from(edge.from)], apex);
            if edge.from != from || met == apex {
                return false;
            }
            from = edge.to;
        }
        self.vertices.push(new);
        self.met.push(0);
        let mut before = end - 1;
        for (k, this) in (base..end).enumerate() {
            let edge = self.hole[k];
            let after = if this + 1 == end { base } else { this + 1 };
            self.put_face([edge.from, edge.to, apex], [edge.outside, after, before]);
            self.faces[usize::from(edge.outside)].beside[usize::from(edge.slot)] = this;
            before = this;
        }
        true
    }

    fn bury(&mut self, place: usize) {
        self.faces[place].alive = false;
        self.distances[place] = f64::INFINITY;
    }

    /// Adds a vertex that is known to be far out, if any face sees it. False if the surface broke.
    pub(super) fn offer(&mut self, new: Vertex, tiny: f64) -> bool {
        // Vertices added close to each other are usually seen by the last faces made.
        let sees = |face: &Face| face.alive && face.normal.dot(&new.w) - face.distance > tiny;
        let seen = self.faces.iter().rposition(sees);
        seen.is_none_or(|from| self.grow(from, new, tiny))
    }

    /// Witnesses of the point of all faces, including dead ones, that is nearest to `target`, and its distance.
    pub(super) fn witnesses_near(&self, target: &Vec3) -> (f64, Vec3, Vec3) {
        let mut best = (f64::INFINITY, Vec3::zeros(), Vec3::zeros());
        for face in &self.faces {
            // No point of a face is nearer than its plane.
            if (face.normal.dot(target) - face.distance).abs() >= best.0 {
                continue;
            }
            let corners = self.corners(face).map(|corner| Vertex {
                w: corner.w - target,
                ..corner
            });
            // Only sub-simplices with the newest corner are tried: so each corner is the newest once.
            for turn in 0..3 {
                let mut simplex = Simplex::default();
                for k in 0..3 {
                    simplex.push(corners[(turn + k) % 3]);
                }
                if let Some(nearest) = simplex.nearest() {
                    simplex.keep(&nearest);
                }
                let (a, b) = simplex.witnesses();
                let off = (b - a - target).norm();
                if off < best.0 {
                    best = (off, a, b);
                }
            }
        }
        best
    }
}

/// The lesser of two numbers, or the second: one instruction, where `f64::min` takes five to handle NaN.
#[inline]
fn lesser(x: f64, y: f64) -> f64 {
    if x < y { x } else { y }
}
