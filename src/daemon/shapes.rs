//! From a checked scene to the placed shapes of its bodies, each equal shape built once.

use std::sync::Arc;

use crate::error::Result;
use crate::scene::{BodySpec, Scene};
use crate::shape::{Library, Shape};
use crate::world::PlacedShape;

/// The built shapes of a scene.
#[derive(Debug)]
pub struct Shapes {
    /// One list a body, in the scene's order.
    pub bodies: Vec<Arc<[PlacedShape]>>,
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
pub(super) fn place(body: &BodySpec, shapes: Vec<Arc<Shape>>) -> Arc<[PlacedShape]> {
    let placed = body.shapes.iter().zip(shapes);
    placed
        .map(|(spec, shape)| PlacedShape {
            shape,
            pose: spec.pose,
        })
        .collect()
}
