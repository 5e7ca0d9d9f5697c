//! The expanding polytope: the depth of two overlapping cores.
//!
//! In: a pair and the simplex that GJK ended with. Out: the gap (minus the least translation that separates) with both
//! certified ends.
//!
//! A polytope inscribed in the Minkowski difference grows at its face nearest to the origin. `f` at that face's normal
//! is the lower end. The upper end is minus the least plane distance over all faces: the polytope is closed and has the
//! origin inside, so a ball of that radius fits into it, and every point of the ball is a difference of two points of
//! the cores. Faces that look away from the origin by rounding only make that end looser, never wrong.
//!
//! Source: van den Bergen 2001, Proximity queries and penetration depth computation on 3D game objects.

use std::cell::RefCell;

use super::newton::{self, Refined};
use super::pair::{CoreGap, Pair, Vertex, across, unit};
use super::simplex::{Simplex, normal_of};
use crate::math::Vec3;

/// Growth steps: polytopes end by themselves long before, overlapping curved cores take 40 to 120.
const STEPS_MAX: usize = 300;
/// Relative width at which curved cores end; polytopes end at roundoff.
const CURVED: f64 = 5e-8;
/// Height of the difference over a face, in parts of the smaller core, from which its features are worth a Newton run.
const NEAR: f64 = 2e-2;
/// Cosine between face normals beyond which a face belongs to another local optimum.
const ANOTHER: f64 = 0.98;

/// A triangle of the polytope; corners counter-clockwise seen from outside.
#[derive(Clone, Copy)]
struct Face {
    corners: [usize; 3],
    /// Face across the edge from corner `k` to corner `k + 1`.
    beside: [usize; 3],
    /// Unit, outward; zero when it has no area.
    normal: Vec3,
    /// Least dot product of a corner with `normal`: the triangle is not nearer to the origin.
    distance: f64,
    alive: bool,
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
struct Polytope {
    vertices: Vec<Vertex>,
    faces: Vec<Face>,
    hole: Vec<Edge>,
    stack: Vec<usize>,
}

thread_local! {
    static SCRATCH: RefCell<Polytope> = RefCell::new(Polytope::default());
}

/// The gap of two cores that overlap or touch.
pub(super) fn depth(pair: &Pair<'_>, simplex: &Simplex) -> CoreGap {
    SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
        Ok(mut polytope) => polytope.run(pair, simplex),
        Err(_) => Polytope::default().run(pair, simplex),
    })
}

/// Best end found so far.
struct Best {
    /// `f(normal)`.
    lower: f64,
    normal: Vec3,
    /// The face it was found at; faces are never overwritten, so it stays readable.
    face: usize,
}

impl Best {
    fn offer(&mut self, lower: f64, normal: &Vec3, face: usize) {
        if lower > self.lower {
            self.face = face;
            self.lower = lower;
            self.normal = *normal;
        }
    }
}

impl Polytope {
    fn run(&mut self, pair: &Pair<'_>, simplex: &Simplex) -> CoreGap {
        let flat = match self.start(pair, simplex) {
            Ok(()) => None,
            Err(flat) => Some(flat),
        };
        if let Some(gap) = flat {
            return gap;
        }
        let tolerance = if pair.polytopes {
            pair.tiny()
        } else {
            CURVED * pair.scale
        };
        let mut best = Best {
            lower: f64::NEG_INFINITY,
            normal: Vec3::z(),
            face: 0,
        };
        let mut refined: Option<Refined> = None;
        let near = NEAR * pair.a.reach().min(pair.b.reach());
        let (mut nearest, mut fits, mut last) = (0, f64::NEG_INFINITY, f64::NEG_INFINITY);
        for _ in 0..STEPS_MAX {
            let Some(place) = self.nearest() else {
                break;
            };
            nearest = place;
            let face = self.faces[place];
            fits = fits.max(face.distance);
            let new = pair.support(&-face.normal);
            let reach = face.normal.dot(&new.w);
            best.offer(-reach, &-face.normal, place);
            last = -reach;
            if reach - face.distance <= tolerance || -best.lower - face.distance <= tolerance {
                break;
            }
            // A first look at the features: the closest point itself becomes a corner, which saves most of the steps.
            let looks_new = refined.is_none_or(|r| r.normal.dot(&face.normal) > -ANOTHER);
            if !pair.polytopes && looks_new && reach - face.distance <= near {
                let corners = face.corners.map(|k| self.vertices[k]);
                let found = newton::solve(pair, &corners, &self.project(place).2, &-face.normal);
                if let Some(found) = found.filter(|r| r.value > best.lower) {
                    best.offer(found.value, &found.normal, place);
                    refined = Some(found);
                    let corner = found.corner();
                    let height = face.normal.dot(&corner.w) - face.distance;
                    if height > pair.tiny() {
                        if self.grow(place, corner, pair.tiny()) {
                            continue;
                        }
                        break;
                    }
                }
            }
            let known = face.corners.iter().any(|&k| self.vertices[k].w == new.w);
            if known || !self.grow(place, new, pair.tiny()) {
                break;
            }
        }
        if let Some(found) = refined.filter(|r| r.value >= best.lower) {
            return CoreGap {
                lower: best.lower,
                upper: (-fits).max(best.lower),
                normal: found.normal,
                point_a: found.point_a,
                point_b: found.point_b,
            };
        }
        // Of directions that are equally good the last one has the witnesses.
        match self.faces.get(nearest) {
            Some(face) if last >= best.lower - pair.tiny() => best.normal = -face.normal,
            _ => nearest = best.face,
        }
        self.finish(pair, &mut best, nearest, fits)
    }

