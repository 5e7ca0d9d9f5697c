//! The place of a body and how well it is known: status, reach, proxy, and their changes in the lists of the tick.
//!
//! In: a pose, a refusal, an age, an edit. Out: the body as the engine sees it, and its place in the change set.

use std::sync::Arc;

use super::World;
use super::bend::Vertices;
use super::body::{Body, Motion};
use super::filters::Hot;
use super::names::NameId;
use super::parts::{Parts, PlacedShape};
use super::path::Path;
use super::tag::Tag;
use crate::config::OnStale;
use crate::ids::BodySlot;
use crate::math::{Aabb, Point, Pose, ROUND};
use crate::scene::BodySpec;
use crate::shape::Geometry;
use crate::wire::{BodyStatus, EndCause};

/// Data of a body that only the world uses.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) spec: Option<Arc<BodySpec>>,
    pub(super) enabled: bool,
    /// Whether a pose was admitted since the body was put or reset; always true for a body that cannot move.
    pub(super) has_pose: bool,
    /// Whether its newest pose was refused.
    pub(super) refused: bool,
    /// Whether it is in `World::growing`.
    pub(super) growing: bool,
    /// The last admitted row as received: position, then quaternion x, y, z, w.
    pub(super) raw: [f64; 7],
    /// Stamp of the last pause that confirmed its pose, nanoseconds; 0: the pause had no stamp.
    pub(super) stood_ns: Option<u64>,
    /// Number of the last pose frame that contained it.
    pub(super) seen: u64,
    /// Number of the last pose frame that contained it more than once.
    pub(super) twice: u64,
    /// Tick in which its pose, age or status last changed.
    pub(super) touched: u64,
    /// Tight box at the body's pose; for a continuous body: around its path since the last tick.
    pub(super) tight: Aabb,
    /// By how much `Body::proxy` is wider than `tight`, metres.
    pub(super) widened_m: f64,
    /// The body that it is attached to, and its pose relative to that body.
    pub(super) attach: Option<(NameId, Pose)>,
    /// The last body of its chain of attachments (itself without one), and its pose relative to that.
    pub(super) root: BodySlot,
    pub(super) root_pose: Pose,
}

impl Entry {
    /// The entry of a slot without a body.
    pub(super) fn gone(slot: BodySlot) -> Self {
        Self {
            spec: None,
            enabled: false,
            has_pose: false,
            refused: false,
            growing: false,
            raw: [f64::NAN; 7],
            stood_ns: None,
            seen: 0,
            twice: 0,
            touched: 0,
            tight: Aabb::empty(),
            widened_m: 0.0,
            attach: None,
            root: slot,
            root_pose: Pose::identity(),
        }
    }
}

/// How well the place of a body is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Judgement {
    pub(super) status: BodyStatus,
    pub(super) reach_m: f64,
    pub(super) in_broad: bool,
}

impl World {
    /// Judges how well the place of a body is known at `self.now_ns`.
    pub(super) fn judge(&self, slot: BodySlot, body: &Body) -> Judgement {
        let entry = &self.entries[slot.index()];
        let root = &self.entries[entry.root.index()];
        let of_root = if entry.root == slot {
            None
        } else {
            self.body(entry.root)
        };
        let vertices = || {
            let bodies = std::iter::once(body).chain(of_root);
            bodies.filter_map(|body| body.vertices.as_deref())
        };
        let has_vertices = vertices().all(|v| v.version.is_some());
        let (status, reach_m) = if !entry.enabled {
            (BodyStatus::Disabled, 0.0)
        } else if !body.moves {
            (BodyStatus::Known, 0.0)
        } else if root.refused || vertices().any(|v| v.refused.is_some()) {
            // Its `max_speed_mps` does not bound it: a sender of invalid poses may have other faults.
            (BodyStatus::Rejected, f64::INFINITY)
        } else if !(root.has_pose && has_vertices) {
            (BodyStatus::NotReceived, f64::INFINITY)
        } else {
            self.judge_age(body, entry.root)
        };
        let in_broad = match status {
            BodyStatus::Known | BodyStatus::Stale | BodyStatus::Held => true,
            // Kept at its last good pose, if it has one.
            BodyStatus::Rejected if root.has_pose && has_vertices => true,
            BodyStatus::NotReceived | BodyStatus::Rejected | BodyStatus::RemovedByAge => {
                self.stays_for_its_way(slot)
            }
            BodyStatus::Disabled | BodyStatus::Truncated => false,
        };
        Judgement {
            status,
            reach_m,
            in_broad,
        }
    }

