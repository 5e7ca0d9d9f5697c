//! Clients that send wrong values in every field: they are refused, counted and reported, and no other client loses
//! data.

use sweepd::limits::FRAME_ROWS_MAX;
use sweepd::time::{Clock, SystemClock};
use sweepd::transport::client::{Client, Link, Rows};
use sweepd::transport::iceoryx::{IoxLink, Place};
use sweepd::wire::{
    BodyStatus, FrameHeader, Reason, RejectReason, State, TransformRow, WIRE_VERSION, frame_flags,
    name_bytes,
};

use crate::live::{
    Desk, Running, SECOND_NS, TWO_SPHERES, at, rejected, send, state, step, tick_until, until,
    words,
};

/// Bodies `a` (1) and `c` (3) of source `sim`, `b` (2) of source `arm`, at a fixed rate.
const SCENE: &str = r#"
[run]
rate = 100
[[source]]
name = "sim"
timeout_ms = 3000
[[source]]
name = "arm"
timeout_ms = 3000
[[body]]
name = "a"
source = "sim"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "b"
source = "arm"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "c"
source = "sim"
shape = { type = "sphere", radius = 0.5 }
"#;

/// A change of one header.
type Change = fn(&mut FrameHeader);

/// A client of `sim` that sets every field of its header by hand.
struct Raw {
    link: IoxLink,
    header: FrameHeader,
}

impl Raw {
    fn new(desk: &Desk) -> Self {
        let clock = SystemClock;
        let place = Place::new(&desk.instance).unwrap();
        let until_ns = clock.monotonic_ns() + 30 * SECOND_NS;
        Self {
            link: IoxLink::open(&place, &clock, until_ns).unwrap(),
            header: FrameHeader {
                session: 77,
                source: name_bytes("sim"),
                flags: frame_flags::FULL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            },
        }
    }

    /// Sends the next frame, with its header changed for this frame only.
    fn send(&mut self, rows: &[TransformRow], change: impl FnOnce(&mut FrameHeader)) {
        self.header.seq += 1;
        let mut header = self.header;
        change(&mut header);
        self.link.send(&header, Rows::Poses(rows)).unwrap();
    }
}

/// A daemon, a correct client of `arm` that subscribes to everything, and a raw one of `sim`; all bodies known, all
/// apart.
fn table(desk: &Desk) -> (Running, Client, Raw) {
    let daemon = desk.run(SCENE, &[]);
    let mut arm = desk.source("arm");
    let mut raw = Raw::new(desk);
    raw.send(&good(), |_| {});
    send(&mut arm, &[at(2, 5.0)]);
    tick_until(&mut arm, "clear", |tick| state(tick) == State::Clear);
    (daemon, arm, raw)
}

fn good() -> [TransformRow; 2] {
    [at(1, 0.0), at(3, 10.0)]
}

#[test]
fn a_bad_pose_makes_its_own_body_unknown_until_a_good_one_comes_and_no_other() {
    let desk = Desk::new();
    let (_daemon, mut arm, mut raw) = table(&desk);
    let mut nan = at(1, f64::NAN);
    nan.orientation = [0.0, 0.0, 0.0, 1.0];
    let mut flat = at(1, 0.0);
    flat.orientation = [0.0; 4];
    for (row, reason) in [
        (nan, RejectReason::NotFinite),
        (flat, RejectReason::BadQuaternion),
        (at(1, 1e13), RejectReason::OverLimit),
    ] {
        let before = rejected(arm.view().tick(), reason);
        raw.send(&[row, at(3, 11.0)], |_| {});
        send(&mut arm, &[at(2, 5.5)]);
        let tick = tick_until(&mut arm, "refused", |tick| rejected(tick, reason) > before);
        assert_eq!(rejected(&tick, reason), before + 1, "{reason}");
        tick_until(&mut arm, "b's new place", |_| true);
        tick_until(&mut arm, "both bodies' good data", |tick| {
            assert_eq!(state(tick), State::Unknown, "{reason} {}", words(tick));
            assert_eq!(tick.unknown, 1, "{reason} {}", words(tick));
            tick.sources[1].seq > 1
        });
        assert!(arm.view().tick().reasons & Reason::Rejected.bit() != 0);
        let bodies = &arm.view().bodies().unwrap().rows;
        assert_eq!(bodies[0].status, BodyStatus::Rejected.code());
        assert_eq!(bodies[0].reject, reason.code());
        assert_eq!(bodies[0].position[0], 0.0, "its last good pose is kept");
        assert_eq!(bodies[2].position[0], 11.0, "of the same frame");
        raw.send(&good(), |_| {});
        tick_until(&mut arm, "clear again", |tick| state(tick) == State::Clear);
    }
}

