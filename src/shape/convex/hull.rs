//! Hulls of points: which points matter, and the faces that manifolds are clipped from.
//!
//! In: points, own frame, metres. Out: a [`Hull`] that is exactly the hull of the points: only points proved to lie
//! within the others are left out, and nothing is moved.

use super::faces::{self, RING_MAX, Thick};
use super::facets::{corners_of, facets_of, is_exact};
use super::flat;
use crate::limits::{EXTENT_MAX_M, HULL_VERTICES_MAX};
use crate::math::{Point, Vec3};
use crate::shape::ShapeError;
use crate::shape::check::spread;

/// A hull: its points, and its faces if they could be found.
#[derive(Debug)]
pub(crate) struct Hull {
    points: Vec<Vec3>,
    faces: Vec<HullFace>,
    /// Corners of all faces, one run per face; behind each run longer than [`RING_MAX`] those that span most of it.
    corners: Vec<u32>,
}

/// A plane face of a hull.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HullFace {
    /// Unit, outward.
    pub(crate) normal: Vec3,
    first: u32,
    count: u32,
}

/// Refuses a coordinate that cannot be computed with.
pub(super) fn check_point(place: usize, point: &Vec3) -> Result<(), ShapeError> {
    for k in 0..3 {
        let value = point[k];
        if !value.is_finite() {
            return Err(ShapeError::NotFinite {
                what: format!("vertex {place}"),
                value,
            });
        }
        if value.abs() > EXTENT_MAX_M {
            return Err(ShapeError::Extent {
                what: format!("vertex {place}"),
                value_m: value.abs(),
            });
        }
    }
    Ok(())
}

impl Hull {
    /// The hull of at least one point.
    pub(super) fn build(given: &[Point]) -> Result<Self, ShapeError> {
        let points = places(given)?;
        let (thin_m, size_m) = thickness(&points);
        Self::of_places(&points, &Thick::of(thin_m, size_m))
    }

    /// The hull of points that span a volume.
    pub(super) fn build_solid(given: &[Point]) -> Result<Self, ShapeError> {
        let points = places(given)?;
        let (thin_m, size_m) = check_volume(&points)?;
        Self::of_places(&points, &Thick::of(thin_m, size_m))
    }

    fn of_places(points: &[Point], thick: &Thick) -> Result<Self, ShapeError> {
        let facets = facets_of(points).unwrap_or_default();
        let is_corner = match facets[..] {
            // Without a surface every query works, and manifolds have one point.
            [] if is_exact(points) => flat::corners_of(points),
            [] => None,
            _ => Some(corners_of(points, &facets)),
        };
        // If it cannot be decided, all points stay.
        let is_corner = is_corner.unwrap_or_else(|| vec![true; points.len()]);
        let corners = is_corner.iter().filter(|is| **is).count();
        if corners > HULL_VERTICES_MAX {
            return Err(ShapeError::TooManyHullVertices { given: corners });
        }
        let mut new_place = vec![u32::MAX; points.len()];
        let kept = (0..points.len()).filter(|&place| is_corner[place]);
        for (new, old) in (0u32..).zip(kept) {
            new_place[old] = new;
        }
        let mut hull = Self {
            points: (points.iter().zip(&is_corner))
                .filter_map(|(p, is)| is.then_some(p.coords))
                .collect(),
            faces: Vec::new(),
            corners: Vec::new(),
        };
        for (normal, corners) in faces::of(points, &facets, thick) {
            let named = corners.into_iter().map(|k| new_place[k as usize]);
            hull.push_face(normal, named.filter(|k| *k != u32::MAX).collect());
        }
        Ok(hull)
    }

    pub(crate) fn points(&self) -> &[Vec3] {
        &self.points
    }

    pub(crate) fn faces(&self) -> &[HullFace] {
        &self.faces
    }

