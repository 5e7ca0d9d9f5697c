//! Coincident, nested and deep bodies: directions are not unique, and differences vanish.

use std::f64::consts::FRAC_PI_2;

use super::kinds::{
    STILL, ball, box_faces, capsule, cone, cuboid, cylinder, floor, hull, logs, mesh_cube, turn,
};
use crate::report::stability::dd::Dd;
use crate::report::stability::stage::{Actor, Asked, Case, Pos};
use crate::report::stability::truth::Truth;
use crate::shape::ShapeSpec;

fn pair(kind: &'static str, value: f64, a: ShapeSpec, b: ShapeSpec, t: [f64; 3]) -> Case {
    turned(kind, value, a, b, t, STILL)
}

fn turned(
    kind: &'static str,
    value: f64,
    a: ShapeSpec,
    b: ShapeSpec,
    t: [f64; 3],
    q: [f64; 4],
) -> Case {
    let lower = (Actor::of(a), Pos::at([0.0; 3]));
    Case::pair(kind, value, lower, (Actor::of(b), Pos { t, q }))
}

pub(super) fn coincident() -> Vec<Case> {
    let mut cases = Vec::new();
    for h in logs(-6, 4, 1) {
        cases.extend(touching(h));
        cases.extend(the_same(h));
    }
    cases
}

/// A right triangle in the plane z = 0, from `x` on.
fn tile(x: f64, h: f64) -> ShapeSpec {
    ShapeSpec::Triangle {
        vertices: [[x, 0.0, 0.0], [x + h, 0.0, 0.0], [x, h, 0.0]],
    }
}

/// Faces, edges and corners that meet exactly: the sums of these numbers have no rounding error.
fn touching(h: f64) -> Vec<Case> {
    let cube = || cuboid(h, h, h);
    let solid = || mesh_cube(h);
    let hull_cube = || hull(&box_faces([h; 3]).0);
    let tile = |x| tile(x, h);
    let two = 2.0 * h;
    vec![
        pair("faces of boxes", h, cube(), cube(), [0.0, 0.0, two]),
        pair(
            "faces of boxes, aside",
            h,
            cube(),
            cube(),
            [0.5 * h, 0.25 * h, two],
        ),
        pair("edges of boxes", h, cube(), cube(), [two, 0.0, two]),
        pair("corners of boxes", h, cube(), cube(), [two, two, two]),
        pair(
            "faces of hulls",
            h,
            hull_cube(),
            hull_cube(),
            [0.5 * h, 0.0, two],
        ),
        pair("box on half_space", h, floor(), cube(), [0.0, 0.0, h]),
        pair("sphere on half_space", h, floor(), ball(h), [0.0, 0.0, h]),
        pair("sphere on box", h, cube(), ball(h), [0.0, 0.0, two]),
        pair("sphere on mesh", h, solid(), ball(h), [0.0, 0.0, two]),
        pair("box on mesh", h, solid(), cube(), [0.5 * h, 0.25 * h, two]),
        pair(
            "mesh on mesh",
            h,
            solid(),
            solid(),
            [0.5 * h, 0.25 * h, two],
        ),
        pair("mesh on half_space", h, floor(), solid(), [0.0, 0.0, h]),
        pair(
            "cylinder on cylinder",
            h,
            cylinder(h, h),
            cylinder(h, h),
            [0.5 * h, 0.0, two],
        ),
        pair(
            "cylinder on box",
            h,
            cube(),
            cylinder(h, h),
            [0.0, 0.0, two],
        ),
        pair(
            "triangles in a plane",
            h,
            tile(0.0),
            tile(0.25 * h),
            [0.0; 3],
        ),
        pair("triangles, one edge", h, tile(0.0), tile(-h), [0.0; 3]),
    ]
}

/// A body at exactly the pose of another one.
fn the_same(h: f64) -> Vec<Case> {
    let hull_cube = || hull(&box_faces([h; 3]).0);
    vec![
        pair("the same sphere", h, ball(h), ball(h), [0.0; 3]),
        pair(
            "the same box",
            h,
            cuboid(h, h, h),
            cuboid(h, h, h),
            [0.0; 3],
        ),
        pair(
            "the same capsule",
            h,
            capsule(h, h),
            capsule(h, h),
            [0.0; 3],
        ),
        pair(
            "the same cylinder",
            h,
            cylinder(h, h),
            cylinder(h, h),
            [0.0; 3],
        ),
        pair("the same hull", h, hull_cube(), hull_cube(), [0.0; 3]),
        pair("the same triangle", h, tile(0.0, h), tile(0.0, h), [0.0; 3]),
    ]
}

