//! Whether two shapes can overlap as deeply as claimed: a search for a point of that depth, which either finds one or
//! proves that there is none.
//!
//! The depth of an overlap with a solid is that of a point of one below the surface of the other. The depth of a point
//! changes by at most the motion of the point, so the depth at the middle of a cell bounds that of the whole cell.
//! Cells without a point deep enough in both are dropped, and the most promising one of the others is halved. Cells are
//! boxes, or for a surface parts of its triangles. If cells are left when the search gives up, the result is open.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use sweepd::math::{Point, Pose, Vec3};

use crate::kinds::Solid;
use crate::oracle::{Placed, Triangle, point_triangle};
use crate::truth::{At, bounds};

/// Most cells examined before the search gives up.
const CELLS_MAX: usize = 2_000;
/// A depth counts as found at this share of it: the last part of the search would take most of the time.
const ENOUGH: f64 = 0.99;
/// Directions searched for the separation of two convex shapes.
const SAMPLES: u32 = 240;

/// The result of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// There is a point of that depth.
    Found,
    /// There is no such point.
    Refuted,
    /// Neither was proved.
    Open,
}

/// Whether two shapes overlap by at least `depth`, metres: for a solid mesh by the depth of a point; for a surface by
/// the separation of one of its triangles from the other shape; for all others by the separation of the two.
pub fn search(a: At<'_>, b: At<'_>, depth: f64) -> Search {
    let solid = |at: &At<'_>| matches!(at.0, Solid::Mesh(_, true));
    if solid(&a) || solid(&b) {
        return point_search(a, b, depth);
    }
    let others = pieces(b);
    let mut all = Search::Refuted;
    for one in pieces(a) {
        for other in &others {
            let gap = bounds((&one, a.1), (other, b.1), SAMPLES);
            if gap.high <= -ENOUGH * depth {
                return Search::Found;
            }
            if gap.low < -depth {
                all = Search::Open;
            }
        }
    }
    all
}

/// The triangles of a surface, or any other shape itself.
fn pieces((solid, _): At<'_>) -> Vec<Solid> {
    match solid {
        Solid::Mesh(soup, _) => {
            let corner = |i: u32| soup.vertices[i as usize].coords;
            let triangle = |face: &[u32; 3]| Solid::Triangle(face.map(corner));
            soup.faces.iter().map(triangle).collect()
        }
        _ => vec![solid.clone()],
    }
}

/// Searches for a point of both shapes that is at least `depth` below the surface of one of them, metres.
///
/// Round shapes other than sphere and capsule are replaced by circumscribed polytopes, in which points are deeper.
fn point_search(a: At<'_>, b: At<'_>, depth: f64) -> Search {
    let from = a.1.translation.vector;
    let bodies = [Body::of(a, &from), Body::of(b, &from)];
    let mut open = BinaryHeap::new();
    let look = |cell: Cell| {
        let (middle, radius) = cell.about();
        let depths = bodies.each_ref().map(|body| body.depth(&middle, &cell));
        let shared = depths[0].min(depths[1]);
        let filled = bodies.iter().zip(depths).filter(|(body, _)| body.filled());
        let deepest = filled.fold(f64::NEG_INFINITY, |most, (_, depth)| most.max(depth));
        let found = shared >= 0.0 && deepest >= ENOUGH * depth;
        let worth = deepest + radius;
        (
            found,
            (shared >= -radius && worth >= depth).then_some(Open(worth, cell)),
        )
    };
    let mut fresh = first_cells(&bodies);
    for _ in 0..CELLS_MAX {
        for cell in fresh {
            match look(cell) {
                (true, _) => return Search::Found,
                (false, kept) => open.extend(kept),
            }
        }
        let Some(Open(_, cell)) = open.pop() else {
            return Search::Refuted;
        };
        fresh = cell.halves();
    }
    Search::Open
}

/// Cells that cover the intersection of two bodies.
fn first_cells(bodies: &[Body; 2]) -> Vec<Cell> {
    for body in bodies {
        if let Body::Mesh(mesh) = body
            && !mesh.solid
        {
            return mesh.triangles.iter().map(|t| Cell::Triangle(*t)).collect();
        }
    }
    let Some((low, high)) = common(bodies) else {
        return Vec::new();
    };
    vec![Cell::Box(
        Point::from((low + high) / 2.0),
        (high - low) / 2.0,
    )]
}

/// A part of the search space.
#[derive(Clone, Copy)]
enum Cell {
    /// Middle and half extents.
    Box(Point, Vec3),
    /// Part of a triangle of the shape that is a surface.
    Triangle(Triangle),
}

