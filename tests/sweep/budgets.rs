//! At any budget a contact during a motion is published as a hit or as open, and a free motion never as a hit.

use sweepd::time::Budget;
use sweepd::wire::{State, pair_flags};

use crate::oracle::rng::Rng;
use crate::rig::Rig;
use crate::truth::point_box;
use crate::walls::{HALF, bullets, fly, shot, world};

const COUNT: usize = if cfg!(debug_assertions) { 60 } else { 1000 };
const BUDGETS: [u64; 7] = [0, 1, 2, 5, 20, 100, 1000];

fn flags(rig: &Rig) -> u8 {
    rig.pair(1, 2).map_or(0, |row| row.flags)
}

#[test]
fn with_any_budget_a_bullet_is_a_hit_or_open_and_with_enough_a_hit() {
    for (kind, bullet) in bullets().iter().enumerate() {
        let mut rng = Rng::new(500 + kind as u64);
        let mut rig = world(bullet);
        let mut hits = [0; BUDGETS.len()];
        let mut count = 0;
        for case in 0..COUNT {
            let (plate, motion, share) = shot(&mut rng, 10.0);
            let up = plate.pose.rotation * sweepd::math::Vec3::z();
            let ahead = 1.01 * (bullet.radius + 2.0 * HALF.z) / up.dot(&motion.travel).abs();
            // A body that starts or ends in contact with the wall is no new hit.
            if ahead > share || ahead > 1.0 - share {
                continue;
            }
            count += 1;
            for (at, units) in BUDGETS.into_iter().enumerate() {
                fly(&mut rig, &plate, &motion, Budget::units(units));
                let told = flags(&rig);
                let what = format!("kind {kind} case {case} units {units}");
                let hit = told & pair_flags::SWEPT_HIT != 0;
                assert!(hit || told & pair_flags::SWEPT_OPEN != 0, "{what}");
                let state = if hit {
                    State::Colliding
                } else {
                    State::Possible
                };
                assert_eq!(rig.state(), state, "{what}");
                hits[at] += usize::from(hit);
                let row = rig.pair(1, 2).unwrap();
                assert!(
                    row.toi_min <= row.toi_max && row.toi_min >= 0.0 && row.toi_max <= 1.0,
                    "{what}"
                );
            }
        }
        println!("kind {kind}: hits of {count} by budget {BUDGETS:?}: {hits:?}");
        assert!(hits.is_sorted(), "{hits:?}");
        assert_eq!(hits[0], 0);
        assert_eq!(hits[BUDGETS.len() - 1], count);
    }
}

#[test]
fn with_any_budget_what_does_not_touch_is_no_hit() {
    for (kind, bullet) in bullets().iter().enumerate() {
        let mut rng = Rng::new(700 + kind as u64);
        let mut rig = world(bullet);
        for case in 0..COUNT {
            let (plate, mut motion, _) = shot(&mut rng, 10.0);
            let side = plate.pose.rotation * sweepd::math::Vec3::y();
            motion.from.translation.vector +=
                side * (HALF.y + 1.0 + bullet.radius * rng.range(1.0, 1.5));
            let least = (0..=2000)
                .map(|k| {
                    motion
                        .place(&sweepd::math::Vec3::zeros(), f64::from(k) / 2000.0)
                        .into()
                })
                .map(|p| point_box(&p, &plate.pose, &plate.half))
                .fold(f64::INFINITY, f64::min);
            if least < bullet.radius {
                continue;
            }
            for units in BUDGETS {
                fly(&mut rig, &plate, &motion, Budget::units(units));
                let what = format!("kind {kind} case {case} units {units}");
                assert_eq!(flags(&rig) & pair_flags::SWEPT_HIT, 0, "{what}");
                assert_ne!(rig.state(), State::Colliding, "{what}");
            }
        }
    }
}

#[test]
fn sweeps_leave_verdicts_half_of_the_budget() {
    // Many bullets graze, and two balls overlap at rest: sweeps must not starve the verdict of the balls.
    let mut bodies = vec![crate::rig::ball(1, 0.0, ""), crate::rig::ball(2, 1.5, "")];
    for k in 0..20_u64 {
        let shape = "{ type = \"capsule\", radius = 0.01, half_height = 0.2 }";
        bodies.push(crate::rig::body(
            10 + k,
            [0.0, 0.0, 50.0],
            shape,
            "continuous = true",
        ));
    }
    let mut rig = Rig::new(&crate::rig::scene("", &bodies));
    let mut rng = Rng::new(9);
    rig.move_x(1, -0.7);
    rig.move_x(2, 0.7);
    rig.send(Budget::units(0));
    for tick in 0..20 {
        for k in 0..20 {
            let at = rng.vector(4.0);
            let pose = rng.pose(at);
            rig.place(10 + k, &pose);
        }
        rig.send(Budget::units(40));
        if tick > 10 {
            assert_eq!(rig.verdict(1, 2), sweepd::wire::Verdict::Colliding);
        }
    }
}

/// Each round began with the same pairs, with turns too short for motions that need many tests.
#[test]
fn bug_of_many_ways_and_little_budget_the_same_were_open_in_each_tick() {
    const SHOTS: u64 = 12;
    const TICKS: u64 = 3 * SHOTS;
    let place = |shot: u64, z: f64| sweepd::math::Pose::translation(20.0 * shot as f64, 0.0, z);
    for units in [30, 60, 200] {
        let bodies: Vec<String> = (1..=SHOTS)
            .flat_map(|shot| {
                let (at, wall) = ([20.0 * shot as f64, 0.0], 100 + shot);
                let shape = crate::cases::SHOT;
                [
                    crate::rig::body(shot, [at[0], at[1], 5.0], shape, "continuous = true"),
                    crate::rig::body(wall, [at[0], at[1], 0.0], crate::cases::PLATE, ""),
                ]
            })
            .collect();
        let mut rig = Rig::new(&crate::rig::scene("", &bodies));
        rig.send(crate::rig::ALL);
        let mut told = std::collections::BTreeMap::new();
        for tick in 0..TICKS {
            for shot in 1..=SHOTS {
                rig.place(shot, &place(shot, if tick % 2 == 0 { -5.0 } else { 5.0 }));
            }
            rig.send(Budget::units(units));
            for shot in 1..=SHOTS {
                let row = rig.pair(shot, 100 + shot).unwrap();
                let hit = row.flags & pair_flags::SWEPT_HIT != 0;
                *told.entry(shot).or_insert(0) += u32::from(hit);
            }
        }
        println!("{units} units: {told:?}");
        assert!(told.values().all(|hits| *hits > 0), "{units}: {told:?}");
    }
}
