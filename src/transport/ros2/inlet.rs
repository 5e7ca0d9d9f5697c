//! The receiving thread (`ros-rx`): waits on every subscription, decodes, and puts frames and poses on the shelf.
//!
//! In: samples of any writer in the DDS domain. Out: frames for the tick thread, which is woken; texts of faults.

mod early;
mod frames;
mod links;
mod roster;
mod wrong;

use std::sync::Arc;
use std::time::Duration;

use ros2_client::{Gid, MessageInfo, Subscription};
use rustdds::mio1::{Events, Poll, Token, Waker};
use serde::de::DeserializeOwned;

use super::lines::{Feeder, Line};
use super::params::Answers;
use super::poses::{Receipt, Source};
use super::services::Services;
use super::shared::Shared;
use super::shelf::{Shelf, Update};
use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};
use crate::transport::Setting;
use crate::wire::ros::BodyTransforms;
use early::Early;
use frames::put_frame;
use links::{look_at, source_name, take_links};
pub(super) use wrong::Local;
use wrong::Wrongs;

/// Longest sleep: bounds the delay until the end of the node, and repeated poses of fixed links, are noticed.
const SLEEP: Duration = Duration::from_nanos(SLEEP_NS);
/// [`SLEEP`], nanoseconds.
const SLEEP_NS: u64 = 100_000_000;
/// Shortest sleep until a frame has waited for its names for its time-out, nanoseconds.
const SLEEP_LEAST_NS: u64 = 5_000_000;
/// Most samples taken from one subscription per round, so that one busy topic does not starve the others.
const TAKES_MAX: usize = 256;
/// Most undecodable samples taken per round.
const ERRORS_MAX: usize = 64;
/// Time between two searches for faults, nanoseconds.
const FAULTS_NS: u64 = 500_000_000;
/// Time after the start without reports, nanoseconds: other nodes may not have sent anything yet.
const QUIET_NS: u64 = 1_000_000_000;
/// Most faults reported at a time: a thousand bodies without frames usually have one cause.
const FAULTS_MAX: usize = 10;
/// Token of the waker.
const WAKE: Token = Token(usize::MAX);

/// State of the receiving thread.
pub(super) struct Inlet {
    lines: Vec<Line>,
    services: Services,
    answers: Answers,
    sources: Vec<Source>,
    shelf: Arc<Shelf>,
    shared: Arc<Shared>,
    /// Wakes the tick thread.
    wake: Box<dyn Fn() + Send>,
    local: Local,
    early: Early,
    /// The daemon's heartbeat, nanoseconds: a longer gap between two rounds means that the process was stopped.
    heartbeat_ns: u64,
    poll: Poll,
    updates: Vec<Update>,
    looked_ns: u64,
    wrongs: Wrongs,
}

impl Inlet {
    /// Registers every subscription.
    ///
    /// * returns - the thread's state, and its waker.
    ///
    /// # Errors
    /// `Error::Io` if no file descriptor or thread is left.
    pub(super) fn new(
        (mut lines, mut services, mut answers): (Vec<Line>, Services, Answers),
        sources: Vec<Source>,
        shelf: Arc<Shelf>,
        shared: Arc<Shared>,
        wake: Box<dyn Fn() + Send>,
        (local, heartbeat_ns): (Local, u64),
    ) -> Result<(Self, Arc<Waker>)> {
        let failed = |e| Error::io("ROS 2: cannot wait on subscriptions", e);
        let poll = Poll::new().map_err(failed)?;
        let waker = Arc::new(Waker::new(poll.registry(), WAKE).map_err(failed)?);
        for (at, line) in lines.iter_mut().enumerate() {
            line.register(poll.registry(), Token(at)).map_err(failed)?;
        }
        let behind = Token(lines.len());
        services.register(poll.registry(), behind).map_err(failed)?;
        answers.register(poll.registry(), behind).map_err(failed)?;
        services.start(&shared, Arc::clone(&waker))?;
        let inlet = Self {
            lines,
            services,
            answers,
            sources,
            shelf,
            shared,
            wake,
            local,
            early: Early::default(),
            heartbeat_ns,
            poll,
            updates: Vec::new(),
            looked_ns: SystemClock.boottime_ns() + QUIET_NS,
            wrongs: Wrongs::default(),
        };
        Ok((inlet, waker))
    }

