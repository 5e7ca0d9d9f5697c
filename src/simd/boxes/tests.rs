//! Every level gives the bits of the safe twin, on boxes that touch, miss by one step, are empty, or are infinite.

#![allow(clippy::float_cmp, reason = "the same numbers, not near ones")]

mod keeps;

use super::*;

/// Runs all kernels on one block and records the results.
struct Everything<'a>(&'a Boxes16, &'a [f32; 6], &'a Down, &'a Down);

impl Kernel for Everything<'_> {
    type Out = (u16, (bool, bool), bool);

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Out {
        let Self(block, one, a, b) = self;
        (
            lanes.meets(block, one),
            lanes.parts(a, b),
            lanes.holds(a, b),
        )
    }
}

/// A small generator of its own: this room imports no other.
fn next(state: &mut u64) -> u64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

fn value(state: &mut u64) -> f32 {
    let grid = [-2.0_f32, -1.0, -0.0, 0.0, 1.0, 2.0];
    let at = grid[usize::try_from(next(state) % 6).unwrap()];
    match next(state) % 12 {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::NEG_INFINITY,
        3 => at.next_up(),
        4 => at.next_down(),
        5 => at * 1e-42,
        _ => at,
    }
}

fn block(state: &mut u64) -> Boxes16 {
    let mut boxes = Boxes16::EMPTY;
    for lane in 0..WIDTH {
        let one = std::array::from_fn(|_| value(state));
        boxes.set(lane, &one);
    }
    boxes
}

#[test]
fn every_level_gives_the_bits_of_the_safe_twin() {
    // Miri runs only the twin; a few rounds show that it is sound.
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let boxes = block(state);
        let one = std::array::from_fn(|_| value(state));
        let mut down = || Down {
            faces: std::array::from_fn(|_| value(state)),
        };
        let (a, b) = (down(), down());
        let wanted = Everything(&boxes, &one, &a, &b).run(Portable);
        for level in Level::available() {
            let got = level.run(Everything(&boxes, &one, &a, &b));
            assert_eq!(got, wanted, "seed {seed}, {level:?}");
        }
    }
}

/// The columns of a matrix.
struct Columns<'a>(&'a [u16; WIDTH]);

impl Kernel for Columns<'_> {
    type Out = [u16; WIDTH];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Out {
        std::array::from_fn(|lane| lanes.column(self.0, lane))
    }
}

#[test]
fn every_level_turns_a_matrix_by_its_columns() {
    let rounds = if cfg!(miri) { 20 } else { 2000 };
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        #[allow(clippy::cast_possible_truncation, reason = "any bits will do")]
        let matrix = [(); WIDTH].map(|()| next(state) as u16);
        for level in Level::available() {
            let columns = level.run(Columns(&matrix));
            for (row, line) in matrix.iter().enumerate() {
                for (lane, column) in columns.iter().enumerate() {
                    let (wanted, got) = (line >> lane & 1, column >> row & 1);
                    assert_eq!(got, wanted, "seed {seed}, {level:?}, {row} {lane}");
                }
            }
        }
    }
}

/// The matrix of some rows.
struct Spread(u16);

impl Kernel for Spread {
    type Out = [u16; WIDTH];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Out {
        lanes.spread(self.0)
    }
}

#[test]
fn every_level_fills_the_rows_that_are_named() {
    for rows in (0..=u16::MAX).step_by(if cfg!(miri) { 4093 } else { 7 }) {
        for level in Level::available() {
            for (row, line) in level.run(Spread(rows)).into_iter().enumerate() {
                let wanted = if rows >> row & 1 == 1 { u16::MAX } else { 0 };
                assert_eq!(line, wanted, "{rows:x}, {level:?}, {row}");
            }
        }
    }
}

/// Numbers some lanes.
struct Numbered(u16, u32);

impl Kernel for Numbered {
    type Out = Vec<u32>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Vec<u32> {
        let mut place = [7; WIDTH];
        lanes.number(self.0, self.1, &mut place);
        place[..self.0.count_ones() as usize].to_vec()
    }
}

