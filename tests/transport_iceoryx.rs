//! Goal: failures that only shared memory between processes can have: files, locks, killed processes, foreign
//! processes. Method: real services under a separate root and prefix, and child processes of this test program.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    reason = "tests"
)]

mod transport_support;

use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{Config, FileName, NodeBuilder, Path as IoxPath, SemanticString, ipc};
use sweepd::time::{Clock, SystemClock};
use sweepd::transport::Door;
use sweepd::transport::client::{
    ClientOptions, FrameInfo, Heard, Link, Message, Rows, StepError, Topics,
};
use sweepd::transport::iceoryx::{
    Cleaned, IoxLink, Place, Server, ServerOptions, Waker, clean_leftovers, leftovers,
    list_instances, spawn_cleaner,
};
use sweepd::wire::{
    FrameHeader, Hello, Inbox, RequestHeader, TransformRow, TransformVelRow, WIRE_VERSION,
};
use transport_support::{Files, Manners, SECOND_NS, StandIn, poses, until};

/// Environment variables with the part that the child process plays, and its place.
const PART: &str = "SWEEPD_TEST_PART";
const ROOT: &str = "SWEEPD_TEST_ROOT";
const PREFIX: &str = "SWEEPD_TEST_PREFIX";

fn options(files: &Files, source: Option<&str>) -> ClientOptions {
    ClientOptions {
        place: files.place.clone(),
        source: source.map(ToOwned::to_owned),
        timeout_ns: 5 * SECOND_NS,
    }
}

fn server(files: &Files, spin_ns: u64) -> Server {
    let options = ServerOptions::new(files.place.clone(), 7);
    Server::open(ServerOptions { spin_ns, ..options }).unwrap()
}

#[test]
fn a_step_over_shared_memory_returns_the_result_of_its_frame_and_nothing_is_left_behind() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let mut client = options(&files, Some("sim")).connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    for x in 1..=20 {
        let rows = poses(3, f64::from(x));
        client
            .step(&FrameInfo::default(), Rows::Poses(&rows), 2 * SECOND_NS)
            .unwrap();
        let pairs = client.view().pairs().unwrap();
        assert_eq!(pairs.rows.len(), 3);
        assert_eq!(pairs.rows[0].gap_best_m, f64::from(x));
        assert_eq!(client.view().contacts().unwrap().rows.len(), 3);
        assert_eq!(client.view().regions().unwrap().rows.len(), 3);
    }
    assert_eq!(client.view().names().unwrap().rows.len(), 1);
    drop(client);
    daemon.stop();
    assert_eq!(files.left(), Vec::<String>::new());
}

/// Starts this test program again as another process, which prints a line when it is ready.
fn spawn(files: &Files, part: &str) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "child_process", "--nocapture"])
        .env(PART, part)
        .env(ROOT, &files.root)
        .env(PREFIX, &files.prefix)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(
        lines.any(|line| line.unwrap().contains("READY")),
        "the child ended early"
    );
    child
}

fn kill_and_reap(mut child: Child) {
    child.kill().unwrap();
    // a zombie counts as alive
    child.wait().unwrap();
}

#[test]
#[ignore = "played by children of the other tests"]
fn child_process() {
    // Not started by another test: all ignored tests are being run.
    let Ok(root) = std::env::var(ROOT) else {
        return;
    };
    let place = Place::new("cell")
        .unwrap()
        .under(root, std::env::var(PREFIX).unwrap());
    let part = std::env::var(PART).unwrap();
    if part == "daemon" {
        let daemon = StandIn::iceoryx(&place, Manners::default());
        println!("READY");
        std::thread::park();
        drop(daemon);
        return;
    }
    let mut client = ClientOptions {
        place,
        source: Some(part),
        timeout_ns: 5 * SECOND_NS,
    }
    .connect()
    .unwrap();
    client.subscribe(Topics::ALL).unwrap();
    let rows = poses(2, 1.0);
    client
        .step(&FrameInfo::default(), Rows::Poses(&rows), 5 * SECOND_NS)
        .unwrap();
    println!("READY");
    loop {
        std::thread::park();
    }
}

