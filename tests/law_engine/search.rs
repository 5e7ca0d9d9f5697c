//! The search methods for mesh pairs, chosen by name: with enough time all give the same answers, and otherwise sound
//! ones. Truth: brute force over all triangles.

use std::path::Path;

use sweepd::config::MeshSearch;
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::scene::Scene;
use sweepd::time::Budget;
use sweepd::wire::{PairRow, Verdict};

use crate::oracle::meshes::{Soup, bumpy_sphere, cuboid, torus, trimesh};
use crate::oracle::rng::Rng;
use crate::oracle::{Placed, Truth, truth};
use crate::rig::{Rig, body, scene};

const PAIRS: usize = 6;
const AWAY_M: f64 = 20.0;

fn soups() -> [Soup; 3] {
    [
        bumpy_sphere(7, 9, 0.1),
        torus(0.9, 0.3, 10, 7),
        cuboid(Vec3::new(0.9, 0.6, 0.4)),
    ]
}

/// Pairs of meshes far from each other; the last two have a second shape and thus no front of their own.
fn text(search: &str) -> String {
    let mut bodies = Vec::new();
    for pair in 0..PAIRS {
        for k in 0..2 {
            let mesh = trimesh(&soups()[(pair + k) % 3], None);
            let shape = if pair >= PAIRS - 2 {
                // Inside each of the solids, so that it touches only what they touch.
                let speck = "{ type = \"sphere\", radius = 0.001, position = [0.75, 0.0, 0.0] }";
                format!("[{mesh}, {speck}]")
            } else {
                mesh
            };
            let id = (2 * pair + k) as u64 + 1;
            bodies.push(body(
                id,
                [AWAY_M * pair as f64, 1.7 * k as f64, 0.0],
                &shape,
                "",
            ));
        }
    }
    scene(&format!("[run]\nmesh_search = \"{search}\""), &bodies)
}

fn start(search: &str) -> Rig {
    Rig::of(&Scene::parse(&text(search), "scene.toml", Path::new(".")).unwrap())
}

fn row_of(rig: &Rig, pair: usize) -> Option<&PairRow> {
    let a = 2 * pair as u64 + 1;
    rig.out.pairs.iter().find(|row| row.body_a == a)
}

/// A pose of B near contact, overlapping or anywhere; in half of the cases a small step from the last pose.
fn next(rng: &mut Rng, pose: &Pose, pair: usize) -> Pose {
    let home = Vec3::new(AWAY_M * pair as f64, 0.0, 0.0);
    if rng.below(2) == 0 {
        let by = [0.001, 0.01, 0.05][rng.below(3)];
        let turn = Quat::from_scaled_axis(rng.vector(by));
        let to = pose.translation.vector + rng.vector(by);
        return Pose::from_parts(to.into(), turn * pose.rotation);
    }
    let away = rng.direction() * rng.range(0.8, 2.2);
    rng.pose(home + away)
}

