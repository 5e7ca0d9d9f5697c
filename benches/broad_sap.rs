//! One update of the broad phase beside rapier3d-f64's `BroadPhaseBvh` and the bare tree of parry3d-f64, on the same
//! f64 boxes: `cargo bench --bench broad_sap -- [--bodies 1000,10000] [--ticks 200] [--scene NAME]
//! [--alone]`.
//!
//! CSV on stdout. Times are CPU times of the update alone (rapier: `set_aabb` of the moved boxes and `update`; parry: leaves,
//! refit, optimiser, self-traversal, the pairs written); filling the peers' own objects is not timed. Work
//! differs: ours and rapier's report begun and ended pairs, parry writes all pairs. In the last tick of each run our
//! pairs are compared with those that parry's tree gives, exactly.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a bench prints, and stops at the first surprise"
)]

#[path = "../tests/common/mod.rs"]
mod common;

use std::process::Command;

use common::Rng;
use parry3d_f64::bounding_volume::Aabb as PeerBox;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d_f64::prelude as rapier;
use sweepd::broad::{BroadPhase, Method, Proxies, Work};
use sweepd::ids::{BodyId, BodySlot};
use sweepd::math::{Aabb, Point, Vec3};
use sweepd::pairs::{PairDelta, PairPolicy, PairSet};
use sweepd::time::{Clock, SystemClock};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

const SEED: u64 = 7;

/// Boxes on their way.
struct World {
    rng: Rng,
    centres: Vec<Point>,
    halves: Vec<Vec3>,
    velocities: Vec<Vec3>,
    boxes: Vec<Aabb>,
    side: Vec3,
    changes: ChangeSet,
}

impl Proxies for World {
    fn aabb(&self, slot: BodySlot) -> &Aabb {
        &self.boxes[slot.index()]
    }
    fn unbounded(&self, _: BodySlot) -> bool {
        false
    }
    fn id(&self, slot: BodySlot) -> BodyId {
        BodyId(u64::from(slot.0) + 1)
    }
}

struct Everything;

impl PairPolicy for Everything {
    fn allows(&self, _: BodySlot, _: BodySlot) -> bool {
        true
    }
}

/// The scenes: boxes with sides 0.5 to 1, half a body a cubic metre, bouncing off the walls; the pile lies five deep
/// on a floor. `speed` is in units of the mean side, 0.75, per tick.
#[derive(Clone, Copy, PartialEq)]
struct Scene {
    name: &'static str,
    speed: f64,
    /// One body in so many moves.
    moving: usize,
}

const SCENES: &[Scene] = &[
    Scene {
        name: "gas",
        speed: 0.001,
        moving: 1,
    },
    Scene {
        name: "gas",
        speed: 0.01,
        moving: 1,
    },
    Scene {
        name: "gas",
        speed: 0.1,
        moving: 1,
    },
    Scene {
        name: "static1",
        speed: 0.01,
        moving: 100,
    },
    Scene {
        name: "pile",
        speed: 0.0027,
        moving: 1,
    },
    Scene {
        name: "teleport",
        speed: 0.01,
        moving: 1,
    },
    Scene {
        name: "churn",
        speed: 0.01,
        moving: 1,
    },
];

impl World {
    fn new(scene: Scene, bodies: usize) -> Self {
        let n = bodies as f64;
        let side = if scene.name == "pile" {
            Vec3::new((n / 5.0).sqrt(), (n / 5.0).sqrt(), 3.4)
        } else {
            Vec3::repeat((n / 0.5).cbrt())
        };
        let mut rng = Rng::new(SEED);
        let mut world = Self {
            centres: Vec::new(),
            halves: Vec::new(),
            velocities: Vec::new(),
            boxes: Vec::new(),
            side,
            changes: ChangeSet::default(),
            rng: Rng::new(SEED + 1),
        };
        for i in 0..bodies {
            let mut centre = Point::from(side.map(|s| rng.between(0.0, s)));
            let mut half = Vec3::from_fn(|_, _| rng.between(0.25, 0.5));
            if scene.name == "pile" {
                half.z = 0.35;
                centre.z = 0.35 + 0.68 * (i % 5) as f64;
                if i == 0 {
                    (centre, half) = (Point::from(side / 2.0), side / 2.0);
                    (centre.z, half.z) = (-0.5, 0.51);
                }
            }
            let way = Vec3::from_fn(|_, _| rng.between(-1.0, 1.0)).normalize();
            world.velocities.push(way * scene.speed * 0.75);
            world.centres.push(centre);
            world.halves.push(half);
            world.boxes.push(Aabb {
                min: centre - half,
                max: centre + half,
            });
            world.changes.inserted.push(BodySlot(i as u32));
        }
        world
    }

