//! The walk itself: its stages, its front, its interval.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::bound::Frame;
use super::contacts::{Contacts, LeafContact};
use super::half_space::HalfSpaceWalk;
use super::side::{Side, leaf};
use super::{Closest, Witness};
use crate::math::{Interval, Point, Pose};
use crate::shape::{Below, Geometry, Inside, Mesh, Node, Shape};
use crate::time::Meter;

/// Entries of the heap, 16 bytes each; beyond it pairs go to the stack, which is slower and as sound.
const FRONT_MAX: usize = 1 << 20;

/// How far a walk is to go. A later goal can be asked for when an earlier one is reached; nothing is done twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Goal {
    /// Until the pair is certified colliding or proved apart.
    Verdict,
    /// Until the least distance is exact; an overlapping pair needs no more than its verdict.
    Gap,
    /// Until all touching or crossing leaf pairs are met, or the least distance is exact.
    Contacts,
}

/// A pair of nodes, and a lower bound on the gap of what they hold.
#[derive(Clone, Copy, Debug)]
struct Entry {
    low: f64,
    a: u32,
    b: u32,
}

impl Ord for Entry {
    /// The least bound is the greatest entry, so that a heap yields it first.
    fn cmp(&self, other: &Self) -> Ordering {
        let places = |e: &Self| (e.a, e.b);
        (other.low.total_cmp(&self.low)).then_with(|| places(other).cmp(&places(self)))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// Not started, or a pair that is none of ours.
    #[default]
    Idle,
    HalfSpace,
    Surfaces,
    Inside,
    Refine,
    Done,
}

/// What is known of the inside tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Containment {
    /// One of the two may hold a part of the other.
    #[default]
    Open,
    /// No surface of the one lies in the other.
    Outside,
    /// One does.
    Inside,
}

/// One resumable query of a shape pair at a fixed relative pose. Keeps its memory from query to query.
#[derive(Debug, Default)]
pub struct Walk {
    frame: Frame,
    stage: Stage,
    /// Pairs of boxes that may touch.
    stack: Vec<Entry>,
    /// Pairs of boxes proved apart.
    heap: BinaryHeap<Entry>,
    /// Boxes of the sides that are convex.
    one: Option<[Node; 2]>,
    /// A solid mesh takes part.
    solids: bool,
    containment: Containment,
    inside: Inside,
    /// Next inside test: 0: points of A in B, 1: points of B in A; and which point.
    next_point: (usize, usize),
    testing: bool,
    /// Sound whatever else is known, metres.
    floor: f64,
    /// Least lower end of the leaf pairs queried, and least upper end of any gap, metres.
    leaf_low: f64,
    high: f64,
    /// A leaf pair touches or crosses.
    touches: bool,
    witness: Option<Witness>,
    contacts: Contacts,
    half_space: HalfSpaceWalk,
}

impl Walk {
    /// Starts a query; from here on [`Walk::interval`] is sound.
    ///
    /// * `pos12` - pose of `b` seen from `a`, finite, unit quaternion.
    ///
    /// At least one of the two is a mesh; else the interval stays unknown and the walk never finishes.
    pub fn start(&mut self, a: &Shape, b: &Shape, pos12: &Pose) {
        self.stage = Stage::Idle;
        self.stack.clear();
        self.heap.clear();
        self.contacts.clear();
        self.containment = Containment::Open;
        self.next_point = (0, 0);
        self.testing = false;
        self.floor = f64::NEG_INFINITY;
        self.leaf_low = f64::INFINITY;
        self.high = f64::INFINITY;
        self.touches = false;
        self.witness = None;
        match (Side::of(a), Side::of(b)) {
            (Some(Side::Convex(_)), Some(Side::Convex(_))) => {}
            (Some(side_a), Some(side_b)) => self.start_surfaces((a, side_a), (b, side_b), pos12),
            (None, Some(Side::Mesh(mesh))) => self.start_half_space(a, mesh, pos12, false),
            (Some(Side::Mesh(mesh)), None) => self.start_half_space(b, mesh, pos12, true),
            _ => {}
        }
    }

    /// Goes on until the goal is reached (true), `slice_units` are spent, or the meter closes.
    ///
    /// `a` and `b` are those of [`Walk::start`]. Units: a node test each, charged cheap; a leaf query each, dear.
    pub fn advance(
        &mut self,
        a: &Shape,
        b: &Shape,
        goal: Goal,
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let end = meter.spent().saturating_add(slice_units);
        if goal == Goal::Contacts && self.stage != Stage::Idle && self.one.is_none() {
            self.stage = Stage::HalfSpace;
            self.half_space.collect();
        }
        loop {
            if self.reached(goal) {
                return true;
            }
            if self.stage == Stage::Idle || meter.spent() >= end || !meter.open() {
                return false;
            }
            self.step(a, b, meter);
        }
    }

