//! Goal: every door fulfils the same contract. Method: one suite, two backends (shared memory, memory of this process),
//! and a stand-in daemon that names in each tick the frames it used.
//!
//! The ROS 2 node is also a door, but not among the backends: half of the rules of this suite are about features that
//! DDS does not have.
//! - *The end of a client ends its session*: DDS reports the end of a writer by its lease, 20 s later; there a
//!   session ends by the source's timeout (law 4.2). *A second daemon is refused*: ROS 2 allows two nodes of one name;
//!   both are reported.
//! - *A slow reader keeps the newest 8*: the history of a reader is its own, by its depth; the memory of the node for
//!   a stopped reader is bounded (`transport/ros2/wheel.rs`). *Sixteen sources are all heard*, *a flooder starves
//!   nobody*: frames are best effort, and a full receive buffer loses frames of all sources alike; frames that the node
//!   itself skips are counted (`transport/ros2/shelf.rs`).
//! - *Frames of another layout*, *a broken request is refused*: a differing type does not match, or is not decoded,
//!   which is counted; requests are services with their own types, not JSON with blobs.
//! - *Body rows, body verdicts and the plan* are not offered; late joiners get names at once, and all else with the
//!   next tick.
//!
//! The other rules (each step has its result, skipped frames are reported, sessions, epochs, pauses, restarts with a
//! new boot id, waiting frames, no computation without readers) are tested with real peers in `tests/python/ros2`, and
//! the messages are compared field by field with shared memory.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    reason = "tests"
)]

mod transport_support;

use std::sync::Arc;
use std::time::Duration;

use sweepd::error::Error;
use sweepd::time::SystemClock;
use sweepd::transport::client::{
    Client, ClientOptions, FrameInfo, Heard, Link, Part, Rows, StepError, Topics,
};
use sweepd::transport::iceoryx::{IoxLink, Server, ServerOptions};
use sweepd::transport::memory::{Hub, MemoryServer};
use sweepd::wire::{
    EndCause, FrameHeader, RejectReason, RequestHeader, TransformVelRow, VertexHeader, VertexRow,
    WIRE_VERSION, frame_flags, name_bytes,
};
use transport_support::{Files, Manners, SECOND_NS, StandIn, poses, until};

/// A transport under test.
trait Backend: Sync {
    fn new() -> Self;
    fn daemon(&self, manners: Manners) -> StandIn;
    fn small_daemon(&self, frame_rows_max: usize) -> StandIn;
    fn second_daemon(&self) -> Result<(), Error>;
    fn client(&self, source: Option<&str>) -> Client;
    fn link(&self) -> Box<dyn Link>;
}

struct Shared(Files);

impl Backend for Shared {
    fn new() -> Self {
        Self(Files::new())
    }

    fn daemon(&self, manners: Manners) -> StandIn {
        StandIn::iceoryx(&self.0.place, manners)
    }

    fn small_daemon(&self, frame_rows_max: usize) -> StandIn {
        let options = ServerOptions {
            frame_rows_max,
            ..ServerOptions::new(self.0.place.clone(), 7)
        };
        StandIn::start(Manners::default(), move || Server::open(options))
    }

    fn second_daemon(&self) -> Result<(), Error> {
        Server::open(ServerOptions::new(self.0.place.clone(), 8)).map(|_| ())
    }

    fn client(&self, source: Option<&str>) -> Client {
        ClientOptions {
            place: self.0.place.clone(),
            source: source.map(ToOwned::to_owned),
            timeout_ns: 5 * SECOND_NS,
        }
        .connect()
        .unwrap()
    }

    fn link(&self) -> Box<dyn Link> {
        Box::new(IoxLink::open(&self.0.place, &SystemClock, u64::MAX).unwrap())
    }
}

struct Memory(Hub);

impl Backend for Memory {
    fn new() -> Self {
        Self(Hub::new())
    }

