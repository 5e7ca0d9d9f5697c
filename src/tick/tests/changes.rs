//! A list of pairs that is kept from `changes` holds what `pairs` says, field by field, whatever happens to the scene,
//! and one of contacts that is kept from `contact_changes` what `contacts` says; and both say the same where nobody
//! reads `pairs` or `contacts`.

use std::collections::BTreeMap;

use super::*;
use crate::wire::{ContactRow, PairRow};

/// What a reader of `changes` keeps: by ids, the tick that sent the row, and the row.
#[derive(Default)]
struct List {
    rows: BTreeMap<(u64, u64), (u64, PairRow)>,
    tick: u64,
}

impl List {
    fn apply(&mut self, out: &Outbox) {
        let header = &out.changes_header;
        let tick = header.message.tick;
        if header.base_tick == 0 {
            self.rows.clear();
        } else {
            assert_eq!(header.base_tick, self.tick);
        }
        for row in &out.changes {
            let ids = (row.body_a, row.body_b);
            if row.has_left() {
                assert_ne!(
                    header.base_tick, 0,
                    "nothing has left a list told as a whole"
                );
                assert!(self.rows.remove(&ids).is_some(), "{ids:?} was not listed");
            } else {
                self.rows.insert(ids, (tick, *row));
            }
        }
        self.tick = tick;
        assert_eq!(self.rows.len() as u64, header.listed);
    }

    fn rows(&self) -> Vec<PairRow> {
        let at_tick = |(sent, row): &(u64, PairRow)| {
            let mut row = *row;
            row.age(self.tick - sent);
            row
        };
        self.rows.values().map(at_tick).collect()
    }
}

/// What a reader of `contact_changes` keeps, by ids.
#[derive(Default)]
struct Contacts {
    rows: BTreeMap<(u64, u64), Vec<ContactRow>>,
    tick: u64,
}

impl Contacts {
    fn apply(&mut self, out: &Outbox) {
        let header = &out.contact_changes_header;
        if header.base_tick == 0 {
            self.rows.clear();
        } else {
            assert_eq!(header.base_tick, self.tick);
        }
        let ids = |row: &ContactRow| (row.body_a, row.body_b);
        assert!(out.contact_changes.is_sorted_by_key(ids));
        for rows in out.contact_changes.chunk_by(|x, y| ids(x) == ids(y)) {
            if rows[0].is_gone() {
                assert_eq!((rows.len(), header.base_tick == 0), (1, false));
                let had = self.rows.remove(&ids(&rows[0]));
                assert!(had.is_some(), "{:?} had no contacts", ids(&rows[0]));
            } else {
                self.rows.insert(ids(&rows[0]), rows.to_vec());
            }
        }
        self.tick = header.message.tick;
        assert_eq!(self.rows().count() as u64, header.listed);
    }

    fn rows(&self) -> impl Iterator<Item = &ContactRow> {
        self.rows.values().flatten()
    }
}

/// What came in how many ticks.
#[derive(Debug, Default)]
struct Seen {
    contact_deltas: u64,
    contact_wholes: u64,
    contacts_cut: u64,
    contacts_gone: usize,
    contacts_told: usize,
    contacts_kept: usize,
    deltas: u64,
    wholes: u64,
    cut: u64,
    left: usize,
    changed: usize,
    aged: usize,
}

impl Seen {
    fn note(&mut self, out: &Outbox) {
        let (header, rows) = (&out.changes_header, &out.changes);
        self.cut += u64::from(header.message.truncated > 0);
        if header.base_tick == 0 {
            self.wholes += 1;
            return;
        }
        self.deltas += 1;
        let left = rows.iter().filter(|row| row.has_left()).count();
        self.left += left;
        self.changed += rows.len() - left;
        self.aged += out.pairs.len() - (rows.len() - left);
    }

    fn note_contacts(&mut self, out: &Outbox) {
        let (header, rows) = (&out.contact_changes_header, &out.contact_changes);
        self.contacts_cut += u64::from(header.message.truncated > 0);
        if header.base_tick == 0 {
            self.contact_wholes += 1;
            return;
        }
        self.contact_deltas += 1;
        let gone = rows.iter().filter(|row| row.is_gone()).count();
        self.contacts_gone += gone;
        self.contacts_told += rows.len() - gone;
        self.contacts_kept += out.contacts.len() - (rows.len() - gone);
    }
}

/// What is done to both engines in a tick, beside what [`World`] does: the source restarts, its world is reset, bodies
/// go for good, a structure is broken and repaired, rows are forgotten.
struct Trouble {
    random: Random,
    session: u64,
    epoch: u64,
}

impl Trouble {
    fn frames(&mut self, inbox: &mut Inbox) {
        if self.random.unit() < 0.01 {
            self.session += 1;
        }
        if self.random.unit() < 0.01 {
            self.epoch += 1;
        }
        for frame in inbox.frames_mut() {
            (frame.header.session, frame.header.epoch) = (self.session, self.epoch);
        }
    }

