//! What the tick thread hands to the sending thread: copies of rows, cut to the limits of ROS 2, in a queue of two.
//! In: an outbox. Out: parcels, the newest kept. No allocation once a parcel has been at its largest.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::open;
use crate::wire::{
    BodyRow, ContactRow, Demand, Event, MessageHeader, NameRow, Outbox, PairRow, Reason, State,
    TickRow, Verdict, pair_flags,
};

/// Parcels that wait: one being sent and one behind it; more would only be older.
const QUEUE_MAX: usize = 2;

/// Limits of what goes out on ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Caps {
    /// Rows of `~/pairs` a tick.
    pub(super) pairs: usize,
    /// Rows of `~/contacts` a tick.
    pub(super) contacts: usize,
}

impl Caps {
    /// How many of these rows go out: an event is told once, so none is left out where there are any rows.
    fn pairs_of(self, rows: &[PairRow]) -> usize {
        if self.pairs == 0 || rows.len() <= self.pairs {
            return self.pairs;
        }
        let events = rows.iter().filter(|row| has_event(row)).count();
        self.pairs.max(events)
    }
}

/// One tick on its way out.
#[derive(Clone, Debug, Default)]
pub(super) struct Parcel {
    pub(super) tick: TickRow,
    /// The tick is done; one that is sent from within has no names yet.
    pub(super) done: bool,
    /// What of the rest was filled.
    pub(super) holds: Demand,
    pub(super) pairs_header: MessageHeader,
    pub(super) pairs: Vec<PairRow>,
    pub(super) contacts_header: MessageHeader,
    pub(super) contacts: Vec<ContactRow>,
    pub(super) bodies: Vec<BodyRow>,
    pub(super) picker: Picker,
}

/// Picks the rows of best rank and keeps their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Picker {
    ranks: Vec<(u8, f64, u32)>,
}

impl Picker {
    /// Copies the `most` rows of least rank, ties by place; returns how many were left out.
    ///
    /// Cost: O(rows), whatever is kept.
    fn pick<T: Copy>(
        &mut self,
        rows: &[T],
        most: usize,
        rank: impl Fn(&T) -> (u8, f64),
        into: &mut Vec<T>,
    ) -> u64 {
        into.clear();
        if rows.len() <= most {
            into.extend_from_slice(rows);
            return 0;
        }
        self.ranks.clear();
        self.ranks.extend(rows.iter().zip(0..).map(|(row, at)| {
            let (class, key) = rank(row);
            (class, key, at)
        }));
        if most > 0 {
            self.ranks.select_nth_unstable_by(most - 1, |a, b| {
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
            });
        }
        self.ranks.truncate(most);
        self.ranks.sort_unstable_by_key(|(.., at)| *at);
        let kept = self
            .ranks
            .iter()
            .filter_map(|(.., at)| rows.get(*at as usize));
        into.extend(kept);
        u64::try_from(rows.len() - into.len()).unwrap_or(u64::MAX)
    }
}

/// Whether it tells of a begin or an end.
fn has_event(row: &PairRow) -> bool {
    row.events & !Event::Persist.bit() != 0
}

/// Rows with events first, then colliding, possible, near; deepest first.
fn pair_rank(row: &PairRow) -> (u8, f64) {
    let has = |flag: u8| row.flags & flag != 0;
    let class = match Verdict::from_code(row.verdict) {
        _ if has_event(row) => 0,
        Some(Verdict::Colliding) => 1,
        _ if has(pair_flags::SWEPT_HIT) => 1,
        Some(Verdict::Possible) => 2,
        _ if has(pair_flags::SWEPT_OPEN) => 2,
        _ => 3,
    };
    (class, row.gap_min_m)
}

impl Parcel {
    /// Rows that do not go out are told in the tick, too: unless it is colliding it is unknown then, as where the tick
    /// itself had cut them off. All messages of a tick say the same state.
    fn note_cut(&mut self, left_out: u64) {
        if left_out == 0 {
            return;
        }
        let header = &mut self.tick.header;
        header.truncated += left_out;
        if header.state != State::Colliding.code() {
            header.state = State::Unknown.code();
        }
        self.tick.reasons |= Reason::Truncated.bit();
        self.pairs_header.state = header.state;
        self.contacts_header.state = header.state;
    }

