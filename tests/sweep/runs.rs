//! Balls that move for hundreds of ticks, many of which have too little budget: every contact during a motion is
//! published, whatever was certified, left open or published before.

use sweepd::math::{Pose, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{State, Verdict, pair_flags};

use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

const BALLS: usize = 10;
const RADIUS: f64 = 0.5;
const TICKS: usize = if cfg!(debug_assertions) { 600 } else { 6_000 };
/// Contacts with less overlap than this may have either result, metres.
const SLACK: f64 = 1e-9;

/// The least distance of two centres that move in straight lines during the same time.
fn least(from: [Vec3; 2], to: [Vec3; 2]) -> f64 {
    let (start, way) = (from[1] - from[0], (to[1] - to[0]) - (from[1] - from[0]));
    let square = way.norm_squared();
    let share = if square > 0.0 {
        (-start.dot(&way) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (start + way * share).norm()
}

/// The flags and the verdict of a pair in a tick.
fn flags_and_verdict(rig: &Rig, a: u64, b: u64) -> (u8, Verdict) {
    let row = rig.pair(a, b).map_or(0, |row| row.flags);
    (row, rig.verdict(a, b))
}

#[test]
fn in_a_long_run_short_of_work_every_touch_on_the_way_is_told() {
    let shape = format!("{{ type = \"sphere\", radius = {RADIUS:?} }}");
    let mut rng = Rng::new(71);
    let mut centres: Vec<Vec3> = (0..BALLS).map(|_| rng.vector(3.0)).collect();
    let bodies: Vec<String> = (0..BALLS)
        .map(|at| {
            let more = if at % 3 == 0 { "" } else { "continuous = true" };
            body(at as u64 + 1, [0.0; 3], &shape, more)
        })
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    rig.checked = false;
    let (mut touched, mut goes_on, mut free) = (0, 0, 0);
    let mut collided = [false; BALLS * BALLS];
    for tick in 0..TICKS {
        let before = centres.clone();
        for (at, centre) in centres.iter_mut().enumerate() {
            // Some rest, most move a little, few jump to where another ball was.
            match rng.below(8) {
                0 | 1 => {}
                2 => *centre = before[(at + 1 + rng.below(BALLS - 1)) % BALLS],
                _ => *centre += rng.vector(1.5),
            }
            *centre = centre.map(|x| x.clamp(-3.0, 3.0));
            rig.place(
                at as u64 + 1,
                &Pose::from_parts((*centre).into(), Default::default()),
            );
        }
        let budget = match rng.below(3) {
            0 => ALL,
            _ => Budget {
                time_ns: None,
                units: Some(rng.below(12) as u64),
            },
        };
        rig.send(budget);
        for a in 0..BALLS {
            for b in a + 1..BALLS {
                let (told, verdict) = flags_and_verdict(&rig, a as u64 + 1, b as u64 + 1);
                let known = &mut collided[a * BALLS + b];
                let was_colliding = std::mem::replace(known, verdict == Verdict::Colliding);
                if tick == 0 || a % 3 == 0 && b % 3 == 0 {
                    continue;
                }
                // A ball that is not continuous is at its new position for the whole tick.
                let from = [a, b].map(|at| if at % 3 == 0 { centres[at] } else { before[at] });
                let distance = least(from, [centres[a], centres[b]]) - 2.0 * RADIUS;
                let hit = told & pair_flags::SWEPT_HIT != 0;
                let open = told & pair_flags::SWEPT_OPEN != 0;
                let end = (centres[b] - centres[a]).norm() - 2.0 * RADIUS;
                let what = format!(
                    "tick {tick}, {a} and {b}, {distance} m, at last {end} m: {:?}",
                    rig.pair(a as u64 + 1, b as u64 + 1)
                );
                if distance > SLACK {
                    free += 1;
                    assert!(!hit, "{what}");
                } else if distance < -SLACK {
                    touched += 1;
                    let starts_so = (from[1] - from[0]).norm() < 2.0 * RADIUS;
                    if was_colliding && starts_so && !hit && !open {
                        goes_on += 1;
                        continue;
                    }
                    let ends_so =
                        verdict == Verdict::Colliding || end < 0.0 && verdict == Verdict::Possible;
                    let is_told = hit || open || ends_so;
                    assert!(is_told, "{what}");
                    assert_ne!(rig.state(), State::Clear, "{what}");
                }
            }
        }
    }
    println!("{touched} touched, {goes_on} of them go on, {free} free");
    assert!(touched > 2 * TICKS && goes_on > TICKS / 10 && free > TICKS);
}
