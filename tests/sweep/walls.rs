//! Spheres, boxes, needles and meshes through walls of 1 mm, up to 100 m per tick, spinning.

use std::f64::consts::PI;

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{Event, State, Verdict, pair_flags};

use crate::oracle::meshes::{torus, trimesh};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, has, scene};
use crate::truth::{Motion, Plate, point_box};

/// A projectile: its shape as text, the points whose hull it is (for a mesh: its vertices), the radius of the ball
/// swept over them, and its bounding radius.
pub struct Bullet {
    pub shape: String,
    pub points: Vec<Vec3>,
    pub margin: f64,
    pub radius: f64,
}

pub fn bullets() -> Vec<Bullet> {
    let corners = |half: Vec3| -> Vec<Vec3> {
        (0..8_u8)
            .map(|k| {
                let sign = |bit: u8| if k & bit == 0 { -1.0 } else { 1.0 };
                half.component_mul(&Vec3::new(sign(1), sign(2), sign(4)))
            })
            .collect()
    };
    let ring = torus(0.04, 0.015, 10, 6);
    let half = Vec3::new(0.03, 0.01, 0.02);
    vec![
        Bullet {
            shape: "{ type = \"sphere\", radius = 0.004 }".to_owned(),
            points: vec![Vec3::zeros()],
            margin: 0.004,
            radius: 0.004,
        },
        Bullet {
            shape: "{ type = \"box\", half_extents = [0.03, 0.01, 0.02] }".to_owned(),
            points: corners(half),
            margin: 0.0,
            radius: half.norm(),
        },
        Bullet {
            shape: "{ type = \"capsule\", radius = 0.0005, half_height = 0.15 }".to_owned(),
            points: vec![Vec3::z() * 0.15, Vec3::z() * -0.15],
            margin: 0.0005,
            radius: 0.1505,
        },
        Bullet {
            shape: trimesh(&ring, None),
            points: ring.vertices.iter().map(|v| v.coords).collect(),
            margin: 0.0,
            radius: 0.055,
        },
    ]
}

pub const HALF: Vec3 = Vec3::new(3.0, 3.0, 0.0005);

pub fn world(bullet: &Bullet) -> Rig {
    let wall = format!(
        "{{ type = \"box\", half_extents = [{}, {}, {}] }}",
        HALF.x, HALF.y, HALF.z
    );
    world_of(&wall, bullet)
}

/// A wall, given as text, and a bullet.
pub fn world_of(wall: &str, bullet: &Bullet) -> Rig {
    let mut rig = Rig::new(&scene(
        "",
        &[
            body(1, [0.0; 3], wall, ""),
            body(2, [0.0; 3], &bullet.shape, "continuous = true"),
        ],
    ));
    rig.checked = false;
    rig
}

/// A wall and a motion through it: the centre is in the wall at the returned share.
pub fn shot(rng: &mut Rng, far: f64) -> (Plate, Motion, f64) {
    let wall = Pose::from_parts(rng.vector(far).into(), rng.rotation());
    let plate = Plate {
        pose: wall,
        half: HALF,
    };
    let up = wall.rotation * Vec3::z();
    let direction = loop {
        let direction = rng.direction();
        if direction.dot(&up).abs() > 0.2 {
            break direction;
        }
    };
    let travel = direction * 10.0_f64.powf(rng.range(0.0, 2.0));
    let share = rng.range(0.2, 0.8);
    let through = wall
        * sweepd::math::Point::from(rng.vector(1.0).component_mul(&Vec3::new(1.0, 1.0, 0.0003)));
    let from = Pose::from_parts((through.coords - travel * share).into(), rng.rotation());
    let motion = Motion {
        from,
        travel,
        axis: rng.direction(),
        angle: rng.range(0.0, 0.99 * PI),
    };
    (plate, motion, share)
}

/// Places both and moves the bullet: two ticks.
pub fn fly(rig: &mut Rig, plate: &Plate, motion: &Motion, budget: Budget) {
    rig.epoch += 1;
    rig.place(1, &plate.pose);
    rig.place(2, &motion.from);
    rig.send(ALL);
    rig.place(2, &motion.end());
    rig.send(budget);
}

/// Shoots a bullet through a wall, placed as body 1, in random ways; each shot must be a hit at the right time. Returns
/// the greatest error of the times.
///
/// * `half_z` - half of the wall's thickness, metres: `HALF.z`, or 0.
/// * `seed` - with the number of shots and the distance from the origin, metres.
pub fn shoot(
    rig: &mut Rig,
    bullet: &Bullet,
    half_z: f64,
    (seed, count, far): (u64, usize, f64),
    what: &str,
) -> f64 {
    let mut rng = Rng::new(seed);
    let (mut case, mut worst) = (0, 0.0_f64);
    while case < count {
        let (mut plate, motion, share) = shot(&mut rng, far);
        plate.half.z = half_z;
        let speed = (plate.pose.rotation * Vec3::z()).dot(&motion.travel).abs();
        let ahead = 1.01 * (bullet.radius + 2.0 * HALF.z) / speed;
        // Both ends must be clearly apart.
        if ahead > share || ahead > 1.0 - share {
            continue;
        }
        case += 1;
        let truth = plate.first_touch(&bullet.points, bullet.margin, &motion, (share, ahead));
        fly(rig, &plate, &motion, ALL);
        let what = format!("{what} case {case} at {far} m");
        let row = rig.pair(1, 2).unwrap_or_else(|| panic!("missed: {what}"));
        assert_ne!(row.flags & pair_flags::SWEPT_HIT, 0, "{what}: {row:?}");
        assert_eq!(rig.state(), State::Colliding, "{what}");
        assert_eq!(rig.verdict(1, 2), Verdict::Apart, "{what}");
        for event in [Event::Begin, Event::End, Event::Passed] {
            assert!(has(row, event), "{what} {row:?}");
        }
        // The resolution of the coordinates limits that of the time.
        let allowed = 1e-11 + 1e-14 * far / speed;
        let error = (row.toi_min - truth).abs().max((row.toi_max - truth).abs());
        assert!(
            row.toi_min <= truth + allowed && truth <= row.toi_max + allowed,
            "{what} {truth} {row:?}"
        );
        assert!(error <= 1e-6 + allowed, "{what}: {error} {truth} {row:?}");
        worst = worst.max(error);
    }
    worst
}

