//! Shared by the benches: an engine fed by hand, quantiles, and the columns that describe the origin of a figure.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "shared by benches that each use a part of it"
)]

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use sweepd::builtin::Random;
use sweepd::daemon::build_shapes;
use sweepd::math::{Pose, Vec3};
use sweepd::scene::Scene;
use sweepd::tick::{Engine, TickInput};
use sweepd::time::{Budget, Clock, SystemClock};
use sweepd::transport::iceoryx::Place;
use sweepd::wire::{
    Demand, FrameHeader, Inbox, Outbox, TickCause, TransformRow, WIRE_VERSION, frame_flags,
    name_bytes,
};
use sweepd::world::Parts;

/// An engine and the frames it is fed with.
pub struct Bench {
    pub engine: Engine,
    pub scene: Scene,
    pub rows: Vec<TransformRow>,
    clock: Arc<SystemClock>,
    inbox: Inbox,
    seq: u64,
}

/// The time a tick took, nanoseconds.
pub struct Took {
    pub wall_ns: u64,
    /// CPU time of the thread.
    pub cpu_ns: u64,
    /// Part of the wall time: work after the outbox was filled.
    pub rest_ns: u64,
}

impl Bench {
    pub fn new(text: &str) -> Self {
        let scene = Scene::parse(text, "bench", Path::new(".")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        Self::of(scene, shapes.bodies)
    }

    /// * `shapes` - the shapes of each body of the scene, in its order.
    pub fn of(scene: Scene, shapes: Vec<Parts>) -> Self {
        let clock = Arc::new(SystemClock);
        let engine = Engine::new(&scene, shapes, 1, Arc::clone(&clock) as Arc<dyn Clock>).unwrap();
        let moving = scene.bodies.iter().filter(|body| body.moves);
        let rows = moving.map(|body| row(body.id.0, &body.pose)).collect();
        Self {
            engine,
            scene,
            rows,
            clock,
            inbox: Inbox::default(),
            seq: 0,
        }
    }

    /// Runs one tick with a frame of these rows, and the work after it for which the budget has time left.
    pub fn tick(
        &mut self,
        rows: &[TransformRow],
        full: bool,
        budget: Budget,
        demand: Demand,
    ) -> Took {
        self.seq += 1;
        self.inbox.clear();
        let frame = self.inbox.push();
        frame.header = FrameHeader {
            session: 1,
            seq: self.seq,
            source: name_bytes("feed"),
            flags: if full {
                frame_flags::FULL
            } else {
                frame_flags::PARTIAL
            },
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        frame.received_ns = self.clock.boottime_ns();
        frame.set_transforms(rows);
        let (woke_ns, cpu_ns) = (self.clock.monotonic_ns(), self.clock.thread_cpu_ns());
        self.engine.tick(TickInput {
            inbox: &self.inbox,
            edits: &[],
            demand,
            budget,
            cause: TickCause::Frame,
            cause_source: Some(0),
            woke_ns,
            pulse: None,
        });
        let told_ns = self.clock.monotonic_ns();
        while self.engine.work_on(u64::MAX) {}
        let now_ns = self.clock.monotonic_ns();
        Took {
            wall_ns: now_ns - woke_ns,
            cpu_ns: self.clock.thread_cpu_ns() - cpu_ns,
            rest_ns: now_ns - told_ns,
        }
    }

    pub fn out(&self) -> &Outbox {
        self.engine.outbox()
    }
}

pub use sweepd::report::rig::row;

/// Ends a daemon that [`another`] started, and deletes its files under `root`.
pub fn end(daemon: Option<Child>, root: impl AsRef<Path>) {
    if let Some(mut daemon) = daemon {
        drop(daemon.stdin.take());
        daemon.wait().unwrap();
    }
    let _left = std::fs::remove_dir_all(root);
}

/// Bodies with constant velocity and angular velocity that bounce off the walls of their cube.
pub struct Flight {
    pub poses: Vec<Pose>,
    velocities: Vec<Vec3>,
    spins: Vec<Vec3>,
    side: f64,
}

impl Flight {
    /// * `step` - speed, metres per tick.
    pub fn new(scene: &Scene, step: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let moving: Vec<_> = scene.bodies.iter().filter(|body| body.moves).collect();
        let mut direction = || {
            let v = Vec3::new(
                random.range(-1.0, 1.0),
                random.range(-1.0, 1.0),
                random.range(-1.0, 1.0),
            );
            v / v.norm().max(1e-3)
        };
        let velocities = moving.iter().map(|_| direction() * step).collect();
        let spins = moving.iter().map(|_| direction() * step).collect();
        #[allow(clippy::cast_precision_loss, reason = "small counts")]
        let side = (moving.len() as f64 / 0.5).cbrt();
        Self {
            poses: moving.iter().map(|body| body.pose).collect(),
            velocities,
            spins,
            side,
        }
    }

    /// Advances the given bodies by one tick.
    pub fn advance(&mut self, who: impl Iterator<Item = usize>) {
        for at in who {
            let pose = &mut self.poses[at];
            let velocity = &mut self.velocities[at];
            for k in 0..3 {
                let next = pose.translation.vector[k] + velocity[k];
                if !(0.0..=self.side).contains(&next) {
                    velocity[k] = -velocity[k];
                }
            }
            pose.translation.vector += *velocity;
            pose.append_rotation_wrt_center_mut(&nalgebra::UnitQuaternion::from_scaled_axis(
                self.spins[at],
            ));
            pose.rotation.renormalize();
        }
    }
}

/// The `share` quantile of times, in their unit; sorts them.
pub fn quantile(times: &mut [u64], share: f64) -> u64 {
    times.sort_unstable();
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index"
    )]
    let at = ((times.len() as f64 - 1.0) * share).round() as usize;
    times[at]
}

