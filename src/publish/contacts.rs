//! Rows of `contacts`: manifold points of colliding pairs, closest points of near ones.

use crate::ids::{PairSlot, small};
use crate::math::{Point, Vec3};
use crate::narrow::{Contact, Finding, Witness};
use crate::wire::{ContactKind, ContactRow, Level, MessageHeader, Outbox, Verdict, contact_flags};
use crate::world::Body;

use super::kept::{Kept, Span};
use super::listing::Mark;
use super::{AHEAD, Publisher, View};

impl Publisher {
    /// Fills `contacts` and `contact_changes`; returns how many rows did not fit. Whole pairs are kept, deepest first.
    pub(super) fn fill_contacts(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        out: &mut Outbox,
    ) -> u64 {
        let all = self.survey.contacts();
        debug_assert_eq!(
            all,
            (self.listing.iter().map(|row| row.contacts as usize)).sum::<usize>(),
            "every row was surveyed once"
        );
        let cut = all > self.limits.contact_rows;
        let told = if cut { self.choose_pairs() } else { all };
        let left_out = (all - told) as u64;
        let header = MessageHeader {
            truncated: left_out,
            ..header
        };
        self.fill_all_contacts(view, header, out);
        self.fill_contact_changes(view, header, told, out);
        left_out
    }

    fn fill_all_contacts(&mut self, view: &mut View<'_>, header: MessageHeader, out: &mut Outbox) {
        if !view.demand.contacts {
            out.contacts.clear();
            self.had_all_contacts = false;
            return;
        }
        let cut = header.truncated > 0;
        let whole = std::mem::replace(&mut self.had_all_contacts, !cut) && !cut;
        let mut kept = std::mem::take(&mut self.kept_contacts);
        kept.begin();
        let mut at = 0;
        while at < self.listing.len() {
            if whole && !self.listing.marks[at].fresh {
                at = self.keep_contacts(at, &mut kept);
                continue;
            }
            if let Some(ahead) = self.listing.marks.get(at + AHEAD)
                && ahead.fresh
                && let Some(slot) = self.listing.row(at + AHEAD).slot
            {
                view.narrow.ask_ahead_for_contacts(slot);
            }
            let (mark, row) = (self.listing.marks[at], self.listing.row(at));
            let sent = row.contacts > 0 && (!cut || self.chosen.get(at) == Some(&true));
            let span = match row.slot {
                Some(_) if sent && !mark.fresh && mark.contacts.len == row.contacts => {
                    kept.keep(mark.contacts)
                }
                Some(slot) if sent => {
                    view.narrow.name_contacts(slot, &mut self.next_contact);
                    kept.make(|out| push_rows(view, slot, out))
                }
                _ => kept.make(|_| {}),
            };
            self.listing.marks[at].contacts = span;
            at += 1;
        }
        kept.finish(&mut out.contacts);
        self.kept_contacts = kept;
        out.contacts_header = header;
    }

    /// Keeps the contacts of rows that are not fresh and were adjacent, from an index on; returns the index after them.
    fn keep_contacts(&mut self, from: usize, kept: &mut Kept<ContactRow>) -> usize {
        let marks = &mut self.listing.marks[from..];
        let first = marks.first().map_or(0, |mark| mark.contacts.first);
        let mut end = first;
        let stays = |mark: &&Mark| {
            let side_by_side = !mark.fresh && mark.contacts.first == end;
            end += if side_by_side { mark.contacts.len } else { 0 };
            side_by_side
        };
        let count = marks.iter().take_while(stays).count();
        let now = kept.keep(Span {
            first,
            len: end - first,
        });
        if now.first != first {
            for mark in &mut marks[..count] {
                mark.contacts.first = mark.contacts.first - first + now.first;
            }
        }
        from + count
    }

    /// Chooses the pairs whose contacts fit: the deepest, with equal depth those with the smaller ids. The first is
    /// always sent, whatever the limit. Returns how many contacts they have.
    fn choose_pairs(&mut self) -> usize {
        let (by_depth, rows) = (&mut self.contact_pairs, &self.listing);
        by_depth.clear();
        let pairs = rows.iter().enumerate().filter(|(_, row)| row.contacts > 0);
        by_depth.extend(pairs.map(|(at, row)| (row.best_m, small(at), row.contacts)));
        // Bisects the part that contains the limit, down to one pair; a sort of all would take several times as long.
        let (mut from, mut to, mut room) = (0, by_depth.len(), self.limits.contact_rows);
        while from < to {
            let middle = (to - from) / 2;
            // Rows are ordered by ids, and so are their indices.
            by_depth[from..to]
                .select_nth_unstable_by(middle, |x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            let deeper = &by_depth[from..=from + middle];
            let count: usize = deeper.iter().map(|&(_, _, count)| count as usize).sum();
            if count <= room {
                room -= count;
                from += middle + 1;
            } else {
                to = from + middle;
            }
        }
        from = from.max(usize::from(!by_depth.is_empty()));
        self.chosen.clear();
        self.chosen.resize(rows.len(), false);
        let mut told = 0;
        for &(_, at, count) in &by_depth[..from] {
            self.chosen[at as usize] = true;
            told += count as usize;
        }
        told
    }
}

/// Appends the contacts of a pair.
pub(super) fn push_rows(view: &View<'_>, slot: PairSlot, out: &mut Vec<ContactRow>) {
    let Some(finding) = view.narrow.finding(slot) else {
        return;
    };
    let (Some(a), Some(b)) = (view.world.body(finding.a), view.world.body(finding.b)) else {
        return;
    };
    if finding.verdict == Verdict::Near {
        if let Some(witness) = finding.witness {
            let mut row = closest_row(a, b, witness);
            let gap = finding.gap;
            // An estimate is never outside the proven interval.
            row.gap_m = row.gap_m.max(gap.min).min(gap.max);
            (row.gap_min_m, row.gap_max_m) = (gap.min, gap.max);
            row.flags = if finding.level == Level::Exact {
                0
            } else {
                contact_flags::ESTIMATE
            };
            out.push(row);
        }
        return;
    }
    let (contacts, tick) = view.narrow.contacts(slot);
    let current = finding.level == Level::Exact && tick >= finding.tested;
    let start = out.len();
    let is_one_pair = a.shapes.len() == 1 && b.shapes.len() == 1;
    // With meshes the gap of a contact is measured along its own normal.
    let are_convex = [a, b]
        .iter()
        .all(|body| body.shapes.iter().all(|p| p.shape.mesh().is_none()));
    for contact in contacts {
        let mut row = contact_row(a, b, contact);
        if !current {
            row.flags = contact_flags::ESTIMATE;
            // What was proven for these shapes was at another pose; the bounds for this pose are those of the bodies.
            row.gap_min_m = finding.gap.min;
            row.gap_max_m = if is_one_pair {
                finding.gap.max
            } else {
                f64::INFINITY
            };
            if are_convex {
                row.gap_m = row.gap_m.max(row.gap_min_m).min(row.gap_max_m);
            }
        }
        out.push(row);
    }
    out[start..].sort_unstable_by_key(|row| {
        (
            row.shape_a,
            row.shape_b,
            row.triangle_a,
            row.triangle_b,
            row.id,
        )
    });
}

/// Number of contact rows of an active pair.
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
