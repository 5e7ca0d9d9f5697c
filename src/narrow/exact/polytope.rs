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
    /// Unit, outward; zero when it has no area.
    pub(super) normal: Vec3,
    /// Least dot product of a corner with `normal`: the triangle is not nearer to the origin. Infinite when it has no
    /// area.
    pub(super) distance: f64,
    pub(super) corners: [Place; 3],
    /// Face across the edge from corner `k` to corner `k + 1`.
    beside: [Place; 3],
    pub(super) alive: bool,
}

const _: () = assert!(size_of::<Face>() == 48, "a query makes some dozens");

/// Place of a vertex or of a face.
type Place = u16;

/// The corner behind each one of a triangle.
const NEXT: [usize; 3] = [1, 2, 0];

/// An edge of the hole around a new vertex: from, to, and the face that stays on its far side.
#[derive(Clone, Copy)]
struct Edge {
    from: Place,
    to: Place,
    outside: Place,
    /// Which edge of that face it is.
    slot: u8,
}

/// Memory of one thread, reused by every query.
#[derive(Default)]
pub(super) struct Polytope {
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<Face>,
    /// Distance of each face, infinite for a dead one: what the search for the nearest one reads.
    distances: Vec<f64>,
    /// By vertex: the one that was last put in with this one on its rim.
    met: Vec<Place>,
    hole: Vec<Edge>,
    /// Edges to go over: a buried face, and which edge of it.
    stack: Vec<(Place, u8)>,
}

impl Polytope {
    /// The face nearest to the origin; of equally near ones the first.
    pub(super) fn nearest(&self) -> Option<usize> {
        // The least of eight lanes, then where it stands: one comparison that decides instead of one for each face.
        let mut lanes = [f64::INFINITY; 8];
        let (whole, rest) = self.distances.as_chunks::<8>();
        for chunk in whole {
            for (least, distance) in lanes.iter_mut().zip(chunk) {
                *least = if *distance < *least {
                    *distance
                } else {
                    *least
                };
            }
        }
        let least = (lanes.iter().chain(rest)).fold(f64::INFINITY, |least, d| least.min(*d));
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

    /// A tetrahedron of `top` and three vertices that lie on the other side of the origin, as seen from it; false where
    /// it is a sliver. Whoever knows the closest point begins with it, and need not ask whether the cores overlap. The
    /// origin may be outside yet: the faces that it lies in front of are then those nearest to it.
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
        self.close_first()
    }

    /// A tetrahedron of three vertices and the one that is farthest the other way; false where it is a sliver. It need
    /// not hold the origin.
    ///
    /// * `out` - unit, from the origin to the three.
    pub(super) fn start_at(&mut self, pair: &Pair<'_>, face: [Vertex; 3], out: &Vec3) -> bool {
        self.clear();
        let [p, q, r] = face;
        let top = pair.support(out);
        self.vertices.extend_from_slice(&[p, q, r, top]);
        self.close_first()
    }

    /// Makes the faces of the first four vertices; false where they are a sliver.
    fn close_first(&mut self) -> bool {
        let whole = self.vertices.first_chunk().is_some_and(has_volume);
        if whole {
            self.tetrahedron();
        }
        whole
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
            self.vertices.extend_from_slice(&simplex.vertices);
            if self.close_first() {
                return Ok(());
            }
            self.vertices.clear();
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
        self.met.resize(self.vertices.len(), 0);
        for k in 0..4 {
            self.put_face(corners[k], beside[k]);
        }
    }

    fn put_face(&mut self, corners: [Place; 3], beside: [Place; 3]) {
        let [a, b, c] = corners.map(|k| self.vertices[usize::from(k)].w);
        let normal = unit(&normal_of(&a, &b, &c));
        let distance = normal.map_or(f64::INFINITY, |n| n.dot(&a).min(n.dot(&b)).min(n.dot(&c)));
        self.distances.push(distance);
        self.faces.push(Face {
            normal: normal.unwrap_or_default(),
            distance,
            corners,
            beside,
            alive: true,
        });
    }

    /// Puts `new` in: the faces it sees go, their rim is joined to it. False when that does not give a closed surface.
    pub(super) fn grow(&mut self, from: usize, new: Vertex, tiny: f64) -> bool {
        let Ok(first) = Place::try_from(from) else {
            return false;
        };
        self.hole.clear();
        self.stack.clear();
        self.bury(from);
        self.stack.extend([(first, 2), (first, 1), (first, 0)]);
        // Flood over the faces that see the new vertex; where the flood ends is the rim, met in its order. What lies in
        // the new vertex's plane goes too, so that no slivers stay.
        while let Some((place, edge)) = self.stack.pop() {
            let face = &self.faces[usize::from(place)];
            let edge = usize::from(edge);
            let outside = face.beside[edge];
            let (from, to) = (face.corners[edge], face.corners[NEXT[edge]]);
            let other = &self.faces[usize::from(outside)];
            if !other.alive {
                continue;
            }
            // The edge is the other's from `to` to `from`.
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
        // Each edge starts where the one before ends, and a corner met twice would pinch the surface.
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

    /// Puts in a vertex that is known to be far out, if any face sees it. False when the surface broke.
    pub(super) fn offer(&mut self, new: Vertex, tiny: f64) -> bool {
        // What is put in side by side is mostly seen by the last faces made.
        let sees = |face: &Face| face.alive && face.normal.dot(&new.w) - face.distance > tiny;
        let seen = self.faces.iter().rposition(sees);
        seen.is_none_or(|from| self.grow(from, new, tiny))
    }

    /// Witnesses of the point of all faces, dead ones too, that is nearest to `target`, and how far off it is.
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

/// Whether a tetrahedron is not a sliver.
fn has_volume(vertices: &[Vertex; 4]) -> bool {
    let w = vertices.map(|v| v.w);
    let normal = (w[1] - w[0]).cross(&(w[2] - w[0]));
    let area = normal.norm();
    let height = normal.dot(&(w[3] - w[0])).abs();
    area > 0.0 && height > 1e-3 * area * area.sqrt()
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
