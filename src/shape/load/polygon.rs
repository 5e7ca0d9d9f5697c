//! Polygons into triangles: a fan if the polygon is convex, ear clipping if not.

use crate::math::{Point, Vec3};

/// Most corners of a polygon that is not convex: ear clipping takes up to the third power of them.
const EAR_CORNERS_MAX: usize = 1000;

/// The triangles of a polygon, with its orientation.
///
/// A fan of a polygon that is not convex covers area outside it and misses area inside; ears do not.
///
/// * `corners` - indices into `vertices`, in range, at least 3.
///
/// # Errors
/// A text, if the polygon crosses itself so that no ear is found.
///
/// Source: Meisters 1975, "Polygons have ears".
pub(super) fn cut(vertices: &[Point], corners: &[u32]) -> Result<Vec<[u32; 3]>, String> {
    if let [a, b, c] = *corners {
        return Ok(vec![[a, b, c]]);
    }
    let place = |corner: u32| vertices[corner as usize].coords;
    // Newell's normal: twice the area, also if corners are collinear or the polygon is not quite flat.
    let origin = place(corners[0]);
    let mut normal = Vec3::zeros();
    for (k, corner) in corners.iter().enumerate() {
        let next = corners[(k + 1) % corners.len()];
        normal += (place(*corner) - origin).cross(&(place(next) - origin));
    }
    // Projected along the normal's largest component; mirrored if that is negative, so that it turns to the left.
    let axis = normal.iamax();
    let (u, v) = if normal[axis] >= 0.0 {
        ((axis + 1) % 3, (axis + 2) % 3)
    } else {
        ((axis + 2) % 3, (axis + 1) % 3)
    };
    let flat = |corner: u32| {
        let at = place(corner) - origin;
        [at[u], at[v]]
    };
    let points: Vec<[f64; 2]> = corners.iter().map(|corner| flat(*corner)).collect();
    let count = points.len();
    let is_convex = normal[axis] != 0.0
        && (0..count)
            .all(|k| turn(points[k], points[(k + 1) % count], points[(k + 2) % count]) >= 0.0)
        && (1..count - 1).all(|k| turn(points[0], points[k], points[k + 1]) >= 0.0);
    if is_convex || normal[axis] == 0.0 {
        // Without an area there is nothing to cover twice.
        return Ok((1..count - 1)
            .map(|k| [corners[0], corners[k], corners[k + 1]])
            .collect());
    }
    if corners.len() > EAR_CORNERS_MAX {
        let count = corners.len();
        return Err(format!(
            "a face of {count} corners is not convex: export the mesh as triangles"
        ));
    }
    ears(corners, &points)
}

/// Twice the signed area of a triangle: positive to the left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether two points are identical: only then may a corner lie on an ear.
#[allow(clippy::float_cmp, reason = "the same corner, copied, not computed")]
fn same(a: [f64; 2], b: [f64; 2]) -> bool {
    a == b
}

fn ears(corners: &[u32], points: &[[f64; 2]]) -> Result<Vec<[u32; 3]>, String> {
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut faces = Vec::with_capacity(corners.len() - 2);
    let mut at = 0;
    let mut misses = 0;
    while left.len() > 3 {
        let count = left.len();
        let (before, tip, after) = (
            left[(at + count - 1) % count],
            left[at % count],
            left[(at + 1) % count],
        );
        let [a, b, c] = [points[before], points[tip], points[after]];
        let holds = |p: [f64; 2]| {
            !same(p, a)
                && !same(p, b)
                && !same(p, c)
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
        };
        let is_flat = turn(a, b, c) == 0.0;
        let is_ear = turn(a, b, c) > 0.0 && !left.iter().any(|k| holds(points[*k]));
        if is_ear || is_flat {
            faces.push([corners[before], corners[tip], corners[after]]);
            left.remove(at % count);
            misses = 0;
            at %= left.len();
        } else {
            misses += 1;
            at = (at + 1) % count;
        }
        if misses > count {
            return Err(crossed(corners));
        }
    }
    if let [a, b, c] = left[..] {
        // The areas sum up to that of the polygon, so a crossing shows in the last triangle at the latest.
        if turn(points[a], points[b], points[c]) < 0.0 {
            return Err(crossed(corners));
        }
        faces.push([corners[a], corners[b], corners[c]]);
    }
    Ok(faces)
}

fn crossed(corners: &[u32]) -> String {
    let count = corners.len();
    format!("a face of {count} corners crosses itself: export the mesh as triangles")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[Point], faces: &[[u32; 3]]) -> (f64, f64) {
        let mut signed = 0.0;
        let mut total = 0.0;
        for face in faces {
            let [a, b, c] = face.map(|k| points[k as usize]);
            let z = (b - a).cross(&(c - a)).z / 2.0;
            signed += z;
            total += z.abs();
        }
        (signed, total)
    }

    #[test]
    fn a_polygon_that_is_not_convex_is_covered_once() {
        // A comb with three teeth, in both orientations.
        let outline = [
            (0.0, 0.0),
            (7.0, 0.0),
            (7.0, 3.0),
            (6.0, 3.0),
            (6.0, 1.0),
            (4.0, 1.0),
            (4.0, 3.0),
            (3.0, 3.0),
            (3.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ];
        let points: Vec<Point> = outline
            .iter()
            .map(|(x, y)| Point::new(*x, *y, 2.0))
            .collect();
        let corners: Vec<u32> = (0..12).collect();
        let faces = cut(&points, &corners).unwrap();
        assert_eq!(faces.len(), 10);
        assert_eq!(area(&points, &faces), (13.0, 13.0));
        let backward: Vec<u32> = (0..12).rev().collect();
        let faces = cut(&points, &backward).unwrap();
        assert_eq!(area(&points, &faces), (-13.0, 13.0));
    }

    #[test]
    fn a_square_with_a_corner_in_line_is_a_fan_or_ears_of_the_same_area() {
        let points = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
            .map(|(x, y)| Point::new(x, y, 0.0));
        let faces = cut(&points, &[0, 1, 2, 3, 4]).unwrap();
        assert_eq!(area(&points, &faces), (4.0, 4.0));
    }

    #[test]
    fn a_bow_tie_of_unequal_halves_is_an_error() {
        let points =
            [(0.0, 0.0), (3.0, 3.0), (3.0, 0.0), (0.0, 1.0)].map(|(x, y)| Point::new(x, y, 0.0));
        assert!(cut(&points, &[0, 1, 2, 3]).is_err());
    }
}
