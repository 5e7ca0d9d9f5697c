//! Boxes compared with brute force over the vertices, for any motion and wherever a refit stopped.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "tests: numbers that f32 has"
)]

use super::*;
use crate::math::Vec3;
use crate::shape::mesh::tests::ball;
use crate::shape::{Inside, Node};

fn rows(mesh: &Mesh, of: impl Fn(usize, &Point) -> Point) -> Vec<[f32; 3]> {
    let moved = mesh.vertices().iter().enumerate();
    moved
        .map(|(i, v)| of(i, v).coords.map(|x| x as f32).into())
        .collect()
}

/// Every triangle lies in every box above it, widened by the lag.
fn boxes_hold(mesh: &Mesh) {
    let mut seen = vec![0; mesh.faces().len()];
    let mut stack = vec![(0_u32, Vec::new())];
    while let Some((place, mut above)) = stack.pop() {
        above.push(mesh.node(place));
        if let super::super::Below::Triangle(face) = mesh.below(place) {
            seen[face as usize] += 1;
            for v in mesh.triangle(face) {
                for node in &above {
                    let p = v - mesh.places_origin();
                    for k in 0..3 {
                        assert!(f64::from(node.min[k]) <= p[k] && p[k] <= f64::from(node.max[k]));
                    }
                }
            }
        }
        mesh.each_below(place, |child| stack.push((child, above.clone())));
    }
    assert!(seen.iter().all(|&n| n == 1));
    let whole = Aabb::of(mesh.vertices());
    assert!(mesh.aabb().holds(&whole));
    for v in mesh.vertices() {
        assert!((v - mesh.centre()).norm() <= mesh.radius());
    }
}

fn wave(i: usize, v: &Point, by: f64) -> Point {
    let shift = Vec3::new((i as f64).sin(), (2.0 * i as f64).cos(), (v.x * 7.0).sin());
    v + shift * by
}

#[test]
fn boxes_hold_their_triangles_wherever_a_refit_stops_and_whatever_comes_meanwhile() {
    let mut mesh = ball(12, 0.1).into_deforming().unwrap();
    assert_eq!(mesh.lag_m(), 0.0);
    boxes_hold(&mesh);
    let mut sum = 0.0;
    for step in 0..60_usize {
        if step % 3 != 2 {
            let by = 0.01 * (1.0 + (step % 5) as f64);
            let moved = rows(&mesh, |i, v| wave(i + step, v, by));
            let before = mesh.vertices().to_vec();
            let (first, part) = if step % 4 == 1 {
                (17, &moved[17..60])
            } else {
                (0, &moved[..])
            };
            let largest = mesh.bend(first, part);
            let truth = before.iter().zip(mesh.vertices());
            let truth = truth.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(largest >= truth && largest <= truth * (1.0 + 1e-12));
            sum += truth;
        }
        assert!(mesh.bent_m() >= sum && mesh.bent_m() <= sum * (1.0 + 1e-12));
        boxes_hold(&mesh);
        mesh.refit(step * 3 % 17);
        boxes_hold(&mesh);
    }
    // Rounds end, whatever arrived in between, and then the boxes fit.
    while mesh.refit(5) > 0 {}
    assert_eq!((mesh.lag_m(), mesh.refit(1)), (0.0, 0));
    boxes_hold(&mesh);
    let [tight, whole] = [
        mesh.node(0),
        Node::leaf(&mesh.aabb().min.coords, &mesh.aabb().max.coords, 0),
    ];
    for k in 0..3 {
        assert!((tight.min[k] - whole.min[k]).abs() < 1e-5);
        assert!((tight.max[k] - whole.max[k]).abs() < 1e-5);
    }
}

#[test]
fn inside_tests_are_of_the_newest_vertices_with_boxes_of_any_age() {
    let mut mesh = ball(8, 0.1).into_deforming().unwrap();
    let far = Vec3::new(5.0, 0.0, 0.0);
    let moved = rows(&mesh, |_, v| v + far);
    mesh.bend(0, &moved);
    for packs in [0, 3, usize::MAX] {
        mesh.refit(packs);
        let mut test = Inside::default();
        assert_eq!(test.run(&mesh, Point::origin(), |_| true), 0);
        assert_eq!(test.run(&mesh, Point::from(far), |_| true), 1);
        // Lags of the move, and in the end none.
        let outer = mesh.outlying(&Vec3::x());
        assert!(mesh.vertices().contains(&outer));
    }
}

#[test]
fn there_and_back_counts_twice_and_the_radius_is_that_of_now() {
    let mut mesh = ball(6, 0.1).into_deforming().unwrap();
    let radius = mesh.radius();
    let rest = rows(&mesh, |_, v| *v);
    let there = rows(&mesh, |_, v| v + Vec3::z() * 0.01);
    for _ in 0..100 {
        mesh.bend(0, &there);
        assert!(mesh.radius() > radius);
        mesh.bend(0, &rest);
        assert!(mesh.radius() <= radius * (1.0 + 1e-12));
    }
    assert!((mesh.bent_m() - 2.0).abs() < 1e-6, "{}", mesh.bent_m());
    assert!(mesh.lag_m() >= 2.0 - 1e-6);
}

