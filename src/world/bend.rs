//! Vertices: the newest shapes of bodies that deform.
//!
//! In: vertex frames from a client that may be wrong in every field. Out: new vertices, with motion sums and boxes
//! updated at once, refusals counted, bodies marked unknown. A frame is checked as a whole before any of it is applied,
//! so a refused one leaves the last good shape. No allocation, unless another owner holds the shape at that moment.

use std::sync::Arc;

use super::World;
use super::admit::Admission;
use super::body::Body;
use super::place::tight_box;
use super::source::{Standing, owns, stand_beside};
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::limits::DEFORMING_VERTICES_MAX;
use crate::math::Aabb;
use crate::shape::{NoVertex, Shape, can_be_vertices};
use crate::wire::{RejectReason, VertexFrame, VertexHeader, WIRE_VERSION, name_str, vertex_flags};

/// State of the vertices of a body that deforms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertices {
    /// Version of its vertices; `None`: those of the scene, none were sent in this session.
    pub version: Option<u64>,
    /// Why its newest vertices were refused, if they were.
    pub refused: Option<RejectReason>,
    /// Box and radius in the scene, by which a put detects whether the shape is another.
    pub(super) rest: (Aabb, f64),
    /// Number of updates.
    pub(super) updates: u64,
    /// The last requested tree could not be built.
    pub(super) unbuilt: Option<Unbuilt>,
}

/// A tree that could not be built: it is not requested again before there are other vertices; after each further
/// failure the wait doubles, in updates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unbuilt {
    pub(super) times: u32,
    pub(super) until: u64,
}

impl Vertices {
    /// For a body that deforms, as the scene defines it.
    pub(super) fn of(shape: &Shape) -> Self {
        Self {
            version: None,
            refused: None,
            rest: (shape.aabb, shape.radius),
            updates: 0,
            unbuilt: None,
        }
    }

    /// Resets the state.
    pub(super) fn forget(&mut self) {
        (self.version, self.refused) = (None, None);
    }
}

impl Body {
    /// The single shape of a body that deforms.
    pub(super) fn bending_shape(&mut self) -> Option<&mut Shape> {
        self.vertices.as_ref()?;
        // Another owner that measures the body at this moment keeps the old state.
        let placed = self.shapes.only_mut()?;
        Some(Arc::make_mut(&mut placed.shape))
    }

    /// Returns whether boxes in its tree are older than its vertices.
    #[must_use]
    pub fn lags(&self) -> bool {
        let lags = |body: &Self| body.shapes.first().is_some_and(|p| p.shape.lag_m() > 0.0);
        self.vertices.is_some() && lags(self)
    }

    /// Fits all boxes of its tree to its vertices, in a separate copy if there are other owners of the shape.
    ///
    /// Cost: O(triangles) if they lag, else none.
    pub fn fit_boxes(&mut self) {
        // Modifying a shared shape copies it.
        if !self.lags() {
            return;
        }
        if let Some(shape) = self.bending_shape() {
            // A round in progress is finished first, and boxes done in it may be older than the last vertices.
            while shape.refit(usize::MAX) > 0 {}
        }
    }
}

impl World {
    /// The bodies that deform, in arbitrary order.
    #[must_use]
    pub fn deforming(&self) -> &[BodySlot] {
        &self.deforming
    }

    /// Fits boxes of a body that deforms to its vertices, at most `packs_max` packs of them; returns how many were
    /// done.
    pub fn refit(&mut self, slot: BodySlot, packs_max: usize) -> usize {
        let body = self.bodies.get_mut(slot.index()).and_then(Option::as_mut);
        // Checked first: modifying a shared shape copies it.
        match body
            .filter(|body| body.lags())
            .and_then(Body::bending_shape)
        {
            Some(shape) => shape.refit(packs_max),
            None => 0,
        }
    }

