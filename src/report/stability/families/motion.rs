//! Cases that are stiff in time: stacks, spinning needles, vibration about touching, bullets.

use std::f64::consts::PI;

use super::kinds::{ball, capsule, cuboid, floor, logs, mesh_cube, stands, turn};
use crate::report::stability::dd::Dd;
use crate::report::stability::stage::{Actor, Asked, Case, Pos};
use crate::shape::ShapeSpec;

pub(super) fn stack() -> Vec<Case> {
    logs(-12, -3, 2)
        .flat_map(|gap_m| [tower("boxes", gap_m, false), tower("meshes", gap_m, true)])
        .collect()
}

/// Eight bodies on a floor, each with a gap to the one below.
fn tower(kind: &'static str, gap_m: f64, mesh: bool) -> Case {
    let mut actors = vec![Actor::of(floor())];
    let mut poses = vec![Pos::at([0.0; 3])];
    let mut top_m = 0.0;
    for k in 0..8_u32 {
        let half_m = 0.5 / f64::from(k + 1);
        let shape = if mesh {
            mesh_cube(half_m)
        } else {
            cuboid(half_m, half_m, half_m)
        };
        actors.push(Actor::of(shape));
        poses.push(Pos {
            t: [0.01 * f64::from(k), 0.0, top_m + gap_m + half_m],
            q: turn([0.0, 0.0, 1.0], 0.1 * f64::from(k)),
        });
        top_m += gap_m + 2.0 * half_m;
    }
    Case {
        kind,
        value: gap_m,
        pairs: (0..8)
            .flat_map(|k| [(k, k + 1), (k, k + 2)])
            .filter(|(_, upper)| *upper <= 8)
            .collect(),
        ticks: vec![poses],
        actors,
        asked: Asked::Gap,
    }
}

pub(super) fn spin() -> Vec<Case> {
    let mut cases = Vec::new();
    for aspect in logs(0, 6, 1) {
        let thin_m = 0.5 / aspect;
        let post = || cuboid(0.05, 0.05, 0.5);
        for (kind, needle, post) in [
            ("box-box", cuboid(0.5, thin_m, thin_m), post()),
            ("capsule-box", capsule(thin_m, 0.5), post()),
            ("box-mesh", cuboid(0.5, thin_m, thin_m), mesh_cube(0.05)),
        ] {
            // The needle's tip passes the post in some ticks, and narrowly misses it in others.
            let poses = |tick: u32| {
                let angle = f64::from(tick) * (PI + 0.13);
                let axis = if matches!(needle, ShapeSpec::Capsule { .. }) {
                    [1.0, 0.0, 0.0]
                } else {
                    [0.0, 0.0, 1.0]
                };
                let needle_at = Pos {
                    t: [0.0; 3],
                    q: turn(axis, angle),
                };
                let post_at = if axis[0] > 0.0 {
                    [0.0, 0.3, 0.4]
                } else {
                    [0.4, 0.3, 0.0]
                };
                vec![needle_at, Pos::at(post_at)]
            };
            cases.push(Case {
                kind,
                value: aspect,
                ticks: (0..24).map(poses).collect(),
                actors: vec![Actor::of(needle.clone()), Actor::of(post)],
                pairs: vec![(0, 1)],
                asked: Asked::Gap,
            });
        }
    }
    cases
}

pub(super) fn vibration() -> Vec<Case> {
    let mut cases = Vec::new();
    for amplitude_m in logs(-12, -3, 1) {
        for stand in stands(1.0, 1.0) {
            // Not a period of the ticks, so that all phases occur.
            let gap_m = |tick: u32| amplitude_m * (2.4 * f64::from(tick)).sin();
            cases.push(Case {
                ticks: (0..48)
                    .map(|tick| stand.poses(gap_m(tick)).to_vec())
                    .collect(),
                ..stand.case(amplitude_m, 0.0)
            });
        }
    }
    cases
}

pub(super) fn bullet() -> Vec<Case> {
    /// Half of the wall's thickness, metres.
    const HALF_M: f64 = 5e-4;
    let mut cases = Vec::new();
    for way_m in logs(-2, 4, 2) {
        let small = 1e-3;
        let sheet = ShapeSpec::Triangle {
            vertices: [[1.0, -0.7, 0.0], [0.0, 1.0, 0.0], [-1.0, -0.7, 0.0]],
        };
        let wall = || cuboid(1.0, 1.0, HALF_M);
        for (kind, shape, wall, reach) in [
            ("sphere at a box", ball(small), wall(), [small, HALF_M]),
            ("sphere at a triangle", ball(small), sheet, [small, 0.0]),
            (
                "box at a box",
                cuboid(small, small, small),
                wall(),
                [small, HALF_M],
            ),
            (
                "sphere at a mesh",
                ball(small),
                mesh_cube(1.0),
                [small, 1.0],
            ),
        ] {
            let start = -0.4 * way_m - reach[1];
            let end = start + way_m;
            let flown = Dd::between(start, end);
            let free = Dd::from(-reach[0]) - Dd::from(reach[1]) - Dd::from(start);
            let place = |z: f64| vec![Pos::at([0.1, 0.05, z]), Pos::at([0.0; 3])];
            let flying = Actor {
                continuous: true,
                ..Actor::of(shape)
            };
            cases.push(Case {
                kind,
                value: way_m,
                actors: vec![flying, Actor::of(wall)],
                ticks: vec![place(start), place(end)],
                pairs: vec![(0, 1)],
                asked: Asked::Impact(free / flown),
            });
        }
    }
    cases
}
