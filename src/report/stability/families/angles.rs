//! Near-parallel edges, faces and axes; needles, slivers and discs; pegs in their holes.

use std::f64::consts::FRAC_PI_4;

use super::kinds::{
    STILL, above, ball, below, box_faces, capsule, cone, cuboid, cylinder, floor, hull, logs, mesh,
    then, turn,
};
use crate::report::stability::stage::{Actor, Case, Pos};
use crate::shape::ShapeSpec;

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Gaps of the near-parallel pairs, metres.
const GAPS_M: [f64; 2] = [1e-3, -1e-3];

pub(super) fn parallel() -> Vec<Case> {
    let mut cases = Vec::new();
    for angle in logs(-12, 0, 2) {
        for gap_m in GAPS_M {
            let mut stand = |kind, lower: ShapeSpec, q_lower, upper: ShapeSpec, q_upper| {
                let top_m = match &lower {
                    ShapeSpec::HalfSpace { .. } => 0.0,
                    lower => below(lower, then(turn(X, std::f64::consts::PI), q_lower)),
                };
                let pos = above(top_m, &upper, q_upper, gap_m);
                let lower_pos = Pos {
                    t: [0.0; 3],
                    q: q_lower,
                };
                cases.push(Case::pair(
                    kind,
                    angle,
                    (Actor::of(lower), lower_pos),
                    (Actor::of(upper), pos),
                ));
            };
            let brick = || cuboid(0.5, 0.4, 0.3);
            let lean = turn([0.8, 0.6, 0.0], angle);
            stand("faces", brick(), STILL, cuboid(0.3, 0.2, 0.4), lean);
            let edge = turn(X, FRAC_PI_4);
            stand("edges", brick(), edge, brick(), then(turn(Z, angle), edge));
            let lying = turn(Y, 2.0 * FRAC_PI_4);
            let rod = || capsule(0.1, 0.5);
            stand("capsules", rod(), lying, rod(), then(turn(Z, angle), lying));
            let leaning = then(turn(Y, angle), lying);
            stand("half_space-capsule", floor(), STILL, rod(), leaning);
            let can = || cylinder(0.2, 0.5);
            stand("half_space-cylinder", floor(), STILL, can(), leaning);
            stand("half_space-disc", floor(), STILL, can(), turn(Y, angle));
            let tile = || ShapeSpec::Triangle {
                vertices: [[0.4, 0.0, 0.0], [-0.3, 0.3, 0.0], [-0.2, -0.3, 0.0]],
            };
            stand("triangles", tile(), STILL, tile(), turn(Y, angle));
            cases.push(axes(angle, 0.4 + gap_m));
        }
    }
    cases
}

/// Two cylinders side by side, with their axes at an angle and their centres on the common perpendicular.
fn axes(angle: f64, apart_m: f64) -> Case {
    let can = || Actor::of(cylinder(0.2, 0.5));
    let other = Pos {
        t: [0.0, apart_m, 0.0],
        q: turn(Y, angle),
    };
    let pair = (can(), Pos::at([0.0; 3]));
    Case::pair("cylinder-cylinder", angle, pair, (can(), other))
}