    /// Witnesses, and Newton where circles take part.
    fn finish(&self, pair: &Pair<'_>, best: &mut Best, nearest: usize, fits: f64) -> CoreGap {
        let (mut point_a, mut point_b, weights) = self.project(nearest);
        // Of faces in one plane only one holds the projection of the origin.
        if weights.iter().any(|w| *w < -1e-9) {
            let mut most = weights.iter().copied().fold(0.0, f64::min);
            for (place, face) in self.faces.iter().enumerate() {
                if face.alive && face.distance <= self.faces[nearest].distance + pair.tiny() {
                    let found = self.project(place);
                    let worst = found.2.iter().copied().fold(0.0, f64::min);
                    if worst > most {
                        most = worst;
                        (point_a, point_b) = (found.0, found.1);
                    }
                }
            }
        }
        if !pair.polytopes
            && let Some(face) = self.faces.get(nearest)
        {
            let corners = face.corners.map(|k| self.vertices[k]);
            let weights = self.project(nearest).2;
            if let Some(found) = newton::solve(pair, &corners, &weights, &best.normal)
                && found.value > best.lower
            {
                best.offer(found.value, &found.normal, nearest);
                (point_a, point_b) = (found.point_a, found.point_b);
            }
        }
        CoreGap {
            lower: best.lower,
            upper: (-fits).max(best.lower),
            normal: best.normal,
            point_a,
            point_b,
        }
    }

    /// Witnesses at the projection of the origin onto a face, clipped to it, and the unclipped weights.
    fn project(&self, place: usize) -> (Vec3, Vec3, [f64; 3]) {
        let Some(face) = self.faces.get(place) else {
            return (Vec3::zeros(), Vec3::zeros(), [1.0, 0.0, 0.0]);
        };
        let [p, q, r] = face.corners.map(|k| self.vertices[k]);
        let normal = normal_of(&p.w, &q.w, &r.w);
        let square = normal.norm_squared();
        let to = -p.w;
        let mut weights = [0.0; 3];
        weights[1] = normal.dot(&to.cross(&(r.w - p.w))) / square;
        weights[2] = normal.dot(&(q.w - p.w).cross(&to)) / square;
        weights[0] = 1.0 - weights[1] - weights[2];
        if !weights.iter().all(|w| w.is_finite()) {
            weights = [1.0, 0.0, 0.0];
        }
        let clipped = weights.map(|w| w.max(0.0));
        let whole: f64 = clipped.iter().sum();
        let mix =
            |x: Vec3, y: Vec3, z: Vec3| (x * clipped[0] + y * clipped[1] + z * clipped[2]) / whole;
        (mix(p.a, q.a, r.a), mix(p.b, q.b, r.b), weights)
    }

    fn nearest(&self) -> Option<usize> {
        let mut best = (None, f64::INFINITY);
        for (place, face) in self.faces.iter().enumerate() {
            if face.alive && face.distance < best.1 {
                best = (Some(place), face.distance);
            }
        }
        best.0
    }

    /// A tetrahedron with a volume, or the gap when the difference is flat.
    fn start(&mut self, pair: &Pair<'_>, simplex: &Simplex) -> Result<(), CoreGap> {
        self.vertices.clear();
        self.faces.clear();
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
        let mut ends = [Vec3::x(), Vec3::y(), Vec3::z()]
            .map(|axis| (pair.support(&axis), pair.support(&-axis)));
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
            self.faces.push(face);
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
    fn grow(&mut self, from: usize, new: Vertex, tiny: f64) -> bool {
        self.hole.clear();
        self.stack.clear();
        self.stack.push(from);
        self.faces[from].alive = false;
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
                    self.faces[next].alive = false;
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
        let base = self.slots(count);
        for k in 0..count {
            let edge = self.hole[k];
            let place = self.place(base, k);
            let (before, after) = (
                self.place(base, (k + count - 1) % count),
                self.place(base, (k + 1) % count),
            );
            let face = self.face([edge.from, edge.to, apex], [edge.outside, after, before]);
            self.faces[place] = face;
            self.faces[edge.outside].beside[edge.slot] = place;
        }
        true
    }

    /// Room for `count` more faces at the end.
    fn slots(&mut self, count: usize) -> usize {
        let base = self.faces.len();
        let empty = Face {
            corners: [0; 3],
            beside: [0; 3],
            normal: Vec3::zeros(),
            distance: f64::INFINITY,
            alive: false,
        };
        self.faces.resize(base + count, empty);
        base
    }

    #[allow(
        clippy::unused_self,
        reason = "keeps the place of new faces in one spot"
    )]
    fn place(&self, base: usize, k: usize) -> usize {
        base + k
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
    }
}
