//! Frames in, results out: lockstep, rounds of two sources, a fixed rate.

use std::time::Instant;

use sweepd::builtin::{Random, pool};
use sweepd::time::{Clock as _, SystemClock};
use sweepd::transport::client::{Client, FrameInfo, Heard, Rows};
use sweepd::wire::{ContactKind, Event, Stage, State, TickCause, Verdict, name_str};

use crate::live::{Desk, SECOND_NS, TWO_SPHERES, at, send, state, step, tick_until, words};

const TWO_SOURCES: &str = r#"
[run]
MODE
[[source]]
name = "left"
timeout_ms = 5000
[[source]]
name = "right"
timeout_ms = 5000
[[body]]
name = "a"
source = "left"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "b"
source = "right"
shape = { type = "sphere", radius = 0.5 }
"#;

#[test]
fn each_step_in_lockstep_has_the_pairs_and_contacts_of_its_own_frame() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let mut touched = false;
    for number in 0..60_u32 {
        // The bodies move through each other, and apart by up to 2 m and back.
        let x = 1.5 - (f64::from(number % 30) / 10.0 - 1.5).abs();
        let x = 2.0 * x + 0.2;
        step(&mut client, &[at(1, 0.0), at(2, x)]);
        let (view, gap_m) = (client.view(), x - 1.0);
        let tick = view.tick();
        assert_eq!(tick.cause, TickCause::Frame.code());
        assert_eq!(tick.sources[0].seq, u64::from(number) + 1);
        let pairs = &view.pairs().expect("listened to").rows;
        let contacts = &view.contacts().expect("listened to").rows;
        if gap_m > 0.0 {
            assert_eq!(state(tick), State::Clear, "{x} {}", words(tick));
            assert!(contacts.is_empty());
        } else {
            let [pair] = &pairs[..] else {
                panic!("{x}: {pairs:?}")
            };
            assert_eq!(state(tick), State::Colliding);
            assert_eq!((pair.body_a, pair.body_b), (1, 2));
            assert_eq!(pair.verdict, Verdict::Colliding.code());
            assert!(pair.gap_min_m <= gap_m && gap_m <= pair.gap_max_m);
            assert!((pair.gap_best_m - gap_m).abs() < 1e-9);
            let begin = pair.events & Event::Begin.bit() != 0;
            assert_eq!(begin, !touched, "{x}");
            let [contact] = &contacts[..] else {
                panic!("{x}: {contacts:?}")
            };
            assert_eq!(contact.kind, ContactKind::Contact.code());
            assert!((contact.gap_m - gap_m).abs() < 1e-6);
            assert!((contact.normal[0] - 1.0).abs() < 1e-6, "from a to b");
            assert!((contact.point_a[0] - 0.5).abs() < 1e-6);
            assert!((contact.point_b[0] - (x - 0.5)).abs() < 1e-6);
        }
        if touched && gap_m > 0.0 {
            let end = pairs.iter().find(|row| row.events & Event::End.bit() != 0);
            assert!(end.is_some(), "{x}: the end is told");
        }
        touched = gap_m <= 0.0;
    }
    let names = &client.view().names().unwrap().rows;
    let names: Vec<_> = names.iter().map(|row| name_str(&row.name)).collect();
    assert_eq!(names, [Some("a"), Some("b")]);
    drop(client);
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
}

#[test]
fn the_time_that_a_frame_leaves_bounds_the_work_of_its_tick() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let hour_ns = 3_600 * SECOND_NS;
    let says = |deadline_ns, time_left_ns| FrameInfo {
        deadline_ns,
        time_left_ns,
        ..FrameInfo::default()
    };
    let mut tick_of = |info: &FrameInfo, place: f64| {
        let mut rows = [at(1, 0.0), at(2, 0.0)];
        rows[1].position = [place; 3];
        client
            .step(info, Rows::Poses(&rows), 30 * SECOND_NS)
            .unwrap();
        *client.view().tick()
    };
    // At the first distance the bodies overlap, which takes work to decide; at the second not even their boxes overlap.
    let (touching, apart) = (0.4, 5.0);
    let late_ns = SystemClock.monotonic_ns() + hour_ns;
    for (late, enough) in [
        (says(1, 0), says(late_ns, 0)),
        (says(0, 1), says(0, hour_ns)),
    ] {
        let tick = tick_of(&late, touching);
        assert!(tick.budget_ns <= 1, "{} ns", tick.budget_ns);
        assert_eq!((tick.units, tick.possible, tick.overrun), (0, 1, 1));
        let tick = tick_of(&enough, touching);
        assert!(tick.budget_ns <= hour_ns, "{} ns", tick.budget_ns);
        assert_eq!((tick.possible, tick.overrun), (0, 0));
        assert_eq!(tick_of(&FrameInfo::default(), apart).possible, 0);
        // A frame without a limit leaves the budget unlimited.
        let tick = tick_of(&FrameInfo::default(), touching);
        assert_eq!((tick.possible, tick.budget_ns), (0, u64::MAX));
        tick_of(&FrameInfo::default(), apart);
    }
}

