//! Goal: faults in the publisher are found. Method: a tick of bodies at rest that touch and are near is published; then
//! faults are made one by one, each in its own publisher or messages.

use std::path::Path;

use super::super::fit::Stood;
use super::super::listing::Row;
use super::super::{Publisher, View};
use crate::daemon::build_shapes;
use crate::ids::{BodyId, PairKey};
use crate::math::Interval;
use crate::narrow::{Narrow, Order, Wanted};
use crate::pairs::{PairDelta, PairSet};
use crate::scene::Scene;
use crate::time::{ManualClock, Meter};
use crate::wire::{Demand, Outbox, Verdict};
use crate::world::World;

/// A row of balls, each overlapping the next and near the one after that, after its first tick.
pub(in crate::publish) struct Stage {
    pub(in crate::publish) world: World,
    pub(in crate::publish) pairs: PairSet,
    pub(in crate::publish) narrow: Narrow,
    pub(in crate::publish) publisher: Publisher,
    out: Outbox,
    tick: u64,
}

impl Stage {
    /// * `pair_rows` - rows that fit into a message.
    pub(in crate::publish) fn new(pair_rows: usize) -> Self {
        let bodies = (0..8).map(|at| {
            let shape = "{ type = \"sphere\", radius = 1.0 }";
            let x = 1.5 * f64::from(at);
            format!(
                "[[body]]\nname = \"b{at}\"\nid = {}\nmoves = false\nreport_within_m = 2.0\n\
                 position = [{x:?}, 0.0, 0.0]\nshape = {shape}\n",
                at + 1
            )
        });
        let text: String = bodies.collect();
        let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
        let shapes = build_shapes(&scene).unwrap().bodies;
        let world = World::new(&scene, shapes, 0).unwrap();
        let mut pairs = PairSet::new(1_000);
        let mut delta = PairDelta::default();
        let slots: Vec<_> = world.bodies().map(|(slot, _)| slot).collect();
        for (at, &a) in slots.iter().enumerate() {
            for &b in &slots[at + 1..] {
                delta.began.extend(pairs.insert(PairKey::new(a, b)));
            }
        }
        let mut limits = scene.config.limits;
        limits.pair_rows = pair_rows;
        let (narrow, publisher) = (Narrow::new(8), Publisher::new(limits));
        let mut stage = Self {
            world,
            pairs,
            narrow,
            publisher,
            out: Outbox::default(),
            tick: 0,
        };
        stage.tick(&delta);
        stage
    }

    fn tick(&mut self, delta: &PairDelta) {
        self.tick += 1;
        let (narrow, world) = (&mut self.narrow, &mut self.world);
        narrow.begin(self.tick, world, &self.pairs, delta);
        narrow.widen(world, &mut self.pairs);
        let wanted = Wanted {
            contacts: true,
            bounds: true,
            regions: false,
            order: Order::AsFound,
        };
        let clock = ManualClock::new(0);
        narrow.spend(world, wanted, &mut Meter::unlimited(&clock));
        let mut view = View {
            world,
            pairs: &self.pairs,
            delta,
            narrow,
            demand: Demand::ALL,
            boot_id: 7,
            tick: self.tick,
            now_ns: 0,
        };
        self.publisher.fill(&mut view, &mut self.out);
    }

    fn check(&self) -> Result<(), String> {
        let of = (&self.world, &self.pairs, &self.narrow);
        self.publisher.validate(self.tick, of, &self.out)
    }
}

/// A fault, and the expected message.
type Fault = (&'static str, fn(&mut Stage));

const FAULTS: [Fault; 12] = [
    ("known is", |stage| {
        // A row that says near for a pair that collides.
        let listing = &mut stage.publisher.listing;
        let at = listing
            .iter()
            .position(|row| row.verdict == Verdict::Colliding);
        let at = at.unwrap();
        let row = *listing.row(at);
        listing.renew(
            at,
            Row {
                verdict: Verdict::Near,
                ..row
            },
            false,
        );
    }),
    ("not apart and has no row", |stage| {
        stage.publisher.listing.drop(0);
        stage.publisher.listing.close();
    }),
    ("contacts of all rows", |stage| {
        let row = *stage.publisher.listing.row(0);
        stage.publisher.survey.leave(&row);
    }),
    ("the widest interval", |stage| {
        let row = *stage.publisher.listing.row(0);
        let wide = Row {
            contacts: 0,
            gap: Interval::UNKNOWN,
            ..row
        };
        stage.publisher.survey.take(&wide, None);
    }),
    ("the worst pair", |stage| {
        let row = *stage.publisher.listing.row(0);
        let deep = Row {
            ids: (BodyId(1), BodyId(u64::MAX)),
            contacts: 0,
            best_m: -1e9,
            verdict: Verdict::Colliding,
            ..row
        };
        stage.publisher.survey.take(&deep, None);
    }),
    ("wait to be told of", |stage| {
        let ids = stage.publisher.listing.row(0).ids;
        stage.publisher.chain.note_dropped(true, ids);
    }),
    ("rows of pairs are not by ids", |stage| {
        stage.out.pairs.swap(0, 1)
    }),
    ("rows of pairs are not those of the list", |stage| {
        stage.out.pairs.pop();
    }),
    ("rows of pairs settled", |stage| {
        stage.publisher.stood = Stood::Nowhere;
        stage.out.pairs.pop();
    }),
    ("not where its mark says", |stage| {
        let marks = &mut stage.publisher.listing.marks;
        let at = marks.iter().position(|mark| mark.contacts.len > 0).unwrap();
        marks[at].contacts.first += 1;
    }),
    ("contacts settled", |stage| {
        let row = stage.out.contacts[0];
        stage.out.contacts.push(row);
    }),
    ("not given yet", |stage| stage.publisher.next_contact = 1),
];

#[test]
fn what_is_broken_in_the_publisher_is_found() {
    for (told, fault) in FAULTS {
        let mut stage = Stage::new(1_000);
        stage.check().unwrap();
        fault(&mut stage);
        let why = stage.check().unwrap_err();
        assert!(why.contains(told), "{why}, not {told}");
    }
}

#[test]
fn what_is_kept_holds_whatever_fits_and_when_nothing_happens() {
    for pair_rows in 1..20 {
        let mut stage = Stage::new(pair_rows);
        for _ in 0..10 {
            stage.check().unwrap();
            stage.tick(&PairDelta::default());
        }
    }
}
