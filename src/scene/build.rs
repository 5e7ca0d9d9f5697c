//! Builds the shapes of a scene, and says which body a shape's trouble belongs to.

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
    /// `[body][shape]`, beside `Scene::bodies` and their `shapes`.
    pub shapes: Vec<Vec<Arc<Shape>>>,
    /// Things to know, one line each, naming file, line and body; each shape is spoken of once.
    pub warnings: Vec<String>,
    /// What was settled where the scene does not say it, one line each, as the warnings.
    pub notes: Vec<String>,
}

/// Where a shape is spoken of, its warnings, its note, and how many more bodies have it.
type Spoken = (String, Vec<String>, Option<&'static str>, usize);

impl Scene {
    /// Builds all shapes; equal ones are shared.
    ///
    /// * `progress` - told after each body: how many are done, of how many.
    ///
    /// # Errors
    /// `Error::Scene` with file, line, body and the mend, at the first shape that cannot be built.
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
        // By address of the shared shape: its first body, its warnings and note, how many more bodies have it.
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

    /// A shape's trouble with file, line and body.
    ///
    /// * `body`, `shape` - places in `Scene::bodies` and its `shapes`.
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

    /// The files of its meshes, each once.
    #[must_use]
    pub fn mesh_files(&self) -> Vec<PathBuf> {
        let shapes = self.bodies.iter().flat_map(|body| &body.shapes);
        let files: BTreeSet<&str> = shapes.filter_map(|placed| placed.shape.file()).collect();
        let base = &self.origin.base;
        files.into_iter().map(|file| base.join(file)).collect()
    }

    /// The body of a name.
    ///
    /// Cost: O(bodies).
    #[must_use]
    pub fn body(&self, name: &str) -> Option<&BodySpec> {
        self.bodies.iter().find(|body| body.name == name)
    }
}
