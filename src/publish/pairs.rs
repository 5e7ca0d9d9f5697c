//! The list of pairs: every one that is not plainly apart, and every event. Rows of `pairs` contain all of it.

use crate::ids::{PairKey, PairSlot, small};
use crate::math::{Interval, Point};
use crate::narrow::{Finding, Passage, Witness};
use crate::wire::{
    BodyStatus, EndCause, Event, Level, MessageHeader, Outbox, PairRow, Verdict, pair_flags,
};
use crate::world::{Body, Tag};

use super::events::{Ids, PairEvent};
use super::fit::Stood;
use super::kept::{Kept, Span};
use super::listing::{Mark, NO_EVENT, Row};
use super::{AHEAD, Publisher, View};

/// The worse of a verdict and the result of a motion that is news.
pub(super) fn worst_of(verdict: Verdict, passage: Option<Passage>) -> Verdict {
    match passage {
        Some(Passage::Touched(_)) => Verdict::Colliding,
        Some(Passage::Open(_)) => verdict.max(Verdict::Possible),
        Some(Passage::Free) | None => verdict,
    }
}

impl Publisher {
    /// Fills `pairs` and `changes`; returns how many rows of the list did not fit.
    pub(super) fn fill_list(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        out: &mut Outbox,
    ) -> u64 {
        let listened = view.demand.pairs || view.demand.changes;
        let left_out = if listened {
            self.add_events(view);
            self.choose_rows()
        } else {
            0
        };
        self.fill_pairs(view, header, left_out, out);
        self.fill_owed(view, out);
        self.fill_changes(view, header, left_out, out);
        // Readers that start later get the full state; no reader needs what happened before.
        let (listing, chosen, cut) = (&self.listing, &self.chosen, left_out > 0);
        let is_left_out = |ids| {
            listing
                .find(ids)
                .is_ok_and(|at| chosen.get(at) != Some(&true))
        };
        self.events.sent(|ids| cut && is_left_out(ids));
        left_out
    }

    fn fill_pairs(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        left_out: u64,
        out: &mut Outbox,
    ) {
        if !view.demand.pairs {
            out.pairs.clear();
            self.stood = Stood::Nowhere;
            return;
        }
        let cut = left_out > 0;
        let whole = matches!(self.stood, Stood::Listed) && !cut;
        let mut kept = std::mem::take(&mut self.kept_pairs);
        kept.begin();
        let mut at = 0;
        while at < self.listing.len() {
            if whole && !self.listing.marks[at].fresh {
                at = self.keep_pairs(at, &mut kept, &mut out.pairs);
                continue;
            }
            if let Some(ahead) = self.listing.marks.get(at + AHEAD)
                && ahead.fresh
                && let Some(slot) = self.listing.row(at + AHEAD).slot
            {
                view.narrow.ask_ahead(slot);
            }
            let sent = !cut || self.chosen.get(at) == Some(&true);
            if sent
                && let Some(first) = self.stood.place(&self.listing.marks[at])
                && let Some(row) = out.pairs.get_mut(first as usize)
            {
                row.age(1);
                kept.keep(Span { first, len: 1 });
            } else if sent {
                let make = |out: &mut Vec<PairRow>| {
                    out.push(self.pair_row(view, self.listing.row(at)));
                };
                kept.make(make);
            }
            at += 1;
        }
        kept.finish(&mut out.pairs);
        self.kept_pairs = kept;
        self.note_places(cut);
        out.pairs_header = MessageHeader {
            truncated: left_out,
            ..header
        };
    }

    /// Keeps the rows that are not fresh and were adjacent, from an index on; returns the index after them.
    fn keep_pairs(&self, from: usize, kept: &mut Kept<PairRow>, out: &mut [PairRow]) -> usize {
        let marks = &self.listing.marks[from..];
        let first = marks.first().map_or(0, |mark| mark.was);
        let side_by_side = |(mark, was): &(&Mark, u32)| !mark.fresh && mark.was == *was;
        let count = marks.iter().zip(first..).take_while(side_by_side).count();
        let from_was = first as usize;
        for row in out.iter_mut().skip(from_was).take(count) {
            row.age(1);
        }
        kept.keep(Span {
            first,
            len: small(count),
        });
        from + count
    }

    /// Gives the listed pairs their events, and lists pairs with events that are no longer active.
    fn add_events(&mut self, view: &mut View<'_>) {
        let (events, listing) = (&self.events, &mut self.listing);
        for (at, event) in events.waiting().iter().enumerate() {
            let place = u32::try_from(at).unwrap_or(NO_EVENT);
            match listing.find(event.ids) {
                Ok(at) => listing.set_event(at, place),
                Err(_) => listing.add(Self::row_of_apart(view, event.ids, place)),
            }
        }
        listing.finish();
    }

    /// The row of a pair that is plainly apart, or gone.
    pub(super) fn row_of_apart(view: &mut View<'_>, ids: Ids, event: u32) -> Row {
        let slot = Self::slot_of(view, ids);
        // Its certificate may still hold while its interval is that of older poses.
        if let Some(slot) = slot {
            view.narrow.bring_up(slot, view.world);
        }
        Row {
            ids,
            gap: Interval { min: 0.0, max: 0.0 },
            best_m: 0.0,
            slot,
            event,
            contacts: 0,
            undecided_since: 0,
            verdict: Verdict::Apart,
        }
    }

    /// The slot of a pair that is apart but still a candidate.
    fn slot_of(view: &View<'_>, ids: Ids) -> Option<PairSlot> {
        let (a, b) = (view.world.slot_of(ids.0)?, view.world.slot_of(ids.1)?);
        view.pairs.find(PairKey::new(a, b))
    }