    fn step(&mut self, scene: Scene) {
        self.changes.clear();
        for i in 0..self.centres.len() {
            let slot = BodySlot(i as u32);
            if i % scene.moving != 0 || (scene.name == "pile" && i == 0) {
                continue;
            }
            let (c, v) = (&mut self.centres[i], &mut self.velocities[i]);
            if scene.name == "pile" {
                // Jitter about its place.
                *v = -*v;
            }
            *c += *v;
            for k in 0..3 {
                if scene.name != "pile" && !(0.0..=self.side[k]).contains(&c[k]) {
                    v[k] = -v[k];
                    c[k] = c[k].clamp(0.0, self.side[k]);
                }
            }
            if scene.name == "teleport" && self.rng.once_in(20) {
                let side = self.side;
                *c = Point::from(side.map(|s| self.rng.between(0.0, s)));
            }
            if scene.name == "churn" && self.rng.once_in(100) {
                let cause = EndCause::Removed;
                self.changes.removed.push(Removed { slot, cause });
                self.changes.inserted.push(slot);
            } else {
                self.changes.moved.push(slot);
            }
            let half = self.halves[i];
            self.boxes[i] = Aabb {
                min: *c - half,
                max: *c + half,
            };
        }
    }

    fn peer_box(&self, slot: BodySlot) -> PeerBox {
        let aabb = &self.boxes[slot.index()];
        let vector = |p: &Point| glamx::DVec3::new(p.x, p.y, p.z);
        PeerBox {
            mins: vector(&aabb.min),
            maxs: vector(&aabb.max),
        }
    }
}

/// Times and what came out.
struct Run {
    first_ns: u64,
    ticks_ns: Vec<u64>,
    pairs: usize,
    work: Work,
}

/// Lets one method run; `update` is told to bring itself up to date and gives its number of pairs.
fn time(
    scene: Scene,
    bodies: usize,
    ticks: usize,
    mut update: impl FnMut(&World) -> (usize, Work),
) -> Run {
    let mut world = World::new(scene, bodies);
    let clock = SystemClock;
    let from = clock.thread_cpu_ns();
    update(&world);
    let first_ns = clock.thread_cpu_ns() - from;
    let mut run = Run {
        first_ns,
        ticks_ns: Vec::new(),
        pairs: 0,
        work: Work::default(),
    };
    for _ in 0..ticks {
        world.step(scene);
        let from = clock.thread_cpu_ns();
        let (pairs, work) = update(&world);
        run.ticks_ns.push(clock.thread_cpu_ns() - from);
        run.pairs = pairs;
        run.work.swaps += work.swaps;
        run.work.tests += work.tests;
        run.work.rebuilds += work.rebuilds;
        run.work.partial = work.partial;
        run.work.axes = work.axes;
    }
    run
}

fn ours(scene: Scene, bodies: usize, ticks: usize) -> Run {
    let mut broad = BroadPhase::new(Method::SweepAndPrune);
    let (mut pairs, mut delta) = (PairSet::new(1 << 22), PairDelta::default());
    time(scene, bodies, ticks, |world| {
        broad.update(&world.changes, world, &Everything, &mut pairs, &mut delta);
        (pairs.len(), broad.work())
    })
}

fn parry(scene: Scene, bodies: usize, ticks: usize) -> Run {
    let (mut tree, mut space) = (Bvh::new(), BvhWorkspace::default());
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    time(scene, bodies, ticks, |world| {
        if tree.is_empty() {
            let boxes: Vec<_> = (0..bodies)
                .map(|i| world.peer_box(BodySlot(i as u32)))
                .collect();
            tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        }
        for slot in world.changes.inserted.iter().chain(&world.changes.moved) {
            tree.insert_or_update_partially(world.peer_box(*slot), slot.0, 0.0);
        }
        tree.refit(&mut space);
        tree.optimize_incremental(&mut space);
        pairs.clear();
        tree.traverse_bvtt_single_tree::<false>(&mut space, &mut |a, b| {
            let (one, other) = (BodySlot(a), BodySlot(b));
            if world.aabb(one).overlaps(world.aabb(other)) {
                pairs.push((a, b));
            }
        });
        (pairs.len(), Work::default())
    })
}

