//! From rows to messages: names looked up, ticks of many rows cut into messages of at most 128 KB. Pure.

use std::collections::{BTreeMap, VecDeque};

use super::{
    BodyTransform, BodyTransforms, Contact, Contacts, Header, Name, Names, Pair, Pairs, Pose,
    Source, State, Tick, TickHeader, Time,
};
use crate::wire::{
    self, BodyRow, BodyStatus, ContactRow, MessageHeader, NameRow, PairRow, Reason, SourceRow,
    TickRow, frame_flags, name_str,
};

/// Bytes of one message: bursts beyond a peer's receive buffer (208 KB by default) are lost and slowly repaired, so
/// 128 KB with their headers is the most.
const MESSAGE_BYTES_MAX: usize = 120_000;
/// Bytes of a row beside its names, with the padding of CDR, rounded up.
const PAIR_BYTES: usize = 152;
/// As [`PAIR_BYTES`].
const CONTACT_BYTES: usize = 248;
/// As [`PAIR_BYTES`].
const NAME_BYTES: usize = 40;

/// Names kept of bodies that have left: the row that ends a pair comes after its body has gone, later still where it
/// did not fit.
const GONE_MAX: usize = 1024;

/// Names of bodies by id and ids by name, as of one scene revision.
#[derive(Clone, Debug, Default)]
pub struct Book {
    by_id: BTreeMap<u64, NameRow>,
    by_name: BTreeMap<String, u64>,
    /// Bodies that have left, the newest last. An id stays with its name for a boot, so none of these is ever wrong.
    gone: VecDeque<NameRow>,
}

impl Book {
    /// A book of rows.
    #[must_use]
    pub fn of(rows: &[NameRow]) -> Self {
        let mut book = Self::default();
        for row in rows {
            book.by_name.insert(name_of(row).to_owned(), row.body);
            book.by_id.insert(row.body, *row);
        }
        book
    }

    /// The next revision of this book, which keeps the names of those that have left.
    #[must_use]
    pub fn next(&self, rows: &[NameRow]) -> Self {
        let mut next = Self::of(rows);
        let left = self.gone.iter().chain(self.by_id.values());
        next.gone = left.filter(|row| !next.holds(row.body)).copied().collect();
        let over = next.gone.len().saturating_sub(GONE_MAX);
        next.gone.drain(..over);
        next
    }

    /// Whether a body is in the scene.
    #[must_use]
    pub fn holds(&self, body: u64) -> bool {
        self.by_id.contains_key(&body)
    }

    /// The name of a body, in the scene or not long gone; else empty.
    #[must_use]
    pub fn name(&self, body: u64) -> &str {
        let gone = || self.gone.iter().rfind(|row| row.body == body);
        self.by_id.get(&body).or_else(gone).map_or("", name_of)
    }

    /// The place of the source that moves a body of the scene; `None`: no such body, or none moves it.
    #[must_use]
    pub fn source(&self, body: u64) -> Option<usize> {
        let place = self.by_id.get(&body)?.source;
        usize::try_from(place).ok().filter(|_| place != u32::MAX)
    }

    /// The id of a name in the scene.
    #[must_use]
    pub fn id(&self, name: &str) -> Option<u64> {
        self.by_name.get(name).copied()
    }

    /// The rows, by id.
    pub fn rows(&self) -> impl Iterator<Item = &NameRow> {
        self.by_id.values()
    }
}

fn name_of(row: &NameRow) -> &str {
    let len = usize::try_from(row.len).unwrap_or(0).min(row.name.len());
    row.name
        .get(..len)
        .and_then(|bytes| std::str::from_utf8(bytes).ok())
        .unwrap_or_default()
}

/// Counters of the node that go out with the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Messages that were not sent.
    pub sends_dropped: u64,
    /// Samples that could not be decoded.
    pub undecodable: u64,
    /// Datagrams that the kernel dropped before DDS.
    pub datagrams_dropped: u64,
    /// Datagrams that DDS could not read.
    pub datagrams_unread: u64,
    /// Samples that were refused, or passed over for newer ones.
    pub refused: u64,
    /// Widest skew of a chain, nanoseconds; `None`: no chain.
    pub skew_ns: Option<u64>,
}

/// Writes messages in one frame.
#[derive(Clone, Debug, Default)]
pub struct Speaker {
    /// The scene's frame.
    pub frame_id: String,
    /// Names in force.
    pub book: Book,
    /// What `header.stamp` says in place of the oldest stamp of all sources, of whatever clock.
    pub stamp: Option<Time>,
}

impl Speaker {
    /// `header.stamp` is the oldest pose used, unless [`Speaker::stamp`] says another.
    #[must_use]
    pub fn header(&self, stamp_ns: u64) -> Header {
        Header {
            stamp: self.stamp.unwrap_or(Time::from_ns(stamp_ns)),
            frame_id: self.frame_id.clone(),
        }
    }

