//! Checks of user input, before anything is built: numbers, extents, indices, contradicting settings.

use crate::limits::{COORDINATE_MAX_M, EXTENT_MAX_M, EXTENT_MIN_M, TRIANGLES_MAX};
use crate::shape::{ShapeError, ShapeSpec};

impl ShapeSpec {
    /// Checks the numbers of the spec; files are not read.
    ///
    /// # Errors
    /// The first thing that cannot be built; texts start with the key they refer to.
    pub fn check(&self) -> Result<(), ShapeError> {
        match self {
            Self::Sphere { radius } => extent("radius", *radius),
            Self::Box { half_extents } => half_extents
                .iter()
                .try_for_each(|half| extent("half_extents", *half)),
            Self::Capsule {
                radius,
                half_height,
            } => {
                extent("radius", *radius)?;
                // A capsule of half height 0 is a ball, and legal.
                finite("half_height", *half_height)?;
                if *half_height == 0.0 {
                    return Ok(());
                }
                extent("half_height", *half_height)
            }
            Self::Cylinder {
                radius,
                half_height,
            }
            | Self::Cone {
                radius,
                half_height,
            } => {
                extent("radius", *radius)?;
                extent("half_height", *half_height)
            }
            Self::Convex {
                vertices,
                file,
                scale,
            } => {
                either(vertices.is_empty(), file.as_deref(), *scale)?;
                if file.is_none() && vertices.len() < 4 {
                    return Err(ShapeError::TooFewPoints {
                        given: vertices.len(),
                    });
                }
                points(vertices)
            }
            Self::Triangle { vertices } => {
                points(vertices)?;
                spread("the extent of the triangle", vertices.iter())
            }
            Self::Trimesh {
                vertices,
                faces,
                file,
                scale,
                solid: _,
            } => {
                let inline = !(vertices.is_empty() && faces.is_empty());
                either(!inline, file.as_deref(), *scale)?;
                if inline {
                    points(vertices)?;
                    indices(vertices.len(), faces)?;
                }
                Ok(())
            }
            Self::HalfSpace { normal, offset } => half_space(*normal, *offset),
            Self::HeightField {
                heights,
                size,
                base_m,
            } => {
                size.iter().try_for_each(|side| extent("size", *side))?;
                extent("base_m", *base_m)?;
                grid(heights)
            }
        }
    }
}

/// Inline geometry or a file, exactly one of them; a scale needs a file.
fn either(
    inline_is_empty: bool,
    file: Option<&str>,
    scale: Option<[f64; 3]>,
) -> Result<(), ShapeError> {
    let setting = |text: &str| Err(ShapeError::Setting(text.to_owned()));
    match (inline_is_empty, file) {
        (true, None) => {
            return setting("no geometry: give `vertices` (a trimesh: `faces` too) or `file`");
        }
        (false, Some(_)) => return setting("file beside `vertices`: keep one of them"),
        (true, Some("")) => {
            return setting("file is empty: write a path, relative to the scene file");
        }
        _ => {}
    }
    let Some(scale) = scale else {
        return Ok(());
    };
    if file.is_none() {
        return setting("scale goes with `file`: write the vertices in metres and leave scale out");
    }
    for factor in scale {
        finite("scale", factor)?;
        if !(1e-12..=1e12).contains(&factor.abs()) {
            return Err(ShapeError::Setting(format!(
                "scale is {factor}: write a factor that is not 0, from 1e-12 to 1e12 (negative mirrors)"
            )));
        }
    }
    Ok(())
}

/// Finite.
pub(crate) fn finite(what: &str, value: f64) -> Result<(), ShapeError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(ShapeError::NotFinite {
        what: what.to_owned(),
        value,
    })
}

/// A size within the allowed range.
pub(super) fn extent(what: &str, value_m: f64) -> Result<(), ShapeError> {
    finite(what, value_m)?;
    if (EXTENT_MIN_M..=EXTENT_MAX_M).contains(&value_m) {
        return Ok(());
    }
    Err(ShapeError::Extent {
        what: what.to_owned(),
        value_m,
    })
}

/// Points that all coincide, or have an allowed extent.
pub(crate) fn spread<'a>(
    what: &str,
    vertices: impl Iterator<Item = &'a [f64; 3]>,
) -> Result<(), ShapeError> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for vertex in vertices {
        for k in 0..3 {
            low[k] = low[k].min(vertex[k]);
            high[k] = high[k].max(vertex[k]);
        }
    }
    let sides = high.iter().zip(low).map(|(high, low)| high - low);
    match sides.fold(0.0, f64::max) {
        0.0 => Ok(()),
        side => extent(what, side.min(EXTENT_MAX_M)),
    }
}

