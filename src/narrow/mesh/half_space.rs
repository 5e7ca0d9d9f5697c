//! A mesh against a half-space: the least height of a vertex over the plane, down the tree.
//!
//! For a surface each triangle is a convex pair with the half-space. For a solid the deepest vertex decides too: a
//! ball in the solid about a point under the plane reaches down to a point of the solid at least its radius deeper.

use super::Closest;
use super::contacts::{Contacts, LeafContact};
use crate::math::{Interval, Point, Pose, ROUND, Vec3};
use crate::shape::{Below, Mesh};

/// The walk; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct HalfSpaceWalk {
    /// Nodes that may hold a lower vertex, and the least height in each, metres.
    stack: Vec<(f64, u32)>,
    /// Pose of the mesh seen from the half-space.
    pose: Pose,
    half_space_is_b: bool,
    /// Into the half-space, mesh's frame.
    down: Vec3,
    /// The same in the half-space's frame.
    down_there: Vec3,
    /// Height of the tree's origin over the plane, metres.
    origin_height_m: f64,
    slop: f64,
    /// Least height met, metres; where; which triangle.
    lowest: Option<(f64, Point, u32)>,
    /// Whether all vertices under the plane are wanted, not only the lowest.
    collects: bool,
}

impl HalfSpaceWalk {
    /// * `plane` - normal and offset in the half-space's own frame.
    /// * returns - false when numbers are not finite.
    pub(super) fn start(
        &mut self,
        mesh: &Mesh,
        plane: (&Vec3, f64),
        pos12: &Pose,
        half_space_is_b: bool,
    ) -> bool {
        let (normal, offset) = plane;
        self.pose = if half_space_is_b {
            pos12.inverse()
        } else {
            *pos12
        };
        self.half_space_is_b = half_space_is_b;
        self.down_there = -normal;
        self.down = self.pose.rotation.inverse() * self.down_there;
        let origin = mesh.tree().origin();
        self.origin_height_m = normal.dot(&(self.pose * origin).coords) - offset;
        let size = self.pose.translation.vector.norm()
            + offset.abs()
            + origin.coords.norm()
            + mesh.radius();
        self.slop = 32.0 * ROUND * size;
        self.lowest = None;
        self.collects = false;
        self.stack.clear();
        self.stack.push((self.bound(mesh, 0), 0));
        // Any vertex bounds the least from above.
        self.offer(mesh, 0, None);
        size.is_finite()
    }

    /// From now on all vertices under the plane are wanted: the walk begins again.
    pub(super) fn collect(&mut self) {
        if !self.collects {
            self.collects = true;
            // What is known stays known.
            let low = self.interval().min + self.slop;
            self.stack.clear();
            self.stack.push((low, 0));
        }
    }

    pub(super) fn finished(&self) -> bool {
        self.stack.is_empty()
    }

    pub(super) fn interval(&self) -> Interval {
        let high = self.lowest.map_or(f64::INFINITY, |l| l.0);
        let low = self.stack.iter().fold(high, |low, entry| low.min(entry.0));
        Interval::new(low - self.slop, high + self.slop)
    }

    /// The lowest vertex met so far, in A's frame.
    pub(super) fn witness(&self) -> Option<LeafContact> {
        self.lowest.map(|l| self.contact(&l))
    }

    /// Tests one node.
    pub(super) fn step(&mut self, mesh: &Mesh, contacts: &mut Contacts) {
        let Some((bound, place)) = self.stack.pop() else {
            return;
        };
        let lowest = self.lowest.map_or(f64::INFINITY, |l| l.0);
        if bound >= lowest && !(self.collects && bound <= self.slop) {
            return;
        }
        match mesh.tree().nodes()[place as usize].below(place) {
            Below::Triangle(face) => self.offer(mesh, face, self.collects.then_some(contacts)),
            Below::Nodes(left, right) => {
                let (left, right) = (
                    (self.bound(mesh, left).max(bound), left),
                    (self.bound(mesh, right).max(bound), right),
                );
                // The lower one on top: it is the next to be looked into.
                let (far, near) = if left.0 < right.0 {
                    (right, left)
                } else {
                    (left, right)
                };
                self.stack.push(far);
                self.stack.push(near);
            }
        }
    }

    fn bound(&self, mesh: &Mesh, place: u32) -> f64 {
        self.origin_height_m - mesh.tree().nodes()[place as usize].reach(&self.down)
    }

    fn offer(&mut self, mesh: &Mesh, face: u32, mut contacts: Option<&mut Contacts>) {
        for corner in mesh.triangle(face) {
            let height = self.origin_height_m - self.down.dot(&(corner - mesh.tree().origin()));
            let here = (height, corner, face);
            if self.lowest.is_none_or(|l| height < l.0) {
                self.lowest = Some(here);
            }
            // A vertex belongs to some six triangles and is one contact.
            if let Some(contacts) = contacts.as_deref_mut()
                && height <= self.slop
            {
                let contact = self.contact(&here);
                if !(contacts.all().iter()).any(|c| {
                    c.closest.point_a == contact.closest.point_a
                        && c.closest.point_b == contact.closest.point_b
                }) {
                    contacts.add(contact);
                }
            }
        }
    }

    fn contact(&self, &(height, corner, face): &(f64, Point, u32)) -> LeafContact {
        let (on_mesh, down) = if self.half_space_is_b {
            (corner, self.down)
        } else {
            (self.pose * corner, self.down_there)
        };
        let on_plane = on_mesh + down * height;
        let pick = |of_mesh: u32| {
            if self.half_space_is_b {
                of_mesh
            } else {
                u32::MAX
            }
        };
        let (triangle_a, triangle_b) = (
            pick(face),
            if self.half_space_is_b { u32::MAX } else { face },
        );
        let closest = Closest {
            gap: Interval::new(height - self.slop, height + self.slop),
            best_m: height,
            normal: if self.half_space_is_b { down } else { -down },
            point_a: if self.half_space_is_b {
                on_mesh
            } else {
                on_plane
            },
            point_b: if self.half_space_is_b {
                on_plane
            } else {
                on_mesh
            },
            finished: true,
        };
        LeafContact {
            closest,
            triangle_a,
            triangle_b,
        }
    }
}