#[test]
fn a_round_of_two_sources_uses_a_frame_of_each() {
    let desk = Desk::new();
    let _daemon = desk.run(
        &TWO_SOURCES.replace("MODE", "mode = \"on_all\"\nlate_ms = 50"),
        &[],
    );
    let (mut left, mut right) = (desk.source("left"), desk.source("right"));
    // The daemon waits in a round only for sources it knows, so both send once first.
    send(&mut left, &[at(1, 0.0)]);
    send(&mut right, &[at(2, 5.0)]);
    let used = |client: &mut Client, seqs: [u64; 2]| {
        tick_until(client, "both frames", |tick| {
            [tick.sources[0].seq, tick.sources[1].seq] == seqs
        })
    };
    used(&mut left, [1, 1]);
    for number in 1..=20_u32 {
        let x = 0.5 + f64::from(number % 2);
        send(&mut left, &[at(1, 0.0)]);
        send(&mut right, &[at(2, x)]);
        let seq = u64::from(number) + 1;
        // A heartbeat in between does not disturb the current round.
        let tick = used(&mut left, [seq, seq]);
        assert_eq!(tick.cause, TickCause::Frame.code(), "{}", words(&tick));
        let wanted = if x < 1.0 {
            State::Colliding
        } else {
            State::Clear
        };
        assert_eq!(state(&tick), wanted, "{x} {}", words(&tick));
    }
}

#[test]
fn a_rate_makes_ticks_on_the_newest_state() {
    let desk = Desk::new();
    let _daemon = desk.run(&TWO_SOURCES.replace("MODE", "rate = 50"), &[]);
    let (mut left, mut right) = (desk.source("left"), desk.source("right"));
    send(&mut left, &[at(1, 0.0)]);
    send(&mut right, &[at(2, 0.4)]);
    let first = tick_until(&mut left, "the pair", |tick| {
        state(tick) == State::Colliding
    });
    let start = Instant::now();
    let last = tick_until(&mut left, "more ticks", |tick| {
        tick.header.tick >= first.header.tick + 25
    });
    assert!(
        start.elapsed().as_secs_f64() > 0.3,
        "25 ticks at 50 Hz take half a second"
    );
    assert_eq!(first.cause, TickCause::Frame.code());
    assert_eq!(last.sources[0].seq, 1, "the newest state is the old one");
}

#[test]
fn a_rate_beyond_what_the_machine_can_do_still_takes_frames_requests_and_signals() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &["--mode", "rate=100000"]);
    let mut client = desk.source("sim");
    send(&mut client, &[at(1, 0.0), at(2, 0.4)]);
    tick_until(&mut client, "the frame", |tick| {
        state(tick) == State::Colliding
    });
    let answer = client.request(r#"{"edits": [{"reset": {}}]}"#, &[], 30 * SECOND_NS);
    assert!(answer.unwrap().ok);
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
}

#[test]
fn a_reader_that_never_reads_holds_nobody_up() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let sleeper = desk.source("sim");
    let mut reader = desk.client(None);
    assert!(matches!(
        reader.wait_tick(30 * SECOND_NS).unwrap(),
        Heard::Tick
    ));
    // The sleeping client has sent nothing, so it has no session and the source is free.
    let mut client = desk.source("sim");
    for number in 0..200_u32 {
        step(&mut client, &[at(1, 0.0), at(2, f64::from(number))]);
    }
    drop(sleeper);
}

#[test]
fn what_publishing_leaves_of_a_budget_is_used_and_told_in_the_next_tick() {
    let desk = Desk::new();
    let bodies = 1_000;
    let scene = pool(bodies, 5);
    // The duration of the floor depends on the machine; one of these budgets ends during the work above it.
    let used = ["1ms", "3ms", "6ms", "12ms", "25ms", "50ms"]
        .iter()
        .any(|budget| {
            let mut daemon = desk.run(&scene, &["--budget", budget]);
            let mut client = desk.source("feed");
            let mut random = Random::new(7);
            let mut used_ns = 0;
            for _ in 0..60 {
                let mut rows: Vec<_> = (1..=bodies as u64).map(|id| at(id, 0.0)).collect();
                for row in &mut rows {
                    row.position = [0; 3].map(|_| random.range(0.0, 12.6));
                }
                step(&mut client, &rows);
                used_ns += client.view().tick().stage_ns[usize::from(Stage::Rest.code())];
            }
            drop(client);
            assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
            used_ns > 0
        });
    assert!(used);
}
