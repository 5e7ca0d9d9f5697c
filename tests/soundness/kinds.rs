//! Shapes of all kinds, as scene text and as the oracle represents them.

use sweepd::math::{Point, Vec3};
use sweepd::shape::ShapeSpec;

use crate::oracle::meshes::{self, Soup};
use crate::oracle::rng::Rng;

pub const KINDS: usize = 13;
pub const HALF_SPACE: usize = 9;
/// Kinds from this one on are deforming bodies.
pub const BENDING: usize = 11;
pub const NAMES: [&str; KINDS] = [
    "sphere",
    "box",
    "capsule",
    "cylinder",
    "cone",
    "convex",
    "triangle",
    "solid",
    "surface",
    "half-space",
    "height field",
    "deforming solid",
    "deforming surface",
];

/// A shape by its definition.
#[derive(Clone, Debug)]
pub enum Solid {
    Sphere(f64),
    Cuboid(Vec3),
    Capsule(f64, f64),
    Cylinder(f64, f64),
    Cone(f64, f64),
    Points(Vec<Vec3>),
    Triangle([Vec3; 3]),
    Mesh(Soup, bool),
    HalfSpace(Vec3, f64),
}

/// A random shape of a kind, of size about `s` metres, and its scene text. The caller takes the mesh of a height field
/// from the built shape.
pub fn any(rng: &mut Rng, kind: usize, s: f64) -> (Solid, ShapeSpec) {
    let mut size = || s * rng.range(0.3, 1.0);
    let (radius, half_height, third) = (size(), size(), size());
    match kind {
        0 => (Solid::Sphere(radius), ShapeSpec::Sphere { radius }),
        1 => {
            let half = Vec3::new(radius, half_height, third);
            (
                Solid::Cuboid(half),
                ShapeSpec::Box {
                    half_extents: half.into(),
                },
            )
        }
        2 => (
            Solid::Capsule(radius, half_height),
            ShapeSpec::Capsule {
                radius,
                half_height,
            },
        ),
        3 => (
            Solid::Cylinder(radius, half_height),
            ShapeSpec::Cylinder {
                radius,
                half_height,
            },
        ),
        4 => (
            Solid::Cone(radius, half_height),
            ShapeSpec::Cone {
                radius,
                half_height,
            },
        ),
        5 => {
            let points: Vec<Vec3> = (0..9)
                .map(|_| rng.direction() * s * rng.range(0.7, 1.0))
                .collect();
            let vertices = points.iter().map(|&p| p.into()).collect();
            (
                Solid::Points(points),
                ShapeSpec::Convex {
                    vertices,
                    file: None,
                    scale: None,
                },
            )
        }
        6 => {
            let points = [0; 3].map(|_| rng.direction() * s * rng.range(0.3, 1.0));
            (
                Solid::Triangle(points),
                ShapeSpec::Triangle {
                    vertices: points.map(Into::into),
                },
            )
        }
        7 | 11 => mesh(some_solid(rng).scaled(Vec3::new(s, s, s)), true),
        8 => mesh(some_surface(rng).scaled(Vec3::new(s, s, s)), false),
        12 => mesh(meshes::patch(rng, 9).scaled(Vec3::new(s, s, s)), false),
        HALF_SPACE => {
            let normal = rng.direction();
            let spec = ShapeSpec::HalfSpace {
                normal: normal.into(),
                offset: half_height,
            };
            (Solid::HalfSpace(normal, half_height), spec)
        }
        _ => {
            let heights = (0..4)
                .map(|_| (0..5).map(|_| s * rng.range(-0.3, 0.3)).collect())
                .collect();
            let spec = ShapeSpec::HeightField {
                heights,
                size: [1.6 * s, 1.3 * s],
                base_m: 0.3 * s,
            };
            (Solid::Mesh(Soup::new(Vec::new(), Vec::new()), true), spec)
        }
    }
}

fn some_solid(rng: &mut Rng) -> Soup {
    let one = Vec3::new(1.0, 1.0, 1.0);
    match rng.below(4) {
        0 => meshes::torus(0.7, 0.25, 6, 4),
        1 => meshes::bumpy_sphere(5, 5, 0.15),
        2 => meshes::cuboid(one * 0.8).and(meshes::cuboid(one * 0.5).inverted()),
        _ => meshes::block_with_hole(1.0, 0.5, 0.5),
    }
}

