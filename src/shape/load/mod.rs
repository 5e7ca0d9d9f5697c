//! Mesh files: STL (binary and text), OBJ, DAE. Own readers, because the available ones keep f32 coordinates, ignore a
//! DAE's up-axis, trust any size that a file claims, and cannot report the line of an error.
//!
//! In: a path. Out: vertices in metres, z up, equal ones merged; faces in the file's order, objects one after another.

mod dae;
mod obj;
mod polygon;
mod stl;
mod weld;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::limits::TRIANGLES_MAX;
use crate::math::Point;
use crate::shape::ShapeError;

/// Longest mesh file, bytes: a text STL of the most triangles takes about this.
const FILE_BYTES_MAX: u64 = 1 << 31;

const _: () = assert!(VERTICES_MAX < u32::MAX as usize);

/// Most vertices of one mesh file: three for each triangle, as STL has them.
const VERTICES_MAX: usize = 3 * TRIANGLES_MAX;

/// The contents of a mesh file.
#[derive(Debug, Default)]
pub(crate) struct Soup {
    /// Metres, z up.
    pub(crate) vertices: Vec<Point>,
    /// Indices into `vertices`, counter-clockwise seen from outside; all in range.
    pub(crate) faces: Vec<[u32; 3]>,
    /// Warnings: issues that did not stop the reading.
    pub(crate) warnings: Vec<String>,
}

/// An error in a file: the line, if the format has lines, and what is wrong.
#[derive(Debug)]
struct Flaw {
    line: Option<usize>,
    error: FlawKind,
}

#[derive(Debug)]
enum FlawKind {
    Format(String),
    Shape(ShapeError),
}

impl Flaw {
    fn at(line: usize, message: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            error: FlawKind::Format(message.into()),
        }
    }

    fn new(message: impl Into<String>) -> Self {
        Self {
            line: None,
            error: FlawKind::Format(message.into()),
        }
    }
}

impl From<ShapeError> for Flaw {
    fn from(error: ShapeError) -> Self {
        Self {
            line: None,
            error: FlawKind::Shape(error),
        }
    }
}

impl Soup {
    /// Checks that `more` vertices may be added.
    fn reserve(&self, more: usize) -> Result<(), Flaw> {
        if more <= VERTICES_MAX - self.vertices.len().min(VERTICES_MAX) {
            return Ok(());
        }
        Err(Flaw::new(format!(
            "more than {VERTICES_MAX} vertices: simplify the mesh, or split the file"
        )))
    }

    /// Adds a vertex and returns its index.
    fn vertex(&mut self, vertex: Point) -> Result<u32, Flaw> {
        self.reserve(1)?;
        let place = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        self.vertices.push(vertex);
        Ok(place)
    }

    /// Adds a face, up to the limit.
    fn face(&mut self, face: [u32; 3]) -> Result<(), Flaw> {
        if self.faces.len() == TRIANGLES_MAX {
            return Err(ShapeError::TooManyTriangles { given: None }.into());
        }
        self.faces.push(face);
        Ok(())
    }
}

/// The path of a mesh file, if it exists and is of a known kind.
///
/// * `base` - the folder of the scene file.
///
/// # Errors
/// `Unreadable` for a missing file or a folder, `Format` for an unknown ending.
pub(crate) fn find_mesh(base: &Path, file: &str) -> Result<PathBuf, ShapeError> {
    let path = base.join(file);
    let meta = std::fs::metadata(&path).map_err(|e| unreadable(&path, e.to_string()))?;
    if !meta.is_file() {
        return Err(unreadable(&path, "this is not a file".to_owned()));
    }
    kind(&path)?;
    Ok(path)
}

/// The bytes of a mesh file, and its path.
///
/// * `base` - the folder of the scene file.
///
/// # Errors
/// As [`find_mesh`]; before a file is read whole, `Format` for one that is too long, and `Content` with
/// `TooManyTriangles`.
pub(crate) fn read(base: &Path, file: &str) -> Result<(PathBuf, Arc<[u8]>), ShapeError> {
    let path = find_mesh(base, file)?;
    let bytes = read_whole(&path, kind(&path)?)?;
    Ok((path, bytes.into()))
}

