//! Goal: the whole engine gives sound answers. Method: built-in scenes with built-in motions; the pairs published in
//! each tick are compared with exact queries of every pair of bodies.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test"
)]

mod harness;

use harness::{Drive, exact_gap};
use sweepd::builtin::{Pattern, pile, pool};
use sweepd::time::Budget;
use sweepd::wire::{BroadCause, BroadMode, Demand, PairRow, State, Verdict};

/// Compares every pair of bodies, by brute force, with the published pairs; returns the counts (colliding, possible).
fn compare(drive: &Drive) -> (usize, usize) {
    let out = drive.out();
    let engine = drive.engine();
    let bodies: Vec<_> = engine.world().bodies().map(|(_, body)| body).collect();
    let (mut colliding, mut possible) = (0, 0);
    for (at, a) in bodies.iter().enumerate() {
        for b in &bodies[at + 1..] {
            if !(a.moves || b.moves) {
                continue;
            }
            let row = out
                .pairs
                .iter()
                .find(|row| (row.body_a, row.body_b) == (a.id.0, b.id.0));
            let verdict = row.map_or(Verdict::Apart, |row| {
                Verdict::from_code(row.verdict).unwrap()
            });
            let truth = exact_gap(a, b);
            match verdict {
                Verdict::Apart | Verdict::Near => {
                    assert!(
                        truth.max > 0.0,
                        "{} and {} collide by {truth:?}, said {verdict}",
                        a.name,
                        b.name
                    );
                }
                Verdict::Colliding => {
                    colliding += 1;
                    assert!(
                        truth.min <= 0.0,
                        "{} and {} are apart by {truth:?}",
                        a.name,
                        b.name
                    );
                }
                Verdict::Possible => {
                    possible += 1;
                    println!(
                        "possible: {} {} {:?} {:?} now {truth:?}",
                        a.name,
                        b.name,
                        row.map(|r| (r.gap_min_m, r.gap_max_m, r.level)),
                        exact_gap(a, b)
                    );
                }
                Verdict::None => panic!("no verdict"),
            }
            if let Some(row) = row.filter(|row| row.verdict != 0) {
                let meets = row.gap_min_m <= truth.max && truth.min <= row.gap_max_m;
                assert!(
                    meets,
                    "{} and {}: [{}, {}] excludes {truth:?}",
                    a.name, b.name, row.gap_min_m, row.gap_max_m
                );
            }
        }
    }
    (colliding, possible)
}

#[test]
fn with_an_unlimited_budget_every_pair_is_decided_and_right() {
    let mut colliding = 0;
    for (scene, seed) in [(pool(120, 3), 1), (pile(120, 4), 2)] {
        let mut drive = Drive::new(&scene, Pattern::Wander, seed);
        for tick in 0..40 {
            drive.step(tick, Budget::UNLIMITED, Demand::ALL);
            let (hits, undecided) = compare(&drive);
            assert_eq!(undecided, 0);
            colliding += hits;
            assert_eq!(drive.out().tick.colliding as usize, hits);
            drive.engine().validate().unwrap();
        }
    }
    assert!(
        colliding > 1000,
        "{colliding} collisions are too few to mean anything"
    );
}

#[test]
fn at_any_budget_even_zero_no_collision_is_missing() {
    for units in [0, 1, 5, 20, 100] {
        let mut drive = Drive::new(&pool(120, 5), Pattern::Wander, 9);
        let mut undecided = 0;
        for tick in 0..25 {
            drive.step(tick, Budget::units(units), Demand::ALL);
            undecided += compare(&drive).1;
            assert!(drive.out().tick.units <= units);
            drive.engine().validate().unwrap();
        }
        assert!(
            units > 50 || undecided > 0,
            "a budget of {units} units cut nothing off"
        );
    }
}

