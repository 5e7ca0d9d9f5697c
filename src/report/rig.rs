//! An engine that is fed directly, without transport; both reports use it.
//!
//! In: a checked scene with its shapes, and poses for each tick. Out: the engine's outbox, and the time of the tick.

use std::sync::Arc;

use crate::error::Result;
use crate::math::{Pose, f32_near};
use crate::scene::Scene;
use crate::shape::Geometry;
use crate::tick::{Engine, TickInput};
use crate::time::{Budget, Clock};
use crate::wire::{
    Demand, FrameHeader, Inbox, Outbox, TickCause, TransformRow, VertexHeader, WIRE_VERSION,
    frame_flags, name_bytes, vertex_flags,
};
use crate::world::Parts;

/// The session of all frames of a report.
const SESSION: u64 = 1;
/// The requested outputs: pairs with their bounds. Contacts would be work that no figure shows.
const DEMAND: Demand = Demand {
    pairs: true,
    contacts: false,
    regions: false,
    bodies: false,
    body_verdicts: false,
    changes: false,
    contact_changes: false,
    changes_anew: false,
};

/// An engine and its input.
pub struct Rig {
    engine: Engine,
    clock: Arc<dyn Clock>,
    inbox: Inbox,
    names: Vec<String>,
    /// Source, body, and the vertices at rest of each body that deforms, which are sent once.
    vertices: Vec<(usize, u64, Vec<[f32; 3]>)>,
    seq: u64,
}

impl std::fmt::Debug for Rig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rig")
            .field("ticks", &self.seq)
            .finish_non_exhaustive()
    }
}

impl Rig {
    /// An engine for a scene and its built shapes, in the order of the scene's bodies.
    ///
    /// # Errors
    /// `Error::Scene` if the scene exceeds its limits.
    pub fn new(scene: &Scene, shapes: &[Parts], clock: Arc<dyn Clock>) -> Result<Self> {
        // With a limit of rows a missing row would not mean that its pair is apart.
        let mut whole = scene.clone();
        whole.config.limits.pair_rows = usize::MAX;
        let engine = Engine::new(&whole, shapes.to_vec(), 1, Arc::clone(&clock))?;
        let deforming = scene.bodies.iter().zip(shapes).filter(|(b, _)| b.deforms);
        let vertices = deforming.filter_map(|(body, placed)| {
            let Geometry::Mesh(mesh) = &placed.first()?.shape.geometry else {
                return None;
            };
            let rows = mesh.vertices().iter();
            let rows = rows.map(|v| [f32_near(v.x), f32_near(v.y), f32_near(v.z)]);
            Some((body.source?, body.id.0, rows.collect()))
        });
        Ok(Self {
            vertices: vertices.collect(),
            names: scene.sources.iter().map(|s| s.name.clone()).collect(),
            engine,
            clock,
            inbox: Inbox::default(),
            seq: 0,
        })
    }

    /// Runs one tick with a frame of each source, and then all work that is left within its budget.
    ///
    /// * `frames` - rows of each source, by its index.
    /// * returns - time from wake-up until no work was left, nanoseconds of the engine's clock.
    pub fn tick(&mut self, frames: &[Vec<TransformRow>], budget: Budget) -> u64 {
        self.seq += 1;
        self.inbox.clear();
        let now_ns = self.clock.boottime_ns();
        for (name, rows) in self.names.iter().zip(frames) {
            let frame = self.inbox.push();
            frame.header = FrameHeader {
                session: SESSION,
                epoch: 1,
                seq: self.seq,
                source: name_bytes(name),
                flags: frame_flags::FULL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            };
            frame.received_ns = now_ns;
            frame.set_transforms(rows);
        }
        if self.seq == 1 {
            self.send_vertices(now_ns);
        }
        let woke_ns = self.clock.monotonic_ns();
        self.engine.tick(TickInput {
            inbox: &self.inbox,
            edits: &[],
            demand: DEMAND,
            budget,
            cause: TickCause::Frame,
            cause_source: (!self.names.is_empty()).then_some(0),
            woke_ns,
            pulse: None,
        });
        while self.engine.work_on(u64::MAX) {}
        self.clock.monotonic_ns() - woke_ns
    }

    /// The outbox of the last tick.
    #[must_use]
    pub fn out(&self) -> &Outbox {
        self.engine.outbox()
    }

    /// The engine.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Sends the vertices of bodies that deform, which are unknown until then.
    fn send_vertices(&mut self, now_ns: u64) {
        for (source, body, rows) in &self.vertices {
            let count = u32::try_from(rows.len()).unwrap_or(u32::MAX);
            let frame = self.inbox.push_vertices();
            frame.header = VertexHeader {
                session: SESSION,
                epoch: 1,
                seq: self.seq,
                body: *body,
                version: 1,
                source: name_bytes(&self.names[*source]),
                count,
                total: count,
                flags: vertex_flags::FULL,
                schema: WIRE_VERSION,
                ..VertexHeader::default()
            };
            frame.received_ns = now_ns;
            frame.rows.extend_from_slice(rows);
        }
    }
}

/// A row of a frame.
#[must_use]
pub fn row(body: u64, pose: &Pose) -> TransformRow {
    let q = pose.rotation.as_vector();
    TransformRow {
        body,
        position: pose.translation.vector.into(),
        orientation: [q.x, q.y, q.z, q.w],
        ..TransformRow::default()
    }
}
