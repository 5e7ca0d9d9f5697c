//! `sweepd feed` as a source: which bodies it moves, how fast, and its behaviour without a daemon.

use std::collections::BTreeMap;

use rustix::process::Signal;
use sweepd::transport::client::{Client, Heard};
use sweepd::wire::{State, TickCause, name_str};

use super::{code, err};
use crate::live::{Desk, SECOND_NS, TWO_SPHERES, output, state, tick_until, until};

/// Writes a scene of `count` bodies with the command itself; returns its path.
fn pool(desk: &Desk, count: &str) -> String {
    let path = desk.dir.join("pool.toml").to_str().unwrap().to_owned();
    let ended = output(&["feed", "--write-scene", &path, "--count", count, "--force"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert_eq!(code(&output(&["check", &path])), Some(0));
    path
}

/// Positions of all bodies by id, from the newest tick with bodies.
fn places(client: &mut Client) -> BTreeMap<u64, [f64; 3]> {
    loop {
        assert_eq!(client.wait_tick(30 * SECOND_NS).unwrap(), Heard::Tick);
        if let Some(bodies) = client.view().bodies() {
            return bodies
                .rows
                .iter()
                .map(|row| (row.body, row.position))
                .collect();
        }
    }
}

#[test]
fn bug_a_scene_of_more_bodies_than_there_may_be_was_begun() {
    let desk = Desk::new();
    let path = desk.dir.join("many.toml").to_str().unwrap().to_owned();
    let ended = output(&["feed", "--write-scene", &path, "--count", "99999999999"]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    assert!(
        err(&ended).contains("at most 1048576 bodies"),
        "{}",
        err(&ended)
    );
}

#[test]
fn without_a_daemon_it_ends_with_code_3_after_its_wait() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let scene = scene.to_str().unwrap();
    let ended = output(&[
        "feed",
        scene,
        "--wait",
        "300ms",
        "--instance",
        &desk.instance,
    ]);
    assert_eq!(code(&ended), Some(3));
    assert!(err(&ended).contains("sweepd run"), "{}", err(&ended));
    for bad in [
        ["--rate", "0"],
        ["--rate", "nan"],
        ["--motion", "fly"],
        ["--wait", "3"],
        ["--work", "3ms..2ms"],
    ] {
        let ended = output(&["feed", scene, bad[0], bad[1]]);
        assert_eq!(code(&ended), Some(2), "{bad:?} {}", err(&ended));
    }
}

#[test]
fn bug_a_scene_that_is_there_is_not_written_over_and_flags_that_say_nothing_are_refused() {
    let desk = Desk::new();
    let path = pool(&desk, "12");
    let kept = std::fs::read(&path).unwrap();
    let write = |more: &[&str]| {
        let mut args = vec!["feed", "--write-scene", &path, "--count", "5"];
        args.extend_from_slice(more);
        output(&args)
    };
    let ended = write(&[]);
    assert_eq!(code(&ended), Some(4), "{}", err(&ended));
    assert!(err(&ended).contains("--force"), "{}", err(&ended));
    for more in [
        &["--rate", "50"][..],
        &["--frames", "9"],
        &["--work", "1ms..2ms"],
        &["--source", "feed"],
        &[&path],
    ] {
        let ended = write(&[more, &["--force"]].concat());
        assert_eq!(code(&ended), Some(2), "{more:?}: {}", err(&ended));
    }
    for more in [&["--kind", "pile"][..], &["--force"]] {
        let ended = output(&[&["feed", &path, "--wait", "100ms"], more].concat());
        assert_eq!(code(&ended), Some(2), "{more:?}: {}", err(&ended));
    }
    assert_eq!(std::fs::read(&path).unwrap(), kept);
    let ended = write(&["--kind", "pile", "--seed", "3", "--force"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert_ne!(std::fs::read(&path).unwrap(), kept);
}

#[test]
fn it_sends_so_many_frames_and_moves_so_many_bodies_the_same_for_a_seed() {
    let desk = Desk::new();
    let path = pool(&desk, "12");
    let mut ends = Vec::new();
    for seed in ["7", "7", "8"] {
        let _daemon = desk.start("run", &[&path, "--mode", "on_frame=feed"]);
        let mut client = desk.source("nobody");
        let args = [
            path.as_str(),
            "--count",
            "5",
            "--seed",
            seed,
            "--rate",
            "200",
            "--frames",
            "40",
        ];
        let mut feed = desk.start("feed", &args);
        let first = tick_until(&mut client, "a frame", |tick| tick.sources[0].seq >= 1);
        assert!(first.sources[0].seq < 40);
        let start = places(&mut client);
        tick_until(&mut client, "the last frame", |tick| {
            tick.sources[0].seq == 40
        });
        let end = places(&mut client);
        assert_eq!(feed.end().0.code(), Some(0), "{}", feed.stderr());
        for (id, place) in &end {
            let moved = place
                .iter()
                .zip(&start[id])
                .any(|(x, y)| x.to_bits() != y.to_bits());
            assert_eq!(moved, *id <= 5, "body {id} of seed {seed}");
        }
        ends.push(end);
    }
    assert_eq!(ends[0], ends[1], "one seed, one motion");
    assert_ne!(ends[0], ends[2]);
}

#[test]
fn bug_frames_of_which_none_was_used_are_no_good_end() {
    let desk = Desk::new();
    let path = pool(&desk, "12");
    let _daemon = desk.start("run", &[&path]);
    let mut client = desk.source("nobody");
    let _first = desk.start("feed", &[&path, "--rate", "100"]);
    tick_until(&mut client, "the first feed", |tick| {
        tick.sources[0].seq >= 1
    });
    let mut second = desk.start("feed", &[&path, "--rate", "100", "--frames", "20"]);
    assert_eq!(second.end().0.code(), Some(4), "{}", second.stderr());
    let said = second.stderr();
    assert!(said.contains("used none of the 20 frames"), "{said}");
}

#[test]
fn with_work_of_its_own_it_leaves_the_rest_of_each_frame_to_the_daemon_and_tells_how_that_went() {
    let desk = Desk::new();
    let path = pool(&desk, "12");
    let _daemon = desk.start("run", &[&path, "--mode", "on_frame=feed"]);
    let mut reader = desk.client(None);
    let args = [
        path.as_str(),
        "--rate",
        "20",
        "--work",
        "1ms..3ms",
        "--frames",
        "40",
    ];
    let mut feed = desk.start("feed", &args);
    let mut given_ns = Vec::new();
    tick_until(&mut reader, "the last frame", |tick| {
        if tick.cause == TickCause::Frame.code() {
            given_ns.push(tick.budget_ns);
        }
        tick.sources[0].seq == 40
    });
    assert_eq!(feed.end().0.code(), Some(0), "{}", feed.stderr());
    // A daemon without a budget of its own has the time that the frame leaves, and no more.
    assert!(!given_ns.is_empty());
    assert!(given_ns.iter().all(|ns| *ns < 49_000_000), "{given_ns:?}");
    let text = feed.stdout();
    let figures = |name: &str| -> Vec<f64> {
        let line = text.lines().find(|line| line.contains(name)).unwrap();
        let (_, after) = line.split_once(name).unwrap();
        after
            .split_whitespace()
            .map(|f| f.parse().unwrap())
            .collect()
    };
    let work = figures("the source's own work");
    assert!(1.0 <= work[0] && work[3] <= 3.0, "{text}");
    // The time left is reported; it is never more than the frame without the work.
    assert!(figures("left for the tick")[3] < 49.0, "{text}");
    assert!(figures("until the result was there")[0] >= 1.0, "{text}");
    let count = |what: &str| -> usize {
        let (before, _) = text.split_once(what).unwrap();
        let last = before.split_whitespace().next_back();
        last.unwrap().parse().unwrap()
    };
    // The work is short compared with the frame, and nearly all of it is left for the tick. So a result is late or cut
    // short only when other load takes the cores, which is rare (0 or 1 of 40 with 4 busy processes on 2 cores).
    assert!(count(" of 40 frames over 50.0 ms") <= 8, "{text}");
    assert!(count(" stopped with pairs undecided") <= 8, "{text}");
    assert!(text.contains("; 0 without a result"), "{text}");
}

#[test]
fn with_work_of_its_own_a_feed_of_which_no_frame_had_a_result_is_no_good_end_and_one_result_is_enough()
 {
    let desk = Desk::new();
    let path = pool(&desk, "12");
    let _daemon = desk.start("run", &[&path]);
    let mut client = desk.source("nobody");
    let mut first = desk.start("feed", &[&path, "--rate", "100"]);
    tick_until(&mut client, "the first feed", |tick| {
        tick.sources[0].seq >= 1
    });
    let work = |frames: &str| {
        let args = ["--rate", "20", "--work", "1ms..2ms", "--frames", frames];
        desk.start("feed", &[&[path.as_str()], &args[..]].concat())
    };
    // Each frame waits one second for its result.
    let mut second = work("2");
    assert_eq!(second.end().0.code(), Some(4), "{}", second.stderr());
    let said = second.stderr();
    assert!(said.contains("none of 2 frames had a result"), "{said}");
    assert!(
        said.contains("source_taken"),
        "the warnings say why: {said}"
    );
    assert!(
        second.stdout().contains("0 of 0 frames over"),
        "{}",
        second.stdout()
    );
    // The source becomes free while the next feed runs.
    let mut third = work("12");
    until("told", || third.stderr().contains("source_taken"));
    assert_eq!(first.stop().0.code(), Some(0));
    assert_eq!(third.end().0.code(), Some(0), "{}", third.stderr());
}

#[test]
fn a_signal_ends_it_with_code_0_also_while_it_waits_for_a_daemon() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let scene = scene.to_str().unwrap();
    for signal in [Signal::INT, Signal::TERM] {
        let mut waiting = desk.start("feed", &[scene, "--wait", "60s"]);
        std::thread::sleep(std::time::Duration::from_millis(300));
        waiting.signal(signal);
        assert_eq!(waiting.end().0.code(), Some(0), "{}", waiting.stderr());
    }
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut reader = desk.client(None);
    for signal in [Signal::INT, Signal::TERM] {
        // At one frame per second, and with its own work: the signal must end its long sleeps too.
        for more in [
            &["--rate", "1"][..],
            &["--rate", "20", "--work", "5ms..10ms"],
        ] {
            let mut feed = desk.start("feed", &[&[scene], more].concat());
            tick_until(&mut reader, "its frames", |tick| tick.sources[0].alive == 1);
            feed.signal(signal);
            assert_eq!(feed.end().0.code(), Some(0), "{}", feed.stderr());
            tick_until(&mut reader, "its end", |tick| tick.sources[0].alive == 0);
        }
    }
    drop(reader);
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn at_rest_it_keeps_bodies_known_and_nothing_moves() {
    let desk = Desk::new();
    let path = pool(&desk, "10");
    let _daemon = desk.start("run", &[&path]);
    let _feed = desk.start("feed", &[&path, "--motion", "rest", "--rate", "50"]);
    let mut client = desk.source("nobody");
    tick_until(&mut client, "all known", |tick| tick.unknown == 0);
    let start = places(&mut client);
    let seq = client.view().tick().sources[0].seq;
    tick_until(&mut client, "more frames", |tick| {
        tick.sources[0].seq > seq + 20
    });
    assert_eq!(places(&mut client), start);
}

#[test]
fn a_feed_started_first_waits_and_one_that_runs_goes_on_over_a_restart() {
    let desk = Desk::new();
    let path = pool(&desk, "10");
    let mut feed = desk.start("feed", &[&path, "--wait", "60s"]);
    std::thread::sleep(std::time::Duration::from_millis(400));
    assert_eq!(feed.ended(), None, "{}", feed.stderr());
    let mut daemon = desk.start("run", &[&path]);
    let mut client = desk.source("nobody");
    // The feed reads the daemon's ticks once a second.
    let boot = tick_until(&mut client, "frames", |tick| tick.sources[0].frames > 150)
        .header
        .boot_id;
    daemon.kill();
    // The feed has noticed that there is no daemon.
    until("told", || feed.stderr().contains("no tick since"));
    assert_eq!(feed.ended(), None, "{}", feed.stderr());
    let _next = desk.start("run", &[&path]);
    let tick = tick_until(&mut client, "frames of the next", |tick| {
        tick.header.boot_id != boot && tick.sources[0].frames > 5
    });
    assert_ne!(state(&tick), State::Unknown);
    until("the restart told", || {
        feed.stderr().contains("the daemon restarted")
    });
    let (status, _) = feed.stop();
    assert_eq!(status.code(), Some(0), "{}", feed.stderr());
}

#[test]
fn a_second_feed_of_the_same_source_is_told_that_it_is_not_used() {
    let desk = Desk::new();
    let path = pool(&desk, "10");
    let _daemon = desk.start("run", &[&path]);
    let _first = desk.start("feed", &[&path]);
    let mut client = desk.client(None);
    tick_until(&mut client, "frames", |tick| tick.sources[0].frames > 5);
    let second = desk.start("feed", &[&path]);
    until("told", || second.stderr().contains("source_taken"));
}

#[test]
fn what_is_refused_of_a_body_that_an_edit_has_removed_is_told() {
    let desk = Desk::new();
    let path = pool(&desk, "10");
    let _daemon = desk.start("run", &[&path]);
    let mut feed = desk.start("feed", &[&path]);
    let mut client = desk.source("nobody");
    tick_until(&mut client, "frames", |tick| tick.sources[0].frames > 5);
    until("names", || {
        client.wait_tick(SECOND_NS).unwrap();
        client.view().names().is_some()
    });
    let row = client.view().names().unwrap().rows[4];
    let (id, name) = (row.body, name_str(&row.name).unwrap());
    let edit = format!(r#"{{"edits": [{{"remove": "{name}"}}]}}"#);
    assert!(client.request(&edit, &[], 30 * SECOND_NS).unwrap().ok);
    until("told", || feed.stderr().contains("unknown_body"));
    assert_eq!(feed.ended(), None, "{}", feed.stderr());
    // The id stays reserved for its name in this boot, so no other body can be moved in its place.
    let edit = format!(
        r#"{{"edits": [{{"put": {{"name": "another", "source": "feed", "id": {id},
        "shape": {{"type": "sphere", "radius": 0.1}}}}}}]}}"#
    );
    let answer = client.request(&edit, &[], 30 * SECOND_NS).unwrap();
    assert!(!answer.ok, "{answer:?}");
}

