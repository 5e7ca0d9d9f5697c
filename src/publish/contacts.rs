//! Rows of `contacts`: manifold points of colliding pairs, closest points of near ones.

use crate::ids::PairSlot;
use crate::math::{Point, Vec3};
use crate::narrow::{Contact, Finding, Witness};
use crate::wire::{ContactKind, ContactRow, Level, MessageHeader, Outbox, Verdict, contact_flags};
use crate::world::Body;

use super::pairs::Row;
use super::{AHEAD, Publisher, View};

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
        let rows: usize = self.rows.iter().map(|row| row.contacts as usize).sum();
        let most = self.limits.contact_rows;
        if rows > most {
            self.choose_pairs(view, most);
            for at in 0..self.contact_pairs.len() {
                let row = self.rows[self.contact_pairs[at].1];
                self.push_pair(view, row, out);
            }
        } else {
            for at in 0..self.rows.len() {
                let ahead = self.rows.get(at + AHEAD).filter(|row| row.contacts > 0);
                if let Some(slot) = ahead.and_then(|row| row.slot) {
                    view.narrow.ask_ahead_for_contacts(slot);
                }
                self.push_pair(view, self.rows[at], out);
            }
        }
        let left_out = rows.saturating_sub(out.contacts.len()) as u64;
        out.contacts_header = MessageHeader {
            truncated: left_out,
            ..header
        };
        left_out
    }

    /// Chooses the pairs whose contacts fit: deepest first, then by ids again.
    fn choose_pairs(&mut self, view: &View<'_>, most: usize) {
        let (chosen, rows) = (&mut self.contact_pairs, &self.rows);
        chosen.clear();
        let depth_of = |row: &Row| {
            let witness = view.narrow.finding(row.slot?)?.witness?;
            Some(witness.best_m)
        };
        let pairs = rows.iter().enumerate().filter(|(_, row)| row.contacts > 0);
        chosen.extend(pairs.map(|(at, row)| (depth_of(row).unwrap_or(0.0), at)));
        // Rows are ordered by ids, and so are their places.
        chosen.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut room = most;
        chosen.retain(|&(_, at)| {
            let count = rows[at].contacts as usize;
            let fits = count <= room;
            room -= if fits { count } else { 0 };
            fits
        });
        chosen.sort_unstable_by_key(|&(_, at)| at);
    }

    fn push_pair(&mut self, view: &mut View<'_>, row: Row, out: &mut Outbox) {
        if let (1.., Some(slot)) = (row.contacts, row.slot) {
            view.narrow.name_contacts(slot, &mut self.next_contact);
            Self::push_rows(view, slot, out);
        }
    }

    fn push_rows(view: &View<'_>, slot: PairSlot, out: &mut Outbox) {
        let Some(finding) = view.narrow.finding(slot) else {
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
        let (contacts, tick) = view.narrow.contacts(slot);
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

/// How many contact rows an active pair has.
pub(super) fn contacts_of(view: &View<'_>, slot: PairSlot, finding: &Finding<'_>) -> usize {
    match finding.verdict {
        Verdict::Colliding => view.narrow.contacts(slot).0.len(),
        Verdict::Near => usize::from(finding.witness.is_some()),
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
