//! `sweepd feed`: a built-in source of moving bodies, and a generator of scenes for it.

mod cadence;
mod same;

use std::sync::atomic::{AtomicBool, Ordering};

use crate::builtin::{Motion, Random, pile, pool};
use crate::error::{Error, Result, counted};
use crate::limits;
use crate::scene::Scene;
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Client, FrameInfo, Heard, Rows};
use crate::wire::{REJECTS_LEN, RejectReason, TickRow, TransformRow, name_str};

use super::args::FeedArgs;
use super::connect;
use super::files::Draft;
use super::out::Out;
use same::Same;

/// Bodies of a generated scene if no count is given.
const COUNT_DEFAULT: usize = 200;
/// Longest sleep between two checks of the stop flag, nanoseconds.
const LOOK_NS: u64 = 50_000_000;
/// Time between two checks of what the daemon reports of our frames, nanoseconds; also the lateness above which the
/// schedule is shifted, and the wait after the last frame.
const HEED_NS: u64 = 1_000_000_000;

/// Moves the bodies of a scene until stopped, or writes a scene.
pub(super) fn feed(args: &FeedArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    if let Some(path) = &args.write_scene {
        let count = args.count.unwrap_or(COUNT_DEFAULT);
        if count > limits::BODIES_MAX {
            return Err(Error::Usage(format!(
                "--count {count}: a scene has at most {} bodies",
                limits::BODIES_MAX
            )));
        }
        let text = if args.kind == "pile" {
            pile(count, args.course.seed)
        } else {
            pool(count, args.course.seed)
        };
        Draft::open(path, args.force, "a scene")?.write(&text)?;
        out.line(&format!(
            "wrote {}: {}",
            path.display(),
            counted(count, "body", "bodies")
        ))?;
        out.flush()?;
        return Ok(true);
    }
    let Some(path) = &args.scene else {
        return Err(Error::Usage(
            "give a scene file, or --write-scene FILE to make one".to_owned(),
        ));
    };
    args.course.check()?;
    let scene = Scene::load(path)?;
    let source = source_of(&scene, args.source.as_deref())?;
    let name = scene.sources[source].name.clone();
    let mut bodies = Bodies::of(&scene, source, args);
    let Some(mut client) = connect(&args.which.instance, Some(&name), args.wait, stop)? else {
        return Ok(true);
    };
    Same::subscribe(&mut client)?;
    if bodies.same.meet(&mut client, args, stop)?.is_none() {
        return Ok(true);
    }
    tracing::info!(
        "feeding {} ({} of them moving) as `{name}` at {} Hz",
        counted(bodies.rows.len(), "body", "bodies"),
        bodies.moving,
        args.course.rate
    );
    match args.work {
        Some(work_ns) => cadence::keep(args, work_ns, &mut bodies, &mut client, (out, stop))?,
        None => stream(args, &name, &mut bodies, &mut client, stop)?,
    }
    Ok(true)
}

/// Sends frames at the rate, until stopped or until the requested number is sent.
fn stream(
    args: &FeedArgs,
    source: &str,
    bodies: &mut Bodies,
    client: &mut Client,
    stop: &AtomicBool,
) -> Result<()> {
    let clock = SystemClock;
    let mut start_ns = clock.monotonic_ns();
    let mut look_ns = start_ns.saturating_add(HEED_NS);
    let mut heeded = Heeded::default();
    let mut frame = 0_u64;
    let mut is_used = false;
    while !stop.load(Ordering::Relaxed) && args.frames.is_none_or(|most| frame < most) {
        let (time_s, stamp_ns) = moment(frame, args.course.rate);
        bodies.move_to(time_s);
        let info = FrameInfo {
            stamp_ns,
            ..FrameInfo::default()
        };
        let Some(met) = bodies.same.meet(client, args, stop)? else {
            break;
        };
        start_ns = start_ns.saturating_add(met.waited_ns);
        is_used = is_used || uses(client, source);
        client.send(&info, Rows::Poses(&bodies.rows))?;
        frame += 1;
        let next_ns = start_ns.saturating_add(moment(frame, args.course.rate).1);
        let now_ns = clock.monotonic_ns();
        if now_ns >= look_ns {
            look_ns = now_ns.saturating_add(HEED_NS);
            heeded.look(client, source)?;
        }
        // After a pause of the process, sending continues from now, without a burst of the missed frames.
        let late_ns = now_ns.saturating_sub(next_ns);
        if late_ns > HEED_NS {
            start_ns = start_ns.saturating_add(late_ns);
        }
        sleep_until(&clock, next_ns, stop);
    }
    if args.frames.is_some() && frame > 0 && !is_used {
        conclude(client, source, frame, stop)?;
    }
    Ok(())
}

