//! Mesh files: STL (binary and text), OBJ, DAE. Own readers, because the ones at hand keep f32 coordinates, skip a DAE's
//! up-axis, believe any size a file claims, and cannot say in which line a mistake stands.
//!
//! In: a path. Out: vertices in metres, z up, equal ones merged; faces in the file's order.

use std::path::{Path, PathBuf};

use crate::shape::ShapeError;

/// Where a mesh file is, if it is there and of a known kind.
///
/// * `base` - the folder of the scene file.
///
/// # Errors
/// `Unreadable` for a missing file or a folder, `Format` for an unknown ending.
pub(crate) fn find_mesh(base: &Path, file: &str) -> Result<PathBuf, ShapeError> {
    let path = base.join(file);
    let unreadable = |message: String| ShapeError::Unreadable {
        path: path.display().to_string(),
        message,
    };
    let meta = std::fs::metadata(&path).map_err(|e| unreadable(e.to_string()))?;
    if !meta.is_file() {
        return Err(unreadable("this is not a file".to_owned()));
    }
    kind(&path)?;
    Ok(path)
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Stl,
    Obj,
    Dae,
}

fn kind(path: &Path) -> Result<Kind, ShapeError> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    match ending.as_str() {
        "stl" => Ok(Kind::Stl),
        "obj" => Ok(Kind::Obj),
        "dae" => Ok(Kind::Dae),
        _ => Err(ShapeError::Format {
            path: path.display().to_string(),
            line: None,
            message: format!("files ending in \".{ending}\" are not read: use .stl, .obj or .dae"),
        }),
    }
}
