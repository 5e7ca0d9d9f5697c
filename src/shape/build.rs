//! From a spec to a built shape, with its warnings.
//!
//! In: a checked or unchecked `ShapeSpec` and the folder its files are relative to. Out: an `Arc<Shape>`. Not in a
//! tick: a large mesh takes seconds.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::math::{Aabb, Point, Pose, Vec3};
use crate::shape::{Convex, Geometry, Mesh, Shape, ShapeError, ShapeSpec, height_field, load};

/// Sizes outside are worth a warning: millimetres taken for metres are the most common mistake of all, metres.
const USUAL_SIZE_M: std::ops::RangeInclusive<f64> = 1e-3..=100.0;

/// A built shape, with warnings.
#[derive(Clone, Debug)]
pub struct Built {
    /// The shape, shared.
    pub shape: Arc<Shape>,
    /// Issues that did not stop it, each a sentence without the body's name.
    pub warnings: Vec<String>,
    /// A decision where the spec leaves it open: nothing to change.
    pub note: Option<&'static str>,
}

/// Note for a mesh whose spec does not say whether it is a solid (law 3.3).
const SOLID: &str = "solid, because it is closed and consistently oriented";

/// Builds a shape.
///
/// * `base` - the folder that the spec's file is relative to.
///
/// Cost: files are read here; O(n log n) of the triangles.
///
/// # Errors
/// What cannot be built, and what to change; a panic of a hull builder becomes `ShapeError::Hull`.
pub fn build(spec: &ShapeSpec, base: &Path) -> Result<Built, ShapeError> {
    build_by(spec, &mut |file| load::read(base, file))
}

/// Reads a mesh file by name: returns its path and its bytes.
pub(super) type Read<'a> = dyn FnMut(&str) -> Result<(PathBuf, Arc<[u8]>), ShapeError> + 'a;

/// As [`build`], with files read by `read`.
pub(super) fn build_by(spec: &ShapeSpec, read: &mut Read<'_>) -> Result<Built, ShapeError> {
    spec.check()?;
    let mut warnings = Vec::new();
    let shape = match spec {
        ShapeSpec::HalfSpace { normal, offset } => half_space(*normal, *offset),
        ShapeSpec::Trimesh {
            vertices,
            faces,
            file,
            scale,
            solid,
        } => match file {
            Some(file) => {
                let (path, soup) = load_by(read, file, *scale)?;
                warnings.extend(soup.warnings);
                mesh(soup.vertices, soup.faces, *solid, &mut warnings)
                    .map_err(|e| e.of_file(&path))?
            }
            None => mesh(points(vertices), faces.clone(), *solid, &mut warnings)?,
        },
        ShapeSpec::HeightField {
            heights,
            size,
            base_m,
        } => {
            let (vertices, faces) = height_field::mesh(heights, *size, *base_m);
            // That it is a solid needs no warning: it was made as one.
            mesh(vertices, faces, Some(true), &mut Vec::new())?
        }
        _ => convex(spec, read, &mut warnings)?,
    };
    warnings.extend(size_warning(&shape));
    let settled = matches!(spec, ShapeSpec::Trimesh { solid: None, .. });
    let is_solid = matches!(&shape.geometry, Geometry::Mesh(mesh) if mesh.is_solid());
    Ok(Built {
        shape: Arc::new(shape),
        warnings,
        note: (settled && is_solid).then_some(SOLID),
    })
}

fn load_by(
    read: &mut Read<'_>,
    file: &str,
    scale: Option<[f64; 3]>,
) -> Result<(PathBuf, load::Soup), ShapeError> {
    let (path, bytes) = read(file)?;
    let soup = load::load(&path, &bytes, scale)?;
    Ok((path, soup))
}

fn convex(
    spec: &ShapeSpec,
    read: &mut Read<'_>,
    warnings: &mut Vec<String>,
) -> Result<Shape, ShapeError> {
    let convex = match spec {
        ShapeSpec::Sphere { radius } => Convex::sphere(*radius),
        ShapeSpec::Box { half_extents } => Convex::cuboid(Vec3::from(*half_extents)),
        ShapeSpec::Capsule {
            radius,
            half_height,
        } => Convex::capsule(*radius, *half_height),
        ShapeSpec::Cylinder {
            radius,
            half_height,
        } => Convex::cylinder(*radius, *half_height),
        ShapeSpec::Cone {
            radius,
            half_height,
        } => Convex::cone(*radius, *half_height),
        ShapeSpec::Triangle { vertices } => Convex::triangle(vertices.map(Point::from)),
        ShapeSpec::Convex {
            vertices,
            file,
            scale,
        } => match file {
            Some(file) => {
                let (path, soup) = load_by(read, file, *scale)?;
                warnings.extend(soup.warnings);
                hull(&soup.vertices).map_err(|e| e.of_file(&path))?
            }
            None => hull(&points(vertices))?,
        },
        ShapeSpec::HalfSpace { .. } | ShapeSpec::Trimesh { .. } | ShapeSpec::HeightField { .. } => {
            return Err(ShapeError::Setting("this shape is not convex".to_owned()));
        }
    };
    Ok(Shape::of_convex(convex.checked()?))
}

/// The hull of points; whatever a hull builder does with odd input, a user's file must not end the daemon.
fn hull(points: &[Point]) -> Result<Convex, ShapeError> {
    let built = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| Convex::hull(points)));
    built.unwrap_or_else(|_| {
        Err(ShapeError::Hull {
            message: "the hull builder gave up".to_owned(),
        })
    })
}

fn mesh(
    vertices: Vec<Point>,
    faces: Vec<[u32; 3]>,
    solid: Option<bool>,
    warnings: &mut Vec<String>,
) -> Result<Shape, ShapeError> {
    let mesh = Mesh::new(vertices, faces, solid)?;
    warnings.extend_from_slice(mesh.warnings());
    Ok(Shape {
        aabb: mesh.aabb_at(&Pose::identity()),
        centre: mesh.centre(),
        radius: mesh.radius(),
        geometry: Geometry::Mesh(mesh),
    })
}

fn half_space(normal: [f64; 3], offset: f64) -> Shape {
    let normal = Vec3::from(normal);
    // Scaled by its largest component first, so that neither 1e-200 nor 1e200 loses the direction.
    let normal = (normal / normal.amax()).normalize();
    let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
    Shape {
        geometry: Geometry::HalfSpace { normal, offset },
        aabb: Aabb {
            min: Point::new(low, low, low),
            max: Point::new(high, high, high),
        },
        centre: Point::from(normal * offset),
        radius: f64::INFINITY,
    }
}

fn points(vertices: &[[f64; 3]]) -> Vec<Point> {
    vertices.iter().map(|v| Point::from(*v)).collect()
}

/// Warns of a size that is rarely meant.
fn size_warning(shape: &Shape) -> Option<String> {
    // The boxes are rounded outward; a size of exactly 1 mm or 100 m is still usual.
    let size = (shape.aabb.max - shape.aabb.min).amax();
    let slop = 1e-9 * size;
    if !size.is_finite() {
        None
    } else if size + slop < *USUAL_SIZE_M.start() {
        Some(format!(
            "it is {size:.2e} m large, under 1 mm: are its units metres?"
        ))
    } else if size - slop > *USUAL_SIZE_M.end() {
        Some(format!(
            "it is {size:.0} m large, over 100 m: are its units metres?"
        ))
    } else {
        None
    }
}
