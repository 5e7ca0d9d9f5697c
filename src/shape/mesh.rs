//! Mesh geometry: triangles, and whether they bound a solid.
//!
//! In: vertices and faces as read or generated. Out: an immutable mesh with its tree, its shells, its bounds and the
//! warnings that `check` shows.

mod adjacency;
mod balls;
mod deform;
mod inside;
mod normals;
mod obb;
mod outline;
mod places;
mod predicates;
mod rings;
mod seams;
mod topology;
mod trails;
mod tree;
mod turn;
mod walks;

use deform::Deform;
pub(crate) use deform::{NewTree, NoVertex, TreeJob, can_be_vertices};
pub(crate) use inside::Inside;
pub(crate) use normals::Cone;
pub(crate) use obb::{BoxId, Held, Obb, ObbPack, ObbTree};
pub(crate) use predicates::{side, turn_yz};
use tree::Tree;
pub(crate) use tree::{Below, NODES_WAITING_MAX, Node};

use adjacency::Adjacency;
pub(crate) use balls::{Ball, Balls};
use normals::Normals;
use outline::{Outline, radius};
use rings::Rings;
use topology::Topology;
pub(crate) use trails::Trails;
pub(crate) use walks::Climb;

use crate::limits::{EXTENT_MAX_M, EXTENT_MIN_M, TRIANGLES_MAX};
use crate::math::{Aabb, Point, Pose, ROUND, Vec3};
use crate::shape::ShapeError;

/// With more vertices than this a table of directions gives the box at a pose.
const OUTLINE_VERTICES_MIN: usize = 24;

/// Triangles in their own frame: a solid when they are closed and face consistently, else a surface.
#[derive(Clone, Debug)]
pub struct Mesh {
    vertices: Vec<Point>,
    faces: Vec<[u32; 3]>,
    solid: bool,
    shells: Vec<u32>,
    warnings: Vec<String>,
    tree: Tree,
    /// Oriented boxes, for pairs of surfaces; the other tree serves rays, planes and extents, where its boxes are as
    /// good at a quarter of the size.
    obb: ObbTree,
    /// Boxed, so that it does not enlarge shapes that are no meshes.
    adjacency: Box<Adjacency>,
    /// The neighbours of each vertex; boxed as well.
    rings: Box<Rings>,
    /// The normals of the faces under each oriented box; boxed as well.
    normals: Box<Normals>,
    /// Inner balls; none for a surface, or a mesh that deforms.
    balls: Option<Box<Balls>>,
    /// None for a small mesh, whose vertices are iterated.
    outline: Option<Outline>,
    /// Its box; for one that deforms it also contains the vertices that no face names.
    bounds: Aabb,
    centre: Point,
    radius: f64,
    /// None for a rigid mesh. If there is one, `obb` is the only tree and there is no outline.
    deform: Option<Box<Deform>>,
}

impl Mesh {
    /// Builds a mesh.
    ///
    /// * `vertices` - own frame, metres.
    /// * `faces` - indices into `vertices`, counter-clockwise seen from outside.
    /// * `solid` - whether the inside belongs to it; `None`: if it is closed and consistently oriented.
    ///
    /// A solid's shell of negative volume that is not wholly within another is turned round with all it contains, and a
    /// warning says so. Faces keep their indices; turned ones swap their last two corners.
    /// Of a closed mesh that is written double-sided only one side is kept, unless `solid` is false; a warning
    /// says so, and faces count without the others.
    ///
    /// Cost: O(n log n); inside tests for shells of negative volume.
    ///
    /// # Errors
    /// Numbers that are not finite, indices out of range, no face with an area, an extent out of range, too many
    /// triangles, or `solid` set for a mesh that cannot bound a solid.
    pub fn new(
        vertices: Vec<Point>,
        mut faces: Vec<[u32; 3]>,
        solid: Option<bool>,
    ) -> Result<Self, ShapeError> {
        let bounds = check(&vertices, &faces)?;
        let mut topology = Topology::new(&vertices, &faces);
        if topology.defects.flat == faces.len() {
            return Err(ShapeError::EmptyMesh);
        }
        let mut warnings = Vec::new();
        if solid != Some(false)
            && topology.defects.duplicates > 0
            && let Some(half) = topology.one_side(&vertices, &faces)
        {
            warnings.push(double_sided(faces.len() - half.0.len()));
            (faces, topology) = half;
        }
        let solid = settle(&mut topology, &vertices, &mut faces, solid, &mut warnings)?;

        let centre = bounds.centre();
        let tree = Tree::new(&vertices, &faces, centre);
        let outline = (vertices.len() > OUTLINE_VERTICES_MIN)
            .then(|| Outline::new(|direction| tree.reach(&vertices, &faces, direction)));
        let mut mesh = Self {
            outline,
            radius: radius(&vertices, &faces, &centre),
            obb: ObbTree::new(&vertices, &faces),
            adjacency: Box::default(),
            rings: Box::default(),
            normals: Box::default(),
            balls: None,
            shells: topology.shells.iter().map(|s| s.vertex).collect(),
            vertices,
            faces,
            solid,
            warnings,
            tree,
            bounds,
            centre,
            deform: None,
        };
        if solid {
            mesh.turn_shells(&topology);
        }
        // Turned faces have their sides in a different order.
        mesh.adjacency = Box::new(Adjacency::new(&topology, &mesh));
        mesh.rings = Box::new(Rings::new(&mesh));
        mesh.normals = Box::new(Normals::new(&mesh));
        mesh.balls = mesh.find_balls();
        mesh.warnings.extend(mesh.adjacency.warning());
        Ok(mesh)
    }

