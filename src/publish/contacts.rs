//! Rows of `contacts`: manifold points of colliding pairs, closest points of near ones.

use crate::ids::{BodyId, PairSlot};
use crate::math::{Point, Vec3};
use crate::narrow::{Contact, Witness};
use crate::wire::{ContactKind, ContactRow, Level, MessageHeader, Outbox, Verdict, contact_flags};
use crate::world::Body;

use super::{Publisher, View};

/// A pair that may have contact rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rank {
    ids: (BodyId, BodyId),
    slot: PairSlot,
    depth_m: f64,
}

impl Publisher {
    /// Fills `contacts`; returns how many rows did not fit. Whole pairs are kept, deepest first.
    pub(super) fn fill_contacts(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        out: &mut Outbox,
    ) -> u64 {
        out.contacts.clear();
        if !view.demand.contacts {
            return 0;
        }
        let rows = self.rank_pairs(view);
        let most = self.limits.contact_rows;
        if rows > most {
            self.contact_ranks
                .sort_unstable_by(|x, y| x.depth_m.total_cmp(&y.depth_m).then(x.ids.cmp(&y.ids)));
            let mut room = most;
            self.contact_ranks.retain(|rank| {
                let count = rows_of(view, rank.slot);
                let fits = count <= room;
                room -= if fits { count } else { 0 };
                fits
            });
        }
        self.contact_ranks.sort_unstable_by_key(|rank| rank.ids);
        for at in 0..self.contact_ranks.len() {
            let rank = self.contact_ranks[at];
            view.narrow.name_contacts(rank.slot, &mut self.next_contact);
            Self::push_rows(view, rank, out);
        }
        let left_out = rows.saturating_sub(out.contacts.len()) as u64;
        out.contacts_header = MessageHeader {
            truncated: left_out,
            ..header
        };
        left_out
    }

    /// Lists the pairs with contact rows; returns how many rows they have.
    fn rank_pairs(&mut self, view: &View<'_>) -> usize {
        self.contact_ranks.clear();
        let mut rows = 0;
        for &slot in view.narrow.active() {
            let Some(finding) = view.narrow.finding(slot) else {
                continue;
            };
            let (Some(a), Some(b)) = (view.world.body(finding.a), view.world.body(finding.b))
            else {
                continue;
            };
            let count = rows_of(view, slot);
            if count > 0 {
                rows += count;
                let depth_m = finding.witness.map_or(0.0, |witness| witness.best_m);
                self.contact_ranks.push(Rank {
                    ids: (a.id, b.id),
                    slot,
                    depth_m,
                });
            }
        }
        rows
    }

    fn push_rows(view: &View<'_>, rank: Rank, out: &mut Outbox) {
        let Some(finding) = view.narrow.finding(rank.slot) else {
            return;
        };
        let (Some(a), Some(b)) = (view.world.body(finding.a), view.world.body(finding.b)) else {
            return;
        };
        if finding.verdict == Verdict::Near {
            if let Some(witness) = finding.witness {
                let mut row = closest_row(a, b, witness);
                (row.gap_min_m, row.gap_max_m) = (finding.gap.min, finding.gap.max);
                row.flags = if finding.level == Level::Exact {
                    0
                } else {
                    contact_flags::ESTIMATE
                };
                out.contacts.push(row);
            }
            return;
        }
        let (contacts, tick) = view.narrow.contacts(rank.slot);
        let current = finding.level == Level::Exact && tick >= finding.tested;
        let start = out.contacts.len();
        for contact in contacts {
            let mut row = contact_row(a, b, contact);
            row.flags = if current { 0 } else { contact_flags::ESTIMATE };
            out.contacts.push(row);
        }
        out.contacts[start..].sort_unstable_by_key(|row| {
            (
                row.shape_a,
                row.shape_b,
                row.triangle_a,
                row.triangle_b,
                row.id,
            )
        });
    }
}

/// How many contact rows a pair has.
fn rows_of(view: &View<'_>, slot: PairSlot) -> usize {
    match view.narrow.finding(slot) {
        Some(finding) if finding.verdict == Verdict::Colliding => {
            view.narrow.contacts(slot).0.len()
        }
        Some(finding) if finding.verdict == Verdict::Near => usize::from(finding.witness.is_some()),
        _ => 0,
    }
}

fn place(a: &Body, b: &Body, point_a: &Point, point_b: &Point, normal: &Vec3) -> ContactRow {
    ContactRow {
        body_a: a.id.0,
        body_b: b.id.0,
        point_a: (a.pose * point_a).coords.into(),
        point_b: (b.pose * point_b).coords.into(),
        point_a_body: point_a.coords.into(),
        point_b_body: point_b.coords.into(),
        normal: (a.pose.rotation * normal).into(),
        ..ContactRow::default()
    }
}

fn contact_row(a: &Body, b: &Body, contact: &Contact) -> ContactRow {
    ContactRow {
        id: contact.id,
        gap_m: contact.gap_m,
        gap_min_m: contact.gap.min,
        gap_max_m: contact.gap.max,
        shape_a: contact.shape_a,
        shape_b: contact.shape_b,
        triangle_a: contact.triangle_a,
        triangle_b: contact.triangle_b,
        kind: ContactKind::Contact.code(),
        ..place(a, b, &contact.point_a, &contact.point_b, &contact.normal)
    }
}

fn closest_row(a: &Body, b: &Body, witness: &Witness) -> ContactRow {
    ContactRow {
        id: 0,
        gap_m: witness.best_m,
        shape_a: witness.shape_a,
        shape_b: witness.shape_b,
        triangle_a: witness.triangle_a,
        triangle_b: witness.triangle_b,
        kind: ContactKind::Closest.code(),
        ..place(a, b, &witness.point_a, &witness.point_b, &witness.normal)
    }
}
