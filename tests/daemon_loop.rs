//! Goal: the daemon's loop keeps the rules of time. Method: daemon, door and client in this process on one thread,
//! rounds run one by one, with a manual clock.
#![allow(
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "tests"
)]

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use sweepd::daemon::{Daemon, build_shapes};
use sweepd::scene::Scene;
use sweepd::time::{Clock, ManualClock};
use sweepd::transport::client::{Client, FrameInfo, Heard, Rows, Topics};
use sweepd::transport::memory::{Hub, MemoryServer};
use sweepd::wire::{Reason, State, TickCause, TickRow, TransformRow};

const MS: u64 = 1_000_000;
const HEARTBEAT_NS: u64 = 100 * MS;
const TIMEOUT_NS: u64 = 5_000 * MS;
const MODES: [&str; 3] = ["on_frame = \"sim\"", "mode = \"on_all\"", "rate = 20"];

/// Balls of radius 1 m with source `sim`.
fn scene(run: &str, balls: usize) -> Scene {
    let mut text = format!(
        "[run]\n{run}\n[[source]]\nname = \"sim\"\ntimeout_ms = {}\n",
        TIMEOUT_NS / MS
    );
    for ball in 1..=balls {
        let _ = write!(
            text,
            "[[body]]\nname = \"b{ball}\"\nid = {ball}\nshape = {{ type = \"sphere\", radius = 1.0 }}\n"
        );
    }
    Scene::parse(&text, "scene.toml", Path::new(".")).unwrap()
}

/// Poses of pairs of balls, each pair far from the others; the centres of a pair differ by `apart` on two axes.
fn pairs(balls: usize, apart: f64) -> Vec<TransformRow> {
    let row = |at: usize| TransformRow {
        body: at as u64 + 1,
        position: [
            (at / 2) as f64 * 10.0 + (at % 2) as f64 * apart,
            (at % 2) as f64 * apart,
            0.0,
        ],
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..TransformRow::default()
    };
    (0..balls).map(row).collect()
}

const TOUCHING: f64 = 1.2;
const APART: f64 = 1.5;

/// A client that receives each tick.
struct Ear {
    client: Client,
}

impl Ear {
    fn of(hub: &Hub, clock: &Arc<ManualClock>) -> Self {
        Self::by(hub, clock, "sim")
    }

    fn by(hub: &Hub, clock: &Arc<ManualClock>, source: &str) -> Self {
        let link = Box::new(hub.link());
        let clock = Arc::clone(clock) as Arc<dyn Clock>;
        let mut client = Client::over(link, clock, Some(source), 0).unwrap();
        client.subscribe(Topics::ALL).unwrap();
        Self { client }
    }

    fn send(&mut self, rows: &[TransformRow]) {
        let info = FrameInfo::default();
        self.client.send(&info, Rows::Poses(rows)).unwrap();
    }

    /// The ticks received since the last call, each with whether the view has pairs.
    fn heard(&mut self) -> Vec<(TickRow, bool)> {
        let mut heard = Vec::new();
        while self.client.wait_tick(0).unwrap() == Heard::Tick {
            let view = self.client.view();
            heard.push((*view.tick(), view.pairs().is_some()));
        }
        heard
    }
}

fn state(tick: &TickRow) -> State {
    State::from_code(tick.header.state).unwrap()
}

#[test]
fn law_4_4_while_a_tick_takes_longer_than_a_heartbeat_clients_hear_that_it_is_under_way() {
    const BALLS: usize = 800;
    let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
    let scene = scene(MODES[0], BALLS);
    let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let mut ear = Ear::of(&hub, &clock);
    ear.send(&pairs(BALLS, APART));
    daemon.round(None).unwrap();
    let first = ear.heard();
    assert_eq!(first.len(), 1, "it took no time");
    ear.send(&pairs(BALLS, TOUCHING));
    // Each read of the clock takes a millisecond, so a tick of about 400 queries is long.
    clock.step_each_read(MS);
    let start_ns = clock.monotonic_ns();
    daemon.round(None).unwrap();
    clock.step_each_read(0);
    let heard = ear.heard();
    let (last, beats) = heard.split_last().unwrap();
    assert!((3..=6).contains(&beats.len()), "{} beats", beats.len());
    let mut before_ns = start_ns;
    for (tick, with_pairs) in beats {
        assert_eq!(state(tick), State::Unknown);
        assert_eq!(tick.reasons, Reason::Undecided.bit());
        assert!(tick.sent_ns - before_ns <= HEARTBEAT_NS + 30 * MS);
        // The test reads all messages after the tick: the pairs are already there, but belong to its end, not to this
        // message.
        assert!(!*with_pairs);
        assert_eq!(tick.header.tick, last.0.header.tick);
        assert_eq!(tick.sources_len, 0);
        before_ns = tick.sent_ns;
    }
    let (tick, with_pairs) = last;
    assert_eq!(state(tick), State::Colliding);
    assert_eq!((tick.colliding, tick.sources[0].seq), (BALLS as u64 / 2, 2));
    assert!(with_pairs);
}