/// The shared memory of a bench and of the process that it starts, separate from that of other daemons.
pub fn place(root: &str) -> Place {
    Place::new("bench").unwrap().under(root, "swbench_")
}

/// Starts this program again and waits until it prints `READY`; the new process must end when its standard input ends.
pub fn another(args: &[&str]) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap())
        .read_line(&mut line)
        .unwrap();
    child
}

/// How often the scheduler preempted a process that could have continued.
pub fn preempted(process: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let mut lines = status.lines();
    let count = lines.find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"));
    count
        .and_then(|count| count.trim().parse().ok())
        .unwrap_or(0)
}

/// The command line without cargo's own argument. Exits at an unknown argument, since a bench can run for minutes and
/// overwrite saved results.
pub fn arguments(is_known: impl Fn(&str) -> bool) -> Vec<String> {
    let all = std::env::args().skip(1);
    let mine: Vec<String> = all.filter(|argument| argument != "--bench").collect();
    if let Some(unknown) = mine.iter().find(|argument| !is_known(argument)) {
        println!("unknown argument {unknown}: the first lines of this bench name those it has");
        std::process::exit(2);
    }
    mine
}

/// Machine, commit and compiler, as CSV columns.
pub fn provenance() -> String {
    let run = |command: &str, args: &[&str]| {
        let out = Command::new(command).args(args).output();
        out.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
            .unwrap_or_default()
    };
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = cpu
            .lines()
            .find(|line| line.starts_with(name))
            .unwrap_or_default();
        line.split(':').nth(1).unwrap_or_default().trim().to_owned()
    };
    let avx512 = if cpu.contains("avx512f") {
        "avx512"
    } else {
        "no avx512"
    };
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    format!(
        "{} family {} model {} {avx512} {cores} cores,{},{}",
        field("model name"),
        field("cpu family"),
        field("model\t"),
        run("git", &["rev-parse", "--short", "HEAD"]),
        run("rustc", &["--version"]).replace(',', " ")
    )
}

/// Rows of a saved CSV that `keep` accepts by their cells. The saved columns must equal `columns` or a prefix of them;
/// missing cells are left empty.
pub fn kept_rows(name: &str, columns: &str, keep: impl Fn(&[&str]) -> bool) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("benches/results")
        .join(name);
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let (old, rows) = text.split_once('\n').unwrap_or_default();
    let Some(new) = columns.trim_end().strip_prefix(old) else {
        return String::new();
    };
    let empty = ",".repeat(new.matches(',').count());
    let kept = rows
        .lines()
        .filter(|row| keep(&row.split(',').collect::<Vec<_>>()));
    kept.map(|row| format!("{row}{empty}\n")).collect()
}

/// Writes a CSV to `benches/results` and to standard output.
pub fn save(name: &str, text: &str) {
    print!("{text}");
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("benches/results")
        .join(name);
    if let Err(error) = std::fs::write(&path, text) {
        eprintln!("cannot write {}: {error}", path.display());
    }
}