#[test]
fn every_level_numbers_the_lanes_that_are_meant_in_their_order() {
    for lanes in (0..=u16::MAX).step_by(if cfg!(miri) { 4093 } else { 1 }) {
        let wanted: Vec<u32> = (0..16).filter(|lane| lanes >> lane & 1 == 1).collect();
        for first in [0, 1 << 20] {
            for level in Level::available() {
                let got = level.run(Numbered(lanes, first));
                let wanted: Vec<u32> = wanted.iter().map(|lane| first + lane).collect();
                assert_eq!(got, wanted, "{lanes:x}, {level:?}");
            }
        }
    }
}

/// The lanes of a `Down` that are not spare.
const FACES: [usize; 6] = [0, 1, 2, 4, 5, 6];

/// Takes a box and returns whether it keeps to a hold.
struct Taken<'a>([&'a [f64; 3]; 2], &'a [f64; 3], &'a Held);

impl Kernel for Taken<'_> {
    type Out = ([u32; 8], bool);

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Out {
        let mut place = Down::EMPTY;
        let keeps = lanes.take(self.0, self.1, self.2, &mut place);
        (place.faces.map(f32::to_bits), keeps)
    }
}

#[test]
fn every_level_tells_alike_whether_a_box_keeps_to_its_hold() {
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    let mut kept = 0;
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let origin = [0.1, 1e7 + 0.3, -3.0];
        #[allow(clippy::cast_precision_loss, reason = "any number will do")]
        let mut near = |k: usize| origin[k] + next(state) as f64 / 2.0_f64.powi(31);
        let low: [f64; 3] = std::array::from_fn(&mut near);
        let high = std::array::from_fn(|k| near(k).max(low[k]));
        let now = Portable.outward(&low, &high, &origin);
        let mut hold = Hold {
            fat: now,
            core: now,
        };
        // One face in some is a step too tight.
        for k in FACES {
            match next(state) % 18 {
                0 => hold.fat.faces[k] = now.faces[k].next_up(),
                1 => hold.core.faces[k] = now.faces[k].next_down(),
                2 => hold.fat.faces[k] = f32::NEG_INFINITY,
                3 => hold.core.faces[k] = f32::INFINITY,
                _ => {}
            }
        }
        let held = Held::of(&hold);
        let wanted = Taken([&low, &high], &origin, &held).run(Portable);
        let inside = FACES.iter().all(|&k| hold.fat.faces[k] <= now.faces[k]);
        let around = FACES.iter().all(|&k| now.faces[k] <= hold.core.faces[k]);
        assert_eq!(wanted.1, inside && around, "seed {seed}");
        kept += u32::from(wanted.1);
        for level in Level::available() {
            let got = level.run(Taken([&low, &high], &origin, &held));
            assert_eq!(got, wanted, "seed {seed}, {level:?}");
        }
    }
    assert!(cfg!(miri) || (5000..15_000).contains(&kept), "{kept}");
}

/// Rounds a box.
struct Rounded<'a>(&'a [f64; 3], &'a [f64; 3], &'a [f64; 3]);

impl Kernel for Rounded<'_> {
    type Out = [u32; 8];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [u32; 8] {
        lanes
            .outward(self.0, self.1, self.2)
            .faces
            .map(f32::to_bits)
    }
}

#[test]
fn every_level_rounds_boxes_outward_to_the_same_bits() {
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let mut number = || {
            #[allow(clippy::cast_precision_loss, reason = "any number will do")]
            let unit = next(state) as f64 / 2.0_f64.powi(31) - 0.5;
            let scale = [0.0, 1e-44, 1e-9, 1.0, 1e7, 1e12, f64::INFINITY];
            let scale = scale[usize::try_from(next(state) % 7).unwrap()];
            if scale.is_finite() {
                unit * scale
            } else {
                scale
            }
        };
        let origin = [0.1, 1e7 + 0.3, -3.0];
        let low = std::array::from_fn(|_| -number().abs());
        let high = std::array::from_fn(|_| number().abs());
        let wanted = Rounded(&low, &high, &origin).run(Portable);
        for k in 0..3 {
            let (min, max) = (f32::from_bits(wanted[k]), -f32::from_bits(wanted[k + 4]));
            let (own_min, own_max) = (low[k] - origin[k], high[k] - origin[k]);
            assert!(
                f64::from(min) <= own_min && own_max <= f64::from(max),
                "seed {seed}"
            );
        }
        for level in Level::available() {
            assert_eq!(
                level.run(Rounded(&low, &high, &origin)),
                wanted,
                "seed {seed}, {level:?}"
            );
        }
    }
}