#[test]
fn law_4_4_in_lockstep_a_heartbeat_judges_ages_and_spends_no_units() {
    const BALLS: usize = 20;
    for budget in ["budget_units = 3", "budget_ms = 1000.0"] {
        let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
        let scene = scene(&format!("{}\n{budget}", MODES[0]), BALLS);
        let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
        let mut ear = Ear::of(&hub, &clock);
        ear.send(&pairs(BALLS, TOUCHING));
        // The time is used up before the first pair, or the units after three pairs.
        clock.step_each_read(if budget.contains("units") {
            0
        } else {
            100 * MS
        });
        daemon.round(None).unwrap();
        clock.step_each_read(0);
        let (frame, _) = ear.heard().pop().unwrap();
        assert_eq!(frame.cause, TickCause::Frame.code());
        let open = frame.possible;
        assert!(open >= BALLS as u64 / 2 - 3, "{open} open");
        for _ in 0..5 {
            clock.advance(HEARTBEAT_NS);
            daemon.round(None).unwrap();
            let (beat, _) = ear.heard().pop().unwrap();
            assert_eq!(beat.cause, TickCause::Heartbeat.code());
            assert_eq!((beat.units, beat.possible), (0, open), "{budget}");
            assert_eq!(beat.budget_units, 0);
        }
        // Stale data decides nothing, and its age is reported.
        clock.advance(TIMEOUT_NS);
        daemon.round(None).unwrap();
        let (late, _) = ear.heard().pop().unwrap();
        assert_eq!((late.units, late.unknown), (0, BALLS as u64));
        assert_eq!(state(&late), State::Unknown);
        assert_ne!(late.reasons & Reason::Stale.bit(), 0);
        // The next frame has units again.
        ear.send(&pairs(BALLS, TOUCHING));
        daemon.round(None).unwrap();
        let (frame, _) = ear.heard().pop().unwrap();
        assert!(frame.units > 0, "{budget}");
    }
}

#[test]
fn bug_in_lockstep_a_frame_behind_one_whose_wait_ends_had_no_units() {
    const BALLS: usize = 20;
    let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
    let scene = scene(MODES[0], BALLS);
    let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let mut ear = Ear::of(&hub, &clock);
    let mut send = |ear: &mut Ear, scene_rev, apart| {
        let info = FrameInfo {
            scene_rev,
            partial: true,
            ..FrameInfo::default()
        };
        let rows = pairs(BALLS, apart);
        ear.client.send(&info, Rows::Poses(&rows)).unwrap();
        daemon.round(None).unwrap();
        ear.heard().pop().unwrap().0
    };
    send(&mut ear, 0, APART);
    send(&mut ear, 99, APART);
    clock.advance(TIMEOUT_NS / 2);
    let waits = send(&mut ear, 0, TOUCHING);
    assert_eq!((waits.sources[0].seq, waits.colliding), (1, 0));
    clock.advance(TIMEOUT_NS / 2);
    daemon.round(None).unwrap();
    let (tick, _) = ear.heard().pop().unwrap();
    assert_eq!(tick.sources[0].seq, 3);
    assert_eq!((tick.possible, tick.colliding), (0, BALLS as u64 / 2));
}

/// A swept pair is checked in the tick in which its motion ends, or never.
#[test]
fn bug_in_lockstep_the_way_of_a_body_of_another_source_whose_frame_had_waited_had_no_units() {
    let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
    let text = format!(
        "[run]\n{}\n[[source]]\nname = \"sim\"\ntimeout_ms = 60000\n[[source]]\nname = \"gun\"\ntimeout_ms = {}\n\
         [[body]]\nname = \"wall\"\nid = 1\nmoves = false\n\
         shape = {{ type = \"box\", half_extents = [0.0005, 2.0, 2.0] }}\n\
         [[body]]\nname = \"bullet\"\nid = 2\nsource = \"gun\"\ncontinuous = true\n\
         shape = {{ type = \"sphere\", radius = 0.004 }}\n",
        MODES[0],
        TIMEOUT_NS / MS
    );
    let scene = Scene::parse(&text, "scene.toml", Path::new(".")).unwrap();
    let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let (mut ear, mut gun) = (Ear::of(&hub, &clock), Ear::by(&hub, &clock, "gun"));
    let mut shoot = |daemon: &mut Daemon<'_>, ear: &mut Ear, scene_rev, x| {
        let info = FrameInfo {
            scene_rev,
            ..FrameInfo::default()
        };
        let bullet = TransformRow {
            body: 2,
            position: [x, 0.0, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        };
        gun.client.send(&info, Rows::Poses(&[bullet])).unwrap();
        ear.send(&[]);
        daemon.round(None).unwrap();
        ear.heard().pop().unwrap().0
    };
    let first = shoot(&mut daemon, &mut ear, 0, -40.0);
    assert_eq!(state(&first), State::Clear);
    shoot(&mut daemon, &mut ear, 99, -40.0);
    clock.advance(TIMEOUT_NS / 2);
    let waits = shoot(&mut daemon, &mut ear, 0, 60.0);
    assert_eq!(state(&waits), State::Clear);
    // The waiting frame before it times out between two frames of the source that leads.
    clock.advance(TIMEOUT_NS / 2);
    daemon.round(None).unwrap();
    let (tick, _) = ear.heard().pop().unwrap();
    assert_ne!(tick.cause, TickCause::Frame.code());
    assert_ne!(tick.reasons & Reason::Swept.bit(), 0);
    assert_eq!(state(&tick), State::Colliding);
}