    /// Judges by age. Age and `on_stale` are the root's; `max_speed_mps` is the body's own.
    fn judge_age(&self, body: &Body, root: BodySlot) -> (BodyStatus, f64) {
        let root_body = self.body(root).unwrap_or(body);
        if !self.is_too_old(root_body, self.now_ns) {
            return (BodyStatus::Known, 0.0);
        }
        match self.on_stale_of(root_body) {
            // A newer frame may follow within this tick.
            OnStale::Remove if self.admits && root_body.in_broad => (BodyStatus::Known, 0.0),
            OnStale::Hold => (BodyStatus::Held, 0.0),
            OnStale::Remove => (BodyStatus::RemovedByAge, f64::INFINITY),
            OnStale::Unknown => (BodyStatus::Stale, self.reach_of(body, root)),
        }
    }

    /// Largest distance of a body from its last good pose by now, metres; infinite without a bound.
    fn reach_of(&self, body: &Body, root: BodySlot) -> f64 {
        let since_ns = self.body(root).unwrap_or(body).since_ns;
        let (Some(speed_mps), Some(since_ns)) = (body.max_speed_mps, since_ns) else {
            return f64::INFINITY;
        };
        // Three roundings of half an ulp each; four are added.
        let age_s = self.now_ns.saturating_sub(since_ns) as f64 * 1e-9;
        let reach_m = (speed_mps * age_s * (1.0 + 8.0 * ROUND)).next_up();
        if reach_m <= self.stale_reach_m {
            reach_m
        } else {
            f64::INFINITY
        }
    }

