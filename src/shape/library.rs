//! Built shapes, shared: ten thousand equal bodies have one shape.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

use crate::shape::{Built, ShapeError, ShapeSpec, build};

/// Shapes built so far, found by what was said of them.
///
/// A mesh file is read again when its size or time has changed.
#[derive(Debug, Default)]
pub struct Library {
    /// By digest; several entries of one digest are told apart by their specs.
    shelves: BTreeMap<u64, Vec<Entry>>,
}

#[derive(Debug)]
struct Entry {
    spec: ShapeSpec,
    file: Option<FileMark>,
    built: Built,
}

/// Which file it was, and in which state.
#[derive(Debug, PartialEq, Eq)]
struct FileMark {
    path: std::path::PathBuf,
    bytes: u64,
    changed: Option<SystemTime>,
}

impl Library {
    /// Nothing is built yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The shape of a spec: an equal one built before, or a new one.
    ///
    /// # Errors
    /// As [`build`].
    pub fn get(&mut self, spec: &ShapeSpec, base: &Path) -> Result<Built, ShapeError> {
        let file = mark(spec, base)?;
        let shelf = self.shelves.entry(digest(spec)).or_default();
        if let Some(entry) = shelf.iter().find(|e| e.spec == *spec && e.file == file) {
            return Ok(entry.built.clone());
        }
        let built = build(spec, base)?;
        shelf.push(Entry {
            spec: spec.clone(),
            file,
            built: built.clone(),
        });
        Ok(built)
    }

    /// Forgets shapes that nobody else holds; to be called after bodies were removed.
    pub fn prune(&mut self) {
        for shelf in self.shelves.values_mut() {
            shelf.retain(|entry| Arc::strong_count(&entry.built.shape) > 1);
        }
        self.shelves.retain(|_, shelf| !shelf.is_empty());
    }

    /// How many different shapes it holds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shelves.values().map(Vec::len).sum()
    }

    /// Whether it holds none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn mark(spec: &ShapeSpec, base: &Path) -> Result<Option<FileMark>, ShapeError> {
    let (ShapeSpec::Convex { file, .. } | ShapeSpec::Trimesh { file, .. }) = spec else {
        return Ok(None);
    };
    let Some(file) = file else {
        return Ok(None);
    };
    let path = super::find_mesh(base, file)?;
    let meta = std::fs::metadata(&path).ok();
    Ok(Some(FileMark {
        bytes: meta.as_ref().map_or(0, std::fs::Metadata::len),
        changed: meta.and_then(|meta| meta.modified().ok()),
        path,
    }))
}

/// FNV-1a over the numbers and texts of a spec. Equal specs have equal digests; -0 and 0 are equal, so 0 is added.
///
/// Source: Fowler, Noll, Vo; the 64-bit constants of their page.
fn digest(spec: &ShapeSpec) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut eat = |bits: u64| {
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    let mut number = |x: f64| eat((x + 0.0).to_bits());
    match spec {
        ShapeSpec::Sphere { radius } => number(*radius),
        ShapeSpec::Box { half_extents } => half_extents.iter().for_each(|x| number(*x)),
        ShapeSpec::Capsule {
            radius,
            half_height,
        }
        | ShapeSpec::Cylinder {
            radius,
            half_height,
        }
        | ShapeSpec::Cone {
            radius,
            half_height,
        } => {
            number(*radius);
            number(*half_height);
        }
        ShapeSpec::Triangle { vertices } => vertices.iter().flatten().for_each(|x| number(*x)),
        ShapeSpec::HalfSpace { normal, offset } => {
            normal.iter().for_each(|x| number(*x));
            number(*offset);
        }
        ShapeSpec::HeightField {
            heights,
            size,
            base_m,
        } => {
            heights
                .iter()
                .flatten()
                .chain(size)
                .for_each(|x| number(*x));
            number(*base_m);
        }
        ShapeSpec::Convex { vertices, file, .. } | ShapeSpec::Trimesh { vertices, file, .. } => {
            vertices.iter().flatten().for_each(|x| number(*x));
            for byte in file.iter().flat_map(|file| file.bytes()) {
                eat(u64::from(byte));
            }
        }
    }
    hash
}