#[test]
fn a_scene_apart_is_clear_and_one_in_contact_is_colliding() {
    let scene = |x: f64| {
        format!(
            "frame_id = \"world\"\n[[source]]\nname = \"feed\"\n\
             [[body]]\nname = \"a\"\nmoves = true\nshape = {{ type = \"sphere\", radius = 1.0 }}\n\
             [[body]]\nname = \"b\"\nmoves = true\nposition = [{x}, 0.0, 0.0]\nshape = {{ type = \"sphere\", radius = 1.0 }}\n"
        )
    };
    let mut apart = Drive::new(&scene(2.5), Pattern::Rest, 1);
    apart.step(0, Budget::UNLIMITED, Demand::ALL);
    assert_eq!(
        State::from_code(apart.out().tick.header.state),
        Some(State::Clear)
    );
    let mut touching = Drive::new(&scene(1.5), Pattern::Rest, 1);
    touching.step(0, Budget::UNLIMITED, Demand::ALL);
    assert_eq!(
        State::from_code(touching.out().tick.header.state),
        Some(State::Colliding)
    );
    let [contact] = touching.out().contacts.as_slice() else {
        panic!("one contact of two spheres")
    };
    assert!((contact.gap_m + 0.5).abs() < 1e-12);
    assert_eq!(contact.normal, [1.0, 0.0, 0.0]);
}

#[test]
fn the_tick_tells_how_the_broad_phase_worked_and_why() {
    let told = |drive: &Drive| {
        let tick = &drive.out().tick;
        let mode = BroadMode::from_code(tick.broad_mode).unwrap();
        let cause = BroadCause::from_code(tick.broad_cause).unwrap();
        (mode, cause, tick.broad_renewed)
    };
    let mut drive = Drive::new(&pool(300, 1), Pattern::Wander, 3);
    drive.step(0, Budget::UNLIMITED, Demand::ALL);
    let first = (BroadMode::Sort, BroadCause::ManyCame, 300);
    assert_eq!(told(&drive), first, "all of a new scene are sorted");
    // All bodies move; after that none does.
    drive.step(1, Budget::UNLIMITED, Demand::ALL);
    let (mode, cause, _) = told(&drive);
    assert_eq!((mode, cause), (BroadMode::List, BroadCause::ManyMoved));
    for _ in 0..3 {
        drive.idle(Budget::UNLIMITED, Demand::ALL);
        let (mode, _, renewed) = told(&drive);
        assert_eq!(
            (mode, renewed),
            (BroadMode::List, 0),
            "kept for sources that move many by turns"
        );
    }
    drive.idle(Budget::UNLIMITED, Demand::ALL);
    let still = (BroadMode::Sparse, BroadCause::FewMoved, 0);
    assert_eq!(told(&drive), still);
    let mut few = Drive::new(&pool(10, 1), Pattern::Wander, 3);
    few.step(0, Budget::UNLIMITED, Demand::ALL);
    assert_eq!(told(&few), (BroadMode::Whole, BroadCause::None, 0));
}

/// Places a body on the x axis of the test; at first all bodies are at one place, later they are spread out.
fn place(drive: &mut Drive, at: usize, x_m: f64) {
    drive.rows_mut()[at].position = [x_m, 0.0, 5.0];
}

#[test]
fn bug_after_a_crowd_every_tick_walked_by_the_places_of_all_its_pairs() {
    let demand = Demand {
        pairs: true,
        ..Demand::default()
    };
    let mut drive = Drive::new(&pool(150, 1), Pattern::Wander, 3);
    drive.place(0);
    let bodies = drive.rows_mut().len();
    (0..bodies).for_each(|at| place(&mut drive, at, 0.0));
    let out = drive.send(Budget::units(50), demand);
    assert!(out.tick.candidates > 5_000, "{bodies} bodies");
    // The two bodies of the last pair stay together, then separate and meet again, while all bodies move.
    let last = [bodies - 2, bodies - 1].map(|at| drive.rows_mut()[at].body);
    for tick in 0..12 {
        for at in 0..bodies - 1 {
            place(&mut drive, at, 5.0 * at as f64 + 0.01 * f64::from(tick));
        }
        let beside = [0.02, 3.0][usize::from((4..8).contains(&tick))];
        let x_m = drive.rows_mut()[bodies - 2].position[0] + beside;
        place(&mut drive, bodies - 1, x_m);
        let out = drive.send(Budget::UNLIMITED, demand);
        let together = u64::from(!(4..8).contains(&tick));
        assert_eq!((out.tick.colliding, out.tick.possible), (together, 0));
        let collide = |row: &&PairRow| row.verdict == Verdict::Colliding.code();
        let mut told = out.pairs.iter().filter(collide);
        assert!(told.all(|row| [row.body_a, row.body_b] == last));
        drive.engine().validate().unwrap();
        if tick > 1 {
            let walked = drive.engine().counters().walked;
            assert!(walked < 10, "{walked} places in tick {tick}");
        }
    }
}
