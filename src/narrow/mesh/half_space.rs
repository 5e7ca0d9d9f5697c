//! A mesh against a half-space: the least height of a vertex over the plane, down the tree.
//!
//! For a surface each triangle is a convex pair with the half-space. For a solid the deepest vertex decides too: a ball
//! in the solid around a point under the plane reaches down to a point of the solid at least its radius deeper.

use super::contacts::LeafContact;
use super::patches::Patches;
use super::{Closest, Goal};
use crate::math::{Interval, Point, Pose, ROUND, Vec3};
use crate::narrow::arena::{Arena, Run};
use crate::narrow::exact::PREDICTION;
use crate::narrow::widen::widened;
use crate::shape::{Below, Mesh, NODES_WAITING_MAX};
use crate::time::Meter;

/// A vertex: its height over the plane, metres; its point; its triangle; its index in the mesh.
type Lowest = (f64, Point, u32, u32);

/// A mesh at a pose over the plane.
#[derive(Clone, Copy, Debug, Default)]
struct Stand {
    /// Pose of the mesh seen from the half-space.
    pose: Pose,
    half_space_is_b: bool,
    /// Into the half-space, mesh's frame.
    down: Vec3,
    /// The same in the half-space's frame.
    down_there: Vec3,
    /// Height of the tree's origin over the plane, metres.
    origin_height_m: f64,
    /// Error bound of heights, metres; not finite if no height is known.
    slop: f64,
}

/// The walk.
#[derive(Debug, Default)]
pub(super) struct HalfSpaceWalk {
    waiting: Waiting,
    stand: Stand,
    /// Vertices up to this height count as contacts, metres: at rest all must, though rounding lifts some.
    near_m: f64,
    /// Least height found, metres; its point; its triangle.
    lowest: Option<Lowest>,
    /// Whether all vertices under the plane are wanted, not only the lowest.
    collects: bool,
    contacts: Patches,
}

/// A stack of nodes that may hold a lower vertex, with the least height in each, metres.
#[derive(Debug)]
struct Waiting {
    nodes: [(f64, u32); NODES_WAITING_MAX],
    len: usize,
}

impl Default for Waiting {
    fn default() -> Self {
        Self {
            nodes: [(0.0, 0); NODES_WAITING_MAX],
            len: 0,
        }
    }
}

impl Waiting {
    fn all(&self) -> &[(f64, u32)] {
        &self.nodes[..self.len]
    }

    /// Restarts with the root alone.
    fn start(&mut self, low: f64) {
        (self.nodes[0], self.len) = ((low, 0), 1);
    }

    fn push(&mut self, node: (f64, u32)) {
        self.nodes[self.len] = node;
        self.len += 1;
    }

    fn pop(&mut self) -> Option<(f64, u32)> {
        self.len = self.len.checked_sub(1)?;
        Some(self.nodes[self.len])
    }
}

impl Stand {
    /// * `plane` - normal and offset in the half-space's own frame.
    fn new(mesh: &Mesh, plane: (&Vec3, f64), pos12: &Pose, half_space_is_b: bool) -> Self {
        let (normal, offset) = plane;
        let pose = if half_space_is_b {
            pos12.inverse()
        } else {
            *pos12
        };
        let down_there = -normal;
        let origin = mesh.places_origin();
        // The origin of a mesh that deforms is its frame's, and the vertices may be far from there.
        let far = origin.coords.norm().max(mesh.centre().coords.norm());
        let size = pose.translation.vector.norm() + offset.abs() + far + mesh.radius();
        Self {
            pose,
            half_space_is_b,
            down: pose.rotation.inverse() * down_there,
            down_there,
            origin_height_m: normal.dot(&(pose * origin).coords) - offset,
            slop: 32.0 * ROUND * size,
        }
    }

    /// The corners of a triangle, with their heights.
    fn corners(&self, mesh: &Mesh, face: u32) -> [Lowest; 3] {
        mesh.faces()[face as usize].map(|vertex| {
            let corner = mesh.vertices()[vertex as usize];
            let height = self.origin_height_m - self.down.dot(&(corner - mesh.places_origin()));
            (height, corner, face, vertex)
        })
    }
}