    fn daemon(&self, manners: Manners) -> StandIn {
        let hub = self.0.clone();
        StandIn::start(manners, move || {
            MemoryServer::open(&hub, manners.boot_id, manners.heartbeat_ns)
        })
    }

    fn small_daemon(&self, frame_rows_max: usize) -> StandIn {
        let hub = self.0.clone();
        StandIn::start(Manners::default(), move || {
            Ok(MemoryServer::open(&hub, 7, 20_000_000)?.with_frame_rows_max(frame_rows_max))
        })
    }

    fn second_daemon(&self) -> Result<(), Error> {
        MemoryServer::open(&self.0, 8, 20_000_000).map(|_| ())
    }

    fn client(&self, source: Option<&str>) -> Client {
        let link = Box::new(self.0.link());
        Client::over(link, Arc::new(SystemClock), source, 5 * SECOND_NS).unwrap()
    }

    fn link(&self) -> Box<dyn Link> {
        Box::new(self.0.link())
    }
}

fn step(client: &mut Client, n: u64, x: f64) -> Result<(), StepError> {
    client
        .step(
            &FrameInfo::default(),
            Rows::Poses(&poses(n, x)),
            5 * SECOND_NS,
        )
        .map(|_| ())
}

fn raw_header(source: &str, seq: u64, schema: u32) -> FrameHeader {
    FrameHeader {
        session: 99,
        seq,
        source: name_bytes(source),
        flags: frame_flags::FULL,
        schema,
        ..FrameHeader::default()
    }
}

fn a_step_returns_the_result_of_exactly_its_frame<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    client.subscribe(Topics::ALL).unwrap();
    for x in 1..=200 {
        step(&mut client, 2, f64::from(x)).unwrap();
        let view = client.view();
        assert_eq!(view.tick().sources[0].seq, u64::try_from(x).unwrap());
        assert_eq!(view.pairs().unwrap().rows[1].gap_best_m, f64::from(x));
        assert_eq!(view.contacts().unwrap().rows.len(), 2);
        assert_eq!(view.regions().unwrap().rows[1].radius_m, f64::from(x));
    }
}

fn a_tick_that_is_told_of_while_it_is_under_way_is_followed_by_itself<B: Backend>() {
    let backend = B::new();
    let manners = Manners {
        long_ticks: true,
        heartbeat_ns: SECOND_NS / 2,
        ..Manners::default()
    };
    let _daemon = backend.daemon(manners);
    let mut client = backend.client(Some("sim"));
    client.subscribe(Topics::ALL).unwrap();
    let mut reader = backend.client(None);
    reader.subscribe(Topics::ALL).unwrap();
    // Announced twice, then published itself, all with one tick number.
    let (mut told, mut last) = (0, 0);
    for x in 1..=20 {
        step(&mut client, 3, f64::from(x)).unwrap();
        assert!(!client.view().is_under_way());
        let pairs = &client.view().pairs().expect("its pairs").rows;
        assert_eq!(pairs[0].gap_best_m, f64::from(x));
        while last < client.view().tick().header.tick {
            assert_eq!(reader.wait_tick(5 * SECOND_NS).unwrap(), Heard::Tick);
            let view = reader.view();
            let number = view.tick().header.tick;
            if view.is_under_way() {
                told += 1;
                assert_eq!(view.tick().sources_len, 0);
                assert!(view.pairs().is_none(), "they come with its end");
            } else {
                last = number;
            }
            let pairs = view.pairs().map_or(number, |pairs| pairs.header.tick);
            assert_eq!(pairs, number, "of another tick");
        }
    }
    assert_eq!(told, 40);
}

fn velocities_come_on_a_type_of_their_own<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    let rows = [TransformVelRow {
        linear: [1.0, 2.0, 3.0],
        ..TransformVelRow::default()
    }; 4];
    client
        .step(&FrameInfo::default(), Rows::Moving(&rows), 5 * SECOND_NS)
        .unwrap();
    assert_eq!(daemon.log().frames[0].1, 4);
}

