//! The walk over trees of axis-aligned boxes: its stages and its interval. The reference and baseline of the fronts.

use super::bound::Frame;
use super::contacts::{Contacts, LeafContact};
use super::containment::{Containment, ShellTests};
use super::front::{Entry, Front};
use super::retest::{reach_of, tree_of};
use super::side::{self, Side};
use super::{Goal, Witness};
use crate::math::{Interval, Pose};
use crate::narrow::arena::Arena;
use crate::shape::{Below, Node, Shape};
use crate::time::Meter;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// Not started, or an unsupported pair.
    #[default]
    Idle,
    Surfaces,
    Inside,
    Refine,
    Done,
}

/// One resumable query of a shape pair at a fixed relative pose. Reuses its memory from query to query.
#[derive(Debug, Default)]
pub struct Walk {
    frame: Frame,
    stage: Stage,
    front: Front,
    /// Boxes of the sides that are convex.
    one: Option<[Node; 2]>,
    /// One of the two is a solid mesh.
    solids: bool,
    shells: ShellTests,
    /// Always sound, metres.
    floor: f64,
    /// Least lower end of the leaf pairs queried, and least upper end of any gap, metres.
    leaf_low: f64,
    high: f64,
    /// A leaf pair touches or crosses.
    touches: bool,
    /// A leaf query near zero could not be finished.
    blurred: bool,
    witness: Option<Witness>,
    contacts: Contacts,
    arena: Arena<LeafContact>,
}

impl Walk {
    /// Starts a query; from here on [`Walk::interval`] is sound.
    ///
    /// * `pos12` - pose of `b` seen from `a`, finite, unit quaternion.
    ///
    /// At least one of the two must be a mesh, none a half-space or a mesh that deforms; else, or with a pose that is
    /// not finite, the interval stays unknown and the walk never finishes.
    pub fn start(&mut self, a: &Shape, b: &Shape, pos12: &Pose) {
        self.stage = Stage::Idle;
        self.front.clear();
        self.contacts.clear();
        self.one = None;
        self.floor = f64::NEG_INFINITY;
        self.leaf_low = f64::INFINITY;
        self.high = f64::INFINITY;
        self.touches = false;
        self.blurred = false;
        self.witness = None;
        self.shells.forget();
        self.shells.start(true);
        match (Side::of(a), Side::of(b)) {
            (Some(Side::Convex(_)), Some(Side::Convex(_))) => {}
            _ if a.is_deforming() || b.is_deforming() => {}
            (Some(side_a), Some(side_b)) => self.start_surfaces((a, side_a), (b, side_b), pos12),
            _ => {}
        }
    }

    /// Works until the goal is reached (true), `slice_units` are spent, or the meter closes.
    ///
    /// `a` and `b` are those of [`Walk::start`]. Units: a node test (cheap) each, a leaf query (costly) each.
    pub fn advance(
        &mut self,
        a: &Shape,
        b: &Shape,
        goal: Goal,
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let end = meter.spent().saturating_add(slice_units);
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

    /// Interval of the gap, metres: sound at any interruption, and never looser than before.
    ///
    /// It never loosens because a box's bound is never below that of its parent box, and both ends enclose the true
    /// gap: neither can pass the other.
    #[must_use]
    pub fn interval(&self) -> Interval {
        if self.stage == Stage::Idle {
            return Interval::UNKNOWN;
        }
        // Surfaces: the least of the open and the queried pairs.
        let surfaces = self.front.least().min(self.leaf_low).min(self.high);
        let (low, high) = match self.shells.state() {
            Containment::Open => (self.floor, self.high),
            Containment::Outside => (surfaces.max(self.floor), self.high),
            Containment::Inside => (self.floor, -surfaces.max(0.0)),
        };
        Interval::new(low.min(high), high)
    }

    /// Whether 0 in the interval of a reached goal means touching (law 3.4). False if a leaf query near zero could not
    /// be finished: then the pair stays `possible`.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.touches || !self.blurred
    }

    /// The leaf pair with the least gap found so far; its gap is that of two leaves. If one shape is within the other,
    /// the surfaces' nearest points found so far, with the normal that leads out.
    #[must_use]
    pub fn witness(&self) -> Option<Witness> {
        match (self.witness, self.shells.state()) {
            (Some(witness), Containment::Inside) => Some(witness.way_out(self.interval())),
            (witness, _) => witness,
        }
    }

    /// Leaf pairs that touch or cross, at most [`super::LEAF_CONTACTS_MAX`]; all of them once `Goal::Contacts` is
    /// reached, except [`Walk::contacts_left_out`]. Unordered. For a shape within another: the nearest points.
    #[must_use]
    pub fn contacts(&self) -> &[LeafContact] {
        self.contacts.all(&self.arena)
    }

    /// How many leaf contacts found no room.
    #[must_use]
    pub fn contacts_left_out(&self) -> u64 {
        self.contacts.left_out
    }

