//! Goal: damage to the narrow phase's memory is found. Method: intersecting bodies of all kinds are worked on with too
//! small a budget, so that something is in progress everywhere; then one fault at a time is introduced into a fresh
//! memory.

use std::path::Path;

use super::*;
use crate::daemon::build_shapes;
use crate::ids::PairKey;
use crate::narrow::arena::Run;
use crate::narrow::cover::Open;
use crate::narrow::cursor::Cursor;
use crate::narrow::holdings::Holdings;
use crate::narrow::memo::Hot;
use crate::narrow::mesh::{FrontStore, Search};
use crate::narrow::shelves::Shelves;
use crate::narrow::{NONE, Order, Wanted};
use crate::pairs::{Ended, PairDelta};
use crate::scene::Scene;
use crate::shape::{BoxId, ball};
use crate::time::{ManualClock, Meter};
use crate::wire::EndCause;
use crate::world::{Parts, World};

/// A ball of 528 triangles as text.
fn mesh() -> String {
    let mesh = ball(12, 0.0);
    let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|v| v.coords.into()).collect();
    let faces = mesh.faces();
    format!("{{ type = \"trimesh\", vertices = {vertices:?}, faces = {faces:?} }}")
}

/// Balls and boxes, single and compound, meshes and convex, on a floor, each overlapping the next.
fn scene() -> String {
    let (mesh, cube) = (mesh(), "{ type = \"box\", half_extents = [0.8, 0.8, 0.8] }");
    let floor = "{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }";
    let round = "{ type = \"cylinder\", radius = 0.7, half_height = 0.8 }";
    let both = format!("[{mesh}, {cube}]");
    let shapes = [floor, &mesh, &mesh, cube, round, round, &both, &both, &mesh];
    let bodies = (0..).zip(shapes).map(|(at, shape)| {
        let x = 0.7 * f64::from(at);
        format!(
            "[[body]]\nname = \"b{at}\"\nid = {}\nmoves = false\nposition = [{x:?}, {:?}, 0.0]\nshape = {shape}\n",
            at + 1,
            0.3 * x
        )
    });
    bodies.collect()
}

type Bodies = (Scene, Vec<Parts>);

fn bodies() -> Bodies {
    let scene = Scene::parse(&scene(), "test", Path::new(".")).unwrap();
    let shapes = build_shapes(&scene).unwrap().bodies;
    (scene, shapes)
}

struct Stage {
    world: World,
    pairs: PairSet,
    narrow: Narrow,
}

impl Stage {
    /// Every pair of bodies except those that a filter forbids, and a tick with `units` units.
    fn new((scene, shapes): &Bodies, units: Option<u64>) -> Self {
        let world = World::new(scene, shapes.clone(), 0).unwrap();
        let mut pairs = PairSet::new(1_000);
        let mut delta = PairDelta::default();
        let slots: Vec<_> = world.bodies().map(|(slot, _)| slot).collect();
        for (at, &a) in slots.iter().enumerate() {
            for &b in &slots[at + 1..] {
                delta.began.extend(pairs.insert(PairKey::new(a, b)));
            }
        }
        let narrow = Narrow::new(8);
        let mut stage = Self {
            world,
            pairs,
            narrow,
        };
        stage.tick(1, &delta, units);
        stage
    }

    fn tick(&mut self, tick: u64, delta: &PairDelta, units: Option<u64>) {
        let Self {
            world,
            pairs,
            narrow,
        } = self;
        let wanted = Wanted {
            contacts: true,
            bounds: true,
            regions: true,
            order: Order::Counted,
        };
        narrow.begin(tick, world, pairs, delta);
        narrow.widen(world, pairs);
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, None, units);
        narrow.spend(world, wanted, &mut meter);
    }

    fn why(&self) -> String {
        self.narrow.validate(&self.pairs).unwrap_err()
    }
}

/// The first memory that satisfies a condition.
fn place(narrow: &Narrow, is_it: impl Fn(&Memo) -> bool) -> usize {
    narrow.memos.iter().position(is_it).unwrap()
}

#[test]
fn what_work_leaves_holds_whenever_it_is_cut_off_and_when_pairs_end() {
    let bodies = bodies();
    for units in (0..600).step_by(37).map(Some).chain([None]) {
        let mut stage = Stage::new(&bodies, units);
        stage.narrow.validate(&stage.pairs).unwrap();
        // Every third pair ends, and begins again in the next tick.
        let gone: Vec<(PairSlot, PairKey)> = stage.pairs.iter().step_by(3).collect();
        let mut delta = PairDelta::default();
        for &(slot, key) in &gone {
            stage.pairs.remove(slot);
            let cause = EndCause::Separated;
            delta.ended.push(Ended { slot, key, cause });
        }
        stage.tick(2, &delta, units);
        stage.narrow.validate(&stage.pairs).unwrap();
        delta.clear();
        stage.pairs.open_tick();
        for (_, key) in gone {
            delta.began.extend(stage.pairs.insert(key));
        }
        stage.tick(3, &delta, units);
        stage.narrow.validate(&stage.pairs).unwrap();
    }
}

