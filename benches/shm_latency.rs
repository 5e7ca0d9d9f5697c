//! The cost of shared memory for a lockstep client: time from sending a frame to receiving its result, minus the tick's
//! time.
//!
//! * `sleep` - both sides sleep at once, and an event wakes each.
//! * `event` - the default: both sides poll for 50 us, then sleep; each frame is sent as soon as the last result is
//!   there.
//! * `event_1khz` - the default with one frame per millisecond, so that the daemon is asleep when it comes.
//! * `polling` - neither side ever sleeps.
//! * `socket_echo` - two bare wake-ups on this machine, for comparison: a Unix datagram to another process and back.
//!
//! Method: a daemon without geometry in its own process (this program again) answers each frame with a tick and one
//! pair per body. The tick reports the time from wake-up to the filled outbox, which is subtracted. `preempted` counts
//! how often the scheduler preempted client or daemon: a polling row in which it is not near 0 measures other load on
//! the cores.
//!
//! `cargo bench --bench shm_latency [-- FRAMES]`
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    missing_docs,
    reason = "a bench ends at the first failure"
)]

mod common;

use std::io::Read as _;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::time::Duration;

use common::{another, end, place, preempted, provenance, save};
use sweepd::time::{Clock, SystemClock};
use sweepd::transport::Door;
use sweepd::transport::client::{ClientOptions, FrameInfo, Rows, Topics};
use sweepd::transport::iceoryx::{Server, ServerOptions};
use sweepd::wire::{Inbox, Outbox, PairRow, TransformRow, WIRE_VERSION};

const SECOND_NS: u64 = 1_000_000_000;
const FRAMES_DEFAULT: usize = 20_000;
/// Frames before the measurement: connections, growth of slices, page faults.
const FRAMES_WARM: usize = 500;

/// How long both sides poll before they sleep; `None`: the default.
fn spin_ns(how: &str) -> Option<u64> {
    match how {
        "sleep" => Some(0),
        "polling" => Some(u64::MAX),
        _ => None,
    }
}

/// A Unix datagram to another process and back: the cost of two wake-ups on this machine.
fn echo(frames: usize) -> String {
    let root = std::env::temp_dir().join(format!("swbench_echo_{}", std::process::id()));
    std::fs::create_dir_all(&root).unwrap();
    let (here, there) = (root.join("here"), root.join("there"));
    let socket = UnixDatagram::bind(&here).unwrap();
    let other = another(&["echo", there.to_str().unwrap(), here.to_str().unwrap()]);
    let clock = SystemClock;
    let mut byte = [1];
    let before = preempted("self") + preempted(&other.id().to_string());
    let mut latencies_ns: Vec<_> = (0..frames)
        .map(|_| {
            let sent_ns = clock.monotonic_ns();
            socket.send_to(&byte, &there).unwrap();
            socket.recv(&mut byte).unwrap();
            clock.monotonic_ns() - sent_ns
        })
        .collect();
    let switches = preempted("self") + preempted(&other.id().to_string());
    socket.send_to(&[0], &there).unwrap();
    end(Some(other), &root);
    report("socket_echo", 0, &mut latencies_ns, switches - before)
}

/// The other side of [`echo`]; returns when it receives a 0.
fn echo_back(own: &str, peer: &str) {
    let socket = UnixDatagram::bind(own).unwrap();
    println!("READY");
    let mut byte = [1];
    while byte[0] != 0 {
        socket.recv(&mut byte).unwrap();
        socket.send_to(&byte, peer).unwrap();
    }
}

/// Runs the daemon until standard input ends.
fn serve(root: &str, how: &str) {
    let clock = SystemClock;
    let mut options = ServerOptions {
        heartbeat_ns: SECOND_NS / 10,
        ..ServerOptions::new(place(root), 7)
    };
    if let Some(spin_ns) = spin_ns(how) {
        options.spin_ns = spin_ns;
    }
    let mut server = Server::open(options).unwrap();
    println!("READY");
    std::thread::spawn(|| {
        let mut nothing = Vec::new();
        let _ended = std::io::stdin().read_to_end(&mut nothing);
        let root = std::env::args().nth(2).unwrap();
        // The server is on another thread, so the request to stop is a file that it looks for.
        std::fs::write(format!("{root}/stop"), "").unwrap();
    });
    let (mut inbox, mut outbox) = (Inbox::default(), Outbox::default());
    outbox.tick.header.boot_id = 7;
    outbox.tick.header.schema = WIRE_VERSION;
    let stop = PathBuf::from(root).join("stop");
    loop {
        server.wait(SECOND_NS / 10, &clock).unwrap();
        let woke_ns = clock.monotonic_ns();
        inbox.clear();
        server.receive(&mut inbox, &clock);
        if inbox.frames().is_empty() {
            if stop.exists() {
                return;
            }
            server.housekeeping();
        }
        let demand = server.demand();
        for frame in inbox.frames() {
            let row = &mut outbox.tick.sources[0];
            row.name = frame.header.source;
            row.session = frame.header.session;
            row.epoch = frame.header.epoch;
            row.seq = frame.header.seq;
            outbox.tick.sources_len = 1;
            outbox.tick.header.tick += 1;
            outbox.pairs_header = outbox.tick.header;
            outbox.pairs.clear();
            if demand.pairs {
                let pairs = frame.transforms.iter().map(|row| PairRow {
                    body_a: row.body,
                    body_b: row.body + 1,
                    ..PairRow::default()
                });
                outbox.pairs.extend(pairs);
            }
            outbox.tick.elapsed_ns = clock.monotonic_ns() - woke_ns;
            server.publish(&outbox).unwrap();
        }
    }
}