    fn start_surfaces(&mut self, a: (&Shape, Side<'_>), b: (&Shape, Side<'_>), pos12: &Pose) {
        let ((root_a, origin_a), (root_b, origin_b)) = (tree_of(a.0, a.1), tree_of(b.0, b.1));
        self.frame = Frame::new(pos12, (origin_a, reach_of(a.0)), (origin_b, reach_of(b.0)));
        if !self.frame.placed.slop.is_finite() {
            return;
        }
        self.one = Some([root_a, root_b]);
        let wholes = side::low((a.1, &origin_a), (b.1, &origin_b), &self.frame);
        let low = self.frame.low(&root_a, &root_b).max(wholes);
        // A ball around the deepest point fits into its solid, so into the box around that.
        let ball = |side: Side<'_>, node: &Node| match side {
            Side::Mesh(mesh) if !mesh.is_solid() => 0.0,
            _ => node.half().min(),
        };
        self.solids = a.1.solid().or(b.1.solid()).is_some();
        self.floor = if self.solids {
            low.max(-ball(a.1, &root_a).max(ball(b.1, &root_b)) - self.frame.placed.slop)
        } else {
            low
        };
        // The whole shapes are apart: nothing can be inside anything.
        self.shells.start(self.solids && low <= 0.0);

        // Any two points give an upper bound: those that face each other.
        let ahead = self.frame.between();
        let point_a = a.1.outlying(&ahead);
        let point_b = self
            .frame
            .placed
            .to_a(&b.1.outlying(&-self.frame.placed.turn_to_b(&ahead)));
        self.high = (point_b - point_a).norm() + self.frame.placed.slop;
        self.put(Entry { low, a: 0, b: 0 });
        self.stage = Stage::Surfaces;
        self.settle_stage();
    }

    fn reached(&self, goal: Goal) -> bool {
        match self.stage {
            Stage::Done => true,
            Stage::Idle | Stage::Inside => false,
            Stage::Surfaces => goal < Goal::Contacts && self.touches,
            Stage::Refine => {
                let inside = self.shells.state() == Containment::Inside;
                goal == Goal::Verdict || (goal == Goal::Gap && inside)
            }
        }
    }

    fn step(&mut self, a: &Shape, b: &Shape, meter: &mut Meter<'_>) {
        match (self.stage, Side::of(a), Side::of(b)) {
            (Stage::Inside, Some(a), Some(b)) => {
                self.shells.step(a, b, &self.frame.placed);
                meter.charge(1);
            }
            (_, Some(a), Some(b)) => {
                if let Some(entry) = self.front.take() {
                    self.expand(&entry, a, b, meter);
                }
            }
            _ => self.stage = Stage::Idle,
        }
        self.settle_stage();
    }

    /// Moves on to the next stage if this one has nothing left.
    fn settle_stage(&mut self) {
        if self.stage == Stage::Surfaces && self.front.is_apart() {
            self.stage = if self.touches {
                Stage::Done
            } else {
                Stage::Inside
            };
        }
        let containment = self.shells.state();
        if self.stage == Stage::Inside && containment != Containment::Open {
            self.stage = Stage::Refine;
        }
        // Settled when no open pair can beat the best leaf pair.
        if self.stage == Stage::Refine
            && self.front.is_apart()
            && self.front.least() >= self.leaf_low
        {
            self.stage = Stage::Done;
            if let (Containment::Inside, Some(way_out)) = (containment, self.witness()) {
                self.contacts.add(&mut self.arena, way_out);
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
            // Not reached: no walk of a mesh that deforms is started.
            (Below::Row(..), _) | (_, Below::Row(..)) => return,
            (Below::Nodes(al, ar), Below::Nodes(bl, br)) => {
                // The larger is split, so that both boxes shrink alike.
                if node_a.half().norm_squared() >= node_b.half().norm_squared() {
                    [(al, entry.b), (ar, entry.b)]
                } else {
                    [(entry.a, bl), (entry.a, br)]
                }
            }
        };
        let bounds = pairs.map(|(i, j)| self.frame.low(&nodes_a[i as usize], &nodes_b[j as usize]));
        meter.charge(2);
        // The nearer one last, so that it is on top of the stack; by its own bound, since the parent's may be greater
        // and is the same for both.
        let order = if bounds[0] <= bounds[1] {
            [1, 0]
        } else {
            [0, 1]
        };
        for k in order {
            let (a, b) = pairs[k];
            let low = bounds[k].max(entry.low);
            self.put(Entry { low, a, b });
        }
    }

    fn put(&mut self, entry: Entry) {
        if entry.low <= self.high {
            self.front.put(entry);
        }
    }

    fn query(&mut self, low: f64, a: (Side<'_>, u32), b: (Side<'_>, u32)) {
        let Ok(closest) = side::leaf(a, b, &self.frame.placed, self.high) else {
            return;
        };
        self.leaf_low = self.leaf_low.min(closest.gap.min.max(low));
        // A solid's depth is that of a point, and the translation that separates two leaves can be more: their query
        // proves an overlap, but not its depth.
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
            feature: 0,
            patch: 0,
            out_m: 0.0,
        };
        let better = |w: &Witness| closest.best_m < w.closest.best_m;
        if self.witness.as_ref().is_none_or(better) {
            self.witness = Some(contact);
        }
        if closest.gap.min <= 0.0 {
            // Certified, or zero within rounding: touching counts as colliding.
            if closest.gap.max <= 8.0 * self.frame.placed.slop || closest.finished {
                self.touches = true;
                self.contacts.add(&mut self.arena, contact);
            } else {
                self.blurred = true;
            }
        }
    }
}
