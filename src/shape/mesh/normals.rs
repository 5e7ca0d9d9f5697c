//! Cones of normals: of the faces under a box of the tree, with the arcs of their edges and corners.
//!
//! In: a final mesh. Out: for each pack of the tree the cone that contains the normals of all faces under it and of all
//! their neighbours. The normals of an edge are the arc between those of its two faces, those of a corner what lies
//! between the faces around it; a cone of no more than a right angle that contains the ends of an arc contains the arc.
//!
//! Some seven bytes a triangle, built with the mesh: in a tick, when the first listener appears, it would be too late.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Matrix3;

use super::Mesh;
use super::obb::{BoxId, Held, ObbTree};
use crate::math::{Vec3, f32_down, f32_up};

/// Added to each half angle, radians: more than the error of f32 axes.
const ROUNDED_RAD: f64 = 1e-6;

/// Directions whose mean is shorter than this have no common axis.
const TOLD: f64 = 0.05;

/// Directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    /// Unit. If the cone contains every direction: a guess, or zero.
    pub(crate) axis: Vec3,
    /// Half angle, radians; pi: every direction.
    pub(crate) half_rad: f64,
}

impl Cone {
    /// Every direction.
    pub(crate) fn every(axis: Vec3) -> Self {
        Self { axis, half_rad: PI }
    }

    /// One direction.
    pub(crate) fn of(axis: Vec3) -> Self {
        Self {
            axis,
            half_rad: 0.0,
        }
    }

    /// The cone in a frame in which its own frame's axes are the columns of `rotation`.
    pub(crate) fn turned(&self, rotation: &Matrix3<f64>) -> Self {
        Self {
            axis: rotation * self.axis,
            ..*self
        }
    }

    /// The opposite directions.
    pub(crate) fn reversed(&self) -> Self {
        Self {
            axis: -self.axis,
            ..*self
        }
    }

    /// A cone that contains all of these and the arcs between them: every direction if they spread over more than a
    /// right angle from their mean, because then arcs may leave it.
    pub(crate) fn around(cones: impl Iterator<Item = Self> + Clone) -> Self {
        let (mut sum, mut count, mut widest) = (Vec3::zeros(), 0.0, 0.0_f64);
        for cone in cones.clone() {
            sum += cone.axis;
            count += cone.axis.norm();
            widest = widest.max(cone.half_rad);
        }
        let Some(axis) = sum.try_normalize(TOLD * count) else {
            return Self::every(Vec3::zeros());
        };
        if widest > FRAC_PI_2 {
            return Self::every(axis);
        }
        let mut half_rad = 0.0_f64;
        for cone in cones {
            half_rad = half_rad.max(angle(&axis, &cone.axis) + cone.half_rad);
            if half_rad > FRAC_PI_2 {
                return Self::every(axis);
            }
        }
        Self { axis, half_rad }
    }
}

/// The angle between two unit vectors, radians; accurate to some 1e-15 for small ones too.
fn angle(u: &Vec3, v: &Vec3) -> f64 {
    u.cross(v).norm().atan2(u.dot(v))
}

/// Cones of a mesh's boxes, own frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Normals {
    /// By face: how far the normals around it lean from its own, radians, rounded up; pi: it has none, or not all faces
    /// around it were found.
    spread: Vec<f32>,
    /// By pack, for everything in it: axis and half angle.
    packs: Vec<[f32; 4]>,
}

impl Normals {
    /// * `mesh` - with its neighbours known.
    ///
    /// Cost: some 0.3 us a triangle.
    pub(super) fn new(mesh: &Mesh) -> Self {
        let count = u32::try_from(mesh.faces.len()).unwrap_or(0);
        let spread = (0..count).map(|face| {
            let Some(own) = mesh.face_normal(face) else {
                return f32_up(PI);
            };
            let mut most = 0.0_f64;
            let whole = mesh.about(face, |other| {
                if let Some(normal) = mesh.face_normal(other) {
                    most = most.max(angle(&own, &normal));
                }
            });
            // A face around a corner that was not found may look anywhere.
            f32_up(if whole { most + ROUNDED_RAD } else { PI })
        });
        let mut normals = Self {
            spread: spread.collect(),
            packs: vec![[0.0, 0.0, 1.0, f32_up(PI)]; mesh.obb.packs().len()],
        };
        let mut faces = Vec::with_capacity(mesh.faces.len());
        normals.fill(mesh, &mesh.obb, 0, &mut faces);
        normals
    }

    /// Fills the cones of a pack and of all below it; appends their faces.
    fn fill(&mut self, mesh: &Mesh, tree: &ObbTree, pack: u32, faces: &mut Vec<u32>) {
        let from = faces.len();
        let mask = tree.packs()[pack as usize].mask;
        for lane in (0..8).filter(|lane| mask >> lane & 1 == 1) {
            match tree.held(BoxId::new(pack, lane)) {
                Held::Triangle(face) => faces.push(face),
                Held::Pack(below) => self.fill(mesh, tree, below, faces),
            }
        }
        let cone = Cone::around(faces[from..].iter().map(|&face| self.face(mesh, face)));
        let axis = cone.axis.map(f32_down);
        self.packs[pack as usize] = [
            axis.x,
            axis.y,
            axis.z,
            f32_up((cone.half_rad + ROUNDED_RAD).min(PI)),
        ];
    }