#[test]
fn rows_that_are_not_the_sources_to_send_are_refused_and_the_rest_of_the_frame_is_used() {
    let desk = Desk::new();
    let (_daemon, mut arm, mut raw) = table(&desk);
    let mut x = 10.0;
    for (row, reason) in [
        (at(99, 0.0), RejectReason::UnknownBody),
        (at(0, 0.0), RejectReason::UnknownBody),
        (at(2, 0.0), RejectReason::WrongSource),
    ] {
        x += 1.0;
        let before = rejected(arm.view().tick(), reason);
        raw.send(&[at(1, 0.0), row, at(3, x)], |_| {});
        tick_until(&mut arm, "refused", |tick| {
            rejected(tick, reason) == before + 1
        });
        assert_eq!(
            state(arm.view().tick()),
            State::Clear,
            "{reason}: {}",
            words(arm.view().tick())
        );
        let bodies = &arm.view().bodies().unwrap().rows;
        assert_eq!(
            (bodies[1].position[0], bodies[2].position[0]),
            (5.0, x),
            "{reason}"
        );
    }
    raw.send(&[at(1, 0.0), at(3, 10.0), at(3, 12.0)], |_| {});
    let tick = tick_until(&mut arm, "refused", |tick| {
        rejected(tick, RejectReason::Duplicate) > 0
    });
    assert_ne!(
        state(&tick),
        State::Clear,
        "which of the two is meant is not known"
    );
}

#[test]
fn whole_frames_that_do_not_fit_are_refused_and_change_nothing() {
    let desk = Desk::new();
    let (_daemon, mut arm, mut raw) = table(&desk);
    let changes: [(&str, RejectReason, Change); 7] = [
        ("schema", RejectReason::BadLayout, |h| h.schema = 99),
        ("no flag", RejectReason::BadLayout, |h| h.flags = 0),
        ("two flags", RejectReason::BadLayout, |h| h.flags = 3),
        ("a pause with poses", RejectReason::BadLayout, |h| {
            h.flags = frame_flags::PAUSED
        }),
        ("no session", RejectReason::BadLayout, |h| h.session = 0),
        ("source", RejectReason::UnknownSource, |h| {
            h.source = name_bytes("ghost")
        }),
        ("an old frame", RejectReason::OldFrame, |h| h.seq = 1),
    ];
    for (what, reason, change) in changes {
        let before = rejected(arm.view().tick(), reason);
        raw.send(&[at(1, 5.0), at(3, 5.0)], change);
        tick_until(&mut arm, what, |tick| {
            assert_eq!(state(tick), State::Clear, "{what} {}", words(tick));
            rejected(tick, reason) > before
        });
    }
    raw.send(&[at(1, 0.0), at(3, 5.5)], |_| {});
    tick_until(&mut arm, "the next good one is used", |tick| {
        state(tick) == State::Colliding
    });
}

#[test]
fn a_frame_of_more_rows_than_a_scene_can_have_bodies_is_refused_unread() {
    let desk = Desk::new();
    let (_daemon, mut arm, mut raw) = table(&desk);
    let rows = vec![at(1, 5.0); FRAME_ROWS_MAX + 1];
    raw.send(&rows, |_| {});
    tick_until(&mut arm, "refused", |tick| {
        assert_ne!(state(tick), State::Colliding, "{}", words(tick));
        rejected(tick, RejectReason::OverLimit) > 0
    });
    raw.send(&good(), |_| {});
    send(&mut arm, &[at(2, 5.0)]);
    tick_until(&mut arm, "clear again", |tick| state(tick) == State::Clear);
}

#[test]
fn a_second_client_of_a_source_is_refused_while_the_first_lives_and_admitted_after_it() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &["--mode", "rate=100"]);
    let mut first = desk.source("sim");
    step(&mut first, &[at(1, 0.0), at(2, 5.0)]);
    let mut second = desk.source("sim");
    send(&mut second, &[at(1, 0.0), at(2, 0.1)]);
    tick_until(&mut first, "refused", |tick| {
        assert_eq!(state(tick), State::Clear, "{}", words(tick));
        rejected(tick, RejectReason::SourceTaken) > 0
    });
    step(&mut first, &[at(1, 0.0), at(2, 6.0)]);
    drop(first);
    // The second client has a session of its own, so its sequence numbers, which start at 1, are not old. Its frames
    // are refused until the daemon has noticed that the first client is gone.
    let session = second.session();
    let mut taken = false;
    while !taken {
        send(&mut second, &[at(1, 0.0), at(2, 0.2)]);
        tick_until(&mut second, "a tick", |tick| {
            taken = tick.sources[0].session == session;
            true
        });
    }
    tick_until(&mut second, "its poses", |tick| {
        state(tick) == State::Colliding
    });
}

