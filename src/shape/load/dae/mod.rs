//! COLLADA (.dae) 1.4 and 1.5: triangles and polygons of the geometries that the scene instances, each at its node's
//! transform, in the unit and with the up-axis that the file names.
//!
//! Unsupported content (skins, splines, holes, look-at and skew transforms, other files) is refused by name: geometry
//! silently left out would be a collision never seen. Materials, lights, cameras, lines and animations have none.
//!
//! Source: Khronos, "COLLADA - Digital Asset Schema Release 1.4.1" and "1.5.0".

mod geometry;
mod nodes;

use std::collections::BTreeMap;

use roxmltree::{Document, Node, ParsingOptions};

use super::{Flaw, Soup, finite};
use crate::math::Point;

/// Most XML elements and texts of one file: a robot's have some thousands, bulk data counts once.
const XML_NODES_MAX: u32 = 5_000_000;
/// Deepest nesting of elements; a deeper file is no scene, and reading it would need a deep stack.
const XML_DEPTH_MAX: usize = 200;

pub(super) fn parse(bytes: &[u8]) -> Result<Soup, Flaw> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| Flaw::new("this is not UTF-8 text: export the mesh again, as UTF-8"))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    check_depth(bytes)?;
    let options = ParsingOptions {
        nodes_limit: XML_NODES_MAX,
        ..ParsingOptions::default()
    };
    let xml = Document::parse_with_options(text, options).map_err(|e| {
        let line = usize::try_from(e.pos().row).unwrap_or(1);
        Flaw::at(
            line,
            format!("this is not XML ({e}): export the mesh again"),
        )
    })?;
    let root = xml.root_element();
    if root.tag_name().name() != "COLLADA" {
        let text = format!(
            "<{}> is not a COLLADA file: use .dae files",
            root.tag_name().name()
        );
        return Err(flaw(root, text));
    }
    let mut soup = Soup::default();
    let frame = Frame::read(root, &mut soup.warnings)?;
    let file = DaeFile::new(root);
    nodes::instance_all(&file, root, &mut soup)?;
    for vertex in &mut soup.vertices {
        *vertex = frame.to_metres(vertex);
    }
    Ok(soup)
}

/// Refuses deep nesting before the XML reader, which may recurse, sees it. Counts tags roughly: those in comments and
/// texts do not matter here.
fn check_depth(bytes: &[u8]) -> Result<(), Flaw> {
    let mut depth = 0_usize;
    for (at, byte) in bytes.iter().enumerate() {
        let next = bytes.get(at + 1);
        match (byte, next) {
            (b'<', Some(b'/')) => depth = depth.saturating_sub(1),
            (b'<', Some(b'!' | b'?')) => {}
            (b'<', _) => depth += 1,
            (b'/', Some(b'>')) => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > XML_DEPTH_MAX {
            let line = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
            let text = format!(
                "elements stand within each other more than {XML_DEPTH_MAX} deep: export the mesh again"
            );
            return Err(Flaw::at(line, text));
        }
    }
    Ok(())
}

/// The elements of a file by their id.
struct DaeFile<'a> {
    /// `None`: the id occurs twice.
    ids: BTreeMap<&'a str, Option<Node<'a, 'a>>>,
}

impl<'a> DaeFile<'a> {
    fn new(root: Node<'a, 'a>) -> Self {
        let mut ids = BTreeMap::new();
        for node in root.descendants().filter(Node::is_element) {
            if let Some(id) = node.attribute("id") {
                ids.entry(id)
                    .and_modify(|known| *known = None)
                    .or_insert(Some(node));
            }
        }
        Self { ids }
    }

    /// The element that an attribute of `node` refers to.
    fn follow(&self, node: Node<'a, 'a>, attribute: &str) -> Result<Node<'a, 'a>, Flaw> {
        let name = node.tag_name().name();
        let Some(url) = node.attribute(attribute) else {
            return Err(flaw(
                node,
                format!("<{name}> has no {attribute}: export the mesh again"),
            ));
        };
        let Some(id) = url.strip_prefix('#') else {
            let text =
                format!("<{name}> refers to \"{url}\", another file: export all into one file");
            return Err(flaw(node, text));
        };
        match self.ids.get(id) {
            Some(Some(found)) => Ok(*found),
            Some(None) => Err(flaw(
                node,
                format!("<{name}> refers to \"{id}\", which is there twice: rename one"),
            )),
            None => Err(flaw(
                node,
                format!("<{name}> refers to \"{id}\", which is not there: export the mesh again"),
            )),
        }
    }
}