#[test]
fn bug_in_lockstep_frames_that_waited_together_were_used_up_in_one_tick_and_not_counted() {
    let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
    let scene = scene(MODES[0], 2);
    let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let mut ear = Ear::of(&hub, &clock);
    let mut send = |ear: &mut Ear, scene_rev, apart| {
        let info = FrameInfo {
            scene_rev,
            partial: true,
            ..FrameInfo::default()
        };
        let rows = pairs(2, apart);
        ear.client.send(&info, Rows::Poses(&rows)).unwrap();
        daemon.round(None).unwrap();
        ear.heard().pop().unwrap().0
    };
    send(&mut ear, 0, APART);
    send(&mut ear, 99, APART);
    clock.advance(TIMEOUT_NS / 2);
    send(&mut ear, 0, TOUCHING);
    let last = send(&mut ear, 0, APART);
    assert_eq!((last.sources[0].seq, last.sources[0].skipped), (1, 0));
    clock.advance(TIMEOUT_NS / 2);
    daemon.round(None).unwrap();
    let (tick, _) = ear.heard().pop().unwrap();
    assert_eq!((tick.sources[0].seq, tick.colliding), (4, 0));
    // The third frame had a contact, and no tick used it: the next tick counts it as skipped.
    clock.advance(HEARTBEAT_NS);
    daemon.round(None).unwrap();
    let (tick, _) = ear.heard().pop().unwrap();
    assert_eq!((tick.sources[0].skipped, tick.sources[0].frames), (1, 3));
}

#[test]
fn law_3_8_a_machine_that_was_suspended_wakes_to_a_tick_that_says_its_data_is_old_in_each_mode() {
    const HOUR_NS: u64 = 3_600_000 * MS;
    for mode in MODES {
        let (hub, clock) = (Hub::new(), Arc::new(ManualClock::new(1_000 * MS)));
        let scene = scene(mode, 2);
        let mut door = MemoryServer::open(&hub, 7, HEARTBEAT_NS).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
        let mut ear = Ear::of(&hub, &clock);
        let far = pairs(2, 20.0);
        let mut word = None;
        for _ in 0..20 {
            clock.advance(50 * MS);
            ear.send(&far);
            daemon.round(None).unwrap();
            word = ear.heard().pop().map(|(tick, _)| state(&tick)).or(word);
        }
        assert_eq!(word, Some(State::Clear), "{mode}");
        // CLOCK_BOOTTIME advances while the machine is suspended.
        clock.advance(HOUR_NS);
        daemon.round(None).unwrap();
        let heard = ear.heard();
        let [(tick, _)] = &heard[..] else {
            panic!("{mode}: {} ticks", heard.len())
        };
        assert_eq!((state(tick), tick.unknown), (State::Unknown, 2), "{mode}");
        assert_ne!(tick.reasons & Reason::Stale.bit(), 0, "{mode}");
        // A frame that was sent before the suspension and is received after it makes no body known either.
        clock.advance(10 * MS);
        ear.send(&far);
        clock.advance(HOUR_NS);
        for _ in 0..3 {
            daemon.round(None).unwrap();
            for (tick, _) in ear.heard() {
                assert_eq!(state(&tick), State::Unknown, "{mode}");
            }
            clock.advance(HEARTBEAT_NS);
        }
        // A new frame makes the bodies known.
        ear.send(&far);
        clock.advance(50 * MS);
        daemon.round(None).unwrap();
        let (tick, _) = ear.heard().pop().unwrap();
        assert_eq!(state(&tick), State::Clear, "{mode}");
    }
}
