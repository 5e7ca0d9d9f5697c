//! Goal: the cause of each tick in every mode, and that silence never counts as safety. Method: the pacer and a world,
//! a manual clock advanced from wake-up to wake-up, frames delivered at given times; every tick is recorded.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "helpers of tests are not covered by the test allowance; milliseconds here are whole numbers"
)]

#[path = "law_pace/many.rs"]
mod many;
#[path = "law_pace/rounds.rs"]
mod rounds;
#[path = "law_world/support.rs"]
mod support;

use sweepd::config::{Config, Mode};
use sweepd::ids::SourceSlot;
use sweepd::scene::Scene;
use sweepd::tick::pace::{Due, Pacer};
use sweepd::time::{Clock, ManualClock};
use sweepd::wire::{BodyStatus, Frame, Inbox, TickCause, WIRE_VERSION, frame_flags};
use sweepd::world::{Edit, World};

use support::{MS, START_NS, TIMEOUT_NS, cube, fixed, frame, moving, row, scene};

const HEARTBEAT_NS: u64 = 100 * MS;
const LATE_NS: u64 = 5 * MS;

/// One published tick.
#[derive(Clone, Debug)]
struct Tick {
    /// Time since the start, milliseconds.
    at_ms: f64,
    due: Due,
    /// `(source, seq)` of its frames.
    frames: Vec<(String, u64)>,
    /// Whether the state of the world alone forbids `clear`.
    unsafe_word: bool,
    known: u64,
}

/// A daemon without transports: pacer, world, clock.
struct Daemon {
    pacer: Pacer,
    world: World,
    clock: ManualClock,
    drained: Inbox,
    inbox: Inbox,
    edits: Vec<Edit>,
    ticks: Vec<Tick>,
    passed: Vec<(Option<SourceSlot>, u64)>,
}

/// The mode with one tick per frame of `sim`.
fn on_sim() -> Mode {
    Mode::OnFrame("sim".to_owned())
}

fn two_bodies(mode: Mode) -> Scene {
    let mut robot = moving("b", 2);
    robot.source = Some(1);
    let mut scene = scene(
        vec![moving("a", 1), robot, fixed("wall", 3, 9.0)],
        Vec::new(),
    );
    scene.config = Config {
        mode,
        heartbeat_ns: HEARTBEAT_NS,
        late_ns: LATE_NS,
        ..Config::default()
    };
    scene
}

impl Daemon {
    fn of(mode: Mode) -> Self {
        Self::of_scene(&two_bodies(mode))
    }

    fn of_scene(scene: &Scene) -> Self {
        let shapes = scene.bodies.iter().map(|_| cube()).collect();
        Self {
            pacer: Pacer::new(&scene.config, &scene.sources).unwrap(),
            world: World::new(scene, shapes, START_NS).unwrap(),
            clock: ManualClock::new(START_NS),
            drained: Inbox::default(),
            inbox: Inbox::default(),
            edits: Vec::new(),
            ticks: Vec::new(),
            passed: Vec::new(),
        }
    }

    /// Delivers frames (milliseconds since the start, frame) and runs every due tick until `end_ms`.
    fn run(&mut self, end_ms: f64, mut frames: Vec<(f64, Frame)>) -> &[Tick] {
        let first = self.ticks.len();
        let end_ns = ns(end_ms);
        frames.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut frames = frames.into_iter().peekable();
        loop {
            self.run_due();
            let now_ns = self.clock.boottime_ns();
            let wake_ns = self.pacer.wake_ns(now_ns, self.world.next_timeout());
            assert!(wake_ns > now_ns, "woken for nothing");
            let next_ns = frames.peek().map_or(u64::MAX, |f| ns(f.0)).min(wake_ns);
            if next_ns > end_ns {
                self.clock.advance(end_ns - now_ns);
                return &self.ticks[first..];
            }
            self.clock.advance(next_ns - now_ns);
            while let Some((at_ms, mut frame)) = frames.next_if(|f| ns(f.0) <= next_ns) {
                frame.received_ns = ns(at_ms);
                frame.header.sent_ns = ns(at_ms);
                *self.drained.push() = frame;
            }
            self.pacer.take(&mut self.drained, &self.world, next_ns);
        }
    }

    fn run_due(&mut self) {
        loop {
            let now_ns = self.clock.boottime_ns();
            let timeout_ns = self.world.next_timeout();
            let edits = !self.edits.is_empty();
            let Some(due) = self.pacer.due(now_ns, edits, timeout_ns, &mut self.inbox) else {
                return;
            };
            self.tick(due, now_ns);
        }
    }

