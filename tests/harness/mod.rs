//! Runs an engine without transports: in, the text of a scene and frames of a built-in motion; out, the outbox.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::panic,
    reason = "shared by tests that each use a part of it"
)]

use std::path::Path;
use std::sync::Arc;

use sweepd::builtin::{Motion, Pattern, Random};
use sweepd::daemon::build_shapes;
use sweepd::math::{Interval, Pose, relative};
use sweepd::narrow::exact::{Warm, convex_gap, half_space_gap};
use sweepd::scene::Scene;
use sweepd::shape::Geometry;
use sweepd::tick::{Engine, TickInput};
use sweepd::time::{Budget, Clock, ManualClock};
use sweepd::wire::{
    Demand, FrameHeader, Inbox, Outbox, TickCause, TransformRow, VertexHeader, WIRE_VERSION,
    frame_flags, name_bytes, vertex_flags,
};
use sweepd::world::{Body, Parts};

/// Nanoseconds between two frames.
pub const FRAME_NS: u64 = 10_000_000;

/// An engine, the motions of its bodies, and the last outbox.
pub struct Drive {
    engine: Engine,
    clock: Arc<ManualClock>,
    inbox: Inbox,
    rows: Vec<TransformRow>,
    motions: Vec<Motion>,
    source: String,
    seq: u64,
    out: Outbox,
    /// Deforming bodies, with their vertices at rest.
    bending: Vec<(u64, Vec<[f32; 3]>)>,
}

impl Drive {
    /// An engine for the text of a scene; its moving bodies follow `pattern`.
    pub fn new(scene: &str, pattern: Pattern, seed: u64) -> Self {
        let scene = Scene::parse(scene, "scene.toml", Path::new(".")).unwrap();
        Self::of(&scene, pattern, seed)
    }

    /// As [`Drive::new`], for a parsed scene.
    pub fn of(scene: &Scene, pattern: Pattern, seed: u64) -> Self {
        let clock = Arc::new(ManualClock::new(1_000_000_000));
        let shapes = build_shapes(scene).unwrap();
        let bending = bending(scene, &shapes.bodies);
        let engine = Engine::new(
            scene,
            shapes.bodies,
            7,
            Arc::clone(&clock) as Arc<dyn Clock>,
        )
        .unwrap();
        let mut random = Random::new(seed);
        let moving = scene
            .bodies
            .iter()
            .filter(|body| body.moves && body.source == Some(0));
        let (rows, motions) = moving
            .map(|body| {
                let row = TransformRow {
                    body: body.id.0,
                    ..TransformRow::default()
                };
                (row, Motion::new(body.pose, pattern, &mut random))
            })
            .unzip();
        let source = scene
            .sources
            .first()
            .map(|s| s.name.clone())
            .unwrap_or_default();
        let (inbox, out) = (Inbox::default(), Outbox::default());
        Self {
            engine,
            clock,
            inbox,
            rows,
            motions,
            source,
            seq: 0,
            out,
            bending,
        }
    }

    /// Moves all bodies to their poses in frame `tick` and runs a tick.
    pub fn step(&mut self, tick: u64, budget: Budget, demand: Demand) -> &Outbox {
        self.place(tick);
        self.send(budget, demand)
    }

    /// As [`Drive::step`], with `armed` set while the engine runs and without a copy of its outbox.
    pub fn step_counted(
        &mut self,
        tick: u64,
        budget: Budget,
        demand: Demand,
        armed: &'static std::thread::LocalKey<std::cell::Cell<bool>>,
    ) {
        self.place(tick);
        self.fill();
        let input = TickInput {
            inbox: &self.inbox,
            edits: &[],
            demand,
            budget,
            cause: TickCause::Frame,
            cause_source: None,
            woke_ns: self.clock.monotonic_ns(),
            pulse: None,
        };
        armed.with(|armed| armed.set(true));
        self.engine.tick(input);
        armed.with(|armed| armed.set(false));
    }

    /// Sets the poses of all bodies to those of frame `tick`.
    pub fn place(&mut self, tick: u64) {
        #[allow(clippy::cast_precision_loss, reason = "small counts")]
        let time_s = tick as f64 * 0.01;
        for at in 0..self.rows.len() {
            let pose = self.motions[at].pose_at(time_s);
            self.set(at, &pose);
        }
    }

    /// Sets the pose of the `at`-th moving body in the next frame.
    pub fn set(&mut self, at: usize, pose: &Pose) {
        let q = pose.rotation.as_vector();
        self.rows[at].position = pose.translation.vector.into();
        self.rows[at].orientation = [q.x, q.y, q.z, q.w];
    }

    /// Sends the current rows as a frame and runs a tick.
    pub fn send(&mut self, budget: Budget, demand: Demand) -> &Outbox {
        self.fill();
        self.tick(budget, demand, TickCause::Frame)
    }

