//! A stand-in daemon for transport tests: it receives frames, answers each with a tick that names it, and echoes
//! requests. It has no geometry, so a failure of these tests is one of the transport.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::missing_panics_doc,
    unreachable_pub,
    missing_docs,
    reason = "shared by several test programs; each uses a part, and a test may panic"
)]

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use sweepd::error::Result;
use sweepd::ids::BodyId;
use sweepd::time::{Clock, SystemClock};
use sweepd::transport::iceoryx::{Place, Server, ServerOptions};
use sweepd::transport::{Door, RequestToken};
use sweepd::wire::{
    ChangesHeader, ContactRow, Frame, FrameHeader, Inbox, MessageHeader, NameRow, Outbox, PairRow,
    Reason, RegionRow, RejectReason, State, TickCause, TickRow, TransformRow, Undelivered, Verdict,
    VertexHeader, WIRE_VERSION,
};

pub const SECOND_NS: u64 = 1_000_000_000;

static PLACES: AtomicU64 = AtomicU64::new(0);

/// A separate place for each test: root, prefix and instance; deleted on drop.
#[derive(Debug)]
pub struct Files {
    pub place: Place,
    pub root: PathBuf,
    pub prefix: String,
}

impl Files {
    pub fn new() -> Self {
        let number = PLACES.fetch_add(1, Ordering::Relaxed);
        let prefix = format!("swt{}_{number}_", std::process::id());
        let root = std::env::temp_dir().join(format!("{prefix}root"));
        let place = Place::new("cell").unwrap().under(&root, &prefix);
        Self {
            place,
            root,
            prefix,
        }
    }

    /// Files of this place in shared memory and under the root, except for directories and the one management file that
    /// iceoryx2 keeps for ever.
    pub fn left(&self) -> Vec<String> {
        let mut left = Vec::new();
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(&self.prefix) && !name.contains("global_mgmt") {
                left.push(name);
            }
        }
        let mut dirs = vec![self.root.clone()];
        while let Some(dir) = dirs.pop() {
            let Ok(entries) = std::fs::read_dir(&dir) else {
                continue;
            };
            for entry in entries.flatten() {
                if entry.path().is_dir() {
                    dirs.push(entry.path());
                } else if !entry.path().to_string_lossy().contains("global_mgmt") {
                    left.push(entry.path().display().to_string());
                }
            }
        }
        left
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.root);
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry
                .file_name()
                .to_string_lossy()
                .starts_with(&self.prefix)
            {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// The messages that the stand-in received.
#[derive(Clone, Debug, Default)]
pub struct Log {
    pub frames: Vec<(FrameHeader, usize, Option<RejectReason>, bool)>,
    pub vertices: Vec<(VertexHeader, Vec<[f32; 3]>, Option<RejectReason>)>,
    pub ended: Vec<u64>,
    pub requests: Vec<Vec<u8>>,
}

/// The behaviour of the stand-in.
#[derive(Clone, Copy, Debug)]
pub struct Manners {
    pub boot_id: u64,
    /// It sleeps for this time before its first tick.
    pub nap: Duration,
    pub heartbeat_ns: u64,
    /// Whether each tick with frames is announced by ticks without lists before its result, as a slow tick is.
    pub long_ticks: bool,
}

impl Default for Manners {
    fn default() -> Self {
        Self {
            boot_id: 7,
            nap: Duration::ZERO,
            heartbeat_ns: 20_000_000,
            long_ticks: false,
        }
    }
}

/// A running stand-in.
#[derive(Debug)]
pub struct StandIn {
    stop: Arc<AtomicBool>,
    pub log: Arc<Mutex<Log>>,
    thread: Option<JoinHandle<()>>,
}

impl StandIn {
    /// Starts it on its own thread; returns when its door is open.
    pub fn start<D: Door>(
        manners: Manners,
        open: impl FnOnce() -> Result<D> + Send + 'static,
    ) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let log = Arc::new(Mutex::new(Log::default()));
        let (opened, wait) = std::sync::mpsc::channel();
        let (stopped, noted) = (Arc::clone(&stop), Arc::clone(&log));
        let thread = std::thread::spawn(move || {
            let mut door = open().expect("the door opens");
            opened.send(()).unwrap();
            serve(&mut door, manners, &stopped, &noted);
        });
        wait.recv().expect("the door opened");
        Self {
            stop,
            log,
            thread: Some(thread),
        }
    }

    pub fn iceoryx(place: &Place, manners: Manners) -> Self {
        let options = ServerOptions {
            heartbeat_ns: manners.heartbeat_ns,
            ..ServerOptions::new(place.clone(), manners.boot_id)
        };
        Self::start(manners, move || Server::open(options))
    }

    pub fn log(&self) -> Log {
        self.log.lock().unwrap().clone()
    }

    pub fn stop(mut self) {
        self.halt();
    }

    fn halt(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("the stand-in panicked");
        }
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        self.halt();
    }
}