#[test]
fn a_mesh_with_two_vertices_in_one_place_cannot_deform() {
    let p = |x: f64, y: f64| Point::new(x, y, 0.0);
    let vertices = vec![
        p(0.0, 0.0),
        p(1.0, 0.0),
        p(0.0, 1.0),
        p(1.0, 0.0),
        p(1.0, 1.0),
    ];
    let mesh = Mesh::new(vertices, vec![[0, 1, 2], [3, 4, 2]], None).unwrap();
    let error = mesh.into_deforming().unwrap_err().to_string();
    assert!(
        error.contains("vertices 1 and 3 are in one place"),
        "{error}"
    );
}

/// Also one that no face names: whole updates contain it.
#[test]
fn bug_a_vertex_that_no_message_can_hold_is_refused_at_once() {
    let p = |x: f64| Point::new(x, x * x, 0.0);
    let with = |far: f64| {
        let vertices = vec![p(0.0), p(1.0), p(2.0), Point::new(0.0, far, 0.0)];
        Mesh::new(vertices, vec![[0, 1, 2]], None)
            .unwrap()
            .into_deforming()
    };
    assert!(with(1e9).is_ok());
    for far in [1.1e9, -1e300] {
        let error = with(far).unwrap_err().to_string();
        assert!(error.contains("its vertex 3 is 1"), "{error}");
    }
}

#[test]
fn rows_that_are_no_vertices_are_told_apart() {
    let good = [[0.0_f32, 1.0, -1e8]];
    assert_eq!(can_be_vertices(&good), Ok(()));
    assert_eq!(can_be_vertices(&[]), Ok(()));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for k in 0..3 {
            let mut rows = [[0.5_f32; 3]; 9];
            rows[7][k] = bad;
            assert_eq!(can_be_vertices(&rows), Err(NoVertex::NotFinite));
        }
    }
    assert_eq!(can_be_vertices(&[[0.0, 2e9, 0.0]]), Err(NoVertex::TooFar));
}

#[test]
fn a_tree_that_was_built_elsewhere_holds_what_has_moved_meanwhile() {
    let mut mesh = ball(10, 0.1).into_deforming().unwrap();
    assert!(mesh.worn_tree().is_none());
    // Twisted until its boxes are half as large again.
    let twisted = rows(&mesh, |_, v| {
        let (sin, cos) = (4.0 * v.z).sin_cos();
        Point::new(
            3.0 * (cos * v.x - sin * v.y),
            0.4 * (sin * v.x + cos * v.y),
            v.z,
        )
    });
    mesh.bend(0, &twisted);
    assert!(mesh.worn_tree().is_none(), "nobody has measured them yet");
    mesh.refit(usize::MAX);
    let (job, late) = (mesh.worn_tree().unwrap(), mesh.worn_tree().unwrap());
    let moved = rows(&mesh, |i, v| wave(i, v, 0.02));
    let step = mesh.bend(0, &moved);
    mesh.refit(7);
    let revision = mesh.tree_revision();
    assert!(mesh.take_tree(job.build()));
    assert_eq!(mesh.tree_revision(), revision + 1);
    assert!(mesh.lag_m() >= step && mesh.lag_m() <= step * (1.0 + 1e-9));
    boxes_hold(&mesh);
    mesh.refit(5);
    boxes_hold(&mesh);
    mesh.refit(usize::MAX);
    assert_eq!(mesh.lag_m(), 0.0);
    boxes_hold(&mesh);
    assert!(mesh.worn_tree().is_none());
    assert!(!mesh.take_tree(late.build()), "of a tree that is gone");
}

#[test]
fn bug_a_mesh_whose_vertices_come_in_parts_shrinks_again_after_a_refit() {
    let mut mesh = ball(12, 0.1).into_deforming().unwrap();
    let (bounds, radius) = (mesh.aabb(), mesh.radius());
    let one = rows(&mesh, |_, v| *v)[7];
    let far = one.map(|x| 5.0 * x);
    for _ in 0..3 {
        mesh.bend(7, &[far]);
        boxes_hold(&mesh);
        assert!(mesh.radius() > 4.0 * radius);
        // Until the boxes contain the vertices again, they may be anywhere that they have been.
        mesh.bend(7, &[one]);
        assert!(mesh.radius() > 4.0 * radius);
        boxes_hold(&mesh);
        while mesh.refit(5) > 0 {
            boxes_hold(&mesh);
        }
        mesh.bend(7, &[one]);
        boxes_hold(&mesh);
        assert!(mesh.radius() <= 1.8 * radius, "{} {radius}", mesh.radius());
        assert!((mesh.aabb().max - bounds.max).norm() < 1e-6);
    }
}

#[test]
fn bug_a_mesh_whose_vertices_come_in_parts_all_the_time_shrinks_though_no_refit_ends_with_nothing_newer()
 {
    let mut mesh = ball(12, 0.1).into_deforming().unwrap();
    let radius = mesh.radius();
    let one = rows(&mesh, |_, v| *v)[7];
    mesh.bend(7, &[one.map(|x| 5.0 * x)]);
    mesh.bend(7, &[one]);
    assert!(mesh.radius() > 4.0 * radius);
    for step in 0..1_000_u16 {
        mesh.refit(1);
        let by = 1.0 + 1e-4 * f32::from(step % 2);
        mesh.bend(7, &[one.map(|x| by * x)]);
        assert!(mesh.lag_m() > 0.0 || step % 2 == 0);
        boxes_hold(&mesh);
    }
    assert!(mesh.radius() <= 2.0 * radius, "{} {radius}", mesh.radius());
}
