//! The tick's state, its reasons, its counts, and the worst pair.

use crate::ids::BodySlot;
use crate::narrow::Passage;
use crate::wire::{
    BodyStatus, MessageHeader, Outbox, Reason, SOURCES_MAX, SourceRow, State, TickRow, Verdict,
};

use super::events::Ids;
use super::leaders::{Leaders, Standing};
use super::listing::Row;
use super::{Publisher, View};

/// The pair that a person should look at first. Default: none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Worst {
    ids: Ids,
    /// `Verdict` code, then depth: sorts by severity.
    rank: (u8, f64),
}

impl Worst {
    fn of(row: &Row) -> Self {
        Self {
            ids: row.ids,
            rank: (row.verdict.code(), -row.best_m),
        }
    }
}

impl Standing for Worst {
    fn is_above(&self, other: &Self) -> bool {
        let ((verdict, depth_m), (theirs, their_depth_m)) = (self.rank, other.rank);
        let order = verdict.cmp(&theirs);
        let order = order.then(depth_m.total_cmp(&their_depth_m));
        order.then(other.ids.cmp(&self.ids)).is_gt()
    }

    fn ids(&self) -> Ids {
        self.ids
    }
}

/// Width of a pair's interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Width {
    ids: Ids,
    width_m: f64,
}

impl Width {
    fn of(row: &Row) -> Self {
        Self {
            ids: row.ids,
            width_m: row.gap.width(),
        }
    }
}

impl Standing for Width {
    fn is_above(&self, other: &Self) -> bool {
        self.width_m.total_cmp(&other.width_m).is_gt()
    }

    fn ids(&self) -> Ids {
        self.ids
    }
}

/// Since when a pair has had no verdict. Default: it has one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wait {
    ids: Ids,
    /// Its first tick without a verdict; 0: decided.
    since: u64,
}

impl Wait {
    fn of(row: &Row) -> Option<Self> {
        let (ids, since) = (row.ids, row.undecided_since);
        (since != 0).then_some(Self { ids, since })
    }
}

impl Standing for Wait {
    fn is_above(&self, other: &Self) -> bool {
        // 0 is the last.
        self.since.wrapping_sub(1) < other.since.wrapping_sub(1)
    }

    fn ids(&self) -> Ids {
        self.ids
    }
}

impl Publisher {
    /// Fills the tick's counts, state, reasons and sources; the engine fills times and units.
    pub(super) fn fill_tick(
        &self,
        view: &View<'_>,
        header: MessageHeader,
        left_out: u64,
        out: &mut Outbox,
    ) {
        let narrow = &view.narrow;
        let counts = view.world.counts();
        let truncated = left_out + view.pairs.missing();
        let possible = narrow.count(Verdict::Possible);
        let mut reasons = counts.reasons;
        if truncated > 0 {
            reasons |= Reason::Truncated.bit();
        }
        let survey = &self.survey;
        let worst = survey.worst.first();
        if possible > 0 || survey.open > 0 {
            reasons |= Reason::Undecided.bit();
        }
        if survey.touched > 0 || survey.open > 0 {
            reasons |= Reason::Swept.bit();
        }
        if view.world.has_teleported() {
            reasons |= Reason::Teleported.bit();
        }
        let cut = |&slot: &BodySlot| {
            let body = view.world.body(slot);
            body.is_some_and(|body| body.status == BodyStatus::Known)
        };
        let cut_bodies = view
            .pairs
            .truncated()
            .iter()
            .filter(|slot| cut(slot))
            .count() as u64;
        let of_pairs = Reason::Undecided.bit() | Reason::Swept.bit() | Reason::Teleported.bit();
        let unsafe_reasons = reasons & !of_pairs;
        let state = if narrow.count(Verdict::Colliding) > 0 || survey.touched > 0 {
            State::Colliding
        } else if unsafe_reasons != 0 || counts.unknown > 0 {
            State::Unknown
        } else if possible > 0 || survey.open > 0 {
            State::Possible
        } else if narrow.count(Verdict::Near) > 0 {
            State::Near
        } else {
            State::Clear
        };
        out.tick = TickRow {
            header: MessageHeader {
                truncated,
                state: state.code(),
                ..header
            },
            rejects: *view.world.rejects(),
            bodies: counts.bodies,
            unknown: counts.unknown + cut_bodies,
            candidates: view.pairs.len() as u64,
            colliding: narrow.count(Verdict::Colliding),
            possible,
            near: narrow.count(Verdict::Near),
            ignored: view.world.ignored_pairs_count(),
            cancelled_events: self.events.cancelled,
            worst_a: worst.ids.0.0,
            worst_b: worst.ids.1.0,
            widest_m: survey.widest.first().width_m,
            oldest_undecided_ticks: survey.oldest_ticks(view.tick),
            reasons,
            sources: sources(view),
            sources_len: u8::try_from(view.world.sources().len()).unwrap_or(u8::MAX),
            ..TickRow::default()
        };
        repeat(header, state, out);
    }
}

