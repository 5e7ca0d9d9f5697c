//! One sweep along one axis: all pairs of boxes at once, for a list that was just sorted or for many new bodies.
//!
//! In: bodies in order of their lower ends. Out: pairs that overlap on the requested axes.
//!
//! The boxes are copied into bands of the second axis, in sweep order, so that the inner loop reads memory sequentially
//! and meets only bodies that are near on two axes: in a gas of 10,000 boxes that is 9 times fewer comparisons than
//! along one axis alone. A body is in each band that it touches, and a pair is reported in the band where the later of
//! the two begins, so exactly once. Bodies that touch many bands are compared with everything.

use super::axis::Axis;
use crate::broad::members::{Bounds, Members};
use crate::ids::{BodySlot, small};

/// Bands that one body may be in; one that touches more is compared with all.
const BANDS_PER_BODY: usize = 4;
/// Width of a band relative to the mean width of a body: with narrower bands, bodies are in too many of them.
const BAND_WIDTHS: f64 = 2.0;
/// Fewest bodies per band.
const BODIES_PER_BAND: usize = 16;
/// Boxes compared before their hits are evaluated.
const CHUNK: usize = 32;

/// A body in the order of the sweep.
#[derive(Clone, Copy, Debug)]
struct Item {
    bounds: Bounds,
    slot: BodySlot,
    /// Band in which its lower end lies.
    first: u32,
    asked: bool,
}

/// The part of a body that the inner loop reads: its box on the two compared axes, upper ends negated, so that two
/// boxes overlap when four numbers do not exceed four others: compares without a branch, two at a time.
type Near = [f64; 4];

/// A box in the form in which it is tested.
fn near(bounds: &Bounds, beside: [usize; 2]) -> Near {
    let [one, two] = beside;
    let (min, max) = (&bounds.min, &bounds.max);
    [min[one], min[two], -max[one], -max[two]]
}

/// The limits of a box that other boxes are tested against.
fn limits(bounds: &Bounds, beside: [usize; 2]) -> Near {
    let [one, two] = beside;
    let (min, max) = (&bounds.min, &bounds.max);
    [max[one], max[two], -min[one], -min[two]]
}

/// How the second axis is cut into bands. The band index is monotonic in the value, which is all that correctness
/// needs.
#[derive(Clone, Copy, Debug)]
struct Bands {
    from: f64,
    scale: f64,
    len: usize,
}

impl Bands {
    /// The band of a value; infinities are in the outer ones.
    fn at(&self, value: f64) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the cast saturates and sends NaN to 0; clamped beside it"
        )]
        let band = ((value - self.from) * self.scale) as usize;
        band.min(self.len - 1)
    }
}

/// Parameters of a sweep.
#[derive(Debug)]
pub(super) struct Course<'a> {
    /// The sorted axis.
    pub(super) axis: &'a Axis,
    /// Its index.
    pub(super) along: usize,
    /// The compared axes.
    pub(super) beside: [usize; 2],
    /// Most pairs to report.
    pub(super) most: usize,
}

/// Memory of the sweep, kept across updates.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    /// All bodies with a box, in order of their lower ends.
    items: Vec<Item>,
    /// Copies of them by band, each in the same order.
    banded: Vec<Item>,
    /// Lower ends of `banded`: a compact array to scan for the last candidate.
    lowers: Vec<f64>,
    /// Boxes of `banded` on the two compared axes.
    nears: Vec<Near>,
    /// Where each band starts in `banded`.
    starts: Vec<usize>,
    /// Indices in `items` of bodies that touch many bands.
    wide: Vec<usize>,
}

impl Sweep {
    /// Reports pairs that overlap on all axes of the course with at least one `asked` body; `false` when they are too
    /// many. Counts comparisons.
    pub(super) fn run(
        &mut self,
        course: &Course<'_>,
        members: &Members,
        asked: impl Fn(BodySlot) -> bool,
        met: &mut Vec<(BodySlot, BodySlot)>,
    ) -> (bool, u64) {
        let bands = self.fill(course, members, asked);
        self.spread(bands, course);
        let mut tests = self.sweep_wide(course, met);
        for band in 0..bands.len {
            tests += self.sweep_band(course, band, met);
            if met.len() > course.most {
                return (false, tests);
            }
        }
        (met.len() <= course.most, tests)
    }

