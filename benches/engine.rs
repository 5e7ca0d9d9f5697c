//! A whole engine tick against rapier3d-f64's `CollisionPipeline`, same convex bodies, same poses, contacts asked of
//! both, in one run, tick by tick in turn. Timed on both sides: taking the poses in, broad phase, narrow phase, contacts;
//! on ours also the filled outbox with all rows.
//!
//! `cargo bench --bench engine [-- --quick]`

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::panic,
    clippy::cast_sign_loss,
    clippy::too_many_lines,
    reason = "a bench"
)]

mod common;

use common::{Bench, Flight, provenance, quantile, row, save};
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

/// What rapier's pipeline yields too: pairs and contacts.
const ASKED: Demand = Demand {
    pairs: true,
    contacts: true,
    bodies: false,
    body_verdicts: false,
};

/// Rapier's side of the same scene.
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
            // Cylinder and cone stand along y there, along z here.
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

    fn tick(&mut self, poses: &[Pose]) -> u64 {
        let start_ns = SystemClock.monotonic_ns();
        for ((handle, upright), pose) in self.handles.iter().zip(poses) {
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

fn main() {
    let quick = std::env::args().any(|arg| arg == "--quick");
    let seed = 11;
    let mut csv = String::from(
        "machine,commit,compiler,seed,bodies,density_per_m3,speed_percent,ticks,ours_median_us,ours_p99_us,\
         rapier_median_us,rapier_p99_us,ratio_median,ours_colliding,rapier_colliding,ours_contacts,candidates,\
         world_us,broad_us,widen_us,narrow_us,publish_us\n",
    );
    let from = provenance();
    for bodies in [1_000, 10_000] {
        for percent in [0.1, 1.0, 10.0] {
            // A body is about 0.75 m across.
            let ticks = if quick { 40 } else { 200 };
            let mut ours = Bench::new(&pool(bodies, seed));
            let mut flight = Flight::new(&ours.scene, 0.75 * percent / 100.0, seed);
            let mut peer = Peer::new(&ours.scene);
            let (mut own_ns, mut peer_ns) = (Vec::new(), Vec::new());
            let mut stages = [0_u64; 5];
            let mut rows = ours.rows.clone();
            for tick in 0..ticks + 20 {
                flight.advance();
                for (to, pose) in rows.iter_mut().zip(&flight.poses) {
                    *to = row(to.body, pose);
                }
                let own = ours.tick(&rows, true, Budget::UNLIMITED, ASKED).wall_ns;
                let theirs = peer.tick(&flight.poses);
                if tick >= 20 {
                    own_ns.push(own);
                    peer_ns.push(theirs);
                    for (sum, ns) in stages.iter_mut().zip(&ours.out().tick.stage_ns) {
                        *sum += ns;
                    }
                }
            }
            let out = ours.out();
            let us = |ns: u64| ns as f64 / 1e3;
            let (own, theirs) = (quantile(&mut own_ns, 0.5), quantile(&mut peer_ns, 0.5));
            let means: Vec<String> = stages
                .iter()
                .map(|sum| format!("{:.1}", us(sum / ticks as u64)))
                .collect();
            csv += &format!(
                "{from},{seed},{bodies},0.5,{percent},{ticks},{:.1},{:.1},{:.1},{:.1},{:.2},{},{},{},{},{}\n",
                us(own),
                us(quantile(&mut own_ns, 0.99)),
                us(theirs),
                us(quantile(&mut peer_ns, 0.99)),
                theirs as f64 / own as f64,
                out.tick.colliding,
                peer.colliding(),
                out.contacts.len(),
                out.tick.candidates,
                means.join(",")
            );
        }
    }
    save("engine.csv", &csv);
}