fn at(sorted: &[u64], share: f64) -> f64 {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "an index below a million"
    )]
    let place = ((sorted.len() - 1) as f64 * share) as usize;
    #[allow(clippy::cast_precision_loss, reason = "nanoseconds below a minute")]
    let us = sorted[place] as f64 / 1000.0;
    us
}

fn report(how: &str, bodies: u64, latencies_ns: &mut [u64], preempted: u64) -> String {
    latencies_ns.sort_unstable();
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let line = format!(
        "{how},{bodies},{},{:.1},{:.1},{:.1},{:.1},{},{preempted}",
        latencies_ns.len(),
        at(latencies_ns, 0.5),
        at(latencies_ns, 0.9),
        at(latencies_ns, 0.99),
        at(latencies_ns, 0.999),
        load.split(' ').next().unwrap_or("")
    );
    eprintln!("{line}");
    line
}

fn measure(how: &str, bodies: u64, frames: usize) -> String {
    let root = std::env::temp_dir().join(format!("swbench_{}", std::process::id()));
    let root = root.to_str().unwrap().to_owned();
    let daemon = another(&["serve", &root, how]);
    let mut client = ClientOptions {
        place: place(&root),
        source: Some("sim".to_owned()),
        timeout_ns: 5 * SECOND_NS,
    }
    .connect()
    .unwrap();
    if let Some(spin_ns) = spin_ns(how) {
        client.set_spin_ns(spin_ns);
    }
    client
        .subscribe(Topics {
            pairs: true,
            ..Topics::default()
        })
        .unwrap();
    let rows: Vec<_> = (1..=bodies)
        .map(|body| TransformRow {
            body,
            ..TransformRow::default()
        })
        .collect();
    let clock = SystemClock;
    let mut latencies_ns = Vec::with_capacity(frames);
    let switches = || preempted("self") + preempted(&daemon.id().to_string());
    let mut before = 0;
    for frame in 0..FRAMES_WARM + frames {
        if how == "event_1khz" {
            std::thread::park_timeout(Duration::from_millis(1));
        }
        if frame == FRAMES_WARM {
            before = switches();
        }
        let sent_ns = clock.monotonic_ns();
        client
            .step(&FrameInfo::default(), Rows::Poses(&rows), SECOND_NS)
            .unwrap();
        let took_ns = clock.monotonic_ns() - sent_ns;
        assert!(client.view().pairs().is_some());
        if frame >= FRAMES_WARM {
            latencies_ns.push(took_ns.saturating_sub(client.view().tick().elapsed_ns));
        }
    }
    let line = report(how, bodies, &mut latencies_ns, switches() - before);
    drop(client);
    end(Some(daemon), &root);
    line
}

fn main() {
    let args: Vec<_> = std::env::args().collect();
    if args.get(1).is_some_and(|arg| arg == "serve") {
        return serve(&args[2], &args[3]);
    }
    if args.get(1).is_some_and(|arg| arg == "echo") {
        return echo_back(&args[2], &args[3]);
    }
    let frames = args
        .iter()
        .find_map(|arg| arg.parse().ok())
        .unwrap_or(FRAMES_DEFAULT);
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,how,bodies,frames,p50_us,p90_us,p99_us,p999_us,load,preempted\n",
    );
    csv += &format!("{from},{}\n", echo(frames));
    for how in ["sleep", "event", "event_1khz", "polling"] {
        for bodies in [1, 100, 1_000, 10_000] {
            let frames = if bodies > 1_000 { frames / 10 } else { frames };
            csv += &format!("{from},{}\n", measure(how, bodies, frames));
        }
    }
    save("shm_latency.csv", &csv);
}