fn a_frame_that_was_passed_over_is_said_to_be_skipped<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    let mut newer = backend.link();
    let header = FrameHeader {
        session: client.session(),
        ..raw_header("sim", 1000, WIRE_VERSION)
    };
    newer.send(&header, Rows::Poses(&poses(1, 2.0))).unwrap();
    until("the newer frame", || daemon.log().frames.len() == 1);
    let skipped = step(&mut client, 1, 1.0).unwrap_err();
    assert!(matches!(skipped, StepError::Skipped(_)), "{skipped}");
}

fn a_late_joiner_gets_the_newest_state_from_an_idle_daemon<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners {
        heartbeat_ns: 200_000_000,
        ..Manners::default()
    });
    let mut client = backend.client(Some("sim"));
    step(&mut client, 1, 1.0).unwrap();
    let mut late = backend.client(None);
    late.subscribe(Topics::ALL).unwrap();
    assert_eq!(late.wait_tick(5 * SECOND_NS).unwrap(), Heard::Tick);
    assert!(late.view().tick().header.tick >= 1);
    until("names and plan of before", || {
        late.wait_tick(SECOND_NS / 4).unwrap();
        late.view().names().is_some() && late.view().plan().is_some()
    });
    assert_eq!(late.view().names().unwrap().rows.len(), 1);
    assert_eq!(late.view().plan().unwrap().rows, b"{\"broad\":\"brute\"}");
}

fn a_slow_reader_holds_nobody_up_and_keeps_the_newest<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners::default());
    let mut slow = backend.client(None);
    slow.subscribe(Topics::ALL).unwrap();
    let mut client = backend.client(Some("sim"));
    client.subscribe(Topics::ALL).unwrap();
    for x in 1..=300 {
        step(&mut client, 50, f64::from(x)).unwrap();
        assert!(client.view().pairs().is_some());
    }
    let newest = client.view().tick().header.tick;
    assert_eq!(slow.latest().unwrap(), Heard::Tick);
    assert!(slow.view().tick().header.tick >= newest);
}

fn sixteen_sources_are_all_heard<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners::default());
    std::thread::scope(|scope| {
        for number in 0..16 {
            let backend = &backend;
            scope.spawn(move || {
                let mut client = backend.client(Some(&format!("source_{number}")));
                for x in 1..=20 {
                    if let Err(e) = step(&mut client, 10, f64::from(x)) {
                        panic!("source {number}, frame {x}: {e}");
                    }
                }
            });
        }
    });
    let mut reader = backend.client(None);
    assert_eq!(reader.wait_tick(5 * SECOND_NS).unwrap(), Heard::Tick);
    let tick = *reader.view().tick();
    assert_eq!(tick.sources_len, 16);
    for row in tick.sources {
        assert_eq!(row.frames, 20);
    }
}

fn a_flooder_does_not_starve_another_source<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let stop = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut link = backend.link();
            let rows = poses(200, 0.0);
            let mut seq = 0;
            while !stop.load(std::sync::atomic::Ordering::Relaxed) {
                seq += 1;
                let header = raw_header("flood", seq, WIRE_VERSION);
                link.send(&header, Rows::Poses(&rows)).unwrap();
            }
        });
        let mut calm = backend.client(Some("calm"));
        for x in 1..=20 {
            calm.send(&FrameInfo::default(), Rows::Poses(&poses(1, f64::from(x))))
                .unwrap();
            until("the calm source's frame", || {
                daemon.log().frames.iter().any(|(header, ..)| {
                    header.source == name_bytes("calm") && header.seq == u64::try_from(x).unwrap()
                })
            });
        }
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
    });
}

