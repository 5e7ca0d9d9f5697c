//! A constant frame rate: a source that works for 7 to 15 ms of each frame of 20 ms, and a daemon whose unlimited ticks
//! take longer than the rest of any frame.
//!
//! * `machine` - no daemon: the source works, then polls the clock until the result would be due. Frames that are
//!   late in this case are late because of the machine.
//! * `deadline`, `time_left` - the frame carries its deadline, or the time it has left; the daemon has no budget of
//!   its own.
//! * `fixed` - the frame carries neither; the daemon's budget is the mean time that the source leaves, or the least.
//! * `unlimited` - no limit: the time that the daemon takes for all its work.
//!
//! Scene: `meshes` of `benches/budget.rs`, 200 pairs of meshes of 19,880 triangles, here moved by 5 % of their diameter
//! per frame; the client subscribes to pairs and contacts.
//!
//! Method: a daemon as `sweepd run` makes it, in its own process (this program again), in lockstep over shared memory.
//! The source's work per frame is random, the same for all cases, and busy, not sleeping. Then the source sends the
//! frame, waits for its result and sleeps for the rest of the frame. A late result delays the start of the next frame.
//!
//! `total`: from the start of a frame to its result. `used`: from sending to the result, as a share of the time that
//! the source left of the frame; `used_with_rest` adds the daemon's work after publishing. `undecided`: share of
//! candidate pairs without a verdict. `unfinished`: share of published pairs whose bounds or contacts were not complete
//! at the poses of the frame. `preempted`: number of times that the scheduler preempted source or daemon.
//!
//! `cargo bench --bench frame_rate [-- FRAMES]`
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    reason = "a bench ends at the first failure"
)]

mod common;
#[allow(
    dead_code,
    unreachable_pub,
    missing_debug_implementations,
    clippy::unwrap_used,
    reason = "shared with another bench"
)]
#[path = "time_critical/stage.rs"]
mod stage;

use std::io::Read as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use common::{another, arguments, end, place, preempted, provenance, quantile, save};
use stage::{Courses, PAIRS, bodies, shapes};
use sweepd::builtin::Random;
use sweepd::config::Mode;
use sweepd::daemon::{Daemon, Shapes};
use sweepd::shape::Library;
use sweepd::time::{Clock, SystemClock};
use sweepd::transport::client::{Client, ClientOptions, FrameInfo, Rows, Topics};
use sweepd::transport::iceoryx::{Server, ServerOptions, spawn_cleaner};
use sweepd::wire::{Level, Stage, TransformRow};

const SEED: u64 = 11;
const SECOND_NS: u64 = 1_000_000_000;
const FRAME_NS: u64 = 20_000_000;
/// The source's own work per frame: shortest and longest.
const WORK_NS: [u64; 2] = [7_000_000, 15_000_000];
/// Reserved in each frame for the transfer both ways, as in `sweepd feed --work`: two wake-ups and reading the rows.
const WAY_NS: u64 = 300_000;
/// The time the source leaves for the tick: the mean (`MEAN_NS`) and the least (`LEAST_NS`).
const MEAN_NS: u64 = FRAME_NS - (WORK_NS[0] + WORK_NS[1]) / 2 - WAY_NS;
const LEAST_NS: u64 = FRAME_NS - WORK_NS[1] - WAY_NS;
/// Motion of a surface point per frame, percent of the diameter: 5 m/s, so that few proofs stay valid from frame to
/// frame.
const MOTION_PERCENT: f64 = 5.0;
const FRAMES_DEFAULT: usize = 1_500;
/// Frames before the measurement: the cold start, connections, growth of slices, page faults.
const FRAMES_WARM: usize = 50;
/// A frame without a limit takes many times 20 ms, so that case runs this many times fewer frames.
const UNLIMITED_PART: usize = 20;

const COLUMNS: &str = "machine,commit,compiler,seed,case,budget_ms,pairs,frames,work_min_ms,work_p50_ms,work_max_ms,\
     total_p50_ms,total_p99_ms,total_max_ms,late_frames,preempted,used_percent,used_with_rest_percent,tick_p50_ms,\
     tick_max_ms,overruns,undecided_percent,unfinished_percent,contacts_mean\n";

/// How a frame limits the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Says {
    Nothing,
    Deadline,
    TimeLeft,
}

/// Whether a daemon answers the frames, and what limits its work.
struct Case {
    name: &'static str,
    /// The daemon's budget; `None`: no budget.
    budget_ns: Option<u64>,
    /// The limit in the frames; `None`: there is no daemon.
    says: Option<Says>,
    frames: usize,
}