    fn tick(&mut self, due: Due, now_ns: u64) {
        self.world.begin_tick(self.ticks.len() as u64 + 1, now_ns);
        for edit in self.edits.drain(..) {
            self.world.apply(&[edit]).unwrap();
        }
        for frame in self.inbox.frames() {
            self.world.admit(frame, now_ns);
        }
        for &session in self.inbox.ended() {
            self.world.end_session(session);
        }
        self.world.age(now_ns);
        self.world.validate().unwrap();
        self.pacer.learn(&self.world);
        let passed = &mut self.passed;
        self.pacer
            .drain_passed(|source, n| passed.push((source, n)));
        let name = |f: &Frame| sweepd::wire::name_str(&f.header.source).unwrap().to_owned();
        let frames = self.inbox.frames().iter();
        let counts = self.world.counts();
        self.ticks.push(Tick {
            at_ms: (now_ns - START_NS) as f64 / MS as f64,
            due,
            frames: frames.map(|f| (name(f), f.header.seq)).collect(),
            unsafe_word: counts.unknown > 0 || counts.reasons != 0,
            known: counts.by_status[usize::from(BodyStatus::Known.code())],
        });
    }

    fn passed_of(&self, source: u32) -> u64 {
        let of = self
            .passed
            .iter()
            .filter(|p| p.0 == Some(SourceSlot(source)));
        of.map(|p| p.1).sum()
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small positive milliseconds"
)]
fn ns(ms: f64) -> u64 {
    START_NS + (ms * MS as f64).round() as u64
}

fn modes() -> [Mode; 4] {
    [on_sim(), Mode::OnAll, Mode::Rate(500.0), Mode::Rate(2.0)]
}

fn sim(seq: u64) -> Frame {
    frame("sim", seq, 0, &[row(1, 0.0)])
}

fn robot(seq: u64) -> Frame {
    frame("robot", seq, 0, &[row(2, 5.0)])
}

/// `count` frames, numbered from 1, from `from_ms` on at intervals of `every_ms`.
fn stream(make: fn(u64) -> Frame, count: u64, from_ms: f64, every_ms: f64) -> Vec<(f64, Frame)> {
    (0..count)
        .map(|k| (from_ms + every_ms * k as f64, make(k + 1)))
        .collect()
}

fn assert_heartbeats(ticks: &[Tick], from_ms: f64, end_ms: f64) {
    let mut last_ms = from_ms;
    for at_ms in ticks.iter().map(|t| t.at_ms).chain([end_ms]) {
        assert!(
            at_ms - last_ms <= 100.0,
            "silence from {last_ms} to {at_ms} ms"
        );
        last_ms = at_ms;
    }
}

fn causes(ticks: &[Tick]) -> Vec<TickCause> {
    ticks.iter().map(|t| t.due.cause).collect()
}

#[test]
fn law_4_4_silence_of_a_daemon_started_without_sources_is_never_clear() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode);
        let ticks = daemon.run(2000.0, Vec::new());
        assert_eq!(ticks[0].at_ms, 0.0, "the first tick goes out at once");
        assert_heartbeats(ticks, 0.0, 2000.0);
        assert!(ticks.iter().all(|t| t.unsafe_word));
    }
}

#[test]
fn law_4_4_silence_of_killed_sources_is_never_clear() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        let mut frames = stream(sim, 50, 1.0, 10.0);
        frames.extend(stream(robot, 50, 1.0, 10.0));
        // The last frames arrive at 491 ms.
        let ticks = daemon.run(3000.0, frames);
        assert_heartbeats(ticks, 0.0, 3000.0);
        assert!(
            ticks.iter().any(|t| !t.unsafe_word),
            "{mode:?}: it was well before"
        );
        let after = |t: &&Tick| t.at_ms >= 991.0;
        assert!(
            ticks.iter().filter(after).all(|t| t.unsafe_word),
            "{mode:?}"
        );
        let timeout = ticks.iter().find(|t| t.due.cause == TickCause::Timeout);
        assert!(timeout.is_some_and(|t| t.at_ms <= 991.0), "{mode:?}");
    }
}

#[test]
fn law_4_4_silence_of_a_pose_that_is_never_sent_is_never_clear() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode);
        // The robot never sends.
        let ticks = daemon.run(2000.0, stream(sim, 200, 1.0, 10.0));
        assert_heartbeats(ticks, 0.0, 2000.0);
        assert!(ticks.iter().all(|t| t.unsafe_word));
    }
}

#[test]
fn law_4_4_silence_of_a_suspended_machine_is_never_clear() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        let mut frames = stream(sim, 40, 1.0, 10.0);
        frames.extend(stream(robot, 40, 1.0, 10.0));
        daemon.run(400.0, frames);
        // Suspended for an hour, so the wake-up is an hour late.
        daemon.clock.advance(3_600_000 * MS);
        let first = daemon.ticks.len();
        daemon.run_due();
        let ticks = &daemon.ticks[first..];
        assert!(!ticks.is_empty(), "{mode:?}");
        assert!(
            ticks.iter().all(|t| t.unsafe_word && t.known == 1),
            "{mode:?}"
        );
    }
}

