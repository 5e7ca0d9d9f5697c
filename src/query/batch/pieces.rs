//! Shapes of a batch as convex pieces, and the least gap over all pairs of them.
//!
//! In: shape specs, a relative pose. Out: one [`Closest`]. A mesh is a surface here: its triangles are its pieces (for
//! a solid mesh see `solids`). By brute force, pruned only by bounding balls, so that it shares no tree with the
//! engine.

use crate::math::{Interval, Point, Pose, Vec3};
use crate::narrow::exact::{Closest, Warm, convex_gap, gap_to_half_space, half_space_gap};
use crate::shape::{Convex, ShapeError, ShapeSpec, spread};

/// Loss where squares of lengths underflow, metres (the root of the least number that has all its digits): without it
/// points 1e-170 m apart would be reported as coincident. A longer gap is not changed by so little.
const SQUARES_LOST_M: f64 = 1.5e-154;

/// Message if squares overflow.
pub(super) const TOO_FAR: &str =
    "the shapes are too far from each other to compute with: write positions that are nearer";

/// What the pieces form together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// One convex solid (or a triangle).
    Convex,
    /// Triangles of a mesh.
    Surface,
    /// No pieces: a half-space.
    HalfSpace,
}

/// A shape as pieces.
pub(super) struct Pieces {
    pub(super) kind: Kind,
    convexes: Vec<Convex>,
    /// Of a half-space, unit.
    normal: Vec3,
    offset_m: f64,
}

impl Pieces {
    fn convex(convex: Convex) -> Result<Self, ShapeError> {
        Ok(Self {
            kind: Kind::Convex,
            convexes: vec![convex.checked()?],
            normal: Vec3::z(),
            offset_m: 0.0,
        })
    }

    /// The checked pieces of a shape.
    pub(super) fn build(spec: &ShapeSpec) -> Result<Self, ShapeError> {
        match spec {
            ShapeSpec::Sphere { radius } => Self::convex(Convex::sphere(*radius)),
            ShapeSpec::Box { half_extents } => {
                Self::convex(Convex::cuboid(Vec3::from(*half_extents)))
            }
            ShapeSpec::Capsule {
                radius,
                half_height,
            } => Self::convex(Convex::capsule(*radius, *half_height)),
            ShapeSpec::Cylinder {
                radius,
                half_height,
            } => Self::convex(Convex::cylinder(*radius, *half_height)),
            ShapeSpec::Cone {
                radius,
                half_height,
            } => Self::convex(Convex::cone(*radius, *half_height)),
            ShapeSpec::Convex { vertices, file, .. } => {
                no_file(file.as_ref())?;
                Self::convex(Convex::hull_of_any(&points(vertices))?)
            }
            ShapeSpec::Triangle { vertices } => {
                let triangle = Self::convex(Convex::triangle(vertices.map(Point::from)))?;
                spread("the extent of the triangle", vertices.iter())?;
                Ok(triangle)
            }
            ShapeSpec::Trimesh {
                vertices,
                faces,
                file,
                ..
            } => {
                no_file(file.as_ref())?;
                Self::mesh(vertices, faces)
            }
            ShapeSpec::HalfSpace { normal, offset } => Self::half_space(normal, *offset),
            ShapeSpec::HeightField { .. } => Err(ShapeError::Setting(
                "a batch takes no height_field: write its surface as a trimesh".to_owned(),
            )),
        }
    }