    /// What is known of the gap, metres: sound at any interruption, and never looser than before.
    ///
    /// It never loosens because a box's bound is never below that of the box it came from, and both ends hold the
    /// truth: neither can pass the other.
    #[must_use]
    pub fn interval(&self) -> Interval {
        if self.stage == Stage::Idle {
            return Interval::UNKNOWN;
        }
        if self.one.is_none() {
            return self.half_space.interval();
        }
        // Surfaces: the least of what is open and what was queried.
        let top = self.heap.peek().map_or(f64::INFINITY, |e| e.low);
        let open = (self.stack.iter()).fold(top, |low, entry| low.min(entry.low));
        let surfaces = open.min(self.leaf_low).min(self.high);
        let (low, high) = match self.containment {
            Containment::Open => (self.floor, self.high),
            Containment::Outside => (surfaces.max(self.floor), self.high),
            Containment::Inside => (self.floor, -surfaces.max(0.0)),
        };
        Interval::new(low.min(high), high)
    }

    /// The leaf pair with the least gap met so far; its gap is that of two leaves. Where one shape is within the
    /// other, the surfaces' nearest points met so far, with the normal that leads out.
    #[must_use]
    pub fn witness(&self) -> Option<Witness> {
        match (self.witness, self.containment) {
            (Some(witness), Containment::Inside) => Some(self.way_out(&witness)),
            (witness, _) => witness,
        }
    }

    /// Of surfaces that are apart though one shape is within the other: moving B towards A's nearest point leads out.
    fn way_out(&self, witness: &Witness) -> Witness {
        let found = witness.closest;
        let closest = Closest {
            gap: self.interval(),
            best_m: (-found.best_m).clamp(self.interval().min, self.interval().max),
            normal: -found.normal,
            ..found
        };
        LeafContact {
            closest,
            ..*witness
        }
    }

    /// Leaf pairs that touch or cross, at most [`super::LEAF_CONTACTS_MAX`]; all of them once `Goal::Contacts` is
    /// reached, but for [`Walk::contacts_left_out`]. In no order.
    #[must_use]
    pub fn contacts(&self) -> &[LeafContact] {
        self.contacts.all()
    }

    /// How many leaf contacts had no room.
    #[must_use]
    pub fn contacts_left_out(&self) -> u64 {
        self.contacts.left_out
    }

    fn start_surfaces(&mut self, a: (&Shape, Side<'_>), b: (&Shape, Side<'_>), pos12: &Pose) {
        let (root_a, root_b) = (tree_of(a.0, a.1), tree_of(b.0, b.1));
        self.frame = Frame::new(pos12, (root_a.1, reach_of(a.0)), (root_b.1, reach_of(b.0)));
        if !self.frame.slop.is_finite() {
            return;
        }
        self.one = Some([root_a.0, root_b.0]);
        let low = self.frame.low(&root_a.0, &root_b.0);
        // A ball about the deepest point fits into the solid that it is in, so into the box around that.
        let ball = |side: Side<'_>, node: &Node| match side {
            Side::Mesh(mesh) if !mesh.is_solid() => 0.0,
            _ => node.half().min(),
        };
        self.solids = a.1.has_inside_test() || b.1.has_inside_test();
        self.floor = if self.solids {
            low.max(-ball(a.1, &root_a.0).max(ball(b.1, &root_b.0)) - self.frame.slop)
        } else {
            low
        };
        // Roots apart: nothing can be inside anything.
        if low > 0.0 || !self.solids {
            self.containment = Containment::Outside;
        }

