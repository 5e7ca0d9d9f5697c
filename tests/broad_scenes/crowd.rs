//! Goal: a world of very many bodies, in which each mode of working frees the memory of the other, stays exact when the
//! mode changes in either direction; and starts in the mode that suits it.
//!
//! Method: 40,000 bodies that move, stop and move again, or hardly move at all; and 1,000 bodies that overlap dozens of
//! others each. The mode of each tick is read from the work counters.

use sweepd::simd::boxes::Level;
use sweepd::wire::{BroadCause, BroadMode};

use crate::exact;
use crate::rig::Rig;
use crate::scenes::{Kind, Scene};

const BODIES: usize = 40_000;

/// Runs ticks in which the scene moves or stands still; returns their modes.
fn frames(rig: &mut Rig, scene: &mut Scene, count: usize, moving: bool) -> Vec<BroadMode> {
    let way = |frame: usize| {
        if moving {
            scene.step();
            rig.take(scene);
        } else {
            rig.put(&scene.boxes, &[], &[]);
        }
        rig.tick(&exact::pairs(&scene.boxes), &format!("frame {frame}"));
        let (mode, _) = rig.work().way.unwrap();
        mode
    };
    (0..count).map(way).collect()
}

#[test]
fn many_bodies_that_move_stop_and_move_again_are_exact_and_begin_without_candidates() {
    let mut scene = Scene::new(Kind::Gas, BODIES, 13);
    let mut rig = Rig::new(Level::best(), BODIES, false);
    rig.start(&scene.boxes);
    let first = frames(&mut rig, &mut scene, 30, true);
    assert!(!first.contains(&BroadMode::Sparse) && !first.contains(&BroadMode::Sort));
    assert_eq!(rig.work().way.unwrap().1, BroadCause::Spell);
    rig.validate();
    let still = frames(&mut rig, &mut scene, 8, false);
    assert!(still.ends_with(&[BroadMode::Sparse]), "{still:?}");
    rig.validate();
    let again = frames(&mut rig, &mut scene, 40, true);
    assert!(again.contains(&BroadMode::Scratch), "{again:?}");
    rig.validate();
}

#[test]
fn many_bodies_of_which_few_move_have_candidates_from_the_second_tick_on() {
    let mut scene = Scene::new(Kind::OnePercent, BODIES, 13);
    let mut rig = Rig::new(Level::best(), BODIES, false);
    rig.start(&scene.boxes);
    assert_eq!(rig.work().way.unwrap().0, BroadMode::Scratch);
    let ways = frames(&mut rig, &mut scene, 6, true);
    assert_eq!(ways[0], BroadMode::Sort);
    assert_eq!(ways[1..], [BroadMode::Sparse; 5]);
    rig.validate();
}

#[test]
fn many_bodies_in_each_gear_by_turns_are_exact() {
    let gears = &[true, true, false, true, false, false, false, true, true];
    let mut scene = Scene::new(Kind::Churn, BODIES, 13);
    let mut rig = Rig::geared("shifting", gears, BODIES, false);
    rig.start(&scene.boxes);
    frames(&mut rig, &mut scene, 26, true);
    rig.validate();
}

#[test]
fn a_crowd_is_searched_once_more_when_it_is_laid_anew_and_stays_exact() {
    let mut scene = Scene::new(Kind::Dense, 1000, 13);
    let mut rig = Rig::geared("from scratch", &[true], 1000, false);
    rig.start(&scene.boxes);
    let mut tests = Vec::new();
    for _ in 0..200 {
        frames(&mut rig, &mut scene, 1, true);
        tests.push(rig.work().tests);
    }
    let peak = |three: &&[u64]| three[1] * 2 > 3 * three[0].max(three[2]);
    assert!(tests.windows(3).filter(peak).count() > 0, "{tests:?}");
    rig.validate();
}

#[test]
fn bodies_at_rest_keep_to_their_first_fat_boxes() {
    let mut scene = Scene::new(Kind::Pile, BODIES, 13);
    let mut rig = Rig::new(Level::best(), BODIES, false);
    rig.start(&scene.boxes);
    let mut sorts = |_| frames(&mut rig, &mut scene, 1, true) == [BroadMode::Sort];
    assert!((0..40).any(&mut sorts), "never sorted");
    for _ in 0..8 {
        frames(&mut rig, &mut scene, 1, true);
        let renewed = rig.work().renewed;
        assert!(renewed * 20 < BODIES as u64, "{renewed} renewed");
    }
    rig.validate();
}