#[test]
fn a_killed_sources_session_ends_and_its_place_is_free_within_a_second() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let cleaner = spawn_cleaner(&files.place).unwrap();
    let child = spawn(&files, "arm");
    let session = daemon.log().frames[0].0.session;
    assert_eq!(list_instances(&files.place).unwrap()[0].sources, 1);
    assert_eq!(daemon.log().ended, [0_u64; 0], "it lives");
    let clock = SystemClock;
    kill_and_reap(child);
    let killed_ns = clock.monotonic_ns();
    until("the session's end", || {
        daemon.log().ended.contains(&session)
    });
    let ended_ns = clock.monotonic_ns() - killed_ns;
    assert_eq!(daemon.log().ended, [session], "told once");
    assert_eq!(list_instances(&files.place).unwrap()[0].sources, 0);
    println!("slot free after {} ms", ended_ns / 1_000_000);
    // The intended duration is a second, which is printed; the limit is higher so that a busy machine does not fail the
    // test.
    assert!(ended_ns < 10 * SECOND_NS, "{} ms", ended_ns / 1_000_000);
    drop(cleaner);
    daemon.stop();
    assert_eq!(files.left(), Vec::<String>::new());
}

#[test]
fn a_killed_reader_does_not_hold_the_others_up() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let _cleaner = spawn_cleaner(&files.place).unwrap();
    let child = spawn(&files, "reader");
    let mut client = options(&files, Some("sim")).connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    let mut child = Some(child);
    for x in 1..=300 {
        if x == 100 {
            kill_and_reap(child.take().unwrap());
        }
        client
            .step(
                &FrameInfo::default(),
                Rows::Poses(&poses(200, f64::from(x))),
                2 * SECOND_NS,
            )
            .unwrap();
        assert_eq!(client.view().pairs().unwrap().rows.len(), 200);
    }
    drop(client);
    until("one reader fewer", || {
        list_instances(&files.place).unwrap()[0].readers == 0
    });
    daemon.stop();
}

#[test]
fn a_killed_daemon_is_started_again_at_once_and_running_clients_go_on() {
    let files = Files::new();
    let child = spawn(&files, "daemon");
    let mut client = options(&files, Some("sim")).connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    let step = |client: &mut sweepd::transport::client::Client, x: f64| {
        client.step(
            &FrameInfo::default(),
            Rows::Poses(&poses(3, x)),
            2 * SECOND_NS,
        )
    };
    step(&mut client, 1.0).unwrap();
    kill_and_reap(child);
    assert_eq!(list_instances(&files.place).unwrap()[0].pid, None);
    let daemon = StandIn::iceoryx(
        &files.place,
        Manners {
            boot_id: 8,
            ..Manners::default()
        },
    );
    let again = step(&mut client, 2.0).unwrap_err();
    assert!(matches!(again, StepError::Restarted(_)), "{again}");
    step(&mut client, 3.0).unwrap();
    assert_eq!(client.view().pairs().unwrap().rows[0].gap_best_m, 3.0);
    let answer = client.request("{}", &[], 5 * SECOND_NS).unwrap();
    assert!(answer.ok, "requests find the new daemon too");
    drop(client);
    daemon.stop();
    assert_eq!(files.left(), Vec::<String>::new());
}

#[test]
fn sixteen_killed_sources_leave_room_for_sixteen_more() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let _cleaner = spawn_cleaner(&files.place).unwrap();
    for _round in 0..2 {
        let children: Vec<_> = (0..16)
            .map(|number| spawn(&files, &format!("s{number}")))
            .collect();
        assert_eq!(list_instances(&files.place).unwrap()[0].sources, 16);
        children.into_iter().for_each(kill_and_reap);
        until("sixteen free places", || {
            list_instances(&files.place).unwrap()[0].sources == 0
        });
    }
    daemon.stop();
}

#[test]
fn an_instance_is_listed_with_its_daemon_sources_and_readers() {
    let files = Files::new();
    assert_eq!(list_instances(&files.place).unwrap(), []);
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let mut client = options(&files, Some("sim")).connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    client
        .send(&FrameInfo::default(), Rows::Poses(&poses(1, 0.0)))
        .unwrap();
    let listed = list_instances(&files.place).unwrap();
    assert_eq!(listed.len(), 1);
    let info = &listed[0];
    assert_eq!(info.instance, "cell");
    assert_eq!(info.pid, Some(std::process::id()));
    assert_eq!(info.boot_id, 7);
    assert_eq!((info.sources, info.readers), (1, 1));
    assert_eq!((info.pair_readers, info.contact_readers), (1, 1));
    assert_eq!((info.change_readers, info.contact_change_readers), (1, 1));
    drop(client);
    daemon.stop();
    assert_eq!(list_instances(&files.place).unwrap(), []);
}