#[test]
fn bug_a_feed_of_another_scene_moved_the_bodies_that_had_its_ids() {
    let desk = Desk::new();
    let swapped = TWO_SPHERES
        .replace("\"a\"", "\"c\"")
        .replace("\"b\"", "\"a\"");
    let other = desk.write("other.toml", &swapped);
    let other = other.to_str().unwrap();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("nobody");
    for more in [
        &["--frames", "5"][..],
        &["--frames", "5", "--rate", "20", "--work", "1ms..2ms"],
    ] {
        let mut feed = desk.start("feed", &[&[other], more].concat());
        assert_eq!(feed.end().0.code(), Some(4), "{}", feed.stderr());
        let said = feed.stderr();
        for word in [
            "other.toml",
            "of the 2 bodies to be sent 2 are",
            "id 1 is \"c\" in the file and \"a\" in the daemon",
        ] {
            assert!(said.contains(word), "{word}: {said}");
        }
    }
    tick_until(&mut client, "a tick after them", |_| true);
    let source = client.view().tick().sources[0];
    assert_eq!((source.frames, source.refused), (0, 0), "nothing was sent");
    // A running feed ends when the next daemon has another scene.
    let scene = desk.dir.join("scene.toml");
    let mut feed = desk.start("feed", &[scene.to_str().unwrap(), "--rate", "50"]);
    tick_until(&mut client, "frames", |tick| tick.sources[0].frames > 5);
    daemon.kill();
    let _next = desk.run(&swapped, &[]);
    assert_eq!(feed.end().0.code(), Some(4), "{}", feed.stderr());
    assert!(
        feed.stderr().contains("runs another scene"),
        "{}",
        feed.stderr()
    );
    tick_until(&mut client, "the next one's ticks", |tick| {
        tick.header.boot_id != 0 && tick.header.tick > 3
    });
    assert_eq!(client.view().tick().sources[0].frames, 0);
}

#[test]
fn the_next_feed_after_a_killed_one_is_used_without_a_restart_of_the_daemon() {
    let desk = Desk::new();
    let path = pool(&desk, "10");
    let _daemon = desk.start("run", &[&path]);
    let mut client = desk.client(None);
    for _ in 0..3 {
        let mut feed = desk.start("feed", &[&path]);
        let before = client.view().tick().sources[0];
        tick_until(&mut client, "its session", |tick| {
            let now = tick.sources[0];
            now.session != before.session && now.frames > before.frames + 3
        });
        feed.kill();
    }
}
