//! Summary of the bodies of a block, from one pass over their boxes: enough to decide that none of them needs a closer
//! look.

use super::curve::centre;
use super::home::widen;
use super::ones;
use super::tree::NO_BOUND;
use crate::simd::boxes::{Down, Kernel, Lanes, WIDTH};

/// The centres of the bodies of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glance {
    pub(super) sum: [f32; 3],
    pub(super) bodies: f32,
    /// Their bounds; inverted if there are none.
    pub(super) spread: [f32; 6],
    /// The least mean side of a box.
    least_side: f32,
}

impl Glance {
    const NOBODY: Self = Self {
        sum: [0.0; 3],
        bodies: 0.0,
        spread: NO_BOUND,
        least_side: f32::INFINITY,
    };

    #[inline(always)]
    fn of(exact: &[Down; WIDTH], live: u16) -> Self {
        let mut seen = Self::NOBODY;
        for lane in ones(live) {
            let middle = centre(&exact[lane].corners());
            for (sum, middle) in seen.sum.iter_mut().zip(middle) {
                *sum += middle;
            }
            widen(&mut seen.spread, &middle);
            seen.least_side = seen.least_side.min(exact[lane].mean_side());
            seen.bodies += 1.0;
        }
        seen
    }

    /// Returns whether no centre is farther outside a region than `sides` times the least mean side of a box.
    pub(super) fn is_within(&self, part: &[f32; 6], sides: f32) -> bool {
        let mut far = 0.0;
        for k in 0..3 {
            let out = (part[k] - self.spread[k])
                .max(self.spread[k + 3] - part[k + 3])
                .max(0.0);
            far += out * out;
        }
        let least = self.least_side * sides;
        far <= least * least
    }
}

/// Summarizes the blocks of a quarter; missing blocks count as empty.
pub(super) struct LookOver<'a> {
    pub(super) live: &'a [u16],
    pub(super) exact: &'a [[Down; WIDTH]],
}

impl Kernel for LookOver<'_> {
    type Out = [Glance; WIDTH];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> [Glance; WIDTH] {
        let mut seen = [Glance::NOBODY; WIDTH];
        for (seen, (live, exact)) in seen.iter_mut().zip(self.live.iter().zip(self.exact)) {
            *seen = Glance::of(exact, *live);
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::super::home::far_from;
    use super::*;
    use crate::builtin::Random;
    use crate::simd::boxes::Level;

    fn around(random: &mut Random) -> f32 {
        f32::from(u16::try_from(random.bits() % 1000).unwrap()) / 100.0
    }

    #[test]
    fn who_is_within_needs_no_look_of_its_own() {
        let mut random = Random::new(11);
        let (mut within, mut beyond) = (0, 0);
        for _ in 0..2000 {
            let spread = 0.1 + around(&mut random);
            let live = u16::try_from(random.bits() & 0xFFFF).unwrap();
            let exact: [Down; WIDTH] = std::array::from_fn(|lane| {
                let low = [(); 3].map(|()| around(&mut random) / 10.0 * spread);
                let side = 0.5 + around(&mut random) / 10.0;
                let one = std::array::from_fn(|k| if k < 3 { low[k] } else { low[k - 3] + side });
                if live >> lane & 1 == 1 {
                    Down::of(one)
                } else {
                    Down::EMPTY
                }
            });
            let part = [0.5, 0.5, 0.5, 1.5, 1.5, 1.5];
            let blocks = [exact];
            let [seen, nobody, ..] = Level::best().run(LookOver {
                live: &[live],
                exact: &blocks,
            });
            assert!(
                nobody.is_within(&part, 0.5),
                "who is not there goes nowhere"
            );
            let mut spread = [f32::INFINITY; 3];
            let mut all_near = true;
            for lane in ones(live) {
                let middle = centre(&exact[lane].corners());
                let side = exact[lane].mean_side();
                all_near &= far_from(&middle, &part) <= side * side * 0.25;
                spread = std::array::from_fn(|k| spread[k].min(middle[k]));
            }
            assert_eq!(seen.spread[..3], spread);
            if seen.is_within(&part, 0.5) {
                within += 1;
                assert!(all_near, "a body is farther out");
            }
            beyond += usize::from(!all_near);
        }
        assert!(
            within > 100 && beyond > 100,
            "{within} within, {beyond} beyond"
        );
    }
}
