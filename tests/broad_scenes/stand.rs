//! Goal: while bodies stand and only tremble, their boxes are compared with their kept boxes and none is stored; the
//! pairs stay exact for any later motion.
//!
//! Method: a pile that trembles until it counts as standing. Then it is disturbed repeatedly, in one way at a time: few
//! or half of the bodies move, some jump, all drift, some leave and come, boxes grow. The mode of each tick is read
//! from the work counters; every frame is compared with the exact set, and the structure is validated.

use sweepd::wire::{BroadCause, BroadMode};

use crate::common::Rng;
use crate::exact;
use crate::rig::Rig;
use crate::scenes::{Box3, Kind, Scene};

const BODIES: usize = 600;
/// Most ticks until an undisturbed pile counts as standing: by then the method has forgotten the margins of earlier
/// motion.
const SETTLES: usize = 6000;

/// Runs one tick; returns whether the method treated the bodies as standing.
fn tick(rig: &mut Rig, boxes: &[Box3], what: &str) -> bool {
    rig.tick(&exact::pairs(boxes), what);
    rig.work().way == Some((BroadMode::List, BroadCause::Standing))
}

/// Runs ticks of a trembling pile until it counts as standing.
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

/// Number of disturbances, each in one of eight ways.
const ROUNDS: usize = if cfg!(debug_assertions) { 8 } else { 80 };

fn shift(one: &Box3, by: [f32; 3]) -> Box3 {
    one.map(|corner| std::array::from_fn(|k| corner[k] + by[k]))
}

#[test]
fn bodies_that_stand_are_exact_whatever_stirs_them() {
    let mut scene = Scene::new(Kind::Pile, BODIES, 5);
    // Always with candidates: after a long enough disturbance a pile would be worked without them for some hundred
    // ticks.
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
                    // All drift with increasing speed, then are back at once.
                    5 => [0.002 * frame as f32 * frame as f32, 0.0, 0.0],
                    // One body in fifty jumps.
                    6 if rng.once_in(50) => std::array::from_fn(|_| rng.between(-3.0, 3.0) as f32),
                    _ => tremble(&mut rng),
                };
                *boxed = shift(home, by);
                // Some boxes grow at one corner, where their centres show little of it.
                if round % 8 == 7 {
                    boxed[0] = boxed[0].map(|x| x - 1e-3 * frame as f32);
                }
                moved.push(body as u32);
            }
            // Some leave, and others take their slots.
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