/// The file's unit and up-axis.
struct Frame {
    unit_m: f64,
    up: Up,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Up {
    X,
    Y,
    Z,
}

impl Frame {
    fn read(root: Node<'_, '_>, warnings: &mut Vec<String>) -> Result<Self, Flaw> {
        let asset = child(root, "asset");
        let unit = asset.and_then(|asset| child(asset, "unit"));
        let unit_m = match unit.and_then(|unit| Some((unit, unit.attribute("meter")?))) {
            Some((unit, meter)) => finite(meter.trim()).map_err(|text| flaw(unit, text))?,
            None => 1.0,
        };
        if !(1e-12..=1e12).contains(&unit_m) {
            let text =
                format!("its unit is {unit_m} m: write a length above 0 in <unit meter=\"..\">");
            return Err(Flaw::new(text));
        }
        let up = match asset.and_then(|asset| child(asset, "up_axis")) {
            Some(node) => match node.text().unwrap_or_default().trim() {
                "X_UP" => Up::X,
                "Y_UP" => Up::Y,
                "Z_UP" => Up::Z,
                _ => {
                    return Err(flaw(
                        node,
                        "its up-axis is unknown: write X_UP, Y_UP or Z_UP",
                    ));
                }
            },
            None => {
                warnings
                    .push("its <up_axis> is missing: Y_UP is taken, as COLLADA says".to_owned());
                Up::Y
            }
        };
        // An asset further down may name a different unit; real files at most repeat the first.
        let mut inner = root.descendants().filter(|node| {
            matches!(node.tag_name().name(), "unit" | "up_axis")
                && node.ancestors().nth(2).is_some_and(|up| up != root)
        });
        if let Some(node) = inner.next() {
            let text = "a second unit or up-axis further down: export the mesh with one for all";
            return Err(flaw(node, text));
        }
        Ok(Self { unit_m, up })
    }

    /// Metres, z up. The rows of the specification's table: right, up and towards the viewer.
    fn to_metres(&self, p: &Point) -> Point {
        let turned = match self.up {
            Up::X => Point::new(-p.y, -p.z, p.x),
            Up::Y => Point::new(p.x, -p.z, p.y),
            Up::Z => *p,
        };
        turned * self.unit_m
    }
}

/// An error at an element.
fn flaw(node: Node<'_, '_>, text: impl Into<String>) -> Flaw {
    Flaw::at(line(node), text)
}

fn line(node: Node<'_, '_>) -> usize {
    let position = node.document().text_pos_at(node.range().start);
    usize::try_from(position.row).unwrap_or(1)
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    children(node, name).next()
}

fn children<'a>(node: Node<'a, 'a>, name: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    let name = name.to_owned();
    node.children()
        .filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// All text of an element: a comment in between splits it into parts.
fn text_of(node: Node<'_, '_>) -> String {
    let mut parts = node
        .children()
        .filter(Node::is_text)
        .filter_map(|part| part.text());
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| all + " " + part)
}

/// All numbers of an element.
fn numbers(node: Node<'_, '_>) -> Result<Vec<f64>, Flaw> {
    // The line of a node is counted from the start of the file, so only on error.
    text_of(node)
        .split_ascii_whitespace()
        .map(|word| finite(word).map_err(|text| flaw(node, text)))
        .collect()
}

/// Exactly `N` numbers.
fn exactly<const N: usize>(node: Node<'_, '_>) -> Result<[f64; N], Flaw> {
    let all = numbers(node)?;
    let given = all.len();
    <[f64; N]>::try_from(all).map_err(|_| {
        let name = node.tag_name().name();
        flaw(
            node,
            format!("<{name}> has {given} numbers, not {N}: export the mesh again"),
        )
    })
}

/// An integer attribute.
fn whole(node: Node<'_, '_>, attribute: &str) -> Result<Option<usize>, Flaw> {
    let Some(text) = node.attribute(attribute) else {
        return Ok(None);
    };
    let name = node.tag_name().name();
    let fault = |_| {
        flaw(
            node,
            format!("{attribute} of <{name}> is not a whole number: export the mesh again"),
        )
    };
    text.trim().parse().map(Some).map_err(fault)
}

#[cfg(test)]
mod tests;