    /// `~/state`.
    #[must_use]
    pub fn state(&self, row: &TickRow) -> State {
        let reasons = Reason::ALL
            .iter()
            .filter(|reason| row.reasons & reason.bit() != 0);
        State {
            header: self.header(row.header.oldest_stamp_ns),
            tick_header: tick_header(&row.header),
            word: wire::State::from_code(row.header.state)
                .map_or("unknown", wire::State::word)
                .to_owned(),
            reasons: row.reasons,
            reason_words: reasons.map(ToString::to_string).collect(),
            worst_a: row.worst_a,
            worst_b: row.worst_b,
            worst_name_a: self.book.name(row.worst_a).to_owned(),
            worst_name_b: self.book.name(row.worst_b).to_owned(),
        }
    }

    /// `~/tick`.
    #[must_use]
    pub fn tick(&self, row: &TickRow, counts: Counts) -> Tick {
        let sources = row.sources.iter().take(usize::from(row.sources_len));
        Tick {
            header: self.header(row.header.oldest_stamp_ns),
            tick_header: tick_header(&row.header),
            sent_ns: row.sent_ns,
            elapsed_ns: row.elapsed_ns,
            budget_ns: row.budget_ns,
            budget_units: row.budget_units,
            floor_ns: row.floor_ns,
            units: row.units,
            stage_ns: row.stage_ns,
            rejects: row.rejects,
            bodies: row.bodies,
            unknown: row.unknown,
            candidates: row.candidates,
            colliding: row.colliding,
            possible: row.possible,
            near: row.near,
            ignored: row.ignored,
            missed: row.missed,
            cancelled_events: row.cancelled_events,
            worst_a: row.worst_a,
            worst_b: row.worst_b,
            widest_m: row.widest_m,
            oldest_undecided_ticks: row.oldest_undecided_ticks,
            reasons: row.reasons,
            cause: row.cause,
            overrun: row.overrun != 0,
            cause_source: row.cause_source,
            rebuilds: row.rebuilds,
            broad_renewed: row.broad_renewed,
            broad_mode: row.broad_mode,
            broad_cause: row.broad_cause,
            sources: sources.map(source).collect(),
            sends_dropped: counts.sends_dropped,
            receipts_undecodable: counts.undecodable,
            receipts_refused: counts.refused,
            tf_skew_s: counts.skew_ns.map_or(f64::NAN, seconds),
        }
    }

    /// `~/pairs`, at least one message.
    #[must_use]
    pub fn pairs(&self, header: &MessageHeader, rows: &[PairRow]) -> Vec<Pairs> {
        let size = |row: &PairRow| self.names_bytes(row.body_a, row.body_b) + PAIR_BYTES;
        cut(rows, size)
            .map(|(rows, chunk_index, chunk_count)| Pairs {
                header: self.header(header.oldest_stamp_ns),
                tick_header: tick_header(header),
                chunk_index,
                chunk_count,
                complete: header.truncated == 0,
                pairs: rows.iter().map(|row| self.pair(row)).collect(),
            })
            .collect()
    }

    /// Where bodies are, of which a pose is known: poses as sources send them.
    #[must_use]
    pub fn bodies(&self, tick: &TickRow, rows: &[BodyRow]) -> BodyTransforms {
        let not_received = BodyStatus::NotReceived.code();
        let placed = rows.iter().filter(|row| row.status != not_received);
        let transform = |row: &BodyRow| BodyTransform {
            name: self.book.name(row.body).to_owned(),
            body: row.body,
            pose: Pose {
                position: row.position.into(),
                orientation: row.orientation.into(),
            },
        };
        BodyTransforms {
            header: self.header(tick.header.oldest_stamp_ns),
            seq: tick.header.tick,
            sent_ns: tick.sent_ns,
            boot_id: tick.header.boot_id,
            flags: frame_flags::PARTIAL,
            transforms: placed.map(transform).collect(),
            ..BodyTransforms::default()
        }
    }

    /// `~/contacts`, at least one message.
    #[must_use]
    pub fn contacts(&self, header: &MessageHeader, rows: &[ContactRow]) -> Vec<Contacts> {
        let size = |row: &ContactRow| self.names_bytes(row.body_a, row.body_b) + CONTACT_BYTES;
        cut(rows, size)
            .map(|(rows, chunk_index, chunk_count)| Contacts {
                header: self.header(header.oldest_stamp_ns),
                tick_header: tick_header(header),
                chunk_index,
                chunk_count,
                complete: header.truncated == 0,
                contacts: rows.iter().map(|row| self.contact(row)).collect(),
            })
            .collect()
    }

