//! Laws 4.6, motion bound, and 4.7, order of work: what costs nothing, and what is carried over.

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{Demand, Verdict};

use crate::oracle::meshes::{self, trimesh};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, FRAME_NS, NONE, Rig, body, scene};

const BALL: &str = "{ type = \"sphere\", radius = 1.0 }";

/// Two balls with overlapping boxes and a gap of `gap` metres.
fn diagonal(gap: f64) -> Rig {
    let place = (2.0 + gap) / 3.0_f64.sqrt();
    let mut bodies = vec![body(1, [0.0; 3], BALL, ""), body(2, [place; 3], BALL, "")];
    bodies.push(body(3, [500.0, 0.0, 0.0], BALL, ""));
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    assert_eq!(rig.out.tick.candidates, 1);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    rig
}

#[test]
fn law_4_6_a_body_that_vibrates_a_millimetre_costs_no_query_in_a_hundred_thousand_ticks() {
    let mut rig = diagonal(0.05);
    rig.checked = false;
    let mut rng = Rng::new(1);
    for _ in 0..100_000 {
        let at = rng.vector(0.001);
        rig.row(1).position = at.into();
        rig.send(ALL);
        assert_eq!(rig.engine.counters().queries, 0);
    }
    assert_eq!(rig.out.tick.candidates, 1);
    rig.engine.validate().unwrap();
}

#[test]
fn law_4_6_a_drift_is_noticed_however_slow() {
    let mut rig = diagonal(0.05);
    rig.checked = false;
    let along = Vec3::repeat(1.0 / 3.0_f64.sqrt());
    for k in 0..=600 {
        let step = 1e-4 * f64::from(k);
        let shake = if k % 2 == 0 { 1e-3 } else { -1e-3 };
        let at = along * step + Vec3::new(shake, -shake, 0.0);
        rig.row(1).position = at.into();
        rig.send(NONE);
        let truth = (Vec3::repeat((2.05) / 3.0_f64.sqrt()) - at).norm() - 2.0;
        if truth <= 0.0 {
            assert_eq!(rig.verdict(1, 2), Verdict::Possible, "{truth}");
        }
    }
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
}

#[test]
fn law_4_6_a_gripper_and_what_it_holds_cost_no_query_while_they_move_together() {
    let mut rig = diagonal(0.005);
    let held = Pose::from_parts(
        Vec3::repeat(2.005 / 3.0_f64.sqrt()).into(),
        Quat::identity(),
    );
    let mut queries = 0;
    for k in 0..2_000 {
        let t = 0.01 * f64::from(k);
        let hand = Pose::from_parts(
            Vec3::new(30.0 * (0.3 * t).sin(), 5.0 * t, t).into(),
            Quat::from_scaled_axis(Vec3::new(0.3 * t, 0.2 * t, -0.7 * t)),
        );
        rig.place(1, &hand);
        rig.place(2, &(hand * held));
        rig.send(ALL);
        queries += rig.engine.counters().queries;
        assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    }
    assert!(queries <= 1, "{queries} queries");
}

#[test]
fn law_4_6_a_tick_visits_the_pairs_of_what_moved_and_no_others() {
    let side: usize = if cfg!(debug_assertions) { 12 } else { 29 };
    let mut bodies = Vec::new();
    for at in 0..side * side * side {
        let place = [at % side, at / side % side, at / side / side].map(|k| 1.02 * k as f64);
        let ball = "{ type = \"sphere\", radius = 0.5 }";
        bodies.push(body(1 + at as u64, place, ball, "report_within_m = 0.1"));
    }
    let mut rig = Rig::new(&scene("", &bodies));
    rig.checked = false;
    rig.demand = Demand::default();
    rig.send(ALL);
    let pairs = rig.out.tick.candidates;
    assert!(pairs > 10 * bodies.len() as u64, "{pairs} pairs");
    rig.idle(FRAME_NS, ALL);
    assert_eq!(rig.engine.counters().visited, 0);
    let moved = bodies.len() / 100;
    for k in 0..moved {
        rig.rows[k * 97].position[2] += 0.001;
    }
    rig.send(ALL);
    let visited = rig.engine.counters().visited;
    assert!(
        visited > 0 && visited <= 26 * moved as u64,
        "{visited} of {pairs} for {moved} bodies"
    );
    rig.send(ALL);
    assert_eq!(
        rig.engine.counters().visited,
        0,
        "the same poses again move nothing"
    );
}

/// Two linked rings as meshes, with centres `distance` metres apart along x: bounds decide no verdict early.
fn links(distance: f64) -> Rig {
    let shape = trimesh(&meshes::torus(1.0, 0.3, 24, 16), None);
    let bodies = [body(1, [0.0; 3], &shape, ""), body(2, [0.0; 3], &shape, "")];
    let mut rig = Rig::new(&scene("", &bodies));
    let turned = Quat::from_scaled_axis(Vec3::x() * std::f64::consts::FRAC_PI_2);
    rig.place(
        2,
        &Pose::from_parts(Vec3::new(distance, 0.0, 0.0).into(), turned),
    );
    rig
}

#[test]
fn law_4_7_interrupted_work_is_resumed_so_that_a_vibrating_mesh_pair_is_decided_in_time() {
    for (distance, want) in [(1.0, Verdict::Apart), (0.59, Verdict::Colliding)] {
        let mut rig = links(distance);
        rig.demand.contacts = false;
        rig.demand.pairs = false;
        rig.send(ALL);
        let whole = rig.out.tick.units;
        assert!(whole > 4, "{whole} units decide it at once");
        for budget in [1, 3, 20] {
            let mut rig = links(distance);
            rig.demand.contacts = false;
            let mut rng = Rng::new(budget);
            // The interval found at the first pose must stay valid during the vibration; three times the work suffices.
            let bound = 3 * whole.div_ceil(budget) + 3;
            let mut ticks = 0;
            loop {
                ticks += 1;
                let at = Vec3::new(distance, 0.0, 0.0) + rng.vector(1e-4);
                rig.row(2).position = at.into();
                rig.send(Budget::units(budget));
                assert!(rig.out.tick.units <= budget + 1);
                if rig.out.tick.possible == 0 {
                    break;
                }
                assert!(
                    ticks <= bound,
                    "{want}: not decided in {ticks} ticks of {budget}, {whole} in all"
                );
            }
            assert_eq!(rig.verdict(1, 2), want);
        }
    }
}