    /// Puts a body at a pose, and updates its motion bound and tight box.
    ///
    /// No length bounds the motion of a half-space. Certificates of one that cannot move count no motion, so if an edit
    /// moves it, its pairs begin again.
    ///
    /// * returns - whether the pose changed, bit by bit.
    pub(super) fn place(&mut self, slot: BodySlot, pose: &Pose) -> bool {
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return false;
        };
        if same_bits(&body.pose, pose) {
            return false;
        }
        body.pose = *pose;
        if !body.unbounded {
            body.motion.advance(pose, &body.centre, body.radius);
        }
        let is_base = body.unbounded && !body.moves;
        self.entries[slot.index()].tight = tight_box(&body.shapes, pose);
        if is_base {
            self.begin_anew(slot);
        }
        true
    }

    /// Judges a body again, and updates its proxy, flags, counts and the change set.
    ///
    /// * `pose_changed` - whether [`World::place`] moved it since it was settled last.
    pub(super) fn settle(&mut self, slot: BodySlot, pose_changed: bool) {
        let Some(body) = self.body(slot) else {
            return;
        };
        let judged = self.judge(slot, body);
        let (was_status, was_reach_m, was_in) = (body.status, body.reach_m, body.in_broad);
        let widened_m = self.widening(slot, body, judged.reach_m);
        self.touch(slot);
        let entry = &mut self.entries[slot.index()];
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return;
        };
        let rewidened = widened_m.to_bits() != entry.widened_m.to_bits();
        if pose_changed || rewidened {
            entry.widened_m = widened_m;
            body.proxy = entry.tight.widened(widened_m);
        }
        body.status = judged.status;
        body.reach_m = judged.reach_m;
        body.in_broad = judged.in_broad;
        self.tags.set(slot, Some(Tag::of(body)));
        let status_changed = was_status != judged.status;
        if status_changed {
            self.by_status[usize::from(was_status.code())] -= 1;
            self.by_status[usize::from(judged.status.code())] += 1;
        }
        let restated = status_changed || was_reach_m.to_bits() != judged.reach_m.to_bits();
        self.watch(slot, judged);
        self.flag_lost(slot, judged, was_in);
        self.list(
            slot,
            was_in,
            judged,
            pose_changed || rewidened,
            restated && !pose_changed,
        );
    }

    /// Sets the deadline and the growth that follow from a judgement.
    fn watch(&mut self, slot: BodySlot, judged: Judgement) {
        let Some(body) = self.bodies[slot.index()].as_ref() else {
            return;
        };
        // An attached body is judged together with its root.
        let root = self.body(self.entries[slot.index()].root).unwrap_or(body);
        let deadline_ns = (body.moves && judged.status == BodyStatus::Known).then(|| {
            body.since_ns
                .unwrap_or_default()
                .saturating_add(self.timeout_of(root))
        });
        let stamp_ns = (judged.in_broad && body.moves).then_some(body.stamp_ns);
        self.ages.set(slot, deadline_ns, stamp_ns);
        let entry = &mut self.entries[slot.index()];
        if grows(judged.status, judged.reach_m) && !entry.growing {
            entry.growing = true;
            self.growing.push(slot);
        }
    }

    /// Records a change in the lists of the tick.
    fn list(&mut self, slot: BodySlot, was_in: bool, now: Judgement, moved: bool, restated: bool) {
        match (was_in, now.in_broad) {
            (false, true) => {
                self.lists.insert(slot);
                if let Some(body) = self.bodies[slot.index()].as_mut() {
                    body.motion.anchor_here(&body.pose);
                }
            }
            (true, false) => self.lists.remove(slot, cause_of(now.status)),
            (true, true) if moved => self.lists.moved(slot),
            _ => {}
        }
        if restated {
            self.lists.restated(slot);
        }
    }

    /// Widening of a body's tight box at a reach, metres.
    ///
    /// An infinite reach does not widen the box: existing pairs are kept, and no new ones are made.
    pub(super) fn widening(&self, slot: BodySlot, body: &Body, reach_m: f64) -> f64 {
        let margin_m = self.margin_of(slot, body);
        if reach_m.is_finite() {
            (margin_m + reach_m).next_up()
        } else {
            self.entries[slot.index()].widened_m.max(margin_m)
        }
    }

    /// Widening of the tight box of a body whose place is known, metres.
    pub(super) fn margin_of(&self, slot: BodySlot, body: &Body) -> f64 {
        let ruled_m = self.filters.margins_m.get(slot.index()).copied();
        body.report_within_m.max(ruled_m.unwrap_or_default())
    }

    /// The filters' data of a slot.
    pub(super) fn hot(&mut self, slot: BodySlot) -> Option<&mut Hot> {
        self.filters.bodies.get_mut(slot.index())
    }
}

/// Whether the reach of a body grows from tick to tick.
pub(super) fn grows(status: BodyStatus, reach_m: f64) -> bool {
    status == BodyStatus::Stale && reach_m.is_finite()
}

/// The cause of the ends of a body's pairs when it leaves the broad phase.
fn cause_of(status: BodyStatus) -> EndCause {
    match status {
        BodyStatus::Disabled => EndCause::Disabled,
        BodyStatus::RemovedByAge => EndCause::SourceLost,
        _ => EndCause::Reset,
    }
}