    /// Indices of the corners of a face, counter-clockwise seen from outside.
    pub(crate) fn corners(&self, face: &HullFace) -> &[u32] {
        let first = face.first as usize;
        self.corners
            .get(first..first + face.count as usize)
            .unwrap_or(&[])
    }

    /// At most [`RING_MAX`] of a face's corners, counter-clockwise seen from outside: those that span most of it.
    pub(crate) fn ring(&self, face: &HullFace) -> &[u32] {
        let count = face.count as usize;
        if count <= RING_MAX {
            return self.corners(face);
        }
        let first = face.first as usize + count;
        self.corners.get(first..first + RING_MAX).unwrap_or(&[])
    }

    #[inline]
    pub(super) fn support(&self, dir: &Vec3) -> (Vec3, u32) {
        let mut best = (0, f64::NEG_INFINITY);
        for (place, point) in self.points.iter().enumerate() {
            let along = point.dot(dir);
            if along > best.1 {
                best = (place, along);
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most HULL_VERTICES_MAX")]
        let element = best.0 as u32;
        (
            self.points.get(best.0).copied().unwrap_or_default(),
            element,
        )
    }

    /// * `corners` - indices of the face's corners in `points`, in any order.
    fn push_face(&mut self, normal: Vec3, mut corners: Vec<u32>) {
        if corners.len() < 3 {
            return;
        }
        faces::order_around(&self.points, &normal, &mut corners);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "at most a few HULL_VERTICES_MAX"
        )]
        let (first, count) = (self.corners.len() as u32, corners.len() as u32);
        self.corners.extend(&corners);
        if corners.len() > RING_MAX {
            faces::thin(&self.points, &normal, &mut corners);
            self.corners.extend(corners);
        }
        self.faces.push(HullFace {
            normal,
            first,
            count,
        });
    }
}

/// The distinct points, sorted by their coordinates.
fn places(given: &[Point]) -> Result<Vec<Point>, ShapeError> {
    for (place, point) in given.iter().enumerate() {
        check_point(place, &point.coords)?;
    }
    let mut points = given.to_vec();
    points.sort_by(|a, b| {
        let key = |p: &Point| [p.x + 0.0, p.y + 0.0, p.z + 0.0];
        let (a, b) = (key(a), key(b));
        a[0].total_cmp(&b[0])
            .then(a[1].total_cmp(&b[1]))
            .then(a[2].total_cmp(&b[2]))
    });
    points.dedup();
    if points.is_empty() {
        return Err(ShapeError::TooFewPoints { given: 0 });
    }
    spread(
        "the extent of the hull",
        points.iter().map(|p| p.coords.as_ref()),
    )?;
    Ok(points)
}

/// Refuses points that span no volume; else their [`thickness`].
fn check_volume(points: &[Point]) -> Result<(f64, f64), ShapeError> {
    if points.len() < 4 {
        return Err(ShapeError::TooFewPoints {
            given: points.len(),
        });
    }
    let (thickness_m, size_m) = thickness(points);
    if thickness_m <= 1e-13 * size_m {
        return Err(ShapeError::FlatHull { thickness_m });
    }
    Ok((thickness_m, size_m))
}

