//! Laws 3.2, 3.3, 4.6: bugs with meshes, half-spaces and height fields, through the engine.

use sweepd::math::{Pose, Quat, Vec3, pose_from};
use sweepd::narrow::gap_between;
use sweepd::time::{Budget, Meter, SystemClock};
use sweepd::wire::{State, Verdict, pair_flags};

use crate::oracle::meshes::{self, trimesh};
use crate::rig::{ALL, NONE, Rig, ball, body, scene};

#[test]
fn law_4_6_a_half_space_turned_by_a_fifth_of_a_radian_sweeps_what_stands_far_from_its_centre() {
    let floor = "{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }";
    let mut bodies = vec![body(1, [0.0; 3], floor, "")];
    bodies.push(body(
        2,
        [10.0, 0.0, 1.5],
        "{ type = \"sphere\", radius = 1.0 }",
        "",
    ));
    bodies.push(body(
        3,
        [-10.0, 0.0, 1.5],
        "{ type = \"sphere\", radius = 1.0 }",
        "",
    ));
    for budget in [NONE, ALL] {
        let mut rig = Rig::new(&scene("", &bodies));
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear);
        rig.place(
            1,
            &Pose::from_parts(
                Vec3::zeros().into(),
                Quat::from_scaled_axis(Vec3::y() * -0.2),
            ),
        );
        rig.send(budget);
        // The edge at +x rises by 10 sin 0.2 = 1.99 m.
        let want = if budget == ALL {
            Verdict::Colliding
        } else {
            Verdict::Possible
        };
        assert_eq!(rig.verdict(1, 2), want);
        if budget == ALL {
            assert_eq!(rig.verdict(1, 3), Verdict::Apart);
        }
    }
}

/// Each body consists of a half-space and a second shape.
#[test]
fn bug_two_bodies_with_half_spaces_never_met_though_their_other_shapes_did() {
    let cube = trimesh(&meshes::cuboid(Vec3::repeat(0.5)), None);
    let sphere = "{ type = \"sphere\", radius = 0.5 }";
    let with = |id, up: i32, other: &str| {
        let plane = format!("{{ type = \"half_space\", normal = [0, 0, {up}], offset = -5 }}");
        body(id, [0.0; 3], &format!("[{plane}, {other}]"), "")
    };
    for (one, other) in [(sphere, sphere), (&*cube, sphere), (&*cube, &*cube)] {
        for method in ["brute", "sap", "grid", "hash", "hgrid", "order"] {
            let run = format!("[run]\nbroad_phase = \"{method}\"\n");
            let mut rig = Rig::new(&scene(&run, &[with(1, 1, one), with(2, -1, other)]));
            // Above the floor of one body and below the ceiling of the other, 3.5 m from both.
            for (x, z, gap_m) in [
                (3.0, 0.0, 2.0),
                (3.1, 0.0, 2.1),
                (0.5, 0.0, f64::NEG_INFINITY),
                (9.0, 0.0, 4.5),
                (9.0, -5.0, f64::NEG_INFINITY),
                (9.0, -1.0, 3.5),
                (3.0, 0.0, 2.0),
            ] {
                rig.row(1).position = [0.0; 3];
                rig.row(2).position = [x, 0.0, z];
                rig.send(ALL);
                let place = format!("{method}, {one} and {other} at {x}, {z}");
                if gap_m < 0.0 {
                    assert_eq!(rig.state(), State::Colliding, "{place}");
                    continue;
                }
                assert_eq!(rig.state(), State::Clear, "{place}");
                let [a, b] = ["b1", "b2"].map(|name| {
                    let world = rig.engine.world();
                    world
                        .slot_named(name)
                        .and_then(|slot| world.body(slot))
                        .unwrap()
                });
                let asked = gap_between(a, b, 0.0, &mut Meter::unlimited(&SystemClock));
                let off_m = (asked.gap.min - gap_m)
                    .abs()
                    .max((asked.gap.max - gap_m).abs());
                assert!(asked.finished && off_m < 1e-6, "{place}: {asked:?}");
            }
        }
    }
}

