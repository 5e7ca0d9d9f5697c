//! Goal: every broad phase gives, in every tick, exactly the pairs and the delta that its specification requires.
//!
//! Method: an oracle that tests every pair in every tick (`oracle.rs`) runs with every method on the same seeded
//! changes. Pairs, slots, delta, truncated bodies and counts are compared in each tick, and each structure is
//! validated.

#![allow(
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test stops at the first surprise, counts here are small, and nobody calls its modules"
)]

#[path = "../common/mod.rs"]
mod common;
mod oracle;
mod outliers;
mod short;
mod world;

use sweepd::wire::EndCause;
use world::{Bench, Summary, World, at};

const NO_LIMIT: usize = 1 << 20;

/// Runs a scene over several seeds; `step` is called before each tick.
fn run(
    ticks: usize,
    bodies: usize,
    limit: usize,
    setup: impl FnMut(&mut World),
    step: impl FnMut(&mut World, usize),
) -> Summary {
    run_short(ticks, bodies, (limit, 1 << 16), setup, step)
}

/// The same with a limit of pairs, and a number of pairs up to which all are recounted in each tick.
fn run_short(
    ticks: usize,
    bodies: usize,
    (limit, recount): (usize, u64),
    mut setup: impl FnMut(&mut World),
    mut step: impl FnMut(&mut World, usize),
) -> Summary {
    let mut all = Summary::default();
    for seed in 0..3 {
        let mut world = World::new(seed, bodies);
        let mut bench = Bench::new(limit, recount);
        setup(&mut world);
        for tick in 0..ticks / 3 {
            step(&mut world, tick);
            bench.tick(&mut world, &format!("seed {seed} tick {tick}"));
        }
        all.add(&bench.seen);
    }
    let pairs = all.pairs;
    assert!(pairs > ticks, "few pairs show nothing: {pairs}");
    all
}

/// Inserts all bodies, with boxes at random positions in a cube.
fn scatter(world: &mut World, reach: f64, half: f64) {
    for i in 0..world.bodies.len() {
        let centre = world.random_vec(reach);
        let half = std::array::from_fn(|_| world.rng.between(0.1, 1.0) * half);
        world.place(i, at(centre, half));
        world.insert(i);
    }
}

fn shift_some(world: &mut World, once_in: usize, by: f64) {
    for i in 0..world.bodies.len() {
        if world.rng.once_in(once_in) {
            let by = world.random_vec(by);
            world.shift(i, by);
        }
    }
}

#[test]
fn boxes_that_wander_give_equal_pairs() {
    let gas = |w: &mut World| scatter(w, 4.0, 0.8);
    let all = run(900, 60, NO_LIMIT, gas, |w, _| shift_some(w, 1, 0.05));
    assert!(all.swaps > 900 && all.rebuilds < 90, "repaired: {all:?}");
    let few = run(900, 60, NO_LIMIT, gas, |w, _| shift_some(w, 20, 0.3));
    assert!(few.swaps > 900 && few.rebuilds < 90, "repaired: {few:?}");
    let crowd = |w: &mut World| scatter(w, 8.0, 1.0);
    run(150, 300, NO_LIMIT, crowd, |w, tick| {
        shift_some(w, [1, 30][tick / 10 % 2], 0.1);
    });
}

#[test]
fn bodies_that_leave_and_come_give_equal_pairs() {
    let setup = |w: &mut World| scatter(w, 3.0, 0.8);
    let causes = [EndCause::Removed, EndCause::Disabled, EndCause::Reset];
    run(1200, 50, NO_LIMIT, setup, |w, tick| {
        for i in 0..50 {
            if w.rng.once_in(12) {
                let cause = causes[w.rng.below(3)];
                w.remove(i, cause);
            }
            if w.rng.once_in(10) {
                w.insert(i);
            }
        }
        if tick % 40 == 39 {
            (0..50).for_each(|i| w.remove(i, EndCause::Reset));
            (0..50).for_each(|i| w.insert(i));
        }
        shift_some(w, 4, 0.2);
    });
}

