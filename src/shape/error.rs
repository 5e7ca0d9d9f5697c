//! Why a shape cannot be built: what is wrong with it and what to change. Its location (file, line, body) is added by
//! the caller.

use std::path::Path;

use crate::error::Error;
use crate::limits::{EXTENT_MAX_M, EXTENT_MIN_M, HULL_VERTICES_MAX, TRIANGLES_MAX};

/// Why a shape cannot be built; each text says what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// A number is NaN or infinite.
    #[error("{what} is {value}: write a finite number")]
    NotFinite {
        /// Which number, e.g. `radius` or `vertex 12`.
        what: String,
        /// The number.
        value: f64,
    },
    /// A size is zero, negative, or outside what can be computed with.
    #[error(
        "{what} is {} m: write a size from {EXTENT_MIN_M:e} to {EXTENT_MAX_M:e} m",
        metres(*.value_m)
    )]
    Extent {
        /// Which size, e.g. `radius`.
        what: String,
        /// The size, metres.
        value_m: f64,
    },
    /// A hull needs four different points.
    #[error("the hull has {given} different points: give at least 4, not all in one plane")]
    TooFewPoints {
        /// How many different points there are.
        given: usize,
    },
    /// All points of a hull lie in one plane (or on one line).
    #[error(
        "the hull is flat ({thickness_m:e} m thick): give points that span a volume, or use a box, a cylinder or a trimesh"
    )]
    FlatHull {
        /// Its least extent found, metres.
        thickness_m: f64,
    },
    /// A hull has more corners than support functions can search.
    #[error(
        "the hull has {given} corners, more than {HULL_VERTICES_MAX}: simplify it, or use a trimesh"
    )]
    TooManyHullVertices {
        /// How many.
        given: usize,
    },
    /// The hull builder failed on these points.
    #[error(
        "the hull of these points cannot be built ({message}): remove nearly equal points, or use a trimesh"
    )]
    Hull {
        /// What it said.
        message: String,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but there are {vertices}: count vertices from 0")]
    IndexOutOfRange {
        /// Index of the face, from 0.
        face: usize,
        /// The index it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A mesh without a triangle, or whose triangles are all degenerate.
    #[error(
        "the mesh has no triangle with an area: give at least one face with three corners that are not in line"
    )]
    EmptyMesh,
    /// More triangles than a mesh may have.
    #[error(
        "the mesh has {}: simplify it, or split it over several bodies",
        .given.map_or(
            format!("more than {TRIANGLES_MAX} triangles"),
            |given| format!("{given} triangles, more than {TRIANGLES_MAX}")
        )
    )]
    TooManyTriangles {
        /// How many; `None`: a file that was not read to its end.
        given: Option<u64>,
    },
    /// A direction without a length.
    #[error("{what} has no length: give a direction that is not (0, 0, 0)")]
    ZeroDirection {
        /// Which direction.
        what: String,
    },
    /// Two settings contradict each other, or one is missing.
    #[error("{0}")]
    Setting(String),
    /// A file that cannot be opened or read.
    #[error("{path}: {message}: check the path (it is relative to the scene file) and its rights")]
    Unreadable {
        /// The file, as it was searched for.
        path: String,
        /// What the system said.
        message: String,
    },
    /// A file whose content does not follow its format.
    #[error("{path}{}: {message}", .line.map_or(String::new(), |line| format!(":{line}")))]
    Format {
        /// The file.
        path: String,
        /// Line, from 1, if the format has lines.
        line: Option<usize>,
        /// What is wrong, and what to change.
        message: String,
    },
    /// A file that was read, and whose geometry cannot be built.
    #[error("{path}: {error}")]
    Content {
        /// The file.
        path: String,
        /// What is wrong with its geometry.
        error: Box<ShapeError>,
    },
}

impl ShapeError {
    /// The same error, attributed to a file.
    pub(super) fn of_file(self, path: &Path) -> Self {
        Self::Content {
            path: path.display().to_string(),
            error: Box::new(self),
        }
    }
}

/// Formats without hundreds of zeros.
fn metres(value: f64) -> String {
    if value == 0.0 || (1e-4..1e16).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

impl From<ShapeError> for Error {
    fn from(error: ShapeError) -> Self {
        Self::Scene(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_says_what_and_what_to_change() {
        let error = ShapeError::Extent {
            what: "radius".to_owned(),
            value_m: -1.0,
        };
        assert_eq!(
            error.to_string(),
            "radius is -1 m: write a size from 1e-9 to 1e9 m"
        );
        let error = ShapeError::Extent {
            what: "radius".to_owned(),
            value_m: 1e-82,
        };
        assert!(error.to_string().starts_with("radius is 1e-82 m: "));
        let error = ShapeError::Format {
            path: "a.obj".to_owned(),
            line: Some(3),
            message: "not a number".to_owned(),
        };
        assert_eq!(error.to_string(), "a.obj:3: not a number");
    }
}
