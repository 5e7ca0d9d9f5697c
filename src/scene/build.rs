//! Builds the shapes of a scene, and names the body that a shape's error or warning belongs to.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::scene::table::shortened;
use crate::scene::{BodySpec, Scene};
use crate::shape::{Library, Shape, ShapeError};

/// The built shapes of a scene.
#[derive(Debug)]
pub struct BuiltShapes {
    /// `[body][shape]`, indexed as `Scene::bodies` and their `shapes`.
    pub shapes: Vec<Vec<Arc<Shape>>>,
    /// Warnings, one line each, with file, line and body. A shared shape is reported once, for its first body.
    pub warnings: Vec<String>,
    /// Choices made where the scene does not specify them, one line each, in the format of the warnings.
    pub notes: Vec<String>,
}

/// Prefix of a shape's messages, its warnings, its note, and the number of further uses of it.
type Spoken = (String, Vec<String>, Option<&'static str>, usize);

impl Scene {
    /// Builds all shapes; equal ones are shared.
    ///
    /// * `progress` - called after each body with the number of bodies done and the total.
    ///
    /// # Errors
    /// `Error::Scene` with file, line, body and the fix, at the first shape that cannot be built.
    pub fn build_shapes(
        &self,
        library: &mut Library,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<BuiltShapes> {
        let mut all = BuiltShapes {
            shapes: Vec::with_capacity(self.bodies.len()),
            warnings: Vec::new(),
            notes: Vec::new(),
        };
        // By address of the shared shape.
        let mut spoken: BTreeMap<usize, Spoken> = BTreeMap::new();
        let mut order = Vec::new();
        for (place, body) in self.bodies.iter().enumerate() {
            let mut shapes = Vec::with_capacity(body.shapes.len());
            for (nth, placed) in body.shapes.iter().enumerate() {
                let built = library
                    .get(&placed.shape, &self.origin.base)
                    .map_err(|error| self.shape_error(place, nth, &error))?;
                if !built.warnings.is_empty() || built.note.is_some() {
                    let address = Arc::as_ptr(&built.shape).addr();
                    let known = spoken.get_mut(&address);
                    if let Some((_, _, _, more)) = known {
                        *more += 1;
                    } else {
                        order.push(address);
                        let prefix = self.prefix(place, nth);
                        spoken.insert(address, (prefix, built.warnings, built.note, 0));
                    }
                }
                shapes.push(if body.deforms {
                    let own = built.shape.to_deforming();
                    Arc::new(own.map_err(|error| self.shape_error(place, nth, &error))?)
                } else {
                    built.shape
                });
            }
            all.shapes.push(shapes);
            progress(place + 1, self.bodies.len());
        }
        for address in order {
            let Some((prefix, warnings, note, more)) = spoken.remove(&address) else {
                continue;
            };
            let more = match more {
                0 => String::new(),
                more => format!(" ({more} more of this shape)"),
            };
            let lines = warnings
                .iter()
                .map(|warning| format!("{prefix}{warning}{more}"));
            all.warnings.extend(lines);
            all.notes
                .extend(note.map(|note| format!("{prefix}{note}{more}")));
        }
        Ok(all)
    }

    /// The error of a shape, prefixed with file, line and body.
    ///
    /// * `body`, `shape` - indices into `Scene::bodies` and its `shapes`.
    #[must_use]
    pub fn shape_error(&self, body: usize, shape: usize, error: &ShapeError) -> Error {
        Error::Scene(format!("{}{error}", self.prefix(body, shape)))
    }

    /// `file:line: body "name": shape 2: `, as far as each is known and needed.
    fn prefix(&self, body: usize, shape: usize) -> String {
        let mut text = self.origin.file.clone();
        let line = self
            .origin
            .shape_lines
            .get(body)
            .and_then(|lines| lines.get(shape));
        if let Some(line) = line.filter(|line| **line > 0) {
            text.push_str(&format!(":{line}"));
        }
        if !text.is_empty() {
            text.push_str(": ");
        }
        let Some(spec) = self.bodies.get(body) else {
            return text;
        };
        text.push_str(&format!("body \"{}\": ", shortened(&spec.name)));
        if spec.shapes.len() > 1 {
            text.push_str(&format!("shape {}: ", shape + 1));
        }
        text
    }

    /// Paths of its mesh files, without duplicates.
    #[must_use]
    pub fn mesh_files(&self) -> Vec<PathBuf> {
        let shapes = self.bodies.iter().flat_map(|body| &body.shapes);
        let files: BTreeSet<&str> = shapes.filter_map(|placed| placed.shape.file()).collect();
        let base = &self.origin.base;
        files.into_iter().map(|file| base.join(file)).collect()
    }

    /// The body with this name.
    ///
    /// Cost: O(bodies).
    #[must_use]
    pub fn body(&self, name: &str) -> Option<&BodySpec> {
        self.bodies.iter().find(|body| body.name == name)
    }
}