#[test]
fn law_4_4_on_frame_makes_one_tick_of_each_frame_in_order() {
    let mut daemon = Daemon::of(on_sim());
    // Five frames at once, and a robot with frames ten times as often.
    let mut frames: Vec<_> = (1..=5).map(|seq| (20.0, sim(seq))).collect();
    frames.extend(stream(robot, 100, 0.5, 1.0));
    let ticks = daemon.run(100.0, frames);
    let by_frame: Vec<_> = ticks
        .iter()
        .filter(|t| t.due.cause == TickCause::Frame)
        .collect();
    assert_eq!(by_frame.len(), 5);
    for (tick, seq) in by_frame.iter().zip(1..) {
        assert!(tick.frames.contains(&("sim".to_owned(), seq)));
        assert_eq!(tick.due.source, Some(SourceSlot(0)));
        assert!(!tick.due.ages_only);
    }
    // The first tick takes the robot's newest frame; the nineteen before it are skipped and counted.
    assert_eq!(by_frame[0].frames[0], ("robot".to_owned(), 20));
    assert_eq!(daemon.passed_of(0), 0);
    assert!(daemon.passed_of(1) >= 19);
    // All other ticks only judge ages and take no frame.
    let others = daemon
        .ticks
        .iter()
        .filter(|t| t.due.cause != TickCause::Frame);
    for tick in others {
        assert!(tick.due.ages_only && tick.frames.is_empty());
    }
}

#[test]
fn law_4_4_a_paused_frame_counts_as_a_frame_in_every_mode() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        let pause = |seq| {
            let mut frame = frame("sim", seq, 0, &[]);
            frame.header.flags = frame_flags::PAUSED;
            frame
        };
        let mut frames = vec![(1.0, sim(1)), (1.0, robot(1))];
        frames.extend((2..=12).map(|seq| (100.0 * seq as f64, pause(seq))));
        frames.extend((2..=12).map(|seq| (100.0 * seq as f64, robot(seq))));
        let ticks = daemon.run(1250.0, frames);
        assert!(ticks.last().is_some_and(|t| t.known == 3), "{mode:?}");
        if mode == on_sim() {
            let by_frame = ticks.iter().filter(|t| t.due.cause == TickCause::Frame);
            assert_eq!(by_frame.count(), 12);
        }
    }
}

#[test]
fn law_4_4_frames_that_were_lost_on_their_way_are_counted() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        let again = |seq, epoch, session| {
            let mut frame = sim(seq);
            (frame.header.epoch, frame.header.session) = (epoch, session);
            frame
        };
        let session = sim(1).header.session;
        let frames = vec![
            // A client that was connected earlier: frames from before are not counted as lost.
            (600.0, sim(7)),
            (1200.0, sim(8)),
            (1800.0, sim(11)),
            (2400.0, sim(12)),
            // An old number, and a new epoch and a new session with their own numbering: no frame is missing.
            (3000.0, sim(2)),
            (3600.0, sim(13)),
            (4200.0, again(1, 1, session)),
            (9000.0, again(90, 0, session + 1)),
        ];
        daemon.run(9600.0, frames);
        assert_eq!(daemon.passed_of(0), 2, "{mode:?}");
        assert_eq!(daemon.passed_of(1), 0);
        // An absurdly high number does not overflow the counter.
        let absurd = (1..=4_u32).flat_map(|epoch| {
            let at_ms = 10_000.0 + 10.0 * f64::from(epoch);
            let frame = |seq| again(seq, epoch.into(), session + 1);
            [(at_ms, frame(1)), (at_ms + 1.0, frame(u64::MAX))]
        });
        daemon.run(11_000.0, absurd.collect());
        assert!(daemon.passed_of(0) < u64::MAX / 2, "{mode:?}");
    }
}

#[test]
fn law_4_4_a_round_takes_the_newest_frame_of_each_live_source() {
    let mut daemon = Daemon::of(Mode::OnAll);
    let frames = vec![
        (1.0, sim(1)),
        (1.0, robot(1)),
        // The faster source sends twice before the slower one: its first frame is skipped.
        (10.0, sim(2)),
        (11.0, sim(3)),
        (12.0, robot(2)),
    ];
    let ticks = daemon.run(50.0, frames);
    let taken = |t: &Tick, name: &str, seq| t.frames.contains(&(name.to_owned(), seq));
    assert_eq!(
        causes(ticks),
        [TickCause::Heartbeat, TickCause::Frame, TickCause::Frame]
    );
    assert!(taken(&ticks[1], "sim", 1) && taken(&ticks[1], "robot", 1));
    assert_eq!(ticks[2].at_ms, 12.0);
    assert!(taken(&ticks[2], "sim", 3) && taken(&ticks[2], "robot", 2));
    assert_eq!(daemon.passed_of(0), 1);
}

