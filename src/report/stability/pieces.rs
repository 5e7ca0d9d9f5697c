//! Polytopes with a radius, and the direction that separates two of them most.
//!
//! In: shapes at poses. Out: corners, edges and normals in [`Dd`], and the gap of two polytopes.

use super::dd::{Dd, Place, V3};
use crate::shape::ShapeSpec;

/// The convex hull of corners, expanded by a radius.
pub(super) struct Piece {
    corners: Vec<V3>,
    /// A point and the unit direction of each edge.
    edges: Vec<(V3, V3)>,
    /// Unit directions of the edges; for a box each only once.
    ways: Vec<V3>,
    normals: Vec<V3>,
    margin: Dd,
}

impl Piece {
    /// * `edges`, `faces` - indices of corners; they may contain more than the edges and faces of the hull.
    fn new(corners: Vec<V3>, edges: &[(usize, usize)], faces: &[[usize; 3]], margin: f64) -> Self {
        let way = |&(i, j): &(usize, usize)| {
            let way = (corners[j] - corners[i]).unit()?;
            Some((corners[i], way))
        };
        let edges: Vec<_> = edges.iter().filter_map(way).collect();
        let normal = |&[i, j, k]: &[usize; 3]| {
            let (u, v) = (corners[j] - corners[i], corners[k] - corners[i]);
            u.unit()?.cross(&v.unit()?).unit()
        };
        Self {
            ways: edges.iter().map(|(_, way)| *way).collect(),
            normals: faces.iter().filter_map(normal).collect(),
            edges,
            corners,
            margin: Dd::from(margin),
        }
    }

    fn line(place: &Place, half: f64, radius: f64) -> Self {
        let ends = [-half, half].map(|z| place.point(&V3::from([0.0, 0.0, z])));
        let corners = if half == 0.0 {
            vec![ends[0]]
        } else {
            ends.to_vec()
        };
        let edges: &[_] = if half == 0.0 { &[] } else { &[(0, 1)] };
        Self::new(corners, edges, &[], radius)
    }

    fn cuboid(place: &Place, half: &[f64; 3]) -> Self {
        let sign = |at: usize, k: usize| if at >> k & 1 == 0 { -half[k] } else { half[k] };
        let corner = |at: usize| place.point(&V3::from([0, 1, 2].map(|k| sign(at, k))));
        let edges: Vec<_> = (0..8)
            .flat_map(|i| (0..3).map(move |k| (i, i | 1 << k)))
            .filter(|(i, j)| i != j)
            .collect();
        let axes = [0, 1, 2].map(|k| {
            let mut axis = [0.0; 3];
            axis[k] = 1.0;
            place.turned(&V3::from(axis))
        });
        Self {
            ways: axes.to_vec(),
            normals: axes.to_vec(),
            ..Self::new((0..8).map(corner).collect(), &edges, &[], 0.0)
        }
    }

    fn triangle(place: &Place, corners: [[f64; 3]; 3]) -> Self {
        let corners = corners.map(|p| place.point(&V3::from(p)));
        Self::new(
            corners.to_vec(),
            &[(0, 1), (1, 2), (2, 0)],
            &[[0, 1, 2]],
            0.0,
        )
    }

    /// The hull of few points: every pair may be an edge, every triple a face.
    fn hull(place: &Place, points: &[[f64; 3]]) -> Self {
        let n = points.len();
        let corners = points.iter().map(|p| place.point(&V3::from(*p))).collect();
        let edges: Vec<_> = (0..n)
            .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
            .collect();
        let faces: Vec<_> = edges
            .iter()
            .flat_map(|&(i, j)| (j + 1..n).map(move |k| [i, j, k]))
            .collect();
        Self::new(corners, &edges, &faces, 0.0)
    }
}