    /// Its vertices, own frame, metres; some may belong to no face.
    #[must_use]
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Its faces as indices into [`Mesh::vertices`], counter-clockwise seen from outside.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The corners of a face that exists.
    #[must_use]
    pub fn triangle(&self, face: u32) -> [Point; 3] {
        debug_assert!((face as usize) < self.faces.len(), "face {face} exists");
        self.faces[face as usize].map(|v| self.vertices[v as usize])
    }

    /// Whether its inside belongs to it.
    #[must_use]
    pub fn is_solid(&self) -> bool {
        self.solid
    }

    /// What `check` reports of it: whether it is a solid and why, and any oddities.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// One vertex, by its index, of every connected set of faces.
    #[must_use]
    pub fn shells(&self) -> &[u32] {
        &self.shells
    }

    /// Centre of its box, own frame, metres.
    #[must_use]
    pub fn centre(&self) -> Point {
        self.centre
    }

    /// Greatest distance of its surface from [`Mesh::centre`], metres, rounded up.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Its box in its own frame, exact.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.bounds
    }

    /// Its tight box at `pose`, rounded outward.
    ///
    /// Exact for a small mesh; of a large one up to 0.4 % larger than tight, exact along its own axes.
    ///
    /// Cost: some 100 ns, regardless of the number of triangles.
    #[must_use]
    pub fn aabb_at(&self, pose: &Pose) -> Aabb {
        let rotation = pose.rotation.to_rotation_matrix();
        let centre = pose * self.centre;
        // Rounding of the rotation, the products and the sum, each a few units of their operands.
        let slop = 16.0 * ROUND * (centre.coords.amax() + self.centre.coords.amax() + self.radius);
        let mut bounds = Aabb::empty();
        for k in 0..3 {
            let axis = rotation.matrix().row(k).transpose();
            let [up, down] = self.extent(&axis);
            bounds.max[k] = centre[k] + up;
            bounds.min[k] = centre[k] - down;
        }
        bounds.widened(slop)
    }

    /// An upper bound, up to rounding, on how far it reaches from its centre along a unit direction.
    pub(crate) fn reach(&self, direction: &Vec3) -> f64 {
        match &self.outline {
            // No direction reaches beyond the ball.
            Some(outline) if !self.is_deforming() => outline.reach(direction).min(self.radius),
            _ => self.extent(direction)[0],
        }
    }

    /// Upper bounds, up to rounding, on how far it reaches from its centre along a unit direction and against it.
    pub(crate) fn extent(&self, direction: &Vec3) -> [f64; 2] {
        if self.is_deforming() {
            return self.extent_of_bounds(direction);
        }
        if self.outline.is_none() {
            let named = self.faces.iter().flatten();
            return named.fold([f64::NEG_INFINITY; 2], |[up, down], &v| {
                let on = direction.dot(&(self.vertices[v as usize] - self.centre));
                [up.max(on), down.max(-on)]
            });
        }
        [*direction, -direction].map(|along| self.reach(&along))
    }

    /// A vertex far along `direction`: not always the farthest, but a vertex of a face in any case.
    ///
    /// Cost: one path down the tree.
    pub(crate) fn outlying(&self, direction: &Vec3) -> Point {
        let mut place = 0;
        loop {
            match self.below(place) {
                Below::Nodes(..) | Below::Row(..) => {
                    let mut best = (f64::NEG_INFINITY, place);
                    self.each_below(place, |child| {
                        let reach = self.node(child).reach(direction);
                        if reach > best.0 {
                            best = (reach, child);
                        }
                    });
                    place = best.1;
                }
                Below::Triangle(face) => {
                    let [a, b, c] = self.triangle(face);
                    let on = |p: &Point| direction.dot(&p.coords);
                    let best = if on(&a) >= on(&b) { a } else { b };
                    return if on(&best) >= on(&c) { best } else { c };
                }
            }
        }
    }

    /// The tree over the triangles of a rigid mesh, for the fronts' reference; see [`Mesh::node`].
    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The tree of oriented boxes over its triangles.
    pub(crate) fn obb(&self) -> &ObbTree {
        &self.obb
    }
}

