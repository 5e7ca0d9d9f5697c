//! Sixteen boxes as a structure of arrays, what can be asked of them, and the safe twin of every kernel.

/// Boxes in a block.
pub(crate) const WIDTH: usize = 16;
/// The same, to reckon with ranks.
pub(crate) const LANES: u32 = 16;

const _: () = assert!(LANES as usize == WIDTH);

/// Sixteen boxes: lower x, y, z, then upper x, y, z, each for sixteen lanes. A lane without a box holds NaN: it meets
/// nothing, and no bound grows by it.
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
/// z, a spare. So outward is downward on each lane, and `a` holds `b` where no lane of `a` is above that of `b`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Down {
    /// By lane.
    pub(crate) faces: [f32; 8],
}

/// What a box may do without any work: it stays inside `fat` and goes on holding `core`. A cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Hold {
    /// Holds the box; its spare lanes are minus infinity.
    pub(crate) fat: Down,
    /// Is held by the box; infinite, also in its spare lanes: no box fails it.
    pub(crate) core: Down,
}

impl Hold {
    /// Of no box: nothing keeps to it.
    pub(crate) const EMPTY: Self = Self {
        fat: Down::EMPTY,
        core: Down::EMPTY,
    };
}

/// The first spare lane of a [`Down`]: how far rounding may have moved the box's faces, and twice as much.
pub(crate) const SLACK: usize = 3;

impl Down {
    /// No box: it holds nothing, meets nothing.
    pub(crate) const EMPTY: Self = Self {
        faces: [f32::NAN; 8],
    };

    /// Lower and upper corner.
    #[inline(always)]
    pub(crate) fn corners(&self) -> [f32; 6] {
        let f = &self.faces;
        [f[0], f[1], f[2], -f[4], -f[5], -f[6]]
    }

    /// Of lower and upper corner; the spare lanes are zero.
    #[inline(always)]
    pub(crate) fn of([x, y, z, u, v, w]: [f32; 6]) -> Self {
        Self {
            faces: [x, y, z, 0.0, -u, -v, -w, 0.0],
        }
    }

    /// As an outer box: its spare lanes hold whatever stands in another's.
    #[inline(always)]
    pub(crate) fn open(mut self) -> Self {
        self.faces[SLACK] = f32::NEG_INFINITY;
        self.faces[SLACK + 4] = f32::NEG_INFINITY;
        self
    }

    /// The mean of its three sides; not finite where the box is not.
    #[inline(always)]
    pub(crate) fn mean_side(&self) -> f32 {
        let f = &self.faces;
        // The sum of lower faces and minus upper ones is minus three mean sides.
        ((f[0] + f[4]) + (f[1] + f[5]) + (f[2] + f[6])) * (-1.0 / 3.0)
    }
}

/// How much more than the rounding of a face tells two boxes surely overlap: rounding takes 2^-22 of a face's distance
/// from the origin at most, on either side.
const SLACK_SHARE: f32 = 1.0 / 1_048_576.0;
/// What is taken off a face, as a share of it, before it is rounded to nearest: a step of an f32.
pub(super) const STEP: f64 = f32::EPSILON as f64;
/// What is taken off besides: below the normal range a step is less than the least normal number.
pub(super) const LEAST: f64 = f32::MIN_POSITIVE as f64;

/// The slack of a box whose largest face is this far from the origin.
#[inline(always)]
pub(crate) fn slack(largest: f32) -> f32 {
    largest * SLACK_SHARE + 8.0 * f32::MIN_POSITIVE
}

/// What can be asked of sixteen boxes at once, and of single ones.
pub(crate) trait Lanes: Copy {
    /// Lanes whose closed box shares a point with `one`.
    fn meets(self, block: &Boxes16, one: &[f32; 6]) -> u16;

    /// The least box around some lanes; upside down (`+inf`, `-inf`) where all of them are empty.
    fn bound(self, block: &Boxes16, chosen: u16) -> [f32; 6];

    /// A box rounded outward to f32, relative to an origin, with its slack.
    ///
    /// * `min`, `max` - up to 1e38 in magnitude, or infinite outward.
    fn outward(self, min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> Down;

    /// As `outward`, written to a place; returns whether the box keeps to a hold, as `holds` tells.
    fn take(
        self,
        corners: [&[f64; 3]; 2],
        origin: &[f64; 3],
        hold: &Hold,
        place: &mut Down,
    ) -> bool;

    /// Whether two boxes are surely apart, and whether they surely overlap: on every axis by the slack of `a` at least.
    fn parts(self, a: &Down, b: &Down) -> (bool, bool);

    /// Whether `inner` lies inside `outer`. The spare lanes are compared too: those of `outer` are to be minus
    /// infinity.
    fn holds(self, outer: &Down, inner: &Down) -> bool;
}

/// Plain Rust.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// Sixteen answers as bits.
#[inline(always)]
fn mask(answers: &[bool; WIDTH]) -> u16 {
    let mut bits = 0;
    for (lane, yes) in answers.iter().enumerate() {
        bits |= u16::from(*yes) << lane;
    }
    bits
}

impl Lanes for Portable {
    #[inline(always)]
    fn meets(self, block: &Boxes16, one: &[f32; 6]) -> u16 {
        let f = &block.faces;
        let answers = std::array::from_fn(|i| {
            (f[0][i] <= one[3])
                & (f[1][i] <= one[4])
                & (f[2][i] <= one[5])
                & (one[0] <= f[3][i])
                & (one[1] <= f[4][i])
                & (one[2] <= f[5][i])
        });
        mask(&answers)
    }

    #[inline(always)]
    fn bound(self, block: &Boxes16, chosen: u16) -> [f32; 6] {
        let mut bound = [f32::NEG_INFINITY; 6];
        for (k, face) in block.faces.iter().enumerate() {
            // Lower faces turned round, so that one rule serves both.
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
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounds to nearest, by half a step at most: a whole one was taken off"
    )]
    fn outward(self, min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> Down {
        let mut down = Down { faces: [0.0; 8] };
        let mut largest = 0.0_f32;
        for k in 0..3 {
            let faces = [min[k] - origin[k], origin[k] - max[k]];
            for (half, face) in faces.into_iter().enumerate() {
                let below = (face - (face.abs() * STEP + LEAST)) as f32;
                down.faces[k + 4 * half] = below;
                largest = if below.abs() > largest {
                    below.abs()
                } else {
                    largest
                };
            }
        }
        down.faces[SLACK] = slack(largest);
        down
    }

    #[inline(always)]
    fn take(
        self,
        corners: [&[f64; 3]; 2],
        origin: &[f64; 3],
        hold: &Hold,
        place: &mut Down,
    ) -> bool {
        *place = self.outward(corners[0], corners[1], origin);
        self.holds(&hold.fat, place) & self.holds(place, &hold.core)
    }

    #[inline(always)]
    fn parts(self, a: &Down, b: &Down) -> (bool, bool) {
        let (a, b) = (&a.faces, &b.faces);
        let (mut apart, mut sure) = (false, true);
        for k in [0, 1, 2, 4, 5, 6] {
            // Lower face of the one minus upper face of the other: above zero where they are apart.
            let gap = a[k] + b[(k + 4) % 8];
            apart |= gap > 0.0;
            sure &= gap <= -a[SLACK];
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
}