fn frames_of_another_layout_or_beyond_limits_are_counted_and_good_ones_still_heard<B: Backend>() {
    let backend = B::new();
    let daemon = backend.small_daemon(100);
    let mut client = backend.client(Some("sim"));
    let mut stranger = backend.link();
    stranger
        .send(
            &raw_header("old", 1, WIRE_VERSION + 1),
            Rows::Poses(&poses(1, 0.0)),
        )
        .unwrap();
    stranger
        .send(
            &raw_header("old", 2, WIRE_VERSION),
            Rows::Poses(&poses(101, 0.0)),
        )
        .unwrap();
    until("both strange frames", || daemon.log().frames.len() >= 2);
    step(&mut client, 100, 1.0).unwrap();
    let rejects = client.view().tick().rejects;
    assert_eq!(rejects[usize::from(RejectReason::BadLayout.code())], 1);
    assert_eq!(rejects[usize::from(RejectReason::OverLimit.code())], 1);
    let log = daemon.log();
    let refused = log
        .frames
        .iter()
        .find(|f| f.2 == Some(RejectReason::OverLimit))
        .unwrap();
    assert_eq!(refused.1, 0, "its rows are left behind");
}

fn nothing_is_sent_for_nobody<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    step(&mut client, 3, 1.0).unwrap();
    assert!(client.view().pairs().is_none());
    client
        .subscribe(Topics {
            pairs: true,
            ..Topics::default()
        })
        .unwrap();
    step(&mut client, 3, 2.0).unwrap();
    assert_eq!(client.view().pairs().unwrap().rows.len(), 3);
    assert!(client.view().contacts().is_none());
    assert!(client.view().regions().is_none());
    assert!(client.view().list().is_none() && client.view().contact_list().is_none());
}

/// The lists kept from `changes` and `contact_changes` must equal the pairs and contacts of the same tick.
fn has_lists(client: &Client) -> bool {
    let view = client.view();
    let (Some(list), Some(contact_list)) = (view.list(), view.contact_list()) else {
        return false;
    };
    if let Some(contacts) = view.contacts() {
        assert_eq!(
            contact_list.iter().copied().collect::<Vec<_>>(),
            contacts.rows
        );
    }
    // Pairs that were dropped from the queue cannot be compared.
    if let Some(pairs) = view.pairs() {
        assert_eq!(list.iter().collect::<Vec<_>>(), pairs.rows);
    }
    true
}

fn lists_kept_from_changes_are_whole_or_not_shown<B: Backend>() {
    let backend = B::new();
    let _daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    client.subscribe(Topics::ALL).unwrap();
    let mut slow = backend.client(None);
    slow.subscribe(Topics::ALL).unwrap();
    for x in 1..=100_u32 {
        step(&mut client, 1 + u64::from(x % 4), f64::from(x)).unwrap();
        assert!(has_lists(&client), "step {x}");
    }
    // Its queue has dropped most of the messages.
    assert_eq!(slow.latest().unwrap(), Heard::Tick);
    until("the whole list again", || {
        let shown = has_lists(&slow);
        slow.wait_tick(SECOND_NS).unwrap();
        shown
    });
    // A new reader replaces the old one, between two ticks or within one.
    for x in 101..=120_u32 {
        drop(slow);
        slow = backend.client(None);
        slow.subscribe(Topics::ALL).unwrap();
        step(&mut client, 1 + u64::from(x % 4), f64::from(x)).unwrap();
        assert!(has_lists(&client), "step {x}");
        until("the whole list for the new one", || {
            slow.wait_tick(SECOND_NS).unwrap();
            has_lists(&slow)
        });
    }
}

fn a_request_is_answered_and_a_broken_one_refused<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(None);
    let blob = vec![7_u8; 100_000];
    for _ in 0..20 {
        let answer = client
            .request("{\"put\":1}", &[&blob, &[1, 2]], 5 * SECOND_NS)
            .unwrap();
        assert!(answer.ok);
        assert_eq!(answer.warnings, ["{\"put\":1}"]);
        assert_eq!(answer.scene_rev, 9 + 100_000 + 2, "bytes that arrived");
    }
    assert_eq!(daemon.log().requests[0][9..100_009], blob[..]);
    let mut stranger = backend.link();
    let mut text = Vec::new();
    for (request, schema, json_len) in [(5, WIRE_VERSION + 1, 2), (6, WIRE_VERSION, 3)] {
        let header = RequestHeader {
            json_len,
            request,
            schema,
            reserved: 0,
        };
        stranger.request(&header, b"{}", &[]).unwrap();
        let mut answer = None;
        until("a refusal", || {
            answer = stranger.answer(&mut text).unwrap();
            answer.is_some()
        });
        let answer = answer.unwrap();
        assert_eq!((answer.request, answer.ok), (request, 0));
        assert!(String::from_utf8_lossy(&text).contains("error"));
    }
    assert_eq!(daemon.log().requests.len(), 20, "nobody reads a broken one");
}

