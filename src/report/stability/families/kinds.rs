//! Shapes, rotations and pairs that several families use.

use nalgebra::{Quaternion, UnitQuaternion};

use crate::math::{Pose, Vec3};
use crate::report::stability::dd::{Place, V3};
use crate::report::stability::stage::{Actor, Case, Pos};
use crate::report::stability::truth::reach;
use crate::shape::ShapeSpec;

pub(super) fn ball(radius: f64) -> ShapeSpec {
    ShapeSpec::Sphere { radius }
}

pub(super) fn cuboid(x: f64, y: f64, z: f64) -> ShapeSpec {
    ShapeSpec::Box {
        half_extents: [x, y, z],
    }
}

pub(super) fn capsule(radius: f64, half_height: f64) -> ShapeSpec {
    ShapeSpec::Capsule {
        radius,
        half_height,
    }
}

pub(super) fn cylinder(radius: f64, half_height: f64) -> ShapeSpec {
    ShapeSpec::Cylinder {
        radius,
        half_height,
    }
}

pub(super) fn cone(radius: f64, half_height: f64) -> ShapeSpec {
    ShapeSpec::Cone {
        radius,
        half_height,
    }
}

/// The half-space z <= 0.
pub(super) fn floor() -> ShapeSpec {
    ShapeSpec::HalfSpace {
        normal: [0.0, 0.0, 1.0],
        offset: 0.0,
    }
}

pub(super) fn hull(points: &[[f64; 3]]) -> ShapeSpec {
    ShapeSpec::Convex {
        vertices: points.to_vec(),
        file: None,
        scale: None,
    }
}

pub(super) fn mesh(vertices: Vec<[f64; 3]>, faces: Vec<[u32; 3]>, solid: bool) -> ShapeSpec {
    ShapeSpec::Trimesh {
        vertices,
        faces,
        file: None,
        scale: None,
        solid: Some(solid),
    }
}

/// Corners of a box, and its twelve triangles, which face outward.
pub(super) fn box_faces([x, y, z]: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corners = vec![
        [-x, -y, -z],
        [x, -y, -z],
        [x, y, -z],
        [-x, y, -z],
        [-x, -y, z],
        [x, -y, z],
        [x, y, z],
        [-x, y, z],
    ];
    let quads: [[u32; 4]; 6] = [
        [0, 3, 2, 1],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ];
    let faces = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    (corners, faces)
}

/// A solid cube as a mesh of triangles.
pub(super) fn mesh_cube(half: f64) -> ShapeSpec {
    let (vertices, faces) = box_faces([half; 3]);
    mesh(vertices, faces, true)
}

/// The quaternion x, y, z, w of a rotation.
pub(super) fn turn(axis: [f64; 3], angle_rad: f64) -> [f64; 4] {
    let axis = Vec3::from(axis).normalize();
    let (s, c) = (angle_rad / 2.0).sin_cos();
    [axis.x * s, axis.y * s, axis.z * s, c]
}

/// The rotation `b`, followed by `a`.
pub(super) fn then(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let quaternion = |q: [f64; 4]| Quaternion::new(q[3], q[0], q[1], q[2]);
    let both = (quaternion(a) * quaternion(b)).coords;
    [both.x, both.y, both.z, both.w]
}

/// A generic rotation.
pub(super) const ANY: [f64; 4] = [0.2, -0.5, 0.3, 0.787_400_787_401_181_1];
/// No rotation.
pub(super) const STILL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Powers of ten from `from` to `to`, with `steps` steps per decade.
pub(super) fn logs(from: i32, to: i32, steps: i32) -> impl Iterator<Item = f64> + Clone {
    (from * steps..=to * steps).map(move |k| {
        let exact = k % steps == 0;
        if exact {
            10.0_f64.powi(k / steps)
        } else {
            10.0_f64.powf(f64::from(k) / f64::from(steps))
        }
    })
}

/// How far a shape rotated by `q` reaches below its origin, metres.
pub(super) fn below(shape: &ShapeSpec, q: [f64; 4]) -> f64 {
    let place = Place::new([0.0; 3], q, [0.0; 3]);
    let down = place.turned_back(&V3::from([0.0, 0.0, -1.0]));
    reach(shape, &down).map_or(0.0, |reach| reach.near())
}

/// The pose of a shape above another one at the origin, whose top is at `top_m`, with a gap along z.
pub(super) fn above(top_m: f64, shape: &ShapeSpec, q: [f64; 4], gap_m: f64) -> Pos {
    Pos {
        t: [0.0, 0.0, top_m + below(shape, q) + gap_m],
        q,
    }
}

/// A pair: the upper shape, rotated by `q` and moved by `aside`, stands on the top of the lower one.
#[derive(Clone, Debug)]
pub(super) struct Stand {
    pub(super) kind: &'static str,
    pub(super) lower: ShapeSpec,
    pub(super) upper: ShapeSpec,
    q: [f64; 4],
    top_m: f64,
    aside: [f64; 2],
    /// Whether the pair may be rotated as a whole: its truth does not need upright shapes.
    free: bool,
}

