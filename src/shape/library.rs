//! Built shapes, shared: ten thousand equal bodies have one shape.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::shape::build::build_by;
use crate::shape::files::{Contents, FileMark, Files};
use crate::shape::{Built, ShapeError, ShapeSpec};

/// Shapes built so far, looked up by their specs.
///
/// A mesh file is read again when its size or time has changed.
#[derive(Debug, Default)]
pub struct Library {
    /// Never locked while a shape is built.
    shelves: Arc<Mutex<Shelves>>,
    files: Files,
}

/// By digest; entries with the same digest are distinguished by their specs.
type Shelves = BTreeMap<u64, Vec<Entry>>;

#[derive(Debug)]
struct Entry {
    spec: ShapeSpec,
    file: Option<FileMark>,
    built: Built,
}

impl Library {
    /// An empty library.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty library; the contents of files that it reads are kept until [`Library::take_kept`].
    #[must_use]
    pub fn keeping() -> Self {
        Self {
            files: Files::Keeping {
                kept: Contents::new(),
                marks: BTreeMap::new(),
            },
            ..Self::default()
        }
    }

    /// An empty library; its files are those that [`Library::take_kept`] returned elsewhere, and no others.
    #[must_use]
    pub fn of_kept(contents: Contents) -> Self {
        Self {
            files: Files::Kept(contents),
            ..Self::default()
        }
    }

    /// A second library of the same shapes, for another thread; what it reads is not kept.
    #[must_use]
    pub fn beside(&self) -> Self {
        Self {
            shelves: Arc::clone(&self.shelves),
            files: Files::default(),
        }
    }

    fn shelves(&self) -> MutexGuard<'_, Shelves> {
        self.shelves.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Files read since the last call, if they are kept.
    pub fn take_kept(&mut self) -> Contents {
        match &mut self.files {
            Files::Keeping { kept, .. } => std::mem::take(kept),
            _ => Contents::new(),
        }
    }

    /// Adds contents to a library of kept files; shapes built from a name's old contents are forgotten.
    pub fn add_kept(&mut self, contents: Contents) {
        let Files::Kept(all) = &mut self.files else {
            return;
        };
        let stays = |entry: &Entry| entry.spec.file().is_none_or(|f| !contents.contains_key(f));
        let mut shelves = (self.shelves.lock()).unwrap_or_else(PoisonError::into_inner);
        (shelves.values_mut()).for_each(|shelf| shelf.retain(stays));
        drop(shelves);
        all.extend(contents);
    }

    /// The shape of a spec: an equal one built before, or a new one.
    ///
    /// # Errors
    /// As [`build`](crate::shape::build).
    pub fn get(&mut self, spec: &ShapeSpec, base: &Path) -> Result<Built, ShapeError> {
        let name = spec.file();
        let file = name.map(|name| self.files.mark(base, name)).transpose()?;
        let known = (name.zip(file.as_ref())).is_none_or(|(name, m)| self.files.knows(name, m));
        let digest = digest(spec);
        let same = |entry: &&Entry| known && entry.spec == *spec && entry.file == file;
        let shelves = self.shelves();
        let found = shelves.get(&digest).and_then(|s| s.iter().find(same));
        if let Some(entry) = found {
            return Ok(entry.built.clone());
        }
        drop(shelves);
        let files = &mut self.files;
        let built = build_by(spec, &mut |name| files.read(base, name))?;
        let entry = Entry {
            spec: spec.clone(),
            file,
            built: built.clone(),
        };
        self.shelves().entry(digest).or_default().push(entry);
        Ok(built)
    }

    /// Forgets shapes that are not used elsewhere; to be called after bodies were removed.
    pub fn prune(&mut self) {
        self.shelves().retain(|_, shelf| {
            shelf.retain(|entry| Arc::strong_count(&entry.built.shape) > 1);
            !shelf.is_empty()
        });
    }

    /// Number of different shapes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shelves().values().map(Vec::len).sum()
    }

    /// Whether it holds none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
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