#[test]
fn a_waker_wakes_the_tick_thread_from_another_thread() {
    let files = Files::new();
    let mut server = Server::open(ServerOptions::new(files.place.clone(), 7)).unwrap();
    let waker = Waker::new(&files.place).unwrap();
    let clock = SystemClock;
    while server.wait(0, &clock).unwrap() != sweepd::transport::Wake::default() {}
    std::thread::scope(|scope| {
        scope.spawn(|| waker.wake());
        let wake = server.wait(10 * SECOND_NS, &clock).unwrap();
        assert!(wake.notified);
    });
}

#[test]
fn a_busy_poll_finds_frames_and_ends_at_its_time() {
    let files = Files::new();
    let mut server = server(&files, u64::MAX);
    let clock = SystemClock;
    let before_ns = clock.monotonic_ns();
    assert!(!server.wait(20_000_000, &clock).unwrap().notified);
    assert!(clock.monotonic_ns() - before_ns >= 20_000_000);
    let mut link = IoxLink::open(&files.place, &clock, u64::MAX).unwrap();
    Link::send(
        &mut link,
        &FrameHeader::default(),
        Rows::Poses(&poses(1, 0.0)),
    )
    .unwrap();
    let mut inbox = Inbox::default();
    until("the frame", || {
        server.wait(20_000_000, &clock).unwrap();
        server.receive(&mut inbox, &clock);
        !inbox.is_empty()
    });
}

#[test]
fn bug_frames_with_and_without_velocities_are_taken_in_the_order_of_their_sending() {
    let files = Files::new();
    let mut server = server(&files, 0);
    let mut link = IoxLink::open(&files.place, &SystemClock, u64::MAX).unwrap();
    let moving = [TransformVelRow::default(); 2];
    let still = poses(2, 0.0);
    for seq in 1..=7 {
        let mut header = FrameHeader::default();
        (header.session, header.epoch, header.seq) = (1, 1, seq);
        header.sent_ns = SystemClock.boottime_ns();
        let rows = match seq % 2 {
            0 => Rows::Poses(&still),
            _ => Rows::Moving(&moving),
        };
        Link::send(&mut link, &header, rows).unwrap();
    }
    let mut seen = Vec::new();
    until("all frames", || {
        let mut inbox = Inbox::default();
        server.receive(&mut inbox, &SystemClock);
        let frames = inbox.frames().iter();
        seen.extend(frames.map(|frame| (frame.header.seq, frame.velocities.len())));
        seen.len() == 7
    });
    let sent: Vec<_> = (1..=7).map(|seq| (seq, (seq % 2) as usize * 2)).collect();
    assert_eq!(seen, sent);
}

#[test]
fn bug_changes_renewed_while_no_daemon_is_there_are_read_from_the_next_one() {
    let files = Files::new();
    let daemon = server(&files, 0);
    let mut link = IoxLink::open(&files.place, &SystemClock, u64::MAX).unwrap();
    let changes = Topics {
        changes: true,
        ..Topics::default()
    };
    Link::subscribe(&mut link, changes).unwrap();
    drop(daemon);
    let mut message = Message::default();
    for _ in 0..3 {
        Link::renew_changes(&mut link).unwrap();
        assert!(!Link::changes(&mut link, &mut message).unwrap());
    }
    let mut daemon = server(&files, 0);
    until("the reader", || daemon.demand().changes);
}

#[test]
fn bug_who_waited_for_an_answer_as_the_daemon_ended_waited_out_its_time() {
    let files = Files::new();
    let mut daemon = server(&files, 0);
    let mut link = IoxLink::open(&files.place, &SystemClock, u64::MAX).unwrap();
    let mut ask = |request| {
        let header = RequestHeader {
            json_len: 2,
            request,
            schema: WIRE_VERSION,
            reserved: 0,
        };
        link.request(&header, b"{}", &[]).unwrap();
    };
    ask(5);
    let mut tokens = Vec::new();
    until("the request", || {
        daemon.requests(&mut |token, _, _| tokens.push(token));
        !tokens.is_empty()
    });
    // The daemon has not read this request.
    ask(6);
    drop(daemon);
    let (mut text, mut refused) = (Vec::new(), Vec::new());
    until("both answers", || {
        while let Some(answer) = link.answer(&mut text).unwrap() {
            let words = String::from_utf8_lossy(&text);
            assert!(words.contains("has ended"), "{words}");
            refused.push((answer.request, answer.ok));
        }
        refused.len() == 2
    });
    refused.sort_unstable();
    assert_eq!(refused, [(5, 0), (6, 0)]);
    assert!(tokens.len() == 1 && link.answer(&mut text).unwrap().is_none());
}