#[test]
fn every_search_of_mesh_pairs_gives_the_same_verdicts_without_a_limit_and_sound_ones_within_any() {
    let soups = soups();
    let names = MeshSearch::NAMED.iter().map(|(_, name)| *name);
    let mut rigs: Vec<(Rig, Rig)> = names.map(|name| (start(name), start(name))).collect();
    let mut rng = Rng::new(77);
    let mut poses: Vec<Pose> = (0..PAIRS)
        .map(|pair| Pose::translation(AWAY_M * pair as f64, 1.7, 0.0))
        .collect();
    let ticks = if cfg!(debug_assertions) { 60 } else { 600 };
    let (mut colliding, mut open, mut apart) = (0, vec![0; rigs.len()], 0);
    for tick in 0..ticks {
        let units = [0, 1, 5, 30, 100, 400][rng.below(6)];
        for (pair, pose) in poses.iter_mut().enumerate() {
            *pose = next(&mut rng, pose, pair);
        }
        let truths: Vec<Truth> = (0..PAIRS)
            .map(|pair| {
                let a = Pose::translation(AWAY_M * pair as f64, 0.0, 0.0);
                let placed = |soup: &Soup, pose: &Pose| {
                    Placed::new(
                        &soup.vertices,
                        &soup.faces,
                        true,
                        pose,
                        &a.translation.vector,
                    )
                };
                let (one, other) = (&soups[pair % 3], &soups[(pair + 1) % 3]);
                truth(&placed(one, &a), &placed(other, &poses[pair]))
            })
            .collect();
        for ((whole, cut), open) in rigs.iter_mut().zip(&mut open) {
            for rig in [&mut *whole, &mut *cut] {
                for (pair, pose) in poses.iter().enumerate() {
                    let q = pose.rotation.coords;
                    let row = rig.row(2 * pair as u64 + 2);
                    row.position = pose.translation.vector.into();
                    row.orientation = [q.x, q.y, q.z, q.w];
                }
            }
            whole.send(Budget::UNLIMITED);
            cut.send(Budget::units(units));
            assert!(cut.out.tick.units <= units + 1);
            for (pair, truth) in truths.iter().enumerate() {
                let what = format!("tick {tick} pair {pair} {units} units: {truth:?}");
                for (rig, limited) in [(&*whole, false), (&*cut, true)] {
                    // A pair without a row is proved apart.
                    let row = row_of(rig, pair);
                    let verdict = row.map_or(Verdict::Apart.code(), |row| row.verdict);
                    let may = verdict == Verdict::Possible.code();
                    assert!(limited || !may, "{what}: {row:?}");
                    let touches = verdict == Verdict::Colliding.code();
                    let low = row.map_or(f64::MIN_POSITIVE, |row| row.gap_min_m);
                    let high = row.map_or(f64::INFINITY, |row| row.gap_max_m);
                    match *truth {
                        Truth::Apart(gap_m) => {
                            assert!(!touches || gap_m < 1e-9, "{what}: {row:?}");
                            assert!(
                                low <= gap_m + 1e-9 && high >= gap_m - 1e-9,
                                "{what}: {row:?}"
                            );
                            apart += 1;
                        }
                        Truth::Overlap(most_m) => {
                            assert!(touches || may, "{what}: {row:?}");
                            assert!(low <= most_m + 1e-9, "{what}: {row:?}");
                            colliding += 1;
                        }
                    }
                    *open += usize::from(limited && may);
                }
            }
        }
    }
    assert!(colliding > 2 * ticks && apart > 2 * ticks);
    assert!(open.iter().all(|open| *open > ticks / 4), "{open:?}");
    // Methods with carried state leave fewer pairs open than the baselines.
    assert!(open[0] < open[2] && open[0] < open[3], "{open:?}");
}

/// Once inner balls prove an overlap, the last contact point is no estimate any more. It was kept, and rows had the gap
/// there and its closing speed.
#[test]
fn bug_an_overlap_told_by_balls_is_not_shown_where_the_two_touched_before() {
    let round = trimesh(&bumpy_sphere(16, 24, 0.02), None);
    let bodies = [[0.0; 3], [1.9, 0.0, 0.0]];
    let bodies: Vec<String> = (1..)
        .zip(bodies)
        .map(|(id, at)| body(id, at, &round, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(Budget::UNLIMITED);
    let touching = *row_of(&rig, 0).unwrap();
    assert_eq!(touching.verdict, Verdict::Colliding.code());
    assert!(
        touching.gap_best_m.is_finite() && touching.gap_max_m > -1e-3,
        "{touching:?}"
    );
    // Deep, and on another side. The two units pay for a retest of the old contact and a test of the inner balls.
    rig.place(2, &Pose::translation(0.0, 0.8, 0.0));
    rig.send(Budget::units(2));
    let deep = *row_of(&rig, 0).unwrap();
    assert_eq!(deep.verdict, Verdict::Colliding.code());
    assert!(deep.gap_max_m < -0.7, "{deep:?}");
    assert!(deep.gap_best_m.is_nan(), "{deep:?}");
}

#[test]
fn the_scene_chooses_a_search_by_name_and_the_plan_says_so() {
    for (search, name) in MeshSearch::NAMED {
        let scene = Scene::parse(&text(name), "scene.toml", Path::new(".")).unwrap();
        assert_eq!(scene.config.mesh_search, Some(*search));
        let rig = Rig::of(&scene);
        let plan = &rig.engine.outbox().plan;
        assert!(plan.contains("search of mesh pairs"), "{plan}");
        assert!(plan.contains("the scene asks for it"), "{plan}");
    }
    let auto = Scene::parse(&text("auto"), "scene.toml", Path::new(".")).unwrap();
    assert_eq!(auto.config.mesh_search, None);
    let wrong = Scene::parse(&text("breadth"), "scene.toml", Path::new(".")).unwrap_err();
    let said = wrong.to_string();
    assert!(
        said.contains("mesh_search is \"breadth\": write \"auto\" or one of carried, restart, breadth_first, priority"),
        "{said}"
    );
}