impl Cell {
    /// A point of the cell, and the radius around it that contains the cell.
    fn about(&self) -> (Point, f64) {
        let (middle, reach) = match self {
            Self::Box(middle, half) => (*middle, half.norm()),
            Self::Triangle(t) => {
                let middle = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
                let far = t.iter().map(|p| (p - middle).norm());
                (middle, far.fold(0.0, f64::max))
            }
        };
        (middle, reach * (1.0 + 1e-12))
    }

    /// Halves at the middle of the longest side.
    fn halves(&self) -> Vec<Self> {
        match *self {
            Self::Box(middle, mut half) => {
                let axis = half.imax();
                half[axis] /= 2.0;
                let mut step = Vec3::zeros();
                step[axis] = half[axis];
                vec![
                    Self::Box(middle - step, half),
                    Self::Box(middle + step, half),
                ]
            }
            Self::Triangle([a, b, c]) => {
                let sides = [(a, b, c), (b, c, a), (c, a, b)];
                let length = |(p, q, _): &(Point, Point, Point)| (q - p).norm();
                let longest = sides
                    .into_iter()
                    .max_by(|s, t| length(s).total_cmp(&length(t)));
                let (p, q, r) = longest.unwrap();
                let m = Point::from((p.coords + q.coords) / 2.0);
                vec![Self::Triangle([p, m, r]), Self::Triangle([m, q, r])]
            }
        }
    }
}

/// A cell that may contain a point of this depth, metres.
struct Open(f64, Cell);

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

/// A shape for which the depth of a point can be computed.
enum Body {
    /// Around an axis segment between two points, with a radius.
    Round(Point, Point, f64),
    /// The half-space below this plane: unit normal, offset.
    Below(Vec3, f64),
    Mesh(Placed),
}

impl Body {
    fn of((solid, pose): At<'_>, from: &Vec3) -> Self {
        let seen = Pose::from_parts((pose.translation.vector - from).into(), pose.rotation);
        let end = |z: f64| seen * Point::new(0.0, 0.0, z);
        match solid {
            Solid::Sphere(r) => Self::Round(end(0.0), end(0.0), *r),
            Solid::Capsule(r, h) => Self::Round(end(-h), end(*h), *r),
            Solid::HalfSpace(normal, offset) => {
                let n = seen.rotation * normal;
                Self::Below(n, offset + n.dot(&seen.translation.vector))
            }
            _ => {
                let [_, around] = solid.between();
                let filled = solid.filled();
                Self::Mesh(Placed::new(
                    &around.vertices,
                    &around.faces,
                    filled,
                    &pose,
                    from,
                ))
            }
        }
    }

    fn filled(&self) -> bool {
        match self {
            Self::Round(..) | Self::Below(..) => true,
            Self::Mesh(mesh) => mesh.solid,
        }
    }

    /// Depth of a point below the surface, metres; negative distance for a point outside. For a cell of a surface it is
    /// 0.
    fn depth(&self, p: &Point, cell: &Cell) -> f64 {
        match self {
            Self::Mesh(mesh) if !mesh.solid && matches!(cell, Cell::Triangle(_)) => 0.0,
            Self::Round(a, b, r) => r - point_triangle(p, &[*a, *b, *b]),
            Self::Below(n, offset) => offset - n.dot(&p.coords),
            Self::Mesh(mesh) if mesh.holds(p) => mesh.distance_from(p),
            Self::Mesh(mesh) => -mesh.distance_from(p),
        }
    }

    /// Its bounding box; `None`: it is unbounded.
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Round(a, b, r) => {
                let r = Vec3::from_element(*r);
                Some((a.coords.inf(&b.coords) - r, a.coords.sup(&b.coords) + r))
            }
            Self::Below(..) => None,
            Self::Mesh(mesh) => {
                let first = mesh.corners[0].coords;
                Some(
                    (mesh.corners.iter()).fold((first, first), |(low, high), p| {
                        (low.inf(&p.coords), high.sup(&p.coords))
                    }),
                )
            }
        }
    }
}

/// The intersection of the two bounding boxes, slightly enlarged.
fn common([a, b]: &[Body; 2]) -> Option<(Vec3, Vec3)> {
    let everything = || {
        let far = Vec3::from_element(f64::MAX);
        (-far, far)
    };
    let (a, b) = (
        a.bounds().unwrap_or_else(everything),
        b.bounds().unwrap_or_else(everything),
    );
    let (low, high) = (a.0.sup(&b.0), a.1.inf(&b.1));
    let slack = 1e-12 * (low.amax() + high.amax());
    let (low, high) = (low.add_scalar(-slack), high.add_scalar(slack));
    (0..3).all(|k| low[k] <= high[k]).then_some((low, high))
}
