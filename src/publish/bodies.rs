//! Rows of `bodies`, one-byte verdicts of bodies, and names.

use crate::wire::{BODY_NAME_LEN, BodyRow, BodyStatus, MessageHeader, NameRow, Outbox, Verdict};
use crate::world::Body;

use super::pairs::worst_of;
use super::{Publisher, View};

impl Publisher {
    /// Fills `bodies` and `body_verdicts`, by body id; returns how many rows of `bodies` did not fit.
    pub(super) fn fill_bodies(
        &mut self,
        view: &View<'_>,
        header: MessageHeader,
        out: &mut Outbox,
    ) -> u64 {
        out.bodies.clear();
        out.body_verdicts.clear();
        if !(view.demand.bodies || view.demand.body_verdicts) {
            return 0;
        }
        self.worst_of_each(view);
        let now_ns = view.now_ns;
        for (slot, body) in view.world.bodies() {
            let verdict = self.verdicts.get(slot.index()).copied().unwrap_or(0);
            if view.demand.body_verdicts {
                out.body_verdicts.push(verdict);
            }
            if view.demand.bodies {
                let mut row = body_row(body, verdict, now_ns);
                if body.status == BodyStatus::Known && view.pairs.is_truncated(slot) {
                    row.status = BodyStatus::Truncated.code();
                }
                out.bodies.push(row);
            }
        }
        out.bodies_header = header;
        0
    }

    /// The worst verdict of each body over its pairs. For a body of unknown place, or with a pair that did not fit into
    /// the pair set, never better than `possible`.
    fn worst_of_each(&mut self, view: &View<'_>) {
        self.verdicts.clear();
        self.verdicts
            .resize(view.world.slots_len(), Verdict::Apart.code());
        for (slot, body) in view.world.bodies() {
            if !matches!(
                body.status,
                BodyStatus::Known | BodyStatus::Held | BodyStatus::Disabled
            ) {
                self.verdicts[slot.index()] = Verdict::Possible.code();
            }
        }
        for &slot in view.pairs.truncated() {
            if let Some(worst) = self.verdicts.get_mut(slot.index()) {
                *worst = Verdict::Possible.code();
            }
        }
        for swept in view.narrow.swept() {
            if let Some(finding) = view.narrow.finding(swept.slot)
                && self.events.is_news(swept.slot, swept.passage)
            {
                for body in [finding.a, finding.b] {
                    let worst = &mut self.verdicts[body.index()];
                    *worst = (*worst).max(worst_of(Verdict::Apart, Some(swept.passage)).code());
                }
            }
        }
        for &slot in view.narrow.active() {
            if let Some(finding) = view.narrow.finding(slot) {
                for body in [finding.a, finding.b] {
                    let worst = &mut self.verdicts[body.index()];
                    *worst = (*worst).max(finding.verdict.code());
                }
            }
        }
    }

    /// Fills `names` when the scene changed.
    pub(super) fn fill_names(view: &View<'_>, out: &mut Outbox) {
        out.names_changed = view.world.names_changed();
        if !out.names_changed {
            return;
        }
        out.names.clear();
        for (_, body) in view.world.bodies() {
            let mut row = NameRow {
                body: body.id.0,
                source: body.source.map_or(u32::MAX, |source| source.0),
                generation: body.generation,
                ..NameRow::default()
            };
            let bytes = body.name.as_bytes();
            let len = bytes.len().min(BODY_NAME_LEN);
            row.name[..len].copy_from_slice(&bytes[..len]);
            row.len = u32::try_from(len).unwrap_or(0);
            out.names.push(row);
        }
    }
}

fn body_row(body: &Body, verdict: u8, now_ns: u64) -> BodyRow {
    let q = body.pose.rotation.as_vector();
    BodyRow {
        body: body.id.0,
        position: body.pose.translation.vector.into(),
        orientation: [q.x, q.y, q.z, q.w],
        stamp_ns: body.stamp_ns,
        received_ns: body.received_ns,
        age_ns: body
            .since_ns
            .map_or(u64::MAX, |since| now_ns.saturating_sub(since)),
        generation: body.generation,
        source: body.source.map_or(u32::MAX, |source| source.0),
        status: body.status.code(),
        verdict,
        reject: body.reject.map_or(0, |reason| reason.code()),
        ..BodyRow::default()
    }
}
