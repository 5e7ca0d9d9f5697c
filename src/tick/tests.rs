//! What a tick publishes does not depend on what the publisher remembers: an engine that keeps its rows from tick to
//! tick, and its twin that makes each of them anew, fill the same outbox bit by bit.

#![allow(
    clippy::cast_possible_truncation,
    reason = "small numbers of bodies, and chance"
)]

mod changes;

use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::builtin::Random;
use crate::daemon::build_shapes;
use crate::time::{Budget, ManualClock};
use crate::wire::{
    FrameHeader, Inbox, TickCause, TransformRow, WIRE_VERSION, frame_flags, name_bytes,
};
use crate::world::Edit;

const BODIES: u64 = 60;

/// Balls, boxes and a bullet that is swept, near enough to be reported, above a plane; some under a source that falls
/// silent now and then, a few with velocities.
fn scene() -> String {
    let mut text = String::from(
        "[limits]\npair_rows = 90\ncontact_rows = 100\n\
         [[source]]\nname = \"feed\"\ntimeout_ms = 45\n\
         [[source]]\nname = \"other\"\ntimeout_ms = 25\n\
         [[body]]\nname = \"floor\"\nid = 1000\nmoves = false\n\
         shape = { type = \"half_space\", normal = [0.0, 0.0, 1.0] }\n",
    );
    for id in 1..=BODIES {
        let shape = if id % 3 == 0 {
            "{ type = \"box\", half_extents = [0.3, 0.4, 0.5] }"
        } else {
            "{ type = \"sphere\", radius = 0.4 }"
        };
        let source = if id % 7 == 0 { "other" } else { "feed" };
        let more = match id % 10 {
            0 => "continuous = true\n",
            1 => "on_stale = \"hold\"\n",
            2 => "max_speed_mps = 1.0\n",
            3 => "report_within_m = 0.2\n",
            _ => "",
        };
        text += &format!(
            "[[body]]\nname = \"b{id}\"\nid = {id}\nsource = \"{source}\"\nshape = {shape}\n{more}"
        );
    }
    text
}

/// Inputs by chance, the same for both engines.
struct World {
    random: Random,
    places: Vec<[f64; 3]>,
    speeds: Vec<[f64; 3]>,
    asleep: Vec<bool>,
    seq: u64,
}

impl World {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let places = (0..BODIES)
            .map(|_| [0.0, 0.0, 0.0].map(|_: f64| random.range(0.2, 3.6)))
            .collect();
        Self {
            random,
            places,
            speeds: vec![[0.0; 3]; BODIES as usize],
            asleep: vec![true; BODIES as usize],
            seq: 0,
        }
    }

    /// The next frames: most bodies rest, some move, some change their velocity alone.
    fn frames(&mut self, now_ns: u64) -> Inbox {
        let mut inbox = Inbox::default();
        self.seq += 1;
        for at in 0..self.places.len() {
            if self.random.unit() < 0.1 {
                self.asleep[at] = self.random.unit() < 0.8;
            }
            if !self.asleep[at] {
                let jump = if self.random.unit() < 0.02 { 2.0 } else { 0.03 };
                for x in &mut self.places[at] {
                    *x = (*x + self.random.range(-jump, jump)).clamp(0.0, 4.0);
                }
            }
            if self.random.unit() < 0.03 {
                self.speeds[at] = [self.random.range(-1.0, 1.0), 0.0, 0.0];
            }
        }
        for (name, seventh, silent) in [("feed", false, 0.1), ("other", true, 0.4)] {
            if self.random.unit() < silent {
                continue;
            }
            let frame = inbox.push();
            frame.header = FrameHeader {
                session: 1,
                seq: self.seq,
                source: name_bytes(name),
                flags: frame_flags::PARTIAL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            };
            frame.received_ns = now_ns;
            let own = (1..=BODIES).filter(|id| (id % 7 == 0) == seventh);
            let own: Vec<u64> = own.collect();
            let rows: Vec<_> = own.iter().map(|id| self.row(*id)).collect();
            frame.set_transforms(&rows);
            if !seventh {
                frame.velocities = own.iter().map(|id| self.velocity(*id)).collect();
            }
        }
        inbox
    }

    fn row(&self, id: u64) -> TransformRow {
        TransformRow {
            body: id,
            position: self.places[id as usize - 1],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        }
    }

    fn velocity(&self, id: u64) -> [f64; 6] {
        let [x, y, z] = self.speeds[id as usize - 1];
        [x, y, z, 0.0, 0.0, 0.0]
    }

    /// Now and then a body goes, comes back, or is filtered otherwise.
    fn edits(&mut self) -> Vec<EditBatch> {
        if self.random.unit() > 0.06 {
            return Vec::new();
        }
        let name = format!("b{}", 1 + self.random.bits() % BODIES);
        let chance = self.random.unit();
        let edit = if chance < 0.6 {
            let enabled = self.random.unit() < 0.5;
            Edit::Enable { name, enabled }
        } else {
            let mask = if self.random.unit() < 0.5 {
                u32::MAX
            } else {
                0
            };
            Edit::Filter {
                name,
                group: None,
                mask: Some(mask),
            }
        };
        vec![EditBatch {
            token: 1,
            edits: vec![edit],
            validate: chance < 0.1,
            warnings: Vec::new(),
        }]
    }

    /// Who listens, and how much work may be done.
    fn asked(&mut self) -> (Demand, Budget) {
        let mut demand = Demand::ALL;
        if self.seq % 40 > 34 {
            demand.contacts = false;
            demand.pairs = self.seq % 80 > 40;
        }
        let units = [None, Some(0), Some(3), Some(40)][self.random.bits() as usize % 4];
        let budget = Budget {
            time_ns: None,
            units,
        };
        (demand, budget)
    }
}