#[test]
fn a_clump_on_a_floor_gives_equal_pairs() {
    let setup = |w: &mut World| {
        w.place(0, at([0.0, 0.0, -0.5], [50.0, 50.0, 0.5]));
        w.insert(0);
        for i in 1..80 {
            let (x, y) = ((i % 9) as f64, (i / 9) as f64);
            w.place(i, at([x * 0.9, y * 0.9, 0.5], [0.5; 3]));
            w.insert(i);
        }
    };
    run(600, 80, NO_LIMIT, setup, |w, tick| {
        for i in 1..80 {
            let jitter = w.random_vec(0.002);
            w.shift(i, [jitter[0] * 5.0, jitter[1] * 5.0, jitter[2]]);
        }
        // All bodies move, so no list of the pairs of single bodies is kept when the body with the most pairs leaves.
        match tick % 50 {
            20 => w.remove(0, EndCause::Removed),
            23 => w.insert(0),
            _ => {}
        }
    });
}

#[test]
fn an_axis_is_skipped_while_all_stand_on_a_floor_and_kept_again_after() {
    let setup = |w: &mut World| {
        for i in 0..100 {
            let (x, y) = ((i % 10) as f64, (i / 10) as f64);
            w.place(i, at([x * 1.5, y * 1.5, 0.5], [0.5; 3]));
            w.insert(i);
        }
    };
    let summary = run(1200, 100, NO_LIMIT, setup, |w, tick| {
        for i in 0..100 {
            let jitter = w.random_vec(0.05);
            w.shift(i, [jitter[0] * 0.1, jitter[1] * 0.1, jitter[2]]);
            if w.rng.once_in(200) {
                w.bodies[i].mask ^= 1;
                w.requery(i);
            }
            if w.rng.once_in(400) {
                w.remove(i, EndCause::Removed);
            }
            if w.rng.once_in(50) {
                w.insert(i);
            }
            // Later all bodies gather in a tower, where they are clumped on the two other axes.
            if tick > 150 && w.rng.once_in(20) {
                let centre = w.bodies[i].aabb.centre().coords;
                let up = (i as f64) * 0.9;
                let by = [7.0 - centre.x, 7.0 - centre.y, up - centre.z];
                w.shift(i, by.map(|v| v * 0.6));
            }
        }
    });
    let (skipped, ticks) = (summary.skipped, summary.ticks);
    assert!(skipped > 100 && skipped < ticks - 300, "{summary:?}");
}

#[test]
fn shared_faces_and_equal_ends_count_as_overlap() {
    let setup = |w: &mut World| {
        for i in 0..64 {
            let centre = [i % 4, i / 4 % 4, i / 16].map(|k| k as f64);
            w.place(i, at(centre, [0.5; 3]));
            w.insert(i);
        }
    };
    run(900, 64, NO_LIMIT, setup, |w, _| {
        for i in 0..64 {
            if w.rng.once_in(8) {
                let by = std::array::from_fn(|_| w.rng.below(3) as f64 * 0.5 - 0.5);
                w.shift(i, by);
            }
        }
    });
}

#[test]
fn minus_zero_touches_zero() {
    let setup = |w: &mut World| {
        for i in 0..4 {
            w.insert(i);
        }
    };
    run(300, 4, NO_LIMIT, setup, |w, _| {
        for i in 0..4 {
            let zero = if w.rng.once_in(2) { 0.0 } else { -0.0 };
            let (low, high) = [(zero, 1.0), (-1.0, zero), (2.0, 3.0)][w.rng.below(3)];
            let mut aabb = at([0.0; 3], [1.0; 3]);
            let k = i % 2;
            (aabb.min[k], aabb.max[k]) = (low, high);
            w.place(i, aabb);
        }
    });
}

