//! Sixteen boxes as a structure of arrays, the queries on them, and the safe twin of every kernel.

use super::hold::Held;

/// Boxes in a block.
pub(crate) const WIDTH: usize = 16;
/// The same, for arithmetic with ranks.
pub(crate) const LANES: u32 = 16;

const _: () = assert!(LANES as usize == WIDTH);

/// Sixteen boxes: lower x, y, z, then upper x, y, z, each for sixteen lanes. A lane without a box contains NaN: it
/// meets nothing, and no bound grows by it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Boxes16 {
    /// By face, by lane.
    pub(crate) faces: [[f32; WIDTH]; 6],
}

impl Boxes16 {
    /// No box at all.
    pub(crate) const EMPTY: Self = Self {
        faces: [[f32::NAN; WIDTH]; 6],
    };

    /// The box of one lane: lower corner, upper corner.
    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> [f32; 6] {
        std::array::from_fn(|k| self.faces[k][lane & (WIDTH - 1)])
    }

    /// Sets the box of one lane.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, one: &[f32; 6]) {
        for (face, value) in self.faces.iter_mut().zip(one) {
            face[lane & (WIDTH - 1)] = *value;
        }
    }
}

/// One box, every face as a number that rounding and widening make smaller: lower x, y, z, a spare, minus upper x, y,
/// z, a spare. So outward is downward on each lane, and `a` contains `b` if no lane of `a` is above that of `b`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Down {
    /// By lane.
    pub(crate) faces: [f32; 8],
}

/// The first spare lane of a [`Down`]; the other is four further.
pub(crate) const SPARE: usize = 3;
/// The value of the spare lanes of a box: two of them surely overlap there, so that no kernel needs to mask the lanes.
const SPARE_FACE: f32 = -1.0 - f32::EPSILON;

impl Down {
    /// No box: it contains nothing, meets nothing.
    pub(crate) const EMPTY: Self = Self {
        faces: [f32::NAN; 8],
    };

    /// Lower and upper corner.
    #[inline(always)]
    pub(crate) fn corners(&self) -> [f32; 6] {
        let f = &self.faces;
        [f[0], f[1], f[2], -f[4], -f[5], -f[6]]
    }

    /// Of lower and upper corner.
    #[inline(always)]
    pub(crate) fn of([x, y, z, u, v, w]: [f32; 6]) -> Self {
        Self {
            faces: [x, y, z, SPARE_FACE, -u, -v, -w, SPARE_FACE],
        }
    }

    /// Its faces without the spare lanes.
    #[inline(always)]
    pub(crate) const fn six(&self) -> [f32; 6] {
        let [x, y, z, _, u, v, w, _] = self.faces;
        [x, y, z, u, v, w]
    }

    /// Of its faces without the spare lanes.
    #[inline(always)]
    pub(crate) fn of_six([x, y, z, u, v, w]: [f32; 6]) -> Self {
        Self {
            faces: [x, y, z, SPARE_FACE, u, v, w, SPARE_FACE],
        }
    }

    /// As an outer box: its spare lanes contain any value.
    #[inline(always)]
    pub(crate) fn open(mut self) -> Self {
        self.faces[SPARE] = f32::NEG_INFINITY;
        self.faces[SPARE + 4] = f32::NEG_INFINITY;
        self
    }

    /// The mean of its three sides; not finite if the box is not.
    #[inline(always)]
    pub(crate) fn mean_side(&self) -> f32 {
        let f = &self.faces;
        // The sum of lower faces and minus upper ones is minus three mean sides.
        ((f[0] + f[4]) + (f[1] + f[5]) + (f[2] + f[6])) * (-1.0 / 3.0)
    }
}

/// Slack beyond the rounding of a face that proves an overlap of two boxes: rounding takes at most 2^-22 of a face's
/// distance from the origin, on either side.
pub(super) const SLACK_SHARE: f32 = 1.0 / 1_048_576.0;
/// Slack of a face in addition to [`SLACK_SHARE`], metres: for rounding below the normal range.
pub(super) const SLACK_LEAST: f32 = 8.0 * LEAST;
/// Subtracted from a face that was rounded to nearest, as a share of it: a step of an f32 or up to two, while rounding
/// moved it by half a step at most.
pub(super) const STEP: f32 = f32::EPSILON;
/// Also subtracted: below the normal range a step is less than the least normal number.
pub(super) const LEAST: f32 = f32::MIN_POSITIVE;

/// The slack of a face at this distance from the origin.
#[inline(always)]
pub(crate) fn slack(far: f32) -> f32 {
    far * SLACK_SHARE + SLACK_LEAST
}

/// Queries on sixteen boxes at once, and on single ones.
pub(crate) trait Lanes: Copy {
    /// Lanes whose closed box shares a point with `one`.
    fn meets(self, block: &Boxes16, one: &[f32; 6]) -> u16;

    /// The least box around the chosen lanes; inverted (`+inf`, `-inf`) if all of them are empty.
    fn bound(self, block: &Boxes16, chosen: u16) -> [f32; 6];