/// Waits after the last of a given number of frames, if none is known to be used. An unused run is an error.
fn conclude(client: &mut Client, source: &str, sent: u64, stop: &AtomicBool) -> Result<()> {
    let clock = SystemClock;
    let mut until_ns = clock.monotonic_ns().saturating_add(HEED_NS);
    let mut is_heard = false;
    while !uses(client, source) {
        let now_ns = clock.monotonic_ns();
        if stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        if now_ns >= until_ns {
            return Err(unused(source, sent, is_heard));
        }
        match client.wait_tick(LOOK_NS)? {
            Heard::Silence => {}
            // A long tick may be the one that uses these frames.
            Heard::Tick if client.view().is_under_way() => {
                until_ns = now_ns.saturating_add(HEED_NS);
            }
            Heard::Tick | Heard::Restarted(_) => is_heard = true,
        }
    }
    Ok(())
}

fn unused(source: &str, sent: u64, is_heard: bool) -> Error {
    if is_heard {
        Error::Refused(format!(
            "the daemon used none of the {sent} frames of `{source}`: look at its log, and at the `rejects` of \
             `sweepd monitor --json`; does it run the same scene, and no other feed of this source?"
        ))
    } else {
        Error::TimedOut(format!(
            "no tick since the last of {sent} frames of `{source}`, of which none was used: has the daemon ended?"
        ))
    }
}

/// Whether the daemon has used a frame of this session.
fn uses(client: &Client, source: &str) -> bool {
    let view = client.view();
    // A tick under way has no source rows.
    !view.is_under_way() && used(view.tick(), client.session(), source).is_some_and(|n| n > 0)
}

/// Number of frames of this session that the daemon has used; `None`: the source has no session, or another one.
fn used(tick: &TickRow, session: u64, source: &str) -> Option<u64> {
    let mut own = tick.sources.iter().take(usize::from(tick.sources_len));
    own.find(|row| name_str(&row.name) == Some(source) && row.session == session)
        .map(|row| row.frames)
}

/// Time of a frame from the start: seconds and nanoseconds.
fn moment(frame: u64, rate_hz: f64) -> (f64, u64) {
    #[allow(
        clippy::cast_precision_loss,
        reason = "frame counts are far below 2^53"
    )]
    let time_s = frame as f64 / rate_hz;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a time, not negative"
    )]
    let time_ns = (time_s * 1e9) as u64;
    (time_s, time_ns)
}

/// Last reports of the daemon, so that each change is logged once.
#[derive(Debug, Default)]
struct Heeded {
    boot_id: u64,
    tick: u64,
    frames: u64,
    rejects: [u64; REJECTS_LEN],
    silent: bool,
    unused: bool,
    refusing: bool,
}