fn a_restarted_daemon_is_told_with_ends_and_running_clients_go_on<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    client.subscribe(Topics::ALL).unwrap();
    let mut reader = backend.client(None);
    reader.subscribe(Topics::ALL).unwrap();
    step(&mut client, 3, 1.0).unwrap();
    until("the reader's pairs", || {
        reader.wait_tick(SECOND_NS).unwrap();
        reader.view().pairs().is_some_and(|p| p.rows.len() == 3)
    });
    daemon.stop();
    // reads what has come since (heartbeats without pairs), so that the reader's last message is known
    while reader.wait_tick(SECOND_NS / 20).unwrap() == Heard::Tick {}
    let before = reader.view().pairs().map_or(0, |p| p.rows.len());
    let _again = backend.daemon(Manners {
        boot_id: 8,
        ..Manners::default()
    });
    let heard = reader.wait_tick(5 * SECOND_NS).unwrap();
    let Heard::Restarted(restarted) = heard else {
        panic!("{heard:?} before the news of the restart");
    };
    assert_eq!((restarted.old_boot, restarted.new_boot), (7, 8));
    assert_eq!(restarted.ends.len(), before);
    for end in &restarted.ends {
        assert_eq!(end.end_cause, EndCause::Restart.code());
    }
    assert!(matches!(
        step(&mut client, 3, 2.0),
        Err(StepError::Restarted(_))
    ));
    step(&mut client, 3, 3.0).unwrap();
    assert_eq!(client.view().tick().header.boot_id, 8);
    assert_eq!(client.view().pairs().unwrap().rows[0].gap_best_m, 3.0);
}

fn bug_after_a_restart_a_range_of_vertices_waits_for_all_of_them<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    let rows = [VertexRow::default(); 4];
    let range = Part::Range { first: 1, total: 4 };
    let refused = |client: &mut Client| {
        let refused = client.send_vertices(1, range, &rows[..2]).unwrap_err();
        assert!(
            refused.to_string().contains("send all of them first"),
            "{refused}"
        );
    };
    refused(&mut client);
    client.send_vertices(1, Part::Full, &rows).unwrap();
    step(&mut client, 3, 1.0).unwrap();
    assert_eq!(client.send_vertices(1, range, &rows[..2]).unwrap(), 2);
    daemon.stop();
    let _again = backend.daemon(Manners {
        boot_id: 8,
        ..Manners::default()
    });
    assert!(matches!(
        step(&mut client, 3, 2.0),
        Err(StepError::Restarted(_))
    ));
    refused(&mut client);
    assert_eq!(client.send_vertices(1, Part::Full, &rows).unwrap(), 1);
    assert_eq!(client.send_vertices(1, range, &rows[..2]).unwrap(), 2);
}

fn the_end_of_a_client_ends_its_session_after_its_frames<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    let session = client.session();
    step(&mut client, 1, 1.0).unwrap();
    client
        .send(&FrameInfo::default(), Rows::Poses(&poses(1, 2.0)))
        .unwrap();
    assert_eq!(daemon.log().ended, [0_u64; 0], "it lives");
    drop(client);
    until("the end of the session", || {
        daemon.log().ended.contains(&session)
    });
    assert_eq!(daemon.log().frames.len(), 2, "no frame is lost for it");
    assert_eq!(daemon.log().ended, [session], "and it is told once");
}