/// Points with allowed coordinates.
pub(crate) fn points(vertices: &[[f64; 3]]) -> Result<(), ShapeError> {
    for (place, vertex) in vertices.iter().enumerate() {
        for value in vertex {
            if !value.is_finite() {
                return Err(ShapeError::NotFinite {
                    what: format!("vertices[{place}]"),
                    value: *value,
                });
            }
            if value.abs() > EXTENT_MAX_M {
                return Err(ShapeError::Setting(format!(
                    "vertices[{place}] is {value:e} m from the shape's origin: stay within {EXTENT_MAX_M:e} m"
                )));
            }
        }
    }
    Ok(())
}

/// Faces that name existing vertices.
pub(crate) fn indices(vertices: usize, faces: &[[u32; 3]]) -> Result<(), ShapeError> {
    if faces.is_empty() || vertices == 0 {
        return Err(ShapeError::EmptyMesh);
    }
    if faces.len() > TRIANGLES_MAX {
        return Err(ShapeError::TooManyTriangles {
            given: Some(faces.len() as u64),
        });
    }
    for (face, corners) in faces.iter().enumerate() {
        if let Some(index) = corners.iter().find(|index| **index as usize >= vertices) {
            return Err(ShapeError::IndexOutOfRange {
                face,
                index: *index,
                vertices,
            });
        }
    }
    Ok(())
}

fn half_space(normal: [f64; 3], offset: f64) -> Result<(), ShapeError> {
    normal.iter().try_for_each(|v| finite("normal", *v))?;
    finite("offset", offset)?;
    if normal.iter().all(|v| *v == 0.0) {
        return Err(ShapeError::ZeroDirection {
            what: "normal".to_owned(),
        });
    }
    if offset.abs() > COORDINATE_MAX_M {
        return Err(ShapeError::Setting(format!(
            "offset is {offset:e} m: stay within {COORDINATE_MAX_M:e} m"
        )));
    }
    Ok(())
}

fn grid(heights: &[Vec<f64>]) -> Result<(), ShapeError> {
    let columns = heights.first().map_or(0, Vec::len);
    if heights.len() < 2 || columns < 2 {
        return Err(ShapeError::Setting(format!(
            "heights is {} by {columns}: give at least 2 rows of 2 samples",
            heights.len()
        )));
    }
    for (row, samples) in heights.iter().enumerate() {
        if samples.len() != columns {
            return Err(ShapeError::Setting(format!(
                "heights[{row}] has {} samples, the first row has {columns}: give each row as many",
                samples.len()
            )));
        }
        for height in samples {
            if !height.is_finite() {
                return Err(ShapeError::NotFinite {
                    what: format!("heights[{row}]"),
                    value: *height,
                });
            }
            if height.abs() > EXTENT_MAX_M {
                return Err(ShapeError::Setting(format!(
                    "heights[{row}] holds {height:e} m: stay within {EXTENT_MAX_M:e} m"
                )));
            }
        }
    }
    let triangles = super::height_field::triangles(heights.len(), columns);
    if triangles > TRIANGLES_MAX as u64 {
        return Err(ShapeError::TooManyTriangles {
            given: Some(triangles),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capsule_of_half_height_zero_is_legal_and_a_cylinder_is_not() {
        let capsule = |half_height| ShapeSpec::Capsule {
            radius: 0.1,
            half_height,
        };
        assert_eq!(capsule(0.0).check(), Ok(()));
        assert!(capsule(-0.1).check().is_err());
        assert!(capsule(1e-12).check().is_err());
        let cylinder = ShapeSpec::Cylinder {
            radius: 0.1,
            half_height: 0.0,
        };
        assert!(cylinder.check().is_err());
    }

    #[test]
    fn degenerate_triangles_are_legal_and_wrong_indices_are_not() {
        let triangle = ShapeSpec::Triangle {
            vertices: [[0.2, 0.1, 0.0]; 3],
        };
        assert_eq!(triangle.check(), Ok(()));
        let tiny = |side: f64| ShapeSpec::Triangle {
            vertices: [[0.0; 3], [side, 0.0, 0.0], [0.0, side, 0.0]],
        };
        assert_eq!(tiny(EXTENT_MIN_M).check(), Ok(()));
        let text = tiny(1e-82).check().unwrap_err().to_string();
        assert!(
            text.starts_with("the extent of the triangle is 1e-82 m"),
            "{text}"
        );
        let mesh = ShapeSpec::Trimesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: vec![[0, 1, 3]],
            file: None,
            scale: None,
            solid: None,
        };
        assert_eq!(
            mesh.check(),
            Err(ShapeError::IndexOutOfRange {
                face: 0,
                index: 3,
                vertices: 3
            })
        );
    }
}