fn cases(frames: usize) -> [Case; 6] {
    let case = |name, budget_ns, says| Case {
        name,
        budget_ns,
        says,
        frames,
    };
    [
        case("machine", None, None),
        case("deadline", None, Some(Says::Deadline)),
        case("time_left", None, Some(Says::TimeLeft)),
        case("fixed", Some(MEAN_NS), Some(Says::Nothing)),
        case("fixed", Some(LEAST_NS), Some(Says::Nothing)),
        Case {
            frames: frames.div_ceil(UNLIMITED_PART),
            ..case("unlimited", None, Some(Says::Nothing))
        },
    ]
}

static STOP: AtomicBool = AtomicBool::new(false);

/// Runs the daemon until standard input ends.
fn serve(root: &str, budget_ns: &str) {
    let (mut scene, placed) = bodies(&shapes());
    scene.config.mode = Mode::OnFrame("feed".to_owned());
    scene.config.budget.time_ns = budget_ns.parse().ok();
    let built = Shapes {
        bodies: placed,
        warnings: Vec::new(),
        notes: Vec::new(),
        library: Library::new(),
    };
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let (place, boot_id) = (place(root), 7);
    let mut server = Server::open(ServerOptions::new(place.clone(), boot_id)).unwrap();
    let _cleaner = spawn_cleaner(&place).unwrap();
    let mut daemon = Daemon::new(&scene, built, boot_id, clock, &mut server).unwrap();
    std::thread::spawn(|| {
        let mut nothing = Vec::new();
        let _ended = std::io::stdin().read_to_end(&mut nothing);
        STOP.store(true, Ordering::Relaxed);
    });
    println!("READY");
    daemon.run(&STOP, None).unwrap();
}

/// Measured values; times in nanoseconds, lists in the order of frames.
#[derive(Default)]
struct Tally {
    work_ns: Vec<u64>,
    /// From the start of the frame to its result.
    total_ns: Vec<u64>,
    tick_ns: Vec<u64>,
    /// From here on sums over all frames.
    left_ns: u64,
    used_ns: u64,
    rest_ns: u64,
    overruns: u64,
    candidates: u64,
    undecided: u64,
    told: usize,
    unfinished: usize,
    contacts: usize,
}

/// The client that sends frames to a daemon.
struct Asker {
    client: Client,
    says: Says,
    courses: Courses,
    rows: Vec<TransformRow>,
}

impl Asker {
    fn connect(root: &str, says: Says) -> Self {
        let options = ClientOptions {
            place: place(root),
            source: Some("feed".to_owned()),
            timeout_ns: 60 * SECOND_NS,
        };
        let mut client = options.connect().unwrap();
        let topics = Topics {
            pairs: true,
            contacts: true,
            ..Topics::default()
        };
        client.subscribe(topics).unwrap();
        Self {
            client,
            says,
            courses: Courses::new(MOTION_PERCENT, SEED),
            rows: Vec::new(),
        }
    }

    /// Computes the poses of the next frame.
    fn advance(&mut self) {
        self.courses.advance();
        self.rows.clear();
        self.rows.extend(self.courses.rows());
    }

    /// Sends the frame and waits for its result.
    ///
    /// * `end_ns` - end of the frame, monotonic clock.
    fn ask(&mut self, end_ns: u64) {
        let until_ns = end_ns - WAY_NS;
        let mut info = FrameInfo::default();
        match self.says {
            Says::Nothing => {}
            Says::Deadline => info.deadline_ns = until_ns,
            // 0 means that the frame sets no limit.
            Says::TimeLeft => {
                let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
                info.time_left_ns = left_ns.max(1);
            }
        }
        let rows = Rows::Poses(&self.rows);
        self.client.step(&info, rows, 60 * SECOND_NS).unwrap();
        // A larger budget would mean that the daemon ignored the limit in the frame.
        let given_ns = self.client.view().tick().budget_ns;
        assert!(self.says == Says::Nothing || given_ns <= FRAME_NS);
    }

    /// Adds the values of the result.
    fn count(&self, tally: &mut Tally) {
        let view = self.client.view();
        let tick = view.tick();
        tally.tick_ns.push(tick.elapsed_ns);
        // This is the rest of the tick before; the mean over many frames is the same.
        tally.rest_ns += tick.stage_ns[usize::from(Stage::Rest.code())];
        tally.overruns += u64::from(tick.overrun);
        tally.candidates += tick.candidates;
        tally.undecided += tick.possible;
        let pairs = &view.pairs().unwrap().rows;
        tally.told += pairs.len();
        let unfinished = pairs.iter().filter(|row| row.level != Level::Exact.code());
        tally.unfinished += unfinished.count();
        tally.contacts += view.contacts().unwrap().rows.len();
    }
}

/// Busy-waits until `until_ns`, as a stand-in for work.
fn work_until(until_ns: u64) {
    while SystemClock.monotonic_ns() < until_ns {
        std::hint::spin_loop();
    }
}

