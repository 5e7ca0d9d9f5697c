//! One `<geometry>`: its corners in the file's own unit, and its triangles.

use std::collections::BTreeMap;

use roxmltree::Node;

use super::{DaeFile, child, children, flaw, numbers, text_of, whole};
use crate::limits::TRIANGLES_MAX;
use crate::math::Point;
use crate::shape::ShapeError;
use crate::shape::load::{Flaw, polygon, shown};

/// Corners and triangles of a geometry, its own frame and unit.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub(super) vertices: Vec<Point>,
    pub(super) faces: Vec<[u32; 3]>,
}

/// Reads a `<geometry>`.
pub(super) fn read<'a>(file: &DaeFile<'a>, geometry: Node<'a, 'a>) -> Result<Part, Flaw> {
    let Some(mesh) = child(geometry, "mesh") else {
        let text =
            "this geometry is no <mesh> (but a spline, hull or surface): export it as triangles";
        return Err(flaw(geometry, text));
    };
    let mut part = Part::default();
    // Several primitives usually share one list of corners; each list is read once, and stored as its first corner and
    // its length.
    let mut lists: BTreeMap<usize, (u32, usize)> = BTreeMap::new();
    for primitive in mesh.children().filter(Node::is_element) {
        let kind = primitive.tag_name().name();
        match kind {
            "triangles" | "polylist" | "polygons" | "trifans" | "tristrips" => {}
            _ => continue,
        }
        let inputs = Inputs::read(file, primitive)?;
        let source = inputs.positions.id().get_usize();
        let (first, count) = match lists.get(&source) {
            Some(list) => *list,
            None => {
                let first = place(part.vertices.len())?;
                let points = positions(file, inputs.positions)?;
                let list = (first, points.len());
                part.vertices.extend(points);
                lists.insert(source, list);
                list
            }
        };
        let corners = Corners {
            first,
            count,
            inputs: &inputs,
        };
        read_primitive(primitive, kind, &corners, &mut part)?;
    }
    Ok(part)
}

fn place(k: usize) -> Result<u32, Flaw> {
    u32::try_from(k).map_err(|_| Flaw::new("more than 2^32 vertices: split the file"))
}

/// The position's offset among the numbers of a corner, and the list it indexes.
struct Inputs<'a> {
    positions: Node<'a, 'a>,
    offset: usize,
    stride: usize,
}

impl<'a> Inputs<'a> {
    fn read(file: &DaeFile<'a>, primitive: Node<'a, 'a>) -> Result<Self, Flaw> {
        let mut stride = 0;
        let mut found = None;
        for input in children(primitive, "input") {
            let offset = whole(input, "offset")?.unwrap_or(0);
            if offset > 64 {
                return Err(flaw(
                    input,
                    "offset of <input> is above 64: export the mesh again",
                ));
            }
            stride = stride.max(offset + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                found = Some((file.follow(input, "source")?, offset));
            }
        }
        let name = primitive.tag_name().name();
        let Some((vertices, offset)) = found else {
            return Err(flaw(
                primitive,
                format!("<{name}> has no VERTEX input: export the mesh again"),
            ));
        };
        let mut inputs = children(vertices, "input");
        let Some(input) = inputs.find(|input| input.attribute("semantic") == Some("POSITION"))
        else {
            return Err(flaw(
                vertices,
                "<vertices> has no POSITION input: export the mesh again",
            ));
        };
        Ok(Self {
            positions: file.follow(input, "source")?,
            offset,
            stride,
        })
    }
}

/// The corners of a `<source>`.
fn positions<'a>(file: &DaeFile<'a>, source: Node<'a, 'a>) -> Result<Vec<Point>, Flaw> {
    let common = child(source, "technique_common");
    let Some(accessor) = common.and_then(|common| child(common, "accessor")) else {
        return Err(flaw(
            source,
            "<source> of the corners has no <accessor>: export the mesh again",
        ));
    };
    let array = file.follow(accessor, "source")?;
    let values = numbers(array)?;
    if let Some(count) = whole(array, "count")?.filter(|count| *count != values.len()) {
        let text = format!(
            "the array says {count} numbers and has {}: it is cut off or damaged, export the mesh again",
            values.len()
        );
        return Err(flaw(array, text));
    }
    // Parameters without a name are skipped, and X, Y, Z may stand in any order.
    let params: Vec<Option<&str>> = children(accessor, "param")
        .map(|param| param.attribute("name"))
        .collect();
    let named = |name: &str| params.iter().position(|known| *known == Some(name));
    let axes = match (named("X"), named("Y"), named("Z")) {
        (Some(x), Some(y), Some(z)) => [x, y, z],
        _ if params.is_empty() || params.iter().all(Option::is_none) => [0, 1, 2],
        _ => {
            return Err(flaw(
                accessor,
                "the corners are not X, Y, Z: export the mesh again",
            ));
        }
    };
    let stride = whole(accessor, "stride")?;
    let offset = whole(accessor, "offset")?.unwrap_or(0);
    let count = whole(accessor, "count")?.unwrap_or(0);
    let [x, y, z] = axes;
    let reach = x.max(y).max(z);
    // COLLADA's default.
    let step = stride.unwrap_or(1);
    if step <= reach {
        let said = stride.map_or("no stride, which means 1".to_owned(), |stride| {
            format!("stride {stride}")
        });
        let text = format!(
            "the accessor has {said}, but a corner takes {} numbers: export the mesh again",
            reach + 1
        );
        return Err(flaw(accessor, text));
    }
    if count == 0 {
        return Ok(Vec::new());
    }
    let last = (count - 1)
        .checked_mul(step)
        .and_then(|at| at.checked_add(offset)?.checked_add(reach));
    if last.is_none_or(|last| last >= values.len()) {
        let text = format!(
            "the accessor counts {count} corners, more than its array holds: export the mesh again"
        );
        return Err(flaw(accessor, text));
    }
    let corners = values[offset..].chunks(step).take(count);
    Ok(corners.map(|v| Point::new(v[x], v[y], v[z])).collect())
}

