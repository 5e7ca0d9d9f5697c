//! Small meshes for tests: solids, surfaces, nested shells, slivers.

use std::fmt::Write as _;

use super::rng::Rng;
use sweepd::math::{Point, Vec3};

/// Vertices and faces; the faces are counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub struct Soup {
    pub vertices: Vec<Point>,
    pub faces: Vec<[u32; 3]>,
}

impl Soup {
    pub fn new(vertices: Vec<Point>, faces: Vec<[u32; 3]>) -> Self {
        Self { vertices, faces }
    }

    pub fn moved(mut self, by: Vec3) -> Self {
        for v in &mut self.vertices {
            *v += by;
        }
        self
    }

    pub fn scaled(mut self, by: Vec3) -> Self {
        for v in &mut self.vertices {
            v.coords.component_mul_assign(&by);
        }
        self
    }

    pub fn inverted(mut self) -> Self {
        for face in &mut self.faces {
            face.swap(1, 2);
        }
        self
    }

    pub fn and(mut self, other: Self) -> Self {
        let first = u32::try_from(self.vertices.len()).unwrap();
        self.vertices.extend(other.vertices);
        self.faces
            .extend(other.faces.into_iter().map(|f| f.map(|i| i + first)));
        self
    }

    /// Removes some of its faces, given by index, and the vertices that no remaining face uses.
    pub fn without(self, mut is_gone: impl FnMut(usize) -> bool) -> Self {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        let mut places = vec![None; self.vertices.len()];
        for (number, face) in self.faces.iter().enumerate() {
            if is_gone(number) {
                continue;
            }
            faces.push(face.map(|old| {
                *places[old as usize].get_or_insert_with(|| {
                    vertices.push(self.vertices[old as usize]);
                    u32::try_from(vertices.len() - 1).unwrap()
                })
            }));
        }
        Self::new(vertices, faces)
    }
}

pub fn tetrahedron(rng: &mut Rng) -> Soup {
    loop {
        let v: Vec<Point> = (0..4).map(|_| rng.point(1.0)).collect();
        let volume = (v[1] - v[0]).cross(&(v[2] - v[0])).dot(&(v[3] - v[0]));
        if volume < -0.1 {
            return Soup::new(v, vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]);
        }
    }
}

pub fn cuboid(half: Vec3) -> Soup {
    let vertices = (0..8u32)
        .map(|i| {
            let at = |k: usize| if i >> k & 1 == 1 { half[k] } else { -half[k] };
            Point::new(at(0), at(1), at(2))
        })
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = quads
        .iter()
        .flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]])
        .collect();
    Soup::new(vertices, faces)
}

/// A cuboid without its face towards +z: a surface, not a solid, although it is nearly closed.
pub fn open_box(half: Vec3) -> Soup {
    cuboid(half).without(|face| face / 2 == 1)
}

/// The convex hull of a few points in general position: the triples that have all other points on one side.
pub fn hull(points: &[Vec3]) -> Soup {
    let mut faces = Vec::new();
    let n = points.len();
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                let normal = (points[j] - points[i]).cross(&(points[k] - points[i]));
                let others = (0..n).filter(|m| ![i, j, k].contains(m));
                let sides: Vec<f64> = others
                    .map(|m| normal.dot(&(points[m] - points[i])))
                    .collect();
                let face = [i, j, k].map(|v| u32::try_from(v).unwrap());
                if sides.iter().all(|s| *s < 0.0) {
                    faces.push(face);
                } else if sides.iter().all(|s| *s > 0.0) {
                    faces.push([face[0], face[2], face[1]]);
                }
            }
        }
    }
    Soup::new(points.iter().map(|p| Point::from(*p)).collect(), faces)
}

fn index(row: usize, column: usize, columns: usize) -> u32 {
    u32::try_from(row * columns + column).unwrap()
}