pub(super) fn slivers() -> Vec<Case> {
    let mut cases = Vec::new();
    for aspect in logs(0, 6, 2) {
        let thin_m = 0.5 / aspect;
        let tip = [0.5, 0.0, 0.0];
        let needles: [(&'static str, ShapeSpec); 5] = [
            ("needle", cuboid(0.5, thin_m, thin_m)),
            ("plate", cuboid(0.5, 0.5, thin_m)),
            (
                "triangle",
                ShapeSpec::Triangle {
                    vertices: [tip, [-0.5, thin_m, 0.0], [-0.5, -thin_m, 0.0]],
                },
            ),
            (
                "hull",
                hull(&[
                    tip,
                    [-0.5, thin_m, 0.0],
                    [-0.5, -thin_m, 0.0],
                    [-0.3, 0.0, thin_m],
                    [-0.3, 0.0, -thin_m],
                ]),
            ),
            ("capsule", capsule(thin_m, 0.5)),
        ];
        // Steep, so that corners touch first; and shallow, so that long edges do.
        for q in [turn([0.3, 1.0, 0.2], 1.1), turn([0.3, 1.0, 0.2], 0.01)] {
            for gap_m in [0.1 * thin_m, -0.1 * thin_m] {
                for (kind, shape) in &needles {
                    cases.push(on_box(kind, aspect, shape, q, gap_m));
                }
                for (kind, shape) in [
                    ("half_space-cone", cone(thin_m, 0.5)),
                    ("half_space-cylinder", cylinder(0.5, thin_m)),
                ] {
                    let pos = above(0.0, &shape, q, gap_m);
                    let lower = (Actor::of(floor()), Pos::at([0.0; 3]));
                    cases.push(Case::pair(kind, aspect, lower, (Actor::of(shape), pos)));
                }
            }
        }
        cases.push(disc(aspect, thin_m));
    }
    cases
}

fn on_box(kind: &'static str, value: f64, shape: &ShapeSpec, q: [f64; 4], gap_m: f64) -> Case {
    let pos = above(0.5, shape, q, gap_m);
    let lower = (Actor::of(cuboid(0.5, 0.5, 0.5)), Pos::at([0.0; 3]));
    Case::pair(kind, value, lower, (Actor::of(shape.clone()), pos))
}

/// A ball above the rim of a thin disc.
fn disc(aspect: f64, thin_m: f64) -> Case {
    let ball_at = Pos::at([0.5 + 0.08, 0.02, thin_m + 0.06]);
    Case::pair(
        "disc-sphere",
        aspect,
        (Actor::of(cylinder(0.5, thin_m)), Pos::at([0.0; 3])),
        (Actor::of(ball(0.1)), ball_at),
    )
}

pub(super) fn peg() -> Vec<Case> {
    /// Half of the peg's side, metres.
    const HALF_M: f64 = 0.1;
    let mut cases = Vec::new();
    for angle in logs(-12, -1, 2) {
        for off_m in [0.0, 1e-9, 1e-4] {
            let axle = (Actor::of(cylinder(0.1, 0.5)), Pos::at([0.0; 3]));
            let wheel = Pos {
                t: [0.0, off_m, 0.0],
                q: turn(Y, angle),
            };
            let hub = (Actor::of(cylinder(0.15, 0.2)), wheel);
            cases.push(Case::pair("wheel on axle", angle, axle, hub));
        }
        for (walls, tube, clear_m) in [
            (
                "hole of boxes, 1 mm clear",
                "hole in a mesh, 1 mm clear",
                1e-3,
            ),
            (
                "hole of boxes, 10 um clear",
                "hole in a mesh, 10 um clear",
                1e-5,
            ),
        ] {
            let leaning = Pos {
                t: [0.0; 3],
                q: turn(Y, angle),
            };
            for (kind, hole) in [
                (walls, of_boxes(HALF_M + clear_m)),
                (tube, of_mesh(HALF_M + clear_m)),
            ] {
                let peg = Actor::of(cuboid(HALF_M, HALF_M, 0.3));
                let hole = (hole, Pos::at([0.0; 3]));
                cases.push(Case::pair(kind, angle, hole, (peg, leaning)));
            }
        }
    }
    cases
}

/// A square hole between four boxes; `half_m` is half of its side.
fn of_boxes(half_m: f64) -> Actor {
    let wall = |x: f64, y: f64| (cuboid(0.05, 0.3, 0.1), [x, y, 0.0]);
    let across = |y: f64| (cuboid(0.3, 0.05, 0.1), [0.0, y, 0.0]);
    Actor {
        parts: vec![
            wall(half_m + 0.05, 0.0),
            wall(-half_m - 0.05, 0.0),
            across(half_m + 0.05),
            across(-half_m - 0.05),
        ],
        continuous: false,
    }
}

/// A square hole through a solid mesh; `half_m` is half of its side.
fn of_mesh(half_m: f64) -> Actor {
    let (mut vertices, _) = box_faces([half_m + 0.1, half_m + 0.1, 0.1]);
    vertices.extend(box_faces([half_m, half_m, 0.1]).0);
    let mut faces = Vec::new();
    let mut quad = |a: u32, b: u32, c: u32, d: u32| faces.extend([[a, b, c], [a, c, d]]);
    for k in 0..4 {
        let next = (k + 1) % 4;
        // The outer walls, the inner walls, the upper ring, the lower ring.
        quad(k, next, 4 + next, 4 + k);
        quad(8 + next, 8 + k, 12 + k, 12 + next);
        quad(4 + k, 4 + next, 12 + next, 12 + k);
        quad(next, k, 8 + k, 8 + next);
    }
    Actor::of(mesh(vertices, faces, true))
}