    /// Admits vertices of one body, or returns why not. Bad input is counted, never an error.
    ///
    /// Only the source that may move the body may bend it, in a session under the same rules as for poses. Wrong
    /// vertices from the right sender leave the body unknown until good ones of all vertices come; an older version, or
    /// the same again, changes nothing.
    ///
    /// Vertices that belong to a frame that waits for a scene revision wait with it.
    ///
    /// Cost: O(rows).
    pub fn admit_vertices(&mut self, frame: &VertexFrame, now_boot_ns: u64) -> Admission {
        self.now_ns = self.now_ns.max(now_boot_ns);
        let source = name_str(&frame.header.source).and_then(|name| self.source_named(name));
        let waits = source.filter(|source| self.bends_later(*source, frame));
        match waits {
            Some(source) => Admission::Waiting { source },
            None => self.admit_vertices_now(frame),
        }
    }

    /// As [`World::admit_vertices`], without waiting.
    pub(super) fn admit_vertices_now(&mut self, frame: &VertexFrame) -> Admission {
        let (found, mut refused) = (self.find_bent(frame), None);
        let taken = found.and_then(|(source, slot)| {
            self.bend(slot, frame).map_err(|reason| {
                if reason != RejectReason::OldFrame {
                    self.refuse_vertices(slot, reason);
                }
                refused = Some(slot);
                (Some(source), reason)
            })?;
            Ok(Admission::Admitted {
                source,
                poses: 0,
                refused_rows: 0,
            })
        });
        taken.unwrap_or_else(|(source, reason)| {
            self.note_refused(reason, source, &frame.header.source);
            if let Some(slot) = refused {
                self.note_refused_body(reason, slot);
            }
            Admission::Refused { source, reason }
        })
    }

    /// Layout, source, session, body: the checks before the vertices themselves.
    fn find_bent(
        &mut self,
        frame: &VertexFrame,
    ) -> Result<(SourceSlot, BodySlot), (Option<SourceSlot>, RejectReason)> {
        let header = &frame.header;
        let name = name_str(&header.source);
        let source = name.and_then(|name| self.source_named(name));
        if header.schema != WIRE_VERSION || header.session == 0 || name.is_none() {
            return Err(self.refuse_unread(source, header, RejectReason::BadLayout));
        }
        let Some(source) = source else {
            return Err((None, RejectReason::UnknownSource));
        };
        let refused = |reason| Err((Some(source), reason));
        if self.is_of_other_boot(header.boot) {
            return Err(self.refuse_unread(Some(source), header, RejectReason::SessionOver));
        }
        if self.sources[source.index()].note_bent(header) {
            self.lose_vertices(source, RejectReason::VertexVersion);
        }
        // A sender that may not bend the body cannot end another's session.
        let found = self.find_bendable(source, header.body);
        if header.session != self.sources[source.index()].session
            && let Err(reason) = found
        {
            return refused(reason);
        }
        let received_ns = match frame.received_ns {
            0 => self.now_ns,
            received_ns => received_ns.min(self.now_ns),
        };
        let state = &mut self.sources[source.index()];
        match stand_beside(state, source, &mut self.over, header, received_ns) {
            Standing::Refused(reason) => return refused(reason),
            Standing::Afresh => {
                // A frame that still waits is from before.
                state.pass_over_waiting();
                state.note_bent(header);
                self.forget_poses(source);
            }
            Standing::Next => {}
        }
        found.map_or_else(refused, |slot| Ok((source, slot)))
    }

    /// The body with this id, if the source may bend it.
    fn find_bendable(&self, source: SourceSlot, body: u64) -> Result<BodySlot, RejectReason> {
        let slot = self
            .slot_of(BodyId(body))
            .ok_or(RejectReason::UnknownBody)?;
        self.may_move(source, slot)?;
        match self.body(slot) {
            Some(body) if body.vertices.is_some() => Ok(slot),
            _ => Err(RejectReason::NotSteerable),
        }
    }

