//! The specification of a shape: the serde type of scene files, edit requests and batch queries.

use serde::{Deserialize, Serialize};

/// A shape as a user writes it, centred on its local origin, metres. Axis of capsule, cylinder, cone: local z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ShapeSpec {
    /// A ball.
    Sphere {
        /// Metres, > 0.
        radius: f64,
    },
    /// A cuboid.
    Box {
        /// Half of each side, metres, > 0.
        half_extents: [f64; 3],
    },
    /// A segment along z with a ball rolled around it.
    Capsule {
        /// Metres, > 0.
        radius: f64,
        /// Half of the segment's length, without the caps, metres, >= 0.
        half_height: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Metres, > 0.
        radius: f64,
        /// Metres, > 0.
        half_height: f64,
    },
    /// A cone along z: apex at `+half_height`, base at `-half_height`.
    Cone {
        /// Of the base, metres, > 0.
        radius: f64,
        /// Metres, > 0.
        half_height: f64,
    },
    /// The solid hull of points: given here, or the vertices of a mesh file.
    Convex {
        /// `[n]`, n >= 4, not all in one plane.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        vertices: Vec<[f64; 3]>,
        /// STL, OBJ or DAE; relative to the scene file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
        /// Factor on each axis of the file's coordinates.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        scale: Option<[f64; 3]>,
    },
    /// One triangle, a surface.
    Triangle {
        /// Its corners.
        vertices: [[f64; 3]; 3],
    },
    /// Triangles: given here, or from a mesh file. Closed and consistently oriented: a solid, else a surface.
    Trimesh {
        /// `[n]` corners.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        vertices: Vec<[f64; 3]>,
        /// `[m]` triples of indices into `vertices`, counter-clockwise seen from outside.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        faces: Vec<[u32; 3]>,
        /// STL, OBJ or DAE; relative to the scene file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
        /// Factor on each axis of the file's coordinates.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        scale: Option<[f64; 3]>,
        /// Whether the inside belongs to it; default: decided by its topology.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        solid: Option<bool>,
    },
    /// All points with `normal . x <= offset`.
    HalfSpace {
        /// Outward, any length but 0.
        normal: [f64; 3],
        /// Along the unit normal, metres.
        #[serde(default)]
        offset: f64,
    },
    /// A solid under a grid of samples, with side walls and a floor.
    HeightField {
        /// `heights[row][column]`, metres: rows along +y, columns along +x, at least 2 by 2.
        heights: Vec<Vec<f64>>,
        /// Full extent along x and y, metres, > 0; centred on the local origin.
        size: [f64; 2],
        /// Height of solid below the least sample, metres, > 0.
        base_m: f64,
    },
}

impl ShapeSpec {
    /// The mesh file that it names, as written.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Convex { file, .. } | Self::Trimesh { file, .. } => file.as_deref(),
            _ => None,
        }
    }

    /// Number of vertices, faces and samples it contains; a file may hold any number.
    #[must_use]
    pub fn size(&self) -> usize {
        match self {
            Self::Convex { file: Some(_), .. } | Self::Trimesh { file: Some(_), .. } => usize::MAX,
            Self::Convex { vertices, .. } => vertices.len(),
            Self::Trimesh {
                vertices, faces, ..
            } => vertices.len() + faces.len(),
            Self::HeightField { heights, .. } => heights.iter().map(Vec::len).sum(),
            _ => 0,
        }
    }
}