    /// Runs until the node closes.
    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(64);
        let mut round_ns = SystemClock.boottime_ns();
        let mut more = false;
        while !self.shared.stopped() {
            let sleep = if more { Duration::ZERO } else { self.sleep() };
            if let Err(e) = self.poll.poll(&mut events, Some(sleep))
                && e.kind() != std::io::ErrorKind::Interrupted
            {
                tracing::error!("ROS 2: nothing more comes in: {e}");
                return;
            }
            let now_ns = SystemClock.boottime_ns();
            let silence_ns = SLEEP_NS + self.heartbeat_ns / 2;
            let receipt = Receipt {
                now_ns,
                waited: now_ns.saturating_sub(round_ns) > silence_ns.max(self.heartbeat_ns * 3 / 2),
                ros_now_ns: self.shared.now().to_ns(),
                from: Gid::ZERO,
            };
            round_ns = now_ns;
            more = self.round(receipt);
        }
    }

    /// Time to sleep until frames that wait for names are due; new names wake the thread.
    fn sleep(&self) -> Duration {
        self.early.until_ns().map_or(SLEEP, |until_ns| {
            let left_ns = until_ns.saturating_sub(SystemClock.boottime_ns());
            Duration::from_nanos(left_ns.clamp(SLEEP_LEAST_NS, SLEEP_NS))
        })
    }

    /// Takes the pending samples of all subscriptions; returns whether there may be more.
    fn round(&mut self, mut receipt: Receipt) -> bool {
        for source in &mut self.sources {
            let timeout_ns = self.shared.timeout_ns(source.place);
            source.set_limits(timeout_ns, self.shared.max_skew_ns());
        }
        self.follow_edits();
        let (mut came, mut more) = (false, false);
        for at in 0..self.lines.len() {
            let (some, rest) = self.take(at, receipt);
            more |= rest;
            // Stamps of this round are compared with the clock of this round.
            if self.lines.get(at).is_some_and(Line::is_clock) {
                receipt.ros_now_ns = self.shared.now().to_ns();
            }
            // A whole frame is handed on at once: looking at idle subscriptions and servers costs a system call each.
            if some && self.lines.get(at).is_some_and(Line::is_whole) {
                (self.wake)();
            } else {
                came |= some;
            }
        }
        came |= self.look(receipt);
        if came {
            (self.wake)();
        }
        let asked = self.services.round(&self.shared.desk, &self.shared);
        if self.answers.round(&self.shared) || asked {
            (self.wake)();
        }
        if receipt.now_ns.saturating_sub(self.looked_ns) >= FAULTS_NS {
            self.looked_ns = receipt.now_ns;
            self.tell_faults(receipt.now_ns);
        }
        more
    }

    /// Drains one subscription; returns whether samples came, and whether there may be more.
    fn take(&mut self, at: usize, receipt: Receipt) -> (bool, bool) {
        let Self {
            lines,
            sources,
            shelf,
            shared,
            local,
            early,
            updates,
            wrongs,
            ..
        } = self;
        let Some(line) = lines.get_mut(at) else {
            return (false, false);
        };
        match line {
            Line::Clock(from, order, heard) => {
                let mut back = false;
                let taken = drain(from, shared, |message, info| {
                    if shared.sim_time() {
                        heard.hear(info.publisher_gid(), receipt.now_ns);
                    }
                    back |= shared.tick_clock(message.clock, order, receipt.now_ns)
                });
                if back {
                    for (place, source) in sources.iter_mut().enumerate() {
                        source.forget();
                        shelf.reset(place);
                    }
                    shared.set(Setting::Reset);
                }
                taken
            }
            Line::Transforms(from) => {
                let held = (&*local, wrongs);
                take_frames(from, (shelf, shared), held, early, receipt)
            }
            Line::Links {
                from,
                fixed,
                sources: places,
            } => drain(from, shared, |message, info| {
                let receipt = Receipt {
                    from: info.publisher_gid(),
                    ..receipt
                };
                let of = places.iter().copied();
                take_links(
                    (sources, of),
                    (shelf, shared),
                    (&message, *fixed),
                    receipt,
                    updates,
                );
            }),
            Line::Pose(from, feeder) => drain(from, shared, |message, info| {
                feeder.hear(info, receipt.now_ns);
                let from = (&*feeder, receipt.now_ns);
                take_one(sources, shelf, shared, from, |source, updates| {
                    source.take_pose(feeder.member, &message, receipt, updates)
                });
            }),
            Line::Odometry(from, feeder) => drain(from, shared, |message, info| {
                feeder.hear(info, receipt.now_ns);
                let from = (&*feeder, receipt.now_ns);
                take_one(sources, shelf, shared, from, |source, updates| {
                    source.take_odometry(feeder.member, &message, receipt, updates)
                });
            }),
        }
    }

    /// Hands on bodies whose chains have changed; returns whether there are any.
    fn look(&mut self, receipt: Receipt) -> bool {
        let (mut came, mut skew_ns) = (false, None);
        for (place, source) in self.sources.iter_mut().enumerate() {
            came |= look_at((source, place), &self.shelf, receipt, &mut self.updates);
            skew_ns = skew_ns.max(source.skew_ns);
            self.shared
                .note_refused(std::mem::take(&mut source.refused));
        }
        self.shared.note_refused(self.shelf.take_passed_over());
        self.shared.set_skew(skew_ns);
        came
    }

    fn tell_faults(&mut self, now_ns: u64) {
        self.wake_for_all();
        let book = self.shared.book();
        let mut all = self.wrongs.words(&book, now_ns, 4 * FAULTS_NS);
        all.extend(self.lines.iter().filter_map(|line| line.fault(now_ns)));
        all.extend(self.shared.lacks_clock().map(str::to_owned));
        all.extend(self.shared_topics());
        all.extend(self.unheard().into_iter().take(FAULTS_MAX));
        for source in &mut self.sources {
            // Sources on one topic report the same faults of links that are not theirs.
            for fault in source.faults(FAULTS_MAX, now_ns) {
                if !all.contains(&fault) {
                    all.push(fault);
                }
            }
        }
        all.truncate(FAULTS_MAX);
        self.shared.set_faults(all, now_ns);
    }
}