    /// Applies the vertices of a frame whose sender may bend the body, all or none.
    fn bend(&mut self, slot: BodySlot, frame: &VertexFrame) -> Result<(), RejectReason> {
        let first = self.check_vertices(slot, frame)?;
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return Err(RejectReason::UnknownBody);
        };
        let Some(shape) = body.bending_shape() else {
            return Err(RejectReason::NotSteerable);
        };
        let step_m = shape.bend(first, &frame.rows);
        let radius = shape.radius;
        body.radius = radius;
        body.motion.bend(step_m, &body.pose, &body.centre, radius);
        if let Some(vertices) = body.vertices.as_mut() {
            (vertices.version, vertices.refused) = (Some(frame.header.version), None);
            vertices.updates += 1;
        }
        if !self.entries[slot.index()].refused {
            body.reject = None;
        }
        let tight = tight_box(&body.shapes, &body.pose);
        self.entries[slot.index()].tight = match body.path.as_mut() {
            Some(path) => {
                path.take_end(tight);
                *path.hull()
            }
            None => tight,
        };
        self.settle(slot, true);
        Ok(())
    }

    /// Checks counts, versions, numbers; yields the index of the first vertex.
    fn check_vertices(&self, slot: BodySlot, frame: &VertexFrame) -> Result<usize, RejectReason> {
        let header = &frame.header;
        let body = self.body(slot).ok_or(RejectReason::UnknownBody)?;
        let known = body.vertices.as_deref().ok_or(RejectReason::NotSteerable)?;
        if known.version.is_some_and(|newest| header.version <= newest) {
            return Err(RejectReason::OldFrame);
        }
        if let Some(reason) = frame.refused {
            return Err(reason);
        }
        if frame.waited && header.sent_ns == 0 {
            return Err(RejectReason::TooOld);
        }
        let shape = body.shapes.first().map(|placed| &placed.shape);
        let there = shape.and_then(|shape| shape.mesh());
        let there = there.map_or(0, |mesh| mesh.vertices().len());
        let size = |n: u32| usize::try_from(n).unwrap_or(usize::MAX);
        let (first, count, total) = (size(header.first), size(header.count), size(header.total));
        let fits = total == there
            && count == frame.rows.len()
            && count <= DEFORMING_VERTICES_MAX
            && first.checked_add(count).is_some_and(|end| end <= there);
        let whole = first == 0 && count == there;
        match header.flags {
            vertex_flags::FULL if fits && whole => {}
            vertex_flags::RANGE if fits && count > 0 => {
                let follows = known.version == Some(header.base_version);
                if known.refused.is_some() || !follows {
                    return Err(RejectReason::VertexVersion);
                }
            }
            _ => return Err(RejectReason::BadLayout),
        }
        match can_be_vertices(&frame.rows) {
            Ok(()) => Ok(first),
            Err(NoVertex::NotFinite) => Err(RejectReason::NotFinite),
            Err(NoVertex::TooFar) => Err(RejectReason::OverLimit),
        }
    }

    /// Vertices whose body cannot be read. If the session in force sent them they are lost, and newer than what is
    /// there; no other sender can make a body unknown in this way.
    fn refuse_unread(
        &mut self,
        source: Option<SourceSlot>,
        header: &VertexHeader,
        reason: RejectReason,
    ) -> (Option<SourceSlot>, RejectReason) {
        if let Some(source) = source
            && header.session != 0
            && header.session == self.sources[source.index()].session
        {
            self.lose_vertices(source, reason);
        }
        (source, reason)
    }

    /// Vertices of a source were lost, for an unknown body: all bodies that it has bent may have another shape by now.
    fn lose_vertices(&mut self, source: SourceSlot, reason: RejectReason) {
        for at in 0..self.deforming.len() {
            let slot = self.deforming[at];
            let body = self.body(slot).filter(|body| owns(source, body));
            let vertices = body.and_then(|body| body.vertices.as_deref());
            if vertices.is_some_and(|vertices| vertices.version.is_some()) {
                self.refuse_vertices(slot, reason);
            }
        }
    }

    /// The newest vertices of a body were refused: it is unknown until good ones come; its last good ones are kept.
    pub(super) fn refuse_vertices(&mut self, slot: BodySlot, reason: RejectReason) {
        if let Some(body) = self.bodies[slot.index()].as_mut()
            && let Some(vertices) = body.vertices.as_mut()
        {
            vertices.refused = Some(reason);
            body.reject = Some(reason);
        }
        self.settle(slot, false);
    }
}
