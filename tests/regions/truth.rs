//! The points that two bodies truly share, by brute force over triangles, vertices and planes, without any tree, front
//! or box of the library.

use crate::oracle::meshes::{Soup, cuboid, trimesh};
use crate::oracle::shared::crossings;
use crate::oracle::{Placed, Triangle};
use sweepd::math::{Point, Pose, Vec3};

/// One shape of a body, at the body's own origin.
#[derive(Clone)]
pub enum Part {
    /// Triangles; the inside does not count.
    Mesh(Soup),
    /// A convex box; the inside counts.
    Box(Vec3),
    /// The half-space z <= 0.
    Floor,
}

impl Part {
    /// The shape as text of a scene file, at a position in the body.
    pub fn text(&self, at: Vec3) -> String {
        let position = format!("position = [{:?}, {:?}, {:?}]", at.x, at.y, at.z);
        match self {
            Self::Mesh(soup) => {
                let shape = trimesh(soup, None);
                format!("{}, {position} }}", shape.trim_end_matches(" }"))
            }
            Self::Box(h) => {
                format!(
                    "{{ type = \"box\", half_extents = [{:?}, {:?}, {:?}], {position} }}",
                    h.x, h.y, h.z
                )
            }
            Self::Floor => "{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }".to_owned(),
        }
    }

    fn soup(&self) -> Option<Soup> {
        match self {
            Self::Mesh(soup) => Some(soup.clone()),
            Self::Box(half) => Some(cuboid(*half)),
            Self::Floor => None,
        }
    }

    pub fn is_convex(&self) -> bool {
        !matches!(self, Self::Mesh(_))
    }

    /// Whether a point of its own frame is inside, for parts whose inside counts.
    fn holds(&self, p: &Point) -> bool {
        match self {
            Self::Mesh(_) => false,
            Self::Box(half) => (0..3).all(|k| p[k].abs() <= half[k]),
            Self::Floor => p.z <= 0.0,
        }
    }
}

/// A body: its shapes and their positions in it.
#[derive(Clone)]
pub struct Thing {
    pub parts: Vec<(Part, Vec3)>,
    pub radius: f64,
    /// Whether its only mesh deforms.
    pub deforms: bool,
}

impl Thing {
    pub fn new(parts: Vec<(Part, Vec3)>) -> Self {
        let far = |(part, at): &(Part, Vec3)| {
            let soup = part.soup().map_or(Vec::new(), |soup| soup.vertices);
            soup.iter()
                .map(|v| (v.coords + at).norm())
                .fold(0.0, f64::max)
        };
        let radius = parts.iter().map(far).fold(0.0, f64::max);
        Self {
            parts,
            radius,
            deforms: false,
        }
    }

    /// Sets the vertices of its only mesh.
    pub fn bend(&mut self, vertices: &[[f32; 3]]) {
        if let [(Part::Mesh(soup), _)] = &mut self.parts[..] {
            let point = |v: &[f32; 3]| Point::from(v.map(f64::from));
            soup.vertices = vertices.iter().map(point).collect();
        }
    }

    pub fn text(&self) -> String {
        let all: Vec<String> = self.parts.iter().map(|(part, at)| part.text(*at)).collect();
        format!("[{}]", all.join(", "))
    }
}

/// All known shared points: ends and middles of the segments that triangles share, vertices of one inside the other.
///
/// * returns - points relative to `from`, world axes; and whether both parts of a point are convex.
pub fn shared(a: (&Thing, &Pose), b: (&Thing, &Pose), from: &Vec3) -> Vec<(Point, bool)> {
    let mut all = Vec::new();
    for (one, at_one) in &a.0.parts {
        for (other, at_other) in &b.0.parts {
            let poses = [(a.1, at_one), (b.1, at_other)].map(|(pose, at)| {
                let shift = pose.translation.vector - from;
                (pose.rotation, shift + pose.rotation * at)
            });
            let convex = one.is_convex() && other.is_convex();
            let placed = [one, other].map(Part::soup);
            let mut triangles = Vec::new();
            for (soup, (turn, shift)) in placed.iter().zip(&poses) {
                let at = |p: &Point| Point::from(turn * p.coords + shift);
                triangles.push(soup.as_ref().map_or(Vec::new(), |soup| {
                    let face = |f: &[u32; 3]| f.map(|i| at(&soup.vertices[i as usize]));
                    soup.faces.iter().map(face).collect::<Vec<Triangle>>()
                }));
            }
            crossings(&triangles[0], &triangles[1], |p| all.push((p, convex)));
            for (corners, within, (turn, shift)) in [
                (&triangles[0], other, &poses[1]),
                (&triangles[1], one, &poses[0]),
            ] {
                for p in corners.iter().flatten() {
                    let own = Point::from(turn.inverse() * (p.coords - shift));
                    if within.holds(&own) {
                        all.push((*p, convex));
                    }
                }
            }
        }
    }
    all
}

/// Vertices of a mesh inside a solid, used where no triangles cross: the mesh is wholly inside.
pub fn held(a: (&Thing, &Pose), b: (&Thing, &Pose), from: &Vec3) -> Vec<Point> {
    let place = |(thing, pose): (&Thing, &Pose)| match &thing.parts[..] {
        [(part, at)] if at.norm() == 0.0 => part.soup().map(|soup| {
            let closed = closed(&soup);
            Placed::new(&soup.vertices, &soup.faces, closed, pose, from)
        }),
        _ => None,
    };
    let (Some(one), Some(other)) = (place(a), place(b)) else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for (of, within) in [(&one, &other), (&other, &one)] {
        let inside = |p: &&Point| within.solid && within.holds(p);
        all.extend(of.corners.iter().filter(inside));
    }
    all
}

/// Whether each edge has two faces, once in each direction.
fn closed(soup: &Soup) -> bool {
    let mut edges: Vec<(u32, u32)> = (soup.faces.iter())
        .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
        .collect();
    edges.sort_unstable();
    (edges.iter()).all(|&(i, j)| edges.binary_search(&(j, i)).is_ok())
}

/// Whether any two triangles cross.
pub fn cross(a: (&Thing, &Pose), b: (&Thing, &Pose)) -> bool {
    !shared(a, b, &a.1.translation.vector).is_empty()
}