    fn face(&self, mesh: &Mesh, face: u32) -> Cone {
        match mesh.face_normal(face) {
            Some(axis) => Cone {
                axis,
                half_rad: f64::from(self.spread[face as usize]),
            },
            None => Cone::every(Vec3::zeros()),
        }
    }
}

impl Mesh {
    /// The outward normals of the faces under a box, of their edges and of their corners, own frame; every direction
    /// for a surface, which can be touched from both sides, and for a mesh that deforms.
    pub(crate) fn normals(&self, id: BoxId) -> Cone {
        if self.is_deforming() {
            // The cones belong to the faces as they were when the mesh was made.
            let own = match self.obb.held(id) {
                Held::Triangle(face) => self.face_normal(face),
                Held::Pack(_) => None,
            };
            return Cone::every(own.unwrap_or_default());
        }
        let cone = match self.obb.held(id) {
            Held::Triangle(face) => self.normals.face(self, face),
            Held::Pack(pack) => {
                let [x, y, z, half_rad] = self.normals.packs[pack as usize].map(f64::from);
                Cone {
                    axis: Vec3::new(x, y, z),
                    half_rad,
                }
            }
        };
        let wide = !self.solid || cone.half_rad > FRAC_PI_2;
        if wide { Cone::every(cone.axis) } else { cone }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;
    use crate::shape::mesh::tests::ball;

    fn tetrahedron() -> Mesh {
        let corners = [
            Point::new(0.0, 0.0, 0.0),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
            Point::new(0.0, 0.0, 1.0),
        ];
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Mesh::new(corners.to_vec(), faces, None).unwrap()
    }

    #[test]
    fn a_cone_around_others_holds_them_and_gives_up_beyond_a_right_angle() {
        let (x, y) = (Vec3::x(), Vec3::y());
        let both = Cone::around([Cone::of(x), Cone::of(y)].into_iter());
        assert!((both.half_rad - PI / 4.0).abs() < 1e-12);
        assert!(Cone::around([Cone::of(x), Cone::of(-x)].into_iter()).half_rad >= PI);
        let wide = [
            Cone {
                axis: x,
                half_rad: 1.0,
            },
            Cone::of(-x + y * 0.5),
        ];
        assert!(Cone::around(wide.into_iter()).half_rad >= PI);
    }

    #[test]
    fn the_cone_of_a_box_of_a_ball_holds_its_normals_and_is_narrower_than_that_of_its_parent() {
        let mesh = ball(20, 0.0);
        assert!(mesh.normals(BoxId::ROOT).half_rad >= PI);
        let mut narrow = 0;
        let mut stack = vec![(BoxId::ROOT, Vec::<Cone>::new())];
        while let Some((id, mut above)) = stack.pop() {
            above.push(mesh.normals(id));
            match mesh.obb.held(id) {
                Held::Pack(pack) => {
                    let mask = mesh.obb.packs()[pack as usize].mask;
                    let lanes = (0..8).filter(|lane| mask >> lane & 1 == 1);
                    stack.extend(lanes.map(|lane| (BoxId::new(pack, lane), above.clone())));
                }
                Held::Triangle(face) => {
                    let normal = mesh.face_normal(face).unwrap();
                    for cone in &above {
                        assert!(angle(&cone.axis, &normal) <= cone.half_rad, "{cone:?}");
                    }
                    narrow += usize::from(above.last().unwrap().half_rad < 0.5);
                }
            }
        }
        assert_eq!(narrow, mesh.faces.len());
    }

    /// A cone of many faces, with a fan about its middle as the bottom: the rings of tip and middle are cut off, and
    /// the faces found were all on one side of the axis.
    #[test]
    fn bug_faces_about_a_corner_of_very_many_have_any_normal() {
        let fan = |n: u32| {
            let rim = (0..n).map(|k| {
                let (sin, cos) = (f64::from(k) / f64::from(n) * 2.0 * PI).sin_cos();
                Point::new(cos, sin, 0.0)
            });
            let ends = [Point::new(0.0, 0.0, 1.0), Point::origin()];
            let faces = (0..n).flat_map(|k| {
                let (a, b) = (2 + k, 2 + (k + 1) % n);
                [[0, a, b], [1, b, a]]
            });
            Mesh::new(ends.into_iter().chain(rim).collect(), faces.collect(), None).unwrap()
        };
        let many = fan(300);
        assert!(many.is_solid());
        for face in 0..600 {
            assert!(many.normals.face(&many, face).half_rad >= PI, "{face}");
        }
        let few = fan(40);
        assert!((0..80).all(|face| few.normals.face(&few, face).half_rad < 3.0));
    }

    #[test]
    fn a_face_beside_sharp_edges_has_the_normals_of_its_neighbours_too() {
        let mesh = tetrahedron();
        let spread = mesh.normals.spread.clone();
        // Faces on the coordinate planes meet at right angles, and the fourth leans away from them.
        assert!(spread.iter().all(|s| *s > 2.18 && *s < 2.19), "{spread:?}");
        assert!(mesh.normals(BoxId::ROOT).half_rad >= PI);
    }
}