/// The lowest corner of a triangle of a mesh over the plane: the upper end of its interval holds for the whole mesh.
///
/// * `plane` - normal and offset in the half-space's own frame.
pub(super) fn retest(
    mesh: &Mesh,
    plane: (&Vec3, f64),
    pos12: &Pose,
    half_space_is_b: bool,
    face: u32,
) -> Option<Closest> {
    let stand = Stand::new(mesh, plane, pos12, half_space_is_b);
    if !stand.slop.is_finite() || face as usize >= mesh.faces().len() {
        return None;
    }
    let corners = stand.corners(mesh, face);
    let lowest = corners.iter().min_by(|x, y| x.0.total_cmp(&y.0))?;
    Some(stand.contact(lowest).closest)
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
        self.stand = Stand::new(mesh, plane, pos12, half_space_is_b);
        self.near_m = self.stand.slop.max(PREDICTION * mesh.radius());
        self.lowest = None;
        self.collects = false;
        self.contacts.clear();
        self.waiting.start(self.bound(mesh, 0));
        // The height of any vertex is an upper bound.
        self.offer(mesh, 0, None);
        self.stand.slop.is_finite()
    }

    /// Works until the goal is reached (true), `end_units` are spent in all, or the meter closes.
    ///
    /// * `off_m` - see [`super::MeshQuery::advance_despite`].
    pub(super) fn advance(
        &mut self,
        arena: &mut Arena<LeafContact>,
        mesh: &Mesh,
        (goal, off_m): (Goal, f64),
        end_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        if goal == Goal::Contacts && !self.collects {
            // All vertices under the plane are wanted: the walk starts again, and the known interval is kept.
            self.collects = true;
            self.waiting.start(self.interval().min + self.stand.slop);
        }
        loop {
            if self.reached(goal, off_m) {
                return true;
            }
            if meter.spent() >= end_units || !meter.open() {
                return false;
            }
            self.step(mesh, arena);
            meter.charge(1);
        }
    }

    fn reached(&self, goal: Goal, off_m: f64) -> bool {
        let decided = |gap: Interval| gap.min > 0.0 || gap.max <= 0.0;
        let here = || widened(self.interval(), off_m);
        self.waiting.len == 0 || (goal == Goal::Verdict && decided(here()))
    }

    pub(super) fn contacts<'a>(&self, arena: &'a Arena<LeafContact>) -> &'a [LeafContact] {
        self.contacts.all(arena)
    }

    /// The block of its contacts.
    pub(super) fn run(&self) -> &Run {
        self.contacts.run()
    }

    /// Releases its memory.
    pub(super) fn release(&mut self, arena: &mut Arena<LeafContact>) {
        self.contacts.release(arena);
    }

    pub(super) fn interval(&self) -> Interval {
        let high = self.lowest.map_or(f64::INFINITY, |l| l.0);
        let low = self
            .waiting
            .all()
            .iter()
            .fold(high, |low, entry| low.min(entry.0));
        Interval::new(low - self.stand.slop, high + self.stand.slop)
    }

    /// The lowest vertex found so far, in A's frame.
    pub(super) fn witness(&self) -> Option<LeafContact> {
        self.lowest.map(|l| self.stand.contact(&l))
    }

    /// Tests one node.
    fn step(&mut self, mesh: &Mesh, arena: &mut Arena<LeafContact>) {
        let Some((bound, place)) = self.waiting.pop() else {
            return;
        };
        let lowest = self.lowest.map_or(f64::INFINITY, |l| l.0);
        if bound >= lowest && !(self.collects && bound <= self.near_m) {
            return;
        }
        match mesh.below(place) {
            Below::Row(..) => {
                // Insertion sort: the lowest on top is opened next.
                let from = self.waiting.len;
                mesh.each_below(place, |child| {
                    let low = self.bound(mesh, child).max(bound);
                    self.waiting.push((low, child));
                });
                let row = &mut self.waiting.nodes[from..self.waiting.len];
                row.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
            }
            Below::Triangle(face) => self.offer(mesh, face, self.collects.then_some(arena)),
            Below::Nodes(left, right) => {
                let (left, right) = (
                    (self.bound(mesh, left).max(bound), left),
                    (self.bound(mesh, right).max(bound), right),
                );
                // The lower one on top: it is opened next.
                let (far, near) = if left.0 < right.0 {
                    (right, left)
                } else {
                    (left, right)
                };
                self.waiting.push(far);
                self.waiting.push(near);
            }
        }
    }

    fn bound(&self, mesh: &Mesh, place: u32) -> f64 {
        self.stand.origin_height_m - mesh.node(place).reach(&self.stand.down)
    }

    fn offer(&mut self, mesh: &Mesh, face: u32, mut arena: Option<&mut Arena<LeafContact>>) {
        for here in self.stand.corners(mesh, face) {
            if self.lowest.is_none_or(|l| here.0 < l.0) {
                self.lowest = Some(here);
            }
            if let Some(arena) = arena.as_deref_mut()
                && here.0 <= self.near_m
            {
                self.contacts.add(arena, &self.stand.contact(&here));
            }
        }
    }
}

impl Stand {
    fn contact(&self, &(height, corner, face, vertex): &Lowest) -> LeafContact {
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
            feature: u64::from(vertex) << 1 | 1,
            patch: 0,
            out_m: 0.0,
        }
    }
}