fn vertices_come_with_the_frame_that_they_belong_with<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    let vertex = |k: u32, at: f32| VertexRow {
        position: [k as f32, at, -1.0],
    };
    let all: Vec<_> = (0..10_000).map(|k| vertex(k, 0.0)).collect();
    let nothing = client.send_vertices(
        3,
        Part::Range {
            first: 5,
            total: 10_000,
        },
        &all[..2],
    );
    assert!(nothing.is_err(), "nothing was sent before");
    assert_eq!(client.send_vertices(3, Part::Full, &all).unwrap(), 1);
    assert_eq!(client.send_vertices(4, Part::Full, &all[..50]).unwrap(), 1);
    step(&mut client, 1, 0.0).unwrap();
    let part = Part::Range {
        first: 5,
        total: 10_000,
    };
    let some = [vertex(5, 2.0), vertex(6, 3.0)];
    assert_eq!(client.send_vertices(3, part, &some).unwrap(), 2);
    step(&mut client, 1, 0.0).unwrap();
    client.reset_epoch();
    assert!(
        client.send_vertices(3, part, &some).is_err(),
        "void with the epoch"
    );
    assert_eq!(client.send_vertices(3, Part::Full, &all).unwrap(), 1);
    step(&mut client, 1, 0.0).unwrap();
    let log = daemon.log();
    let seen = |v: &(VertexHeader, Vec<[f32; 3]>, Option<RejectReason>)| {
        let h = &v.0;
        assert_eq!((h.session, h.schema), (client.session(), WIRE_VERSION));
        assert_eq!(h.source, name_bytes("sim"));
        assert!(v.2.is_none() && h.sent_ns > 0 && h.count as usize == v.1.len());
        let order = (h.epoch, h.seq, h.body);
        (
            order,
            h.version,
            h.base_version,
            (h.first, h.count, h.total),
        )
    };
    let told: Vec<_> = log.vertices.iter().map(seen).collect();
    let wanted = [
        ((0, 1, 3), 1, 0, (0, 10_000, 10_000)),
        ((0, 1, 4), 1, 0, (0, 50, 50)),
        ((0, 2, 3), 2, 1, (5, 2, 10_000)),
        ((1, 3, 3), 1, 0, (0, 10_000, 10_000)),
    ];
    assert_eq!(told, wanted);
    let rows = |at: usize| &log.vertices[at].1;
    assert!((rows(0).iter().zip(&all)).all(|(row, sent)| *row == sent.position));
    assert_eq!(rows(2)[..], some.map(|v| v.position));
    // Each message was received in the round of its frame, or earlier.
    drop(client);
    // A client that sends only vertices has a session too, which ends with it.
    let mut bender = backend.client(Some("bender"));
    bender.send_vertices(9, Part::Full, &all[..10]).unwrap();
    let session = bender.session();
    until("its vertices come", || daemon.log().vertices.len() == 5);
    drop(bender);
    until("its session ends", || daemon.log().ended.contains(&session));
}

fn pauses_and_epochs_are_carried<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    step(&mut client, 1, 1.0).unwrap();
    client.pause().unwrap();
    client.reset_epoch();
    let partial = FrameInfo {
        partial: true,
        stamp_ns: 5,
        clock_id: 2,
        scene_rev: 3,
        deadline_ns: 4,
        time_left_ns: 6,
    };
    client.send(&partial, Rows::Poses(&poses(1, 2.0))).unwrap();
    until("three frames", || daemon.log().frames.len() == 3);
    let frames: Vec<_> = daemon.log().frames.iter().map(|f| f.0).collect();
    let flags: Vec<_> = frames.iter().map(|f| f.flags).collect();
    assert_eq!(
        flags,
        [frame_flags::FULL, frame_flags::PAUSED, frame_flags::PARTIAL]
    );
    assert_eq!(
        [frames[0].epoch, frames[1].epoch, frames[2].epoch],
        [0, 0, 1]
    );
    assert_eq!([frames[0].seq, frames[1].seq, frames[2].seq], [1, 2, 3]);
    assert!(frames.iter().all(|f| f.sent_ns > 0 && f.session != 0));
    let last = frames[2];
    assert_eq!((last.stamp_ns, last.clock_id, last.scene_rev), (5, 2, 3));
    assert_eq!((last.deadline_ns, last.time_left_ns), (4, 6));
}