#[test]
fn law_4_4_a_late_source_is_not_waited_for_until_its_next_frame() {
    let mut daemon = Daemon::of(Mode::OnAll);
    let frames = vec![
        (1.0, sim(1)),
        (1.0, robot(1)),
        // The robot misses this round, which closes 5 ms after its first frame, ...
        (10.0, sim(2)),
        // ... and does not delay the next ones, ...
        (20.0, sim(3)),
        (30.0, sim(4)),
        // ... until it sends again: its frame opens a round that includes the frame of `sim`.
        (35.0, robot(2)),
        (37.0, sim(5)),
        (40.0, sim(6)),
    ];
    let ticks = daemon.run(60.0, frames);
    let at: Vec<f64> = ticks[1..].iter().map(|t| t.at_ms).collect();
    assert_eq!(at, [1.0, 15.0, 20.0, 30.0, 37.0, 45.0]);
}

#[test]
fn law_4_4_a_partial_frame_is_never_passed_over_for_a_newer_one() {
    let mut daemon = Daemon::of(Mode::Rate(50.0));
    let partial = |seq, body| {
        let mut frame = frame("sim", seq, 0, &[row(body, 1.0)]);
        frame.header.flags = frame_flags::PARTIAL;
        frame
    };
    let frames = vec![
        (1.0, partial(1, 1)),
        (2.0, partial(2, 99)),
        (3.0, sim(3)),
        (4.0, sim(4)),
    ];
    daemon.run(25.0, frames);
    assert_eq!(
        daemon.passed_of(0),
        3,
        "full frames stand for all before them"
    );
    assert_eq!(daemon.ticks.last().unwrap().frames, [("sim".to_owned(), 4)]);
    let frames = vec![
        (26.0, sim(5)),
        (27.0, partial(6, 1)),
        (28.0, partial(7, 99)),
    ];
    let ticks_len = daemon.run(45.0, frames).len();
    assert!(ticks_len > 0);
    assert_eq!(daemon.ticks.last().unwrap().frames.len(), 3);
    assert_eq!(daemon.passed_of(0), 3);
}

#[test]
fn law_4_2_bug_a_full_frame_overtook_a_pause_or_another_of_its_session_which_was_refused() {
    let sent = |seq, flags, scene_rev| {
        let rows = [row(1, 1.0)];
        let pauses = flags == frame_flags::PAUSED;
        let mut frame = frame("sim", seq, 0, if pauses { &[] } else { &rows });
        (frame.header.flags, frame.header.scene_rev) = (flags, scene_rev);
        frame
    };
    let (full, partial, paused) = (frame_flags::FULL, frame_flags::PARTIAL, frame_flags::PAUSED);
    for (between, passed) in [(paused, 2), (partial, 1), (full, 1)] {
        let mut daemon = Daemon::of(Mode::Rate(50.0));
        let frames = vec![
            (1.0, sent(5, full, 1)),
            (2.0, sent(6, between, 0)),
            (3.0, sent(7, full, 1)),
        ];
        daemon.run(25.0, frames);
        let taken: Vec<u64> = daemon
            .ticks
            .iter()
            .flat_map(|t| &t.frames)
            .map(|f| f.1)
            .collect();
        assert!(taken.is_sorted() && taken.last() == Some(&7), "{taken:?}");
        assert_eq!(daemon.passed_of(0), passed, "{taken:?}");
        assert_eq!(daemon.world.rejects().iter().sum::<u64>(), 0, "{taken:?}");
    }
}

#[test]
fn law_4_4_a_rate_does_not_make_up_for_missed_beats() {
    let mut daemon = Daemon::of(Mode::Rate(100.0));
    let ticks = daemon.run(50.0, Vec::new());
    assert_eq!(ticks.len(), 6, "at 0, 10, .. 50 ms");
    // The daemon is delayed by 35 ms: one tick follows at once, then the original schedule.
    daemon.clock.advance(35 * MS);
    let at: Vec<f64> = daemon
        .run(110.0, Vec::new())
        .iter()
        .map(|t| t.at_ms)
        .collect();
    assert_eq!(at, [85.0, 90.0, 100.0, 110.0]);
}

#[test]
fn law_4_4_a_slow_rate_takes_the_newest_state_with_each_heartbeat() {
    let mut daemon = Daemon::of(Mode::Rate(1.0));
    let mut frames = stream(sim, 190, 1.0, 10.0);
    frames.extend(stream(robot, 190, 1.0, 10.0));
    let ticks = daemon.run(1900.0, frames);
    assert_heartbeats(ticks, 0.0, 1900.0);
    // No body becomes stale while its frames wait for the next scheduled tick.
    assert!(ticks[1..].iter().all(|t| t.known == 3 && !t.unsafe_word));
}