fn shots(count: usize, far: f64) {
    let mut worst = 0.0_f64;
    for (kind, bullet) in bullets().iter().enumerate() {
        let (mut rig, seed) = (world(bullet), 40 + kind as u64);
        let error = shoot(
            &mut rig,
            bullet,
            HALF.z,
            (seed, count, far),
            &format!("kind {kind}"),
        );
        worst = worst.max(error);
    }
    println!("worst error of the time of impact at {far} m: {worst:e}");
}

pub const COUNT: usize = if cfg!(debug_assertions) { 150 } else { 2500 };

#[test]
fn a_bullet_through_a_wall_of_a_millimetre_is_never_missed_and_its_time_is_right() {
    shots(COUNT, 10.0);
}

#[test]
fn a_bullet_through_a_wall_a_thousand_kilometres_from_the_origin_is_never_missed() {
    shots(COUNT / 5, 1e6);
}

#[test]
fn what_stays_before_the_wall_or_beside_it_is_no_hit() {
    for (kind, bullet) in bullets().iter().enumerate() {
        let mut rng = Rng::new(90 + kind as u64);
        let mut rig = world(bullet);
        for case in 0..COUNT / 2 {
            let (plate, mut motion, share) = shot(&mut rng, 10.0);
            if case % 2 == 0 {
                // It stops just before the wall, or starts just before it.
                let up = plate.pose.rotation * Vec3::z();
                let speed = up.dot(&motion.travel).abs();
                let clear = (bullet.radius + HALF.z) * rng.range(1.0001, 1.1) / speed;
                motion.travel *= (share - clear).max(0.0);
            } else {
                // It passes the rim.
                let side = plate.pose.rotation * Vec3::x();
                let off = HALF.x + 1.2 + bullet.radius * 1.01;
                motion.from.translation.vector += side * off;
            }
            let least = (0..=2000)
                .map(|k| motion.place(&Vec3::zeros(), f64::from(k) / 2000.0).into())
                .map(|p| point_box(&p, &plate.pose, &plate.half))
                .fold(f64::INFINITY, f64::min);
            if least < bullet.radius {
                continue;
            }
            fly(&mut rig, &plate, &motion, ALL);
            let flags = rig.pair(1, 2).map_or(0, |row| row.flags);
            let told = flags & (pair_flags::SWEPT_HIT | pair_flags::SWEPT_OPEN);
            assert_eq!(told, 0, "kind {kind} case {case} {:?}", rig.pair(1, 2));
            assert_eq!(rig.state(), State::Clear, "kind {kind} case {case}");
        }
    }
}

#[test]
fn a_bullet_at_rest_is_not_swept() {
    let bullet = &bullets()[0];
    let mut rig = world(bullet);
    let plate = Plate {
        pose: Pose::identity(),
        half: HALF,
    };
    let motion = Motion {
        from: Pose::from_parts(Vec3::new(0.0, 0.0, 5.0).into(), Quat::identity()),
        travel: Vec3::new(0.0, 0.0, -10.0),
        axis: Vec3::z(),
        angle: 0.0,
    };
    fly(&mut rig, &plate, &motion, ALL);
    assert!(has(rig.pair(1, 2).unwrap(), Event::Passed));
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
    assert!(rig.pair(1, 2).is_none(), "{:?}", rig.pair(1, 2));
    assert_eq!(rig.out.tick.candidates, 0, "its box is tight again");
}

#[test]
fn bug_a_touch_within_rounding_was_told_before_it_was() {
    // A ball of radius 1 mm moves 10 mm towards a wall of 1 mm: their surfaces meet after 3 mm.
    let mut rig = Rig::new(&scene(
        "",
        &[
            body(
                1,
                [0.0; 3],
                "{ type = \"box\", half_extents = [3.0, 3.0, 0.0005] }",
                "",
            ),
            body(
                2,
                [0.0; 3],
                "{ type = \"sphere\", radius = 0.001 }",
                "continuous = true",
            ),
        ],
    ));
    rig.place(1, &Pose::identity());
    for z in [-0.0045, 0.0055] {
        rig.place(2, &Pose::translation(0.0, 0.0, z));
        rig.send(ALL);
    }
    let row = rig.pair(1, 2).unwrap();
    assert_ne!(row.flags & pair_flags::SWEPT_HIT, 0, "{row:?}");
    assert!(row.toi_min <= 0.3 && 0.3 <= row.toi_max, "{row:?}");
    assert!(row.toi_max - row.toi_min <= 1e-8, "{row:?}");
}