/// Takes frames of `~/transforms`, and earlier ones whose names are known by now.
///
/// * returns - whether frames came, and whether there may be more.
fn take_frames(
    from: &Subscription<BodyTransforms>,
    (shelf, shared): (&Shelf, &Shared),
    (local, wrongs): (&Local, &mut Wrongs),
    early: &mut Early,
    receipt: Receipt,
) -> (bool, bool) {
    // The revision is read first, so that the names are at least as new as it.
    let names_rev = shared.names_rev();
    let book = shared.book();
    let mut put = |message: &BodyTransforms, receipt, refused| {
        let held = (local, &mut *wrongs);
        put_frame((shelf, shared), held, (message, receipt, refused), &book);
    };
    let mut released = false;
    while let Some((message, receipt)) = early.next(receipt.now_ns, names_rev) {
        put(&message, receipt, None);
        released = true;
    }
    let (came, more) = drain(from, shared, |message: BodyTransforms, _| {
        let place = local.place(&message.source);
        let timeout_ns = place.map(|place| shared.timeout_ns(place));
        early.take(message, receipt, names_rev, timeout_ns, &mut put);
    });
    (came || released, more)
}

/// Takes a message of one body.
fn take_one(
    sources: &mut [Source],
    shelf: &Shelf,
    shared: &Shared,
    (feeder, now_ns): (&Feeder, u64),
    take: impl FnOnce(&mut Source, &mut Vec<Update>) -> bool,
) {
    let Some(source) = sources.get_mut(feeder.source) else {
        return;
    };
    let mut updates = Vec::new();
    if take(source, &mut updates) {
        shelf.reset(feeder.source);
        shared.say_back(&source_name(source), now_ns);
    }
    shelf.merge(feeder.source, &updates);
}

/// Takes the samples of a subscription.
///
/// * returns - whether samples came, and whether there may be more.
fn drain<M: DeserializeOwned + 'static>(
    from: &Subscription<M>,
    shared: &Shared,
    mut each: impl FnMut(M, &MessageInfo),
) -> (bool, bool) {
    let (mut came, mut errors) = (false, 0);
    for _ in 0..TAKES_MAX {
        match from.take() {
            Ok(Some((message, info))) => {
                came = true;
                each(message, &info);
            }
            Ok(None) => return (came, false),
            Err(_) => {
                shared.note_undecodable();
                errors += 1;
                if errors == ERRORS_MAX {
                    return (came, true);
                }
            }
        }
    }
    (came, true)
}
