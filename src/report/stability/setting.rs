//! The scene in which a case runs. In: a [`Case`]. Out: the scene, the shapes and the rows for an engine.

use super::stage::{Actor, Asked, Case, Pos};
use super::truth::Truth;
use crate::error::Result;
use crate::ids::BodyId;
use crate::math::Pose;
use crate::scene::{BodySpec, PlacedSpec, Scene, SourceSpec};
use crate::shape::{Library, ShapeSpec};
use crate::wire::TransformRow;
use crate::world::{Parts, PlacedShape};

/// The distance within which a pair is reported, metres.
pub(super) fn reach_of(scene: &Scene, (i, j): (usize, usize)) -> f64 {
    let of = |at: usize| scene.bodies[at].report_within_m;
    of(i).max(of(j))
}

/// The scene of a case: one source; bodies are reported well beyond every true gap, so that each pair has a row. For
/// impacts the distance is 0.
pub(super) fn scene(case: &Case, truths: &[Vec<Truth>]) -> Scene {
    let farthest = truths.iter().flatten().map(|truth| truth.high.near());
    let most = farthest.fold(0.0_f64, f64::max);
    let within_m = match case.asked {
        Asked::Impact(_) => 0.0,
        _ => 2.0 * most + case.size_m(0, case.pairs[0]),
    };
    let mut scene = Scene {
        frame_id: "world".to_owned(),
        sources: vec![SourceSpec {
            name: "report".to_owned(),
            timeout_ns: 3_600_000_000_000,
            on_stale: Default::default(),
            ros2: None,
        }],
        ..Scene::default()
    };
    scene.config.threads = Some(1);
    scene.bodies = (1..)
        .zip(&case.actors)
        .map(|(id, actor)| body(id, actor, within_m))
        .collect();
    scene
}

fn body(id: u64, actor: &Actor, report_within_m: f64) -> BodySpec {
    let part = |(shape, at): &(_, [f64; 3])| PlacedSpec {
        shape: ShapeSpec::clone(shape),
        pose: Pose::translation(at[0], at[1], at[2]),
    };
    let parts = actor.parts.iter().map(part).collect();
    BodySpec {
        continuous: actor.continuous,
        source: Some(0),
        report_within_m,
        ..BodySpec::new(format!("body_{id}"), BodyId(id), parts)
    }
}

/// Builds the shapes of its bodies.
pub(super) fn shapes(scene: &Scene) -> Result<Vec<Parts>> {
    let built = scene.build_shapes(&mut Library::new(), |_, _| {})?;
    let placed = scene.bodies.iter().zip(built.shapes).map(|(body, shapes)| {
        let parts = body.shapes.iter().zip(shapes);
        parts
            .map(|(spec, shape)| PlacedShape {
                shape,
                pose: spec.pose,
            })
            .collect()
    });
    Ok(placed.collect())
}

/// A row of a frame, as a sender writes it.
pub(super) fn row(body: u64, pos: &Pos) -> TransformRow {
    TransformRow {
        body,
        position: pos.t,
        orientation: pos.q,
        ..TransformRow::default()
    }
}
