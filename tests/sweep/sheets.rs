//! Walls of zero thickness: a sheet of two triangles, and a closed plate whose two sides coincide.
//!
//! Method: as for walls of a millimetre in `cases` and `walls`: flights with contacts computed by hand, from either
//! side, and random shots with contacts found by bisection.

use sweepd::math::{Point, Pose, Quat, Vec3};
use sweepd::wire::{Event, State, Verdict};

use crate::cases::{SHOT, SWEPT, is_near};
use crate::oracle::meshes::{Soup, cuboid, trimesh};
use crate::rig::{ALL, Rig, body, has, scene};
use crate::walls::{COUNT, HALF, bullets, shoot, world_of};

/// Promised width of the interval of the time of impact, as a share of the motion.
const CLOSE: f64 = 1e-6;

/// A rectangle in the plane z = 0, as two triangles.
fn sheet() -> Soup {
    let corner = |x: f64, y: f64| Point::new(x * HALF.x, y * HALF.y, 0.0);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let vertices = corners.map(|(x, y)| corner(x, y)).to_vec();
    Soup::new(vertices, vec![[0, 1, 2], [0, 2, 3]])
}

/// The walls as text. The plate has each face twice, once inverted: a solid with an empty inside.
fn walls() -> [(&'static str, String); 2] {
    let plate = sheet().and(sheet().inverted());
    [
        ("sheet", trimesh(&sheet(), Some(false))),
        // A mesh that is not closed would be refused as a solid.
        ("plate", trimesh(&plate, Some(true))),
    ]
}

#[test]
fn a_ball_or_a_box_through_a_wall_of_no_thickness_is_a_hit_from_either_side() {
    let half = Vec3::new(0.02, 0.01, 0.005);
    let [x, y, z]: [f64; 3] = half.into();
    let convex = format!("{{ type = \"box\", half_extents = [{x}, {y}, {z}] }}");
    let mesh = trimesh(&cuboid(half), None);
    let (flat, turned) = (
        Quat::identity(),
        Quat::from_scaled_axis(Vec3::new(0.3, 0.5, 0.2)),
    );
    // The extent of a box along z.
    let reach = |turn: Quat| half.dot(&(turn.inverse() * Vec3::z()).abs());
    let shots = [
        (SHOT, flat, 0.01),
        (convex.as_str(), flat, reach(flat)),
        (convex.as_str(), turned, reach(turned)),
        (mesh.as_str(), flat, reach(flat)),
        (mesh.as_str(), turned, reach(turned)),
    ];
    // Straight through a face, straight through the edge between two faces, and at an angle.
    let ways = [
        [[0.3, 0.2], [0.3, 0.2]],
        [[0.0, 0.0], [0.0, 0.0]],
        [[1.0, -0.5], [-0.4, 0.7]],
    ];
    for (name, wall) in walls() {
        for (number, (shape, turn, reach)) in shots.into_iter().enumerate() {
            let mut rig = Rig::new(&scene(
                "",
                &[
                    body(1, [0.0; 3], &wall, ""),
                    body(2, [0.0, 0.0, 5.0], shape, SWEPT),
                ],
            ));
            for (way, [from, to]) in ways.into_iter().enumerate() {
                for side in [1.0, -1.0] {
                    let what = format!("{name}, shot {number}, way {way} from {side}");
                    let place = |[x, y]: [f64; 2], z: f64| {
                        Pose::from_parts(Vec3::new(x, y, z).into(), turn)
                    };
                    rig.epoch += 1;
                    rig.place(2, &place(from, 5.0 * side));
                    rig.send(ALL);
                    assert_eq!(rig.state(), State::Clear, "{what}");
                    rig.place(2, &place(to, -5.0 * side));
                    rig.send(ALL);
                    let row = rig.pair(1, 2).unwrap_or_else(|| panic!("missed: {what}"));
                    println!("{what}: {} to {}", row.toi_min, row.toi_max);
                    is_near(row, (5.0 - reach) / 10.0, CLOSE);
                    for event in [Event::Begin, Event::End, Event::Passed] {
                        assert!(has(row, event), "{what}: {row:?}");
                    }
                    assert_eq!(rig.verdict(1, 2), Verdict::Apart, "{what}");
                    assert_eq!(rig.state(), State::Colliding, "{what}");
                }
            }
        }
    }
}

#[test]
fn a_bullet_through_a_wall_of_no_thickness_is_never_missed_and_its_time_is_right() {
    // Only balls and boxes: the first two kinds.
    for (kind, bullet) in bullets().iter().take(2).enumerate() {
        for (name, wall) in walls() {
            let (mut rig, seed) = (world_of(&wall, bullet), 60 + kind as u64);
            let what = format!("kind {kind} through a {name}");
            let worst = shoot(&mut rig, bullet, 0.0, (seed, COUNT / 3, 10.0), &what);
            println!("{what}: worst error of the time of impact {worst:e}");
        }
    }
}

#[test]
fn what_stops_before_a_wall_of_no_thickness_or_passes_its_rim_is_no_hit() {
    for (name, wall) in walls() {
        let mut rig = Rig::new(&scene(
            "",
            &[
                body(1, [0.0; 3], &wall, ""),
                body(2, [0.0, 0.0, 5.0], SHOT, SWEPT),
            ],
        ));
        let beside = HALF.x + 0.01;
        // The radius of the ball is 10 mm: it stops just above the wall, or passes it by a millimetre.
        for (x, z, is_hit) in [
            (0.3, 0.01 + 1e-7, false),
            (0.3, 0.01 - 1e-7, true),
            (beside + 1e-3, -5.0, false),
            (beside - 1e-3, -5.0, true),
        ] {
            rig.epoch += 1;
            for height in [5.0, z] {
                rig.place(2, &Pose::translation(x, 0.2, height));
                rig.send(ALL);
            }
            let what = format!("{name} at {x} to {z}: {:?}", rig.pair(1, 2));
            let state = if is_hit {
                State::Colliding
            } else {
                State::Clear
            };
            assert_eq!(rig.state(), state, "{what}");
        }
    }
}
