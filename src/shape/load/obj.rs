//! Wavefront OBJ: vertices and polygons; colours, normals, textures, materials, groups, lines and points are skipped.

use super::{Flaw, Soup, VERTICES_MAX, lines, number, polygon, shown};
use crate::limits::TRIANGLES_MAX;
use crate::math::Point;
use crate::shape::ShapeError;

/// Keywords that carry no surface.
const SKIPPED: &[&str] = &[
    "vt",
    "vn",
    "vp",
    "o",
    "g",
    "s",
    "mg",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "l",
    "p",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
];

/// What is read so far.
#[derive(Default)]
struct Reader {
    soup: Soup,
    /// Of the face at hand: places of its vertices.
    corners: Vec<u32>,
    waiting: Waiting,
}

/// Faces that name vertices which stand further down, as they may, and all faces behind these: they keep their order.
#[derive(Default)]
struct Waiting {
    /// Places of their vertices, one face after another.
    corners: Vec<u32>,
    /// Line of each face, and where its corners end.
    faces: Vec<(usize, usize)>,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Flaw> {
    // Names are in any encoding; everything else is ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::default();
    let mut joined = String::new();
    let mut lines = lines(&text).enumerate();
    while let Some((place, line)) = lines.next() {
        let (mut row, mut goes_on) = cut(line);
        if goes_on {
            joined.clear();
            joined.push_str(row);
            while goes_on {
                let next = lines.next().map_or("", |(_, next)| next);
                (row, goes_on) = cut(next);
                joined.push(' ');
                joined.push_str(row);
            }
            row = &joined;
        }
        reader.read_row(row, place + 1)?;
    }
    reader.close()
}

/// The content of a line, and whether a backslash at its end joins the next line. One at the end of a comment does not:
/// it is part of the comment.
fn cut(line: &str) -> (&str, bool) {
    if let Some((row, _)) = line.split_once('#') {
        return (row, false);
    }
    match line.trim_end().strip_suffix('\\') {
        Some(row) => (row, true),
        None => (line, false),
    }
}

impl Reader {
    fn read_row(&mut self, row: &str, line: usize) -> Result<(), Flaw> {
        let mut words = row.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut place = [0.0; 3];
                for x in &mut place {
                    let word = words.next().ok_or_else(|| {
                        Flaw::at(
                            line,
                            "a vertex has three coordinates: mend it, or export the mesh again",
                        )
                    })?;
                    *x = number(word, line)?;
                }
                self.soup.vertex(Point::from(place))?;
                Ok(())
            }
            Some("f" | "fo") => self.read_face(words, line),
            None => Ok(()),
            Some(word) if SKIPPED.contains(&word) => Ok(()),
            Some(word) => {
                let text = format!(
                    "\"{}\" is not read (free-form surfaces are not): export the mesh as triangles",
                    shown(word)
                );
                Err(Flaw::at(line, text))
            }
        }
    }

    /// Adds a face, or lets it wait until all vertices are read.
    fn read_face<'a>(
        &mut self,
        words: impl Iterator<Item = &'a str>,
        line: usize,
    ) -> Result<(), Flaw> {
        let vertices = self.soup.vertices.len();
        self.corners.clear();
        for word in words {
            self.corners.push(corner(word, line, vertices)?);
        }
        if self.corners.len() < 3 {
            let text = format!(
                "a face has {} corners: write 3 or more, or export the mesh again",
                self.corners.len()
            );
            return Err(Flaw::at(line, text));
        }
        let is_ahead = self.corners.iter().any(|place| *place as usize >= vertices);
        if !is_ahead && self.waiting.faces.is_empty() {
            return add(&mut self.soup, &self.corners, line);
        }
        let waiting = &mut self.waiting;
        waiting.corners.extend_from_slice(&self.corners);
        waiting.faces.push((line, waiting.corners.len()));
        // As many as of all triangles that may be; a polygon has fewer corners than its triangles have.
        if waiting.corners.len() > 3 * TRIANGLES_MAX {
            return Err(ShapeError::TooManyTriangles { given: None }.into());
        }
        Ok(())
    }

    /// Adds the faces that waited.
    fn close(mut self) -> Result<Soup, Flaw> {
        let vertices = self.soup.vertices.len();
        let mut from = 0;
        for &(line, to) in &self.waiting.faces {
            let corners = &self.waiting.corners[from..to];
            if let Some(place) = corners.iter().find(|place| **place as usize >= vertices) {
                let index = u64::from(*place) + 1;
                let text = format!(
                    "the face names vertex \"{index}\", but the file has {vertices}: count from 1"
                );
                return Err(Flaw::at(line, text));
            }
            add(&mut self.soup, corners, line)?;
            from = to;
        }
        Ok(self.soup)
    }
}

/// Adds a face all of whose vertices are there.
fn add(soup: &mut Soup, corners: &[u32], line: usize) -> Result<(), Flaw> {
    let faces = polygon::cut(&soup.vertices, corners).map_err(|text| Flaw::at(line, text))?;
    faces.into_iter().try_for_each(|face| soup.face(face))
}

/// The index of the vertex in `v`, `v/vt`, `v//vn` or `v/vt/vn`: from 1, or from -1 backwards.
///
/// * `vertices` - how many stand before it.
fn corner(word: &str, line: usize, vertices: usize) -> Result<u32, Flaw> {
    let index = word.split('/').next().unwrap_or_default();
    let place = index.parse::<i64>().ok().and_then(|index| {
        let size = usize::try_from(index.unsigned_abs()).ok()?;
        match (index > 0, size) {
            (_, 0) => None,
            // That there are so many is seen at the end.
            (true, from_start) => Some(from_start - 1).filter(|place| *place < VERTICES_MAX),
            (false, from_end) => vertices.checked_sub(from_end),
        }
    });
    place
        .and_then(|place| u32::try_from(place).ok())
        .ok_or_else(|| {
            let text = format!(
                "the face names vertex \"{}\", but {vertices} came before it: count from 1",
                shown(word)
            );
            Flaw::at(line, text)
        })
}
