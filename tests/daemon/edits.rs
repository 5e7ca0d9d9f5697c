//! Scene edits of a running daemon, over the request service.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use sweepd::transport::client::{Client, FrameInfo, Heard, Rows};
use sweepd::wire::{
    Answer, BodyStatus, EndCause, Event, PairRow, Reason, State, TickCause, TickRow,
};

use crate::live::{Desk, SECOND_NS, TWO_SPHERES, at, send, state, step, tick_until, words};

fn ask(client: &mut Client, edits: &str) -> Answer {
    let json = format!("{{\"edits\": [{edits}]}}");
    client.request(&json, &[], 30 * SECOND_NS).unwrap()
}

/// Applies the edits; returns the scene revision.
pub(crate) fn done(client: &mut Client, edits: &str) -> u64 {
    let answer = ask(client, edits);
    assert!(answer.ok, "{answer:?}");
    answer.scene_rev
}

/// The end cause in the rows of pairs up to this revision.
fn end_by(client: &mut Client, rev: u64) -> Option<EndCause> {
    let mut cause = None;
    loop {
        let tick = *client.view().tick();
        let rows = client.view().pairs().map(|pairs| pairs.rows.clone());
        let ended = |row: &PairRow| row.events & Event::End.bit() != 0;
        for row in rows.iter().flatten().filter(|row| ended(row)) {
            cause = EndCause::ALL
                .iter()
                .copied()
                .find(|c| c.code() == row.end_cause);
        }
        if tick.header.scene_rev >= rev {
            assert_eq!(tick.cause, TickCause::Edit.code(), "{}", words(&tick));
            return cause;
        }
        assert_eq!(client.wait_tick(30 * SECOND_NS).unwrap(), Heard::Tick);
    }
}

#[test]
fn each_edit_is_done_in_a_tick_of_its_own_cause_and_ends_pairs_by_its_cause() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let touching = [at(1, 0.0), at(2, 0.5)];
    let sphere = r#"{ "put": { "name": "b", "source": "sim", "shape": { "type": "sphere", "radius": 0.5 } } }"#;
    let cases = [
        (
            r#"{"enable": {"body": "b", "enabled": false}}"#,
            EndCause::Disabled,
            r#"{"enable": {"body": "b", "enabled": true}}"#,
        ),
        (
            r#"{"filter": {"body": "b", "mask": 2}}"#,
            EndCause::Filtered,
            r#"{"filter": {"body": "b", "mask": 4294967295}}"#,
        ),
        (
            r#"{"rule": {"action": "ignore", "a": "a", "b": "b", "reason": "glued"}}"#,
            EndCause::Filtered,
            r#"{"drop_rules": {"a": "b", "b": "a"}}"#,
        ),
        (r#"{"reset": {"source": "sim"}}"#, EndCause::Reset, ""),
        (r#"{"remove": "b"}"#, EndCause::Removed, sphere),
    ];
    for (edit, cause, back) in cases {
        step(&mut client, &touching);
        assert_eq!(state(client.view().tick()), State::Colliding, "{edit}");
        let before = client.view().tick().header.scene_rev;
        let rev = done(&mut client, edit);
        assert!(rev > before, "{edit}");
        assert_eq!(end_by(&mut client, rev), Some(cause), "{edit}");
        assert_ne!(state(client.view().tick()), State::Colliding, "{edit}");
        if !back.is_empty() {
            done(&mut client, back);
        }
    }
    step(&mut client, &touching);
    assert_eq!(
        state(client.view().tick()),
        State::Colliding,
        "all is as before"
    );
}

/// In lockstep, ticks caused by edits do no work; this one does, because it is also the result of a frame.
#[test]
fn a_frame_that_waited_for_an_edit_has_its_result_worked_out() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    let info = FrameInfo {
        scene_rev: client.view().tick().header.scene_rev + 1,
        ..FrameInfo::default()
    };
    let frame = client
        .send(&info, Rows::Poses(&[at(1, 0.0), at(2, 0.5)]))
        .unwrap();
    done(
        &mut client,
        r#"{"margin": {"body": "b", "report_within_m": 0.1}}"#,
    );
    let is_its_result = |tick: &TickRow| tick.sources[0].seq == frame.seq;
    let result = tick_until(&mut client, "its result", is_its_result);
    assert_eq!(result.cause, TickCause::Edit.code(), "{}", words(&result));
    assert_eq!(state(&result), State::Colliding, "{}", words(&result));
}

