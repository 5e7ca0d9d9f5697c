//! The source of mesh file contents: the disk, or contents that were kept.
//!
//! In: a file's name, as written in a spec. Out: its path, for messages and its kind, and its bytes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use crate::shape::{ShapeError, load};

/// Contents of mesh files by their names, as written in specs.
pub type Contents = BTreeMap<String, Arc<[u8]>>;

/// Where mesh files are read.
#[derive(Debug, Default)]
pub(super) enum Files {
    /// On disk.
    #[default]
    Disk,
    /// On disk; contents are kept until they are taken, so that the same shapes can be built elsewhere.
    Keeping {
        kept: Contents,
        /// The file behind each name when it was last kept.
        marks: BTreeMap<String, FileMark>,
    },
    /// Only these contents.
    Kept(Contents),
}

/// Identifies a file and its state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FileMark {
    path: PathBuf,
    bytes: u64,
    changed: Option<SystemTime>,
}

impl Files {
    /// The mark that distinguishes a file from one read before.
    pub(super) fn mark(&self, base: &Path, file: &str) -> Result<FileMark, ShapeError> {
        if let Self::Kept(contents) = self {
            let bytes = find(contents, file)?;
            return Ok(FileMark {
                path: file.into(),
                bytes: bytes.len() as u64,
                changed: None,
            });
        }
        let path = load::find_mesh(base, file)?;
        let meta = std::fs::metadata(&path).ok();
        Ok(FileMark {
            bytes: meta.as_ref().map_or(0, std::fs::Metadata::len),
            changed: meta.and_then(|meta| meta.modified().ok()),
            path,
        })
    }

    /// Whether a shape built from this file may be reused: while contents are kept, only if this very file was kept.
    pub(super) fn knows(&self, file: &str, mark: &FileMark) -> bool {
        match self {
            Self::Keeping { marks, .. } => marks.get(file) == Some(mark),
            _ => true,
        }
    }

    /// Reads a file.
    pub(super) fn read(
        &mut self,
        base: &Path,
        file: &str,
    ) -> Result<(PathBuf, Arc<[u8]>), ShapeError> {
        match self {
            Self::Kept(contents) => Ok((file.into(), find(contents, file)?)),
            Self::Disk => load::read(base, file),
            Self::Keeping { .. } => {
                let mark = self.mark(base, file)?;
                let (path, bytes) = load::read(base, file)?;
                if let Self::Keeping { kept, marks } = self {
                    kept.insert(file.to_owned(), Arc::clone(&bytes));
                    marks.insert(file.to_owned(), mark);
                }
                Ok((path, bytes))
            }
        }
    }
}

fn find(contents: &Contents, file: &str) -> Result<Arc<[u8]>, ShapeError> {
    contents
        .get(file)
        .cloned()
        .ok_or_else(|| ShapeError::Unreadable {
            path: file.to_owned(),
            message: "it is not among the files that were kept".to_owned(),
        })
}
