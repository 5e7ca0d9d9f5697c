//! A recording daemon over memory, and the content of its recording.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use sweepd::daemon::Daemon;
use sweepd::error::Result;
use sweepd::record::file::{Ending, McapSink, Read, Reader, buffered};
use sweepd::record::{Difference, Recorder, Replay, Sink, Start, Tally, TickRecord};
use sweepd::scene::Scene;
use sweepd::shape::Library;
use sweepd::tick::build::build_shapes_in;
use sweepd::time::{Clock, ManualClock};
use sweepd::transport::memory::{Hub, MemoryServer};
use sweepd::transport::{BodyChange, Door, RequestToken, Setting, Wake};
use sweepd::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow, Undelivered};

/// A folder for a recording and the meshes of a scene; deleted on drop.
pub struct Folder(PathBuf);

static NUMBERS: AtomicU64 = AtomicU64::new(0);

impl Folder {
    pub fn new() -> Self {
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let name = format!("sweepd_record_{}_{number}", std::process::id());
        let dir = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&dir).unwrap();
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/meshes");
        for mesh in ["wedge.stl", "wedge.obj"] {
            std::fs::copy(data.join(mesh), dir.join(mesh)).unwrap();
        }
        Self(dir)
    }

    pub fn dir(&self) -> &Path {
        &self.0
    }

    pub fn file(&self) -> PathBuf {
        self.0.join("run.mcap")
    }

    /// Deletes the mesh files, so that nothing can be built from them any more.
    pub fn forget_meshes(&self) {
        for mesh in ["wedge.stl", "wedge.obj"] {
            std::fs::remove_file(self.0.join(mesh)).unwrap();
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Settings that an operator makes from outside the daemon.
pub type Panel = Arc<Mutex<Vec<Setting>>>;

/// A door over memory with an operator.
struct Desk {
    inner: MemoryServer,
    panel: Panel,
}

impl Door for Desk {
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        self.inner.wait(timeout_ns, clock)
    }
    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        self.inner.receive(inbox, clock);
    }
    fn demand(&mut self) -> Demand {
        self.inner.demand()
    }
    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        self.inner.publish(outbox)
    }
    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.inner.publish_tick(tick)
    }
    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
        self.inner.requests(take);
    }
    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        self.inner.answer(token, ok, json)
    }
    fn settings(&mut self, take: &mut dyn FnMut(Setting)) {
        self.panel.lock().unwrap().drain(..).for_each(take);
    }
    fn follows_bodies(&self) -> bool {
        true
    }
    fn bodies(&mut self, changes: &[BodyChange]) {
        self.inner.bodies(changes);
    }
    fn housekeeping(&mut self) {
        self.inner.housekeeping();
    }
}

/// Makes the sink of a recording from its start record.
pub type Make<'a> = dyn Fn(&Start) -> Box<dyn Sink> + 'a;

/// Runs a recording daemon; returns its number of ticks.
///
/// * `sink` - makes the sink of the recording; `None`: the folder's file.
/// * `drive` - called after each round until it returns true.
pub fn run(
    folder: &Folder,
    text: &str,
    hub: &Hub,
    clock: &Arc<ManualClock>,
    panel: Panel,
    sink: Option<&Make<'_>>,
    mut drive: impl FnMut() -> bool,
) -> u64 {
    let scene = Scene::parse(text, "rich.toml", folder.dir()).unwrap();
    let mut shapes = build_shapes_in(&scene, Library::keeping(), |_, _| {}).unwrap();
    let files = shapes.library.take_kept();
    let inner = MemoryServer::open(hub, 7, scene.config.heartbeat_ns).unwrap();
    let mut door = Desk { inner, panel };
    let shared = Arc::clone(clock) as Arc<dyn Clock>;
    let mut daemon = Daemon::new(&scene, shapes, 7, shared, &mut door).unwrap();
    let start = Start::of(&scene, text.to_owned(), files, 7, daemon.engine().now_ns());
    let sink = match sink {
        Some(sink) => sink(&start),
        None => {
            let file = buffered(std::fs::File::create(folder.file()).unwrap());
            Box::new(McapSink::new(file, "run.mcap", &scene.frame_id, &start).unwrap())
        }
    };
    daemon.record(Recorder::start(sink).unwrap());
    while !drive() {
        daemon.round(None).unwrap();
        daemon.engine().validate().unwrap();
    }
    let ticks = daemon.engine().ticks();
    let _told = daemon.end_record(None);
    ticks
}

/// The whole content of a complete recording.
pub fn records(path: &Path) -> (Start, Vec<TickRecord>) {
    let (start, all, ending) = ended(path);
    assert_eq!(ending, Ending::Whole);
    (start, all)
}

/// The whole content of a recording, and how it ends.
pub fn ended(path: &Path) -> (Start, Vec<TickRecord>, Ending) {
    let (mut reader, start) = Reader::open(path).unwrap();
    let mut all = Vec::new();
    loop {
        match reader.next_tick().unwrap() {
            Read::Tick(record) => all.push(record.clone()),
            Read::End(ending) => return (start, all, ending),
        }
    }
}

/// Replays records up to the first difference.
pub fn replay(start: &Start, all: Vec<TickRecord>) -> (Option<Difference>, Tally) {
    replay_from(start, all, 0)
}

/// The same; the first `run_only` records are run and not compared.
pub fn replay_from(
    start: &Start,
    all: Vec<TickRecord>,
    run_only: usize,
) -> (Option<Difference>, Tally) {
    let mut replay = Replay::new(start).unwrap();
    for (at, mut record) in all.into_iter().enumerate() {
        if let Some(found) = replay.tick(&mut record, at >= run_only).unwrap() {
            return (Some(found), replay.tally());
        }
    }
    (None, replay.tally())
}
