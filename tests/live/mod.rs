//! The real binary as a child process, for tests of what a user sees: each daemon has its own instance, every child is
//! ended and reaped, and every wait has a time limit.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::missing_panics_doc,
    clippy::disallowed_methods,
    unreachable_pub,
    missing_docs,
    reason = "shared by several test programs; each uses a part, and a test may panic and sleep"
)]

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, prlimit};
use sweepd::transport::client::{Client, FrameInfo, Heard, Rows, Topics};
use sweepd::wire::{RejectReason, State, TickRow, TransformRow};

pub const SECOND_NS: u64 = 1_000_000_000;
/// Longest wait: no operation of these tests takes longer, even on a busy machine.
pub const LONG: Duration = Duration::from_secs(60);

static NUMBERS: AtomicU64 = AtomicU64::new(0);

/// Two spheres of radius 0.5 m (`a` id 1, `b` id 2) with source `sim`, in lockstep.
pub const TWO_SPHERES: &str = r#"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 3000
[[body]]
name = "a"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "b"
shape = { type = "sphere", radius = 0.5 }
"#;

/// A folder for scenes and logs, and an instance name; the folder is deleted on drop.
#[derive(Debug)]
pub struct Desk {
    pub instance: String,
    pub dir: PathBuf,
}

impl Desk {
    pub fn new() -> Self {
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let instance = format!("t{}_{number}", std::process::id());
        let dir = std::env::temp_dir().join(format!("sweepd_{instance}"));
        std::fs::create_dir_all(&dir).unwrap();
        Self { instance, dir }
    }

    /// Writes a file atomically: a daemon that was just started may still be reading the previous content.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.dir.join(name);
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let part = self.dir.join(format!("{name}.{number}.part"));
        std::fs::write(&part, text).unwrap();
        std::fs::rename(&part, &path).unwrap();
        path
    }

    /// Writes a scene file with this text.
    pub fn scene(&self, text: &str) -> PathBuf {
        self.write("scene.toml", text)
    }

    /// Starts `sweepd COMMAND ARGS --instance INSTANCE`, with its output in files of the desk.
    pub fn start(&self, command: &str, args: &[&str]) -> Running {
        self.start_as(sweepd(), command, args)
    }

    /// The same with a binary in a given environment.
    pub fn start_as(&self, mut binary: Command, command: &str, args: &[&str]) -> Running {
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let file = |what: &str| self.dir.join(format!("{command}_{number}.{what}"));
        let (stdout, stderr) = (file("out"), file("err"));
        let child = binary
            .arg(command)
            .args(args)
            .args(["--instance", &self.instance])
            .stdin(Stdio::null())
            .stdout(std::fs::File::create(&stdout).unwrap())
            .stderr(std::fs::File::create(&stderr).unwrap())
            .spawn()
            .unwrap();
        Running {
            child,
            stdout,
            stderr,
        }
    }

    /// Starts a daemon for this scene. It may not be ready yet on return; clients wait for it.
    pub fn run(&self, scene: &str, args: &[&str]) -> Running {
        let path = self.scene(scene);
        let mut all = vec![path.to_str().unwrap()];
        all.extend_from_slice(args);
        self.start("run", &all)
    }

    pub fn client(&self, source: Option<&str>) -> Client {
        Client::connect(&self.instance, source, 30 * SECOND_NS).unwrap()
    }

    /// Connects a client that feeds this source and subscribes to everything.
    pub fn source(&self, name: &str) -> Client {
        let mut client = self.client(Some(name));
        client.subscribe(Topics::ALL).unwrap();
        client
    }

    /// Files of this instance: the lock, and the services of iceoryx2 whose text names it.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for dir in ["/dev/shm", "/tmp/iceoryx2/services"] {
            for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
                let path = entry.path();
                let text = || std::fs::read(&path).unwrap_or_default();
                let by_name = path.to_string_lossy().contains(&self.instance);
                let wanted = format!("{}/", self.instance).into_bytes();
                let names_us = || text().windows(wanted.len()).any(|w| w == wanted);
                if by_name || (dir.starts_with("/tmp") && names_us()) {
                    found.push(path);
                }
            }
        }
        found
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

/// The binary under test, without environment variables that change its output.
pub fn sweepd() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sweepd"));
    command.env_remove("NO_COLOR");
    command
}

/// The binary with a resource limit, given as shell code: `ulimit -n 20`. File descriptors inherited from this test
/// program, which has clients open, would count towards the limit, so the shell closes them first.
pub fn limited(limit: &str) -> Command {
    let close =
        r#"for f in /proc/self/fd/*; do f=${f##*/}; [ "$f" -gt 2 ] && eval "exec $f>&-"; done"#;
    let mut command = Command::new("bash");
    command
        .args(["-c", &format!("{close}; {limit} && exec \"$@\""), "bash"])
        .arg(env!("CARGO_BIN_EXE_sweepd"));
    command
}

/// The binary with SIGHUP ignored, as `nohup` starts it, or with its default action.
pub fn with_hangups(ignored: bool) -> Command {
    let mut command = Command::new("env");
    let way = if ignored {
        "--ignore-signal=HUP"
    } else {
        "--default-signal=HUP"
    };
    command.arg(way).arg(env!("CARGO_BIN_EXE_sweepd"));
    command
}

/// Runs a command until it ends.
pub fn run_out(mut command: Command, args: &[&str]) -> Output {
    command
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    finish(command.spawn().unwrap())
}

