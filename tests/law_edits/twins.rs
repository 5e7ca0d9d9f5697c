//! Three engines that get the same input and different budgets.

use std::path::Path;
use std::sync::Arc;

use sweepd::math::Pose;
use sweepd::scene::Scene;
use sweepd::tick::{EditBatch, Engine, TickInput};
use sweepd::time::{Budget, Clock, ManualClock};
use sweepd::wire::{
    Demand, FrameHeader, Inbox, TickCause, TransformRow, WIRE_VERSION, frame_flags, name_bytes,
};
use sweepd::world::Edit;

use crate::oracle::rng::Rng;

/// Their budgets: unlimited, a random limit, none.
pub const ENGINES: usize = 3;

/// Broad phases as scene text; empty: the plan chooses.
const METHODS: [&str; 4] = [
    "",
    "[run]\nbroad_phase = \"order\"\n",
    "[run]\nbroad_phase = \"sap\"\n",
    "[run]\nbroad_phase = \"hgrid\"\n",
];

pub struct Twins {
    pub engines: [Engine; ENGINES],
    clock: Arc<ManualClock>,
    inbox: Inbox,
    seq: u64,
    epoch: u64,
    sent: Option<Sent>,
}

/// A frame: whether it begins an epoch, and its rows; a row without a pose is sent with NaN.
pub struct Sent {
    pub is_anew: bool,
    pub rows: Vec<(u64, Option<Pose>)>,
}

impl Twins {
    /// The first engine has the broad phase of the plan, the others a random one.
    pub fn new(rng: &mut Rng) -> Self {
        let clock = Arc::new(ManualClock::new(1_000_000_000));
        let engine = |at: usize| {
            let method = METHODS[if at == 0 { 0 } else { rng.below(METHODS.len()) }];
            let text = format!(
                "frame_id = \"world\"\n{method}[[source]]\nname = \"feed\"\ntimeout_ms = 500\n"
            );
            let scene = Scene::parse(&text, "scene.toml", Path::new(".")).unwrap();
            let clock = Arc::clone(&clock) as Arc<dyn Clock>;
            Engine::new(&scene, Vec::new(), 1, clock).unwrap()
        };
        Self {
            engines: std::array::from_fn(engine),
            clock,
            inbox: Inbox::default(),
            seq: 0,
            epoch: 1,
            sent: None,
        }
    }

    /// Advances the clock and drops the last frame.
    pub fn wait(&mut self, ns: u64) -> u64 {
        self.clock.advance(ns);
        self.inbox.clear();
        self.sent = None;
        self.clock.boottime_ns()
    }

    /// Sets the frame of the next tick.
    pub fn send(&mut self, sent: Sent, full: bool) {
        self.epoch += u64::from(sent.is_anew);
        self.seq += 1;
        let frame = self.inbox.push();
        frame.header = FrameHeader {
            session: 11,
            epoch: self.epoch,
            seq: self.seq,
            source: name_bytes("feed"),
            flags: if full {
                frame_flags::FULL
            } else {
                frame_flags::PARTIAL
            },
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        frame.received_ns = self.clock.boottime_ns();
        let rows: Vec<TransformRow> = sent.rows.iter().map(row).collect();
        frame.set_transforms(&rows);
        self.sent = Some(sent);
    }

    /// Takes the frame of the last tick.
    pub fn take_sent(&mut self) -> Option<Sent> {
        self.sent.take()
    }

    /// Runs a tick of each engine, with requests of edits.
    ///
    /// * returns - whether each request was applied.
    pub fn tick(&mut self, requests: &[Vec<Edit>], rng: &mut Rng) -> Vec<bool> {
        let batches: Vec<EditBatch> = (1..)
            .zip(requests)
            .map(|(token, edits)| EditBatch {
                token,
                edits: edits.clone(),
                validate: false,
                warnings: Vec::new(),
            })
            .collect();
        let mut taken: Option<Vec<bool>> = None;
        let mut whole = 0;
        for (at, engine) in self.engines.iter_mut().enumerate() {
            let budget = match at {
                0 => Budget::UNLIMITED,
                1 => Budget::units(rng.bits() % (whole + 1)),
                _ => Budget::units(0),
            };
            let out = engine.tick(TickInput {
                inbox: &self.inbox,
                edits: &batches,
                demand: Demand::ALL,
                budget,
                cause: TickCause::Frame,
                cause_source: None,
                woke_ns: self.clock.monotonic_ns(),
                pulse: None,
            });
            whole = out.tick.units;
            engine.validate().unwrap();
            let mut own = vec![false; requests.len()];
            for outcome in engine.outcomes() {
                own[outcome.token as usize - 1] = outcome.result.is_ok();
            }
            if let Some(taken) = &taken {
                assert_eq!(*taken, own, "engines differ in what they take");
            }
            taken = Some(own);
        }
        taken.unwrap()
    }
}

fn row((id, pose): &(u64, Option<Pose>)) -> TransformRow {
    let mut row = TransformRow {
        body: *id,
        position: [f64::NAN; 3],
        ..TransformRow::default()
    };
    if let Some(pose) = pose {
        let q = pose.rotation.as_vector();
        row.position = pose.translation.vector.into();
        row.orientation = [q.x, q.y, q.z, q.w];
    }
    row
}
