//! Law 3.9: events in messages that reached no reader come with the next message that does, each once and in order.
//! Balls move randomly, and messages are lost randomly; readers keep lists from the rows.

use std::collections::{BTreeMap, BTreeSet};

use sweepd::builtin::Random;
use sweepd::wire::{Event, Outbox, PairRow, Undelivered, Verdict};

use crate::rig::{ALL, Rig, ball, has, scene};

type Ids = (u64, u64);

fn ids(row: &PairRow) -> Ids {
    (row.body_a, row.body_b)
}

/// The collisions reported to a reader as begun, and the number of begins.
#[derive(Default)]
struct Told {
    open: BTreeSet<Ids>,
    begins: u64,
}

impl Told {
    /// Applies the rows of a message; asserts that each event follows from the earlier ones.
    fn take<'a>(&mut self, rows: impl Iterator<Item = &'a PairRow>, what: &str) {
        for row in rows {
            let what = format!("{what}: {row:?}");
            if has(row, Event::End) {
                assert!(self.open.remove(&ids(row)), "{what}");
                assert!(row.end_first_tick <= row.end_last_tick, "{what}");
            }
            if has(row, Event::Begin) {
                self.begins += 1;
                assert!(self.open.insert(ids(row)), "{what}");
                assert!(row.begin_first_tick <= row.begin_last_tick, "{what}");
                assert!(row.end_last_tick <= row.begin_first_tick, "{what}");
            }
            let goes_on = has(row, Event::Persist);
            assert!(!goes_on || self.open.contains(&ids(row)), "{what}");
        }
    }
}

/// `pairs` as a door sends them to readers that lack events.
fn mended(out: &Outbox) -> BTreeMap<Ids, PairRow> {
    let rows = out.pairs.iter().chain(&out.owed);
    let mut rows: BTreeMap<_, _> = rows.map(|row| (ids(row), *row)).collect();
    rows.retain(|_, row| !row.has_left());
    rows
}

/// A reader of `changes`.
#[derive(Default)]
struct List {
    rows: BTreeMap<Ids, PairRow>,
    tick: u64,
    told: Told,
}

impl List {
    fn take(&mut self, out: &Outbox, what: &str) {
        let header = &out.changes_header;
        if header.base_tick == 0 {
            self.rows.clear();
        } else {
            assert_eq!(header.base_tick, self.tick, "{what}");
        }
        for row in &out.changes {
            if row.has_left() {
                assert_ne!(
                    header.base_tick, 0,
                    "{what}: a whole list has no row that left"
                );
                self.rows.remove(&ids(row));
            } else {
                self.rows.insert(ids(row), *row);
            }
        }
        assert!(out.changes.is_sorted_by_key(ids), "{what}");
        assert_eq!(self.rows.len() as u64, header.listed, "{what}");
        self.tick = header.message.tick;
        self.told.take(out.changes.iter(), what);
    }
}

fn colliding(rig: &Rig) -> BTreeSet<Ids> {
    let rows = rig.out.pairs.iter();
    let rows = rows.filter(|row| row.verdict == Verdict::Colliding.code());
    rows.map(ids).collect()
}

/// Plays a run; returns the number of begins that each reader received.
///
/// * `pair_rows` - number of pair rows that fit in a message.
fn play(seed: u64, pair_rows: usize) -> [u64; 3] {
    let mut random = Random::new(seed);
    let head = format!("[limits]\npair_rows = {pair_rows}\n");
    let balls: Vec<_> = (1..=7)
        .map(|id| ball(id, 10.0 * id as f64, "report_within_m = 0.5"))
        .collect();
    let mut rig = Rig::new(&scene(&head, &balls));
    let (mut all, mut pairs, mut list) = (Told::default(), Told::default(), List::default());
    let mut lost = Undelivered::default();
    for tick in 1..=400 {
        let what = format!("seed {seed}, {pair_rows} rows, tick {tick}");
        for id in 1..=7 {
            if random.unit() < 0.3 {
                rig.move_x(id, 12.0 * random.unit());
            }
        }
        rig.demand.changes_anew = lost.changes || tick == 1;
        rig.send(ALL);
        all.take(rig.out.pairs.iter(), &what);
        // Near the end no message is lost any more.
        let is_lost = |chance: f64| chance < 0.5 && tick < 380;
        lost = Undelivered {
            messages: 1,
            pairs: is_lost(random.unit()),
            changes: is_lost(random.unit()),
        };
        if !lost.pairs {
            let rows = mended(&rig.out);
            assert!(rows.len() <= pair_rows, "{what}");
            pairs.take(rows.values(), &what);
        }
        if !lost.changes {
            assert!(rig.out.changes_header.listed <= pair_rows as u64, "{what}");
            list.take(&rig.out, &what);
        }
        if pair_rows == 100 {
            let now = colliding(&rig);
            assert_eq!(all.open, now, "{what}");
            assert!(lost.pairs || pairs.open == now, "{what}");
            assert!(lost.changes || list.told.open == now, "{what}");
        }
        rig.engine.note_undelivered(lost);
        rig.engine.validate().unwrap();
    }
    rig.demand.changes_anew = false;
    rig.send(ALL);
    if pair_rows == 100 {
        assert!(rig.out.owed.is_empty());
        let missed = all.begins - pairs.begins.min(list.told.begins);
        assert_eq!(rig.out.owed_cancelled, missed, "seed {seed}");
    }
    [all.begins, pairs.begins, list.told.begins]
}

#[test]
fn law_3_9_events_of_messages_that_were_lost_come_later_each_once() {
    let mut sum = [0; 3];
    for seed in 1..=20 {
        for (sum, begins) in sum.iter_mut().zip(play(seed, 100)) {
            *sum += begins;
        }
    }
    let [all, pairs, changes] = sum;
    assert!(pairs < all && changes < all, "some cancel: {sum:?}");
    assert!(pairs > all / 3 && changes > all / 3, "most come: {sum:?}");
}

#[test]
fn law_3_9_events_of_messages_that_were_lost_keep_to_the_limit_of_rows() {
    for seed in 1..=20 {
        for pair_rows in [1, 2, 4] {
            play(seed, pair_rows);
        }
    }
}
