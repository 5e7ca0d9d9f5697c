//! A constant frame rate: a source whose own work takes 7 to 15 ms of each frame of 20 ms, and a daemon whose ticks
//! would take longer than what is left of any of them.
//!
//! * `machine` - no daemon: the source works, and then looks at the clock until the result would be there. What is
//!   late here is the machine's doing.
//! * `deadline`, `time_left` - the frame says when its time is up, or how much it has left; the daemon has no budget of
//!   its own.
//! * `fixed` - the frame says nothing, the daemon has a budget: what the source leaves on average, and what it leaves
//!   at least.
//! * `unlimited` - neither: what the daemon would take.
//!
//! Scene: `meshes` of `benches/budget.rs`, 200 pairs of meshes of 19,880 triangles, here moved by 5 % of their diameter
//! a frame; pairs and contacts are listened to.
//!
//! Method: a daemon as `sweepd run` makes it, in a process of its own (this program again), in lockstep over shared
//! memory. The source's work is drawn anew for each frame, the same for all cases, and it is work, not sleep. Then the
//! source sends the frame and waits for that frame's result; what is left after that it sleeps. A frame that is late
//! delays the begin of the next.
//!
//! `total`: from the begin of a frame to its result. `used`: from sending to the result, as a share of what the source
//! left of the frame; `used_with_rest` counts what the daemon went on to work after it, too. `undecided`: pairs without
//! a verdict, of all candidates. `unfinished`: of the pairs told, those whose bounds or contacts were not finished at
//! the frame's poses. `preempted`: the times that the scheduler took the core from source or daemon.
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
/// The source's own work: shortest and longest.
const WORK_NS: [u64; 2] = [7_000_000, 15_000_000];
/// Kept back of each frame for the way there and back, as `sweepd feed --work` does: two wake-ups, reading the rows.
const WAY_NS: u64 = 300_000;
/// What the source leaves of a frame for the tick on average, and at least.
const MEAN_NS: u64 = FRAME_NS - (WORK_NS[0] + WORK_NS[1]) / 2 - WAY_NS;
const LEAST_NS: u64 = FRAME_NS - WORK_NS[1] - WAY_NS;
/// Motion of a surface point a frame, percent of the diameter: 5 m/s, so that little of what was proved holds on.
const MOTION_PERCENT: f64 = 5.0;
const FRAMES_DEFAULT: usize = 1_500;
/// Frames before the measurement: the cold start, connections, growth of slices, page faults.
const FRAMES_WARM: usize = 50;
/// A frame without any limit takes many times 20 ms: so many fewer of these.
const UNLIMITED_PART: usize = 20;

const COLUMNS: &str = "machine,commit,compiler,seed,case,budget_ms,pairs,frames,work_min_ms,work_p50_ms,work_max_ms,\
     total_p50_ms,total_p99_ms,total_max_ms,late_frames,preempted,used_percent,used_with_rest_percent,tick_p50_ms,\
     tick_max_ms,overruns,undecided_percent,unfinished_percent,contacts_mean\n";

/// What a frame says of its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Says {
    Nothing,
    Deadline,
    TimeLeft,
}

/// Who answers frames, and what ends its work.
struct Case {
    name: &'static str,
    /// The daemon's budget; `None`: it has none.
    budget_ns: Option<u64>,
    /// `None`: nobody is asked.
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

/// The daemon's part: until its standard input ends.
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

/// What was measured; times in nanoseconds, lists in the order of frames.
#[derive(Default)]
struct Tally {
    work_ns: Vec<u64>,
    /// From the frame's begin to its result.
    total_ns: Vec<u64>,
    tick_ns: Vec<u64>,
    /// Sums over all frames.
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

/// The source's side of a daemon.
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

    /// The poses of the next frame.
    fn advance(&mut self) {
        self.courses.advance();
        self.rows.clear();
        self.rows.extend(self.courses.rows());
    }

    /// Sends the frame and waits for its result.
    ///
    /// * `end_ns` - when the frame ends, monotonic.
    fn ask(&mut self, end_ns: u64) {
        let until_ns = end_ns - WAY_NS;
        let mut info = FrameInfo::default();
        match self.says {
            Says::Nothing => {}
            Says::Deadline => info.deadline_ns = until_ns,
            // 0 would say nothing.
            Says::TimeLeft => {
                let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
                info.time_left_ns = left_ns.max(1);
            }
        }
        let rows = Rows::Poses(&self.rows);
        self.client.step(&info, rows, 60 * SECOND_NS).unwrap();
        // Else the frame's word was not heard.
        let given_ns = self.client.view().tick().budget_ns;
        assert!(self.says == Says::Nothing || given_ns <= FRAME_NS);
    }

    /// Adds what the result says.
    fn count(&self, tally: &mut Tally) {
        let view = self.client.view();
        let tick = view.tick();
        tally.tick_ns.push(tick.elapsed_ns);
        // Of the tick before; in the mean of many frames that is the same.
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

/// Looks at the clock until then: work, as far as the machine can tell.
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

/// Frame after frame; `warm` is called before the first that counts.
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

/// A quantile, milliseconds.
fn ms(times: &mut [u64], share: f64) -> String {
    format!("{:.2}", quantile(times, share) as f64 * 1e-6)
}

fn percent(part: f64, whole: f64) -> f64 {
    100.0 * part / whole.max(1.0)
}

/// The columns from `case` on.
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