#[test]
fn a_request_is_done_whole_or_not_at_all_and_says_what_is_wrong() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let rev = client.view().tick().header.scene_rev;
    let first = r#"{"enable": {"body": "a", "enabled": false}}, "#;
    for (edit, told) in [
        (r#"{"remove": "nobody"}"#, "nobody"),
        (r#"{"attach": {"body": "b", "to": "ghost"}}"#, "ghost"),
        (r#"{"reset": {"source": "siim"}}"#, "siim"),
        (
            r#"{"put": {"name": "c", "source": "arm", "shape": {"type": "sphere", "radius": 1}}}"#,
            "arm",
        ),
        (
            r#"{"put": {"name": "c", "shape": {"type": "sphere", "radius": -1}}}"#,
            "radius",
        ),
        (
            r#"{"put": {"name": "c", "moves": false, "shape": {"type": "trimesh",
            "vertices_blob": {"offset": 0, "count": 3}, "faces_blob": {"offset": 72, "count": 1}}}}"#,
            "\"c\"",
        ),
        (
            r#"{"put": {"name": "c", "moves": false, "shape": {"type": "trimesh", "file": "none.stl"}}}"#,
            "none.stl",
        ),
        (r#"{"remuve": "a"}"#, "remove"),
        ("7", "edit 2"),
    ] {
        let answer = ask(&mut client, &format!("{first}{edit}"));
        let error = answer.error.clone().unwrap_or_default();
        assert!(!answer.ok && error.contains(told), "{edit}: {answer:?}");
    }
    for rubbish in [
        "",
        "{",
        "[]",
        "{\"edits\": []}",
        "{\"edits\": 3}",
        "\u{0}\u{1}",
    ] {
        let answer = client.request(rubbish, &[], 30 * SECOND_NS).unwrap();
        assert!(
            !answer.ok && answer.error.is_some(),
            "{rubbish}: {answer:?}"
        );
    }
    step(&mut client, &[at(1, 0.0), at(2, 0.4)]);
    assert_eq!(
        client.view().tick().header.scene_rev,
        rev,
        "nothing was done"
    );
    assert_eq!(state(client.view().tick()), State::Colliding);
}

#[test]
fn a_body_put_while_it_runs_takes_part_once_its_pose_has_come() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    let put = r#"{"put": {"name": "c", "source": "sim", "shape": {"type": "box", "half_extents": [0.5, 0.5, 0.5]}}}"#;
    let rev = done(&mut client, put);
    tick_until(&mut client, "the edit", |tick| tick.header.scene_rev >= rev);
    let tick = client.view().tick();
    assert_eq!(
        (state(tick), tick.bodies, tick.unknown),
        (State::Unknown, 3, 1)
    );
    assert!(tick.reasons & Reason::NotReceived.bit() != 0);
    let names = &client.view().names().unwrap().rows;
    assert_eq!((names.len(), names[2].body), (3, 3), "its id is told");
    assert_eq!(
        done(&mut client, put),
        rev,
        "the same again changes nothing"
    );
    step(&mut client, &[at(1, 0.0), at(2, 5.0), at(3, 5.8)]);
    assert_eq!(state(client.view().tick()), State::Colliding);
    // Attached to `a`, body `c` moves with `a`; rows for `c` itself would be refused.
    done(
        &mut client,
        r#"{"attach": {"body": "c", "to": "a", "position": [0, 3, 0]}}"#,
    );
    step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    assert_eq!(
        state(client.view().tick()),
        State::Clear,
        "{}",
        words(client.view().tick())
    );
    let bodies = &client.view().bodies().unwrap().rows;
    assert_eq!(bodies[2].position, [0.0, 3.0, 0.0]);
    assert_eq!(bodies[2].status, BodyStatus::Known.code());
}