impl Heeded {
    /// Logs warnings for the user: silence, a restart, refused or unused frames.
    fn look(&mut self, client: &mut Client, source: &str) -> Result<()> {
        while client.latest()? != Heard::Silence {}
        if client.view().is_under_way() {
            return Ok(());
        }
        let tick = *client.view().tick();
        let (boot_id, number) = (tick.header.boot_id, tick.header.tick);
        let silent = (boot_id, number) == (self.boot_id, self.tick);
        if silent && !self.silent {
            tracing::warn!(
                "no tick since the last second; the daemon may have ended, frames go on"
            );
        }
        if self.boot_id != 0 && boot_id != self.boot_id {
            tracing::warn!("the daemon restarted");
            // The first tick after a restart may precede the first frame.
            *self = Self {
                boot_id,
                tick: number,
                rejects: tick.rejects,
                ..Self::default()
            };
            return Ok(());
        }
        let own = used(&tick, client.session(), source);
        let unused = !silent && own.is_none_or(|frames| frames == self.frames);
        let refused: Vec<String> = RejectReason::ALL
            .iter()
            .zip(tick.rejects.iter().zip(&self.rejects))
            .filter(|(_, (now, before))| now > before)
            .map(|(reason, (now, before))| format!("{} {reason}", now - before))
            .collect();
        let refusing = !refused.is_empty();
        if unused && !self.unused {
            tracing::warn!("the daemon uses no frame of `{source}`");
        }
        if refusing && !self.refusing {
            tracing::warn!(
                "the daemon refuses (counted over all sources): {}; does it run the same scene, and no other \
                 feed of this source?",
                refused.join(", ")
            );
        }
        *self = Self {
            boot_id,
            tick: number,
            frames: own.unwrap_or(0),
            rejects: tick.rejects,
            silent,
            unused,
            refusing,
        };
        Ok(())
    }
}

/// Index of the source to send as: the named one, or the first.
fn source_of(scene: &Scene, name: Option<&str>) -> Result<usize> {
    let names = || {
        scene
            .sources
            .iter()
            .map(|s| s.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    match name {
        None if scene.sources.is_empty() => Err(Error::Usage(
            "the scene has no [[source]]; nothing in it can be moved".to_owned(),
        )),
        None => Ok(0),
        Some(name) => scene
            .sources
            .iter()
            .position(|s| s.name == name)
            .ok_or_else(|| {
                Error::Usage(format!(
                    "--source {name}: the scene has no such source; it has: {}",
                    names()
                ))
            }),
    }
}

/// The rows to send and their motions.
struct Bodies {
    same: Same,
    rows: Vec<TransformRow>,
    motions: Vec<Motion>,
    moving: usize,
}

impl Bodies {
    fn of(scene: &Scene, source: usize, args: &FeedArgs) -> Self {
        let mut random = Random::new(args.course.seed);
        let own = scene
            .bodies
            .iter()
            .filter(|b| b.moves && b.source == Some(source) && b.attached_to.is_none());
        let same = Same::new(own.clone().map(|b| (b.id.0, b.name.clone())).collect());
        let (rows, motions): (Vec<_>, Vec<_>) = own
            .map(|body| {
                let row = TransformRow {
                    body: body.id.0,
                    ..TransformRow::default()
                };
                (row, Motion::new(body.pose, args.course.motion, &mut random))
            })
            .unzip();
        let moving = args.count.unwrap_or(rows.len()).min(rows.len());
        let mut bodies = Self {
            same,
            rows,
            motions,
            moving,
        };
        bodies.place(0.0, 0);
        bodies
    }

    fn move_to(&mut self, time_s: f64) {
        self.place(time_s, self.rows.len() - self.moving);
    }

    /// Writes the poses of all but the last `still` bodies.
    fn place(&mut self, time_s: f64, still: usize) {
        let moving = self.rows.len() - still;
        for (row, motion) in self.rows.iter_mut().zip(&self.motions).take(moving) {
            let pose = motion.pose_at(time_s);
            let q = pose.rotation.as_vector();
            row.position = pose.translation.vector.into();
            row.orientation = [q.x, q.y, q.z, q.w];
        }
    }
}

/// Sleeps until a time of `CLOCK_MONOTONIC`, or until stopped; checks the stop flag at least each `LOOK_NS`.
fn sleep_until(clock: &dyn Clock, until_ns: u64, stop: &AtomicBool) {
    loop {
        let now_ns = clock.monotonic_ns();
        if now_ns >= until_ns || stop.load(Ordering::Relaxed) {
            return;
        }
        let wait_ns = (until_ns - now_ns).min(LOOK_NS);
        #[allow(
            clippy::disallowed_methods,
            reason = "a source that paces itself has nothing else to wait for"
        )]
        std::thread::sleep(std::time::Duration::from_nanos(wait_ns));
    }
}