fn serve(door: &mut dyn Door, manners: Manners, stop: &AtomicBool, log: &Mutex<Log>) {
    let clock = SystemClock;
    let (mut inbox, mut outbox) = (Inbox::default(), Outbox::default());
    outbox.tick.header.boot_id = manners.boot_id;
    outbox.tick.header.schema = WIRE_VERSION;
    let mut name = NameRow {
        body: 1,
        len: 3,
        ..NameRow::default()
    };
    name.name[..3].copy_from_slice(b"box");
    outbox.names = vec![name];
    outbox.plan = "{\"broad\":\"brute\"}".to_owned();
    outbox.names_changed = true;
    outbox.plan_changed = true;
    std::thread::park_timeout(manners.nap);
    while !stop.load(Ordering::Relaxed) {
        door.wait(manners.heartbeat_ns, &clock).unwrap();
        inbox.clear();
        door.receive(&mut inbox, &clock);
        note(log, &inbox);
        answer(door, log);
        let demand = door.demand();
        for frame in inbox.frames() {
            admit(&mut outbox.tick, frame);
            outbox.tick.cause = TickCause::Frame.code();
            if manners.long_ticks {
                tell_of(door, &outbox.tick);
            }
            tick(door, &mut outbox, demand, frame);
        }
        if inbox.frames().is_empty() {
            outbox.tick.cause = TickCause::Heartbeat.code();
            tick(door, &mut outbox, demand, &Frame::default());
            door.housekeeping();
        }
    }
}

fn note(log: &Mutex<Log>, inbox: &Inbox) {
    let mut log = log.lock().unwrap();
    for frame in inbox.frames() {
        log.frames.push((
            frame.header,
            frame.transforms.len(),
            frame.refused,
            frame.waited,
        ));
    }
    let vertices = inbox.vertices().iter();
    log.vertices
        .extend(vertices.map(|v| (v.header, v.rows.clone(), v.refused)));
    log.ended.extend_from_slice(inbox.ended());
}

fn answer(door: &mut dyn Door, log: &Mutex<Log>) {
    let mut asked: Vec<(RequestToken, String)> = Vec::new();
    door.requests(&mut |token, header, bytes| {
        let json = &bytes[..usize::try_from(header.json_len).unwrap()];
        log.lock().unwrap().requests.push(bytes.clone());
        let text = format!(
            "{{\"ok\":true,\"scene_rev\":{},\"warnings\":[{:?}]}}",
            bytes.len(),
            String::from_utf8_lossy(json)
        );
        asked.push((token, text));
    });
    for (token, text) in asked {
        door.answer(token, true, &text).unwrap();
    }
}

fn admit(tick: &mut TickRow, frame: &Frame) {
    let bad = frame
        .refused
        .or_else(|| (frame.header.schema != WIRE_VERSION).then_some(RejectReason::BadLayout));
    if let Some(reason) = bad {
        tick.rejects[usize::from(reason.code())] += 1;
        return;
    }
    let known = usize::from(tick.sources_len);
    let at = (0..known)
        .find(|&i| tick.sources[i].name == frame.header.source)
        .unwrap_or(known);
    let row = &mut tick.sources[at];
    let header = &frame.header;
    if row.session == header.session && (row.epoch, row.seq) >= (header.epoch, header.seq) {
        tick.rejects[usize::from(RejectReason::OldFrame.code())] += 1;
        return;
    }
    row.name = frame.header.source;
    row.session = frame.header.session;
    row.epoch = frame.header.epoch;
    row.seq = frame.header.seq;
    row.frames += 1;
    tick.sources_len = tick.sources_len.max(u8::try_from(at + 1).unwrap());
}