    /// Fills the inbox with a full frame of the current rows, and with the vertices.
    fn fill(&mut self) {
        self.clock.advance(FRAME_NS);
        self.seq += 1;
        self.inbox.clear();
        let frame = self.inbox.push();
        frame.header = FrameHeader {
            session: 11,
            epoch: 1,
            seq: self.seq,
            source: name_bytes(&self.source),
            flags: frame_flags::FULL,
            schema: WIRE_VERSION,
            stamp_ns: self.seq * FRAME_NS,
            ..FrameHeader::default()
        };
        frame.received_ns = self.clock.boottime_ns();
        frame.set_transforms(&self.rows);
        self.bend();
    }

    /// The vertices of each deforming body as last sent, in the order of the bodies: at rest plus a travelling wave.
    pub fn bent(&self) -> Vec<Vec<[f32; 3]>> {
        #[allow(clippy::cast_precision_loss, reason = "small counts")]
        let phase = (self.seq % 150) as f32 * (std::f32::consts::TAU / 150.0);
        let wave = |&[x, y, z]: &[f32; 3]| [x, y, z + 0.05 * (5.0 * x + phase).sin()];
        let all = self.bending.iter();
        all.map(|(_, rest)| rest.iter().map(wave).collect())
            .collect()
    }

    fn bend(&mut self) {
        let bent = self.bent();
        for ((body, _), rows) in self.bending.iter().zip(&bent) {
            let frame = self.inbox.push_vertices();
            let count = u32::try_from(rows.len()).unwrap();
            frame.header = VertexHeader {
                session: 11,
                epoch: 1,
                seq: self.seq,
                body: *body,
                version: self.seq,
                source: name_bytes(&self.source),
                count,
                total: count,
                flags: vertex_flags::FULL,
                schema: WIRE_VERSION,
                ..VertexHeader::default()
            };
            frame.rows.extend_from_slice(rows);
        }
    }

    /// Runs a tick without a frame.
    pub fn idle(&mut self, budget: Budget, demand: Demand) -> &Outbox {
        self.clock.advance(FRAME_NS);
        self.inbox.clear();
        self.tick(budget, demand, TickCause::Heartbeat)
    }

    fn tick(&mut self, budget: Budget, demand: Demand, cause: TickCause) -> &Outbox {
        let input = TickInput {
            inbox: &self.inbox,
            edits: &[],
            demand,
            budget,
            cause,
            cause_source: None,
            woke_ns: self.clock.monotonic_ns(),
            pulse: None,
        };
        self.out.clone_from(self.engine.tick(input));
        &self.out
    }

    /// The last outbox.
    pub fn out(&self) -> &Outbox {
        &self.out
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The clock.
    pub fn clock(&self) -> &ManualClock {
        &self.clock
    }

    /// The rows of the next frame.
    pub fn rows_mut(&mut self) -> &mut Vec<TransformRow> {
        &mut self.rows
    }
}

/// Deforming bodies, with their vertices in the scene.
fn bending(scene: &Scene, shapes: &[Parts]) -> Vec<(u64, Vec<[f32; 3]>)> {
    let bodies = scene.bodies.iter().zip(shapes);
    let bent = bodies.filter(|(body, _)| body.deforms);
    bent.map(|(body, placed)| {
        let Geometry::Mesh(mesh) = &placed[0].shape.geometry else {
            panic!("a mesh")
        };
        #[allow(clippy::cast_possible_truncation, reason = "they are f32")]
        let rows = mesh
            .vertices()
            .iter()
            .map(|v| [v.x as f32, v.y as f32, v.z as f32]);
        (body.id.0, rows.collect())
    })
    .collect()
}

/// The gap of two bodies that consist of one convex shape or half-space each, by a cold exact query.
pub fn exact_gap(a: &Body, b: &Body) -> Interval {
    let place = |body: &Body| body.pose * body.shapes[0].pose;
    let (one, other) = (&a.shapes[0].shape.geometry, &b.shapes[0].shape.geometry);
    let (pose_a, pose_b) = (place(a), place(b));
    match (one, other) {
        (Geometry::Convex(x), Geometry::Convex(y)) => {
            convex_gap(x, y, &relative(&pose_a, &pose_b), &mut Warm::default()).gap
        }
        (Geometry::HalfSpace { normal, offset }, Geometry::Convex(y)) => {
            half_space_gap(normal, *offset, y, &relative(&pose_a, &pose_b)).gap
        }
        (Geometry::Convex(x), Geometry::HalfSpace { normal, offset }) => {
            half_space_gap(normal, *offset, x, &relative(&pose_b, &pose_a)).gap
        }
        _ => panic!("one convex shape a body"),
    }
}
