//! `sweepd run`: the daemon on shared memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::config::Mode;
use crate::daemon::{Daemon, Watchdog};
use crate::error::{Error, Result, counted};
use crate::scene::Scene;
use crate::time::{Clock, SystemClock};
use crate::transport::iceoryx::{
    Cleaner, Place, Server, ServerOptions, bytes_needed, cramped, scarce, spawn_cleaner,
};
use crate::transport::{Both, Door};

use super::args::RunArgs;
use super::files::inputs;
use super::progress::shapes_of;
use super::record::Tape;
use super::ros;
use super::values::Limit;

/// Exit code when the watchdog ends the process.
const EXIT_WATCHDOG: i32 = 5;
/// Longest time for the watchdog's last line, nanoseconds: on a machine that thrashes a line takes seconds.
const LAST_LINE_NS: u64 = 5_000_000_000;
/// Default time of the watchdog, nanoseconds; a long heartbeat makes it longer.
const WATCHDOG_NS: u64 = 10_000_000_000;
/// Least time of the watchdog beyond a heartbeat, nanoseconds. A long tick shows progress each heartbeat, an idle
/// daemon each 100 ms, and a busy machine may delay either.
const WATCHDOG_BEYOND_NS: u64 = 1_000_000_000;

/// Runs the daemon until a signal, or for the requested number of ticks.
pub(super) fn run(args: &RunArgs, ros_words: Option<&[String]>, stop: &AtomicBool) -> Result<bool> {
    let place = Place::new(&args.which.instance)?;
    let asked = ros::Asked::read(args, ros_words)?;
    let text = Scene::read_text(&args.scene)?;
    let mut scene = Scene::parse_at(&text, &args.scene)?;
    apply(args, &mut scene)?;
    asked.check(&scene)?;
    let watchdog = watchdog(args, &scene)?;
    let mut read = inputs(&args.scene, &scene);
    read.extend(ros::inputs(ros_words));
    let tape = Tape::of(args, &read)?;
    let mut shapes = shapes_of(&scene, tape.library())?;
    let given = (text, shapes.library.take_kept());
    for warning in scene.notes().iter().chain(&shapes.warnings) {
        tracing::warn!("{warning}");
    }
    let boot_id = crate::transport::client::random_u64()?;
    let mut options = ServerOptions::new(place.clone(), boot_id);
    options.heartbeat_ns = scene.config.heartbeat_ns;
    if let Some(spin_ns) = args.spin {
        options.spin_ns = spin_ns;
    }
    if args.busy_poll {
        options.spin_ns = u64::MAX;
    }
    let Some((mut server, _cleaner)) = open(options, stop)? else {
        return Ok(true);
    };
    let (bodies, sources) = (scene.bodies.len(), scene.sources.len());
    let limits = &scene.config.limits;
    let short = [
        scarce(bytes_needed(limits, bodies, sources)),
        cramped(limits, bodies),
    ];
    for warning in short.iter().flatten() {
        tracing::warn!("{warning}");
    }
    let mut node = asked.open(&scene, &shapes, &place, boot_id)?;
    let mut both;
    let door: &mut dyn Door = match ros::door(&mut node) {
        Some(node) => {
            both = Both::new(&mut server, node);
            &mut both
        }
        None => &mut server,
    };
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let mut daemon = Daemon::new(&scene, shapes, boot_id, clock, door)?;
    tape.begin(&mut daemon, &scene, given, boot_id)?;
    let watchdog = match watchdog {
        Limit::None => None,
        Limit::Of(limit_ns) => Some(Watchdog::start(Duration::from_nanos(limit_ns), give_up)?),
    };
    if let Some(watchdog) = &watchdog {
        daemon.watched_by(watchdog);
    }
    tracing::info!(
        "instance `{}` runs {}: {}, {}",
        args.which.instance,
        args.scene.display(),
        counted(bodies, "body", "bodies"),
        counted(sources, "source", "sources")
    );
    daemon.run(stop, args.ticks)?;
    // A failed recording was reported when it failed; it is no error here, since the daemon has done its work.
    let _told_already = daemon.end_record(watchdog);
    let ticks = counted(daemon.engine().ticks(), "tick", "ticks");
    tracing::info!("ended after {ticks}");
    Ok(true)
}

/// The server, and the thread that cleans up dead clients outside the tick; `None`: a signal came before they were
/// ready.
fn open(options: ServerOptions, stop: &AtomicBool) -> Result<Option<(Server, Cleaner)>> {
    let place = options.place.clone();
    let opened = Server::open(options).and_then(|server| Ok((server, spawn_cleaner(&place)?)));
    match opened {
        // A signal interrupts waits of iceoryx2 at its start, which it reports as a failure.
        Err(cut_off) if stop.load(Ordering::Relaxed) => {
            tracing::info!("ended by a signal before it ran: {}", cut_off.with_causes());
            Ok(None)
        }
        opened => opened.map(Some),
    }
}

/// Ends the process for its watchdog. The last line bypasses the log, since a stalled thread may hold its lock. If
/// stderr blocks, which may be what stalls the tick thread, the process ends without the line.
fn give_up() {
    let wait = || {
        let start_ns = SystemClock.monotonic_ns();
        while SystemClock.monotonic_ns().saturating_sub(start_ns) < LAST_LINE_NS {
            std::thread::park_timeout(Duration::from_nanos(LAST_LINE_NS));
        }
        std::process::exit(EXIT_WATCHDOG);
    };
    let thread = std::thread::Builder::new().name("sweepd-last".to_owned());
    let _none_left = thread.spawn(wait);
    let line: &[u8] =
        b"sweepd: the tick thread makes no progress: the daemon ends, start it again\n";
    let _told_if_it_can_be = rustix::io::write(std::io::stderr(), line);
    std::process::exit(EXIT_WATCHDOG);
}

/// Longest time without progress in a tick. A value that would end a healthy daemon is refused.
fn watchdog(args: &RunArgs, scene: &Scene) -> Result<Limit> {
    let least_ns = scene.config.heartbeat_ns.saturating_add(WATCHDOG_BEYOND_NS);
    match args.watchdog {
        None => Ok(Limit::Of(WATCHDOG_NS.max(least_ns))),
        Some(Limit::Of(limit_ns)) if limit_ns < least_ns => Err(Error::Usage(format!(
            "--watchdog: {} ms is shorter than a healthy daemon may pause with the heartbeat of this scene; give at least \
             {} ms, or `none`",
            limit_ns / 1_000_000,
            least_ns.div_ceil(1_000_000)
        ))),
        Some(limit) => Ok(limit),
    }
}

/// Applies the flags, which override the scene.
fn apply(args: &RunArgs, scene: &mut Scene) -> Result<()> {
    let limit = |limit| match limit {
        Limit::None => None,
        Limit::Of(most) => Some(most),
    };
    if let Some(budget) = args.budget {
        scene.config.budget.time_ns = limit(budget);
    }
    if let Some(units) = args.budget_units {
        scene.config.budget.units = limit(units);
    }
    if let Some(mode) = &args.mode {
        if let Mode::OnFrame(name) = mode {
            let wrong = match scene.sources.iter().find(|own| own.name == *name) {
                Some(own) => own.ros2.as_ref().map(|_| crate::scene::no_lockstep(name)),
                None => {
                    let text =
                        "the scene has no source of that name; add a [[source]] or name another";
                    Some(text.to_owned())
                }
            };
            if let Some(wrong) = wrong {
                return Err(Error::Usage(format!("--mode on_frame={name}: {wrong}")));
            }
        }
        scene.config.mode = mode.clone();
    }
    Ok(())
}
