//! The axes of a box: those of the area's covariance, of the mesh's frame, or of the single triangle.
//!
//! In: triangles. Out: axes and a centre in f64, and the corners that the box must contain.

use nalgebra::{Matrix3, SymmetricEigen};

use crate::math::{Point, Vec3};

/// A box around triangles, in f64; [`ObbPack::of`] rounds and measures it again.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub(super) axes: Matrix3<f64>,
    pub(super) centre: Point,
    pub(super) corners: Vec<Point>,
}

pub(super) fn fit(part: &[(u32, Vec3)], corners: &impl Fn(u32) -> [Point; 3]) -> Fitted {
    let all: Vec<Point> = part.iter().flat_map(|&(face, _)| corners(face)).collect();
    let axes = if let [(face, _)] = part {
        triangle_axes(&corners(*face))
    } else {
        // The tighter of the two by the box's surface area.
        let candidates = [area_axes(part, corners), Matrix3::identity()];
        let surface = |axes: &Matrix3<f64>| {
            let (_, half) = extents(axes, &all);
            half.x * half.y + half.y * half.z + half.z * half.x
        };
        if surface(&candidates[0]) < surface(&candidates[1]) {
            candidates[0]
        } else {
            candidates[1]
        }
    };
    around(axes, all)
}

/// The box along these axes around points.
pub(super) fn around(axes: Matrix3<f64>, corners: Vec<Point>) -> Fitted {
    let (centre, _) = extents(&axes, &corners);
    Fitted {
        axes,
        centre,
        corners,
    }
}

/// Centre and half sides along axes.
fn extents(axes: &Matrix3<f64>, points: &[Point]) -> (Point, Vec3) {
    let from = points[0];
    let (mut low, mut high) = (Vec3::zeros(), Vec3::zeros());
    for p in points {
        let on = axes.tr_mul(&(p - from));
        low = low.inf(&on);
        high = high.sup(&on);
    }
    (from + axes * ((low + high) * 0.5), (high - low) * 0.5)
}

/// Along the longest edge, along the normal, and across.
fn triangle_axes([a, b, c]: &[Point; 3]) -> Matrix3<f64> {
    let edges = [b - a, c - b, a - c];
    let longest = if edges[0].norm_squared() >= edges[1].norm_squared() {
        edges[0]
    } else {
        edges[1]
    };
    let longest = if longest.norm_squared() >= edges[2].norm_squared() {
        longest
    } else {
        edges[2]
    };
    let along = longest
        .try_normalize(f64::MIN_POSITIVE)
        .unwrap_or(Vec3::x());
    let normal = edges[0].cross(&edges[1]);
    let normal = normal - along * along.dot(&normal);
    let normal = normal
        .try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_else(|| any_across(&along));
    Matrix3::from_columns(&[along, normal.cross(&along), normal])
}

/// A unit vector orthogonal to a unit vector.
fn any_across(along: &Vec3) -> Vec3 {
    let least = Vec3::ith(along.iamin(), 1.0);
    let across = least - along * along.dot(&least);
    across.try_normalize(f64::MIN_POSITIVE).unwrap_or(Vec3::z())
}

/// Principal axes of the area.
fn area_axes(part: &[(u32, Vec3)], corners: &impl Fn(u32) -> [Point; 3]) -> Matrix3<f64> {
    let from = corners(part[0].0)[0];
    let (mut area, mut mean, mut second) = (0.0, Vec3::zeros(), Matrix3::zeros());
    for &(face, _) in part {
        let [p, q, r] = corners(face).map(|x| x - from);
        let size = (q - p).cross(&(r - p)).norm();
        let middle = (p + q + r) / 3.0;
        area += size;
        mean += middle * size;
        let spread = middle * middle.transpose() * 9.0
            + p * p.transpose()
            + q * q.transpose()
            + r * r.transpose();
        second += spread * (size / 12.0);
    }
    if area <= f64::MIN_POSITIVE {
        return Matrix3::identity();
    }
    let mean = mean / area;
    let covariance = second / area - mean * mean.transpose();
    let largest = covariance.amax();
    if !(largest.is_finite() && largest > f64::MIN_POSITIVE) {
        return Matrix3::identity();
    }
    // Scaled: the eigenvalue search stops at an absolute tolerance.
    let axes = SymmetricEigen::new(covariance / largest).eigenvectors;
    let first = axes.column(0).into_owned().try_normalize(0.5);
    let second = first.and_then(|u| {
        let v = axes.column(1).into_owned();
        (v - u * u.dot(&v)).try_normalize(0.5)
    });
    match (first, second) {
        (Some(u), Some(v)) => Matrix3::from_columns(&[u, v, u.cross(&v)]),
        _ => Matrix3::identity(),
    }
}