/// A body at rest at its start pose, from its entry in the scene.
pub(super) fn new_body(spec: &BodySpec, shapes: Parts, generation: u32) -> (Body, Aabb) {
    let is_half_space = |s: &PlacedShape| matches!(s.shape.geometry, Geometry::HalfSpace { .. });
    let unbounded = shapes.iter().any(is_half_space);
    let only_half_spaces = shapes.iter().all(is_half_space);
    let (centre, radius) = sphere_around(&shapes, unbounded);
    let tight = tight_box(&shapes, &spec.pose);
    // A half-space has no bounding box or sphere, so it cannot be swept.
    let path = (spec.continuous && !unbounded).then(|| {
        let mut path = Path::new(centre, radius, spec.teleport_m, true);
        path.restart(tight);
        Box::new(path)
    });
    let bends = shapes.first().filter(|_| spec.deforms);
    let vertices = bends.map(|placed| Box::new(Vertices::of(&placed.shape)));
    let body = Body {
        id: spec.id,
        name: spec.name.clone(),
        generation,
        shapes,
        moves: spec.moves,
        unbounded,
        only_half_spaces,
        pose: spec.pose,
        velocity: None,
        centre,
        radius,
        motion: Motion::at(&spec.pose),
        path,
        vertices,
        proxy: tight.widened(spec.report_within_m),
        // The caller settles it; until then it has the status of a body without a pose.
        status: BodyStatus::NotReceived,
        reach_m: f64::INFINITY,
        reject: None,
        source: None,
        stamp_ns: 0,
        since_ns: None,
        received_ns: 0,
        lent_timeout_ns: u64::MAX,
        report_within_m: spec.report_within_m,
        max_speed_mps: spec.max_speed_mps,
        priority: spec.priority,
        on_stale: spec.on_stale,
        in_broad: false,
    };
    (body, tight)
}

/// The tight box of shapes at a body's pose, rounded outward.
pub(super) fn tight_box(shapes: &[PlacedShape], pose: &Pose) -> Aabb {
    let at = &pose.translation.vector;
    shapes.iter().fold(Aabb::empty(), |all, placed| {
        let on = &placed.pose.translation.vector;
        let own = &placed.shape.aabb.max.coords;
        let tight = placed.shape.aabb_at(&(pose * placed.pose));
        // The box is tight at the rounded product of the two poses; this bounds the distance to the true product.
        let rounding_m = 32.0 * ROUND * (at.amax() + on.amax() + own.amax());
        all.merged(&if rounding_m.is_finite() {
            tight.widened(rounding_m)
        } else {
            tight
        })
    })
}

/// Centre and radius of a sphere around all shapes, body frame; the radius is rounded up.
fn sphere_around(shapes: &[PlacedShape], unbounded: bool) -> (Point, f64) {
    if unbounded {
        return (Point::origin(), f64::INFINITY);
    }
    let centres = || shapes.iter().map(|s| s.pose * s.shape.centre);
    let centre = match shapes {
        [_] => centres().next().unwrap_or_else(Point::origin),
        _ => Aabb::of(&centres().collect::<Vec<_>>()).centre(),
    };
    let radius = centres()
        .zip(shapes)
        .map(|(at, placed)| (at - centre).norm() + placed.shape.radius)
        .fold(0.0, f64::max);
    // Bounds the rounding of a rotation, a translation and a difference of coordinates of this size.
    let magnitude = shapes
        .iter()
        .map(|s| s.pose.translation.vector.amax() + s.shape.centre.coords.amax())
        .fold(radius, f64::max);
    (centre, radius + 32.0 * ROUND * magnitude)
}

pub(super) fn same_bits(one: &Pose, other: &Pose) -> bool {
    let (v, w) = (&one.translation.vector, &other.translation.vector);
    let (q, r) = (&one.rotation.as_vector(), &other.rotation.as_vector());
    v.iter()
        .zip(w.iter())
        .all(|(a, b)| a.to_bits() == b.to_bits())
        && q.iter()
            .zip(r.iter())
            .all(|(a, b)| a.to_bits() == b.to_bits())
}