/// Refuses values that cannot be computed with, and returns the box of all vertices that faces name.
fn check(vertices: &[Point], faces: &[[u32; 3]]) -> Result<Aabb, ShapeError> {
    if faces.len() > TRIANGLES_MAX {
        return Err(ShapeError::TooManyTriangles {
            given: Some(faces.len() as u64),
        });
    }
    for (i, vertex) in vertices.iter().enumerate() {
        if let Some(&value) = vertex.iter().find(|x| !x.is_finite()) {
            return Err(ShapeError::NotFinite {
                what: format!("vertex {i}"),
                value,
            });
        }
    }
    let mut bounds = Aabb::empty();
    for (i, face) in faces.iter().enumerate() {
        for &index in face {
            let Some(vertex) = vertices.get(index as usize) else {
                return Err(ShapeError::IndexOutOfRange {
                    face: i,
                    index,
                    vertices: vertices.len(),
                });
            };
            bounds.min = bounds.min.inf(vertex);
            bounds.max = bounds.max.sup(vertex);
        }
    }
    if faces.is_empty() {
        return Err(ShapeError::EmptyMesh);
    }
    let extent = (bounds.max - bounds.min).amax();
    if !(EXTENT_MIN_M..=EXTENT_MAX_M).contains(&extent) {
        return Err(ShapeError::Extent {
            what: "the extent of the mesh".to_owned(),
            value_m: extent,
        });
    }
    let furthest = bounds.min.coords.amax().max(bounds.max.coords.amax());
    if furthest > EXTENT_MAX_M {
        return Err(ShapeError::Extent {
            what: "the largest coordinate of the mesh".to_owned(),
            value_m: furthest,
        });
    }
    Ok(bounds)
}

/// Decides whether the mesh is a solid, and why; turns faces of a solid that do not agree.
fn settle(
    topology: &mut Topology,
    vertices: &[Point],
    faces: &mut [[u32; 3]],
    said: Option<bool>,
    warnings: &mut Vec<String>,
) -> Result<bool, ShapeError> {
    let defects = topology.defects.clone();
    let why = format!(
        "{} open edges and {} edges whose faces disagree",
        defects.open, defects.inconsistent
    );
    let solid = match (said, defects.closed()) {
        (None, true) => true,
        (None, false) => {
            let mend = if defects.open > 0 {
                "close it, or say solid = false"
            } else {
                "say solid = true to have faces turned, or solid = false"
            };
            warnings.push(format!("surface, because it has {why}: {mend}"));
            false
        }
        (Some(said), _) if !said || defects.closed() => said,
        (Some(_), _) => {
            let Some(turned) = topology.orient(vertices, faces) else {
                return Err(ShapeError::Setting(format!(
                    "solid = true, but the mesh has {why}: close it, or say solid = false"
                )));
            };
            topology.measure(vertices, faces);
            warnings.push(format!("{turned} faces turned so that neighbours agree"));
            true
        }
    };
    let counts = [
        (defects.flat, "faces without an area"),
        (
            defects.needles,
            "needles (faces a million times as long as high)",
        ),
        (
            defects.duplicates,
            "faces on the same corners as another face",
        ),
        (defects.unreferenced, "vertices that no face names"),
    ];
    for (count, what) in counts {
        if count > 0 {
            warnings.push(format!("{count} {what}"));
        }
    }
    Ok(solid)
}

fn double_sided(count: usize) -> String {
    format!(
        "{count} faces on the same corners as another face, the other way round, left out: what is left is closed"
    )
}

#[cfg(test)]
pub(super) mod tests;
