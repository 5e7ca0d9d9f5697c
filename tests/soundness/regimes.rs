//! Wanted poses of couples: a third overlapping, a third apart by at most a hundredth, the others wherever their motion
//! leads.

use crate::oracle::rng::Rng;
use crate::truth::Bounds;

/// A pair that is apart by at most this share of the smaller body's size is close. The size of a body is twice the
/// scale at which it is drawn: about its diameter.
pub const CLOSE: f64 = 0.01;

/// Wanted share of overlapping and of close pair-ticks, percent: a third, and a reserve for scenes in which many shapes
/// are too thin to overlap for long, or have oracle bounds too wide to decide.
const SHARE: u64 = 38;

/// The wanted relation of a couple.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regime {
    Overlapping,
    Close,
    Free,
}

impl Regime {
    /// The regime of the couple at this index of a scene, at its start.
    pub fn of(place: usize) -> Self {
        let (close, overlapping) = (Self::Close, Self::Overlapping);
        [close, overlapping, close, overlapping, Self::Free][place % 5]
    }

    /// Whether a couple is in its regime; `small`: the smaller body's size, metres.
    pub fn holds(self, gap: &Bounds, small: f64) -> bool {
        match self {
            Self::Overlapping => gap.depth() > 0.0,
            Self::Close => gap.depth() <= 0.0 && gap.high <= CLOSE * small,
            Self::Free => true,
        }
    }

    /// A gap to move to, metres: of any order of magnitude for overlapping couples and a quarter of the close ones;
    /// otherwise uniform within the hundredth.
    pub fn gap(self, rng: &mut Rng, small: f64) -> f64 {
        let part = match self {
            Self::Overlapping => {
                let depth = 10.0_f64.powf(rng.range(-8.0, -0.5));
                -depth
            }
            Self::Close if rng.below(4) == 0 => 10.0_f64.powf(rng.range(-9.0, -2.1)),
            Self::Close | Self::Free => CLOSE * rng.range(0.005, 0.995),
        };
        part * small
    }
}

/// Number of pair-ticks in each relation, according to the oracle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shares {
    pub all: u64,
    pub overlapping: u64,
    pub close: u64,
}

impl Shares {
    /// * `small` - the smaller body's size, metres.
    pub fn count(&mut self, gap: &Bounds, small: f64) {
        self.all += 1;
        self.overlapping += u64::from(gap.depth() > 0.0);
        self.close += u64::from(gap.is_within(CLOSE * small));
    }

    /// The regime with the greatest deficit.
    pub fn lacking(&self) -> Regime {
        let free = self.all.saturating_sub(self.overlapping + self.close);
        let kinds = [
            (Regime::Overlapping, self.overlapping, SHARE),
            (Regime::Close, self.close, SHARE),
            (Regime::Free, free, 100 - 2 * SHARE),
        ];
        let least = kinds
            .into_iter()
            .min_by_key(|(_, count, share)| count * 1000 / share);
        least.map_or(Regime::Free, |(regime, ..)| regime)
    }
}