    /// A box rounded outward to f32, relative to an origin.
    ///
    /// * `min`, `max` - up to 1e38 in magnitude, or infinite outward.
    fn outward(self, min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> Down;

    /// As `outward`, written to `place`; returns whether the box keeps to a hold, as `holds` does.
    fn take(
        self,
        corners: [&[f64; 3]; 2],
        origin: &[f64; 3],
        held: &Held,
        place: &mut Down,
    ) -> bool;

    /// Whether a box, rounded to nearest, keeps to a hold: if so, the box rounded outward lies in a fat box that is
    /// wider by a step of each face and `LEAST`, and contains the core.
    fn keeps(self, corners: [&[f64; 3]; 2], origin: &[f64; 3], held: &Held) -> bool;

    /// Whether two boxes are surely apart, and whether they surely overlap: at every face by at least the slack of that
    /// of `a`. That is enough for both: a face of `b` that is much farther out than that of `a` was rounded by no more
    /// than a small share of the overlap there.
    fn parts(self, a: &Down, b: &Down) -> (bool, bool);

    /// Whether `inner` lies inside `outer`. The spare lanes are compared too: those of `outer` must be minus infinity.
    fn holds(self, outer: &Down, inner: &Down) -> bool;

    /// Bit `lane` of each row of a matrix of bits, as the bits of those rows.
    fn column(self, matrix: &[u16; WIDTH], lane: usize) -> u16;

    /// A matrix with all bits in some rows.
    fn spread(self, rows: u16) -> [u16; WIDTH];

    /// Writes the numbers of the given lanes, the first lane being `first`, ascending to the front of `place`; the
    /// values behind them are arbitrary.
    fn number(self, lanes: u16, first: u32, place: &mut [u32; WIDTH]);
}

/// Plain Rust.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// Sixteen flags as bits.
#[inline(always)]
fn mask(answers: &[bool; WIDTH]) -> u16 {
    let mut bits = 0;
    for (lane, yes) in answers.iter().enumerate() {
        bits |= u16::from(*yes) << lane;
    }
    bits
}

/// A face as an f32 that is not above it.
#[inline(always)]
#[allow(
    clippy::cast_possible_truncation,
    reason = "rounds to nearest, by half a step at most: a whole one is taken off"
)]
fn below(face: f64) -> f32 {
    let nearest = face as f32;
    nearest - (nearest.abs() * STEP + LEAST)
}

impl Lanes for Portable {
    #[inline(always)]
    fn meets(self, block: &Boxes16, one: &[f32; 6]) -> u16 {
        let f = &block.faces;
        let answers = std::array::from_fn(|i| {
            // NaN never separates on a lower face, and never meets on an upper one.
            let parted = (one[3] < f[0][i]) | (one[4] < f[1][i]) | (one[5] < f[2][i]);
            !parted & (one[0] <= f[3][i]) & (one[1] <= f[4][i]) & (one[2] <= f[5][i])
        });
        mask(&answers)
    }

    #[inline(always)]
    fn bound(self, block: &Boxes16, chosen: u16) -> [f32; 6] {
        let mut bound = [f32::NEG_INFINITY; 6];
        for (k, face) in block.faces.iter().enumerate() {
            // Lower faces negated, so that one rule serves both.
            let sign = if k < 3 { -1.0 } else { 1.0 };
            for (lane, value) in face.iter().enumerate() {
                let value = sign * value;
                // NaN loses every compare.
                if chosen >> lane & 1 == 1 && value > bound[k] {
                    bound[k] = value;
                }
            }
            bound[k] *= sign;
        }
        bound
    }

    #[inline(always)]
    fn outward(self, min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> Down {
        let mut down = Down {
            faces: [SPARE_FACE; 8],
        };
        for k in 0..3 {
            down.faces[k] = below(min[k] - origin[k]);
            down.faces[k + 4] = below(origin[k] - max[k]);
        }
        down
    }

    #[inline(always)]
    fn take(
        self,
        corners: [&[f64; 3]; 2],
        origin: &[f64; 3],
        held: &Held,
        place: &mut Down,
    ) -> bool {
        *place = self.outward(corners[0], corners[1], origin);
        let hold = held.hold();
        self.holds(&hold.fat, place) & self.holds(place, &hold.core)
    }

    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounds to nearest, which the fat box in the block is wider by"
    )]
    fn keeps(self, [min, max]: [&[f64; 3]; 2], origin: &[f64; 3], held: &Held) -> bool {
        let mut nearest = Down {
            faces: [SPARE_FACE; 8],
        };
        for k in 0..3 {
            nearest.faces[k] = (min[k] - origin[k]) as f32;
            nearest.faces[k + 4] = (origin[k] - max[k]) as f32;
        }
        let hold = held.hold();
        self.holds(&hold.fat, &nearest) & self.holds(&nearest, &hold.core)
    }

    #[inline(always)]
    fn parts(self, a: &Down, b: &Down) -> (bool, bool) {
        let (a, b) = (&a.faces, &b.faces);
        let (mut apart, mut sure) = (false, true);
        for k in 0..8 {
            // Lower face of one minus upper face of the other: positive if they are apart.
            let gap = a[k] + b[(k + 4) % 8];
            apart |= gap > 0.0;
            sure &= gap <= -slack(a[k].abs());
        }
        (apart, sure)
    }

    #[inline(always)]
    fn holds(self, outer: &Down, inner: &Down) -> bool {
        let mut holds = true;
        for (o, i) in outer.faces.iter().zip(&inner.faces) {
            holds &= o <= i;
        }
        holds
    }

    #[inline(always)]
    fn column(self, matrix: &[u16; WIDTH], lane: usize) -> u16 {
        mask(&matrix.map(|row| row >> (lane % WIDTH) & 1 == 1))
    }

    #[inline(always)]
    fn spread(self, rows: u16) -> [u16; WIDTH] {
        std::array::from_fn(|row| if rows >> row & 1 == 1 { u16::MAX } else { 0 })
    }

    #[inline(always)]
    fn number(self, lanes: u16, first: u32, place: &mut [u32; WIDTH]) {
        let mut at = 0;
        for (lane, number) in (first..).take(WIDTH).enumerate() {
            // Overwritten if the lane is not selected: no branch is needed.
            place[at % WIDTH] = number;
            at += usize::from(lanes >> lane & 1);
        }
    }
}
