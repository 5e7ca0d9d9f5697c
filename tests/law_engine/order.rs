//! Laws 3.11 and 4.5: the same inputs give the same bits, whatever their order, even if work is cut off.

use std::path::Path;

use sweepd::builtin::{Motion, Pattern, Random, pool};
use sweepd::config::BroadMethod;
use sweepd::ids::BodyId;
use sweepd::scene::Scene;
use sweepd::shape::ShapeSpec;
use sweepd::time::Budget;

use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::rig::{Rig, row};

/// A pool of convex bodies and some meshes, with ids in descending order.
fn mixed() -> Scene {
    let mut scene = Scene::parse(&pool(60, 4), "scene.toml", Path::new(".")).unwrap();
    let torus = meshes::torus(0.4, 0.15, 10, 7);
    for (k, body) in scene.bodies.iter_mut().enumerate() {
        body.id = BodyId(1000 - 7 * k as u64);
        if k % 6 == 2 {
            body.shapes[0].shape = ShapeSpec::Trimesh {
                vertices: torus.vertices.iter().map(|v| v.coords.into()).collect(),
                faces: torus.faces.clone(),
                file: None,
                scale: None,
                solid: None,
            };
        }
        if k % 5 == 3 {
            let mut second = body.shapes[0].clone();
            second.pose.translation.vector.x += 0.6;
            body.shapes.push(second);
        }
        body.report_within_m = if k % 4 == 0 { 0.05 } else { 0.0 };
    }
    scene
}

fn shuffle<T>(items: &mut [T], rng: &mut Rng) {
    for at in (1..items.len()).rev() {
        items.swap(at, rng.below(at + 1));
    }
}

#[test]
fn law_4_5_the_same_inputs_in_any_order_and_any_broad_phase_give_the_same_bits_at_any_budget_in_units()
 {
    let scene = mixed();
    let mut random = Random::new(5);
    let motions: Vec<(u64, Motion)> = (scene.bodies.iter())
        .map(|body| {
            (
                body.id.0,
                Motion::new(body.pose, Pattern::Wander, &mut random),
            )
        })
        .collect();
    for units in [0, 7, 40, 200, 1_000_000] {
        let mut want: Vec<String> = Vec::new();
        let methods = BroadMethod::NAMED.iter().map(|(method, _)| Some(*method));
        for (order, method) in (0..).zip([None, None, None].into_iter().chain(methods)) {
            let mut rng = Rng::new(order);
            let mut scene = scene.clone();
            scene.config.broad_phase = method;
            if order > 0 {
                shuffle(&mut scene.bodies, &mut rng);
            }
            let mut rig = Rig::of(&scene);
            for tick in 0..40_u32 {
                for (id, motion) in &motions {
                    *rig.row(*id) = row(*id, &motion.pose_at(0.02 * f64::from(tick)));
                }
                if order > 0 {
                    shuffle(&mut rig.rows, &mut rng);
                }
                rig.send(Budget::units(units));
                let out = &mut rig.out;
                // The work counters of the broad phase may depend on the order.
                (
                    out.tick.broad_renewed,
                    out.tick.broad_mode,
                    out.tick.broad_cause,
                ) = (0, 0, 0);
                let said = format!(
                    "{:?}\n{:?}\n{:?}\n{:?}\n{:?}\n{:?}",
                    out.pairs, out.contacts, out.regions, out.bodies, out.body_verdicts, out.tick
                );
                match want.get(tick as usize) {
                    None => want.push(said),
                    Some(want) if *want != said => {
                        let differs = want.lines().zip(said.lines()).find(|(a, b)| a != b);
                        let (a, b) = differs.unwrap();
                        let at = a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count();
                        let from = at.saturating_sub(300);
                        panic!(
                            "{units} units, {method:?}, tick {tick}:\n{}\n{}",
                            &a[from..(at + 100).min(a.len())],
                            &b[from..(at + 100).min(b.len())]
                        );
                    }
                    Some(_) => {}
                }
            }
        }
    }
}
