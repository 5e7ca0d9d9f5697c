//! Reads one shape with its pose in the body.
//!
//! In: a node of a scene file or of a request. Out: a checked `PlacedSpec`; files are not opened.

use crate::error::nearest;
use crate::limits::{COORDINATE_MAX_M, QUATERNION_NORM_TOLERANCE, REQUEST_BYTES_MAX};
use crate::math::{Pose, pose_from};
use crate::scene::PlacedSpec;
use crate::scene::node::{Fault, Node, Value};
use crate::scene::table::{Table, list, real, reals, shortened};
use crate::shape::ShapeSpec;

/// Every shape type and its keys.
const TYPES: &[(&str, &[&str])] = &[
    ("sphere", &["radius"]),
    ("box", &["half_extents"]),
    ("capsule", &["radius", "half_height"]),
    ("cylinder", &["radius", "half_height"]),
    ("cone", &["radius", "half_height"]),
    ("convex", &["vertices", "file", "scale"]),
    ("triangle", &["vertices"]),
    ("trimesh", &["vertices", "faces", "file", "scale", "solid"]),
    ("half_space", &["normal", "offset"]),
    ("height_field", &["heights", "size", "base_m"]),
];

/// Keys that every shape has.
const PLACE_KEYS: &[&str] = &["type", "position", "orientation"];

/// Reads a shape.
///
/// * `blobs` - the bytes after the JSON of a request, which `vertices_blob` and `faces_blob` point into.
pub(crate) fn read_shape(node: Node, blobs: Option<&[u8]>) -> Result<PlacedSpec, Fault> {
    let names: Vec<&str> = TYPES.iter().map(|(name, _)| *name).collect();
    let at = node.at;
    let Some(kind) = node.peek_text("type") else {
        if !matches!(node.value, Value::Table(_)) {
            let text = format!("a shape is a table, but here stands {}", node.kind());
            return Err(Fault::new(
                at,
                text + ": write { type = \"sphere\", radius = 0.1 }",
            ));
        }
        let text = format!("a shape needs `type`: write one of {}", names.join(", "));
        return Err(Fault::new(at, text));
    };
    let Some((kind, keys)) = TYPES.iter().find(|(name, _)| *name == kind) else {
        let mend = match nearest(kind, &names) {
            Some(name) => format!("did you mean \"{name}\"?"),
            None => format!("write one of {}", names.join(", ")),
        };
        let text = format!("there is no shape of type \"{}\": {mend}", shortened(kind));
        return Err(Fault::new(at, text));
    };
    let mut known = [PLACE_KEYS, keys].concat();
    if blobs.is_some() {
        known.extend(keys.iter().filter_map(|key| match *key {
            "vertices" if keys.contains(&"file") => Some("vertices_blob"),
            "faces" => Some("faces_blob"),
            _ => None,
        }));
    }
    let mut table = Table::open(node, "this shape", &known)?;
    table.take("type");
    let pose = read_pose(&mut table)?;
    let shape = read_spec(kind, &mut table, blobs)?;
    shape.check().map_err(|e| {
        // The text starts with the key that it is about; the error is reported at the line of that key.
        let text = e.to_string();
        let key = table.places().find(|(key, _)| {
            let rest = text.strip_prefix(key);
            rest.is_some_and(|rest| rest.starts_with([' ', '[']))
        });
        let at = key.map_or(at, |(_, at)| at);
        Fault::new(at, text)
    })?;
    Ok(PlacedSpec { shape, pose })
}