fn frames_that_waited_while_the_daemon_was_silent_say_so<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners {
        nap: Duration::from_millis(200),
        ..Manners::default()
    });
    // a bare link, because a client would wait for the hello of the sleeping daemon
    let mut early = backend.link();
    early
        .send(
            &raw_header("early", 1, WIRE_VERSION),
            Rows::Poses(&poses(1, 1.0)),
        )
        .unwrap();
    let mut client = backend.client(Some("sim"));
    until("the frame", || daemon.log().frames.len() == 1);
    step(&mut client, 1, 2.0).unwrap();
    let waited: Vec<_> = daemon.log().frames.iter().map(|f| f.3).collect();
    assert_eq!(waited, [true, false]);
}

fn a_second_daemon_is_refused_and_the_first_goes_on<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let refused = backend.second_daemon().unwrap_err();
    assert_eq!(refused.exit_code(), 4, "{refused}");
    assert!(refused.to_string().contains("taken"), "{refused}");
    let mut client = backend.client(Some("sim"));
    step(&mut client, 1, 1.0).unwrap();
    daemon.stop();
    backend.second_daemon().unwrap();
}

fn a_step_without_a_daemon_times_out_and_says_why<B: Backend>() {
    let backend = B::new();
    let daemon = backend.daemon(Manners::default());
    let mut client = backend.client(Some("sim"));
    step(&mut client, 1, 1.0).unwrap();
    daemon.stop();
    let late = client
        .step(
            &FrameInfo::default(),
            Rows::Poses(&poses(1, 2.0)),
            SECOND_NS / 10,
        )
        .unwrap_err();
    assert!(matches!(late, StepError::TimedOut(_)), "{late}");
    assert!(late.to_string().contains("no tick came"), "{late}");
}

#[test]
fn a_source_name_that_fits_no_frame_is_refused_at_once() {
    for name in [String::new(), "s".repeat(32)] {
        let client = ClientOptions {
            place: Files::new().place.clone(),
            source: Some(name),
            timeout_ns: 0,
        };
        let refused = client.connect().unwrap_err();
        assert!(matches!(refused, Error::Usage(_)), "{refused}");
    }
}

macro_rules! both {
    ($($name:ident)+) => {
        mod shared_memory {
            $(#[test] fn $name() { super::$name::<super::Shared>(); })+
        }
        mod memory {
            $(#[test] fn $name() { super::$name::<super::Memory>(); })+
        }
    };
}

both! {
    vertices_come_with_the_frame_that_they_belong_with
    a_step_returns_the_result_of_exactly_its_frame
    a_tick_that_is_told_of_while_it_is_under_way_is_followed_by_itself
    velocities_come_on_a_type_of_their_own
    a_frame_that_was_passed_over_is_said_to_be_skipped
    a_late_joiner_gets_the_newest_state_from_an_idle_daemon
    a_slow_reader_holds_nobody_up_and_keeps_the_newest
    lists_kept_from_changes_are_whole_or_not_shown
    sixteen_sources_are_all_heard
    a_flooder_does_not_starve_another_source
    frames_of_another_layout_or_beyond_limits_are_counted_and_good_ones_still_heard
    nothing_is_sent_for_nobody
    a_request_is_answered_and_a_broken_one_refused
    a_restarted_daemon_is_told_with_ends_and_running_clients_go_on
    bug_after_a_restart_a_range_of_vertices_waits_for_all_of_them
    the_end_of_a_client_ends_its_session_after_its_frames
    pauses_and_epochs_are_carried
    frames_that_waited_while_the_daemon_was_silent_say_so
    a_second_daemon_is_refused_and_the_first_goes_on
    a_step_without_a_daemon_times_out_and_says_why
}
