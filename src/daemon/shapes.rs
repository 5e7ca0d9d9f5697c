//! From a checked scene to the placed shapes of its bodies, each equal shape built once.

use std::sync::Arc;

use crate::error::Result;
use crate::ids::BodyId;
use crate::scene::{BodySpec, Scene};
use crate::shape::{Library, Shape};
use crate::transport::BodyNote;
use crate::world::{Parts, PlacedShape};

/// The built shapes of a scene.
#[derive(Debug)]
pub struct Shapes {
    /// One list a body, in the scene's order.
    pub bodies: Vec<Parts>,
    /// What `check` shows: sizes, open meshes, turned shells.
    pub warnings: Vec<String>,
    /// The shapes by spec, for edits that use them again.
    pub library: Library,
}

/// Builds every shape of a scene.
///
/// # Errors
/// `Error::Scene` with file, line, body and what to change, for the first shape that cannot be built.
pub fn build_shapes(scene: &Scene) -> Result<Shapes> {
    let mut library = Library::new();
    let built = scene.build_shapes(&mut library, |_, _| {})?;
    let bodies = scene
        .bodies
        .iter()
        .zip(built.shapes)
        .map(|(body, shapes)| place(body, shapes))
        .collect();
    Ok(Shapes {
        bodies,
        warnings: built.warnings,
        library,
    })
}

/// Built shapes at their places in a body.
pub(super) fn place(body: &BodySpec, shapes: Vec<Arc<Shape>>) -> Parts {
    let placed = body.shapes.iter().zip(shapes);
    placed
        .map(|(spec, shape)| PlacedShape {
            shape,
            pose: spec.pose,
        })
        .collect()
}

/// What doors need to know of a body.
#[must_use]
pub fn body_note(spec: &BodySpec, id: BodyId, placed: &[PlacedShape]) -> BodyNote {
    BodyNote {
        id: id.0,
        name: spec.name.clone(),
        source: spec.source,
        frame: spec.ros_frame.as_ref().unwrap_or(&spec.name).clone(),
        topic: spec.ros_topic.clone().unwrap_or_default(),
        bounds: bounds(placed),
    }
}

/// Centre and half extents of a body's box in its own frame; `None`: it has no end.
fn bounds(placed: &[PlacedShape]) -> Option<([f64; 3], [f64; 3])> {
    let boxes = placed.iter().map(|p| p.shape.aabb_at(&p.pose));
    let whole = boxes.reduce(|a, b| a.merged(&b))?;
    let (centre, half) = (whole.centre(), whole.half_extents());
    let finite = half.iter().all(|x| x.is_finite());
    finite.then(|| ([centre.x, centre.y, centre.z], [half.x, half.y, half.z]))
}