fn rapier(scene: Scene, bodies: usize, ticks: usize) -> Run {
    let mut colliders = rapier::ColliderSet::new();
    let handles: Vec<_> = (0..bodies)
        .map(|_| {
            colliders.insert(
                rapier::ColliderBuilder::cuboid(0.5, 0.5, 0.5)
                    .active_collision_types(rapier::ActiveCollisionTypes::all()),
            )
        })
        .collect();
    let (bodies_none, params) = (
        rapier::RigidBodySet::new(),
        rapier::IntegrationParameters::default(),
    );
    let (mut broad, mut events) = (rapier::BroadPhaseBvh::new(), Vec::new());
    let mut count = 0_usize;
    time(scene, bodies, ticks, |world| {
        for slot in world.changes.inserted.iter().chain(&world.changes.moved) {
            broad.set_aabb(&params, handles[slot.index()], world.peer_box(*slot));
        }
        events.clear();
        broad.update(&params, &colliders, &bodies_none, &[], &[], &mut events);
        for event in &events {
            match event {
                rapier::BroadPhasePairEvent::AddPair(_) => count += 1,
                rapier::BroadPhasePairEvent::DeletePair(_) => count = count.saturating_sub(1),
            }
        }
        (count, Work::default())
    })
}

fn told(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output();
    let text = output.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
    text.unwrap_or_default().replace(',', ";")
}

fn print_row(scene: Scene, bodies: usize, method: &str, run: &mut Run, where_from: &str) {
    run.ticks_ns.sort_unstable();
    let at =
        |share: f64| run.ticks_ns[((run.ticks_ns.len() - 1) as f64 * share) as usize] as f64 / 1e3;
    let count = run.ticks_ns.len() as u64;
    let mean = run.ticks_ns.iter().sum::<u64>() as f64 / count as f64 / 1e3;
    let work = run.work;
    println!(
        "{where_from},{SEED},{},{bodies},{},{},{method},{},{:.1},{:.1},{:.1},{:.1},{},{},{},{},{},{}",
        scene.name,
        scene.speed,
        100.0 / scene.moving as f64,
        count,
        run.first_ns as f64 / 1e3,
        at(0.5),
        mean,
        at(0.99),
        run.pairs,
        work.swaps / count,
        work.tests / count,
        work.rebuilds,
        work.partial,
        work.axes
            .iter()
            .zip("xyz".chars())
            .filter(|(k, _)| **k)
            .map(|(_, c)| c)
            .collect::<String>(),
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let sizes = option("--bodies").unwrap_or("1000,10000".into());
    let ticks: usize = option("--ticks").map_or(200, |t| t.parse().unwrap());
    let only = option("--scene");
    let alone = arguments.iter().any(|a| a == "--alone");
    let machine = told(
        "sh",
        &["-c", "grep -m1 'model name' /proc/cpuinfo | cut -d: -f2"],
    );
    let commit = told("git", &["describe", "--always", "--dirty"]);
    let where_from = format!("{machine},{commit},{}", told("rustc", &["--version"]));
    println!(
        "machine,commit,compiler,seed,scene,bodies,speed_sizes_per_tick,moving_percent,method,ticks,first_us,\
         median_us,mean_us,p99_us,pairs,swaps,tests,rebuilds,partial,axes"
    );
    for bodies in sizes.split(',').map(|n| n.parse::<usize>().unwrap()) {
        for scene in SCENES
            .iter()
            .filter(|s| only.as_deref().is_none_or(|name| name == s.name))
        {
            let mut sap = ours(*scene, bodies, ticks);
            if alone {
                print_row(*scene, bodies, "sweepd-sap", &mut sap, &where_from);
                continue;
            }
            let mut tree = parry(*scene, bodies, ticks);
            assert_eq!(
                sap.pairs, tree.pairs,
                "{}: the exact pairs differ",
                scene.name
            );
            print_row(*scene, bodies, "sweepd-sap", &mut sap, &where_from);
            print_row(*scene, bodies, "parry-bvh", &mut tree, &where_from);
            print_row(
                *scene,
                bodies,
                "rapier-bvh",
                &mut rapier(*scene, bodies, ticks),
                &where_from,
            );
        }
    }
}
