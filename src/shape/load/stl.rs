//! STL, binary and text.

use super::{Flaw, Soup, lines, number, shown, unmarked};
use crate::math::Point;

/// Header and count of a binary file, bytes.
pub(super) const HEAD_BYTES: u64 = 84;
/// One triangle of a binary file: normal, three corners, two bytes of attribute.
const TRIANGLE_BYTES: usize = 50;

/// Number of triangles that a binary file claims; `None` for a text.
pub(super) fn claimed(bytes: &[u8]) -> Option<u64> {
    let head = bytes.get(..84)?;
    if is_text(unmarked(head)) {
        return None;
    }
    let count: [u8; 4] = head[80..].try_into().ok()?;
    Some(u64::from(u32::from_le_bytes(count)))
}

/// The error of a binary file whose size does not match its count.
///
/// * `size` - of the whole file, bytes.
pub(super) fn misfit(count: u64, size: u64) -> Option<String> {
    let expected = HEAD_BYTES + count * TRIANGLE_BYTES as u64;
    // Some exporters append a line end after the last triangle.
    let fits = size.checked_sub(expected).is_some_and(|extra| extra <= 2);
    (!fits).then(|| {
        format!(
            "the header says {count} triangles, which take {expected} bytes, but the file has {size}: it is cut off, \
             damaged or no STL, export the mesh again"
        )
    })
}

/// Whether this is the head of a text file. Binary headers may begin with `solid` too, but a text has no control
/// characters except white space.
fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(84)];
    let is_plain = head.iter().all(|b| *b >= b' ' || b.is_ascii_whitespace());
    let word: Vec<u8> = head
        .iter()
        .skip_while(|b| b.is_ascii_whitespace())
        .take(5)
        .map(u8::to_ascii_lowercase)
        .collect();
    word == b"solid" && is_plain
}

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Flaw> {
    let fits = |count: &u64| bytes.len() as u64 == HEAD_BYTES + count * TRIANGLE_BYTES as u64;
    // A header of plain text whose count and size agree is binary nevertheless.
    let raw_count = bytes.get(80..84).and_then(|b| <[u8; 4]>::try_from(b).ok());
    let is_binary = raw_count.is_some_and(|raw| fits(&u64::from(u32::from_le_bytes(raw))));
    // The header of a binary file may hold any bytes, those of a mark too.
    let text = unmarked(bytes);
    if !is_binary && is_text(text) {
        return parse_text(text);
    }
    let Some(raw) = raw_count else {
        return Err(Flaw::new(format!(
            "{} bytes are neither a text STL (it begins with \"solid\") nor a binary one (84 bytes and more): export the mesh again",
            bytes.len()
        )));
    };
    let count = u64::from(u32::from_le_bytes(raw));
    if let Some(text) = misfit(count, bytes.len() as u64) {
        return Err(Flaw::new(text));
    }
    let mut soup = Soup::default();
    for row in bytes[84..].chunks_exact(TRIANGLE_BYTES) {
        let coordinate = |k: usize| {
            let mut four = [0; 4];
            four.copy_from_slice(&row[12 + 4 * k..16 + 4 * k]);
            f64::from(f32::from_le_bytes(four))
        };
        let mut face = [0; 3];
        for (corner, slot) in face.iter_mut().enumerate() {
            let at = 3 * corner;
            *slot = soup.vertex(Point::new(
                coordinate(at),
                coordinate(at + 1),
                coordinate(at + 2),
            ))?;
        }
        soup.face(face)?;
    }
    Ok(soup)
}

/// The words of a text file with their lines.
struct Words<'a, L> {
    /// With their line numbers.
    lines: L,
    words: std::str::SplitAsciiWhitespace<'a>,
    line: usize,
}

impl<'a, L: Iterator<Item = (usize, &'a str)>> Words<'a, L> {
    fn next(&mut self) -> Option<&'a str> {
        loop {
            if let Some(word) = self.words.next() {
                return Some(word);
            }
            let (line, text) = self.lines.next()?;
            self.line = line + 1;
            self.words = text.split_ascii_whitespace();
        }
    }

    fn skip_line(&mut self) {
        self.words = "".split_ascii_whitespace();
    }

    fn expect(&mut self, wanted: &str) -> Result<(), Flaw> {
        match self.next() {
            Some(word) if word.eq_ignore_ascii_case(wanted) => Ok(()),
            found => Err(self.unexpected(found, wanted)),
        }
    }

    fn unexpected(&self, found: Option<&str>, wanted: &str) -> Flaw {
        let text = match found {
            Some(word) => {
                format!(
                    "expected `{wanted}`, found \"{}\": the file is damaged, export the mesh again",
                    shown(word)
                )
            }
            None => {
                format!("the file ends before `{wanted}`: it is cut off, export the mesh again")
            }
        };
        Flaw::at(self.line, text)
    }
}

fn parse_text(bytes: &[u8]) -> Result<Soup, Flaw> {
    // Names after `solid` are in any encoding; everything else is ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut words = Words {
        lines: lines(&text).enumerate(),
        words: "".split_ascii_whitespace(),
        line: 1,
    };
    let mut soup = Soup::default();
    while let Some(word) = words.next() {
        if !word.eq_ignore_ascii_case("solid") {
            return Err(words.unexpected(Some(word), "solid"));
        }
        words.skip_line();
        loop {
            match words.next() {
                Some(word) if word.eq_ignore_ascii_case("facet") => {
                    read_facet(&mut words, &mut soup)?
                }
                Some(word) if word.eq_ignore_ascii_case("endsolid") => break,
                found => return Err(words.unexpected(found, "facet or endsolid")),
            }
        }
        words.skip_line();
    }
    Ok(soup)
}

/// The rest of a `facet`: a normal, which is not used, and a loop of three corners.
fn read_facet<'a>(
    words: &mut Words<'a, impl Iterator<Item = (usize, &'a str)>>,
    soup: &mut Soup,
) -> Result<(), Flaw> {
    words.expect("normal")?;
    for _ in 0..3 {
        let found = words.next();
        found.ok_or_else(|| words.unexpected(None, "a normal"))?;
    }
    words.expect("outer")?;
    words.expect("loop")?;
    let mut face = [0; 3];
    for slot in &mut face {
        words.expect("vertex")?;
        let mut place = [0.0; 3];
        for x in &mut place {
            let word = words.next();
            let word = word.ok_or_else(|| words.unexpected(None, "a coordinate"))?;
            *x = number(word, words.line)?;
        }
        *slot = soup.vertex(Point::from(place))?;
    }
    words.expect("endloop")?;
    words.expect("endfacet")?;
    soup.face(face)
}
