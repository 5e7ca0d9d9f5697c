//! The inside test: how often the surface of a closed mesh winds around a point, as a walk that can stop.
//!
//! In: a closed, consistently oriented mesh and a point in its frame. Out: the winding number, 0 outside.
//!
//! A ray along +x is followed through the tree. What counts is decided by exact signs: whether the ray crosses a
//! triangle is the winding number of its outline around the ray in the plane of y and z, with the half-open rule of
//! polygon tests, so a ray through an edge or a corner counts for exactly one of the triangles that share it. Solid
//! angles over all triangles were refused: no tree prunes them exactly.

use std::cmp::Ordering;

use super::Mesh;
use super::balls::NEARLY;
use super::predicates::{side, turn_yz};
use super::tree::{Below, NODES_WAITING_MAX};
use crate::math::Point;

/// One inside test in progress.
#[derive(Debug)]
pub(crate) struct Inside {
    point: Point,
    waiting: [u32; NODES_WAITING_MAX],
    len: usize,
    winding: i64,
}

impl Default for Inside {
    fn default() -> Self {
        Self {
            point: Point::origin(),
            waiting: [0; NODES_WAITING_MAX],
            len: 0,
            winding: 0,
        }
    }
}

impl Inside {
    /// Starts the test of `point`, given in the mesh's frame.
    pub(crate) fn start(&mut self, point: Point) {
        (self.point, self.winding) = (point, 0);
        (self.waiting[0], self.len) = (0, 1);
    }

    /// Whether the walk is over.
    pub(crate) fn finished(&self) -> bool {
        self.len == 0
    }

    /// How often the surface winds around the point; valid when finished.
    pub(crate) fn winding(&self) -> i64 {
        self.winding
    }

    /// Tests one node. `counts` selects the triangles (all of them, or those of one shell).
    pub(crate) fn step(&mut self, mesh: &Mesh, counts: impl Fn(u32) -> bool) {
        let Some(top) = self.len.checked_sub(1) else {
            return;
        };
        self.len = top;
        let place = self.waiting[top];
        let node = mesh.node(place);
        // Rounding of a difference is monotonic, so a vertex inside the box stays inside after it.
        let p = self.point - mesh.places_origin();
        let beside = |k: usize, x: f64| x < f64::from(node.min[k]) || x > f64::from(node.max[k]);
        if p.x > f64::from(node.max[0]) || beside(1, p.y) || beside(2, p.z) {
            return;
        }
        match mesh.below(place) {
            Below::Nodes(left, right) => {
                self.waiting[top..top + 2].copy_from_slice(&[right, left]);
                self.len = top + 2;
            }
            Below::Row(..) => mesh.each_below(place, |child| {
                self.waiting[self.len] = child;
                self.len += 1;
            }),
            Below::Triangle(face) if counts(face) => self.count(&mesh.triangle(face)),
            Below::Triangle(_) => {}
        }
    }

    /// The whole test at once, without a budget.
    pub(crate) fn run(&mut self, mesh: &Mesh, point: Point, counts: impl Fn(u32) -> bool) -> i64 {
        self.start(point);
        while !self.finished() {
            self.step(mesh, &counts);
        }
        self.winding
    }

    /// Takes one triangle into account.
    fn count(&mut self, triangle: &[Point; 3]) {
        let p = &self.point;
        let mut outline = 0i64;
        for k in 0..3 {
            let (a, b) = (&triangle[k], &triangle[(k + 1) % 3]);
            if a.z <= p.z && p.z < b.z && turn_yz(a, b, p) == Ordering::Greater {
                outline += 1;
            } else if b.z <= p.z && p.z < a.z && turn_yz(a, b, p) == Ordering::Less {
                outline -= 1;
            }
        }
        if outline == 0 {
            return;
        }
        // The normal has the sign of `outline` along x: the triangle is ahead when the point is behind it.
        match (side(&triangle[0], &triangle[1], &triangle[2], p), outline) {
            (Ordering::Less, 1..) | (Ordering::Greater, ..=-1) => self.winding += outline,
            // On the surface itself: the distance is zero and decides.
            _ => {}
        }
    }
}

impl Mesh {
    /// A lower bound on the depth of a point under the surface of a solid that does not deform, own frame, metres,
    /// positive; `None`: it is not inside, or twice this many boxes do not decide it.
    pub(crate) fn depth_of(&self, point: &Point, boxes: usize) -> Option<f64> {
        if !self.solid || self.is_deforming() {
            return None;
        }
        let mut inside = Inside::default();
        inside.start(*point);
        for _ in 0..boxes {
            inside.step(self, |_| true);
        }
        if !inside.finished() || inside.winding() == 0 {
            return None;
        }
        let ((near_m, _), whole) = self.near_within(point, boxes);
        let depth_m = near_m * NEARLY - self.spare_m();
        (whole && depth_m > 0.0).then_some(depth_m)
    }
}

/// How often a closed surface, given by its triangles, winds around a point that is not on it.
pub(super) fn winding_of(point: Point, triangles: impl Iterator<Item = [Point; 3]>) -> i64 {
    let mut test = Inside::default();
    test.start(point);
    triangles.for_each(|triangle| test.count(&triangle));
    test.winding
}
