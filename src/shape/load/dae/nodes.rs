//! The tree of nodes: which geometry is placed where.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Unit};
use roxmltree::Node;

use super::geometry::{self, Part};
use super::{DaeFile, child, children, exactly, flaw};
use crate::math::{Point, Vec3};
use crate::shape::load::{Flaw, Soup};

/// Most nodes visited: instances of instances can multiply without end.
const VISITS_MAX: usize = 1_000_000;
/// Deepest nesting of nodes, instances included.
const DEPTH_MAX: usize = 200;

struct Walk<'a, 'f> {
    file: &'f DaeFile<'a>,
    /// By the number of the geometry's element.
    parts: BTreeMap<usize, Part>,
    visits: usize,
    soup: &'f mut Soup,
}

/// Places every geometry of the scene; without a scene, every geometry as it is.
pub(super) fn instance_all<'a>(
    file: &DaeFile<'a>,
    root: Node<'a, 'a>,
    soup: &mut Soup,
) -> Result<(), Flaw> {
    let mut walk = Walk {
        file,
        parts: BTreeMap::new(),
        visits: 0,
        soup,
    };
    let geometries: Vec<Node<'a, 'a>> = children(root, "library_geometries")
        .flat_map(|library| children(library, "geometry"))
        .collect();
    let Some(scene) = visual_scene(file, root)? else {
        for geometry in geometries {
            walk.instance(geometry, &Matrix4::identity())?;
        }
        return Ok(());
    };
    for node in children(scene, "node") {
        walk.visit(node, Matrix4::identity(), 0)?;
    }
    let left_out = geometries
        .iter()
        .filter(|geometry| !walk.parts.contains_key(&geometry.id().get_usize()))
        .count();
    if left_out > 0 {
        let text = format!(
            "{left_out} of its {} geometries are not in its scene and were left out",
            geometries.len()
        );
        walk.soup.warnings.push(text);
    }
    Ok(())
}

/// The scene that the file shows; if it names none, the only one.
fn visual_scene<'a>(file: &DaeFile<'a>, root: Node<'a, 'a>) -> Result<Option<Node<'a, 'a>>, Flaw> {
    let scene = child(root, "scene");
    if let Some(instance) = scene.and_then(|scene| child(scene, "instance_visual_scene")) {
        return file.follow(instance, "url").map(Some);
    }
    let mut scenes = children(root, "library_visual_scenes")
        .flat_map(|library| children(library, "visual_scene"));
    let first = scenes.next();
    if let Some(second) = scenes.next() {
        return Err(flaw(
            second,
            "several visual scenes, and no <scene> says which: export one",
        ));
    }
    Ok(first)
}

impl<'a> Walk<'a, '_> {
    fn visit(
        &mut self,
        node: Node<'a, 'a>,
        mut place: Matrix4<f64>,
        depth: usize,
    ) -> Result<(), Flaw> {
        self.visits += 1;
        if depth > DEPTH_MAX || self.visits > VISITS_MAX {
            return Err(flaw(
                node,
                "its nodes are too deep, too many or in a loop: export the mesh as one object",
            ));
        }
        for part in node.children().filter(Node::is_element) {
            if let Some(step) = transform(part)? {
                place *= step;
            }
        }
        for part in node.children().filter(Node::is_element) {
            match part.tag_name().name() {
                "node" => self.visit(part, place, depth + 1)?,
                "instance_node" => {
                    let target = self.file.follow(part, "url")?;
                    self.visit(target, place, depth + 1)?;
                }
                "instance_geometry" => {
                    let geometry = self.file.follow(part, "url")?;
                    self.instance(geometry, &place)?;
                }
                "instance_controller" => {
                    let text = "skinned and morphed meshes are not read: export the mesh without its skeleton";
                    return Err(flaw(part, text));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Adds a geometry at a transform.
    fn instance(&mut self, geometry: Node<'a, 'a>, place: &Matrix4<f64>) -> Result<(), Flaw> {
        if geometry.tag_name().name() != "geometry" {
            let text = format!(
                "<{}> stands where a <geometry> is meant: export the mesh again",
                geometry.tag_name().name()
            );
            return Err(flaw(geometry, text));
        }
        if !self.parts.contains_key(&geometry.id().get_usize()) {
            let part = geometry::read(self.file, geometry)?;
            self.parts.insert(geometry.id().get_usize(), part);
        }
        let Some(part) = self.parts.get(&geometry.id().get_usize()) else {
            return Ok(());
        };
        self.soup.reserve(part.vertices.len())?;
        let first = place_of(self.soup.vertices.len());
        let is_identity = *place == Matrix4::identity();
        let moved = part.vertices.iter().map(|p| {
            // As written if nothing moves it: no rounding.
            if is_identity {
                *p
            } else {
                Point::from((place * p.to_homogeneous()).xyz())
            }
        });
        self.soup.vertices.extend(moved);
        let mirrors = place.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for face in &part.faces {
            let [a, b, c] = face.map(|corner| first + corner);
            self.soup
                .face(if mirrors { [a, c, b] } else { [a, b, c] })?;
        }
        Ok(())
    }
}

/// As an index of a face; `Soup::reserve` has checked that it fits.
fn place_of(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

/// The matrix of a transform element, for column vectors; `None` for other elements.
fn transform(node: Node<'_, '_>) -> Result<Option<Matrix4<f64>>, Flaw> {
    Ok(Some(match node.tag_name().name() {
        "matrix" => {
            let rows: [f64; 16] = exactly(node)?;
            if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
                return Err(flaw(
                    node,
                    "the last row of <matrix> is not 0 0 0 1: export the mesh again",
                ));
            }
            Matrix4::from_row_slice(&rows)
        }
        "translate" => Matrix4::new_translation(&Vec3::from(exactly::<3>(node)?)),
        "scale" => Matrix4::new_nonuniform_scaling(&Vec3::from(exactly::<3>(node)?)),
        "rotate" => {
            let [x, y, z, degrees] = exactly(node)?;
            let Some(axis) = Unit::try_new(Vec3::new(x, y, z), 0.0) else {
                return Err(flaw(node, "<rotate> has no axis: export the mesh again"));
            };
            nalgebra::Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
        }
        name @ ("lookat" | "skew") => {
            return Err(flaw(
                node,
                format!("<{name}> is not read: apply the transforms before the export"),
            ));
        }
        _ => return Ok(None),
    }))
}