#[test]
fn law_4_4_an_edit_makes_a_tick_at_once_in_every_mode() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        daemon.run(33.0, Vec::new());
        daemon.edits.push(Edit::Remove {
            name: "wall".to_owned(),
        });
        let first = daemon.ticks.len();
        daemon.run_due();
        assert_eq!(
            causes(&daemon.ticks[first..]),
            [TickCause::Edit],
            "{mode:?}"
        );
        assert_eq!(daemon.world.scene_rev(), 2);
        let ages_only = matches!(mode, Mode::OnFrame(_));
        assert_eq!(daemon.ticks[first].due.ages_only, ages_only);
    }
}

#[test]
fn law_4_2_a_session_that_was_heard_in_time_is_not_taken_over_by_a_frame_that_waited_behind_it() {
    let mut daemon = Daemon::of(on_sim());
    let mut other = robot(1);
    other.header.session = 77;
    // The robot sends all the time; a frame of another session arrives once; for 700 ms no tick takes frames of either.
    let mut frames = vec![
        (1.0, robot(1)),
        (2.0, sim(1)),
        (600.0, other),
        (710.0, sim(2)),
    ];
    frames.extend((2..=70).map(|seq| (10.0 * seq as f64, robot(seq))));
    daemon.run(720.0, frames);
    assert_eq!(daemon.world.sources()[1].session, 1);
    let taken = sweepd::wire::RejectReason::SourceTaken;
    assert_eq!(daemon.world.rejects()[usize::from(taken.code())], 1);
}

#[test]
fn law_4_2_an_ended_session_ends_after_the_last_of_its_frames() {
    let mut daemon = Daemon::of(on_sim());
    *daemon.drained.push() = robot(1);
    daemon.drained.end_session(1);
    let now_ns = daemon.clock.boottime_ns();
    daemon
        .pacer
        .take(&mut daemon.drained, &daemon.world, now_ns);
    // The first tick is a heartbeat without frames: the session must not be ended before its frame was taken.
    daemon.run(10.0, Vec::new());
    assert_eq!(daemon.world.sources()[1].frames(), 0);
    let mut lead = sim(1);
    lead.header.session = 2;
    daemon.run(20.0, vec![(15.0, lead)]);
    assert_eq!(daemon.world.sources()[1].frames(), 1);
    assert_eq!(daemon.world.sources()[1].session, 0);
}

/// Queues vertices of a source for the next drain.
fn bend(daemon: &mut Daemon, source: &str, session: u64, seq: u64, version: u64) {
    let header = &mut daemon.drained.push_vertices().header;
    (header.session, header.seq, header.version) = (session, seq, version);
    (header.source, header.schema) = (sweepd::wire::name_bytes(source), WIRE_VERSION);
}

/// Input that a tick takes: `(session, seq)` of frames, versions of vertices.
type Taken = (Vec<(u64, u64)>, Vec<u64>);

/// The input that the next tick takes, after the pacer has the drained messages; `None`: no tick is due.
fn next(daemon: &mut Daemon) -> Option<Taken> {
    let now_ns = daemon.clock.boottime_ns();
    daemon
        .pacer
        .take(&mut daemon.drained, &daemon.world, now_ns);
    daemon.pacer.due(now_ns, false, None, &mut daemon.inbox)?;
    let frames = daemon.inbox.frames().iter();
    let frames = frames.map(|f| (f.header.session, f.header.seq)).collect();
    let versions = daemon.inbox.vertices().iter().map(|v| v.header.version);
    Some((frames, versions.collect()))
}

#[test]
fn law_4_4_vertices_wait_for_the_frame_that_they_belong_with() {
    let mut daemon = Daemon::of(on_sim());
    bend(&mut daemon, "sim", 1, 1, 1);
    bend(&mut daemon, "robot", 1, 5, 50);
    bend(&mut daemon, "sim", 1, 0, 2);
    bend(&mut daemon, "robot", 1, 0, 51);
    // The first tick is a heartbeat. Vertices that belong to no frame stay behind those sent before them.
    assert_eq!(next(&mut daemon), Some((vec![], vec![])));
    assert_eq!(next(&mut daemon), None);
    *daemon.drained.push() = sim(1);
    bend(&mut daemon, "sim", 1, 2, 3);
    bend(&mut daemon, "sim", 1, 2, 4);
    *daemon.drained.push() = sim(2);
    bend(&mut daemon, "sim", 1, 4, 5);
    *daemon.drained.push() = sim(3);
    assert_eq!(next(&mut daemon), Some((vec![(1, 1)], vec![1, 2])));
    assert_eq!(next(&mut daemon), Some((vec![(1, 2)], vec![3, 4])));
    assert_eq!(next(&mut daemon), Some((vec![(1, 3)], vec![])));
    // Its frame does not come. Vertices of a source that does not lead wait for at most a timeout.
    daemon.clock.advance(TIMEOUT_NS);
    assert_eq!(next(&mut daemon), Some((vec![], vec![50, 51])));
    // Its session ends: vertices that wait for a frame that never comes are dropped with it.
    daemon.drained.end_session(1);
    daemon.clock.advance(200 * MS);
    assert_eq!(next(&mut daemon), Some((vec![], vec![])));
    *daemon.drained.push() = sim(9);
    assert_eq!(next(&mut daemon), Some((vec![(1, 9)], vec![])));
}