impl Stand {
    fn new(kind: &'static str, lower: ShapeSpec, upper: ShapeSpec, q: [f64; 4]) -> Self {
        let top_m = -below(&lower, [1.0, 0.0, 0.0, 0.0]);
        Self {
            top_m: if matches!(lower, ShapeSpec::HalfSpace { .. }) {
                0.0
            } else {
                -top_m
            },
            kind,
            lower,
            upper,
            q,
            aside: [0.0; 2],
            free: true,
        }
    }

    fn aside(self, x: f64, y: f64) -> Self {
        Self {
            aside: [x, y],
            ..self
        }
    }

    fn upright(self) -> Self {
        Self {
            free: false,
            ..self
        }
    }

    /// Poses with a gap along the axis, rotated as a whole if that is allowed.
    pub(super) fn poses(&self, gap_m: f64) -> [Pos; 2] {
        let mut upper = above(self.top_m, &self.upper, self.q, gap_m);
        (upper.t[0], upper.t[1]) = (self.aside[0], self.aside[1]);
        let poses = [Pos::at([0.0; 3]), upper];
        if self.free { turned(poses) } else { poses }
    }

    /// The case with a gap along the axis.
    pub(super) fn case(&self, value: f64, gap_m: f64) -> Case {
        let [a, b] = self.poses(gap_m);
        Case::pair(
            self.kind,
            value,
            (Actor::of(self.lower.clone()), a),
            (Actor::of(self.upper.clone()), b),
        )
    }
}

/// Both poses after a generic rotation about the origin.
fn turned(poses: [Pos; 2]) -> [Pos; 2] {
    let whole = [0.31, 0.17, -0.42, 0.83];
    let unit =
        UnitQuaternion::new_normalize(Quaternion::new(whole[3], whole[0], whole[1], whole[2]));
    let unit_xyzw = unit.as_vector();
    let unit_xyzw = [unit_xyzw.x, unit_xyzw.y, unit_xyzw.z, unit_xyzw.w];
    let about = Pose::from_parts(Vec3::zeros().into(), unit);
    poses.map(|pos| Pos {
        t: (about.rotation * Vec3::from(pos.t)).into(),
        q: then(unit_xyzw, pos.q),
    })
}

/// Pairs of all kinds; the lower body has size `a`, the upper one `b`, metres.
pub(super) fn stands(a: f64, b: f64) -> Vec<Stand> {
    let cube = || cuboid(0.5 * a, 0.5 * a, 0.5 * a);
    let brick = || cuboid(0.3 * b, 0.2 * b, 0.4 * b);
    let wedge = |s: f64| {
        let points = [
            [0.4, 0.0, -0.2],
            [-0.3, 0.3, -0.2],
            [-0.3, -0.3, -0.2],
            [0.1, 0.05, 0.4],
            [-0.1, 0.1, 0.3],
        ];
        hull(&points.map(|p| p.map(|x| x * s)))
    };
    let tile = ShapeSpec::Triangle {
        vertices: [[0.4, 0.0, 0.0], [-0.3, 0.3, 0.1], [-0.2, -0.3, -0.1]].map(|p| p.map(|x| x * b)),
    };
    let aside = 0.03 * b;
    vec![
        Stand::new("sphere-sphere", ball(0.5 * a), ball(0.3 * b), STILL),
        Stand::new("box-box", cube(), brick(), ANY).aside(aside, -aside),
        Stand::new("box-capsule", cube(), capsule(0.1 * b, 0.3 * b), ANY).aside(aside, aside),
        Stand::new("box-hull", cube(), wedge(b), ANY).aside(aside, 0.0),
        Stand::new("box-triangle", cube(), tile, ANY).aside(aside, 0.0),
        Stand::new("half_space-box", floor(), brick(), ANY),
        Stand::new(
            "half_space-cylinder",
            floor(),
            cylinder(0.2 * b, 0.4 * b),
            ANY,
        ),
        Stand::new("half_space-cone", floor(), cone(0.2 * b, 0.4 * b), ANY),
        Stand::new(
            "cylinder-sphere",
            cylinder(0.4 * a, 0.5 * a),
            ball(0.3 * b),
            STILL,
        )
        .aside(aside, aside),
        Stand::new(
            "cylinder-cylinder",
            cylinder(0.4 * a, 0.5 * a),
            cylinder(0.3 * b, 0.2 * b),
            STILL,
        )
        .aside(aside, aside)
        .upright(),
        Stand::new("mesh-box", mesh_cube(0.5 * a), brick(), ANY).aside(aside, aside),
        Stand::new("mesh-mesh", mesh_cube(0.5 * a), mesh_cube(0.3 * b), ANY).aside(aside, aside),
    ]
}