        // Any two points of the two are an upper bound: those that face each other.
        let ahead = self.frame.between();
        let point_a = a.1.outlying(&ahead);
        let point_b = self
            .frame
            .to_a(&b.1.outlying(&-self.frame.turn_to_b(&ahead)));
        self.high = (point_b - point_a).norm() + self.frame.slop;
        self.put(Entry { low, a: 0, b: 0 });
        self.stage = Stage::Surfaces;
        self.settle_stage();
    }

    fn start_half_space(&mut self, plane: &Shape, mesh: &Mesh, pos12: &Pose, is_b: bool) {
        let Geometry::HalfSpace { normal, offset } = &plane.geometry else {
            return;
        };
        self.one = None;
        if self.half_space.start(mesh, (normal, *offset), pos12, is_b) {
            self.stage = Stage::HalfSpace;
        }
    }

    fn reached(&self, goal: Goal) -> bool {
        match self.stage {
            Stage::Done => true,
            Stage::Idle | Stage::Inside => false,
            Stage::HalfSpace => {
                let interval = self.half_space.interval();
                goal == Goal::Verdict && (interval.min > 0.0 || interval.max <= 0.0)
            }
            Stage::Surfaces => goal < Goal::Contacts && self.touches,
            Stage::Refine => {
                goal == Goal::Verdict
                    || (goal == Goal::Gap && self.containment == Containment::Inside)
            }
        }
    }

    fn step(&mut self, a: &Shape, b: &Shape, meter: &mut Meter<'_>) {
        match (self.stage, Side::of(a), Side::of(b)) {
            (Stage::HalfSpace, Some(Side::Mesh(mesh)), _)
            | (Stage::HalfSpace, _, Some(Side::Mesh(mesh))) => {
                self.half_space.step(mesh, &mut self.contacts);
                meter.charge(1);
                self.witness = self.half_space.witness();
                if self.half_space.finished() {
                    self.stage = Stage::Done;
                }
            }
            (Stage::Inside, Some(a), Some(b)) => {
                self.step_inside(a, b);
                meter.charge(1);
            }
            (_, Some(a), Some(b)) => {
                let entry = self.stack.pop().or_else(|| self.heap.pop());
                if let Some(entry) = entry {
                    self.expand(&entry, a, b, meter);
                }
            }
            _ => self.stage = Stage::Idle,
        }
        self.settle_stage();
    }

    /// Moves on to the next stage where this one has nothing left.
    fn settle_stage(&mut self) {
        if self.stage == Stage::Surfaces && self.stack.is_empty() {
            self.stage = match (self.touches, self.containment) {
                (true, _) => Stage::Done,
                (false, Containment::Open) => Stage::Inside,
                (false, _) => Stage::Refine,
            };
        }
        if self.stage == Stage::Refine && self.stack.is_empty() {
            // Settled when nothing on the heap can beat the best leaf pair.
            let open = self.heap.peek().map_or(f64::INFINITY, |e| e.low);
            if open >= self.leaf_low {
                self.stage = Stage::Done;
                if let (Containment::Inside, Some(way_out)) = (self.containment, self.witness()) {
                    self.contacts.add(way_out);
                }
            }
        }
    }

    /// Replaces a pair of boxes by smaller ones, or queries two leaves.
    fn expand(&mut self, entry: &Entry, a: Side<'_>, b: Side<'_>, meter: &mut Meter<'_>) {
        let Some(one) = self.one else { return };
        if entry.low > self.high {
            // Nothing in it can be the nearest.
            return;
        }
        let (nodes_a, nodes_b) = (a.nodes(&one[0]), b.nodes(&one[1]));
        let (node_a, node_b) = (&nodes_a[entry.a as usize], &nodes_b[entry.b as usize]);
        let pairs = match (node_a.below(entry.a), node_b.below(entry.b)) {
            (Below::Triangle(i), Below::Triangle(j)) => {
                self.query(entry.low, (a, i), (b, j));
                meter.charge_dear(1);
                return;
            }
            (Below::Nodes(left, right), Below::Triangle(_)) => [(left, entry.b), (right, entry.b)],
            (Below::Triangle(_), Below::Nodes(left, right)) => [(entry.a, left), (entry.a, right)],
            (Below::Nodes(al, ar), Below::Nodes(bl, br)) => {
                // The larger is parted, so that both boxes shrink alike.
                if node_a.half().norm_squared() >= node_b.half().norm_squared() {
                    [(al, entry.b), (ar, entry.b)]
                } else {
                    [(entry.a, bl), (entry.a, br)]
                }
            }
        };
        let [first, second] = pairs.map(|(i, j)| Entry {
            low: (self.frame.low(&nodes_a[i as usize], &nodes_b[j as usize])).max(entry.low),
            a: i,
            b: j,
        });
        meter.charge(2);
        // The nearer one last, so that it is on top of the stack.
        let (near, far) = if first.low <= second.low {
            (first, second)
        } else {
            (second, first)
        };
        self.put(far);
        self.put(near);
    }

    fn put(&mut self, entry: Entry) {
        if entry.low > self.high {
            return;
        }
        if entry.low > 0.0 && self.heap.len() < FRONT_MAX {
            self.heap.push(entry);
        } else {
            self.stack.push(entry);
        }
    }

    fn query(&mut self, low: f64, a: (Side<'_>, u32), b: (Side<'_>, u32)) {
        let Some(closest) = leaf(a, b, &self.frame, self.high) else {
            return;
        };
        self.leaf_low = self.leaf_low.min(closest.gap.min.max(low));
        // A solid's depth is that of a point, and the translation that parts two leaves can be more: of an overlap
        // their query proves no more than that it is one.
        let high = if self.solids {
            closest.gap.max.max(0.0)
        } else {
            closest.gap.max
        };
        self.high = self.high.min(high);
        let triangle = |(side, i): (Side<'_>, u32)| match side {
            Side::Mesh(_) => i,
            Side::Convex(_) => u32::MAX,
        };
        let contact = LeafContact {
            closest,
            triangle_a: triangle(a),
            triangle_b: triangle(b),
        };
        let better = |w: &Witness| closest.best_m < w.closest.best_m;
        if self.witness.as_ref().is_none_or(better) {
            self.witness = Some(contact);
        }
        if closest.gap.min <= 0.0 {
            // Certified, or zero within its rounding: touching collides.
            self.touches |= closest.gap.max <= 8.0 * self.frame.slop || closest.finished;
            self.contacts.add(contact);
        }
    }

    /// One node of an inside test; starts the next test where one is over.
    fn step_inside(&mut self, a: Side<'_>, b: Side<'_>) {
        let (way, place) = self.next_point;
        let (of, within) = if way == 0 { (a, b) } else { (b, a) };
        let solid = match within {
            Side::Mesh(mesh) if way < 2 && mesh.is_solid() => mesh,
            _ if way < 2 => {
                self.next_point = (way + 1, 0);
                return;
            }
            _ => {
                self.containment = Containment::Outside;
                self.stage = Stage::Refine;
                return;
            }
        };
        if !self.testing {
            if place == of.shell_count() {
                self.next_point = (way + 1, 0);
                return;
            }
            let point: Point = of.shell_point(place);
            let seen = if way == 0 {
                self.frame.to_b(&point)
            } else {
                self.frame.to_a(&point)
            };
            self.inside.start(seen);
            self.testing = true;
        }
        self.inside.step(solid, |_| true);
        if self.inside.finished() {
            self.testing = false;
            self.next_point = (way, place + 1);
            if self.inside.winding() != 0 {
                self.containment = Containment::Inside;
                self.stage = Stage::Refine;
            }
        }
    }
}

