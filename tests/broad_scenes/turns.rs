//! Goal: motion that alternates, or that sets in at once, has no performance cliff: sources of two rates do not cause a
//! new list of candidates in every other tick, and if very many bodies leave or jump, all are sorted instead of moved
//! one by one. The pairs stay exact.
//!
//! Method: a gas with persistent candidates, moved by hand; the mode of each tick is read from the work counters.

use sweepd::wire::{BroadCause, BroadMode};

use crate::common::Rng;
use crate::exact;
use crate::rig::{Rig, at};
use crate::scenes::{Box3, Kind, Scene};

const BODIES: usize = 2000;

/// A gas at rest, in the mode with candidates.
fn at_rest(name: &str) -> (Rig, Vec<Box3>) {
    let scene = Scene::new(Kind::Gas, BODIES, 5);
    let mut rig = Rig::geared(name, &[false], BODIES, false);
    rig.start(&scene.boxes);
    for _ in 0..8 {
        rig.put(&scene.boxes, &[], &[]);
        rig.tick(&exact::pairs(&scene.boxes), name);
    }
    assert_eq!(rig.work().way.unwrap().0, BroadMode::Sparse);
    (rig, scene.boxes)
}

/// Moves some bodies a little; returns the mode of the tick.
fn nudge(rig: &mut Rig, boxes: &mut [Box3], moved: &[u32], rng: &mut Rng) -> BroadMode {
    for body in moved {
        let by: [f32; 3] = std::array::from_fn(|_| rng.between(-2e-2, 2e-2) as f32);
        let one = &mut boxes[*body as usize];
        *one = one.map(|corner| std::array::from_fn(|k| corner[k] + by[k]));
    }
    rig.put(boxes, moved, &[]);
    rig.tick(&exact::pairs(boxes), &rig.name.clone());
    rig.work().way.unwrap().0
}

#[test]
fn bug_sources_of_two_rates_had_all_candidates_listed_anew_by_turns() {
    let (mut rig, mut boxes) = at_rest("two rates");
    let mut rng = Rng::new(7);
    let fast: Vec<u32> = (0..20).collect();
    let all: Vec<u32> = (0..600).collect();
    for round in 0..40 {
        assert_eq!(nudge(&mut rig, &mut boxes, &all, &mut rng), BroadMode::List);
        // One to three ticks of the fast source for each of the slow one: the list is kept for them.
        for _ in 0..=round % 3 {
            let way = nudge(&mut rig, &mut boxes, &fast, &mut rng);
            assert_eq!(way, BroadMode::List, "round {round}");
        }
        rig.validate();
    }
    // The list is dropped once only the fast source continues.
    let ways: Vec<_> = (0..4)
        .map(|_| nudge(&mut rig, &mut boxes, &fast, &mut rng))
        .collect();
    assert_eq!(ways.last(), Some(&BroadMode::Sparse), "{ways:?}");
    rig.validate();
}

#[test]
fn bug_bodies_that_all_jumped_from_rest_were_seated_one_by_one() {
    let (mut rig, mut boxes) = at_rest("jump");
    let mut rng = Rng::new(11);
    let reach = (BODIES as f64).cbrt();
    for (share, sorted) in [(1, true), (4, true), (100, false)] {
        let moved: Vec<u32> = (0..BODIES as u32).filter(|_| rng.once_in(share)).collect();
        for body in &moved {
            let place = std::array::from_fn(|_| rng.between(0.0, 3.0 * reach) as f32);
            boxes[*body as usize] = at(place, 0.4);
        }
        rig.put(&boxes, &moved, &[]);
        rig.tick(&exact::pairs(&boxes), "jump");
        let way = rig.work().way.unwrap();
        let sort = way == (BroadMode::Sort, BroadCause::ManyCame);
        assert_eq!(sort, sorted, "one in {share}: {way:?}");
        rig.validate();
        for _ in 0..6 {
            rig.put(&boxes, &[], &[]);
            rig.tick(&exact::pairs(&boxes), "rest");
        }
        rig.validate();
    }
}

#[test]
fn bodies_that_leave_at_once_and_come_again_are_exact() {
    let (mut rig, boxes) = at_rest("leave");
    let mut rng = Rng::new(13);
    for share in [1, 2, 5, 40, 1] {
        let left: Vec<u32> = (0..BODIES as u32).filter(|_| rng.once_in(share)).collect();
        rig.change(&boxes, &[], &left, &[]);
        let mut there = boxes.clone();
        // For the exact set, absent bodies overlap none.
        for body in &left {
            there[*body as usize] = at([-1e6 - 10.0 * *body as f32, 0.0, 0.0], 0.1);
        }
        rig.tick(&exact::pairs(&there), "leave");
        rig.validate();
        rig.change(&boxes, &[], &[], &left);
        rig.tick(&exact::pairs(&boxes), "come");
        rig.validate();
    }
}