    fn mesh(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<Self, ShapeError> {
        let mut convexes = Vec::with_capacity(faces.len());
        for (face, corners) in faces.iter().enumerate() {
            let mut triangle = [Point::origin(); 3];
            for (corner, index) in triangle.iter_mut().zip(corners) {
                let vertex = vertices.get(*index as usize);
                *corner = Point::from(*vertex.ok_or(ShapeError::IndexOutOfRange {
                    face,
                    index: *index,
                    vertices: vertices.len(),
                })?);
            }
            convexes.push(Convex::triangle(triangle).checked()?);
        }
        if convexes.is_empty() {
            return Err(ShapeError::EmptyMesh);
        }
        // Their faces name only existing vertices.
        let used = faces.iter().flatten().map(|k| &vertices[*k as usize]);
        spread("the extent of the mesh", used)?;
        Ok(Self {
            kind: Kind::Surface,
            convexes,
            normal: Vec3::z(),
            offset_m: 0.0,
        })
    }

    fn half_space(normal: &[f64; 3], offset_m: f64) -> Result<Self, ShapeError> {
        let bad = normal.iter().chain([&offset_m]).find(|v| !v.is_finite());
        if let Some(value) = bad {
            return Err(ShapeError::NotFinite {
                what: "normal or offset".to_owned(),
                value: *value,
            });
        }
        let normal = Vec3::from(*normal);
        let largest = normal.amax();
        if largest == 0.0 {
            return Err(ShapeError::ZeroDirection {
                what: "normal".to_owned(),
            });
        }
        Ok(Self {
            kind: Kind::HalfSpace,
            convexes: Vec::new(),
            normal: (normal / largest).normalize(),
            offset_m,
        })
    }
}

fn no_file(file: Option<&String>) -> Result<(), ShapeError> {
    match file {
        None => Ok(()),
        Some(_) => Err(ShapeError::Setting(
            "a batch reads no mesh files: write the vertices into the line".to_owned(),
        )),
    }
}

fn points(vertices: &[[f64; 3]]) -> Vec<Point> {
    vertices.iter().map(|v| Point::from(*v)).collect()
}

/// The least gap over all pairs of pieces; the interval contains the least of them all.
pub(super) fn gap(a: &Pieces, b: &Pieces, pos12: &Pose) -> Result<Closest, String> {
    let mut least = Least::default();
    match (a.kind, b.kind) {
        (Kind::HalfSpace, Kind::HalfSpace) => {
            return Err(
                "two half-spaces have no gap: one of the shapes must be bounded".to_owned(),
            );
        }
        (Kind::HalfSpace, _) => {
            for piece in &b.convexes {
                least.offer(&half_space_gap(&a.normal, a.offset_m, piece, pos12));
            }
        }
        (_, Kind::HalfSpace) => {
            for piece in &a.convexes {
                least.offer(&gap_to_half_space(piece, &b.normal, b.offset_m, pos12));
            }
        }
        _ => bounded(&a.convexes, &b.convexes, pos12, &mut least),
    }
    (least.found())
        .map(|found| allow_for_squares(&found))
        .ok_or_else(|| TOO_FAR.to_owned())
}

/// Widens an interval by what squares may have lost; if it is no wider than that, it is as narrow as possible.
fn allow_for_squares(found: &Closest) -> Closest {
    let gap = Interval::new(
        found.gap.min - SQUARES_LOST_M,
        found.gap.max + SQUARES_LOST_M,
    );
    Closest {
        gap,
        // A certain collision stays certain.
        finished: found.finished || found.gap.max <= 0.0 || gap.width() <= 4.0 * SQUARES_LOST_M,
        ..*found
    }
}

/// The result of the piece pair with the least gap, with the interval over all pairs.
#[derive(Default)]
struct Least {
    found: Option<Closest>,
    /// Least lower end of the unfinished queries.
    open_m: Option<f64>,
    /// Nothing is known of one pair of pieces: squares of its lengths overflow.
    is_lost: bool,
}

impl Least {
    fn offer(&mut self, closest: &Closest) {
        if !(closest.gap.min.is_finite() && closest.gap.max.is_finite()) {
            self.is_lost = true;
            return;
        }
        if !closest.finished {
            let open_m = self.open_m.unwrap_or(f64::INFINITY);
            self.open_m = Some(open_m.min(closest.gap.min));
        }
        match &mut self.found {
            None => self.found = Some(*closest),
            Some(found) => {
                let gap = found.gap.least(closest.gap);
                if closest.best_m < found.best_m {
                    *found = *closest;
                }
                found.gap = gap;
                found.best_m = found.best_m.clamp(gap.min, gap.max);
            }
        }
    }

    /// The result over all pairs, unless one is lost. Finished if no unfinished query can narrow it.
    fn found(&self) -> Option<Closest> {
        let found = self.found.filter(|_| !self.is_lost)?;
        let is_open = self.open_m.is_some_and(|low_m| low_m <= found.gap.max);
        Some(Closest {
            finished: !is_open,
            ..found
        })
    }

    fn upper(&self) -> f64 {
        self.found.map_or(f64::INFINITY, |f| f.gap.max)
    }
}

/// Two lists of pieces: the pair whose balls are nearest first, for a good upper end, then all that may be below it.
fn bounded(a: &[Convex], b: &[Convex], pos12: &Pose, least: &mut Least) {
    let centres: Vec<Point> = b.iter().map(|piece| pos12 * piece.centre()).collect();
    let low = |x: &Convex, y: &Convex, centre: &Point| {
        let distance = (centre - x.centre()).norm();
        // Less the rounding of the centre's position and of the sum.
        distance
            - x.radius()
            - y.radius()
            - 1e-14 * (distance + pos12.translation.vector.norm() + y.reach())
    };
    let mut nearest = (f64::INFINITY, None);
    for x in a {
        for (y, centre) in b.iter().zip(&centres) {
            let bound = low(x, y, centre);
            if bound < nearest.0 || nearest.1.is_none() {
                nearest = (bound, Some((x, y)));
            }
        }
    }
    if let Some((x, y)) = nearest.1 {
        least.offer(&convex_gap(x, y, pos12, &mut Warm::default()));
    }
    for x in a {
        for (y, centre) in b.iter().zip(&centres) {
            if low(x, y, centre) <= least.upper() {
                least.offer(&convex_gap(x, y, pos12, &mut Warm::default()));
            }
        }
    }
}