    pub(super) fn pair_row(&self, view: &View<'_>, row: &Row) -> PairRow {
        self.pair_row_with(view, row, self.events.waiting().get(row.event as usize))
    }

    /// The row of a pair, with this event.
    pub(super) fn pair_row_with(
        &self,
        view: &View<'_>,
        row: &Row,
        event: Option<&PairEvent>,
    ) -> PairRow {
        let mut out = PairRow {
            body_a: row.ids.0.0,
            body_b: row.ids.1.0,
            gap_min_m: f64::NEG_INFINITY,
            gap_max_m: f64::INFINITY,
            gap_best_m: f64::NAN,
            closing_mps: f64::NAN,
            toi_min: f64::NAN,
            toi_max: f64::NAN,
            ..PairRow::default()
        };
        match row
            .slot
            .and_then(|slot| Some((slot, view.narrow.finding(slot)?)))
        {
            Some((slot, finding)) => self.describe(view, slot, &finding, &mut out),
            None => out.flags |= pair_flags::GONE,
        }
        if let Some(event) = event {
            if let Some((ticks, cause)) = event.end {
                out.events |= Event::End.bit();
                out.end_cause = cause.code();
                (out.end_first_tick, out.end_last_tick) = (ticks.first, ticks.last);
            }
            if let Some(ticks) = event.begin.or(event.pass) {
                out.events |= Event::Begin.bit();
                (out.begin_first_tick, out.begin_last_tick) = (ticks.first, ticks.last);
            }
            if let Some(ticks) = event.pass {
                out.events |= Event::End.bit() | Event::Passed.bit();
                // An earlier end that did not fit is merged with this one: its range starts at the earlier first tick.
                let first = event.end.map_or(ticks.last, |(end, _)| end.first);
                out.end_cause = EndCause::Separated.code();
                (out.end_first_tick, out.end_last_tick) = (first, ticks.last);
            }
        }
        if out.verdict == Verdict::Colliding.code() && out.events & Event::Begin.bit() == 0 {
            out.events |= Event::Persist.bit();
        }
        out
    }

    fn describe(&self, view: &View<'_>, slot: PairSlot, finding: &Finding<'_>, out: &mut PairRow) {
        let world = view.world;
        let (Some(a), Some(b)) = (world.tag(finding.a), world.tag(finding.b)) else {
            return;
        };
        out.verdict = finding.verdict.code();
        out.level = finding.level.code();
        let (verdict, tick) = match finding.verdict {
            Verdict::Colliding | Verdict::Near => (finding.verdict, view.tick),
            _ => {
                let history = self.events.history(slot);
                (history.verdict, history.tick)
            }
        };
        (out.certified_verdict, out.certified_tick) = (verdict.code(), tick);
        (out.gap_min_m, out.gap_max_m) = (finding.gap.min, finding.gap.max);
        out.bound_age_ticks =
            u32::try_from(view.tick - finding.tested.max(finding.born)).unwrap_or(u32::MAX);
        if let Some(witness) = finding.witness {
            // An estimate is never outside the proven interval.
            out.gap_best_m = witness.best_m.max(finding.gap.min).min(finding.gap.max);
            if goes_as_told(a)
                && goes_as_told(b)
                && let (Some(a), Some(b)) = (world.body(finding.a), world.body(finding.b))
            {
                out.closing_mps = closing_speed(a, b, witness);
            }
        }
        self.describe_way(view, slot, out);
        if finding.touching {
            out.flags |= pair_flags::TOUCHING;
        }
        if finding.level != Level::Exact {
            out.flags |= pair_flags::ESTIMATE;
        }
        for body in [a, b] {
            match body.status {
                BodyStatus::Known => {}
                BodyStatus::Held => out.flags |= pair_flags::HELD_BODY,
                _ => out.flags |= pair_flags::UNKNOWN_BODY,
            }
        }
    }

    /// Adds what is known about the motion to this tick's poses.
    fn describe_way(&self, view: &View<'_>, slot: PairSlot, out: &mut PairRow) {
        let Some(swept) = view.narrow.passage(slot) else {
            return;
        };
        if swept.teleported {
            out.flags |= pair_flags::TELEPORTED;
        }
        // A pair that collides now must have touched by now.
        let colliding = out.verdict == Verdict::Colliding.code();
        let toi = match swept.passage {
            // A body that jumped was not swept.
            Passage::Free if colliding && !swept.jumped => {
                Passage::Touched(Interval { min: 1.0, max: 1.0 })
            }
            Passage::Open(toi) if colliding => Passage::Touched(toi),
            passage => passage,
        };
        if !self.events.is_news(slot, toi) {
            return;
        }
        let toi = match toi {
            Passage::Free => return,
            Passage::Touched(toi) => {
                out.flags |= pair_flags::SWEPT_HIT;
                toi
            }
            Passage::Open(toi) => {
                out.flags |= pair_flags::SWEPT_OPEN;
                toi
            }
        };
        (out.toi_min, out.toi_max) = (toi.min, toi.max);
    }
}

/// Returns whether a body moves as its sender reports: for a silent or refused one the report is old.
fn goes_as_told(tag: &Tag) -> bool {
    tag.has_velocity && matches!(tag.status, BodyStatus::Known | BodyStatus::Truncated)
}

/// How fast the gap shrinks at the witness of two bodies with known velocities, metres per second.
fn closing_speed(a: &Body, b: &Body, witness: &Witness) -> f64 {
    let velocity_at = |body: &Body, point: Point| {
        // A body that cannot move has no velocity.
        body.twist_at(&point).unwrap_or_default().linear_mps
    };
    let relative = velocity_at(b, witness.point_b) - velocity_at(a, witness.point_a);
    -relative.dot(&(a.pose.rotation * witness.normal))
}
