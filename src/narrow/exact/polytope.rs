//! A convex polytope that grows: faces with neighbours, a first tetrahedron, and the step that puts a vertex in.
//!
//! In: vertices of the Minkowski difference. Out: a closed surface and its face nearest to the origin.

use super::pair::{CoreGap, Held, Pair, Vertex, across, unit};
use super::simplex::{Simplex, normal_of};
use crate::math::Vec3;

/// Sine of 60 degrees.
const SIXTY: f64 = 0.866_025_403_784_438_6;

/// A triangle of the polytope; corners counter-clockwise seen from outside.
#[derive(Clone, Copy)]
pub(super) struct Face {
    pub(super) corners: [usize; 3],
    /// Face across the edge from corner `k` to corner `k + 1`.
    pub(super) beside: [usize; 3],
    /// Unit, outward; zero when it has no area.
    pub(super) normal: Vec3,
    /// Least dot product of a corner with `normal`: the triangle is not nearer to the origin.
    pub(super) distance: f64,
    pub(super) alive: bool,
}

/// An edge of the hole around a new vertex: from, to, and the face that stays on its far side.
#[derive(Clone, Copy)]
struct Edge {
    from: usize,
    to: usize,
    outside: usize,
    slot: usize,
}

/// Memory of one thread, reused by every query.
#[derive(Default)]
pub(super) struct Polytope {
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<Face>,
    /// Distance of each face, infinite for a dead one: what the search for the nearest one reads.
    distances: Vec<f64>,
    hole: Vec<Edge>,
    stack: Vec<usize>,
}

impl Polytope {
    pub(super) fn nearest(&self) -> Option<usize> {
        let mut best = (None, f64::INFINITY);
        for (place, distance) in self.distances.iter().enumerate() {
            if *distance < best.1 {
                best = (Some(place), *distance);
            }
        }
        best.0
    }

    fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.distances.clear();
    }

    /// A tetrahedron of `top` and three vertices that lie on the other side of the origin, as seen from it; false where
    /// that does not hold the origin. Whoever knows the closest point begins with it, and need not ask whether the
    /// cores overlap.
    ///
    /// * `out` - unit, from the origin to `top`.
    pub(super) fn start_below(&mut self, pair: &Pair<'_>, top: Vertex, out: &Vec3) -> bool {
        self.clear();
        let one = across(out);
        let other = out.cross(&one);
        self.vertices.push(top);
        for (x, y) in [(1.0, 0.0), (-0.5, SIXTY), (-0.5, -SIXTY)] {
            // The support is asked for the way it is least along.
            self.vertices.push(pair.support(&-(one * x + other * y)));
        }
        self.tetrahedron();
        let tiny = pair.tiny();
        (self.faces.iter()).all(|face| face.normal != Vec3::zeros() && face.distance > tiny)
    }

    /// A tetrahedron with a volume, or the gap when the difference is flat.
    ///
    /// * `axes` - orthogonal; where the simplex does not do, the tetrahedron begins along one of them.
    #[allow(clippy::result_large_err, reason = "lives on the stack for one query")]
    pub(super) fn start(
        &mut self,
        pair: &Pair<'_>,
        simplex: &Simplex,
        axes: &[Vec3; 3],
    ) -> Result<(), CoreGap> {
        self.clear();
        let flat_below = 2.0 * pair.tiny();
        if simplex.count == 4 {
            let w = simplex.vertices.map(|v| v.w);
            let normal = (w[1] - w[0]).cross(&(w[2] - w[0]));
            let area = normal.norm();
            let height = normal.dot(&(w[3] - w[0])).abs();
            // Good enough when it is not a sliver.
            if area > 0.0 && height > 1e-3 * area * area.sqrt() {
                self.vertices.extend_from_slice(&simplex.vertices);
                self.tetrahedron();
                return Ok(());
            }
        }
        // Two ends along some axis, then the farthest from the line, then from the plane.
        let mut ends = axes.map(|axis| (pair.support(&axis), pair.support(&-axis)));
        ends.sort_by(|s, t| {
            (t.0.w - t.1.w)
                .norm_squared()
                .total_cmp(&(s.0.w - s.1.w).norm_squared())
        });
        let (p, q) = ends[0];
        let Some(along) = unit(&(q.w - p.w)).filter(|_| (q.w - p.w).norm() > flat_below) else {
            return Err(flat(pair, &Vec3::z(), simplex));
        };
        let side = across(&along);
        let other = along.cross(&side);
        let candidates = [side, -side, other, -other].map(|d| pair.support(&d));
        let off = |v: &Vertex| {
            let d = v.w - p.w;
            (d - along * d.dot(&along)).norm()
        };
        let mut r = candidates[0];
        for c in candidates {
            if off(&c) > off(&r) {
                r = c;
            }
        }
        let normal = normal_of(&p.w, &q.w, &r.w);
        let Some(normal) = unit(&normal).filter(|_| off(&r) > flat_below) else {
            return Err(flat(pair, &side, simplex));
        };
        let (low, high) = (pair.support(&normal), pair.support(&-normal));
        let height = |v: &Vertex| normal.dot(&(v.w - p.w)).abs();
        let s = if height(&low) > height(&high) {
            low
        } else {
            high
        };
        if height(&s) <= flat_below {
            return Err(flat(pair, &normal, simplex));
        }
        self.vertices.extend_from_slice(&[p, q, r, s]);
        self.tetrahedron();
        Ok(())
    }

    /// Faces of the first four vertices, turned outward.
    fn tetrahedron(&mut self) {
        let w = |k: usize| self.vertices[k].w;
        if (w(1) - w(0)).cross(&(w(2) - w(0))).dot(&(w(3) - w(0))) > 0.0 {
            self.vertices.swap(1, 2);
        }
        // The face opposite to 3 is 0 1 2, seen from outside; the others share its edges.
        let corners = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        let beside = [[1, 2, 3], [3, 2, 0], [1, 3, 0], [2, 1, 0]];
        for k in 0..4 {
            let face = self.face(corners[k], beside[k]);
            self.push(face);
        }
    }

    fn face(&self, corners: [usize; 3], beside: [usize; 3]) -> Face {
        let [a, b, c] = corners.map(|k| self.vertices[k].w);
        let normal = unit(&normal_of(&a, &b, &c));
        let distance = normal.map_or(f64::INFINITY, |n| n.dot(&a).min(n.dot(&b)).min(n.dot(&c)));
        Face {
            corners,
            beside,
            normal: normal.unwrap_or_default(),
            distance,
            alive: true,
        }
    }

    /// Puts `new` in: the faces it sees go, their rim is joined to it. False when that does not give a closed surface.
    pub(super) fn grow(&mut self, from: usize, new: Vertex, tiny: f64) -> bool {
        self.hole.clear();
        self.stack.clear();
        self.stack.push(from);
        self.bury(from);
        // Flood over the faces that see the new vertex; where the flood ends is the rim. What lies in the new vertex's
        // plane goes too, so that no slivers stay.
        while let Some(place) = self.stack.pop() {
            let face = self.faces[place];
            for k in 0..3 {
                let next = face.beside[k];
                let other = &self.faces[next];
                if !other.alive {
                    continue;
                }
                let height = other
                    .normal
                    .dot(&(new.w - self.vertices[other.corners[0]].w));
                if other.normal == Vec3::zeros() || height > -tiny {
                    self.bury(next);
                    self.stack.push(next);
                    continue;
                }
                let (from, to) = (face.corners[k], face.corners[(k + 1) % 3]);
                let slot =
                    (0..3).find(|&s| other.corners[s] == to && other.corners[(s + 1) % 3] == from);
                let Some(slot) = slot else {
                    return false;
                };
                self.hole.push(Edge {
                    from,
                    to,
                    outside: next,
                    slot,
                });
            }
        }
        self.close(new)
    }

    /// Joins the rim to the new vertex. The rim must be one loop.
    fn close(&mut self, new: Vertex) -> bool {
        let count = self.hole.len();
        if count < 3 {
            return false;
        }
        // Chain the edges: each starts where the one before ends.
        for k in 0..count - 1 {
            let end = self.hole[k].to;
            let Some(next) = (k + 1..count).find(|&j| self.hole[j].from == end) else {
                return false;
            };
            self.hole.swap(k + 1, next);
        }
        if self.hole[count - 1].to != self.hole[0].from {
            return false;
        }
        // A corner met twice would pinch the surface.
        for k in 0..count {
            if self.hole[k + 1..]
                .iter()
                .any(|e| e.from == self.hole[k].from)
            {
                return false;
            }
        }
        let apex = self.vertices.len();
        self.vertices.push(new);
        let base = self.faces.len();
        for k in 0..count {
            let edge = self.hole[k];
            let before = base + if k == 0 { count - 1 } else { k - 1 };
            let after = base + if k + 1 == count { 0 } else { k + 1 };
            let face = self.face([edge.from, edge.to, apex], [edge.outside, after, before]);
            self.push(face);
            self.faces[edge.outside].beside[edge.slot] = base + k;
        }
        true
    }

    fn push(&mut self, face: Face) {
        self.distances.push(face.distance);
        self.faces.push(face);
    }

    fn bury(&mut self, place: usize) {
        self.faces[place].alive = false;
        self.distances[place] = f64::INFINITY;
    }

    /// Puts in a vertex that is known to be far out, if any face sees it. False when the surface broke.
    pub(super) fn offer(&mut self, new: Vertex, tiny: f64) -> bool {
        let seen = self.faces.iter().enumerate().find_map(|(place, face)| {
            let height = face.normal.dot(&(new.w - self.vertices[face.corners[0]].w));
            (face.alive && height > tiny).then_some(place)
        });
        seen.is_none_or(|from| self.grow(from, new, tiny))
    }

    /// Witnesses of the point of all faces, dead ones too, that is nearest to `target`, and how far off it is.
    pub(super) fn witnesses_near(&self, target: &Vec3) -> (f64, Vec3, Vec3) {
        let mut best = (f64::INFINITY, Vec3::zeros(), Vec3::zeros());
        for face in &self.faces {
            let corners = face.corners.map(|k| {
                let corner = self.vertices[k];
                Vertex {
                    w: corner.w - target,
                    ..corner
                }
            });
            // Reducing tries what holds the newest corner: each one is the newest once.
            for turn in 0..3 {
                let mut simplex = Simplex::default();
                for k in 0..3 {
                    simplex.push(corners[(turn + k) % 3]);
                }
                let _ = simplex.reduce(0.0);
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

/// The gap when the difference has no thickness along `normal`: 0 but for rounding, separated at once along it.
fn flat(pair: &Pair<'_>, normal: &Vec3, simplex: &Simplex) -> CoreGap {
    let (one, other) = (
        normal.dot(&pair.support(normal).w),
        -normal.dot(&pair.support(&-normal).w),
    );
    let (lower, normal) = if one >= other {
        (one, *normal)
    } else {
        (other, -*normal)
    };
    let (point_a, point_b) = simplex.witnesses();
    CoreGap {
        lower,
        upper: (point_b - point_a).norm().max(lower),
        normal,
        point_a,
        point_b,
        held: Held::default(),
    }
}