    /// Takes what a tick filled.
    fn fill(&mut self, outbox: &Outbox, demand: Demand, caps: Caps) {
        self.tick = outbox.tick;
        self.done = true;
        self.holds = demand;
        (self.pairs_header, self.contacts_header) = (outbox.pairs_header, outbox.contacts_header);
        if demand.pairs {
            let most = caps.pairs_of(&outbox.pairs);
            let left_out = self
                .picker
                .pick(&outbox.pairs, most, pair_rank, &mut self.pairs);
            self.pairs_header.truncated += left_out;
            self.note_cut(left_out);
        }
        if demand.contacts {
            let depth = |row: &ContactRow| (row.kind, row.gap_m);
            let left_out =
                self.picker
                    .pick(&outbox.contacts, caps.contacts, depth, &mut self.contacts);
            self.contacts_header.truncated += left_out;
            self.note_cut(left_out);
        }
        if demand.bodies {
            self.bodies.clear();
            self.bodies.extend_from_slice(&outbox.bodies);
        }
    }
}

#[derive(Debug, Default)]
struct Line {
    ready: VecDeque<Parcel>,
    spare: Vec<Parcel>,
    names: Option<(u64, Vec<NameRow>)>,
    dropped: u64,
    stop: bool,
}

/// The queue between the two threads.
#[derive(Debug, Default)]
pub(super) struct Parcels {
    line: Mutex<Line>,
    bell: Condvar,
}

/// What the sending thread finds.
#[derive(Debug)]
pub(super) enum Next {
    /// The oldest parcel that waits, and names where they are new, with their scene revision.
    Parcel(Box<Parcel>, Option<(u64, Vec<NameRow>)>),
    /// Nothing came in time.
    Nothing,
    /// The node closes.
    Stop,
}

impl Parcels {
    /// Puts a tick into the queue; the oldest gives way, and one that is alone before others.
    ///
    /// * returns - ticks that gave way.
    pub(super) fn put(&self, outbox: &Outbox, demand: Demand, caps: Caps) -> u64 {
        let mut parcel = self.take_spare();
        parcel.fill(outbox, demand, caps);
        let names = outbox
            .names_changed
            .then(|| (outbox.tick.header.scene_rev, outbox.names.clone()));
        self.push(parcel, names)
    }

    /// Puts a tick alone.
    ///
    /// * returns - ticks that gave way.
    pub(super) fn put_tick(&self, tick: &TickRow) -> u64 {
        let mut parcel = self.take_spare();
        parcel.tick = *tick;
        parcel.done = false;
        parcel.holds = Demand::default();
        self.push(parcel, None)
    }

    fn take_spare(&self) -> Parcel {
        open(&self.line).spare.pop().unwrap_or_default()
    }

    fn push(&self, parcel: Parcel, names: Option<(u64, Vec<NameRow>)>) -> u64 {
        let mut line = open(&self.line);
        line.ready.push_back(parcel);
        let mut gone = 0;
        if line.ready.len() > QUEUE_MAX {
            // One that is sent from within a tick has nothing but that tick: rows and events are worth more.
            let bare = line.ready.iter().position(|parcel| !parcel.done);
            if let Some(parcel) = line.ready.remove(bare.unwrap_or_default()) {
                line.spare.push(parcel);
                line.dropped += 1;
                gone = 1;
            }
        }
        if names.is_some() {
            line.names = names;
        }
        drop(line);
        self.bell.notify_one();
        gone
    }

    /// Waits for a parcel.
    pub(super) fn next(&self, wait: Duration) -> Next {
        let line = open(&self.line);
        let nothing = |line: &mut Line| line.ready.is_empty() && !line.stop;
        let waited = self.bell.wait_timeout_while(line, wait, nothing);
        let (mut line, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if line.stop {
            return Next::Stop;
        }
        match line.ready.pop_front() {
            Some(parcel) => Next::Parcel(Box::new(parcel), line.names.take()),
            None => Next::Nothing,
        }
    }

    /// Gives a parcel's memory back.
    pub(super) fn give_back(&self, parcel: Parcel) {
        open(&self.line).spare.push(parcel);
    }

    /// Ticks that gave way to newer ones.
    #[cfg(test)]
    pub(super) fn dropped(&self) -> u64 {
        open(&self.line).dropped
    }

    /// Ends the wait of the sending thread for good.
    pub(super) fn stop(&self) {
        open(&self.line).stop = true;
        self.bell.notify_one();
    }
}

#[cfg(test)]
mod tests;