#[test]
fn bug_a_topic_whose_places_are_all_taken_was_told_by_the_name_of_an_enum() {
    let files = Files::new();
    let _daemon = server(&files, 0);
    let pairs = Topics {
        pairs: true,
        ..Topics::default()
    };
    let mut links = Vec::new();
    let why = loop {
        let mut link = IoxLink::open(&files.place, &SystemClock, u64::MAX).unwrap();
        match Link::subscribe(&mut link, pairs) {
            Ok(()) => links.push(link),
            Err(why) => break why,
        }
    };
    assert_eq!(links.len(), 32);
    assert!(matches!(why, sweepd::error::Error::Refused(_)), "{why:?}");
    let said = why.with_causes();
    assert!(said.starts_with("every place is taken"), "{said}");
    assert_eq!(said.matches("ExceedsMax").count(), 1, "{said}");
}

#[test]
fn bug_an_instance_whose_daemon_was_killed_while_it_made_a_service_could_not_be_started_again() {
    let files = Files::new();
    let daemon = server(&files, 0);
    let folder = files.place.root().join("services");
    let is_it = |text: &str| text.contains("/v1/transforms_vel\"");
    let entries = std::fs::read_dir(&folder).unwrap();
    let services = entries.map(|entry| entry.unwrap().path());
    let (path, text) = services
        .map(|path| (path.clone(), std::fs::read_to_string(path).unwrap()))
        .find(|(_, text)| is_it(text))
        .unwrap();
    drop(daemon);
    assert!(!path.exists(), "it went with the daemon");
    // A file in the state before its service exists: it is writable.
    std::fs::write(&path, text).unwrap();
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o600)).unwrap();
    drop(server(&files, 0));
}

#[test]
fn bug_a_wait_of_less_than_a_microsecond_ends() {
    let (ended, end) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let files = Files::new();
        let mut server = server(&files, 0);
        let clock = SystemClock;
        let link = IoxLink::open(&files.place, &clock, u64::MAX);
        let mut link = link.unwrap();
        for timeout_ns in (1..2_000).step_by(37) {
            server.wait(timeout_ns, &clock).unwrap();
            Link::wait(&mut link, timeout_ns).unwrap();
        }
        ended.send(()).unwrap();
    });
    // Nothing in this test wakes a thread that sleeps for ever.
    let end = end.recv_timeout(Duration::from_secs(60));
    assert!(end.is_ok(), "a wait does not end");
}

#[test]
fn bug_a_wait_ends_at_its_time_and_not_at_the_next_tick_of_the_systems_timer() {
    let files = Files::new();
    let mut server = server(&files, 0);
    let clock = SystemClock;
    while server.wait(0, &clock).unwrap() != sweepd::transport::Wake::default() {}
    // With timer ticks at 250 Hz each of these waits took 4 ms or more; the shortest one shows the intended wait,
    // whatever other load there is.
    let timeout_ns = 2_300_000;
    let took = (0..50).map(|_| {
        let before_ns = clock.monotonic_ns();
        server.wait(timeout_ns, &clock).unwrap();
        clock.monotonic_ns() - before_ns
    });
    let least_ns = took.min().unwrap();
    assert!((timeout_ns..3_300_000).contains(&least_ns), "{least_ns}");
}

#[test]
fn a_client_without_a_daemon_times_out_and_makes_nothing() {
    let files = Files::new();
    let none = ClientOptions {
        timeout_ns: SECOND_NS / 5,
        ..options(&files, None)
    };
    let error = none.connect().unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    assert!(error.to_string().contains("sweepd run"), "{error}");
    assert!(!files.root.exists(), "only a daemon makes the root");
}

/// A node of iceoryx2 on the test's files, as any other program could open it.
fn stranger(files: &Files) -> iceoryx2::prelude::Node<ipc::Service> {
    let mut config = Config::default();
    let root = IoxPath::new(files.root.to_str().unwrap().as_bytes()).unwrap();
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(files.prefix.as_bytes()).unwrap();
    NodeBuilder::new().config(&config).create().unwrap()
}