/// A ball of `n * n * 2` triangles as binary vertices and faces.
fn ball(n: u32) -> (Vec<u8>, Vec<u8>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let mut corner = |u: f64, v: f64| {
        let p = [v.sin() * u.cos(), v.sin() * u.sin(), v.cos()];
        vertices.extend(p.iter().flat_map(|x| x.to_le_bytes()));
    };
    let step = std::f64::consts::PI / f64::from(n);
    corner(0.0, 0.0);
    for row in 1..n {
        for column in 0..n {
            corner(f64::from(column) * 2.0 * step, f64::from(row) * step);
        }
    }
    corner(0.0, std::f64::consts::PI);
    let last = (n - 1) * n + 1;
    let of = |row: u32, column: u32| 1 + (row - 1) * n + column % n;
    let mut face = |f: [u32; 3]| faces.extend(f.iter().flat_map(|k| k.to_le_bytes()));
    for column in 0..n {
        face([0, of(1, column), of(1, column + 1)]);
        face([last, of(n - 1, column + 1), of(n - 1, column)]);
        for row in 1..n - 1 {
            let [a, b, c, d] = [
                of(row, column),
                of(row + 1, column),
                of(row + 1, column + 1),
                of(row, column + 1),
            ];
            face([a, b, c]);
            face([a, c, d]);
        }
    }
    (vertices, faces)
}

fn put_ball(n: u32, at_x: f64) -> (String, Vec<u8>, Vec<u8>) {
    let (vertices, faces) = ball(n);
    let (points, triangles) = (vertices.len() / 24, faces.len() / 12);
    let mut json = String::new();
    let _ = write!(
        json,
        r#"{{"edits": [{{"put": {{"name": "ball", "moves": false, "position": [{at_x}, 0, 0], "shape": {{
        "type": "trimesh", "vertices_blob": {{"offset": 0, "count": {points}}},
        "faces_blob": {{"offset": {}, "count": {triangles}}} }} }} }}]}}"#,
        vertices.len()
    );
    (json, vertices, faces)
}

#[test]
fn a_mesh_put_by_blobs_collides_as_a_solid() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let (json, vertices, faces) = put_ball(24, 3.0);
    let answer = client
        .request(&json, &[&vertices, &faces], 30 * SECOND_NS)
        .unwrap();
    assert!(answer.ok, "{answer:?}");
    step(&mut client, &[at(1, 0.0), at(2, 1.4)]);
    assert_eq!(
        state(client.view().tick()),
        State::Clear,
        "{}",
        words(client.view().tick())
    );
    for inside_m in [1.7, 3.0] {
        step(&mut client, &[at(1, 0.0), at(2, inside_m)]);
        assert_eq!(state(client.view().tick()), State::Colliding, "{inside_m}");
        assert_eq!(client.view().tick().worst_a, 2);
    }
}

