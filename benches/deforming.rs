//! A deforming body of 19,880 triangles in contact with a rigid one: the cost of an update that is due immediately
//! (copy, displacement, box: part of the floor), the cost of its refit, which counts towards the budget, and which
//! verdicts remain open with a third of the work units of a full tick.
//!
//! `cargo bench --bench deforming [-- --quick]`

#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    unreachable_pub,
    missing_debug_implementations,
    dead_code,
    reason = "a bench, which uses a part of the tests' oracle"
)]

mod common;
#[path = "../tests/oracle/mod.rs"]
mod oracle;

use std::path::Path;
use std::sync::Arc;

use common::{arguments, provenance, quantile, row, save};
use oracle::meshes::{bumpy_sphere, trimesh};
use sweepd::daemon::build_shapes;
use sweepd::ids::BodyId;
use sweepd::math::{Point, Pose, Vec3};
use sweepd::scene::Scene;
use sweepd::shape::Geometry;
use sweepd::tick::{Engine, TickInput};
use sweepd::time::{Budget, Clock, SystemClock};
use sweepd::wire::{
    Demand, FrameHeader, Inbox, TickCause, Verdict, VertexFrame, VertexHeader, VertexRow,
    WIRE_VERSION, frame_flags, name_bytes, vertex_flags,
};

/// An engine with the two bodies, and the vertices that are sent.
struct Rig {
    engine: Engine,
    clock: Arc<SystemClock>,
    rest: Vec<Point>,
    rows: Vec<VertexRow>,
    version: u64,
}

/// The result of one tick.
struct Told {
    units: u64,
    verdict: Verdict,
    age: u64,
}

impl Rig {
    fn new(text: &str) -> Self {
        let scene = Scene::parse(text, "bench", Path::new(".")).unwrap();
        let shapes = build_shapes(&scene).unwrap().bodies;
        let Geometry::Mesh(mesh) = &shapes[0][0].shape.geometry else {
            unreachable!("a mesh")
        };
        let rest = mesh.vertices().to_vec();
        let clock = Arc::new(SystemClock);
        let engine = Engine::new(&scene, shapes, 1, Arc::clone(&clock) as Arc<dyn Clock>);
        Self {
            rows: vec![VertexRow::default(); rest.len()],
            rest,
            clock,
            engine: engine.unwrap(),
            version: 0,
        }
    }

    /// Deforms the mesh by a wave of amplitude at most `by_m`; its phase changes with each step.
    fn bend(&mut self, step: usize, by_m: f64) {
        let phase = 0.3 * step as f64;
        for (row, rest) in self.rows.iter_mut().zip(&self.rest) {
            let moved = rest + Vec3::from(rest.coords) * (by_m * (5.0 * rest.x + phase).sin());
            row.position = moved.coords.map(|x| x as f32).into();
        }
    }

    fn frame(&mut self, into: &mut VertexFrame) {
        self.version += 1;
        let count = u32::try_from(self.rows.len()).unwrap();
        into.header = VertexHeader {
            session: 1,
            seq: self.version,
            body: 1,
            version: self.version,
            source: name_bytes("feed"),
            count,
            total: count,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        };
        into.set_rows(&self.rows);
    }

