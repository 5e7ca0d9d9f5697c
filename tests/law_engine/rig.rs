//! A scene as text, an engine, and functions that move its bodies.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use sweepd::daemon::build_shapes;
use sweepd::math::Pose;
use sweepd::scene::{PairAction, PairRule, Scene};
use sweepd::tick::{EditBatch, Engine, TickInput};
use sweepd::time::{Budget, Clock, ManualClock};
use sweepd::wire::{
    Demand, Event, FrameHeader, Inbox, Outbox, PairRow, Reason, RejectReason, State, TickCause,
    TickRow, TransformRow, Verdict, VertexFrame, WIRE_VERSION, frame_flags, name_bytes, pair_flags,
};
use sweepd::world::Edit;

/// Time between two frames.
pub(crate) const FRAME_NS: u64 = 10_000_000;
pub(crate) const ALL: Budget = Budget::UNLIMITED;
pub(crate) const NONE: Budget = Budget {
    time_ns: None,
    units: Some(0),
};

const PAIRS_APART_M: f64 = 10.0;

/// The text of a scene: `head`, which precedes the source, and its bodies.
pub(crate) fn scene(head: &str, bodies: &[String]) -> String {
    let mut text =
        format!("frame_id = \"world\"\n{head}\n[[source]]\nname = \"feed\"\ntimeout_ms = 500\n");
    for body in bodies {
        let _ = write!(text, "\n[[body]]\n{body}");
    }
    text
}

/// A moving body at `at`, with `shape` as an inline table.
pub(crate) fn body(id: u64, at: [f64; 3], shape: &str, more: &str) -> String {
    format!("name = \"b{id}\"\nid = {id}\nmoves = true\nposition = {at:?}\nshape = {shape}\n{more}")
}

/// A ball of radius 1 m at `x` on the x axis.
pub(crate) fn ball(id: u64, x: f64, more: &str) -> String {
    body(
        id,
        [x, 0.0, 0.0],
        "{ type = \"sphere\", radius = 1.0 }",
        more,
    )
}

/// `pairs` pairs of balls, far from each other; the two of a pair are at the same position: b1 and b2, b3 and b4, ...
pub(crate) fn ball_pairs(pairs: u64) -> Rig {
    let balls: Vec<String> = (1..=2 * pairs)
        .map(|id| ball(id, ((id - 1) / 2) as f64 * PAIRS_APART_M, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &balls));
    rig.checked = false;
    rig
}

/// Moves the second ball of each pair to this position relative to the first.
pub(crate) fn put_pairs(rig: &mut Rig, pairs: u64, [x, y]: [f64; 2]) {
    for pair in 0..pairs {
        let at = Pose::translation(pair as f64 * PAIRS_APART_M + x, y, 0.0);
        rig.place(2 * pair + 2, &at);
    }
}

pub(crate) fn rule(action: PairAction, a: &str, b: &str, report_within_m: Option<f64>) -> Edit {
    Edit::Rule(PairRule {
        action,
        a: a.to_owned(),
        b: b.to_owned(),
        reason: "test".to_owned(),
        report_within_m,
    })
}

pub(crate) struct Rig {
    pub(crate) engine: Engine,
    pub(crate) clock: Arc<ManualClock>,
    pub(crate) rows: Vec<TransformRow>,
    pub(crate) demand: Demand,
    /// Source of the frames.
    pub(crate) source: &'static str,
    pub(crate) session: u64,
    pub(crate) epoch: u64,
    /// Whether the next frames have no timestamp of the sender.
    pub(crate) unstamped: bool,
    /// Sessions whose client has disconnected, reported with the next frame.
    pub(crate) ended: Vec<u64>,
    pub(crate) flags: u32,
    /// Linear and angular velocity of each row; empty: none are sent.
    pub(crate) velocities: Vec<[f64; 6]>,
    /// Vertices sent with the next frame.
    pub(crate) vertices: Vec<VertexFrame>,
    pub(crate) out: Outbox,
    /// Deadline of the next frames; 0: none.
    pub(crate) deadline_ns: u64,
    pub(crate) time_left_ns: u64,
    /// Scene revision that the next frames wait for.
    pub(crate) scene_rev: u64,
    /// Time from a frame's receipt to its tick.
    pub(crate) waited_ns: u64,
    /// Time from a tick's wake-up to the tick.
    pub(crate) woken_ns: u64,
    /// Announcements sent during the last tick.
    pub(crate) pulses: Vec<TickRow>,
    /// Whether every structure is validated after each tick.
    pub(crate) checked: bool,
    pub(crate) seq: u64,
    inbox: Inbox,
}