#[test]
fn the_place_of_a_killed_source_is_free_again_within_a_second() {
    let desk = Desk::new();
    let daemon = desk.run(TWO_SPHERES, &["--mode", "rate=100"]);
    let mut reader = desk.client(None);
    let path = desk.scene(TWO_SPHERES);
    let mut feed = desk.start("feed", &[path.to_str().unwrap(), "--rate", "100"]);
    let seen = tick_until(&mut reader, "its frames", |tick| tick.sources[0].frames > 5);
    let mut next = desk.source("sim");
    feed.kill();
    // Measured in ticks, a hundred per second, from the last tick with a frame of the killed feed, whose timeout is
    // three seconds.
    let (mut last, mut frames) = (seen.header.tick, seen.sources[0].frames);
    let session = next.session();
    let taken = loop {
        send(&mut next, &[at(1, 0.0), at(2, 5.0)]);
        let tick = tick_until(&mut reader, "a tick", |_| true);
        let row = tick.sources[0];
        if row.session == session {
            break tick;
        }
        if row.frames > frames {
            (last, frames) = (tick.header.tick, row.frames);
        }
    };
    let waited = taken.header.tick - last;
    assert!(waited <= 100, "{waited} ticks\n{}", daemon.stderr());
}

#[test]
fn sixteen_sources_are_all_heard_a_seventeenth_is_refused_and_a_late_reader_has_all_at_once() {
    use std::fmt::Write as _;
    let mut text = String::from("[run]\nmode = \"on_all\"\n");
    for number in 1..=16 {
        let _ = write!(
            text,
            "[[source]]\nname = \"s{number}\"\ntimeout_ms = 5000\n\
             [[body]]\nname = \"b{number}\"\nid = {number}\nsource = \"s{number}\"\n\
             shape = {{ type = \"sphere\", radius = 0.5 }}\n"
        );
    }
    let desk = Desk::new();
    let _daemon = desk.run(&text, &[]);
    let mut sources: Vec<Client> = (1..=16)
        .map(|n| desk.client(Some(&format!("s{n}"))))
        .collect();
    let mut round = |x: f64| {
        for (number, source) in (1_u64..).zip(&mut sources) {
            #[allow(clippy::cast_precision_loss, reason = "sixteen")]
            send(source, &[at(number, x * number as f64)]);
        }
    };
    let mut reader = desk.source("nobody");
    round(3.0);
    tick_until(&mut reader, "all of them", |tick| {
        usize::from(tick.sources_len) == 16
            && tick.sources.iter().all(|row| row.alive == 1)
            && state(tick) == State::Clear
    });
    round(0.9);
    tick_until(&mut reader, "fifteen pairs", |tick| tick.colliding == 15);
    // The scene has no seventeenth source: its frames are counted as refused, and no other frame is lost.
    let mut more = desk.source("s17");
    send(&mut more, &[at(1, 7.0)]);
    let tick = tick_until(&mut reader, "refused", |tick| {
        rejected(tick, RejectReason::UnknownSource) > 0
    });
    assert_eq!(tick.colliding, 15, "{}", words(&tick));
    // A client that connects later, while no source sends, gets all topics.
    let mut late = desk.source("nobody");
    let tick = tick_until(&mut late, "a tick", |_| true);
    assert_eq!((tick.sources_len, tick.colliding), (16, 15));
    until("names and pairs", || {
        late.wait_tick(SECOND_NS).unwrap();
        let view = late.view();
        view.names().is_some_and(|names| names.rows.len() == 16)
            && view.pairs().is_some_and(|pairs| pairs.rows.len() == 15)
    });
}

#[test]
fn an_empty_scene_and_an_empty_frame_are_never_clear() {
    let desk = Desk::new();
    let _daemon = desk.run("[run]\nrate = 50\n[[source]]\nname = \"sim\"\n", &[]);
    let mut client = desk.source("sim");
    for number in 1..=5 {
        step(&mut client, &[]);
        step(&mut client, &[at(1, 0.0)]);
        let tick = client.view().tick();
        assert_eq!(state(tick), State::Unknown, "{}", words(tick));
        assert!(tick.reasons & Reason::NoInput.bit() != 0);
        assert_eq!(rejected(tick, RejectReason::UnknownBody), number);
    }
}