/// Tests whether two boxes are apart.
struct Parted<'a>(&'a Down, &'a Down);

impl Kernel for Parted<'_> {
    type Out = (bool, bool);

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Out {
        lanes.parts(self.0, self.1)
    }
}

#[test]
fn what_is_told_of_rounded_boxes_is_true_of_the_boxes() {
    let rounds = if cfg!(miri) { 20 } else { 50_000 };
    let mut open = 0;
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let at = |state: &mut u64, below: usize| usize::try_from(next(state)).unwrap() % below;
        let mut one_of = |some: &[f64]| some[at(state, some.len())];
        // Two boxes that nearly touch at a face on one axis; far out or not, of any size.
        let (far, far_too) = (
            one_of(&[0.0, 1e-30, 1.0, 1e7]),
            one_of(&[0.0, 1e-40, 3.0, -1e9]),
        );
        let (side, other_side) = (one_of(&[1e-6, 1.0, 1e4]), one_of(&[1e-6, 1.0, 1e12]));
        let little = one_of(&[0.0, 1e-45, -1e-45, 1e-9, -1e-9, 1e-3, -1e-3, 0.5, -0.5]);
        let axis = at(state, 3);
        #[allow(clippy::cast_precision_loss, reason = "any number will do")]
        let mut unit = || next(state) as f64 / 2.0_f64.powi(31);
        let low = [far, far_too, unit()];
        let high = low.map(|x| x + side);
        let mut low_too = low.map(|x| x - other_side * unit());
        let mut high_too: [f64; 3] = std::array::from_fn(|k| low_too[k].max(low[k]) + other_side);
        low_too[axis] = high[axis] + little * side;
        high_too[axis] = low_too[axis] + other_side;
        let origin = [0.0, 0.1, -7.0];
        let one = Portable.outward(&low, &high, &origin);
        let other = Portable.outward(&low_too, &high_too, &origin);
        let overlap = (0..3).all(|k| low[k] <= high_too[k] && low_too[k] <= high[k]);
        for level in Level::available() {
            for (a, b) in [(&one, &other), (&other, &one)] {
                let (apart, sure) = level.run(Parted(a, b));
                assert!(!apart || !overlap, "seed {seed}: told apart");
                assert!(!sure || overlap, "seed {seed}: told to overlap");
                open += u32::from(!apart & !sure);
            }
        }
    }
    assert!(open > 0, "none was too near to tell");
}

/// Bounds a block.
struct Bounded<'a>(&'a Boxes16, u16);

impl Kernel for Bounded<'_> {
    type Out = [f32; 6];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [f32; 6] {
        lanes.bound(self.0, self.1)
    }
}

#[test]
fn every_level_bounds_blocks_alike() {
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    for seed in 0..rounds {
        let state = &mut (seed + 1);
        let boxes = block(state);
        let chosen = u16::try_from(next(state) % 65_536).unwrap();
        let wanted = Bounded(&boxes, chosen).run(Portable);
        for level in Level::available() {
            // A zero of either sign bounds alike.
            let got = level.run(Bounded(&boxes, chosen));
            assert!(
                got.iter().zip(&wanted).all(|(a, b)| a == b),
                "seed {seed}, {level:?}"
            );
        }
    }
}

#[test]
fn a_bound_holds_the_chosen_lanes_and_empty_ones_count_for_nothing() {
    let mut boxes = Boxes16::EMPTY;
    let none = Portable.bound(&boxes, u16::MAX);
    assert!(none[0] > none[3]);
    boxes.set(3, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    boxes.set(4, &[-9.0, -9.0, -9.0, 99.0, 99.0, 99.0]);
    boxes.set(15, &[-1.0, 1.5, -2.0, 0.0, 9.0, 5.0]);
    let bound = Portable.bound(&boxes, !(1 << 4));
    assert_eq!(bound, [-1.0, 1.0, -2.0, 3.0, 9.0, 5.0]);
    assert_eq!(boxes.get(3), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}