#[test]
fn law_4_4_bug_vertices_ahead_of_a_frame_that_comes_a_tick_later_bent_the_pose_before_it() {
    for mode in [
        Mode::Rate(10.0),
        Mode::OnAll,
        Mode::OnFrame("robot".to_owned()),
    ] {
        let mut daemon = Daemon::of(mode.clone());
        let tick = |daemon: &mut Daemon| {
            daemon.clock.advance(HEARTBEAT_NS);
            let (frames, versions) = next(daemon).unwrap();
            let of_sim = frames.iter().filter(|(_, seq)| *seq >= 10);
            (of_sim.map(|(_, seq)| *seq).collect::<Vec<_>>(), versions)
        };
        // Both sources send, so that a round is complete and the lead has a frame.
        let mut seq = 0;
        let mut send = |daemon: &mut Daemon, of_sim: u64| {
            seq += 1;
            *daemon.drained.push() = robot(seq);
            *daemon.drained.push() = sim(of_sim);
        };
        assert_eq!(tick(&mut daemon), (vec![], vec![]), "{mode:?}");
        bend(&mut daemon, "sim", 1, 10, 1);
        // Vertices that belong to no frame keep their order.
        bend(&mut daemon, "sim", 1, 0, 2);
        assert_eq!(tick(&mut daemon), (vec![], vec![]), "{mode:?}");
        send(&mut daemon, 10);
        assert_eq!(tick(&mut daemon), (vec![10], vec![1, 2]), "{mode:?}");
        // Their frame, or a later one, was already taken.
        bend(&mut daemon, "sim", 1, 10, 3);
        assert_eq!(tick(&mut daemon), (vec![], vec![3]), "{mode:?}");
        bend(&mut daemon, "sim", 1, 11, 4);
        send(&mut daemon, 12);
        assert_eq!(tick(&mut daemon), (vec![12], vec![4]), "{mode:?}");
        // Their frame never comes.
        bend(&mut daemon, "sim", 1, 13, 5);
        assert_eq!(tick(&mut daemon), (vec![], vec![]), "{mode:?}");
        daemon.clock.advance(TIMEOUT_NS - HEARTBEAT_NS);
        assert_eq!(tick(&mut daemon), (vec![], vec![5]), "{mode:?}");
        // Vertices of another session do not wait for its frame.
        send(&mut daemon, 14);
        assert_eq!(tick(&mut daemon), (vec![14], vec![]), "{mode:?}");
        bend(&mut daemon, "sim", 77, 15, 70);
        assert_eq!(tick(&mut daemon), (vec![], vec![70]), "{mode:?}");
    }
}

#[test]
fn law_4_4_bug_vertices_of_a_round_that_is_under_way_went_ahead_of_their_frame() {
    let mut daemon = Daemon::of(Mode::OnAll);
    let frames = (1..=5).flat_map(|k| [(k as f64, sim(k)), (k as f64, robot(k))]);
    daemon.run(6.0, frames.collect());
    bend(&mut daemon, "sim", 1, 6, 1);
    *daemon.drained.push() = sim(6);
    let now_ns = daemon.clock.boottime_ns();
    daemon
        .pacer
        .take(&mut daemon.drained, &daemon.world, now_ns);
    // The tick of an edit does not affect the round.
    let due = daemon.pacer.due(now_ns, true, None, &mut daemon.inbox);
    assert_eq!(due.unwrap().cause, TickCause::Edit);
    assert!(daemon.inbox.frames().is_empty() && daemon.inbox.vertices().is_empty());
    *daemon.drained.push() = robot(6);
    assert_eq!(next(&mut daemon), Some((vec![(1, 6), (1, 6)], vec![1])));
}

#[test]
fn law_4_2_bug_vertices_of_another_session_wait_for_the_frames_of_the_one_in_force() {
    let mut daemon = Daemon::of(on_sim());
    daemon.run(5.0, vec![(1.0, robot(1)), (2.0, sim(1))]);
    // The robot's frames wait for the lead; vertices of another session would be taken in any tick.
    for seq in 2..=4 {
        *daemon.drained.push() = robot(seq);
    }
    bend(&mut daemon, "robot", 77, 0, 7);
    daemon.clock.advance(HEARTBEAT_NS);
    assert_eq!(next(&mut daemon), Some((vec![], vec![])));
    *daemon.drained.push() = sim(2);
    // The newest frame of the robot, and that of the lead.
    assert_eq!(next(&mut daemon), Some((vec![(1, 4), (1, 2)], vec![7])));
}

