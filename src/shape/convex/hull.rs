//! Hulls of points: which points matter, and the faces that manifolds are clipped from.
//!
//! In: points, own frame, metres. Out: a [`Hull`] that is exactly the hull of the points: parry's hull builder moves
//! vertices of thin hulls, so its result says only which points are strictly inside and which lie on one face.

use std::panic::{AssertUnwindSafe, catch_unwind};

use parry3d_f64::transformation::try_convex_hull;

use crate::limits::{EXTENT_MAX_M, HULL_VERTICES_MAX};
use crate::math::{Point, Vec3, from_glam_vec, to_glam_vec};
use crate::shape::ShapeError;

/// A hull: its points, and its faces where they could be found.
#[derive(Debug)]
pub(crate) struct Hull {
    points: Vec<Vec3>,
    faces: Vec<HullFace>,
    /// Corners of all faces, one run a face.
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
        for (place, point) in given.iter().enumerate() {
            check_point(place, &point.coords)?;
        }
        let mut points: Vec<Vec3> = given.iter().map(|p| p.coords).collect();
        points.sort_by(|a, b| {
            let key = |p: &Vec3| [p.x + 0.0, p.y + 0.0, p.z + 0.0];
            let (a, b) = (key(a), key(b));
            a[0].total_cmp(&b[0])
                .then(a[1].total_cmp(&b[1]))
                .then(a[2].total_cmp(&b[2]))
        });
        points.dedup();
        if points.is_empty() {
            return Err(ShapeError::TooFewPoints { given: 0 });
        }
        let mut hull = Self {
            points,
            faces: Vec::new(),
            corners: Vec::new(),
        };
        hull.find_faces();
        if hull.points.len() > HULL_VERTICES_MAX {
            return Err(ShapeError::TooManyHullVertices {
                given: hull.points.len(),
            });
        }
        Ok(hull)
    }

    /// Refuses a hull without a volume.
    pub(super) fn check_volume(&self) -> Result<(), ShapeError> {
        if self.points.len() < 4 {
            return Err(ShapeError::TooFewPoints {
                given: self.points.len(),
            });
        }
        let (thickness_m, size_m) = self.thickness();
        if thickness_m <= 1e-13 * size_m {
            return Err(ShapeError::FlatHull { thickness_m });
        }
        Ok(())
    }

    /// Greatest distance of a point from the plane of a large triangle of points, and the greatest extent: both 0 for a
    /// point.
    fn thickness(&self) -> (f64, f64) {
        let Some(first) = self.points.first() else {
            return (0.0, 0.0);
        };
        let far = |from: &dyn Fn(&Vec3) -> f64| {
            self.points
                .iter()
                .max_by(|a, b| from(a).total_cmp(&from(b)))
                .copied()
                .unwrap_or(*first)
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

    pub(crate) fn points(&self) -> &[Vec3] {
        &self.points
    }

    pub(crate) fn faces(&self) -> &[HullFace] {
        &self.faces
    }

    /// Places of the corners of a face, counter-clockwise seen from outside.
    pub(crate) fn corners(&self, face: &HullFace) -> &[u32] {
        let first = face.first as usize;
        self.corners
            .get(first..first + face.count as usize)
            .unwrap_or(&[])
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

    /// Asks parry for the triangles, merges them into faces and drops what lies strictly inside all of them. When it
    /// fails, all points stay and there are no faces: every query works, manifolds have one point.
    fn find_faces(&mut self) {
        if self.points.len() < 4 {
            return;
        }
        let (_, size_m) = self.thickness();
        let Some(triangles) = triangles_of(&self.points, size_m) else {
            return;
        };
        let mut planes: Vec<(Vec3, f64, Vec<u32>)> = Vec::new();
        let mut whole = is_closed(&triangles);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|k| self.points[k as usize]);
            let normal = (b - a).cross(&(c - a));
            let length = normal.norm();
            if length <= 1e-12 * size_m * size_m {
                whole = false;
                continue;
            }
            let normal = normal / length;
            let offset = normal.dot(&a);
            // Triangles of one plane: the corners of the one lie in the plane of the other.
            let same = planes.iter_mut().find(|(n, o, _)| {
                n.dot(&normal) > 1.0 - 1e-9
                    && [a, b, c]
                        .iter()
                        .all(|p| (n.dot(p) - *o).abs() <= 1e-9 * size_m)
            });
            match same {
                Some((_, _, corners)) => {
                    for corner in triangle {
                        if !corners.contains(&corner) {
                            corners.push(corner);
                        }
                    }
                }
                None => planes.push((normal, offset, triangle.to_vec())),
            }
        }
        // Only the planes of a whole surface tell what is inside.
        if whole {
            self.drop_inner(&mut planes, size_m);
        }
        for (normal, _, mut corners) in planes {
            order_around(&self.points, &normal, &mut corners);
            #[allow(
                clippy::cast_possible_truncation,
                reason = "at most a few HULL_VERTICES_MAX"
            )]
            let (first, count) = (self.corners.len() as u32, corners.len() as u32);
            self.corners.extend(corners);
            self.faces.push(HullFace {
                normal,
                first,
                count,
            });
        }
    }

    fn drop_inner(&mut self, planes: &mut [(Vec3, f64, Vec<u32>)], size_m: f64) {
        let mut new_place = vec![u32::MAX; self.points.len()];
        let mut kept = Vec::with_capacity(self.points.len());
        for (place, point) in self.points.iter().enumerate() {
            let named = planes
                .iter()
                .any(|(_, _, corners)| corners.iter().any(|&k| k as usize == place));
            let inside = planes
                .iter()
                .all(|(n, o, _)| n.dot(point) < o - 1e-9 * size_m);
            if named || !inside {
                #[allow(clippy::cast_possible_truncation, reason = "checked by the caller")]
                let at = kept.len() as u32;
                new_place[place] = at;
                kept.push(*point);
            }
        }
        for (_, _, corners) in planes {
            for corner in corners {
                *corner = new_place[*corner as usize];
            }
        }
        self.points = kept;
    }
}