/// The pieces of a shape; `None`: it is no union of polytopes with a radius.
pub(super) fn pieces((spec, place): &(&ShapeSpec, Place)) -> Option<Vec<Piece>> {
    Some(match spec {
        ShapeSpec::Sphere { radius } => vec![Piece::line(place, 0.0, *radius)],
        ShapeSpec::Capsule {
            radius,
            half_height,
        } => vec![Piece::line(place, *half_height, *radius)],
        ShapeSpec::Box { half_extents } => vec![Piece::cuboid(place, half_extents)],
        ShapeSpec::Convex { vertices, .. } => vec![Piece::hull(place, vertices)],
        ShapeSpec::Triangle { vertices } => vec![Piece::triangle(place, *vertices)],
        ShapeSpec::Trimesh {
            vertices, faces, ..
        } => {
            let corner = |i: u32| vertices.get(i as usize).copied();
            let triangle = |f: &[u32; 3]| {
                let corners = [corner(f[0])?, corner(f[1])?, corner(f[2])?];
                Some(Piece::triangle(place, corners))
            };
            faces.iter().map(triangle).collect::<Option<_>>()?
        }
        _ => return None,
    })
}

/// The greatest `f` (see `truth`) over all directions that may be the best one.
pub(super) fn of_pieces(a: &Piece, b: &Piece) -> Dd {
    let mut ways: Vec<V3> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        .map(V3::from)
        .to_vec();
    let mut offer = |way: V3| ways.extend(way.unit());
    a.normals.iter().chain(&b.normals).for_each(|n| offer(*n));
    for p in &a.corners {
        b.corners.iter().for_each(|q| offer(*q - *p));
    }
    for (from, to) in [(a, b), (b, a)] {
        for (q, way) in &to.edges {
            for p in &from.corners {
                let off = *p - *q;
                offer(off - way.scaled(way.dot(&off)));
            }
        }
    }
    for u in &a.ways {
        b.ways.iter().for_each(|v| offer(u.cross(v)));
    }
    // Flat pieces in one plane or on one line: also directions across an edge within the plane, or across the line.
    for u in a.ways.iter().chain(&b.ways) {
        a.normals
            .iter()
            .chain(&b.normals)
            .for_each(|n| offer(u.cross(n)));
        if a.normals.is_empty() && b.normals.is_empty() {
            offer(u.cross(&V3::from([1.0, 0.0, 0.0])));
            offer(u.cross(&V3::from([0.0, 1.0, 0.0])));
        }
    }
    best(a, b, &ways) - a.margin - b.margin
}

/// The greatest `f`: in f64 first; directions that f64 cannot rank are computed again in full precision.
fn best(a: &Piece, b: &Piece, ways: &[V3]) -> Dd {
    let near = |piece: &Piece| -> Vec<[f64; 3]> {
        let corners = piece.corners.iter();
        corners.map(|p| p.0.map(Dd::near)).collect()
    };
    let (of_a, of_b) = (near(a), near(b));
    let size = of_a.iter().chain(&of_b).flatten();
    let size = size.fold(0.0_f64, |most, x| most.max(x.abs()));
    let along = |n: &[f64; 3], p: &[f64; 3]| n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
    let ends = |n: &[f64; 3], of: &[[f64; 3]]| {
        let all = of.iter().map(|p| along(n, p));
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    let rough: Vec<f64> = ways
        .iter()
        .map(|way| {
            let n = way.0.map(Dd::near);
            let ((a_low, a_high), (b_low, b_high)) = (ends(&n, &of_a), ends(&n, &of_b));
            (b_low - a_high).max(a_low - b_high)
        })
        .collect();
    let top = rough.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let limit = top - 1e-13 * size;
    let close = ways
        .iter()
        .zip(&rough)
        .filter(|(_, rough)| **rough >= limit);
    close
        .map(|(way, _)| exact(a, b, way))
        .fold(Dd::from(f64::NEG_INFINITY), Dd::max)
}

/// The greater `f` of a direction and its opposite.
fn exact(a: &Piece, b: &Piece, n: &V3) -> Dd {
    let ends = |piece: &Piece| {
        let all = || piece.corners.iter().map(|p| n.dot(p));
        let none = Dd::from(f64::INFINITY);
        (all().fold(none, Dd::min), all().fold(-none, Dd::max))
    };
    let ((a_low, a_high), (b_low, b_high)) = (ends(a), ends(b));
    (b_low - a_high).max(a_low - b_high)
}
