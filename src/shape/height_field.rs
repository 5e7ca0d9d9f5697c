//! Height fields as closed meshes: the top surface, four side walls, and a floor below the least sample.
//!
//! In: a grid of checked samples. Out: vertices and faces; the faces of the top surface come first, two a cell, row by
//! row, so that a triangle's index gives its cell.

use crate::math::Point;

/// Number of triangles in the mesh of a grid.
pub(crate) fn triangles(rows: usize, columns: usize) -> u64 {
    let (rows, columns) = (rows.max(2) as u64, columns.max(2) as u64);
    let edges = boundary_len(rows, columns);
    (rows - 1)
        .saturating_mul(columns - 1)
        .saturating_mul(2)
        .saturating_add(3 * edges)
}

fn boundary_len(rows: u64, columns: u64) -> u64 {
    2 * (rows - 1) + 2 * (columns - 1)
}

/// Vertices and outward faces of the solid under a grid, its own frame, metres.
///
/// Each cell is cut from its lower-left to its upper-right sample, as in MuJoCo. The floor is a fan about its middle
/// that shares the walls' corners, so that no corner lies on another's edge and the mesh is closed.
///
/// * `heights` - `[rows][columns]`, at least 2 by 2, rows along +y, columns along +x.
/// * `size` - full extent along x and y, metres; centred on the origin.
/// * `base_m` - how far the floor lies below the least sample, metres.
pub(crate) fn mesh(
    heights: &[Vec<f64>],
    size: [f64; 2],
    base_m: f64,
) -> (Vec<Point>, Vec<[u32; 3]>) {
    let (rows, columns) = (heights.len(), heights.first().map_or(0, Vec::len));
    let least = heights
        .iter()
        .flatten()
        .fold(f64::INFINITY, |a, b| a.min(*b));
    // Rounded down and away, so that a huge least sample still has a floor below it.
    let floor = (least - base_m).min(least.next_down());
    let mut points = Vec::with_capacity(rows * columns + 2 * (rows + columns));
    for (row, samples) in heights.iter().enumerate() {
        let y = place(row, rows, size[1]);
        for (column, height) in samples.iter().enumerate() {
            points.push(Point::new(place(column, columns, size[0]), y, *height));
        }
    }
    let sample = |row: usize, column: usize| index(row * columns + column);
    let mut faces = Vec::new();
    for row in 1..rows {
        for column in 1..columns {
            let (low, high) = (sample(row - 1, column - 1), sample(row, column));
            faces.push([low, sample(row - 1, column), high]);
            faces.push([low, high, sample(row, column - 1)]);
        }
    }

    // Once around the rim, counter-clockwise seen from above.
    let south = (0..columns - 1).map(|column| sample(0, column));
    let east = (0..rows - 1).map(|row| sample(row, columns - 1));
    let north = (1..columns).rev().map(|column| sample(rows - 1, column));
    let west = (1..rows).rev().map(|row| sample(row, 0));
    let rim: Vec<u32> = south.chain(east).chain(north).chain(west).collect();
    let below = index(points.len());
    for at in &rim {
        let top = points[*at as usize];
        points.push(Point::new(top.x, top.y, floor));
    }
    let middle = index(points.len());
    points.push(Point::new(0.0, 0.0, floor));
    for (k, top) in rim.iter().enumerate() {
        let next = (k + 1) % rim.len();
        let (top_next, low, low_next) = (rim[next], below + index(k), below + index(next));
        faces.push([*top, low, low_next]);
        faces.push([*top, low_next, top_next]);
        faces.push([middle, low_next, low]);
    }
    (points, faces)
}

/// Position of sample `k` of `count` along a side of `length_m`; the ends are exact.
fn place(k: usize, count: usize, length_m: f64) -> f64 {
    #[allow(
        clippy::cast_precision_loss,
        reason = "a grid has at most some millions of samples"
    )]
    let (k, last) = (k as f64, (count - 1) as f64);
    length_m * (k / last) - length_m / 2.0
}

fn index(k: usize) -> u32 {
    // The count of triangles was checked before: it is far below u32.
    u32::try_from(k).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn a_height_field_is_closed_with_its_top_first_and_its_volume_right() {
        let heights = vec![
            vec![0.0, 0.5, 0.0],
            vec![0.25, 1.0, 0.25],
            vec![0.0, 0.5, 0.0],
            vec![0.0, 0.0, -1.0],
        ];
        let (points, faces) = mesh(&heights, [4.0, 6.0], 0.5);
        assert_eq!(faces.len() as u64, triangles(4, 3));
        let mut edges = BTreeMap::new();
        let mut volume = 0.0;
        for face in &faces {
            let [a, b, c] = face.map(|i| points[i as usize].coords);
            volume += a.dot(&b.cross(&c)) / 6.0;
            for k in 0..3 {
                *edges.entry((face[k], face[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        for ((from, to), count) in &edges {
            assert_eq!((*count, edges.get(&(*to, *from))), (1, Some(&1)));
        }
        // The volume under each triangle of the top is its mean height above the floor times its area.
        let mut wanted = 0.0;
        for face in &faces[..12] {
            let [a, b, c] = face.map(|i| points[i as usize]);
            let area = (b - a).xy().perp(&(c - a).xy()) / 2.0;
            assert!(area > 0.0, "the top is seen counter-clockwise from above");
            wanted += area * ((a.z + b.z + c.z) / 3.0 + 1.5);
        }
        assert!((volume - wanted).abs() < 1e-12, "{volume} {wanted}");
        assert!(
            faces[12..]
                .iter()
                .flatten()
                .any(|i| points[*i as usize].z <= -1.5)
        );
    }
}