pub(super) fn nested() -> Vec<Case> {
    let mut cases = Vec::new();
    for ratio in logs(-6, 0, 2) {
        let (r, at) = (0.15 * ratio, [0.3, 0.0, 0.0]);
        let block = || cuboid(1.0, 0.9, 0.8);
        let q = turn([1.0, 2.0, 3.0], 0.7);
        cases.extend([
            pair("sphere in sphere", ratio, ball(1.0), ball(r), at),
            pair("sphere in box", ratio, block(), ball(r), at),
            turned("box in box", ratio, block(), cuboid(r, r, r), at, q),
            turned("capsule in box", ratio, block(), capsule(r, r), at, q),
            turned(
                "box in hull",
                ratio,
                hull(&box_faces([1.0; 3]).0),
                cuboid(r, r, r),
                at,
                q,
            ),
            pair("sphere in cylinder", ratio, cylinder(1.0, 0.9), ball(r), at),
            pair("sphere in cone", ratio, cone(1.0, 0.9), ball(r), at),
            pair(
                "cylinder in cylinder",
                ratio,
                cylinder(1.0, 0.9),
                cylinder(r, r),
                at,
            ),
        ]);
        // The deepest point of the inner body is on its side away from the cube's nearest face, which is 1 m from the
        // cube's centre.
        let deepest = Dd::from(0.3) - Dd::from(1.0) - Dd::from(r);
        for (kind, shape) in [("sphere in mesh", ball(r)), ("mesh in mesh", mesh_cube(r))] {
            cases.push(Case {
                asked: Asked::Known(Truth::is(deepest)),
                ..pair(kind, ratio, mesh_cube(1.0), shape, at)
            });
        }
    }
    cases
}

pub(super) fn deep() -> Vec<Case> {
    let mut cases = Vec::new();
    let denormal = [5e-324, 1e-310, 1e-300, 1e-200, 1e-100, 1e-50, 1e-30];
    for off in denormal.into_iter().chain(logs(-20, 0, 1)) {
        let aside = [0.6 * off, 0.48 * off, 0.64 * off];
        let (across, perpendicular) = (turn([0.0, 1.0, 0.0], FRAC_PI_2), [0.0, off, 0.0]);
        let brick = || cuboid(0.5, 0.4, 0.3);
        let can = || cylinder(0.3, 0.5);
        cases.extend([
            pair("sphere-sphere", off, ball(0.5), ball(0.3), aside),
            pair("sphere-box", off, brick(), ball(0.3), aside),
            pair("sphere-capsule", off, capsule(0.3, 0.5), ball(0.3), aside),
            pair("sphere-cylinder", off, can(), ball(0.3), aside),
            pair("sphere-cone", off, cone(0.4, 0.5), ball(0.3), aside),
            pair(
                "capsules, parallel",
                off,
                capsule(0.3, 0.5),
                capsule(0.2, 0.4),
                aside,
            ),
            turned(
                "capsules, crossed",
                off,
                capsule(0.3, 0.5),
                capsule(0.2, 0.4),
                aside,
                across,
            ),
            turned(
                "capsule-box",
                off,
                brick(),
                capsule(0.2, 0.4),
                aside,
                across,
            ),
            pair("box-box", off, brick(), brick(), aside),
            turned(
                "box-box, turned",
                off,
                brick(),
                brick(),
                aside,
                turn([1.0, 2.0, 3.0], 0.7),
            ),
            pair("cylinders, parallel", off, can(), cylinder(0.2, 0.6), aside),
            turned(
                "cylinders, crossed",
                off,
                can(),
                can(),
                perpendicular,
                across,
            ),
            pair("cylinder-box", off, can(), brick(), aside),
        ]);
    }
    cases
}

pub(super) fn denormals() -> Vec<Case> {
    let mut cases = Vec::new();
    let near = [
        5e-324, 1e-310, 1e-300, 1e-250, 1e-200, 1e-150, 1e-100, 1e-50,
    ];
    for gap_m in near.into_iter().chain(logs(-30, -15, 1)) {
        // A corner at the origin of its own frame: only the body's position puts it above the face.
        let corner = || ShapeSpec::Triangle {
            vertices: [[0.0; 3], [0.4, 0.3, 0.5], [-0.2, 0.3, 0.5]],
        };
        let tile = ShapeSpec::Triangle {
            vertices: [[0.5, -0.3, 0.0], [0.0, 0.6, 0.0], [-0.5, -0.3, 0.0]],
        };
        let wedge = hull(&[
            [0.0; 3],
            [0.4, 0.3, 0.5],
            [-0.2, 0.3, 0.5],
            [0.0, -0.3, 0.4],
        ]);
        let up = [0.0, 0.0, gap_m];
        cases.extend([
            pair("half_space-triangle", gap_m, floor(), corner(), up),
            pair("half_space-hull", gap_m, floor(), wedge.clone(), up),
            pair("triangle-triangle", gap_m, tile.clone(), corner(), up),
            pair("triangle-hull", gap_m, tile, wedge, up),
        ]);
    }
    cases
}
