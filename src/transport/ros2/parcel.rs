//! The queue between the tick thread and the sending thread: two ticks, as copies of rows cut to the limits of ROS 2.
//! In: an outbox. Out: parcels, the newest kept. The tick thread allocates only for new names and growing row counts.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::open;
use crate::wire::{
    BodyRow, ContactRow, Demand, Event, MessageHeader, NameRow, Outbox, PairRow, Reason, State,
    TickRow, Verdict, pair_flags,
};

/// Parcels that wait: one to be sent next and one after it; more would only be older.
const QUEUE_MAX: usize = 2;

/// Row limits of messages on ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Caps {
    /// Rows of `~/pairs` per tick.
    pub(super) pairs: usize,
    /// Rows of `~/contacts` per tick.
    pub(super) contacts: usize,
}

impl Caps {
    /// Row limit for these pairs. An event is published only once, so all rows with events fit unless the limit is 0.
    fn pairs_of(self, rows: &[PairRow]) -> usize {
        if self.pairs == 0 || rows.len() <= self.pairs {
            return self.pairs;
        }
        let events = rows.iter().filter(|row| has_event(row)).count();
        self.pairs.max(events)
    }
}

/// The output of one tick for the sending thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Parcel {
    pub(super) tick: TickRow,
    /// Whether the tick has ended; a parcel from within a tick has only the tick row, and no names yet.
    pub(super) done: bool,
    /// Which row lists were filled.
    pub(super) holds: Demand,
    pub(super) pairs_header: MessageHeader,
    pub(super) pairs: Vec<PairRow>,
    pub(super) contacts_header: MessageHeader,
    pub(super) contacts: Vec<ContactRow>,
    pub(super) bodies: Vec<BodyRow>,
    pub(super) picker: Picker,
}

/// Selects the rows of lowest rank and keeps their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Picker {
    ranks: Vec<(u8, f64, u32)>,
}

impl Picker {
    /// Copies the `most` rows of lowest rank, ties by position; returns the number of rows left out.
    ///
    /// Cost: O(rows + kept log kept).
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

/// Whether the row has a begin or end event.
fn has_event(row: &PairRow) -> bool {
    row.events & !Event::Persist.bit() != 0
}

/// Rank of a pair: rows with events first, then colliding, possible, near; lowest `gap_min_m` first.
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
    /// Adds rows left out to the tick's `truncated`. The state becomes unknown unless it is colliding, as where the
    /// engine itself truncates a tick. All messages of a tick have the same state.
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

    /// Copies the output of a tick.
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

/// Result of waiting for a parcel.
#[derive(Debug)]
pub(super) enum Next {
    /// The oldest waiting parcel, and the names if they are new, with their scene revision.
    Parcel(Box<Parcel>, Option<(u64, Vec<NameRow>)>),
    /// No parcel came in time.
    Nothing,
    /// The node is closing.
    Stop,
}

impl Parcels {
    /// Queues a tick. When the queue is full, the oldest parcel without rows is dropped, else the oldest parcel.
    ///
    /// * returns - number of ticks dropped.
    pub(super) fn put(&self, outbox: &Outbox, demand: Demand, caps: Caps) -> u64 {
        let mut parcel = self.take_spare();
        parcel.fill(outbox, demand, caps);
        let names = outbox
            .names_changed
            .then(|| (outbox.tick.header.scene_rev, outbox.names.clone()));
        self.push(parcel, names)
    }

    /// Queues a tick row without other rows.
    ///
    /// * returns - number of ticks dropped.
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
            // A parcel from within a tick has only the tick row; rows and events are worth more.
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

    /// Waits for a parcel, at most for `wait`.
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

    /// Returns a parcel's memory for reuse.
    pub(super) fn give_back(&self, parcel: Parcel) {
        open(&self.line).spare.push(parcel);
    }

    /// Number of ticks dropped for newer ones.
    #[cfg(test)]
    pub(super) fn dropped(&self) -> u64 {
        open(&self.line).dropped
    }

    /// Ends the wait of the sending thread permanently.
    pub(super) fn stop(&self) {
        open(&self.line).stop = true;
        self.bell.notify_one();
    }
}

#[cfg(test)]
mod tests;