    /// Copies the boxes in order and chooses the bands.
    fn fill(
        &mut self,
        course: &Course<'_>,
        members: &Members,
        asked: impl Fn(BodySlot) -> bool,
    ) -> Bands {
        self.items.clear();
        let across = course.beside[0];
        let (mut least, mut most, mut widths) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for slot in course.axis.lowers() {
            let bounds = *members.bounds(slot);
            let (low, high) = (bounds.min[across], bounds.max[across]);
            if low.is_finite() && high.is_finite() {
                (least, most) = (least.min(low), most.max(low));
                widths += high - low;
            }
            self.items.push(Item {
                bounds,
                slot,
                first: 0,
                asked: asked(slot),
            });
        }
        let count = self.items.len();
        #[allow(
            clippy::cast_precision_loss,
            reason = "a count far below 2^53, and a width that only chooses"
        )]
        let band = (BAND_WIDTHS * widths / count as f64).max((most - least) / count as f64);
        let wanted = Bands {
            from: least,
            scale: 1.0 / band,
            len: (count / BODIES_PER_BAND).max(1),
        };
        let one = Bands {
            from: 0.0,
            scale: 0.0,
            len: 1,
        };
        if !wanted.scale.is_finite() || !wanted.from.is_finite() {
            return one;
        }
        Bands {
            len: wanted.at(most) + 1,
            ..wanted
        }
    }

    /// Copies each body into the bands it touches.
    fn spread(&mut self, bands: Bands, course: &Course<'_>) {
        let across = course.beside[0];
        self.wide.clear();
        self.starts.clear();
        self.starts.resize(bands.len + 1, 0);
        let touched = |item: &Item| {
            let (low, high) = (item.bounds.min[across], item.bounds.max[across]);
            bands.at(low)..=bands.at(high).max(bands.at(low))
        };
        for (at, item) in self.items.iter_mut().enumerate() {
            let touched = touched(item);
            item.first = small(*touched.start());
            if touched.end() - touched.start() >= BANDS_PER_BODY {
                self.wide.push(at);
            } else {
                touched.for_each(|band| self.starts[band + 1] += 1);
            }
        }
        for band in 0..bands.len {
            self.starts[band + 1] += self.starts[band];
        }
        let Some(any) = self.items.first() else {
            return;
        };
        let total = self.starts[bands.len];
        self.banded.clear();
        self.banded.resize(total, *any);
        // Each start serves as the position of the next body, and so becomes the start of the band after.
        let mut wide = self.wide.iter().peekable();
        for (at, item) in self.items.iter().enumerate() {
            if wide.next_if_eq(&&at).is_some() {
                continue;
            }
            for band in touched(item) {
                self.banded[self.starts[band]] = *item;
                self.starts[band] += 1;
            }
        }
        self.starts.rotate_right(1);
        self.starts[0] = 0;
        self.lowers.clear();
        self.nears.clear();
        for item in &self.banded {
            self.lowers.push(item.bounds.min[course.along]);
            self.nears.push(near(&item.bounds, course.beside));
        }
    }

    /// Compares the bodies that touch many bands with all others, and with each other once.
    fn sweep_wide(&self, course: &Course<'_>, met: &mut Vec<(BodySlot, BodySlot)>) -> u64 {
        let mut is_wide = self.wide.iter().copied().peekable();
        for (at, other) in self.items.iter().enumerate() {
            let other_is_wide = is_wide.next_if_eq(&at).is_some();
            for place in &self.wide {
                let item = &self.items[*place];
                let overlap = item.bounds.meets(&other.bounds, course.along)
                    & item.bounds.meets(&other.bounds, course.beside[0])
                    & item.bounds.meets(&other.bounds, course.beside[1])
                    & (item.asked | other.asked);
                if overlap && (!other_is_wide || *place < at) {
                    met.push((item.slot, other.slot));
                }
            }
        }
        (self.wide.len() * self.items.len()) as u64
    }

    /// Sweeps one band.
    fn sweep_band(
        &self,
        course: &Course<'_>,
        band: usize,
        met: &mut Vec<(BodySlot, BodySlot)>,
    ) -> u64 {
        let (from, to) = (self.starts[band], self.starts[band + 1]);
        let here = small(band);
        let (items, lowers) = (&self.banded[from..to], &self.lowers[from..to]);
        let nears = &self.nears[from..to];
        let mut tests = 0;
        for (at, item) in items.iter().enumerate() {
            let reach = item.bounds.max[course.along];
            let limits = limits(&item.bounds, course.beside);
            // Bodies that start beyond the upper end cannot overlap, nor can any after them.
            let mut start = at + 1;
            let count = lowers[start..]
                .iter()
                .take_while(|low| **low <= reach)
                .count();
            tests += count as u64;
            for chunk in nears[start..start + count].chunks(CHUNK) {
                let mut hits = [0_usize; CHUNK];
                let mut len = 0;
                for (place, near) in (start..).zip(chunk) {
                    let meets = (near[0] <= limits[0])
                        & (near[1] <= limits[1])
                        & (near[2] <= limits[2])
                        & (near[3] <= limits[3]);
                    hits[len] = place;
                    len += usize::from(meets);
                }
                for other in &hits[..len] {
                    let other = &items[*other];
                    if item.first.max(other.first) == here && (item.asked || other.asked) {
                        met.push((item.slot, other.slot));
                    }
                }
                start += CHUNK;
            }
        }
        tests
    }
}