#[test]
fn rows_or_headers_of_another_type_are_refused_at_the_door() {
    let files = Files::new();
    let _daemon = StandIn::iceoryx(&files.place, Manners::default());
    let node = stranger(&files);
    let name = "cell/v1/transforms".try_into().unwrap();
    let bytes = node
        .service_builder(&name)
        .publish_subscribe::<[u8]>()
        .user_header::<FrameHeader>()
        .open();
    let single = node
        .service_builder(&name)
        .publish_subscribe::<TransformRow>()
        .user_header::<FrameHeader>()
        .open();
    let bare = node
        .service_builder(&name)
        .publish_subscribe::<[TransformRow]>()
        .open();
    for (what, refused) in [
        ("bytes", bytes.is_err()),
        ("a single row", single.is_err()),
        ("no header", bare.is_err()),
    ] {
        assert!(refused, "{what}");
    }
    let mut good = options(&files, Some("sim")).connect().unwrap();
    good.step(
        &FrameInfo::default(),
        Rows::Poses(&poses(1, 1.0)),
        2 * SECOND_NS,
    )
    .unwrap();
}

#[test]
fn a_daemon_of_another_wire_version_is_refused_with_both_versions() {
    let files = Files::new();
    let server = Server::open(ServerOptions::new(files.place.clone(), 7)).unwrap();
    // the hello of a newer daemon, on the service whose layout is frozen
    let node = stranger(&files);
    let hello = node
        .service_builder(&"cell/hello".try_into().unwrap())
        .publish_subscribe::<Hello>()
        .open()
        .unwrap();
    let publisher = hello.publisher_builder().create().unwrap();
    std::thread::scope(|scope| {
        let client = scope.spawn(|| options(&files, None).connect().map(|_| ()));
        let mut theirs = Hello {
            magic: *b"sweepd\0\0",
            wire_version: 2,
            ..Hello::default()
        };
        theirs.sweepd_version[..5].copy_from_slice(b"9.9.9");
        while !client.is_finished() {
            publisher.send_copy(theirs).unwrap();
            std::thread::park_timeout(Duration::from_millis(10));
        }
        let error = client.join().unwrap().unwrap_err();
        assert_eq!(error.exit_code(), 4);
        let text = error.to_string();
        assert!(
            text.contains("9.9.9") && text.contains("wire version 2"),
            "{text}"
        );
        assert!(text.contains(env!("CARGO_PKG_VERSION")), "{text}");
    });
    drop(server);
}

/// Its topics have other names; the error was `no daemon runs`.
#[test]
fn bug_a_daemon_that_has_only_the_hello_in_common_is_refused_with_both_versions() {
    let files = Files::new();
    std::fs::create_dir_all(&files.root).unwrap();
    let node = stranger(&files);
    let hello = node
        .service_builder(&"cell/hello".try_into().unwrap())
        .publish_subscribe::<Hello>()
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(1)
        .history_size(1)
        .create()
        .unwrap();
    let publisher = hello.publisher_builder().create().unwrap();
    let mut theirs = Hello {
        magic: *b"sweepd\0\0",
        wire_version: 2,
        ..Hello::default()
    };
    theirs.sweepd_version[..5].copy_from_slice(b"9.9.9");
    publisher.send_copy(theirs).unwrap();
    std::thread::scope(|scope| {
        let client = scope.spawn(|| options(&files, None).connect().map(|_| ()));
        while !client.is_finished() {
            publisher.update_connections().unwrap();
            std::thread::park_timeout(Duration::from_millis(10));
        }
        let error = client.join().unwrap().unwrap_err();
        assert_eq!(error.exit_code(), 4, "{error}");
        let text = error.to_string();
        assert!(
            text.contains("9.9.9") && text.contains("wire version 2"),
            "{text}"
        );
    });
}

#[test]
fn a_removed_root_does_not_let_a_second_daemon_in_and_the_first_goes_on() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let mut client = options(&files, Some("sim")).connect().unwrap();
    std::fs::remove_dir_all(&files.root).unwrap();
    let refused = Server::open(ServerOptions::new(files.place.clone(), 8)).unwrap_err();
    assert!(
        refused.to_string().contains("taken by process"),
        "{refused}"
    );
    assert_eq!(client.wait_tick(5 * SECOND_NS).unwrap(), Heard::Tick);
    drop(client);
    drop(daemon);
}