    /// `~/names`, at least one message.
    #[must_use]
    pub fn names(&self, stamp: Time, boot_id: u64, scene_rev: u64) -> Vec<Names> {
        let rows: Vec<NameRow> = self.book.rows().copied().collect();
        let size = |row: &NameRow| usize::try_from(row.len).unwrap_or(0) + NAME_BYTES;
        let name = |row: &NameRow| Name {
            body: row.body,
            generation: row.generation,
            source: row.source,
            name: name_of(row).to_owned(),
        };
        cut(&rows, size)
            .map(|(rows, chunk_index, chunk_count)| Names {
                header: Header {
                    stamp,
                    frame_id: self.frame_id.clone(),
                },
                boot_id,
                scene_rev,
                chunk_index,
                chunk_count,
                names: rows.iter().map(name).collect(),
            })
            .collect()
    }

    fn names_bytes(&self, a: u64, b: u64) -> usize {
        self.book.name(a).len() + self.book.name(b).len()
    }

    fn pair(&self, row: &PairRow) -> Pair {
        Pair {
            name_a: self.book.name(row.body_a).to_owned(),
            name_b: self.book.name(row.body_b).to_owned(),
            body_a: row.body_a,
            body_b: row.body_b,
            gap_min_m: row.gap_min_m,
            gap_max_m: row.gap_max_m,
            gap_best_m: row.gap_best_m,
            closing_mps: row.closing_mps,
            toi_min: row.toi_min,
            toi_max: row.toi_max,
            begin_first_tick: row.begin_first_tick,
            begin_last_tick: row.begin_last_tick,
            end_first_tick: row.end_first_tick,
            end_last_tick: row.end_last_tick,
            certified_tick: row.certified_tick,
            bound_age_ticks: row.bound_age_ticks,
            verdict: row.verdict,
            certified_verdict: row.certified_verdict,
            events: row.events,
            end_cause: row.end_cause,
            level: row.level,
            flags: row.flags,
        }
    }

    fn contact(&self, row: &ContactRow) -> Contact {
        Contact {
            id: row.id,
            name_a: self.book.name(row.body_a).to_owned(),
            name_b: self.book.name(row.body_b).to_owned(),
            body_a: row.body_a,
            body_b: row.body_b,
            point_a: row.point_a.into(),
            point_b: row.point_b.into(),
            point_a_body: row.point_a_body.into(),
            point_b_body: row.point_b_body.into(),
            normal: row.normal.into(),
            gap_m: row.gap_m,
            gap_min_m: row.gap_min_m,
            gap_max_m: row.gap_max_m,
            shape_a: row.shape_a,
            shape_b: row.shape_b,
            triangle_a: row.triangle_a,
            triangle_b: row.triangle_b,
            flags: row.flags,
            kind: row.kind,
        }
    }
}

/// The head of a tick as every message repeats it.
#[must_use]
pub fn tick_header(row: &MessageHeader) -> TickHeader {
    TickHeader {
        boot_id: row.boot_id,
        tick: row.tick,
        scene_rev: row.scene_rev,
        oldest_stamp_ns: row.oldest_stamp_ns,
        newest_stamp_ns: row.newest_stamp_ns,
        truncated: row.truncated,
        state: row.state,
    }
}

fn seconds(ns: u64) -> f64 {
    std::time::Duration::from_nanos(ns).as_secs_f64()
}

fn source(row: &SourceRow) -> Source {
    Source {
        name: name_str(&row.name).unwrap_or_default().to_owned(),
        session: row.session,
        epoch: row.epoch,
        seq: row.seq,
        stamp_ns: row.stamp_ns,
        clock_id: row.clock_id,
        age_ns: row.age_ns,
        frames: row.frames,
        skipped: row.skipped,
        refused: row.refused,
        alive: row.alive != 0,
        paused: row.paused != 0,
    }
}

/// Cuts rows into runs that each fit a message; at least one run, which may be empty.
///
/// * returns - each run, its place among them, and how many there are.
fn cut<T>(rows: &[T], size: impl Fn(&T) -> usize) -> impl Iterator<Item = (&[T], u32, u32)> {
    let (mut all, mut from, mut bytes) = (Vec::new(), 0, 0);
    for (at, row) in rows.iter().enumerate() {
        let own = size(row);
        if bytes + own > MESSAGE_BYTES_MAX && at > from {
            all.push(rows.get(from..at).unwrap_or_default());
            (from, bytes) = (at, 0);
        }
        bytes += own;
    }
    all.push(rows.get(from..).unwrap_or_default());
    let count = u32::try_from(all.len()).unwrap_or(u32::MAX);
    all.into_iter()
        .zip(0..)
        .map(move |(run, at)| (run, at, count))
}

#[cfg(test)]
mod tests;
