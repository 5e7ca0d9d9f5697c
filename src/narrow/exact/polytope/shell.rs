//! The shell: the final surface of a polytope, kept as the start of the pair's next query.
//!
//! In: a polytope that contains a ball as deep as the cores overlap. Out, at other poses: the same surface, if it still
//! is one.
//!
//! Corners are kept as the elements they lie on, plus the position on a circle. Evaluated at any poses, of any two
//! cores, they are points of the Minkowski difference: an outdated shell is still sound. A closed surface whose faces
//! all look away from the origin contains it, bent or not, so that [`epa`](super::super::epa) continues as if it had
//! just made it: while the cores move little its faces are usually far enough out already, and each is visited once;
//! otherwise, it grows.

use super::super::pair::{NO_ELEMENT, Pair, Vertex};
use super::{Place, Polytope};
use crate::math::{Vec3, f32_near};
use crate::shape::Core;
use crate::simd::boxes::prefetch;

/// Most corners of a shell: overlapping curved cores end with some fourteen, and one in twenty with more than this.
const CORNERS_MAX: usize = 32;
/// The number of triangles in a closed surface with that many corners.
const FACES_MAX: usize = 2 * CORNERS_MAX - 4;
/// Most vertices and faces of a polytope of which a shell can be left, including dead ones.
const VERTICES_SEEN: usize = 128;
const FACES_SEEN: usize = 512;

/// The final surface of an exact query of a pair, for the next one; see [`convex_gap_along`].
///
/// [`convex_gap_along`]: super::super::convex_gap_along
#[derive(Clone, Debug)]
// In this order, so that the part that most shells fill is contiguous.
#[repr(C)]
pub struct Shell {
    corners_len: u8,
    /// 0: empty.
    faces_len: u8,
    /// The current query ended with it.
    pub(in super::super) used: bool,
    corners: [Corner; CORNERS_MAX],
    faces: [Triangle; FACES_MAX],
}

const _: () = assert!(size_of::<Shell>() <= 1152, "every fourth pair has one");

/// A face: its corners, and the faces across each of its edges.
#[derive(Clone, Copy, Debug, Default)]
struct Triangle {
    corners: [u8; 3],
    beside: [u8; 3],
}

/// A vertex, given by the elements it lies on.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    of_a: u32,
    of_b: u32,
    /// Position on a circle of A, as x and y of its frame, and on a circle of B; for a corner that represents a cap its
    /// place in A's frame, metres.
    at: [f32; 4],
}

impl Default for Shell {
    fn default() -> Self {
        Self {
            corners_len: 0,
            faces_len: 0,
            used: false,
            corners: [Corner::default(); CORNERS_MAX],
            faces: [Triangle::default(); FACES_MAX],
        }
    }
}

impl Shell {
    /// Whether it is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.faces_len == 0
    }

    /// Prefetches it: the part that most shells fill.
    #[inline]
    pub(in crate::narrow) fn ask_ahead(&self) {
        prefetch(&self.faces_len);
        if let (Some(corners), Some(faces)) = (
            self.corners.first_chunk::<14>(),
            self.faces.first_chunk::<24>(),
        ) {
            prefetch(corners);
            prefetch(faces);
        }
    }

    /// Empties it.
    pub fn clear(&mut self) {
        (self.corners_len, self.faces_len) = (0, 0);
    }
}

impl Corner {
    fn of(pair: &Pair<'_>, vertex: &Vertex) -> Self {
        let at = if vertex.lies_on_elements() {
            let b = pair.to_b(&(vertex.b - pair.at));
            [vertex.a.x, vertex.a.y, b.x, b.y]
        } else {
            [vertex.w.x, vertex.w.y, vertex.w.z, 0.0]
        };
        Self {
            of_a: vertex.of_a,
            of_b: vertex.of_b,
            at: at.map(f32_near),
        }
    }

    /// The vertex at the poses of a pair; `None` if a core has no such element.
    ///
    /// * `aside` - places a corner that represents a cap.
    fn vertex(&self, pair: &Pair<'_>, aside: impl Fn(&Vec3) -> Option<Vec3>) -> Option<Vertex> {
        let [x, y, z, _] = self.at.map(f64::from);
        let (a, b) = if self.of_a == NO_ELEMENT {
            let w = aside(&Vec3::new(x, y, z))?;
            (Vec3::zeros(), w)
        } else {
            let on = |core: &Core, element, x: f32, y: f32| {
                core.element(element, &Vec3::new(f64::from(x), f64::from(y), 0.0))
            };
            let [ax, ay, bx, by] = self.at;
            let b = on(pair.b.core(), self.of_b, bx, by)?;
            let a = on(pair.a.core(), self.of_a, ax, ay)?;
            (a, pair.rotation * b + pair.at)
        };
        Some(Vertex {
            w: b - a,
            a,
            b,
            of_a: self.of_a,
            of_b: self.of_b,
        })
    }
}

impl Polytope {
    /// Leaves the surface as a shell, if it is complete and not too large.
    pub(in super::super) fn leave(&self, pair: &Pair<'_>, shell: &mut Shell) {
        shell.clear();
        if self.vertices.len() > VERTICES_SEEN || self.faces.len() > FACES_SEEN {
            return;
        }
        let (mut corner_of, mut face_of) = ([u8::MAX; VERTICES_SEEN], [u8::MAX; FACES_SEEN]);
        let (mut corners, mut faces) = (0, 0);
        let alive = || self.faces.iter().zip(0..).filter(|(face, _)| face.alive);
        for (face, at) in alive() {
            let Some(kept) = shell.faces.get_mut(usize::from(faces)) else {
                return;
            };
            face_of[at] = faces;
            faces += 1;
            for (to, corner) in kept.corners.iter_mut().zip(face.corners.map(usize::from)) {
                let place = &mut corner_of[corner];
                if *place == u8::MAX {
                    let Some(kept) = shell.corners.get_mut(usize::from(corners)) else {
                        return;
                    };
                    *kept = Corner::of(pair, &self.vertices[corner]);
                    *place = corners;
                    corners += 1;
                }
                *to = *place;
            }
        }
        for ((face, _), kept) in alive().zip(&mut shell.faces) {
            kept.beside = face.beside.map(|at| face_of[usize::from(at)]);
            // A step that failed has left a hole.
            if kept.beside.contains(&u8::MAX) {
                return;
            }
        }
        (shell.corners_len, shell.faces_len) = (corners, faces);
        shell.used = true;
    }

    /// Begins with a shell; false if there is none, it belongs to other cores, or it does not contain the origin.
    ///
    /// * `aside` - places a corner that represents a cap.
    pub(in super::super) fn start_with(
        &mut self,
        pair: &Pair<'_>,
        shell: &Shell,
        aside: impl Fn(&Vec3) -> Option<Vec3>,
    ) -> bool {
        self.clear();
        for corner in &shell.corners[..usize::from(shell.corners_len)] {
            let Some(vertex) = corner.vertex(pair, &aside) else {
                return false;
            };
            self.vertices.push(vertex);
        }
        self.met.resize(self.vertices.len(), 0);
        let faces = usize::from(shell.faces_len);
        for face in &shell.faces[..faces] {
            self.put_face(face.corners.map(Place::from), face.beside.map(Place::from));
        }
        faces > 0 && self.distances.iter().all(|d| *d > 0.0)
    }
}