/// Position and orientation, both optional.
pub(crate) fn read_pose(table: &mut Table) -> Result<Pose, Fault> {
    let at = table.at("position");
    let position = table.triple("position")?.unwrap_or_default();
    if let Some(far) = position.iter().find(|x| x.abs() > COORDINATE_MAX_M) {
        let text = format!("position holds {far:e} m: stay within {COORDINATE_MAX_M:e} m");
        return Err(Fault::new(at, text));
    }
    let Some(node) = table.take("orientation") else {
        return Ok(Pose::translation(position[0], position[1], position[2]));
    };
    let at = node.at;
    let xyzw: [f64; 4] = reals(node, "orientation")?;
    let norm = xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
    let is_unit = (norm - 1.0).abs() <= QUATERNION_NORM_TOLERANCE;
    match pose_from(position, xyzw) {
        Some(pose) if is_unit => Ok(pose),
        _ => {
            let text = format!(
                "orientation has length {norm}: write a unit quaternion, in the order x, y, z, w"
            );
            Err(Fault::new(at, text))
        }
    }
}

fn read_spec(kind: &str, table: &mut Table, blobs: Option<&[u8]>) -> Result<ShapeSpec, Fault> {
    Ok(match kind {
        "sphere" => ShapeSpec::Sphere {
            radius: table.number("radius")?,
        },
        "box" => ShapeSpec::Box {
            half_extents: reals(table.need("half_extents")?, "half_extents")?,
        },
        "capsule" => ShapeSpec::Capsule {
            radius: table.number("radius")?,
            half_height: table.number("half_height")?,
        },
        "cylinder" => ShapeSpec::Cylinder {
            radius: table.number("radius")?,
            half_height: table.number("half_height")?,
        },
        "cone" => ShapeSpec::Cone {
            radius: table.number("radius")?,
            half_height: table.number("half_height")?,
        },
        "triangle" => {
            let node = table.need("vertices")?;
            let at = node.at;
            let corners = <[[f64; 3]; 3]>::try_from(read_vertices(node)?)
                .map_err(|_| Fault::new(at, "vertices of a triangle: write 3 points"))?;
            ShapeSpec::Triangle { vertices: corners }
        }
        "half_space" => ShapeSpec::HalfSpace {
            normal: reals(table.need("normal")?, "normal")?,
            offset: table
                .take("offset")
                .map_or(Ok(0.0), |node| real(node, "offset"))?,
        },
        "height_field" => ShapeSpec::HeightField {
            heights: read_heights(table.need("heights")?)?,
            size: reals(table.need("size")?, "size")?,
            base_m: table.number("base_m")?,
        },
        "convex" => ShapeSpec::Convex {
            vertices: take_vertices(table, blobs)?,
            file: table.text("file")?,
            scale: read_scale(table)?,
        },
        _ => ShapeSpec::Trimesh {
            vertices: take_vertices(table, blobs)?,
            faces: take_faces(table, blobs)?,
            file: table.text("file")?,
            scale: read_scale(table)?,
            solid: table.flag("solid")?,
        },
    })
}

/// One factor for all axes, or three.
fn read_scale(table: &mut Table) -> Result<Option<[f64; 3]>, Fault> {
    let Some(node) = table.take("scale") else {
        return Ok(None);
    };
    if matches!(node.value, Value::List(_)) {
        return reals(node, "scale").map(Some);
    }
    let factor = real(node, "scale")?;
    Ok(Some([factor; 3]))
}

fn read_heights(node: Node) -> Result<Vec<Vec<f64>>, Fault> {
    let read_row = |node| -> Result<Vec<f64>, Fault> {
        let samples = list(node, "each row of heights")?;
        samples.into_iter().map(|n| real(n, "heights")).collect()
    };
    list(node, "heights")?.into_iter().map(read_row).collect()
}

fn read_vertices(node: Node) -> Result<Vec<[f64; 3]>, Fault> {
    let mut all = Vec::new();
    for (place, node) in list(node, "vertices")?.into_iter().enumerate() {
        all.push(reals(node, &format_place("vertices", place))?);
    }
    Ok(all)
}

fn format_place(what: &str, place: usize) -> String {
    format!("{what}[{place}]")
}

