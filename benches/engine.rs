//! A whole engine tick against rapier3d-f64's `CollisionPipeline`: the same convex bodies, poses and demand for
//! contacts, in one run, in turn tick by tick. Timed on both sides: reading the poses, broad phase, narrow phase,
//! contacts; on our side also filling the outbox with all rows of pairs and contacts, or with their changes only.
//!
//! `cargo bench --bench engine [-- --quick | --case=N [--ticks=N]]`; a single case, counted from 0, is printed and not
//! saved; `--ticks` replaces its number of ticks.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::panic,
    clippy::cast_sign_loss,
    clippy::too_many_lines,
    reason = "a bench"
)]

mod common;

use common::{Bench, Flight, arguments, provenance, quantile, row, save};
use rapier3d_f64::prelude::{
    ActiveCollisionTypes, BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet,
    CollisionPipeline, IslandManager, NarrowPhase, Pose as RapierPose, RigidBodySet, Vector,
};
use sweepd::builtin::pool;
use sweepd::math::Pose;
use sweepd::scene::Scene;
use sweepd::shape::ShapeSpec;
use sweepd::time::{Budget, Clock, SystemClock};
use sweepd::wire::Demand;

/// How pairs and contacts are published.
#[derive(Clone, Copy, Debug)]
enum Rows {
    /// All rows of pairs and of contacts in each tick.
    Pairs,
    /// All contacts, but only changes of the list of pairs.
    Changes,
    /// Only changes of both; the reader keeps its own lists, as rapier does internally.
    News,
}

impl Rows {
    /// The demand; it includes contacts, which rapier's pipeline computes too.
    fn demand(self) -> Demand {
        Demand {
            pairs: matches!(self, Self::Pairs),
            changes: matches!(self, Self::Changes | Self::News),
            contacts: matches!(self, Self::Pairs | Self::Changes),
            contact_changes: matches!(self, Self::News),
            ..Demand::default()
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Pairs => "pairs",
            Self::Changes => "changes",
            Self::News => "news",
        }
    }
}

/// The same scene in rapier.
struct Peer {
    pipeline: CollisionPipeline,
    islands: IslandManager,
    broad: BroadPhaseBvh,
    narrow: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    handles: Vec<(ColliderHandle, bool)>,
}

impl Peer {
    fn new(scene: &Scene) -> Self {
        let mut colliders = ColliderSet::new();
        let mut handles = Vec::new();
        for body in scene.bodies.iter().filter(|body| body.moves) {
            // Rapier's cylinders and cones have their axis along y, ours along z.
            let (builder, upright) = match &body.shapes[0].shape {
                ShapeSpec::Sphere { radius } => (ColliderBuilder::ball(*radius), false),
                ShapeSpec::Box {
                    half_extents: [x, y, z],
                } => (ColliderBuilder::cuboid(*x, *y, *z), false),
                ShapeSpec::Capsule {
                    radius,
                    half_height,
                } => (ColliderBuilder::capsule_z(*half_height, *radius), false),
                ShapeSpec::Cylinder {
                    radius,
                    half_height,
                } => (ColliderBuilder::cylinder(*half_height, *radius), true),
                ShapeSpec::Cone {
                    radius,
                    half_height,
                } => (ColliderBuilder::cone(*half_height, *radius), true),
                ShapeSpec::Convex { vertices, .. } => {
                    let points: Vec<Vector> = vertices
                        .iter()
                        .map(|p| Vector::new(p[0], p[1], p[2]))
                        .collect();
                    (ColliderBuilder::convex_hull(&points).unwrap(), false)
                }
                other => panic!("no peer for {other:?}"),
            };
            let builder = builder.active_collision_types(ActiveCollisionTypes::all());
            handles.push((colliders.insert(builder.build()), upright));
        }
        Self {
            pipeline: CollisionPipeline::new(),
            islands: IslandManager::new(),
            broad: BroadPhaseBvh::new(),
            narrow: NarrowPhase::new(),
            bodies: RigidBodySet::new(),
            colliders,
            handles,
        }
    }

    /// * `moved` - indices of the bodies whose pose has changed.
    fn tick(&mut self, poses: &[Pose], moved: impl Iterator<Item = usize>) -> u64 {
        let start_ns = SystemClock.monotonic_ns();
        for at in moved {
            let ((handle, upright), pose) = (&self.handles[at], &poses[at]);
            let turn =
                nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
            let rotation = if *upright {
                pose.rotation * turn
            } else {
                pose.rotation
            };
            let (t, q) = (&pose.translation.vector, rotation.as_vector());
            let mut seen = RapierPose::from_translation(Vector::new(t.x, t.y, t.z));
            seen.rotation = rapier3d_f64::math::Rotation::from_xyzw(q.x, q.y, q.z, q.w);
            if let Some(collider) = self.colliders.get_mut(*handle) {
                collider.set_position(seen);
            }
        }
        self.pipeline.step(
            0.0,
            &mut self.islands,
            &mut self.broad,
            &mut self.narrow,
            &mut self.bodies,
            &mut self.colliders,
            &(),
            &(),
        );
        SystemClock.monotonic_ns() - start_ns
    }

    fn colliding(&self) -> usize {
        let touching = |pair: &&rapier3d_f64::geometry::ContactPair| {
            pair.manifolds()
                .iter()
                .any(|m| m.points.iter().any(|p| p.dist <= 0.0))
        };
        self.narrow.contact_pairs().filter(touching).count()
    }
}

/// The parameters of a case.
#[derive(Clone, Copy, Debug)]
struct Case {
    bodies: usize,
    /// Percentage of the bodies that moves.
    moving: usize,
    /// Motion per tick, percent of a body's size.
    speed: f64,
    ticks: usize,
    rows: Rows,
}