#[test]
fn a_shape_that_takes_long_to_build_does_not_stop_the_ticks() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let instance = desk.instance.clone();
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    let asker = std::thread::spawn(move || {
        let mut asker = Client::connect(&instance, None, 30 * SECOND_NS).unwrap();
        let (json, vertices, faces) = put_ball(400, 20.0);
        let start = Instant::now();
        let answer = asker
            .request(&json, &[&vertices, &faces], 60 * SECOND_NS)
            .unwrap();
        (answer, start.elapsed())
    });
    let (first, mut frames) = (client.view().tick().header.tick, 0);
    while !asker.is_finished() {
        step(
            &mut client,
            &[at(1, 0.0), at(2, 5.0 + f64::from(frames) * 1e-6)],
        );
        frames += 1;
    }
    let (answer, time) = asker.join().unwrap();
    assert!(answer.ok, "{answer:?}");
    let ticks = client.view().tick().header.tick - first;
    println!("{ticks} ticks, {frames} of them for frames, in the {time:?} of the request");
    // A bound far below the usual number of frames; there would be none if the tick thread built the mesh.
    assert!(
        f64::from(frames) > time.as_secs_f64() * 5.0,
        "{frames} in {time:?}"
    );
    // A build that is still running does not delay the end of the daemon.
    let (json, vertices, faces) = put_ball(401, 20.0);
    let mut hasty = desk.client(None);
    assert!(
        hasty
            .request(&json, &[&vertices, &faces], 1_000_000)
            .is_err()
    );
    send(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    let (status, time) = daemon.stop();
    assert_eq!(status.code(), Some(0), "{}", daemon.stderr());
    assert!(time.as_secs_f64() < 2.0, "{time:?}");
}

#[test]
fn bug_questions_do_not_wait_for_the_mesh_of_another_client() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let instance = desk.instance.clone();
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
    let (json, vertices, faces) = put_ball(400, 20.0);
    let putter = std::thread::spawn(move || {
        let mut putter = Client::connect(&instance, None, 30 * SECOND_NS).unwrap();
        let start = Instant::now();
        let blobs: [&[u8]; 2] = [&vertices, &faces];
        let answer = putter.request(&json, &blobs, 60 * SECOND_NS).unwrap();
        assert!(answer.ok, "{answer:?}");
        start.elapsed()
    });
    let brings =
        r#"{"touching": {"shape": {"type": "sphere", "radius": 4.6}, "position": [0, 0, 0]}}"#;
    let (mut longest, mut asked) = (Duration::ZERO, 0);
    while !putter.is_finished() {
        step(&mut client, &[at(1, 0.0), at(2, 5.0)]);
        for question in [r#"{"gap": {"a": "a", "b": "b"}}"#, brings] {
            let start = Instant::now();
            let answer = client.request(question, &[], 60 * SECOND_NS).unwrap();
            assert!(answer.ok, "{answer:?}");
            longest = longest.max(start.elapsed());
            asked += 1;
        }
    }
    // A question that waited for the mesh would take nearly as long as the mesh: seconds, where milliseconds are usual.
    let mesh = putter.join().unwrap();
    println!("{asked} questions, the longest {longest:?}, in {mesh:?}");
    assert!(longest < mesh / 2, "{longest:?} of {mesh:?}");
}

#[test]
fn a_client_can_ask_for_a_check_of_every_structure_while_its_pairs_go_on() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let answer = client
        .request(r#"{"validate": true}"#, &[], 30 * SECOND_NS)
        .unwrap();
    assert!(answer.ok && answer.warnings.is_empty(), "{answer:?}");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    assert_eq!(state(client.view().tick()), State::Colliding);
    assert_eq!(client.view().tick().rebuilds, 0);
}

#[test]
fn a_margin_set_at_run_time_tells_pairs_as_near() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    // Two balls of radius 0.5 m, 0.5 m apart.
    let apart = [at(1, 0.0), at(2, 1.5)];
    step(&mut client, &apart);
    assert_eq!(state(client.view().tick()), State::Clear);
    for (edit, wanted) in [
        (
            r#"{"margin": {"body": "b", "report_within_m": 0.6}}"#,
            State::Near,
        ),
        (r#"{"margin": {"body": "b"}}"#, State::Clear),
        (r#"{"margin": {"report_within_m": 0.6}}"#, State::Near),
        (r#"{"margin": {}}"#, State::Clear),
    ] {
        done(&mut client, edit);
        step(&mut client, &apart);
        assert_eq!(state(client.view().tick()), wanted, "{edit}");
    }
}