/// The root box of a side and what it is relative to, own frame.
fn tree_of(shape: &Shape, side: Side<'_>) -> (Node, Point) {
    match side {
        Side::Mesh(mesh) => (mesh.tree().nodes()[0], mesh.tree().origin()),
        Side::Convex(_) => {
            let origin = shape.aabb.centre();
            let (low, high) = (shape.aabb.min - origin, shape.aabb.max - origin);
            (Node::leaf(&low, &high, 0), origin)
        }
    }
}

/// Greatest distance of a point from the local origin, rounded up a little.
fn reach_of(shape: &Shape) -> f64 {
    shape.centre.coords.norm() + shape.radius
}

/// Queries the leaf pair of last tick's contact again: one unit. `None` when the two have no such leaves.
///
/// * `triangle_a`, `triangle_b` - of a [`Witness`] or [`LeafContact`]; `u32::MAX` for a side that is no mesh.
#[must_use]
pub fn retest_witness(
    a: &Shape,
    b: &Shape,
    pos12: &Pose,
    triangle_a: u32,
    triangle_b: u32,
) -> Option<Closest> {
    let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
    let there = |side: Side<'_>, i: u32| match side {
        Side::Mesh(mesh) => (i as usize) < mesh.faces().len(),
        Side::Convex(_) => true,
    };
    if !there(side_a, triangle_a) || !there(side_b, triangle_b) {
        return None;
    }
    let frame = Frame::new(
        pos12,
        (tree_of(a, side_a).1, reach_of(a)),
        (tree_of(b, side_b).1, reach_of(b)),
    );
    if !frame.slop.is_finite() {
        return None;
    }
    leaf(
        (side_a, triangle_a),
        (side_b, triangle_b),
        &frame,
        f64::INFINITY,
    )
}
