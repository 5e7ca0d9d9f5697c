//! From boxes to cells: the cell index is monotonic in the coordinate, so boxes that share a point share a cell,
//! whatever rounding does.

use crate::broad::members::Bounds;

/// Levels: cells from 2^-40 to 2^60 metres; smaller and larger boxes use the first or last level.
const POWERS: std::ops::RangeInclusive<i32> = -40..=60;
/// Most cells of an array, per body, plus a few; beyond that the cells are made larger than the largest box needs.
const CELLS_A_BODY: f64 = 4.0;
/// See [`CELLS_A_BODY`].
const CELLS_LEAST: f64 = 64.0;
/// Cells on one axis at most, so that their numbers are exact.
const CELLS_AN_AXIS: f64 = 1_099_511_627_776.0;
/// A box as large as a cell covers two on each axis; with cells larger by this factor, rounding does not add a third.
const ROOM: f64 = 1.0 + 1e-6;

/// The least power of two above a box's longest side: its level.
pub(super) fn level_of(side_m: f64) -> i32 {
    // The exponent of the number; a side of zero has the least.
    let exponent = i32::try_from(side_m.to_bits() >> 52 & 0x7FF).unwrap_or(0) - 1023;
    (exponent + 1).clamp(*POWERS.start(), *POWERS.end())
}

/// Cells of one size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    origin: [f64; 3],
    cells_per_m: f64,
    /// Cells of an array around the scene on each axis.
    shape: [i64; 3],
}

impl Lattice {
    /// The cells of a level, around the world's origin.
    pub(super) fn of_power(power: i32) -> Self {
        Self {
            origin: [0.0; 3],
            cells_per_m: 2.0_f64.powi(-power),
            shape: [i64::MAX; 3],
        }
    }

    /// Cells as large as the largest finite box.
    ///
    /// * `bodies` - number of bodies, if the cells are in an array: the cells are then made large enough for it.
    pub(super) fn around<'a>(
        boxes: impl Iterator<Item = &'a Bounds>,
        bodies: Option<usize>,
    ) -> Self {
        let (mut low, mut high, mut cell) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], 0.0_f64);
        for bounds in boxes.filter(|bounds| bounds.side().is_finite()) {
            cell = cell.max(bounds.side());
            for k in 0..3 {
                low[k] = low[k].min(bounds.min[k]);
                high[k] = high[k].max(bounds.max[k]);
            }
        }
        let extent: [f64; 3] = std::array::from_fn(|k| (high[k] - low[k]).max(0.0));
        let longest = extent.into_iter().fold(0.0, f64::max);
        cell = (cell * ROOM)
            .max(longest / CELLS_AN_AXIS)
            .max(f64::MIN_POSITIVE * CELLS_AN_AXIS);
        #[allow(clippy::cast_precision_loss, reason = "at most 2^20 bodies")]
        let most = bodies.map_or(f64::INFINITY, |n| CELLS_A_BODY * n as f64 + CELLS_LEAST);
        let count = |cell: f64| {
            extent
                .iter()
                .map(|e| (e / cell).floor() + 1.0)
                .product::<f64>()
        };
        while count(cell) > most {
            cell *= 1.25;
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most 2^41")]
        let shape = extent.map(|e| ((e / cell).floor() + 1.0) as i64);
        Self {
            origin: low.map(|l| if l.is_finite() { l } else { 0.0 }),
            cells_per_m: 1.0 / cell,
            shape,
        }
    }

    /// Cells of the array on each axis.
    pub(super) fn shape(&self) -> [i64; 3] {
        self.shape
    }

    /// The cells that a box covers.
    pub(super) fn range(&self, bounds: &Bounds) -> Range {
        let cell = |k: usize, place: f64| {
            #[allow(
                clippy::cast_possible_truncation,
                reason = "the cast saturates: what lies beyond stands in the last cell"
            )]
            let cell = ((place - self.origin[k]) * self.cells_per_m).floor() as i64;
            cell
        };
        Range {
            low: std::array::from_fn(|k| cell(k, bounds.min[k])),
            high: std::array::from_fn(|k| cell(k, bounds.max[k])),
        }
    }
}

/// Cells from a lowest to a highest, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Range {
    low: [i64; 3],
    high: [i64; 3],
}

impl Range {
    /// No cell.
    pub(super) const EMPTY: Self = Self {
        low: [0; 3],
        high: [-1; 3],
    };

    /// Number of cells.
    pub(super) fn len(&self) -> u64 {
        let side = |k: usize| self.high[k].saturating_sub(self.low[k]).saturating_add(1);
        let side = |k: usize| u64::try_from(side(k)).unwrap_or(0);
        side(0).saturating_mul(side(1)).saturating_mul(side(2))
    }

    /// The range clamped to an array; cells beyond fall on the edge.
    pub(super) fn clamped(&self, shape: [i64; 3]) -> Self {
        let clamp = |cell: [i64; 3]| std::array::from_fn(|k| cell[k].clamp(0, shape[k] - 1));
        Self {
            low: clamp(self.low),
            high: clamp(self.high),
        }
    }

    /// Every cell.
    pub(super) fn cells(self) -> impl Iterator<Item = [i64; 3]> {
        let [x, y, z] = std::array::from_fn(|k| self.low[k]..=self.high[k]);
        z.flat_map(move |z| {
            let x = x.clone();
            let y = y.clone();
            y.flat_map(move |y| x.clone().map(move |x| [x, y, z]))
        })
    }

    /// The lowest cell that is in both ranges; they must share one.
    pub(super) fn lower_shared(&self, other: &Self) -> [i64; 3] {
        std::array::from_fn(|k| self.low[k].max(other.low[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_the_least_power_of_two_above_the_side() {
        for (side, level) in [(1.0, 1), (0.99, 0), (3.0, 2), (0.0, -40), (1e300, 60)] {
            assert_eq!(level_of(side), level, "{side}");
        }
    }

    #[test]
    fn a_range_yields_each_cell_once() {
        let range = Range {
            low: [1, -1, 0],
            high: [2, 0, 0],
        };
        let cells: Vec<_> = range.cells().collect();
        assert_eq!(cells, [[1, -1, 0], [2, -1, 0], [1, 0, 0], [2, 0, 0]]);
        assert_eq!(range.len(), 4);
        assert_eq!((Range::EMPTY.len(), Range::EMPTY.cells().count()), (0, 0));
    }
}
