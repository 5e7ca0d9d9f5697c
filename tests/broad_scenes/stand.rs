//! Goal: where bodies stand, and only tremble, their boxes are held against their holds and none is stored; the pairs
//! are exact all the same, whatever stirs the bodies then.
//!
//! Method: a pile, long enough for all to have been everywhere they tremble to. Then, again and again, one way of
//! stirring it: few or half of the bodies move, some jump, all drift, some leave and come, boxes swell. What each tick
//! did is read off its work; every frame is compared with the exact set, and the structure is checked.

use sweepd::wire::{BroadCause, BroadMode};

use crate::common::Rng;
use crate::exact;
use crate::rig::Rig;
use crate::scenes::{Box3, Kind, Scene};

const BODIES: usize = 600;
/// Ticks after which a pile that is left alone stands: bodies have forgotten the margins of their ways.
const SETTLES: usize = 6000;

/// One tick; whether the bodies stood in it.
fn tick(rig: &mut Rig, boxes: &[Box3], what: &str) -> bool {
    rig.tick(&exact::pairs(boxes), what);
    rig.work().way == Some((BroadMode::List, BroadCause::Standing))
}

/// Ticks of a pile that trembles, until it stands.
fn settle(rig: &mut Rig, scene: &mut Scene, what: &str) {
    let stands = (0..SETTLES).any(|frame| {
        scene.step();
        rig.take(scene);
        tick(rig, &scene.boxes, &format!("{what}, frame {frame}")) && frame > 8
    });
    let work = rig.work();
    assert!(stands, "{what}: not after {SETTLES} ticks: {work:?}");
    rig.validate();
}

/// Times that it is stirred, in one of eight ways each.
const ROUNDS: usize = if cfg!(debug_assertions) { 8 } else { 80 };

fn shift(one: &Box3, by: [f32; 3]) -> Box3 {
    one.map(|corner| std::array::from_fn(|k| corner[k] + by[k]))
}

#[test]
fn bodies_that_stand_are_exact_whatever_stirs_them() {
    let mut scene = Scene::new(Kind::Pile, BODIES, 5);
    // Always with candidates: stirred for long enough, a pile is worked without them for some hundred ticks.
    let mut rig = Rig::geared("standing", &[false], BODIES, false);
    let mut rng = Rng::new(3);
    rig.start(&scene.boxes);
    for round in 0..ROUNDS {
        settle(&mut rig, &mut scene, &format!("round {round}"));
        let mut boxes = scene.boxes.clone();
        for frame in 0..6 {
            let what = format!("round {round}, frame {frame}");
            let mut moved = Vec::new();
            let share = [1, 1, 2, 20, 200, 1, 1, 2][round % 8];
            for (body, boxed) in boxes.iter_mut().enumerate().skip(1) {
                if !rng.once_in(share) {
                    continue;
                }
                let tremble =
                    |rng: &mut Rng| std::array::from_fn(|_| rng.between(-2e-3, 2e-3) as f32);
                let home = &scene.boxes[body];
                let by: [f32; 3] = match round % 8 {
                    // They tremble, all or some of them.
                    0..=4 => tremble(&mut rng),
                    // All drift, slowly at first, and are back at once.
                    5 => [0.002 * frame as f32 * frame as f32, 0.0, 0.0],
                    // One of fifty jumps.
                    6 if rng.once_in(50) => std::array::from_fn(|_| rng.between(-3.0, 3.0) as f32),
                    _ => tremble(&mut rng),
                };
                *boxed = shift(home, by);
                // Some swell or shrink where they are: their middles tell nothing of it.
                if round % 8 == 7 {
                    boxed[0] = boxed[0].map(|x| x - 1e-3 * frame as f32);
                }
                moved.push(body as u32);
            }
            // Some leave, and others come in their slots.
            let churned: Vec<u32> = if round % 3 == 2 {
                moved.extract_if(.., |_| rng.once_in(100)).collect()
            } else {
                Vec::new()
            };
            rig.put(&boxes, &moved, &churned);
            tick(&mut rig, &boxes, &what);
            rig.validate();
        }
    }
}
