//! Whether a box rounded to nearest keeps to a hold: equal at every level, with its consequence for rounding outward.

use super::super::lanes::{LEAST, STEP};
use super::{FACES, next};
use crate::simd::boxes::{Held, Hold, Kernel, Lanes, Level, Portable, SPARE};

/// Whether a box keeps to a hold, rounded to nearest.
struct Kept<'a>([&'a [f64; 3]; 2], &'a [f64; 3], &'a Held);

impl Kernel for Kept<'_> {
    type Out = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        lanes.keeps(self.0, self.1, self.2)
    }
}

#[test]
fn a_box_that_keeps_to_a_hold_rounded_to_nearest_lies_in_the_looser_one_rounded_outward() {
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    let (mut kept, mut astray) = (0, 0);
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let origin = [0.1, 1e7 + 0.3, -3.0];
        #[allow(clippy::cast_precision_loss, reason = "any number will do")]
        let mut near = |k: usize| origin[k] + (next(state) as f64 / 2.0_f64.powi(31) - 1.0);
        let low: [f64; 3] = std::array::from_fn(&mut near);
        let high = std::array::from_fn(|k| near(k).max(low[k]));
        let now = Portable.outward(&low, &high, &origin);
        let mut hold = Hold {
            fat: now.open(),
            core: now,
        };
        (hold.core.faces[SPARE], hold.core.faces[SPARE + 4]) = (f32::INFINITY, f32::INFINITY);
        // Within a few steps of the rounded box, on either side.
        for k in FACES {
            for (face, up) in [(&mut hold.fat, -1), (&mut hold.core, 1)] {
                let face = &mut face.faces[k];
                for _ in 0..next(state) % 6 {
                    *face = if up < 0 {
                        face.next_down()
                    } else {
                        face.next_up()
                    };
                }
                if next(state).is_multiple_of(32) {
                    *face = if up < 0 {
                        face.next_up()
                    } else {
                        face.next_down()
                    };
                }
            }
        }
        let held = Held::of(&hold);
        let wanted = Kept([&low, &high], &origin, &held).run(Portable);
        kept += u32::from(wanted);
        for level in Level::available() {
            let got = level.run(Kept([&low, &high], &origin, &held));
            assert_eq!(got, wanted, "seed {seed}, {level:?}");
        }
        let mut loose = hold.fat;
        for face in &mut loose.faces {
            *face -= face.abs() * STEP + LEAST;
        }
        let lies = Portable.holds(&loose, &now) && Portable.holds(&now, &hold.core);
        assert!(lies || !wanted, "seed {seed}");
        astray += u32::from(wanted && !Portable.holds(&hold.fat, &now));
    }
    assert!(cfg!(miri) || kept > 1000, "{kept}");
    // Otherwise the hold itself would do, and nothing would be tested.
    assert!(cfg!(miri) || astray > 50, "{astray} of {kept}");
}