impl Rig {
    pub(crate) fn new(text: &str) -> Self {
        Self::of(&Scene::parse(text, "scene.toml", Path::new(".")).unwrap())
    }

    pub(crate) fn of(scene: &Scene) -> Self {
        let clock = Arc::new(ManualClock::new(1_000_000_000));
        let shapes = build_shapes(scene).unwrap().bodies;
        let engine = Engine::new(scene, shapes, 7, Arc::clone(&clock) as Arc<dyn Clock>).unwrap();
        let moving = scene
            .bodies
            .iter()
            .filter(|b| b.moves && b.attached_to.is_none());
        let rows = moving.map(|b| row(b.id.0, &b.pose)).collect();
        Self {
            engine,
            clock,
            rows,
            demand: Demand::ALL,
            source: "feed",
            session: 11,
            epoch: 1,
            unstamped: false,
            ended: Vec::new(),
            flags: frame_flags::FULL,
            velocities: Vec::new(),
            vertices: Vec::new(),
            out: Outbox::default(),
            deadline_ns: 0,
            time_left_ns: 0,
            scene_rev: 0,
            waited_ns: 0,
            woken_ns: 0,
            pulses: Vec::new(),
            checked: true,
            seq: 0,
            inbox: Inbox::default(),
        }
    }

    /// The row of a body in the next frames.
    pub(crate) fn row(&mut self, id: u64) -> &mut TransformRow {
        self.rows.iter_mut().find(|row| row.body == id).unwrap()
    }

    pub(crate) fn place(&mut self, id: u64, pose: &Pose) {
        *self.row(id) = row(id, pose);
    }

    pub(crate) fn move_x(&mut self, id: u64, x: f64) {
        self.row(id).position[0] = x;
    }

    /// Sends a frame with the current rows, and runs a tick.
    pub(crate) fn send(&mut self, budget: Budget) -> &Outbox {
        self.frame();
        self.tick(budget, &[], TickCause::Frame)
    }

    /// Sends several frames, with rows set by `set`, and runs one tick.
    #[allow(dead_code, reason = "of the tests that share this rig one sends so")]
    pub(crate) fn send_several(
        &mut self,
        frames: usize,
        mut set: impl FnMut(usize, &mut Self),
        budget: Budget,
    ) -> &Outbox {
        let mut all = Inbox::default();
        for at in 0..frames {
            set(at, self);
            self.frame();
            all.push().clone_from(&self.inbox.frames()[0]);
        }
        self.inbox = all;
        self.tick(budget, &[], TickCause::Frame)
    }

    /// Runs a tick without a frame, `after_ns` later.
    pub(crate) fn idle(&mut self, after_ns: u64, budget: Budget) -> &Outbox {
        self.clock.advance(after_ns);
        self.inbox.clear();
        self.tick(budget, &[], TickCause::Heartbeat)
    }

    /// Runs a tick with vertices and without a frame, `after_ns` later.
    #[allow(dead_code, reason = "of the tests that share this rig one sends so")]
    pub(crate) fn idle_with_vertices(&mut self, after_ns: u64, budget: Budget) -> &Outbox {
        self.clock.advance(after_ns);
        self.inbox.clear();
        self.take_vertices();
        self.tick(budget, &[], TickCause::Heartbeat)
    }

    /// The number of rejections for a reason in this boot.
    #[allow(dead_code, reason = "as above")]
    pub(crate) fn rejects(&self, reason: RejectReason) -> u64 {
        self.out.tick.rejects[usize::from(reason.code())]
    }

    /// Runs a tick with edits and without a frame.
    pub(crate) fn edit(&mut self, edits: Vec<Edit>, budget: Budget) -> &Outbox {
        self.clock.advance(FRAME_NS);
        self.inbox.clear();
        self.tick_with(edits, budget)
    }

    /// Runs a tick with edits and a frame with the current rows.
    #[allow(dead_code, reason = "of the tests that share this rig one sends so")]
    pub(crate) fn send_with(&mut self, edits: Vec<Edit>, budget: Budget) -> &Outbox {
        self.frame();
        self.tick_with(edits, budget)
    }