#[test]
fn law_4_2_bug_a_strangers_frame_is_none_of_the_round() {
    let mut daemon = Daemon::of(Mode::OnAll);
    daemon.run(10.0, vec![(1.0, sim(1)), (2.0, robot(1))]);
    let mut stranger = robot(1);
    stranger.header.session = 77;
    let mut foreign = robot(2);
    foreign.header.schema = WIRE_VERSION + 1;
    let ticks = daemon.run(
        30.0,
        vec![
            (20.0, sim(2)),
            (20.5, stranger),
            (21.0, foreign),
            (22.0, robot(2)),
        ],
    );
    let [tick] = ticks else {
        panic!("one round: {ticks:?}")
    };
    assert_eq!(tick.at_ms, 22.0);
    assert!(tick.frames.contains(&("robot".to_owned(), 2)));
    assert_eq!(daemon.world.sources()[1].session, 1);
    // After the end of the session in force the next session counts as a participant.
    daemon.drained.end_session(1);
    let mut next = robot(1);
    next.header.session = 78;
    let mut lead = sim(1);
    lead.header.session = 78;
    // There is no other source to wait for.
    let ticks = daemon.run(60.0, vec![(50.0, next), (51.0, lead)]);
    assert_eq!((ticks[0].at_ms, ticks[0].frames.len()), (50.0, 1));
}

#[test]
fn law_4_2_bug_what_is_of_another_boot_begins_no_round() {
    let mut daemon = Daemon::of(Mode::OnAll);
    daemon.world.set_boot(7);
    let mut left_over = sim(1);
    left_over.header.boot = 8;
    // The foreign frame would have begun a round and missed it, and the next round would not have waited for its
    // source.
    daemon.run(1.0, vec![(0.0, robot(1))]);
    let ticks = daemon.run(9.0, vec![(2.0, left_over)]);
    assert!(ticks.is_empty(), "{ticks:?}");
    let ticks = daemon.run(20.0, vec![(10.0, sim(1)), (11.0, robot(2))]);
    let [tick] = ticks else {
        panic!("one round: {ticks:?}")
    };
    assert_eq!((tick.at_ms, tick.frames.len()), (11.0, 3));
}

#[test]
fn law_4_4_bug_vertices_go_with_their_frame_whoever_else_sends() {
    let mut daemon = Daemon::of(on_sim());
    daemon.run(1.0, Vec::new());
    let mut foreign = sim(1);
    foreign.header.session = 77;
    // A frame of another session after, then before the own one.
    bend(&mut daemon, "sim", 1, 1, 1);
    *daemon.drained.push() = sim(1);
    *daemon.drained.push() = foreign.clone();
    // Vertices of the other session are refused, which is reported early.
    bend(&mut daemon, "sim", 77, 2, 70);
    assert_eq!(next(&mut daemon), Some((vec![(1, 1)], vec![1, 70])));
    bend(&mut daemon, "sim", 1, 2, 2);
    *daemon.drained.push() = sim(2);
    // The frame of the other session makes no tick by itself.
    assert_eq!(next(&mut daemon), Some((vec![(77, 1), (1, 2)], vec![2])));
    // Vertices with a number that is too high go with the next frame, as do those sent before and after them.
    bend(&mut daemon, "sim", 1, 10, 3);
    bend(&mut daemon, "sim", 1, 3, 4);
    *daemon.drained.push() = sim(3);
    assert_eq!(next(&mut daemon), Some((vec![(1, 3)], vec![3, 4])));
    // Vertices of the session that follows an ended one wait for their own frame.
    daemon.drained.end_session(1);
    bend(&mut daemon, "sim", 78, 1, 80);
    *daemon.drained.push() = sim(4);
    assert_eq!(next(&mut daemon), Some((vec![(1, 4)], vec![])));
    (foreign.header.session, foreign.header.seq) = (78, 1);
    *daemon.drained.push() = foreign;
    assert_eq!(next(&mut daemon), Some((vec![(78, 1)], vec![80])));
}

#[test]
fn law_4_2_bug_a_stranger_that_floods_pushes_no_frame_of_the_lead_out() {
    let mut daemon = Daemon::of(on_sim());
    daemon.run(1.0, vec![(0.0, sim(1))]);
    *daemon.drained.push() = sim(2);
    for seq in 1..=70 {
        let frame = daemon.drained.push();
        *frame = sim(seq);
        frame.header.session = 77;
    }
    let (frames, _) = next(&mut daemon).unwrap();
    assert_eq!(frames, [(1, 2)]);
    // Waiting frames are refused at the next heartbeat, and those that exceeded the limit are reported.
    daemon.run(110.0, Vec::new());
    let taken = sweepd::wire::RejectReason::SourceTaken;
    assert!(daemon.world.rejects()[usize::from(taken.code())] > 60);
    assert!(daemon.passed_of(0) > 0);
}