#[test]
fn law_3_2_a_peg_in_its_hole_turned_by_a_hundredth_of_a_radian() {
    // A peg of length 2 m in a hole 0.5 m deep, with 3 or 6 mm of clearance on each side; a rotation of 0.01 rad about
    // z brings its corners about 5 mm closer.
    let hole = trimesh(&meshes::block_with_hole(1.0, 0.5, 0.25), None);
    for (clearance, angle, collides) in [
        (0.003, 0.01, true),
        (0.006, 0.01, false),
        (0.003, 0.001, false),
    ] {
        let peg = format!(
            "{{ type = \"box\", half_extents = [{0}, {0}, 1.0] }}",
            0.5 - clearance
        );
        for budget in [NONE, Budget::units(5), ALL] {
            let mut rig = Rig::new(&scene(
                "",
                &[body(1, [0.0; 3], &hole, ""), body(2, [0.0; 3], &peg, "")],
            ));
            rig.send(ALL);
            assert_eq!(rig.state(), State::Clear, "{clearance}");
            let turned = Pose::from_parts(
                Vec3::zeros().into(),
                Quat::from_scaled_axis(Vec3::z() * angle),
            );
            rig.place(2, &turned);
            rig.send(budget);
            if collides {
                assert_ne!(
                    rig.verdict(1, 2),
                    Verdict::Apart,
                    "{clearance} {angle} {budget:?}"
                );
            } else {
                assert_ne!(
                    rig.verdict(1, 2),
                    Verdict::Colliding,
                    "{clearance} {angle} {budget:?}"
                );
            }
            if budget == ALL {
                assert_eq!(
                    rig.verdict(1, 2) == Verdict::Colliding,
                    collides,
                    "{clearance} {angle}"
                );
            }
        }
    }
}

#[test]
fn law_3_3_a_torus_round_a_rod_is_no_collision_until_it_is_moved_against_it() {
    let torus = trimesh(&meshes::torus(1.0, 0.3, 24, 16), None);
    let rod = "{ type = \"cylinder\", radius = 0.5, half_height = 3.0 }";
    let mut rig = Rig::new(&scene(
        "",
        &[body(1, [0.0; 3], &torus, ""), body(2, [0.0; 3], rod, "")],
    ));
    for k in 0..40 {
        let x = 0.01 * f64::from(k);
        rig.move_x(2, x);
        rig.send(ALL);
        // The inner radius of the tube is 0.7, the radius of the rod 0.5 (the facets of the mesh lie slightly outside).
        if x < 0.19 {
            assert_eq!(rig.verdict(1, 2), Verdict::Apart, "{x}");
        }
        if x > 0.22 {
            assert_eq!(rig.verdict(1, 2), Verdict::Colliding, "{x}");
        }
    }
}

#[test]
fn law_3_3_a_ball_inside_a_solid_mesh_collides_and_inside_a_surface_it_does_not() {
    let soup = meshes::bumpy_sphere(16, 16, 0.05);
    let small = "{ type = \"sphere\", radius = 0.1 }";
    for (solid, want) in [(true, Verdict::Colliding), (false, Verdict::Apart)] {
        let shape = trimesh(&soup, Some(solid));
        let mut rig = Rig::new(&scene(
            "",
            &[
                body(1, [0.0; 3], &shape, ""),
                body(2, [0.1, 0.0, 0.0], small, ""),
            ],
        ));
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), want, "solid = {solid}");
        // It moves out through the wall in one step, and back.
        rig.move_x(2, 5.0);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Apart);
        rig.move_x(2, 0.2);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), want, "solid = {solid}");
    }
}