fn engine(clock: &Arc<ManualClock>) -> Engine {
    engine_of(&scene(), clock)
}

fn engine_of(text: &str, clock: &Arc<ManualClock>) -> Engine {
    let scene = Scene::parse(text, "test", Path::new(".")).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let clock = Arc::clone(clock) as Arc<dyn Clock>;
    Engine::new(&scene, shapes.bodies, 7, clock).unwrap()
}

#[test]
fn a_tick_says_the_same_whether_its_rows_are_kept_or_made_anew() {
    let clock = Arc::new(ManualClock::new(1_000_000_000));
    let (mut keeper, mut twin) = (engine(&clock), engine(&clock));
    let mut world = World::new(5);
    let (mut rows, mut cut) = (0, 0);
    for tick in 1..=1500 {
        clock.advance(10_000_000);
        let (inbox, edits) = (world.frames(clock.boottime_ns()), world.edits());
        let (mut demand, budget) = world.asked();
        // They tell what was forgotten: see `changes`.
        (demand.changes, demand.contact_changes) = (false, false);
        let broken = tick % 211 == 0;
        let run = |engine: &mut Engine| {
            if broken {
                engine.broad = BroadPhase::new(engine.method);
            }
            let edits = if broken {
                vec![EditBatch {
                    token: 2,
                    edits: Vec::new(),
                    validate: true,
                    warnings: Vec::new(),
                }]
            } else {
                edits.clone()
            };
            let input = TickInput {
                inbox: &inbox,
                edits: &edits,
                demand,
                budget,
                cause: TickCause::Frame,
                cause_source: Some(0),
                woke_ns: clock.monotonic_ns(),
                pulse: None,
            };
            format!("{:?}", engine.tick(input))
        };
        let kept = run(&mut keeper);
        twin.publisher.forget_rows();
        let made = run(&mut twin);
        if kept != made {
            let [kept, made] =
                [&kept, &made].map(|text| text.split(" PairRow").collect::<Vec<_>>());
            let differ = kept.iter().zip(&made).find(|(one, other)| one != other);
            panic!("tick {tick}: kept, then made anew: {differ:#?}");
        }
        rows += keeper.out.pairs.len();
        cut += usize::from(keeper.out.pairs_header.truncated > 0);
        cut += usize::from(keeper.out.contacts_header.truncated > 0);
    }
    assert!(
        rows > 50_000 && cut > 100,
        "{rows} rows, {cut} messages cut"
    );
}

/// The bodies of a source that is silent for good are undecided for good, and cost the ticks of others nothing.
#[test]
fn bug_rows_of_a_dead_source_were_made_anew_in_every_tick() {
    let clock = Arc::new(ManualClock::new(1_000_000_000));
    // How far a body may be that has a greatest speed grows with its age.
    let text = scene().replace("max_speed_mps = 1.0\n", "");
    let mut engine = engine_of(&text, &clock);
    let mut world = World::new(3);
    let mut oldest = 0;
    for tick in 1..=40 {
        clock.advance(10_000_000);
        let inbox = if tick == 1 {
            world.frames(clock.boottime_ns())
        } else {
            Inbox::default()
        };
        engine.tick(TickInput {
            inbox: &inbox,
            edits: &[],
            demand: Demand::ALL,
            budget: Budget::UNLIMITED,
            cause: TickCause::Heartbeat,
            cause_source: None,
            woke_ns: clock.monotonic_ns(),
            pulse: None,
        });
        let row = &engine.out.tick;
        if tick > 10 {
            assert!(row.possible > 50, "{} undecided pairs", row.possible);
            assert_eq!(row.oldest_undecided_ticks, oldest + 1);
        }
        oldest = row.oldest_undecided_ticks;
        if tick > 30 {
            assert_eq!(engine.publisher.reviewed, 0, "tick {tick}");
        }
    }
}

/// Pairs that were visited when the stamps had these numbers before are visited all the same.
#[test]
fn bug_after_as_many_ticks_as_there_are_stamps_each_pair_is_looked_at_as_before() {
    let clock = Arc::new(ManualClock::new(1_000_000_000));
    let (mut young, mut old) = (engine(&clock), engine(&clock));
    let mut world = World::new(9);
    for tick in 1..=200 {
        clock.advance(10_000_000);
        let inbox = world.frames(clock.boottime_ns());
        if tick == 100 {
            old.narrow.set_stamp(u32::MAX - 3);
        }
        let told = [&mut young, &mut old].map(|engine| {
            let input = TickInput {
                inbox: &inbox,
                edits: &[],
                demand: Demand::ALL,
                budget: Budget::UNLIMITED,
                cause: TickCause::Frame,
                cause_source: Some(0),
                woke_ns: clock.monotonic_ns(),
                pulse: None,
            };
            format!("{:?}", engine.tick(input))
        });
        assert!(told[0] == told[1], "tick {tick}");
    }
}