/// Runs the binary until it ends.
pub fn output(args: &[&str]) -> Output {
    run_out(sweepd(), args)
}

/// Waits for a child with piped output; kills it after [`LONG`].
pub fn finish(mut child: Child) -> Output {
    let mut pipes = (child.stdout.take(), child.stderr.take());
    let read = |pipe: Option<&mut dyn Read>| {
        let mut bytes = Vec::new();
        if let Some(pipe) = pipe {
            pipe.read_to_end(&mut bytes).unwrap();
        }
        bytes
    };
    let (stdout, stderr) = std::thread::scope(|scope| {
        let watch = Pid::from_child(&child);
        let (done, ended) = std::sync::mpsc::channel::<()>();
        scope.spawn(move || {
            if ended.recv_timeout(LONG).is_err() {
                let _ = kill_process(watch, Signal::KILL);
            }
        });
        let errors = scope.spawn(|| read(pipes.1.as_mut().map(|p| p as &mut dyn Read)));
        let stdout = read(pipes.0.as_mut().map(|p| p as &mut dyn Read));
        let stderr = errors.join().unwrap();
        done.send(()).unwrap();
        (stdout, stderr)
    });
    let status = child.wait().unwrap();
    Output {
        status,
        stdout,
        stderr,
    }
}

/// A running child; terminated and reaped on drop.
#[derive(Debug)]
pub struct Running {
    child: Child,
    stdout: PathBuf,
    stderr: PathBuf,
}

impl Running {
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Sets a soft resource limit of the child.
    pub fn limit(&self, what: Resource, most: u64) {
        let pid = Some(Pid::from_child(&self.child));
        let maximum = getrlimit(what).maximum;
        let limit = Rlimit {
            current: Some(most),
            maximum,
        };
        prlimit(pid, what, limit).unwrap();
    }

    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Kills it with SIGKILL and reaps it: an unreaped process counts as alive.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().unwrap()
    }

    /// Waits for its end; returns its exit status and the duration of the wait.
    pub fn end(&mut self) -> (ExitStatus, Duration) {
        let start = Instant::now();
        loop {
            if let Some(status) = self.ended() {
                return (status, start.elapsed());
            }
            assert!(start.elapsed() < LONG, "still running\n{}", self.stderr());
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Sends SIGTERM and waits for the end.
    pub fn stop(&mut self) -> (ExitStatus, Duration) {
        self.signal(Signal::TERM);
        self.end()
    }

    pub fn stdout(&self) -> String {
        read_text(&self.stdout)
    }

    pub fn stderr(&self) -> String {
        read_text(&self.stderr)
    }

    /// Shared memory of iceoryx2 that it has mapped.
    pub fn shared(&self) -> Vec<PathBuf> {
        let maps = read_text(Path::new(&format!("/proc/{}/maps", self.pid())));
        let mut paths: Vec<PathBuf> = maps
            .lines()
            .filter_map(|line| line.split_whitespace().nth(5))
            .filter(|path| path.starts_with("/dev/shm/") && !path.contains("global_mgmt"))
            .map(PathBuf::from)
            .collect();
        paths.sort();
        paths.dedup();
        paths
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if self.ended().is_some() {
            return;
        }
        // SIGTERM first, so that it can clean up.
        let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
        let start = Instant::now();
        while self.ended().is_none() {
            if start.elapsed() > Duration::from_secs(10) {
                let _ = self.child.kill();
                let _ = self.child.wait();
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

fn read_text(path: &Path) -> String {
    String::from_utf8_lossy(&std::fs::read(path).unwrap_or_default()).into_owned()
}

/// Waits until the condition holds.
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < LONG, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A row that places a body on the x axis.
pub fn at(body: u64, x: f64) -> TransformRow {
    TransformRow {
        body,
        position: [x, 0.0, 0.0],
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..TransformRow::default()
    }
}

/// Sends a frame and waits for its result, which is in the client's view afterwards.
pub fn step(client: &mut Client, rows: &[TransformRow]) {
    client
        .step(&FrameInfo::default(), Rows::Poses(rows), 30 * SECOND_NS)
        .unwrap();
}

pub fn send(client: &mut Client, rows: &[TransformRow]) {
    client
        .send(&FrameInfo::default(), Rows::Poses(rows))
        .unwrap();
}

/// Waits for the first tick from now on for which the condition holds.
pub fn tick_until(
    client: &mut Client,
    what: &str,
    mut holds: impl FnMut(&TickRow) -> bool,
) -> TickRow {
    let start = Instant::now();
    loop {
        assert!(
            start.elapsed() < LONG,
            "no tick: {what}; last {:?}",
            words(client.view().tick())
        );
        if client.wait_tick(SECOND_NS).unwrap() == Heard::Tick && holds(client.view().tick()) {
            return *client.view().tick();
        }
    }
}

pub fn state(tick: &TickRow) -> State {
    State::from_code(tick.header.state).unwrap()
}

pub fn rejected(tick: &TickRow, reason: RejectReason) -> u64 {
    tick.rejects[usize::from(reason.code())]
}

/// A tick as text, for messages of tests.
pub fn words(tick: &TickRow) -> String {
    format!(
        "tick {} {:?} reasons {:b} cause {} rejects {:?}",
        tick.header.tick,
        State::from_code(tick.header.state),
        tick.reasons,
        tick.cause,
        tick.rejects
    )
}
