//! From what users say to what the engine takes: the shapes of a scene, and edits with built shapes. Off the tick.
//!
//! In: a checked scene, requests read from JSON. Out: placed shapes, [`EditBatch`]es.

use std::path::PathBuf;
use std::sync::Arc;

use super::EditBatch;
use crate::error::Result;
use crate::scene::{BodyDraft, EditRequest, PlacedSpec, Scene, SourceSpec};
use crate::shape::{Contents, Library, Shape};
use crate::world::{Parts, PlacedShape, Put};

/// The built shapes of a scene.
#[derive(Debug)]
pub struct Shapes {
    /// One list a body, in the scene's order.
    pub bodies: Vec<Parts>,
    /// What `check` shows: sizes, open meshes, turned shells.
    pub warnings: Vec<String>,
    /// What `check` shows beside: which meshes are solids without the scene saying so.
    pub notes: Vec<String>,
    /// The shapes by spec, for edits that use them again.
    pub library: Library,
}

/// Builds every shape of a scene.
///
/// # Errors
/// `Error::Scene` with file, line, body and what to change, for the first shape that cannot be built.
pub fn build_shapes(scene: &Scene) -> Result<Shapes> {
    build_shapes_in(scene, Library::new(), |_, _| {})
}

/// As [`build_shapes`], with a library of its own: one that keeps the files it reads, or is of kept ones.
///
/// * `progress` - told after each body: how many are done, of how many.
///
/// # Errors
/// As [`build_shapes`].
pub fn build_shapes_in(
    scene: &Scene,
    mut library: Library,
    progress: impl FnMut(usize, usize),
) -> Result<Shapes> {
    let built = scene.build_shapes(&mut library, progress)?;
    let bodies = scene
        .bodies
        .iter()
        .zip(built.shapes)
        .map(|(body, shapes)| place(&body.shapes, shapes))
        .collect();
    Ok(Shapes {
        bodies,
        warnings: built.warnings,
        notes: built.notes,
        library,
    })
}

/// Built shapes at their places in a body.
fn place(specs: &[PlacedSpec], shapes: Vec<Arc<Shape>>) -> Parts {
    let placed = specs.iter().zip(shapes);
    placed
        .map(|(spec, shape)| PlacedShape {
            shape,
            pose: spec.pose,
        })
        .collect()
}

/// Makes edits of requests.
#[derive(Debug)]
pub struct EditBuilder {
    sources: Vec<SourceSpec>,
    /// The folder that mesh files are relative to; `None`: the library's files are kept ones.
    base: Option<PathBuf>,
    library: Library,
}

impl EditBuilder {
    /// For a running scene, with the shapes that are built already.
    #[must_use]
    pub fn new(scene: &Scene, library: Library) -> Self {
        Self {
            sources: scene.sources.clone(),
            base: Some(scene.origin.base.clone()),
            library,
        }
    }

    /// As [`EditBuilder::new`], for a library of kept files.
    #[must_use]
    pub fn of_kept(scene: &Scene, library: Library) -> Self {
        Self {
            base: None,
            ..Self::new(scene, library)
        }
    }

    /// Another one for the questions of the same scene, which keeps no files.
    #[must_use]
    pub fn beside(&self) -> Self {
        Self {
            sources: self.sources.clone(),
            base: self.base.clone(),
            library: self.library.beside(),
        }
    }

    /// Builds the shapes of a request.
    ///
    /// # Errors
    /// One text that names the body, what is wrong and what to change.
    pub fn build(
        &mut self,
        token: u64,
        asked: EditRequest,
    ) -> std::result::Result<EditBatch, String> {
        let mut warnings = Vec::new();
        let mut edits = Vec::with_capacity(asked.edits.len());
        for edit in asked.edits {
            edits.push(edit.build(|draft| self.put(*draft, &mut warnings))?);
        }
        self.library.prune();
        Ok(EditBatch {
            token,
            edits,
            validate: asked.validate,
            warnings,
        })
    }

    /// Builds shapes that are to be no body, for a question; and what is odd about them.
    ///
    /// # Errors
    /// One text that names the shape, what is wrong and what to change.
    pub fn shapes(
        &mut self,
        specs: &[PlacedSpec],
    ) -> std::result::Result<(Parts, Vec<String>), String> {
        let base = self.base.clone().unwrap_or_default();
        let (mut shapes, mut warnings) = (Vec::with_capacity(specs.len()), Vec::new());
        for (place, spec) in specs.iter().enumerate() {
            let named = |what: &dyn std::fmt::Display| format!("shape {}: {what}", place + 1);
            let built = self.library.get(&spec.shape, &base);
            let built = built.map_err(|e| named(&e))?;
            warnings.extend(built.warnings.iter().map(|warning| named(warning)));
            shapes.push(built.shape);
        }
        let parts = place(specs, shapes);
        self.library.prune();
        Ok((parts, warnings))
    }

    /// The files that were read since the last call, where the library keeps them; to be asked for after a request that
    /// was built, for the shapes of one that was not may serve the next.
    pub fn take_kept(&mut self) -> Contents {
        self.library.take_kept()
    }

    /// Adds to the files of a library that is of kept ones.
    pub fn add_kept(&mut self, contents: Contents) {
        self.library.add_kept(contents);
    }

    /// Builds a body that is to be put.
    fn put(
        &mut self,
        draft: BodyDraft,
        warnings: &mut Vec<String>,
    ) -> std::result::Result<Put, String> {
        let body = draft.settle(&self.sources, self.base.as_deref())?;
        let base = self.base.clone().unwrap_or_default();
        let mut shapes = Vec::with_capacity(body.shapes.len());
        for (place, spec) in body.shapes.iter().enumerate() {
            let built = self.library.get(&spec.shape, &base);
            let named = |e| format!("body \"{}\": shape {}: {e}", body.name, place + 1);
            let built = built.map_err(named)?;
            let named_warnings = built
                .warnings
                .iter()
                .map(|w| format!("body \"{}\": {w}", body.name));
            warnings.extend(named_warnings);
            shapes.push(if body.deforms {
                Arc::new(built.shape.to_deforming().map_err(named)?)
            } else {
                built.shape
            });
        }
        let shapes = place(&body.shapes, shapes);
        Ok(Put {
            body: Arc::new(body),
            shapes,
        })
    }
}