#[test]
fn what_a_killed_daemon_leaves_is_seen_and_cleaned_on_demand_and_a_living_one_goes_on() {
    let files = Files::new();
    let living = files.place.with_instance("living").unwrap();
    let daemon = StandIn::iceoryx(&living, Manners::default());
    let child = spawn(&files, "daemon");
    let pid = child.id();
    let look = || leftovers(&files.place).unwrap();
    let names = |nodes: &[sweepd::transport::iceoryx::NodeOwner]| -> Vec<String> {
        nodes.iter().map(|node| node.name.clone()).collect()
    };
    let before = look();
    assert!(names(&before.alive).contains(&"sweepd/cell/daemon".to_owned()));
    assert!(before.dead.is_empty() && before.locks.is_empty() && before.unclear == 0);
    kill_and_reap(child);
    let left = look();
    assert_eq!(names(&left.dead), ["sweepd/cell/daemon"]);
    assert_eq!(left.dead[0].pid, pid);
    assert_eq!(left.locks.len(), 1);
    assert_eq!(left.locks[0].instance, "cell");
    let shared = || {
        let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let ours = entries.filter(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            name.starts_with(&files.prefix)
        });
        ours.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let files_left = shared().len();

    // A client that only looks cleans nothing, not even when its node comes and goes, and neither does a cleanup of
    // another place.
    let reader = ClientOptions {
        place: living.clone().looking_only(),
        ..options(&files, None)
    };
    drop(reader.connect().unwrap());
    list_instances(&living.clone().looking_only()).unwrap();
    let elsewhere = clean_leftovers(&files.place, Some("living")).unwrap();
    assert_eq!(elsewhere, Cleaned::default());
    assert_eq!(
        (look().dead, look().locks),
        (left.dead.clone(), left.locks.clone())
    );

    let done = clean_leftovers(&files.place, Some("cell")).unwrap();
    assert_eq!((done.nodes, done.locks), (left.dead, left.locks));
    assert_eq!(done.failed, Vec::<String>::new());
    let after = look();
    assert!(after.dead.is_empty() && after.locks.is_empty());
    assert!(shared().len() < files_left, "{files_left} files were there");
    assert_eq!(
        clean_leftovers(&files.place, None).unwrap(),
        Cleaned::default()
    );

    let alive = ClientOptions {
        place: living,
        ..options(&files, Some("sim"))
    };
    let mut client = alive.connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    let rows = poses(3, 1.0);
    client
        .step(&FrameInfo::default(), Rows::Poses(&rows), 2 * SECOND_NS)
        .unwrap();
    assert_eq!(client.view().tick().header.boot_id, 7);

    // A file that no process has mapped is reported; the files of the running daemon are not, however old they look.
    let stray = std::path::Path::new("/dev/shm").join(format!("{}stray", files.prefix));
    std::fs::write(&stray, [0; 8192]).unwrap();
    for path in shared() {
        let file = std::fs::File::options().write(true).open(path).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH)
            .unwrap();
    }
    let unmapped = look().unmapped;
    assert_eq!((unmapped.files, unmapped.example), (1, Some(stray)));
    assert_eq!(unmapped.bytes, 8192);
    drop(client);
    daemon.stop();
}

#[test]
fn bug_frames_waited_until_a_large_request_was_copied() {
    let files = Files::new();
    let mut server = server(&files, 0);
    let mut link = IoxLink::open(&files.place, &SystemClock, u64::MAX).unwrap();
    let header = |request| RequestHeader {
        json_len: 2,
        request,
        schema: WIRE_VERSION,
        reserved: 0,
    };
    let blob: Vec<u8> = (0..3_u32 << 20).map(|at| (at % 251) as u8).collect();
    link.request(&header(1), b"{}", &[&blob]).unwrap();
    link.request(&header(2), b"[]", &[]).unwrap();
    let (mut looks, mut frames, mut asked) = (0, 0, Vec::new());
    let mut inbox = Inbox::default();
    until("both requests", || {
        Link::send(
            &mut link,
            &FrameHeader::default(),
            Rows::Poses(&poses(1, 0.0)),
        )
        .unwrap();
        // While some of the frames are not copied yet, no wait lasts.
        let wake = server.wait(60 * SECOND_NS, &SystemClock).unwrap();
        assert!(wake.notified);
        inbox.clear();
        server.receive(&mut inbox, &SystemClock);
        frames += inbox.frames().len();
        looks += 1;
        server.requests(&mut |_, header, bytes| asked.push((header.request, bytes)));
        asked.len() == 2
    });
    assert!(looks >= 10, "3 MiB were copied in {looks} looks");
    assert_eq!(frames, looks, "each look found its frame");
    assert_eq!(asked[0].1[2..], blob[..]);
    assert_eq!((asked[0].0, &asked[1]), (1, &(2, b"[]".to_vec())));
}