fn sleep_until(until_ns: u64) {
    loop {
        let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
        if left_ns == 0 {
            return;
        }
        std::thread::park_timeout(Duration::from_nanos(left_ns));
    }
}

/// Plays the frames one after the other; calls `warm` before the first measured frame.
fn play(mut asker: Option<&mut Asker>, frames: usize, mut warm: impl FnMut()) -> Tally {
    let clock = SystemClock;
    let (mut tally, mut random) = (Tally::default(), Random::new(SEED));
    let mut begin_ns = clock.monotonic_ns();
    for frame in 0..FRAMES_WARM + frames {
        let end_ns = begin_ns + FRAME_NS;
        let own_ns = WORK_NS[0] + random.bits() % (WORK_NS[1] - WORK_NS[0] + 1);
        if let Some(asker) = &mut asker {
            asker.advance();
        }
        work_until(begin_ns + own_ns);
        let sent_ns = clock.monotonic_ns();
        match &mut asker {
            Some(asker) => asker.ask(end_ns),
            None => work_until(end_ns - WAY_NS),
        }
        let heard_ns = clock.monotonic_ns();
        if frame >= FRAMES_WARM {
            tally.work_ns.push(sent_ns - begin_ns);
            tally.total_ns.push(heard_ns - begin_ns);
            tally.left_ns += end_ns.saturating_sub(sent_ns);
            tally.used_ns += heard_ns - sent_ns;
            if let Some(asker) = &asker {
                asker.count(&mut tally);
            }
        }
        sleep_until(end_ns);
        if frame + 1 == FRAMES_WARM {
            warm();
        }
        begin_ns = clock.monotonic_ns();
    }
    tally
}

/// A quantile as text, milliseconds.
fn ms(times: &mut [u64], share: f64) -> String {
    format!("{:.2}", quantile(times, share) as f64 * 1e-6)
}

fn percent(part: f64, whole: f64) -> f64 {
    100.0 * part / whole.max(1.0)
}

/// The CSV columns from `case` on.
fn line(case: &Case, mut tally: Tally, preempted: u64) -> String {
    let budget = match case.budget_ns {
        Some(ns) => format!("{:.1}", ns as f64 * 1e-6),
        None => "none".to_owned(),
    };
    let late = tally.total_ns.iter().filter(|ns| **ns > FRAME_NS).count();
    let work = [0.0, 0.5, 1.0].map(|share| ms(&mut tally.work_ns, share));
    let total = [0.5, 0.99, 1.0].map(|share| ms(&mut tally.total_ns, share));
    let ours = format!(
        "{},{budget},{PAIRS},{},{},{},{late},{preempted}",
        case.name,
        case.frames,
        work.join(","),
        total.join(",")
    );
    if case.says.is_none() {
        return ours + ",,,,,,,,";
    }
    let left = tally.left_ns as f64;
    let used = percent(tally.used_ns as f64, left);
    let with_rest = percent((tally.used_ns + tally.rest_ns) as f64, left);
    let tick = [0.5, 1.0].map(|share| ms(&mut tally.tick_ns, share));
    format!(
        "{ours},{used:.1},{with_rest:.1},{},{},{:.2},{:.1},{:.1}",
        tick.join(","),
        tally.overruns,
        percent(tally.undecided as f64, tally.candidates as f64),
        percent(tally.unfinished as f64, tally.told as f64),
        tally.contacts as f64 / case.frames as f64
    )
}

fn measure(case: &Case) -> String {
    let root = std::env::temp_dir().join(format!("swbench_{}", std::process::id()));
    let root = root.to_str().unwrap().to_owned();
    let budget = case
        .budget_ns
        .map_or("none".to_owned(), |ns| ns.to_string());
    let daemon = case.says.map(|_| another(&["serve", &root, &budget]));
    let mut asker = case.says.map(|says| Asker::connect(&root, says));
    let id = daemon.as_ref().map(|daemon| daemon.id().to_string());
    let switches = || preempted("self") + id.as_deref().map_or(0, preempted);
    let mut before = 0;
    let tally = play(asker.as_mut(), case.frames, || before = switches());
    let line = line(case, tally, switches() - before);
    eprintln!("{line}");
    drop(asker);
    end(daemon, &root);
    line
}

fn main() {
    let args: Vec<_> = std::env::args().collect();
    if args.get(1).is_some_and(|arg| arg == "serve") {
        return serve(&args[2], &args[3]);
    }
    let arguments = arguments(|one| one.parse::<usize>().is_ok_and(|frames| frames > 0));
    let frames: Option<usize> = arguments.iter().find_map(|one| one.parse().ok());
    let from = provenance();
    let mut csv = String::from(COLUMNS);
    for case in cases(frames.unwrap_or(FRAMES_DEFAULT)) {
        csv += &format!("{from},{SEED},{}\n", measure(&case));
    }
    save("frame_rate.csv", &csv);
}
