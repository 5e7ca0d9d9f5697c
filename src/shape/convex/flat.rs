//! Corners of point sets without volume: in one plane or on one line.
//!
//! In: points, own frame, all different, sorted by their coordinates. Out: which are corners of their hull.
//!
//! Source: Andrew 1979, "Another efficient algorithm for convex hulls in two dimensions"; turns are exact.

use std::cmp::Ordering;

use crate::math::Point;
use crate::shape::mesh::{side, turn_yz};

/// Which points are corners: projected along an axis that does not lie in the plane, those at which the outline turns;
/// for a line, its ends.
///
/// * `points` - at least one, `facets::is_exact`.
/// * returns - `None` if they are not coplanar.
///
/// Cost: O(n log n).
pub(super) fn corners_of(points: &[Point]) -> Option<Vec<bool>> {
    let (first, last) = (points.first()?, points.last()?);
    let mut is_corner = vec![false; points.len()];
    let off_line = (0..3).find_map(|axis| {
        let is_off = |p: &&Point| turn(axis, first, last, p).is_ne();
        Some((axis, points.iter().find(is_off)?))
    });
    let Some((axis, third)) = off_line else {
        is_corner[0] = true;
        is_corner[points.len() - 1] = true;
        return Some(is_corner);
    };
    if !points.iter().all(|p| side(first, last, third, p).is_eq()) {
        return None;
    }
    // No two coincide in this projection, since the axis does not lie in the plane.
    let mut order: Vec<usize> = (0..points.len()).collect();
    let (l, m) = ((axis + 1) % 3, (axis + 2) % 3);
    let key = |place: usize, k: usize| points[place][k] + 0.0;
    order.sort_by(|&a, &b| {
        let along = key(a, l).total_cmp(&key(b, l));
        along.then(key(a, m).total_cmp(&key(b, m)))
    });
    mark_chain(points, axis, order.iter(), &mut is_corner);
    mark_chain(points, axis, order.iter().rev(), &mut is_corner);
    Some(is_corner)
}

/// Marks one half of the outline: the points that remain, in order, when each that makes no left turn is removed.
fn mark_chain<'a>(
    points: &[Point],
    axis: usize,
    order: impl Iterator<Item = &'a usize>,
    is_corner: &mut [bool],
) {
    let mut chain: Vec<usize> = Vec::new();
    for &next in order {
        while let [.., a, b] = chain[..]
            && turn(axis, &points[a], &points[b], &points[next]).is_le()
        {
            chain.pop();
        }
        chain.push(next);
    }
    for place in chain {
        is_corner[place] = true;
    }
}

/// The turn of three points seen along an axis.
fn turn(axis: usize, a: &Point, b: &Point, c: &Point) -> Ordering {
    let seen = |p: &Point| Point::new(p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]);
    turn_yz(&seen(a), &seen(b), &seen(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of points, which are sorted first.
    fn corners(mut points: Vec<Point>) -> Option<Vec<Point>> {
        points.sort_by(|a, b| {
            a.coords
                .as_slice()
                .partial_cmp(b.coords.as_slice())
                .unwrap()
        });
        let is_corner = corners_of(&points)?;
        let kept = points.iter().zip(is_corner).filter(|(_, is)| *is);
        Some(kept.map(|(p, _)| *p).collect())
    }

    #[test]
    fn a_grid_in_any_plane_has_four_corners_and_a_line_two() {
        let cells = || (0..9).flat_map(|x| (0..9).map(move |y| (f64::from(x), f64::from(y))));
        let planes: [fn(f64, f64) -> [f64; 3]; 5] = [
            |x, y| [x, y, 0.5],
            |x, y| [0.0, x, y],
            |x, y| [x, -3.0, y],
            |x, y| [x, y, x - 2.0 * y],
            |x, y| [x, x, y],
        ];
        for plane in planes {
            let grid = cells().map(|(x, y)| Point::from(plane(x, y)));
            assert_eq!(corners(grid.collect()).unwrap().len(), 4);
            let line = (0..50).map(|k| Point::from(plane(f64::from(k), 2.0 * f64::from(k))));
            assert_eq!(corners(line.collect()).unwrap().len(), 2);
            assert_eq!(
                corners(vec![Point::from(plane(1.0, 2.0))]).unwrap().len(),
                1
            );
        }
        // Off the line by an ulp, but still in the plane.
        let triangle = [
            [0.0, 0.0, 1.0],
            [0.5, 0.5_f64.next_up(), 1.0],
            [1.0, 1.0, 1.0],
        ];
        let mut points: Vec<Point> = triangle.map(Point::from).into();
        assert_eq!(corners(points.clone()).unwrap().len(), 3);
        points.push(Point::new(0.3, 0.1, 1.0_f64.next_up()));
        assert_eq!(corners(points), None);
    }
}