/// Announces a tick that is under way: the tick alone, as a daemon sends it at each heartbeat.
fn tell_of(door: &mut dyn Door, last: &TickRow) {
    let mut bare = TickRow {
        header: last.header,
        rejects: last.rejects,
        reasons: Reason::Undecided.bit(),
        ..TickRow::default()
    };
    bare.header.tick += 1;
    bare.header.state = State::Unknown.code();
    for _ in 0..2 {
        bare.sent_ns = SystemClock.boottime_ns();
        door.publish_tick(&bare).unwrap();
    }
}

fn tick(door: &mut dyn Door, outbox: &mut Outbox, demand: sweepd::wire::Demand, frame: &Frame) {
    outbox.tick.header.tick += 1;
    outbox.tick.sent_ns = SystemClock.boottime_ns();
    outbox.tick.bodies = frame.transforms.len() as u64;
    let header: MessageHeader = outbox.tick.header;
    (outbox.pairs_header, outbox.contacts_header) = (header, header);
    outbox.bodies_header = header;
    outbox.pairs.clear();
    outbox.regions_header = header;
    outbox.contacts.clear();
    outbox.regions.clear();
    // one colliding pair per body, enough to tell frames apart
    let pair = |row: &TransformRow| PairRow {
        body_a: row.body,
        body_b: row.body + 1,
        verdict: Verdict::Colliding.code(),
        certified_verdict: Verdict::Colliding.code(),
        gap_best_m: row.position[0],
        ..PairRow::default()
    };
    let pairs: Vec<PairRow> = frame.transforms.iter().map(pair).collect();
    if demand.pairs {
        outbox.pairs.clone_from(&pairs);
    }
    retell(
        outbox.tick.header,
        demand.changes_anew,
        (&mut outbox.changes_header, &mut outbox.changes),
        &pairs,
        |row| row.body_a,
        |row| PairRow {
            verdict: Verdict::Apart.code(),
            ..*row
        },
    );
    let contact = |row: &TransformRow| ContactRow {
        body_a: row.body,
        gap_m: row.position[0],
        ..ContactRow::default()
    };
    let contacts: Vec<ContactRow> = frame.transforms.iter().map(contact).collect();
    if demand.contacts {
        outbox.contacts.clone_from(&contacts);
    }
    retell(
        outbox.tick.header,
        demand.changes_anew,
        (
            &mut outbox.contact_changes_header,
            &mut outbox.contact_changes,
        ),
        &contacts,
        |row| row.body_a,
        |row| ContactRow::gone((BodyId(row.body_a), BodyId(row.body_b))),
    );
    for row in &frame.transforms {
        if demand.regions {
            outbox.regions.push(RegionRow {
                body_a: row.body,
                radius_m: row.position[0],
                ..RegionRow::default()
            });
        }
    }
    assert_eq!(door.publish(outbox).unwrap(), Undelivered::default());
    outbox.names_changed = false;
    outbox.plan_changed = false;
}

/// Updates a list of changes: all present rows, and the rows of the tick before that are gone.
///
/// * `left` - makes the row that reports that a pair has left the list.
fn retell<R: Copy + PartialEq>(
    tick: MessageHeader,
    anew: bool,
    (header, rows): (&mut ChangesHeader, &mut Vec<R>),
    now: &[R],
    body: fn(&R) -> u64,
    left: fn(&R) -> R,
) {
    let before = header.message.tick;
    let whole = anew || before + 1 != tick.tick;
    *header = ChangesHeader {
        message: tick,
        base_tick: if whole { 0 } else { before },
        listed: now.len() as u64,
    };
    let is_there = |row: &R| now.iter().any(|now| body(now) == body(row));
    rows.retain(|row| !whole && *row != left(row) && !is_there(row));
    for row in &mut *rows {
        *row = left(row);
    }
    rows.extend_from_slice(now);
}

/// `n` bodies whose x identifies the frame that they are from.
pub fn poses(n: u64, x: f64) -> Vec<TransformRow> {
    (1..=n)
        .map(|body| TransformRow {
            body,
            position: [x, 0.0, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..TransformRow::default()
        })
        .collect()
}

/// Waits until a condition holds, at most ten seconds.
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let clock = SystemClock;
    let end_ns = clock.monotonic_ns() + 10 * SECOND_NS;
    while !holds() {
        assert!(clock.monotonic_ns() < end_ns, "never: {what}");
        std::thread::park_timeout(Duration::from_millis(2));
    }
}