#[test]
fn huge_tiny_flat_and_infinite_boxes_give_equal_pairs() {
    let setup = |w: &mut World| {
        for i in 0..50 {
            let size = [1e-6, 1e-3, 1.0, 1e3][i % 4];
            let mut aabb = at(w.random_vec(2.0), [size; 3]);
            if i % 5 == 0 {
                aabb.max.z = aabb.min.z;
            }
            if i % 17 == 0 {
                aabb.max = aabb.min;
            }
            if i == 3 {
                (aabb.min.x, aabb.max.x) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            w.place(i, aabb);
            w.insert(i);
        }
    };
    run(600, 50, NO_LIMIT, setup, |w, _| shift_some(w, 3, 0.3));
}

#[test]
fn teleports_of_few_and_of_all_give_equal_pairs() {
    let setup = |w: &mut World| scatter(w, 3.0, 0.8);
    let summary = run(900, 60, NO_LIMIT, setup, |w, tick| {
        let once_in = if tick % 7 == 0 { 1 } else { 20 };
        for i in 0..60 {
            if w.rng.once_in(once_in) {
                let aabb = at(w.random_vec(3.0), [0.6; 3]);
                w.place(i, aabb);
            }
        }
    });
    assert!(summary.rebuilds > 90, "sorted anew: {summary:?}");
}

#[test]
fn boxes_that_all_coincide_give_equal_pairs() {
    let setup = |w: &mut World| {
        for i in 0..24 {
            w.place(i, at([1.0; 3], [0.5; 3]));
            w.insert(i);
        }
    };
    run(600, 24, NO_LIMIT, setup, |w, tick| {
        let to = at([(tick % 3) as f64; 3], [0.5; 3]);
        for i in 0..24 {
            if tick % 5 == 0 || w.rng.once_in(6) {
                w.place(i, to);
            }
        }
    });
}

#[test]
fn filter_edits_on_bodies_at_rest_find_and_end_pairs() {
    let setup = |w: &mut World| scatter(w, 2.0, 1.0);
    run(900, 40, NO_LIMIT, setup, |w, _| {
        for i in 0..40 {
            if w.rng.once_in(15) {
                w.bodies[i].group = 1 << w.rng.below(3);
                w.bodies[i].mask = w.rng.below(8) as u32;
                w.requery(i);
            }
        }
        shift_some(w, 40, 0.3);
    });
}

#[test]
fn unbounded_bodies_are_paired_with_all_that_the_filters_allow() {
    let setup = |w: &mut World| {
        for i in 0..4 {
            w.bodies[i].unbounded = true;
        }
        scatter(w, 3.0, 0.5);
    };
    run(600, 30, NO_LIMIT, setup, |w, _| {
        for i in 0..30 {
            if w.rng.once_in(15) {
                w.remove(i, EndCause::Removed);
            }
            if w.rng.once_in(10) {
                w.insert(i);
            }
            if w.rng.once_in(20) {
                w.bodies[i].group = 1 + w.rng.below(2) as u32;
                w.bodies[i].mask = 1 + w.rng.below(3) as u32;
                w.requery(i);
            }
        }
        shift_some(w, 5, 0.3);
    });
}

#[test]
fn pairs_of_bodies_of_unknown_place_stay_and_no_new_ones_come() {
    let setup = |w: &mut World| scatter(w, 2.5, 0.7);
    run(900, 40, NO_LIMIT, setup, |w, _| {
        for i in 0..40 {
            if w.rng.once_in(25) {
                let keeps = !w.bodies[i].keeps;
                w.set_keeps(i, keeps);
            }
            if w.rng.once_in(60) {
                w.remove(i, EndCause::SourceLost);
            }
            if w.rng.once_in(30) {
                w.insert(i);
            }
        }
        shift_some(w, 3, 0.3);
    });
}

#[test]
fn forced_pairs_are_candidates_whatever_the_boxes_say() {
    let setup = |w: &mut World| scatter(w, 2.5, 0.7);
    run(900, 30, NO_LIMIT, setup, |w, tick| {
        if tick % 9 == 4 {
            w.forced_changed = true;
            w.forced.clear();
            for _ in 0..w.rng.below(12) {
                let (a, b) = (w.rng.below(30), w.rng.below(30));
                if a != b {
                    w.forced
                        .push(sweepd::ids::PairKey::new(World::slot(a), World::slot(b)));
                }
            }
        }
        for i in 0..30 {
            if w.rng.once_in(30) {
                w.remove(i, EndCause::Disabled);
            }
            if w.rng.once_in(15) {
                w.insert(i);
            }
            if w.rng.once_in(40) {
                w.bodies[i].mask ^= 1;
                w.requery(i);
            }
        }
        shift_some(w, 3, 0.3);
    });
}

#[test]
fn far_from_the_origin_the_candidates_are_those_of_f64_boxes() {
    let far = |w: &mut World| {
        for i in 0..50 {
            let centre = w.random_vec(0.04).map(|v| v + 1e7);
            w.place(i, at(centre, [0.005; 3]));
            w.insert(i);
        }
    };
    run(450, 50, NO_LIMIT, far, |w, _| shift_some(w, 2, 0.004));
    let spread = |w: &mut World| {
        for i in 0..50 {
            let group = (i / 5) as f64 * 1e6;
            let centre = w.random_vec(0.02).map(|v| v + group);
            w.place(i, at(centre, [0.005; 3]));
            w.insert(i);
        }
    };
    run(450, 50, NO_LIMIT, spread, |w, _| shift_some(w, 2, 0.004));
}