#[test]
fn law_4_2_bug_what_the_world_refuses_takes_nobodys_place_in_a_round() {
    let mut daemon = Daemon::of(Mode::OnAll);
    daemon.run(1.0, vec![(0.0, sim(1)), (0.5, robot(1))]);
    let of_77 = |seq| {
        let mut frame = robot(seq);
        frame.header.session = 77;
        frame
    };
    // Session 77 takes over from a silent one, is silent itself, and then frames of the ended session arrive.
    let silent_ms = (TIMEOUT_NS / MS) as f64 + 10.0;
    let then_ms = 2.0 * silent_ms;
    daemon.run(silent_ms + 1.0, vec![(silent_ms, of_77(1))]);
    assert_eq!(daemon.world.sources()[1].session, 77);
    let ticks = daemon.run(
        then_ms + 50.0,
        vec![
            (then_ms, robot(2)),
            (then_ms + 1.0, of_77(2)),
            (then_ms + 2.0, robot(3)),
            (then_ms + 3.0, of_77(3)),
        ],
    );
    for (at_ms, seq) in [(1.0, 2), (3.0, 3)] {
        let frame = ("robot".to_owned(), seq);
        let of_77 = |tick: &&Tick| tick.at_ms == then_ms + at_ms && tick.frames.contains(&frame);
        assert!(ticks.iter().find(of_77).is_some(), "{seq}: {ticks:?}");
    }
    assert_eq!(daemon.world.sources()[1].session, 77);
}

#[test]
fn law_4_2_bug_a_stranger_is_told_so_with_the_next_heartbeat() {
    let mut daemon = Daemon::of(Mode::OnAll);
    daemon.run(1.0, vec![(0.0, robot(1))]);
    let mut stranger = robot(1);
    stranger.header.session = 77;
    let mut foreign = sim(1);
    foreign.header.schema = WIRE_VERSION + 1;
    daemon.run(110.0, vec![(5.0, stranger.clone()), (6.0, foreign)]);
    let rejects = |daemon: &Daemon, reason: sweepd::wire::RejectReason| {
        daemon.world.rejects()[usize::from(reason.code())]
    };
    for reason in [
        sweepd::wire::RejectReason::SourceTaken,
        sweepd::wire::RejectReason::BadLayout,
    ] {
        assert_eq!(rejects(&daemon, reason), 1, "{reason:?}");
    }
    // The session in force ends while the other one waits: the other need not wait any longer.
    stranger.header.seq = 2;
    let ticks = daemon.ticks.len();
    daemon.run(120.0, vec![(115.0, stranger)]);
    assert_eq!(daemon.ticks.len(), ticks);
    daemon.drained.end_session(1);
    let now_ns = daemon.clock.boottime_ns();
    daemon
        .pacer
        .take(&mut daemon.drained, &daemon.world, now_ns);
    daemon.run(121.0, Vec::new());
    let tick = daemon.ticks.last().unwrap();
    assert_eq!(tick.due.cause, TickCause::Frame);
    assert_eq!(tick.frames, [("robot".to_owned(), 2)]);
}

#[test]
fn frames_of_no_source_and_beyond_the_limit_are_counted() {
    let mut daemon = Daemon::of(Mode::OnAll);
    let frames = (0..100)
        .map(|seq| (1.0, frame("nobody", seq, 0, &[])))
        .collect();
    daemon.run(200.0, frames);
    let unknown = sweepd::wire::RejectReason::UnknownSource;
    let refused = daemon.world.rejects()[usize::from(unknown.code())];
    let passed: u64 = daemon
        .passed
        .iter()
        .filter(|p| p.0.is_none())
        .map(|p| p.1)
        .sum();
    assert_eq!(refused + passed, 100);
}

#[test]
fn a_mode_that_cannot_be_is_refused_with_what_to_change() {
    let scene = two_bodies(Mode::OnFrame("simm".to_owned()));
    let text = Pacer::new(&scene.config, &scene.sources)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("simm") && text.contains("sim, robot"),
        "{text}"
    );
    for hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let scene = two_bodies(Mode::Rate(hz));
        assert!(Pacer::new(&scene.config, &scene.sources).is_err(), "{hz}");
    }
}

#[test]
fn timeouts_are_told_at_their_time() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        let ticks = daemon.run(700.0, vec![(150.0, sim(1)), (150.0, robot(1))]);
        // A scheduled tick may fall exactly on the timeout and report it.
        let at_ms = 150.0 + TIMEOUT_NS as f64 / MS as f64;
        let told = ticks.iter().find(|t| t.at_ms >= at_ms).unwrap();
        assert!(told.unsafe_word && told.at_ms <= at_ms, "{mode:?} {told:?}");
        assert!(told.known == 1 && ticks.iter().any(|t| t.known == 3));
        if mode != Mode::Rate(500.0) {
            assert_eq!(told.due.cause, TickCause::Timeout);
        }
    }
}