/// Copies the common header and the state into every message.
fn repeat(header: MessageHeader, state: State, out: &mut Outbox) {
    for message in [
        &mut out.pairs_header,
        &mut out.changes_header.message,
        &mut out.contacts_header,
        &mut out.contact_changes_header.message,
        &mut out.regions_header,
        &mut out.bodies_header,
    ] {
        *message = MessageHeader {
            truncated: message.truncated,
            state: state.code(),
            ..header
        };
    }
}

/// Totals over the rows, updated as they come and go.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    worst: Leaders<Worst>,
    widest: Leaders<Width>,
    oldest: Leaders<Wait>,
    /// Pairs that touched during their motion, and those that may have.
    touched: u64,
    open: u64,
    /// Number of contacts of all rows.
    contacts: usize,
}

impl Survey {
    /// Begins a tick with the rows of the last one.
    pub(super) fn begin(&mut self) {
        (self.touched, self.open) = (0, 0);
    }

    /// Clears all rows.
    pub(super) fn forget(&mut self) {
        self.worst.clear();
        self.widest.clear();
        self.oldest.clear();
        (self.contacts, self.touched, self.open) = (0, 0, 0);
    }

    /// Removes a row of the last tick, which goes or is renewed.
    pub(super) fn leave(&mut self, row: &Row) {
        self.contacts -= row.contacts as usize;
        self.worst.leave(&Worst::of(row));
        self.widest.leave(&Width::of(row));
        if let Some(wait) = Wait::of(row) {
            self.oldest.leave(&wait);
        }
    }

    /// Searches the worst pairs, the widest intervals and the longest waits again, if the known ones are gone.
    pub(super) fn look_again<'a>(&mut self, rows: impl Iterator<Item = &'a Row>) {
        if self.worst.are_gone() || self.widest.are_gone() || self.oldest.are_gone() {
            self.worst.clear();
            self.widest.clear();
            self.oldest.clear();
            rows.for_each(|row| self.rank(row));
        }
    }

    /// Adds the row of an active pair, or of one whose motion is news. Rows that exist only for an event are not
    /// surveyed.
    ///
    /// * `passage` - result of its motion, if that is news.
    pub(super) fn take(&mut self, row: &Row, passage: Option<Passage>) {
        match passage {
            Some(Passage::Touched(_)) => self.touched += 1,
            Some(Passage::Open(_)) => self.open += 1,
            Some(Passage::Free) | None => {}
        }
        self.contacts += row.contacts as usize;
        self.rank(row);
    }

    fn rank(&mut self, row: &Row) {
        self.worst.take(Worst::of(row));
        self.widest.take(Width::of(row));
        if let Some(wait) = Wait::of(row) {
            self.oldest.take(wait);
        }
    }

    /// Number of contacts of the pairs.
    pub(super) fn contacts(&self) -> usize {
        self.contacts
    }

    /// Structure check, between two ticks: compares the totals with all rows.
    ///
    /// # Errors
    /// The first difference.
    pub(super) fn validate<'a>(&self, rows: impl Iterator<Item = &'a Row>) -> Result<(), String> {
        let (mut contacts, mut worst, mut widest_m) = (0, Worst::default(), 0.0_f64);
        let mut oldest = Wait::default();
        for row in rows {
            oldest = Wait::of(row)
                .filter(|wait| wait.is_above(&oldest))
                .unwrap_or(oldest);
            contacts += row.contacts as usize;
            widest_m = widest_m.max(row.gap.width());
            // A row that exists only for its event, or for its motion, is no active pair.
            let one = Worst::of(row);
            if row.verdict != Verdict::Apart && one.is_above(&worst) {
                worst = one;
            }
        }
        if contacts != self.contacts {
            let kept = self.contacts;
            return Err(format!("{contacts} contacts of all rows, {kept} kept up"));
        }
        let kept_m = self.widest.first().width_m;
        if widest_m.total_cmp(&kept_m).is_ne() {
            return Err(format!(
                "the widest interval is {widest_m} m, {kept_m} m kept up"
            ));
        }
        let kept = self.oldest.first().since;
        if kept != oldest.since {
            return Err(format!(
                "the oldest undecided pair is so since tick {}, {kept} kept up",
                oldest.since
            ));
        }
        let kept = self.worst.first().ids;
        if kept != worst.ids {
            return Err(format!(
                "the worst pair is {:?}, {kept:?} kept up",
                worst.ids
            ));
        }
        Ok(())
    }

    /// Age of the oldest undecided pair, in ticks; 0: there is none.
    fn oldest_ticks(&self, tick: u64) -> u64 {
        match self.oldest.first().since {
            0 => 0,
            since => tick - since + 1,
        }
    }
}

fn sources(view: &View<'_>) -> [SourceRow; SOURCES_MAX] {
    let mut rows = [SourceRow::default(); SOURCES_MAX];
    for (row, source) in rows.iter_mut().zip(view.world.sources()) {
        *row = source.to_row(view.now_ns);
    }
    rows
}
