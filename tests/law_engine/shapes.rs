//! 3.2, 3.3, 4.6: what once was said of meshes, half-spaces and height fields, through the engine.

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{State, Verdict};

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
        // The side at +x rises by 10 sin 0.2 = 1.99 m.
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

#[test]
fn law_3_2_a_peg_in_its_hole_turned_by_a_hundredth_of_a_radian() {
    // Peg 2 m long in a hole 0.5 m deep: 5 mm of clearance on each side, turned about z its corners come 0.005 nearer.
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
        // The tube's inner side is at 0.7, the rod's at 0.5 (the facets of the mesh lie a little farther out).
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
        // It flies out through the wall in one step, and back.
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
        // Beside the wall at x = 2, half way down, and below the floor at -0.5.
        ([3.1, 0.0, -0.2], false),
        ([2.9, 0.0, -0.2], true),
        ([0.0, 0.0, -1.6], false),
        ([0.0, 0.0, -1.4], true),
        // Round the upper edge at (2, 2, 0).
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