    /// Runs a tick with new vertices, and the other body at `x`.
    fn tick(&mut self, x: f64, budget: Budget) -> Told {
        let mut inbox = Inbox::default();
        let mut vertices = VertexFrame::default();
        self.frame(&mut vertices);
        inbox.push_vertices().clone_from(&vertices);
        let frame = inbox.push();
        frame.header = FrameHeader {
            session: 1,
            seq: self.version,
            source: name_bytes("feed"),
            flags: frame_flags::FULL,
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        let other = Pose::translation(x, 0.1, 0.05);
        frame.set_transforms(&[row(1, &Pose::identity()), row(2, &other)]);
        let out = self.engine.tick(TickInput {
            inbox: &inbox,
            edits: &[],
            demand: Demand {
                changes: false,
                ..Demand::ALL
            },
            budget,
            cause: TickCause::Frame,
            cause_source: Some(0),
            woke_ns: self.clock.monotonic_ns(),
            pulse: None,
        });
        let verdict = out.pairs.first().map_or(Verdict::Apart, |row| {
            Verdict::from_code(row.verdict).unwrap()
        });
        Told {
            units: out.tick.units,
            verdict,
            age: out.tick.oldest_undecided_ticks,
        }
    }
}

/// Collects the measured values as CSV.
struct Table {
    csv: String,
    from: String,
    steps: usize,
}

impl Table {
    fn say(&mut self, what: &str, samples: &mut [u64], scale: f64) {
        let mut at = |q: f64| quantile(samples, q) as f64 / scale;
        let (median, p99, max) = (at(0.5), at(0.99), at(1.0));
        let Self { from, steps, .. } = self;
        self.csv += &format!("{from},{what},{steps},{median:.1},{p99:.1},{max:.1}\n");
    }
}

/// Measures admission and refit separately.
fn pieces(text: &str, table: &mut Table) {
    let mut rig = Rig::new(text);
    rig.tick(5.0, Budget::UNLIMITED);
    let mut world = rig.engine.world().clone();
    let slot = world.slot_of(BodyId(1)).unwrap();
    let mut frame = VertexFrame::default();
    let (mut copy, mut admit, mut refit, mut all) = (vec![], vec![], vec![], vec![]);
    for step in 0..table.steps {
        rig.bend(step, 0.01);
        let start_ns = rig.clock.monotonic_ns();
        frame.set_rows(&rig.rows);
        let copied_ns = rig.clock.monotonic_ns();
        rig.frame(&mut frame);
        let ready_ns = rig.clock.monotonic_ns();
        world.admit_vertices(&frame, rig.clock.boottime_ns());
        let admitted_ns = rig.clock.monotonic_ns();
        world.refit(slot, usize::MAX);
        let fitted_ns = rig.clock.monotonic_ns();
        assert!(!world.body(slot).unwrap().lags());
        // The first step also copies data that the cloned world shares with the engine's world; it is not counted.
        if step > 0 {
            copy.push(copied_ns - start_ns);
            admit.push(admitted_ns - ready_ns);
            refit.push(fitted_ns - admitted_ns);
            all.push((copied_ns - start_ns) + (fitted_ns - ready_ns));
        }
    }
    table.say("copy out of the transport us", &mut copy, 1e3);
    table.say("admission with displacement and box us", &mut admit, 1e3);
    table.say("refit us", &mut refit, 1e3);
    table.say("together us", &mut all, 1e3);
}

/// A pair that enters and leaves contact: the work of full ticks, and which verdicts remain open with a third of it.
fn a_third(text: &str, table: &mut Table) {
    let course = |step: usize| 1.88 + 0.1 * (0.05 * step as f64).sin();
    let (mut whole, mut third) = (Rig::new(text), Rig::new(text));
    let (mut units, mut ages, mut open, mut wrong) = (vec![], vec![], 0_u64, 0_u64);
    for step in 0..table.steps {
        whole.bend(step, 0.01);
        let truth = whole.tick(course(step), Budget::UNLIMITED);
        units.push(truth.units);
        third.bend(step, 0.01);
        let told = third.tick(course(step), Budget::units(truth.units / 3));
        ages.push(told.age);
        if told.verdict == Verdict::Possible {
            open += 1;
        } else {
            wrong += u64::from(told.verdict != truth.verdict);
        }
    }
    let per_mille = 1000 * open / table.steps as u64;
    table.say("units of a tick without limit", &mut units, 1.0);
    table.say("a third of them: oldest undecided ticks", &mut ages, 1.0);
    table.say("a third of them: open per mille", &mut [per_mille], 1.0);
    table.say("a third of them: wrong verdicts", &mut [wrong], 1.0);
}

fn main() {
    let quick = !arguments(|one| one == "--quick").is_empty();
    // 19,880 triangles, diameter about 2 m.
    let mesh = trimesh(&bumpy_sphere(71, 142, 0.06), None);
    let text = format!(
        "[[source]]\nname = \"feed\"\ntimeout_ms = 1000000\n\
         [[body]]\nname = \"soft\"\nid = 1\ndeforms = true\nshape = {mesh}\n\
         [[body]]\nname = \"rigid\"\nid = 2\nshape = {mesh}\n"
    );
    let mut table = Table {
        csv: String::from("machine,commit,compiler,what,steps,median,p99,max\n"),
        from: provenance(),
        steps: if quick { 100 } else { 1000 },
    };
    pieces(&text, &mut table);
    a_third(&text, &mut table);
    save("deforming.csv", &table.csv);
}