/// Parses a mesh file's bytes.
///
/// * `path` - determines its kind, and names it in messages.
/// * `scale` - factor on each axis of the file's coordinates (after its own unit and up-axis); an odd number of
///   negative factors mirrors, and faces are turned so that outside stays outside.
///
/// # Errors
/// `Format` with the line, `Content` with `TooManyTriangles`, `NotFinite`.
pub(crate) fn load(path: &Path, bytes: &[u8], scale: Option<[f64; 3]>) -> Result<Soup, ShapeError> {
    let mut soup = parse(kind(path)?, bytes).map_err(|flaw| match flaw.error {
        FlawKind::Shape(error) => error.of_file(path),
        FlawKind::Format(message) => ShapeError::Format {
            path: path.display().to_string(),
            line: flaw.line,
            message,
        },
    })?;
    if let Some(scale) = scale {
        scale_by(&mut soup, scale);
    }
    check_finite(&soup, path)?;
    weld::weld(&mut soup);
    Ok(soup)
}

fn parse(kind: Kind, bytes: &[u8]) -> Result<Soup, Flaw> {
    match kind {
        Kind::Stl => stl::parse(bytes),
        Kind::Obj => obj::parse(unmarked(bytes)),
        Kind::Dae => dae::parse(unmarked(bytes)),
    }
}

/// The supported formats.
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

fn unreadable(path: &Path, message: String) -> ShapeError {
    ShapeError::Unreadable {
        path: path.display().to_string(),
        message,
    }
}

/// The bytes of a file; one that is too large is refused by its header.
fn read_whole(path: &Path, kind: Kind) -> Result<Vec<u8>, ShapeError> {
    let failed = |e: std::io::Error| unreadable(path, e.to_string());
    let mut file = File::open(path).map_err(failed)?;
    let size = file.metadata().map_err(failed)?.len();
    let mut bytes = Vec::new();
    if kind == Kind::Stl {
        file.by_ref()
            .take(stl::HEAD_BYTES)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        if let Some(given) = stl::claimed(&bytes).filter(|given| *given > TRIANGLES_MAX as u64) {
            // A count that does not fit into the file is no count.
            return Err(match stl::misfit(given, size) {
                Some(message) => ShapeError::Format {
                    path: path.display().to_string(),
                    line: None,
                    message,
                },
                None => ShapeError::TooManyTriangles { given: Some(given) }.of_file(path),
            });
        }
    }
    if size > FILE_BYTES_MAX {
        return Err(ShapeError::Format {
            path: path.display().to_string(),
            line: None,
            message: format!(
                "the file has {size} bytes, more than {FILE_BYTES_MAX}: simplify the mesh, or split it"
            ),
        });
    }
    // A file that grows while it is read ends at the limit too.
    file.take(FILE_BYTES_MAX)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    Ok(bytes)
}

fn scale_by(soup: &mut Soup, scale: [f64; 3]) {
    for vertex in &mut soup.vertices {
        for (x, factor) in vertex.iter_mut().zip(scale) {
            *x *= factor;
        }
    }
    if scale.iter().filter(|factor| **factor < 0.0).count() % 2 == 1 {
        for face in &mut soup.faces {
            face.swap(1, 2);
        }
    }
}

fn check_finite(soup: &Soup, path: &Path) -> Result<(), ShapeError> {
    let bad = soup
        .vertices
        .iter()
        .flat_map(|v| v.iter())
        .find(|x| !x.is_finite());
    bad.map_or(Ok(()), |value| {
        Err(ShapeError::NotFinite {
            what: format!("{}: a coordinate, scaled,", path.display()),
            value: *value,
        })
    })
}

/// A finite number in a line of a text file.
fn number(word: &str, line: usize) -> Result<f64, Flaw> {
    finite(word).map_err(|text| Flaw::at(line, text))
}

/// A finite number, or what is wrong with it.
fn finite(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => Err(format!("{value} is not finite: export the mesh again")),
        Err(_) => Err(format!(
            "\"{}\" is not a number: mend it, or export the mesh again",
            shown(word)
        )),
    }
}

/// The beginning of a word, as messages show it.
fn shown(word: &str) -> String {
    let head: String = word.chars().take(20).collect();
    head.escape_default().to_string()
}

/// The bytes behind the mark that some editors put in front of a text in UTF-8.
fn unmarked(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// Lines with any line ending: LF, CR LF, or CR alone.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    let text = text.strip_suffix('\n').unwrap_or(text);
    text.split('\n')
        .flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'))
}

#[cfg(test)]
mod tests;