#[test]
fn law_3_2_a_height_field_has_a_top_walls_and_a_floor() {
    let field = "{ type = \"height_field\", heights = [[0.0, 0.2, 0.0], [0.1, 0.5, 0.1], [0.0, 0.0, 0.0]], size = [4.0, 4.0], base_m = 0.5 }";
    let mut rig = Rig::new(&scene(
        "",
        &[body(1, [0.0; 3], field, ""), ball(2, 9.0, "")],
    ));
    let cases = [
        ([0.0, 0.0, 1.6], false),
        ([0.0, 0.0, 1.4], true),
        // Next to the wall at x = 2, half way down, and below the floor at -0.5.
        ([3.1, 0.0, -0.2], false),
        ([2.9, 0.0, -0.2], true),
        ([0.0, 0.0, -1.6], false),
        ([0.0, 0.0, -1.4], true),
        // Around the upper corner at (2, 2, 0).
        ([2.7, 2.7, 0.7], false),
        ([2.5, 2.5, 0.5], true),
    ];
    for (place, collides) in cases {
        rig.row(2).position = place;
        rig.send(NONE);
        assert!(
            !collides || rig.verdict(1, 2) != Verdict::Apart,
            "{place:?}"
        );
        rig.send(ALL);
        let want = if collides {
            Verdict::Colliding
        } else {
            Verdict::Apart
        };
        assert_eq!(rig.verdict(1, 2), want, "{place:?}");
    }
}

#[test]
fn bug_a_solid_and_a_body_of_several_shapes_were_told_as_deeper_than_any_point_of_them_can_be() {
    // No point is deeper than 0.25 m in the terrain, which is at most 0.5 m thick, nor deeper than 0.2 m in the body,
    // whose post is 0.3 m and more from a triangle of the terrain.
    let terrain = "{ type = \"height_field\", heights = [[0.0, 0.3, 0.0], [0.3, 0.1, 0.2], [0.0, 0.2, 0.0]], size = [2.0, 2.0], base_m = 0.2 }";
    let knob = "{ type = \"sphere\", radius = 0.2 }";
    let post = "{ type = \"box\", half_extents = [0.1, 0.1, 0.3], position = [0.2, 0.0, 0.0] }";
    let several = format!("[{knob}, {post}]");
    let mut still = body(101, [0.0; 3], terrain, "");
    still = still.replace("moves = true", "moves = false");
    let mut rig = Rig::new(&scene("", &[still, body(41, [0.0; 3], &several, "")]));
    // The random numbers with which the bug was found: xorshift64 (Marsaglia 2003).
    let mut state = 88_172_645_463_325_252_u64;
    let mut unit = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX)
    };
    let mut place = [-0.75, 0.3, -0.18];
    let mut deep = 0;
    for tick in 1..6000 {
        for x in &mut place {
            *x = (*x + (unit() - 0.5) * 0.08_f64).clamp(-0.9, 0.9);
        }
        let turn = Quat::from_scaled_axis(Vec3::z() * (0.2 * place[0]));
        rig.place(41, &Pose::from_parts(Vec3::from(place).into(), turn));
        rig.send(Budget::units(1));
        let Some(row) = rig.pair(41, 101) else {
            continue;
        };
        deep += usize::from(row.gap_max_m < 0.0);
        assert!(row.gap_max_m > -0.25 - 1e-9, "tick {tick}: {row:?}");
    }
    assert!(deep > 100, "{deep} ticks");
}