/// Greatest distance of a point from the plane of a large triangle of points, and the greatest extent: both 0 for a
/// point.
fn thickness(points: &[Point]) -> (f64, f64) {
    let Some(first) = points.first() else {
        return (0.0, 0.0);
    };
    let far = |from: &dyn Fn(&Point) -> f64| {
        let farthest = points.iter().max_by(|a, b| from(a).total_cmp(&from(b)));
        *farthest.unwrap_or(first)
    };
    let second = far(&|p| (p - first).norm());
    let along = second - first;
    let third = far(&|p| along.cross(&(p - first)).norm());
    let normal = along.cross(&(third - first));
    let length = normal.norm();
    if length == 0.0 {
        return (0.0, along.norm());
    }
    let fourth = far(&|p| normal.dot(&(p - first)).abs());
    (normal.dot(&(fourth - first)).abs() / length, along.norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::EXTENT_MIN_M;

    #[test]
    fn bug_a_cube_with_points_all_over_its_faces_has_eight_corners_and_six_faces() {
        let n = 30_i32;
        let on = |k: i32| k == 0 || k == n;
        let cells =
            (0..=n).flat_map(|x| (0..=n).flat_map(move |y| (0..=n).map(move |z| [x, y, z])));
        let points: Vec<Point> = cells
            .filter(|[x, y, z]| on(*x) || on(*y) || on(*z))
            .map(|cell| Point::from(cell.map(|k| f64::from(k) / f64::from(n))))
            .collect();
        assert_eq!(points.len(), 5402);
        let hull = Hull::build(&points).unwrap();
        assert_eq!(hull.points().len(), 8);
        assert_eq!(hull.faces().len(), 6);
        for face in hull.faces() {
            assert_eq!(hull.corners(face).len(), 4);
            assert!((face.normal.amax() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn no_corner_is_left_out_however_little_it_stands_out() {
        let mut random = crate::builtin::Random::new(7);
        let mut number = || random.unit() * 2.0 - 1.0;
        for thin in [1.0, 1e-6, 1e-12] {
            let points: Vec<Point> = (0..2000)
                .map(|_| {
                    let p = Vec3::new(number(), number(), number());
                    // A third are coplanar up to rounding.
                    let turned = Vec3::new(p.x, p.y + 0.3 * p.x, thin * p.z + 0.7 * p.x);
                    Point::from(if number() > 0.3 {
                        p.normalize() * 0.9
                    } else {
                        turned
                    })
                })
                .collect();
            let hull = Hull::build(&points).unwrap();
            assert!(
                hull.points()
                    .iter()
                    .all(|p| points.contains(&Point::from(*p)))
            );
            for _ in 0..2000 {
                let dir = Vec3::new(number(), number(), number());
                let all = points.iter().map(|p| p.coords.dot(&dir));
                let most = all.fold(f64::NEG_INFINITY, f64::max);
                let kept = hull.support(&dir).0.dot(&dir);
                assert!(kept >= most - 2.0 * f64::EPSILON, "{kept} {most}");
            }
        }
    }

    #[test]
    fn bug_points_of_almost_no_extent_are_refused_and_one_place_is_none() {
        let simplex = |side: f64| {
            let corners = [Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
            Hull::build(&corners.map(|p| Point::from(p * side)))
        };
        assert!(simplex(EXTENT_MIN_M).is_ok() && simplex(0.0).is_ok());
        for side in [0.9 * EXTENT_MIN_M, 1e-70, 1e-170] {
            let text = simplex(side).unwrap_err().to_string();
            assert!(text.starts_with("the extent of the hull is "), "{text}");
        }
    }

    #[test]
    fn many_points_on_a_ball_are_refused_with_their_number() {
        let points = (0..20_000).map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * f64::from(k)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            Point::new(across * cos, across * sin, z)
        });
        let refused = Hull::build(&points.collect::<Vec<_>>()).unwrap_err();
        assert_eq!(refused, ShapeError::TooManyHullVertices { given: 20_000 });
    }

    #[test]
    fn bug_many_points_without_a_volume_are_flat_and_not_too_many() {
        let cells = (0..70).flat_map(|x| (0..70).map(move |y| (f64::from(x), f64::from(y))));
        let grid: Vec<Point> = cells.map(|(x, y)| Point::new(x, y, 0.0)).collect();
        let line: Vec<Point> = (0..5000).map(|x| Point::new(x.into(), 0.0, 0.0)).collect();
        for (points, corners) in [(grid, 4), (line, 2)] {
            let refused = Hull::build_solid(&points).unwrap_err();
            assert_eq!(refused, ShapeError::FlatHull { thickness_m: 0.0 });
            assert_eq!(Hull::build(&points).unwrap().points().len(), corners);
        }
    }
}