/// How numbers of a primitive map to corners of the part.
struct Corners<'a> {
    first: u32,
    count: usize,
    inputs: &'a Inputs<'a>,
}

impl Corners<'_> {
    /// The corners named by a `<p>`.
    fn read(&self, p: Node<'_, '_>) -> Result<Vec<u32>, Flaw> {
        let text = text_of(p);
        let mut all = Vec::new();
        let mut words = 0;
        for word in text.split_ascii_whitespace() {
            if words % self.inputs.stride == self.inputs.offset {
                let index = word
                    .parse::<u32>()
                    .ok()
                    .filter(|index| (*index as usize) < self.count);
                let Some(index) = index else {
                    let text = format!(
                        "a face names corner \"{}\", but there are {}: export the mesh again",
                        shown(word),
                        self.count
                    );
                    return Err(flaw(p, text));
                };
                all.push(self.first + index);
            }
            words += 1;
        }
        if words % self.inputs.stride != 0 {
            let text = format!(
                "{words} numbers are no whole corners of {}: export the mesh again",
                self.inputs.stride
            );
            return Err(flaw(p, text));
        }
        Ok(all)
    }
}

fn read_primitive<'a>(
    primitive: Node<'a, 'a>,
    kind: &str,
    corners: &Corners<'_>,
    part: &mut Part,
) -> Result<(), Flaw> {
    if let Some(holes) = child(primitive, "ph") {
        return Err(flaw(
            holes,
            "polygons with holes are not read: export the mesh as triangles",
        ));
    }
    let claimed = whole(primitive, "count")?;
    let vcount = child(primitive, "vcount");
    let mut counted = 0;
    for p in children(primitive, "p") {
        let list = corners.read(p)?;
        match kind {
            "triangles" => {
                let (faces, rest) = list.as_chunks::<3>();
                if !rest.is_empty() {
                    return Err(flaw(
                        p,
                        format!(
                            "{} corners are no whole triangles: export the mesh again",
                            list.len()
                        ),
                    ));
                }
                counted += faces.len();
                add(part, faces.iter().copied())?;
            }
            "polylist" => {
                let Some(vcount) = vcount else {
                    return Err(flaw(
                        primitive,
                        "<polylist> has no <vcount>: export the mesh again",
                    ));
                };
                counted += read_polylist(vcount, p, &list, part)?;
            }
            "polygons" => {
                counted += 1;
                let faces = cut(part, &list, p)?;
                add(part, faces)?;
            }
            "trifans" => {
                counted += 1;
                add(
                    part,
                    (2..list.len()).map(|k| [list[0], list[k - 1], list[k]]),
                )?;
            }
            _ => {
                counted += 1;
                // Every second triangle of a strip faces the other way.
                add(
                    part,
                    (2..list.len()).map(|k| match k % 2 {
                        0 => [list[k - 2], list[k - 1], list[k]],
                        _ => [list[k - 1], list[k - 2], list[k]],
                    }),
                )?;
            }
        }
    }
    if let Some(claimed) = claimed.filter(|claimed| *claimed != counted) {
        let text = format!(
            "<{kind}> says {claimed} and has {counted}: it is cut off or damaged, export the mesh again"
        );
        return Err(flaw(primitive, text));
    }
    Ok(())
}

fn read_polylist<'a>(
    vcount: Node<'a, 'a>,
    p: Node<'a, 'a>,
    list: &[u32],
    part: &mut Part,
) -> Result<usize, Flaw> {
    let text = text_of(vcount);
    let mut rest = list;
    let mut counted = 0;
    for word in text.split_ascii_whitespace() {
        let count = word
            .parse::<usize>()
            .ok()
            .filter(|count| *count <= rest.len());
        let Some((polygon, tail)) = count.map(|count| rest.split_at(count)) else {
            return Err(flaw(
                vcount,
                "<vcount> and <p> do not fit together: export the mesh again",
            ));
        };
        let faces = cut(part, polygon, vcount)?;
        add(part, faces)?;
        rest = tail;
        counted += 1;
    }
    if !rest.is_empty() {
        return Err(flaw(
            p,
            "<p> has corners that <vcount> does not count: export the mesh again",
        ));
    }
    Ok(counted)
}

fn cut(part: &Part, corners: &[u32], at: Node<'_, '_>) -> Result<Vec<[u32; 3]>, Flaw> {
    if corners.len() < 3 {
        let text = format!(
            "a face has {} corners: export the mesh as triangles",
            corners.len()
        );
        return Err(flaw(at, text));
    }
    polygon::cut(&part.vertices, corners).map_err(|text| flaw(at, text))
}

fn add(part: &mut Part, faces: impl IntoIterator<Item = [u32; 3]>) -> Result<(), Flaw> {
    for face in faces {
        if part.faces.len() == TRIANGLES_MAX {
            return Err(ShapeError::TooManyTriangles { given: None }.into());
        }
        part.faces.push(face);
    }
    Ok(())
}