/// A ball, and a ball of another body that is a thousand kilometres from its body's origin; they overlap by some
/// nanometres.
#[test]
fn bug_what_touched_last_was_known_better_than_the_place_of_a_part_far_from_its_bodys_origin() {
    let ball = "{ type = \"sphere\", radius = 0.5 }";
    let several = "[{ type = \"sphere\", radius = 0.5, position = [1e6, 0.0, 0.0] }, \
                    { type = \"sphere\", radius = 0.5, position = [1e6, 50.0, 0.0] }]";
    let turn = Quat::new_unchecked(nalgebra::Quaternion::new(
        -0.146_920_825_131_206_4,
        0.014_011_738_308_423_79,
        -0.196_567_592_238_371_67,
        -0.969_318_896_965_261_6,
    ));
    let place = Vec3::new(
        956_436.768_841_630_5,
        -279_317.292_460_612_55,
        84_923.480_565_664_36,
    );
    let at = |off: Vec3| Pose::from_parts((place + off).into(), turn);
    let between = (at(Vec3::zeros()) * nalgebra::Point3::new(1e6, 0.0, 0.0)).coords;
    let across = between.cross(&Vec3::z());
    for units in 0..8 {
        let bodies = [
            body(1, [0.0; 3], ball, ""),
            body(2, place.into(), several, ""),
        ];
        let mut rig = Rig::new(&scene("", &bodies));
        rig.place(2, &at(across * 0.02 - between * 0.01));
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
        rig.place(2, &at(Vec3::zeros()));
        rig.send(Budget::units(units));
        let row = rig.pair(1, 2).unwrap();
        // Coordinates of this size are not known more accurately.
        let off = 1e6 * f64::EPSILON;
        assert!(row.gap_best_m < 0.0, "after {units}: {row:?}");
        assert!(
            row.gap_max_m >= row.gap_best_m + off,
            "after {units}: {row:?}"
        );
    }
}

/// Quarter turns and decimal positions, a kilometre from the origins of the bodies: the rounding error of the composed
/// poses exceeds the gap.
#[test]
fn bug_shapes_far_from_their_bodies_are_not_proved_to_overlap_where_rounding_alone_says_so() {
    const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
    let gem = "type = \"convex\", vertices = [[0.3, 0, 0], [-0.3, 0, 0], [0, 0.3, 0], [0, -0.3, 0], [0, 0, 0.3], [0, 0, -0.3]]";
    let turn = [0.0, HALF, 0.0, HALF];
    // Gaps computed with 400 bits.
    let cases = [
        (
            "position = [-626.9554710763733, -1320.663211605125, -107.75250794802987], \
             orientation = [0, 0.7071067811865476, 0, 0.7071067811865476]",
            (
                [107.75250794802976, 1320.663211605125, -626.9554710763734],
                turn,
            ),
            "type = \"box\", half_extents = [0.3, 0.3, 0.5], orientation = [-0.5, 0.5, 0.5, 0.5]",
            ([0.60000000000004, 0.0, 0.0], turn),
            1.5365e-13,
        ),
        (
            "position = [1.0000000002220446, -1000000.5000000002, 0.1], \
             orientation = [-0.7071067811865476, 0, 0, 0.7071067811865476]",
            ([1000000.1, 0.1, 0.3], [HALF, HALF, 0.0, 0.0]),
            "type = \"box\", half_extents = [1.0, 0.3, 0.5], orientation = [-0.5, 0.5, 0.5, 0.5], \
             position = [2.220446049250313e-10, -1.0, -1000000.5000000002]",
            ([1000000.1, 0.4, 0.8], [HALF, 0.0, HALF, 0.0]),
            2.2204e-10,
        ),
    ];
    for (gem_at, (at_a, turn_a), other, (at_b, turn_b), gap_m) in cases {
        let bodies = [
            body(1, [0.0; 3], &format!("{{ {gem}, {gem_at} }}"), ""),
            body(2, [0.0; 3], &format!("{{ {other} }}"), ""),
        ];
        let mut rig = Rig::new(&scene("", &bodies));
        rig.place(1, &pose_from(at_a, turn_a).unwrap());
        rig.place(2, &pose_from(at_b, turn_b).unwrap());
        rig.send(ALL);
        let row = rig.pair(1, 2).unwrap();
        let held = row.gap_min_m <= gap_m && gap_m <= row.gap_max_m;
        assert!(held, "{gap_m} {row:?}");
        // Rounding hides the difference between overlap and contact: the pair counts as colliding, with the flag for
        // touching.
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding, "{row:?}");
        assert_ne!(row.flags & pair_flags::TOUCHING, 0, "{row:?}");
    }
}