const fn case(bodies: usize, moving: usize, speed: f64, ticks: usize, rows: Rows) -> Case {
    Case {
        bodies,
        moving,
        speed,
        ticks,
        rows,
    }
}

const CASES: [Case; 15] = [
    case(1_000, 100, 0.1, 200, Rows::Pairs),
    case(1_000, 100, 1.0, 200, Rows::Pairs),
    case(1_000, 100, 10.0, 200, Rows::Pairs),
    case(1_000, 1, 1.0, 200, Rows::Pairs),
    case(1_000, 1, 1.0, 200, Rows::Changes),
    case(1_000, 1, 1.0, 200, Rows::News),
    case(10_000, 100, 0.1, 200, Rows::Pairs),
    case(10_000, 100, 1.0, 200, Rows::Pairs),
    case(10_000, 100, 10.0, 200, Rows::Pairs),
    case(10_000, 1, 1.0, 200, Rows::Pairs),
    case(10_000, 1, 1.0, 200, Rows::Changes),
    case(10_000, 1, 1.0, 200, Rows::News),
    case(100_000, 1, 1.0, 60, Rows::Pairs),
    case(100_000, 1, 1.0, 60, Rows::Changes),
    case(100_000, 1, 1.0, 60, Rows::News),
];
/// Ticks before the measurement.
const SETTLE: usize = 20;
const SEED: u64 = 11;

fn main() {
    let number = |one: &str, name: &str| one.strip_prefix(name)?.parse::<usize>().ok();
    let case_of = |one: &str| CASES.get(number(one, "--case=")?).copied();
    let ticks_of = |one: &str| number(one, "--ticks=");
    let known = |one: &str| one == "--quick" || case_of(one).is_some() || ticks_of(one).is_some();
    let arguments = arguments(known);
    let quick = arguments.iter().any(|one| one == "--quick");
    if let Some(mut case) = arguments.iter().find_map(|one| case_of(one)) {
        let ticks = arguments.iter().find_map(|one| ticks_of(one));
        case.ticks = ticks.unwrap_or(case.ticks);
        println!("{}", run(case));
        return;
    }
    let mut csv = String::from(
        "machine,commit,compiler,seed,bodies,density_per_m3,moving_percent,speed_percent,rows,ticks,ours_median_us,\
         ours_p99_us,rapier_median_us,rapier_p99_us,ratio_median,ours_colliding,rapier_colliding,ours_contacts,\
         candidates,world_us,broad_us,widen_us,narrow_us,publish_us\n",
    );
    let from = provenance();
    for mut case in CASES {
        if quick && case.bodies > 10_000 {
            continue;
        }
        case.ticks = if quick { 40 } else { case.ticks };
        csv += &format!("{from},{}\n", run(case));
    }
    save("engine.csv", &csv);
}

/// Runs one case; returns its columns of the CSV.
fn run(case: Case) -> String {
    let Case {
        bodies,
        moving,
        speed,
        ticks,
        rows: asked,
    } = case;
    // Bodies that do not move are not sent again, so the timeout is long; `contact_rows` is large enough for all
    // contacts.
    let scene = pool(bodies, SEED).replace("timeout_ms = 500", "timeout_ms = 600000")
        + "\n[limits]\ncontact_rows = 1048576\n";
    let mut ours = Bench::new(&scene);
    // A body is about 0.75 m across.
    let mut flight = Flight::new(&ours.scene, 0.75 * speed / 100.0, SEED);
    let mut peer = Peer::new(&ours.scene);
    let (mut own_ns, mut peer_ns) = (Vec::new(), Vec::new());
    let mut stages = [0_u64; 5];
    let who: Vec<usize> = (0..bodies).step_by(100 / moving).collect();
    let all = ours.rows.clone();
    let mut rows: Vec<_> = who.iter().map(|at| all[*at]).collect();
    for tick in 0..ticks + SETTLE {
        // The first frame gives every body a pose.
        let own = if tick == 0 {
            peer.tick(&flight.poses, 0..bodies);
            ours.tick(&all, true, Budget::UNLIMITED, asked.demand())
                .wall_ns
        } else {
            flight.advance(who.iter().copied());
            for (to, at) in rows.iter_mut().zip(&who) {
                *to = row(to.body, &flight.poses[*at]);
            }
            ours.tick(&rows, moving == 100, Budget::UNLIMITED, asked.demand())
                .wall_ns
        };
        let theirs = peer.tick(&flight.poses, who.iter().copied());
        if tick >= SETTLE {
            own_ns.push(own);
            peer_ns.push(theirs);
            for (sum, ns) in stages.iter_mut().zip(&ours.out().tick.stage_ns) {
                *sum += ns;
            }
        }
    }
    let out = ours.out();
    let listed = if matches!(asked, Rows::News) {
        usize::try_from(out.contact_changes_header.listed).unwrap()
    } else {
        0
    };
    let us = |ns: u64| ns as f64 / 1e3;
    let (own, theirs) = (quantile(&mut own_ns, 0.5), quantile(&mut peer_ns, 0.5));
    let means: Vec<String> = stages
        .iter()
        .map(|sum| format!("{:.1}", us(sum / ticks as u64)))
        .collect();
    format!(
        "{SEED},{bodies},0.5,{moving},{speed},{},{ticks},{:.1},{:.1},{:.1},{:.1},{:.2},{},{},{},{},{}",
        asked.name(),
        us(own),
        us(quantile(&mut own_ns, 0.99)),
        us(theirs),
        us(quantile(&mut peer_ns, 0.99)),
        theirs as f64 / own as f64,
        out.tick.colliding,
        peer.colliding(),
        out.contacts.len().max(listed),
        out.tick.candidates,
        means.join(",")
    )
}
