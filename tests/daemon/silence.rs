//! Silence never counts as safety: no source, killed sources, a pose that never came.

use rustix::process::Signal;
use std::time::{Duration, Instant};

use sweepd::transport::client::{Client, Heard};
use sweepd::wire::{BodyStatus, Reason, State, TickRow};

use crate::live::{Desk, SECOND_NS, at, send, state, tick_until, until, words};

/// Two spheres far apart, each with its own source.
fn scene(mode: &str) -> String {
    let mode = if mode.contains('=') {
        mode.to_owned()
    } else {
        format!("mode = \"{mode}\"")
    };
    let sources =
        ["sim", "arm"].map(|name| format!("[[source]]\nname = \"{name}\"\ntimeout_ms = 800\n"));
    let bodies = [("a", "sim", 0), ("b", "arm", 5)].map(|(name, source, x)| {
        format!(
            "[[body]]\nname = \"{name}\"\nsource = \"{source}\"\nposition = [{x}.0, 0.0, 0.0]\n\
             shape = {{ type = \"sphere\", radius = 0.5 }}\n"
        )
    });
    format!("[run]\n{mode}\n{}{}", sources.concat(), bodies.concat())
}

const MODES: [&str; 3] = ["on_all", "on_frame = \"sim\"", "rate = 20"];
/// Longest time between ticks: the heartbeat of 100 ms, and an allowance for a busy machine.
const GAP_MAX_NS: u64 = 100_000_000 + SECOND_NS;

/// Receives ticks for a while; calls `each` with every tick, and asserts that none is late.
fn listen(client: &mut Client, time: Duration, mut each: impl FnMut(&TickRow)) {
    let (start, mut before_ns, mut ticks) = (Instant::now(), None, 0);
    while start.elapsed() < time {
        if client.wait_tick(5 * SECOND_NS).unwrap() != Heard::Tick {
            panic!("no tick for five seconds");
        }
        let tick = *client.view().tick();
        if let Some(before_ns) = before_ns {
            let gap_ns = tick.sent_ns - before_ns;
            assert!(gap_ns < GAP_MAX_NS, "{} ms", gap_ns / 1_000_000);
        }
        before_ns = Some(tick.sent_ns);
        ticks += 1;
        each(&tick);
    }
    assert!(ticks >= 3, "{ticks} ticks in {time:?}");
}

fn has(tick: &TickRow, reason: Reason) -> bool {
    tick.reasons & reason.bit() != 0
}

#[test]
fn without_a_source_every_mode_beats_and_says_that_nothing_was_received() {
    let desks = MODES.map(|mode| (mode, Desk::new()));
    let _daemons = desks
        .each_ref()
        .map(|(mode, desk)| desk.run(&scene(mode), &[]));
    for (mode, desk) in &desks {
        let mut client = desk.client(None);
        listen(&mut client, Duration::from_millis(900), |tick| {
            assert_eq!(state(tick), State::Unknown, "{mode} {}", words(tick));
            assert!(
                has(tick, Reason::NotReceived) && has(tick, Reason::NoInput),
                "{mode}"
            );
            assert_eq!((tick.unknown, tick.bodies), (2, 2));
        });
    }
}

#[test]
fn when_every_source_is_killed_no_mode_stays_clear() {
    for mode in MODES {
        let desk = Desk::new();
        let _daemon = desk.run(&scene(mode), &[]);
        let path = desk.scene(&scene(mode));
        let feed = |source: &str| {
            let path = path.to_str().unwrap();
            desk.start(
                "feed",
                &[path, "--source", source, "--motion", "rest", "--rate", "50"],
            )
        };
        let mut feeds = [feed("sim"), feed("arm")];
        let mut client = desk.source("nobody");
        tick_until(&mut client, "clear", |tick| state(tick) == State::Clear);
        for feed in &mut feeds {
            feed.kill();
        }
        tick_until(&mut client, "both unknown", |tick| tick.unknown == 2);
        listen(&mut client, Duration::from_millis(700), |tick| {
            assert_ne!(state(tick), State::Clear, "{mode} {}", words(tick));
            assert_eq!(tick.unknown, 2, "{mode} {}", words(tick));
            let told = has(tick, Reason::Stale) || has(tick, Reason::NotReceived);
            assert!(told, "{mode} {}", words(tick));
        });
        let alive = client.view().tick().sources.iter().any(|s| s.alive == 1);
        assert!(!alive, "{mode}");
    }
}

#[test]
fn a_stopped_source_is_stale_at_its_time_out_and_clear_again_when_it_goes_on() {
    let desk = Desk::new();
    let _daemon = desk.run(&scene("on_all"), &[]);
    let path = desk.scene(&scene("on_all"));
    let feed = |source: &str| {
        let path = path.to_str().unwrap();
        desk.start("feed", &[path, "--source", source, "--motion", "rest"])
    };
    let (frozen, _other) = (feed("sim"), feed("arm"));
    let mut client = desk.source("nobody");
    tick_until(&mut client, "clear", |tick| state(tick) == State::Clear);
    frozen.signal(Signal::STOP);
    let tick = tick_until(&mut client, "stale", |tick| has(tick, Reason::Stale));
    assert_ne!(state(&tick), State::Clear);
    until("the body's row", || {
        client.wait_tick(SECOND_NS).unwrap();
        let bodies = client.view().bodies();
        bodies.is_some_and(|b| b.rows[0].status == BodyStatus::Stale.code())
    });
    frozen.signal(Signal::CONT);
    tick_until(&mut client, "clear again", |tick| {
        state(tick) == State::Clear
    });
}

#[test]
fn a_pose_that_never_came_is_never_clear_in_any_mode() {
    for mode in MODES {
        let desk = Desk::new();
        let _daemon = desk.run(&scene(mode), &[]);
        let mut client = desk.source("sim");
        let mut sent = 0_u64;
        listen(&mut desk.client(None), Duration::from_millis(700), |tick| {
            send(&mut client, &[at(1, 0.0)]);
            sent += 1;
            assert_eq!(state(tick), State::Unknown, "{mode} {}", words(tick));
            assert!(has(tick, Reason::NotReceived), "{mode} {}", words(tick));
        });
        let tick = tick_until(&mut client, "a alone is known", |tick| tick.unknown == 1);
        assert!(tick.sources[0].frames > 0 && tick.sources[1].frames == 0);
    }
}