    fn edits(&mut self, edits: &mut Vec<EditBatch>, broken: bool) {
        let chance = self.random.unit();
        let name = format!("b{}", 1 + self.random.bits() % BODIES);
        let edit = match chance {
            _ if broken => None,
            x if x < 0.002 => Some(Edit::Reset { source: None }),
            x if x < 0.006 => Some(Edit::Remove { name }),
            _ => return,
        };
        edits.push(EditBatch {
            token: 2,
            edits: edit.into_iter().collect(),
            validate: broken,
            warnings: Vec::new(),
        });
    }
}

fn same<T: std::fmt::Debug>(one: &[T], other: &[T], what: &str) {
    // As text: NaN is equal to NaN here, and 0 not to -0.
    let [one, other] = [one, other].map(|rows| {
        let rows = rows.iter().map(|row| format!("{row:?}"));
        rows.collect::<Vec<_>>()
    });
    if one != other {
        let differ = one.iter().zip(&other).find(|(one, other)| one != other);
        panic!(
            "{what}: {} and {} rows, {differ:#?}",
            one.len(),
            other.len()
        );
    }
}

#[test]
fn lists_kept_from_changes_hold_what_pairs_and_contacts_say_whatever_happens() {
    let mut seen = Seen::default();
    for seed in 1..=4 {
        play(seed, &mut seen);
    }
    assert!(
        seen.deltas > 3000 && seen.wholes > 500 && seen.cut > 100,
        "{seen:?}"
    );
    assert!(
        seen.left > 1500 && seen.changed > 30_000 && seen.aged > 30_000,
        "{seen:?}"
    );
    assert!(
        seen.contact_deltas > 3000 && seen.contact_wholes > 500 && seen.contacts_cut > 100,
        "{seen:?}"
    );
    assert!(
        seen.contacts_gone > 1000 && seen.contacts_told > 10_000 && seen.contacts_kept > 10_000,
        "{seen:?}"
    );
}

fn play(seed: u64, seen: &mut Seen) {
    let clock = Arc::new(ManualClock::new(1_000_000_000));
    let (mut both, mut lone) = (engine(&clock), engine(&clock));
    let mut world = World::new(seed);
    let mut trouble = Trouble {
        random: Random::new(seed + 100),
        session: 1,
        epoch: 0,
    };
    let mut list = List::default();
    let (mut contacts, mut lone_contacts) = (Contacts::default(), Contacts::default());
    for tick in 1..=1500_u64 {
        clock.advance(10_000_000);
        let (mut inbox, mut edits) = (world.frames(clock.boottime_ns()), world.edits());
        let (mut demand, budget) = world.asked();
        let (broken, forgotten) = (tick % 211 == 0, tick % 173 == 0);
        trouble.frames(&mut inbox);
        trouble.edits(&mut edits, broken);
        demand.changes = tick % 300 > 3;
        demand.contact_changes = demand.contacts;
        demand.changes_anew = trouble.random.unit() < 0.02;
        let run = |engine: &mut Engine, whole: bool| {
            let demand = Demand {
                pairs: whole,
                contacts: whole && demand.contacts,
                ..demand
            };
            if broken {
                engine.broad = BroadPhase::new(engine.method);
            }
            if forgotten {
                engine.publisher.forget_rows();
            }
            engine.tick(TickInput {
                inbox: &inbox,
                edits: &edits,
                demand,
                budget,
                cause: TickCause::Frame,
                cause_source: Some(0),
                woke_ns: clock.monotonic_ns(),
                pulse: None,
            });
        };
        run(&mut both, true);
        run(&mut lone, false);
        assert!(lone.out.pairs.is_empty() && lone.out.contacts.is_empty());
        let what = format!("seed {seed}, tick {tick}");
        if demand.contact_changes {
            for (engine, list) in [(&both, &mut contacts), (&lone, &mut lone_contacts)] {
                let header = engine.out.contact_changes_header;
                assert!(!demand.changes_anew || header.base_tick == 0, "{what}");
                assert_eq!(header.message, both.out.contacts_header, "{what}");
                list.apply(&engine.out);
                let kept: Vec<_> = list.rows().copied().collect();
                same(&kept, &both.out.contacts, &what);
            }
            seen.note_contacts(&both.out);
        } else {
            assert!(both.out.contact_changes.is_empty(), "{what}");
        }
        if !demand.changes {
            assert!(both.out.changes.is_empty());
            continue;
        }
        let header = both.out.changes_header;
        assert_eq!(header, lone.out.changes_header, "{what}");
        same(&both.out.changes, &lone.out.changes, &what);
        assert!(!demand.changes_anew || header.base_tick == 0, "{what}");
        assert_eq!(header.message, both.out.pairs_header, "{what}");
        assert_eq!(both.out.tick.header, lone.out.tick.header, "{what}");
        list.apply(&both.out);
        same(&list.rows(), &both.out.pairs, &what);
        seen.note(&both.out);
    }
}