    fn tick_with(&mut self, edits: Vec<Edit>, budget: Budget) -> &Outbox {
        let batch = EditBatch {
            token: 1,
            edits,
            validate: false,
            warnings: Vec::new(),
        };
        self.tick(budget, &[batch], TickCause::Edit);
        for outcome in self.engine.outcomes() {
            outcome.result.as_ref().unwrap();
        }
        &self.out
    }

    fn frame(&mut self) {
        self.clock.advance(FRAME_NS);
        self.seq += 1;
        self.inbox.clear();
        let frame = self.inbox.push();
        frame.header = FrameHeader {
            session: self.session,
            epoch: self.epoch,
            seq: self.seq,
            source: name_bytes(self.source),
            flags: self.flags,
            schema: WIRE_VERSION,
            stamp_ns: if self.unstamped {
                0
            } else {
                self.seq * FRAME_NS
            },
            deadline_ns: self.deadline_ns,
            time_left_ns: self.time_left_ns,
            scene_rev: self.scene_rev,
            ..FrameHeader::default()
        };
        frame.received_ns = self.clock.boottime_ns();
        frame.set_transforms(&self.rows);
        frame.velocities.clone_from(&self.velocities);
        self.take_vertices();
        for session in self.ended.drain(..) {
            self.inbox.end_session(session);
        }
        self.clock.advance(self.waited_ns);
    }

    fn take_vertices(&mut self) {
        for vertices in self.vertices.drain(..) {
            self.inbox.push_vertices().clone_from(&vertices);
        }
    }

    fn tick(&mut self, budget: Budget, edits: &[EditBatch], cause: TickCause) -> &Outbox {
        self.pulses.clear();
        let mut pulse = |row: &TickRow| self.pulses.push(*row);
        let woke_ns = self.clock.monotonic_ns();
        self.clock.advance(self.woken_ns);
        let input = TickInput {
            inbox: &self.inbox,
            edits,
            demand: self.demand,
            budget,
            cause,
            cause_source: None,
            woke_ns,
            pulse: Some(&mut pulse),
        };
        self.out.clone_from(self.engine.tick(input));
        if self.checked {
            self.engine.validate().unwrap();
            self.check_widest();
        }
        &self.out
    }

    /// The engine maintains the widest interval from tick to tick; this compares it with the maximum over all rows.
    fn check_widest(&self) {
        if !self.demand.pairs || self.out.pairs_header.truncated > 0 {
            return;
        }
        // A row of a pair that is apart counts only if it has a swept flag; others are there for their event.
        let counts = |row: &&PairRow| {
            let way = pair_flags::SWEPT_HIT | pair_flags::SWEPT_OPEN;
            row.verdict > Verdict::Apart.code() || row.flags & way != 0
        };
        let rows = self.out.pairs.iter().filter(counts);
        let widest_m = rows
            .map(|row| row.gap_max_m - row.gap_min_m)
            .fold(0.0, f64::max);
        assert_eq!(self.out.tick.widest_m, widest_m, "{:?}", self.out.pairs);
    }

    pub(crate) fn pair(&self, a: u64, b: u64) -> Option<&PairRow> {
        let mut rows = self.out.pairs.iter();
        rows.find(|row| (row.body_a, row.body_b) == (a, b))
    }

    /// The published verdict of a pair. Apart if there is no row, or only the last row of a pair that is no longer a
    /// candidate.
    pub(crate) fn verdict(&self, a: u64, b: u64) -> Verdict {
        let row = self
            .pair(a, b)
            .filter(|row| row.flags & pair_flags::GONE == 0);
        row.map_or(Verdict::Apart, |row| {
            Verdict::from_code(row.verdict).unwrap()
        })
    }

    pub(crate) fn state(&self) -> State {
        State::from_code(self.out.tick.header.state).unwrap()
    }

    pub(crate) fn because(&self, reason: Reason) -> bool {
        self.out.tick.reasons & reason.bit() != 0
    }

    pub(crate) fn ticks(&self) -> u64 {
        self.engine.ticks()
    }
}

pub(crate) fn has(row: &PairRow, event: Event) -> bool {
    row.events & event.bit() != 0
}

pub(crate) fn row(id: u64, pose: &Pose) -> TransformRow {
    let q = pose.rotation.as_vector();
    TransformRow {
        body: id,
        position: pose.translation.vector.into(),
        orientation: [q.x, q.y, q.z, q.w],
        ..TransformRow::default()
    }
}