/// parry's triangles as places in `points`; `None` when it fails, in whatever way.
fn triangles_of(points: &[Vec3], size_m: f64) -> Option<Vec<[u32; 3]>> {
    // Brought to size 1 by a power of two, so that nothing is rounded: parry's tolerances are absolute.
    let scale = (-size_m.log2().round()).exp2();
    let scaled: Vec<_> = points.iter().map(|p| to_glam_vec(&(p * scale))).collect();
    let built = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&scaled)));
    let (vertices, triangles) = built.ok()?.ok()?;
    let places: Vec<u32> = vertices
        .iter()
        .map(|v| nearest(points, &(from_glam_vec(*v) / scale)))
        .collect();
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|k| places.get(k as usize).copied());
            Some([a?, b?, c?])
        })
        .collect()
}

/// Whether a triangle surface can be that of a ball: Euler's count.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut corners: Vec<u32> = triangles.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    triangles.len() + 4 == 2 * corners.len()
}

fn nearest(points: &[Vec3], to: &Vec3) -> u32 {
    let mut best = (0, f64::INFINITY);
    for (place, point) in (0_u32..).zip(points) {
        let square = (point - to).norm_squared();
        if square < best.1 {
            best = (place, square);
        }
    }
    best.0
}

/// Sorts corners of a convex face counter-clockwise about its normal.
fn order_around(points: &[Vec3], normal: &Vec3, corners: &mut [u32]) {
    let at = |k: u32| points[k as usize];
    let Some(&first) = corners.first() else {
        return;
    };
    let middle: Vec3 = corners.iter().map(|&k| at(k)).sum::<Vec3>() / corners.len() as f64;
    let x = at(first) - middle;
    let y = normal.cross(&x);
    let angle = |k: u32| {
        let p = at(k) - middle;
        p.dot(&y).atan2(p.dot(&x))
    };
    corners.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)).then(a.cmp(&b)));
}