/// A torus around z of `rings` times `sides` quads.
pub fn torus(radius: f64, tube: f64, rings: usize, sides: usize) -> Soup {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..rings {
        let u = std::f64::consts::TAU * i as f64 / rings as f64;
        for j in 0..sides {
            let v = std::f64::consts::TAU * j as f64 / sides as f64;
            let r = radius + tube * v.cos();
            vertices.push(Point::new(r * u.cos(), r * u.sin(), tube * v.sin()));
            let at = |i: usize, j: usize| index(i % rings, j % sides, sides);
            let (a, b) = (at(i, j), at(i + 1, j));
            let (c, d) = (at(i + 1, j + 1), at(i, j + 1));
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Soup::new(vertices, faces)
}

/// About 2 * rows * columns triangles, radius about 1, bumps of size `bump`.
pub fn bumpy_sphere(rows: usize, columns: usize, bump: f64) -> Soup {
    let mut vertices = vec![Point::new(0.0, 0.0, 1.0), Point::new(0.0, 0.0, -1.0)];
    let mut faces = Vec::new();
    for i in 1..rows {
        let theta = std::f64::consts::PI * i as f64 / rows as f64;
        for j in 0..columns {
            let phi = std::f64::consts::TAU * j as f64 / columns as f64;
            let r = 1.0 + bump * (5.0 * theta).sin() * (4.0 * phi).cos();
            let (s, c) = theta.sin_cos();
            vertices.push(Point::new(r * s * phi.cos(), r * s * phi.sin(), r * c));
        }
    }
    let at = |i: usize, j: usize| 2 + index(i - 1, j % columns, columns);
    for j in 0..columns {
        faces.push([0, at(1, j), at(1, j + 1)]);
        faces.push([1, at(rows - 1, j + 1), at(rows - 1, j)]);
        for i in 1..rows - 1 {
            let (a, b) = (at(i, j), at(i + 1, j));
            let (c, d) = (at(i + 1, j + 1), at(i, j + 1));
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Soup::new(vertices, faces)
}

/// A bumpy sphere without about every fifth face, and always without the first: a surface with holes.
pub fn holed_sphere(rng: &mut Rng, rows: usize, columns: usize, bump: f64) -> Soup {
    let whole = bumpy_sphere(rows, columns, bump);
    whole.without(|face| face == 0 || rng.below(5) == 0)
}

/// An open wavy sheet over x and y.
pub fn patch(rng: &mut Rng, cells: usize) -> Soup {
    let n = cells + 1;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let at = |k: usize| 2.0 * k as f64 / cells as f64 - 1.0;
            vertices.push(Point::new(at(j), at(i), rng.range(-0.15, 0.15)));
            if i < cells && j < cells {
                let (a, b) = (index(i, j, n), index(i, j + 1, n));
                let (c, d) = (index(i + 1, j + 1, n), index(i + 1, j, n));
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    Soup::new(vertices, faces)
}

/// A height field as a closed mesh: a sheet, side walls and a floor at `-base`.
pub fn height_field(rng: &mut Rng, cells: usize, base: f64) -> Soup {
    let mut soup = patch(rng, cells);
    let n = cells + 1;
    let count = u32::try_from(n * n).unwrap();
    let floor: Vec<Point> = (soup.vertices.iter())
        .map(|v| Point::new(v.x, v.y, -base))
        .collect();
    let top = soup.faces.clone();
    soup.vertices.extend(floor);
    soup.faces.extend(
        top.iter()
            .map(|&[a, b, c]| [a + count, c + count, b + count]),
    );
    // Walls along the border, counter-clockwise seen from above.
    let mut border = Vec::new();
    border.extend((0..cells).map(|j| index(0, j, n)));
    border.extend((0..cells).map(|i| index(i, cells, n)));
    border.extend((0..cells).map(|j| index(cells, cells - j, n)));
    border.extend((0..cells).map(|i| index(cells - i, 0, n)));
    for k in 0..border.len() {
        let (a, b) = (border[k], border[(k + 1) % border.len()]);
        soup.faces
            .extend([[a, a + count, b + count], [a, b + count, b]]);
    }
    soup
}

/// A block with a square hole along z: half width `outer`, half width of the hole `inner`, half height `height`.
pub fn block_with_hole(outer: f64, inner: f64, height: f64) -> Soup {
    let mut vertices = Vec::new();
    for z in [-height, height] {
        for half in [outer, inner] {
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                vertices.push(Point::new(half * x, half * y, z));
            }
        }
    }
    let mut faces = Vec::new();
    for k in 0..4u32 {
        let n = (k + 1) % 4;
        let (o, on, i, inn) = (k, n, 4 + k, 4 + n);
        let up = 8;
        // Outer wall, inner wall, top, bottom.
        faces.extend([[o, on, on + up], [o, on + up, o + up]]);
        faces.extend([[inn, i, i + up], [inn, i + up, inn + up]]);
        faces.extend([[o + up, on + up, inn + up], [o + up, inn + up, i + up]]);
        faces.extend([[on, o, i], [on, i, inn]]);
    }
    Soup::new(vertices, faces)
}

/// A fan of long thin triangles, a millionth as wide as long.
pub fn slivers(rng: &mut Rng) -> Soup {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for _ in 0..6 {
        let at = u32::try_from(vertices.len()).unwrap();
        let from = rng.point(0.5);
        let along = rng.direction() * rng.range(0.5, 1.5);
        vertices.extend([from, from + along, from + along * 0.5 + rng.vector(1e-6)]);
        faces.push([at, at + 1, at + 2]);
    }
    Soup::new(vertices, faces)
}

/// A mesh as an inline table of a scene file.
pub fn trimesh(soup: &Soup, solid: Option<bool>) -> String {
    let mut text = "{ type = \"trimesh\", vertices = [".to_owned();
    for v in &soup.vertices {
        let _ = write!(text, "[{:?}, {:?}, {:?}], ", v.x, v.y, v.z);
    }
    text += "], faces = [";
    for f in &soup.faces {
        let _ = write!(text, "{f:?}, ");
    }
    text += "]";
    if let Some(solid) = solid {
        let _ = write!(text, ", solid = {solid}");
    }
    text + " }"
}
