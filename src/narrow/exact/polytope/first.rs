//! The start of a polytope: a tetrahedron of known vertices, or a cap and vertices below it.

use super::super::newton::Cap;
use super::super::pair::{CoreGap, Held, NO_ELEMENT, Pair, Vertex, frame, unit};
use super::super::simplex::{Simplex, normal_of};
use super::{Place, Polytope};
use crate::math::Vec3;

/// Sine of 60 degrees.
const SIXTY: f64 = 0.866_025_403_784_438_6;

/// Corners and neighbours of the faces of an antiprism: the cap, the faces from each of its sides to a corner below,
/// those from each two corners below to one above, and the bottom.
const ANTIPRISM: [([Place; 3], [Place; 3]); 8] = [
    ([0, 1, 2], [1, 2, 3]),
    ([0, 3, 1], [6, 4, 0]),
    ([1, 4, 2], [4, 5, 0]),
    ([2, 5, 0], [5, 6, 0]),
    ([3, 4, 1], [7, 2, 1]),
    ([4, 5, 2], [7, 3, 2]),
    ([5, 3, 0], [7, 1, 3]),
    ([3, 5, 4], [6, 5, 4]),
];

impl Polytope {
    /// A tetrahedron of `top` and three vertices on the other side of the origin; false if it is a sliver. A caller
    /// that knows the closest point begins with it, and need not test whether the cores overlap. The origin may still
    /// be outside: the faces that it lies in front of are then the nearest to it.
    ///
    /// * `out` - unit, from the origin to `top`.
    pub(in super::super) fn start_below(
        &mut self,
        pair: &Pair<'_>,
        top: Vertex,
        out: &Vec3,
    ) -> bool {
        self.clear();
        let (one, other) = frame(out);
        self.vertices.push(top);
        for (x, y) in [(1.0, 0.0), (-0.5, SIXTY), (-0.5, -SIXTY)] {
            // The support is queried in the direction that it minimises.
            self.vertices.push(pair.support(&-(one * x + other * y)));
        }
        self.close_first()
    }

    /// Where to place a point that represents a cap: on the same side of the way out as before; `None`: it was on no
    /// side.
    ///
    /// * `out`, `depth_m` - as in [`Polytope::start_under`].
    pub(in super::super) fn beside(
        out: &Vec3,
        depth_m: f64,
        cap: &Cap,
        was: &Vec3,
    ) -> Option<Vec3> {
        let side = unit(&(was - out * out.dot(was)))?;
        Some(standing(out, depth_m, cap, &side))
    }

    /// An antiprism: three points in the plane that the difference reaches according to the cap, and three vertices
    /// below, around the middle. The three points need not lie in the difference, see [`Cap::rise`].
    ///
    /// * `out` - unit, from the origin to the cap.
    /// * `depth_m` - distance of that plane.
    pub(in super::super) fn start_under(
        &mut self,
        pair: &Pair<'_>,
        out: &Vec3,
        depth_m: f64,
        cap: &Cap,
    ) {
        self.clear();
        let (one, other) = frame(out);
        let around = [(1.0, 0.0), (-0.5, SIXTY), (-0.5, -SIXTY)].map(|(x, y)| one * x + other * y);
        for side in &around {
            self.vertices.push(Vertex {
                w: standing(out, depth_m, cap, side),
                of_a: NO_ELEMENT,
                of_b: NO_ELEMENT,
                ..Vertex::default()
            });
        }
        for k in [2, 0, 1] {
            // Between two of the points above; the support is queried in the direction that it minimises.
            self.vertices.push(pair.support(&around[k]));
        }
        self.met.resize(self.vertices.len(), 0);
        for (corners, beside) in ANTIPRISM {
            self.put_face(corners, beside);
        }
    }

    /// A tetrahedron of three vertices and the farthest vertex on the other side; false if it is a sliver. It need not
    /// contain the origin.
    ///
    /// * `out` - unit, from the origin to the three.
    pub(in super::super) fn start_at(
        &mut self,
        pair: &Pair<'_>,
        face: [Vertex; 3],
        out: &Vec3,
    ) -> bool {
        self.clear();
        let [p, q, r] = face;
        let top = pair.support(out);
        self.vertices.extend_from_slice(&[p, q, r, top]);
        self.close_first()
    }

    /// Makes the faces of the first four vertices; false if they are a sliver.
    fn close_first(&mut self) -> bool {
        let whole = self.vertices.first_chunk().is_some_and(has_volume);
        if whole {
            self.tetrahedron();
        }
        whole
    }

    /// A tetrahedron with a volume, or the gap if the difference is flat.
    ///
    /// * `axes` - orthogonal; if the simplex is not usable, the tetrahedron begins along one of them.
    #[allow(clippy::result_large_err, reason = "lives on the stack for one query")]
    pub(in super::super) fn start(
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
        let (side, other) = frame(&along);
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
}

/// A point that represents a cap, on a side of the way out.
fn standing(out: &Vec3, depth_m: f64, cap: &Cap, side: &Vec3) -> Vec3 {
    out * depth_m + side * (depth_m * cap.rise())
}

/// Whether a tetrahedron has a volume.
fn has_volume(vertices: &[Vertex; 4]) -> bool {
    let w = vertices.map(|v| v.w);
    let normal = (w[1] - w[0]).cross(&(w[2] - w[0]));
    let area = normal.norm();
    let height = normal.dot(&(w[3] - w[0])).abs();
    area > 0.0 && height > 1e-3 * area * area.sqrt()
}

/// The gap if the difference has no thickness along `normal`: 0 up to rounding, and any motion along it separates.
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
    // A run from scratch has no points of the cores to report.
    let apart_m = if simplex.count == 0 {
        f64::INFINITY
    } else {
        (point_b - point_a).norm()
    };
    CoreGap {
        lower,
        upper: apart_m.max(lower),
        normal,
        point_a,
        point_b,
        held: Held::default(),
    }
}
