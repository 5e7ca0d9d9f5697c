//! A scene as text, an engine, and hands to move its bodies.

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

/// Between two frames.
pub(crate) const FRAME_NS: u64 = 10_000_000;
pub(crate) const ALL: Budget = Budget::UNLIMITED;
pub(crate) const NONE: Budget = Budget {
    time_ns: None,
    units: Some(0),
};

const PAIRS_APART_M: f64 = 10.0;

/// A scene: what stands before the source, and its bodies.
pub(crate) fn scene(head: &str, bodies: &[String]) -> String {
    let mut text =
        format!("frame_id = \"world\"\n{head}\n[[source]]\nname = \"feed\"\ntimeout_ms = 500\n");
    for body in bodies {
        let _ = write!(text, "\n[[body]]\n{body}");
    }
    text
}

/// A body that moves, with `shape` as an inline table, at x, y, z.
pub(crate) fn body(id: u64, at: [f64; 3], shape: &str, more: &str) -> String {
    format!("name = \"b{id}\"\nid = {id}\nmoves = true\nposition = {at:?}\nshape = {shape}\n{more}")
}

/// A ball of radius 1 m at x.
pub(crate) fn ball(id: u64, x: f64, more: &str) -> String {
    body(
        id,
        [x, 0.0, 0.0],
        "{ type = \"sphere\", radius = 1.0 }",
        more,
    )
}

/// Two balls for each of `pairs` pairs far from one another, in the same place: b1 and b2, b3 and b4, ...
pub(crate) fn ball_pairs(pairs: u64) -> Rig {
    let balls: Vec<String> = (1..=2 * pairs)
        .map(|id| ball(id, ((id - 1) / 2) as f64 * PAIRS_APART_M, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &balls));
    rig.checked = false;
    rig
}

/// Puts the second ball of each pair where it is seen from the first.
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
    /// Whose frames are sent.
    pub(crate) source: &'static str,
    pub(crate) session: u64,
    pub(crate) epoch: u64,
    /// The next frames say no time of the sender's.
    pub(crate) unstamped: bool,
    /// Sessions whose client is gone, told with the next frame.
    pub(crate) ended: Vec<u64>,
    pub(crate) flags: u32,
    /// Linear and angular velocity of each row, or empty.
    pub(crate) velocities: Vec<[f64; 6]>,
    /// What goes with the next frame.
    pub(crate) vertices: Vec<VertexFrame>,
    pub(crate) out: Outbox,
    /// What the next frames say of their ticks' end; 0: nothing.
    pub(crate) deadline_ns: u64,
    pub(crate) time_left_ns: u64,
    /// Revision of the scene that the next frames need.
    pub(crate) scene_rev: u64,
    /// Between a frame's receipt and its tick.
    pub(crate) waited_ns: u64,
    /// Between a tick's wake-up and the tick.
    pub(crate) woken_ns: u64,
    /// Ticks that went out alone while the last one was under way.
    pub(crate) pulses: Vec<TickRow>,
    /// Whether the whole structure is checked after each tick.
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

    /// A frame with the rows as they are, and a tick.
    pub(crate) fn send(&mut self, budget: Budget) -> &Outbox {
        self.frame();
        self.tick(budget, &[], TickCause::Frame)
    }

    /// Frames one after the other, the rows of each as `set` makes them, and one tick.
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

    /// A tick without a frame, `after_ns` later.
    pub(crate) fn idle(&mut self, after_ns: u64, budget: Budget) -> &Outbox {
        self.clock.advance(after_ns);
        self.inbox.clear();
        self.tick(budget, &[], TickCause::Heartbeat)
    }

    /// A tick with vertices and no frame, `after_ns` later.
    #[allow(dead_code, reason = "of the tests that share this rig one sends so")]
    pub(crate) fn idle_with_vertices(&mut self, after_ns: u64, budget: Budget) -> &Outbox {
        self.clock.advance(after_ns);
        self.inbox.clear();
        self.take_vertices();
        self.tick(budget, &[], TickCause::Heartbeat)
    }

    /// How many were refused for a reason in this boot.
    #[allow(dead_code, reason = "as above")]
    pub(crate) fn rejects(&self, reason: RejectReason) -> u64 {
        self.out.tick.rejects[usize::from(reason.code())]
    }

    /// A tick with edits and no frame.
    pub(crate) fn edit(&mut self, edits: Vec<Edit>, budget: Budget) -> &Outbox {
        self.clock.advance(FRAME_NS);
        self.inbox.clear();
        self.tick_with(edits, budget)
    }

    /// A tick with edits and a frame with the rows as they are.
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

    /// The widest interval is kept from tick to tick: here it is looked for among all rows.
    fn check_widest(&self) {
        if !self.demand.pairs || self.out.pairs_header.truncated > 0 {
            return;
        }
        // A row of a pair that is apart is there for its event, or its way.
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

    /// The published verdict of a pair; no row, or the last row of a pair that is no candidate any more: apart.
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
