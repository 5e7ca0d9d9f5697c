//! Wavefront OBJ: vertices and polygons; colours, normals, textures, materials, groups, lines and points are skipped.

use super::{Flaw, Soup, lines, number, polygon, shown};
use crate::math::Point;

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

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Flaw> {
    // Names are in any encoding; everything else is ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut soup = Soup::default();
    let mut corners: Vec<u32> = Vec::new();
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
        read_row(row, place + 1, &mut soup, &mut corners)?;
    }
    Ok(soup)
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

fn read_row(row: &str, line: usize, soup: &mut Soup, corners: &mut Vec<u32>) -> Result<(), Flaw> {
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
            soup.vertex(Point::from(place))?;
            Ok(())
        }
        Some("f" | "fo") => {
            corners.clear();
            for word in words {
                corners.push(corner(word, line, soup.vertices.len())?);
            }
            if corners.len() < 3 {
                let text = format!(
                    "a face has {} corners: write 3 or more, or export the mesh again",
                    corners.len()
                );
                return Err(Flaw::at(line, text));
            }
            let faces =
                polygon::cut(&soup.vertices, corners).map_err(|text| Flaw::at(line, text))?;
            faces.into_iter().try_for_each(|face| soup.face(face))
        }
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

/// The index of the vertex in `v`, `v/vt`, `v//vn` or `v/vt/vn`: from 1, or from -1 backwards.
fn corner(word: &str, line: usize, vertices: usize) -> Result<u32, Flaw> {
    let index = word.split('/').next().unwrap_or_default();
    let place = index.parse::<i64>().ok().and_then(|index| {
        let index = usize::try_from(index.unsigned_abs())
            .ok()
            .map(|size| (index > 0, size));
        match index? {
            (_, 0) => None,
            (true, from_start) => Some(from_start - 1),
            (false, from_end) => vertices.checked_sub(from_end),
        }
    });
    let place = place.filter(|place| *place < vertices);
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