/// A fault to introduce, and the message expected for it.
type Fault = (&'static str, fn(&mut Narrow));

/// With little work done: much is in progress.
const UNDER_WAY: [Fault; 12] = [
    ("of different lengths", |narrow| {
        narrow.urgencies.pop();
    }),
    ("memories of", |narrow| {
        let spare = narrow.hot.len();
        narrow.hot.push(Hot {
            live: true,
            ..Hot::dead()
        });
        narrow.memos.push(Memo::new());
        narrow.urgencies.push(narrow.urgencies[spare - 1]);
    }),
    ("listed as active", |narrow| {
        narrow.active.push(narrow.active[0])
    }),
    ("listed twice as undecided", |narrow| {
        narrow.undecided.push(narrow.undecided[0]);
    }),
    ("is undecided: true, and listed: false", |narrow| {
        narrow.undecided.pop();
    }),
    ("is undecided: false, and listed: true", |narrow| {
        let slot = narrow.undecided[0];
        narrow.memos[slot.index()].queued = false;
    }),
    ("of no pair is listed as undecided", |narrow| {
        narrow.undecided.push(PairSlot(1_000_000));
    }),
    ("is to be refreshed: true, and listed: false", |narrow| {
        let at = place(narrow, |memo| !memo.refreshing);
        narrow.memos[at].refreshing = true;
    }),
    ("neither free nor held: fronts", |narrow| {
        let at = place(narrow, |memo| memo.front != NONE);
        narrow.memos[at].front = NONE;
    }),
    ("held twice, or free and held: queries", |narrow| {
        let mut at = narrow.shelves.cursors.take(Cursor::default);
        narrow.memos[0].cursor = at;
        narrow.shelves.cursors.give(&mut at);
    }),
    ("not there: fronts of bodies", |narrow| {
        let at = place(narrow, |memo| memo.compound != NONE);
        narrow.memos[at].compound = 1_000;
    }),
    ("one is lost, or two overlap", |narrow| {
        // A block without an owner.
        let mut run = Run::default();
        let open = Open {
            low: 0.0,
            a: BoxId(0),
            b: BoxId(0),
        };
        assert!(narrow.shelves.store.entries.open.push(&mut run, open));
    }),
];

/// Units with which something of each kind is in progress.
fn units_under_way(bodies: &Bodies) -> u64 {
    let is_under_way = |units: &u64| {
        let narrow = Stage::new(bodies, Some(*units)).narrow;
        let held = |place: fn(&Memo) -> u32| narrow.memos.iter().any(|memo| place(memo) != NONE);
        let fronts = held(|memo| memo.front) && held(|memo| memo.compound);
        fronts && !narrow.undecided.is_empty()
    };
    (0..600).step_by(3).find(is_under_way).unwrap()
}

#[test]
fn what_is_broken_while_work_is_under_way_is_found() {
    let bodies = bodies();
    let units = units_under_way(&bodies);
    for (told, fault) in UNDER_WAY {
        let mut stage = Stage::new(&bodies, Some(units));
        stage.narrow.validate(&stage.pairs).unwrap();
        fault(&mut stage.narrow);
        let why = stage.why();
        assert!(why.contains(told), "{why}, not {told}");
    }
}

/// With all work done.
const DONE: [Fault; 3] = [
    ("a certificate is of no pair of boxes", |narrow| {
        let Shelves { fronts, store, .. } = &mut narrow.shelves;
        let mut held = Holdings::default();
        fronts.all().iter().for_each(|front| front.tell(&mut held));
        let mut runs = held.covers.iter().map(|cover| cover.runs_of_groups()[0]);
        let run = runs.find(|run| !run.is_empty()).unwrap();
        store.entries.groups.all_mut(run)[0].mask = 0;
    }),
    ("neither free nor held: shells", |narrow| {
        let at = place(narrow, |memo| memo.shell != NONE);
        narrow.memos[at].shell = NONE;
    }),
    ("held twice, or free and held: contact sets", |narrow| {
        let with = |memo: &Memo| memo.contacts != NONE;
        let at = place(narrow, with);
        let other = narrow.memos.iter().rposition(with).unwrap();
        narrow.memos[at].contacts = narrow.memos[other].contacts;
    }),
];

#[test]
fn what_is_broken_when_all_is_done_is_found() {
    let bodies = bodies();
    for (told, fault) in DONE {
        let mut stage = Stage::new(&bodies, None);
        stage.narrow.validate(&stage.pairs).unwrap();
        fault(&mut stage.narrow);
        let why = stage.why();
        assert!(why.contains(told), "{why}, not {told}");
    }
}

/// Two balls of triangles that are near each other, at rest: their bounding boxes overlap.
#[test]
fn bug_a_pair_at_rest_that_found_no_room_is_asked_again_in_the_next_tick() {
    let (mesh, more) = (
        mesh(),
        "{ type = \"sphere\", radius = 0.1, position = [-9.0, 0.0, 0.0] }",
    );
    for shape in [mesh.clone(), format!("[{mesh}, {more}]")] {
        let text = format!(
            "[[body]]\nname = \"a\"\nid = 1\nmoves = false\nshape = {shape}\n\
             [[body]]\nname = \"b\"\nid = 2\nmoves = false\nposition = [1.165, 1.165, 1.165]\nshape = {mesh}\n"
        );
        let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
        let shapes = build_shapes(&scene).unwrap().bodies;
        let mut stage = Stage::new(&(scene, shapes), Some(0));
        let slot = stage.pairs.iter().next().unwrap().0;
        // No cheap test decides it, and there is no room for a search.
        stage.narrow.set_search(Search::Restart);
        stage.narrow.shelves.store = FrontStore::with_room(0, 0);
        let none = PairDelta::default();
        for tick in 2..5 {
            let turns = stage.narrow.memos[slot.index()].turns;
            stage.tick(tick, &none, None);
            stage.narrow.validate(&stage.pairs).unwrap();
            assert_eq!(stage.narrow.hot[slot.index()].verdict, Verdict::Possible);
            assert!(
                stage.narrow.memos[slot.index()].turns > turns,
                "tick {tick}"
            );
        }
        stage.narrow.give_back(slot);
        stage.narrow.shelves.store = FrontStore::default();
        stage.tick(5, &none, None);
        assert_eq!(stage.narrow.hot[slot.index()].verdict, Verdict::Apart);
    }
}