fn read_faces(node: Node) -> Result<Vec<[u32; 3]>, Fault> {
    let mut all = Vec::new();
    for (place, node) in list(node, "faces")?.into_iter().enumerate() {
        let (at, what) = (node.at, "write three places in `vertices`, counted from 0");
        let fault = || Fault::new(at, format!("faces[{place}]: {what}"));
        let corners = list(node, "a face")?
            .into_iter()
            .map(|node| match node.value {
                Value::Whole(index) => u32::try_from(index).map_err(|_| fault()),
                _ => Err(fault()),
            });
        let corners = corners.collect::<Result<Vec<u32>, Fault>>()?;
        all.push(<[u32; 3]>::try_from(corners).map_err(|_| fault())?);
    }
    Ok(all)
}

fn take_vertices(table: &mut Table, blobs: Option<&[u8]>) -> Result<Vec<[f64; 3]>, Fault> {
    let inline = table.take("vertices").map(read_vertices).transpose()?;
    let blob = take_blob(table, "vertices_blob", 24, blobs)?;
    match (inline, blob) {
        (Some(_), Some(_)) => Err(doubled(table, "vertices")),
        (Some(vertices), None) => Ok(vertices),
        (None, None) => Ok(Vec::new()),
        (None, Some(bytes)) => {
            let vertex = |row: &[u8]| {
                let number = |k: usize| {
                    let mut eight = [0; 8];
                    eight.copy_from_slice(&row[8 * k..8 * k + 8]);
                    f64::from_le_bytes(eight)
                };
                [number(0), number(1), number(2)]
            };
            Ok(bytes.chunks_exact(24).map(vertex).collect())
        }
    }
}

fn take_faces(table: &mut Table, blobs: Option<&[u8]>) -> Result<Vec<[u32; 3]>, Fault> {
    let inline = table.take("faces").map(read_faces).transpose()?;
    let blob = take_blob(table, "faces_blob", 12, blobs)?;
    match (inline, blob) {
        (Some(_), Some(_)) => Err(doubled(table, "faces")),
        (Some(faces), None) => Ok(faces),
        (None, None) => Ok(Vec::new()),
        (None, Some(bytes)) => {
            let face = |row: &[u8]| {
                let index = |k: usize| {
                    let mut four = [0; 4];
                    four.copy_from_slice(&row[4 * k..4 * k + 4]);
                    u32::from_le_bytes(four)
                };
                [index(0), index(1), index(2)]
            };
            Ok(bytes.chunks_exact(12).map(face).collect())
        }
    }
}

fn doubled(table: &Table, key: &str) -> Fault {
    let text = format!("{key} beside {key}_blob: keep one of them");
    Fault::new(table.at(key), text)
}

/// The bytes that `{ offset, count }` names: `count` rows of `row_bytes`, `offset` bytes after the JSON.
fn take_blob<'a>(
    table: &mut Table,
    key: &str,
    row_bytes: u64,
    blobs: Option<&'a [u8]>,
) -> Result<Option<&'a [u8]>, Fault> {
    let (Some(node), Some(blobs)) = (table.take(key), blobs) else {
        return Ok(None);
    };
    let mut place = Table::open(node, "a blob", &["offset", "count"])?;
    let most = REQUEST_BYTES_MAX as u64;
    let need = |found: Option<u64>, what: &str| {
        found.ok_or_else(|| Fault::new(None, format!("{key} needs `{what}`: add it")))
    };
    let offset = need(place.whole("offset", 0, most)?, "offset")?;
    let count = need(place.whole("count", 0, most)?, "count")?;
    // Both are below 2^29, so neither the product nor the sum can overflow.
    let end = offset + count * row_bytes;
    let range = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
    let bytes = range.and_then(|(from, to)| blobs.get(from..to));
    bytes.map(Some).ok_or_else(|| {
        let text = format!(
            "{key} ends at byte {end}, but only {} bytes follow the JSON: check offset (bytes) and count (rows of {row_bytes} bytes)",
            blobs.len()
        );
        Fault::new(None, text)
    })
}
