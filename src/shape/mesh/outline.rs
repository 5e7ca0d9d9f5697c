//! How far a mesh reaches in any direction, from a table of directions: its box at a pose costs the same for any number
//! of triangles.
//!
//! In: exact reaches at the nodes of a grid on the faces of a cube. Out: an upper bound for any direction.
//!
//! The reach `h(d)`, the greatest `d . v` over all vertices, is convex and scales with the length of `d`: if `d` is a
//! sum of grid directions with non-negative weights, `h(d)` is at most the same sum of their reaches. The weights are
//! bilinear in the grid's cell. Along the axes of the mesh the bound is exact; for a sphere it is at most 0.4 % too
//! large.

use crate::math::{Point, ROUND, Vec3, f32_up};

/// Cells along a side of a cube face: the error falls with their square. 16 make 7 kB a mesh.
const CELLS: usize = 16;
const NODES: usize = CELLS + 1;

/// The table.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    /// `[6][NODES][NODES]`: cube face (axis, then sign), second axis, third axis; metres, rounded up.
    reach: Vec<f32>,
}

impl Outline {
    /// * `reach` - an upper bound on `d . v` over all vertices, for a direction of any length.
    pub(super) fn new(reach: impl Fn(&Vec3) -> f64) -> Self {
        let at = |k: usize| 2.0 * count(k) / count(CELLS) - 1.0;
        let mut all = Vec::with_capacity(6 * NODES * NODES);
        for face in 0..6 {
            for i in 0..NODES {
                for j in 0..NODES {
                    let sign = if face % 2 == 0 { 1.0 } else { -1.0 };
                    let mut direction = Vec3::zeros();
                    let axis = face / 2;
                    direction[axis] = sign;
                    direction[(axis + 1) % 3] = at(i);
                    direction[(axis + 2) % 3] = at(j);
                    all.push(f32_up(reach(&direction)));
                }
            }
        }
        Self { reach: all }
    }

    /// An upper bound on `direction . v` over all vertices, up to rounding.
    pub(super) fn reach(&self, direction: &Vec3) -> f64 {
        let axis = direction.iamax();
        let largest = direction[axis].abs();
        if largest == 0.0 {
            return 0.0;
        }
        let face = 2 * axis + usize::from(direction[axis] < 0.0);
        let (i, u) = cell(direction[(axis + 1) % 3] / largest);
        let (j, v) = cell(direction[(axis + 2) % 3] / largest);
        let at = |i: usize, j: usize| f64::from(self.reach[(face * NODES + i) * NODES + j]);
        let near = at(i, j) * (1.0 - v) + at(i, j + 1) * v;
        let far = at(i + 1, j) * (1.0 - v) + at(i + 1, j + 1) * v;
        largest * (near * (1.0 - u) + far * u)
    }
}

fn count(k: usize) -> f64 {
    f64::from(u32::try_from(k).unwrap_or(u32::MAX))
}

/// The cell of a coordinate in [-1, 1], and the position in it from 0 to 1.
fn cell(x: f64) -> (usize, f64) {
    let scaled = (x.clamp(-1.0, 1.0) + 1.0) * 0.5 * count(CELLS);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to CELLS by the clamp"
    )]
    let place = (scaled as usize).min(CELLS - 1);
    (place, scaled - count(place))
}

// Coordinates of the grid are exact.
const _: () = assert!(CELLS.is_power_of_two());

/// Greatest distance of a named vertex from the centre, rounded up.
pub(super) fn radius(vertices: &[Point], faces: &[[u32; 3]], centre: &Point) -> f64 {
    let square = faces
        .iter()
        .flatten()
        .map(|&v| (vertices[v as usize] - centre).norm_squared())
        .fold(0.0, f64::max);
    square.sqrt() * (1.0 + 8.0 * ROUND)
}
