//! A list of pairs that is kept from `changes` holds what `pairs` says, field by field, whatever happens to the scene;
//! and `changes` say the same where nobody reads `pairs`.

use std::collections::BTreeMap;

use super::*;
use crate::wire::PairRow;

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

/// What came in how many ticks.
#[derive(Debug, Default)]
struct Seen {
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

fn same(one: &[PairRow], other: &[PairRow], what: &str) {
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
fn a_list_kept_from_changes_holds_what_pairs_says_whatever_happens() {
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
    for tick in 1..=1500_u64 {
        clock.advance(10_000_000);
        let (mut inbox, mut edits) = (world.frames(clock.boottime_ns()), world.edits());
        let (mut demand, budget) = world.asked();
        let (broken, forgotten) = (tick % 211 == 0, tick % 173 == 0);
        trouble.frames(&mut inbox);
        trouble.edits(&mut edits, broken);
        demand.changes = tick % 300 > 3;
        demand.changes_anew = trouble.random.unit() < 0.02;
        let run = |engine: &mut Engine, pairs: bool| {
            if broken {
                engine.broad = BroadPhase::new(engine.method);
            }
            if forgotten {
                engine.publisher.forget_rows();
            }
            engine.tick(TickInput {
                inbox: &inbox,
                edits: &edits,
                demand: Demand { pairs, ..demand },
                budget,
                cause: TickCause::Frame,
                cause_source: Some(0),
                woke_ns: clock.monotonic_ns(),
                pulse: None,
            });
        };
        run(&mut both, true);
        run(&mut lone, false);
        assert!(lone.out.pairs.is_empty());
        if !demand.changes {
            assert!(both.out.changes.is_empty());
            continue;
        }
        let what = format!("seed {seed}, tick {tick}");
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