fn some_surface(rng: &mut Rng) -> Soup {
    match rng.below(4) {
        0 => meshes::patch(rng, 4),
        1 => meshes::slivers(rng),
        2 => meshes::open_box(Vec3::new(0.8, 0.8, 0.8)),
        _ => meshes::holed_sphere(rng, 5, 5, 0.15),
    }
}

fn mesh(soup: Soup, solid: bool) -> (Solid, ShapeSpec) {
    let spec = ShapeSpec::Trimesh {
        vertices: soup.vertices.iter().map(|v| v.coords.into()).collect(),
        faces: soup.faces.clone(),
        file: None,
        scale: None,
        solid: Some(solid),
    };
    (Solid::Mesh(soup, solid), spec)
}

impl Solid {
    /// Support value along unit `n`, from the definition; not for meshes and half-spaces.
    pub fn reach(&self, n: &Vec3) -> f64 {
        let off = n.x.hypot(n.y);
        let most = |p: &[Vec3]| p.iter().map(|v| v.dot(n)).fold(f64::NEG_INFINITY, f64::max);
        match self {
            Self::Sphere(r) => *r,
            Self::Cuboid(h) => h.x * n.x.abs() + h.y * n.y.abs() + h.z * n.z.abs(),
            Self::Capsule(r, h) => r + h * n.z.abs(),
            Self::Cylinder(r, h) => r * off + h * n.z.abs(),
            Self::Cone(r, h) => (h * n.z).max(r * off - h * n.z),
            Self::Points(p) => most(p),
            Self::Triangle(p) => most(p),
            Self::Mesh(soup, _) => soup
                .vertices
                .iter()
                .map(|v| v.coords.dot(n))
                .fold(f64::NEG_INFINITY, f64::max),
            Self::HalfSpace(..) => panic!("no support"),
        }
    }

    /// Polytopes inside and around the shape, as meshes. They are equal if the shape is a polytope or a triangle.
    pub fn between(&self) -> [Soup; 2] {
        match self {
            Self::Cuboid(h) => [meshes::cuboid(*h), meshes::cuboid(*h)],
            Self::Points(p) => [meshes::hull(p), meshes::hull(p)],
            Self::Triangle(p) => {
                let soup = Soup::new(p.map(Point::from).to_vec(), vec![[0, 1, 2]]);
                [soup.clone(), soup]
            }
            Self::Mesh(soup, _) => [soup.clone(), soup.clone()],
            Self::Cylinder(r, h) => [prism(*r, *r, *h, 0.0), prism(*r, *r, *h, 1.0)],
            Self::Cone(r, h) => [prism(*r, 0.0, *h, 0.0), prism(*r, 0.0, *h, 1.0)],
            Self::Sphere(_) | Self::Capsule(..) | Self::HalfSpace(..) => panic!("no polytope"),
        }
    }

    pub fn filled(&self) -> bool {
        !matches!(self, Self::Triangle(_) | Self::Mesh(_, false))
    }
}

/// Sides of the polygon that approximates a circle.
const SIDES: u32 = 12;

/// A prism or pyramid inscribed in (`outside` 0) or circumscribed about (1) a cylinder or cone.
fn prism(low: f64, high: f64, h: f64, outside: f64) -> Soup {
    let grow = 1.0 + outside * (1.0 / (std::f64::consts::PI / f64::from(SIDES)).cos() - 1.0);
    let mut vertices = vec![Point::new(0.0, 0.0, -h), Point::new(0.0, 0.0, h)];
    let mut faces = Vec::new();
    for k in 0..SIDES {
        let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(SIDES)).sin_cos();
        vertices.push(Point::new(low * grow * c, low * grow * s, -h));
        vertices.push(Point::new(high * grow * c, high * grow * s, h));
        let (a, b) = (2 + 2 * k, 2 + 2 * ((k + 1) % SIDES));
        faces.push([0, b, a]);
        if high > 0.0 {
            faces.extend([[a, b, b + 1], [a, b + 1, a + 1], [1, a + 1, b + 1]]);
        } else {
            faces.push([a, b, 1]);
        }
    }
    Soup::new(vertices, faces)
}
