//! Vertices that belong to a frame which waits for a scene revision: they wait for it, so that no tick has one without
//! the other.
//!
//! In: messages of a source while frames of it wait. Out: the same in order, as soon as such a frame is taken.

use std::collections::VecDeque;

use super::World;
use super::source::SourceState;
use crate::ids::{BodyId, SourceSlot};
use crate::limits::{VERTEX_FRAMES_WAITING_MAX, VERTEX_ROWS_WAITING_MAX};
use crate::wire::{RejectReason, VertexFrame, VertexHeader};

/// Messages of one source, the oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct BendsWaiting {
    list: VecDeque<VertexFrame>,
    /// Number of vertices in them.
    rows: usize,
}

impl BendsWaiting {
    fn is_full_with(&self, rows: usize) -> bool {
        self.list.len() >= VERTEX_FRAMES_WAITING_MAX || self.rows + rows > VERTEX_ROWS_WAITING_MAX
    }

    fn push(&mut self, frame: VertexFrame) {
        self.rows += frame.rows.len();
        self.list.push_back(frame);
    }

    /// Takes the first one, if it is wanted.
    fn take(&mut self, wanted: impl FnOnce(&VertexHeader) -> bool) -> Option<VertexFrame> {
        let first = self.list.front()?;
        if !wanted(&first.header) {
            return None;
        }
        self.rows -= first.rows.len();
        self.list.pop_front()
    }
}

impl SourceState {
    /// Returns whether vertices must wait: for a waiting frame or a later one, or behind vertices that wait.
    fn keeps_waiting(&self, header: &VertexHeader) -> bool {
        let epoch = self.order.map(|(epoch, _)| epoch);
        if header.session != self.session || epoch != Some(header.epoch) {
            return false;
        }
        let taken = self.newest.map(|newest| (newest.epoch, newest.seq));
        let is_of_later = header.seq != 0 && taken < Some((header.epoch, header.seq));
        self.waits() && is_of_later || !self.bends.list.is_empty()
    }
}

impl World {
    /// Queues vertices behind the waiting frames of their source, if they belong there.
    ///
    /// * returns - whether it did.
    pub(super) fn bends_later(&mut self, source: SourceSlot, frame: &VertexFrame) -> bool {
        let state = &mut self.sources[source.index()];
        if !state.keeps_waiting(&frame.header) {
            return false;
        }
        let received_ns = match frame.received_ns {
            0 => self.now_ns,
            received_ns => received_ns.min(self.now_ns),
        };
        state.heard_ns = state.heard_ns.max(received_ns);
        while self.sources[source.index()]
            .bends
            .is_full_with(frame.rows.len())
        {
            let Some(oldest) = self.sources[source.index()].bends.take(|_| true) else {
                break;
            };
            self.lose_bend(source, &oldest);
        }
        self.sources[source.index()].bends.push(VertexFrame {
            received_ns,
            ..frame.clone()
        });
        true
    }

    /// A frame has been taken: vertices that belong to the newest taken frame, or an earlier one, are applied now; but
    /// not before those that still wait, which a pause may have overtaken.
    pub(super) fn bend_with(&mut self, source: SourceSlot) {
        let state = &self.sources[source.index()];
        let Some(newest) = &state.newest else {
            return;
        };
        let first = state.waiting.first();
        let first = first.map(|frame| (frame.header.epoch, frame.header.seq));
        let newest = (newest.epoch, newest.seq);
        let may_bend = move |header: &VertexHeader| {
            let number = (header.epoch, header.seq);
            number <= newest && first.is_none_or(|first| number < first)
        };
        loop {
            let bends = &mut self.sources[source.index()].bends;
            let Some(vertices) = bends.take(may_bend) else {
                return;
            };
            self.admit_vertices_now(&vertices);
        }
    }

    /// Vertices that are never applied: the body differs from what its sender reported last.
    fn lose_bend(&mut self, source: SourceSlot, vertices: &VertexFrame) {
        // The loss is reported for this body here, and not for all bodies by the gap in the numbers.
        let _of_before = self.sources[source.index()].note_bent(&vertices.header);
        let Some(slot) = self.slot_of(BodyId(vertices.header.body)) else {
            return;
        };
        let bends = self.body(slot).is_some_and(|body| body.vertices.is_some());
        if bends && self.may_move(source, slot).is_ok() {
            self.refuse_vertices(slot, RejectReason::VertexVersion);
        }
    }
}
