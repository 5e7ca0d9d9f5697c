//! The receiving thread (`ros-rx`): waits on every subscription, decodes, and puts frames and poses on the shelf.
//!
//! In: samples of anybody in the DDS domain. Out: frames for the tick thread, which is woken; faults in words.

use std::sync::Arc;
use std::time::Duration;

use ros2_client::{Gid, MessageInfo, Subscription};
use rustdds::mio1::{Events, Interest, Poll, Token, Waker};
use serde::de::DeserializeOwned;

use super::poses::{Receipt, Source};
use super::shared::Shared;
use super::shelf::{Shelf, Update};
use super::speak::Book;
use crate::error::{Error, Result};
use crate::limits::FRAME_ROWS_MAX;
use crate::time::{Clock as _, SystemClock};
use crate::wire::ros::{BodyTransforms, Odometry, PoseStamped, TfMessage, Twist};
use crate::wire::{Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, name_bytes};

/// Longest sleep: how soon the end, and chains that never change, are seen.
const SLEEP: Duration = Duration::from_nanos(SLEEP_NS);
/// [`SLEEP`], nanoseconds.
const SLEEP_NS: u64 = 100_000_000;
/// Samples taken from one subscription in one go, so that a flooder starves nobody.
const TAKES_MAX: usize = 256;
/// Samples that cannot be decoded, in one go.
const ERRORS_MAX: usize = 64;
/// How often faults are looked for, nanoseconds.
const FAULTS_NS: u64 = 500_000_000;
/// Faults told at a time; a thousand bodies without frames have one cause.
const FAULTS_MAX: usize = 10;
/// Token of the waker.
const WAKE: Token = Token(usize::MAX);

/// A subscription and where its messages go.
pub(super) enum Line {
    /// `~/transforms`.
    Transforms(Subscription<BodyTransforms>),
    /// Links, for these sources.
    Links {
        /// The subscription.
        from: Subscription<TfMessage>,
        /// Whether they never change.
        fixed: bool,
        /// Places of the sources.
        sources: Vec<usize>,
    },
    /// Poses of one body.
    Pose(Subscription<PoseStamped>, Feeder),
    /// Odometry of one body.
    Odometry(Subscription<Odometry>, Feeder),
}

/// Whose topic it is, and who sends on it.
#[derive(Clone, Debug)]
pub(super) struct Feeder {
    /// Place of the source.
    pub(super) source: usize,
    /// Place of the body among those of its source.
    pub(super) member: usize,
    /// The topic's full name.
    pub(super) topic: String,
    /// The two publishers last heard, and when, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) heard: [Option<(Gid, u64)>; 2],
}

impl Feeder {
    fn hear(&mut self, info: &MessageInfo, now_ns: u64) {
        let gid = info.publisher_gid();
        let [first, second] = &mut self.heard;
        match first {
            Some((own, at)) if *own == gid => *at = now_ns,
            _ => {
                *second = first.take();
                *first = Some((gid, now_ns));
            }
        }
    }

    /// Two publishers within a second: the body would jump between them.
    fn fault(&self, now_ns: u64) -> Option<String> {
        let fresh = |heard: &Option<(Gid, u64)>| {
            heard.is_some_and(|(_, at)| now_ns.saturating_sub(at) < 1_000_000_000)
        };
        self.heard.iter().all(fresh).then(|| {
            format!(
                "topic {}: two publishers send poses of one body: stop one of them",
                self.topic
            )
        })
    }
}

/// The receiving thread's own things.
pub(super) struct Inlet {
    pub(super) lines: Vec<Line>,
    pub(super) sources: Vec<Source>,
    pub(super) shelf: Arc<Shelf>,
    pub(super) shared: Arc<Shared>,
    /// Wakes the tick thread.
    pub(super) wake: Box<dyn Fn() + Send>,
    /// The scene's frame.
    pub(super) frame_id: String,
    /// The daemon's heartbeat: a longer silence of this loop means that the process stood still, nanoseconds.
    pub(super) heartbeat_ns: u64,
    poll: Poll,
    updates: Vec<Update>,
    looked_ns: u64,
    frame_fault: Option<(String, u64)>,
}

impl Inlet {
    /// Registers every subscription.
    ///
    /// * returns - the thread's things, and what wakes it.
    ///
    /// # Errors
    /// `Error::Io` when there is no descriptor left.
    pub(super) fn new(
        mut lines: Vec<Line>,
        sources: Vec<Source>,
        shelf: Arc<Shelf>,
        shared: Arc<Shared>,
        wake: Box<dyn Fn() + Send>,
        (frame_id, heartbeat_ns): (String, u64),
    ) -> Result<(Self, Waker)> {
        let failed = |e| Error::io("ROS 2: cannot wait on subscriptions", e);
        let poll = Poll::new().map_err(failed)?;
        let waker = Waker::new(poll.registry(), WAKE).map_err(failed)?;
        for (at, line) in lines.iter_mut().enumerate() {
            let (registry, token) = (poll.registry(), Token(at));
            match line {
                Line::Transforms(from) => registry.register(from, token, Interest::READABLE),
                Line::Links { from, .. } => registry.register(from, token, Interest::READABLE),
                Line::Pose(from, _) => registry.register(from, token, Interest::READABLE),
                Line::Odometry(from, _) => registry.register(from, token, Interest::READABLE),
            }
            .map_err(failed)?;
        }
        let inlet = Self {
            lines,
            sources,
            shelf,
            shared,
            wake,
            frame_id,
            heartbeat_ns,
            poll,
            updates: Vec::new(),
            looked_ns: 0,
            frame_fault: None,
        };
        Ok((inlet, waker))
    }

    /// Runs until the node closes.
    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(64);
        let mut round_ns = SystemClock.boottime_ns();
        let mut more = false;
        while !self.shared.stopped() {
            let sleep = if more { Duration::ZERO } else { SLEEP };
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
            };
            round_ns = now_ns;
            more = self.round(receipt);
        }
    }

    /// Takes what is there; whether there may be more.
    fn round(&mut self, receipt: Receipt) -> bool {
        let (mut came, mut more) = (false, false);
        for at in 0..self.lines.len() {
            let (some, rest) = self.take(at, receipt);
            came |= some;
            more |= rest;
        }
        came |= self.look(receipt);
        if came {
            (self.wake)();
        }
        if receipt.now_ns.saturating_sub(self.looked_ns) >= FAULTS_NS {
            self.looked_ns = receipt.now_ns;
            self.tell_faults(receipt.now_ns);
        }
        more
    }

    /// Drains one subscription; whether something came, and whether there may be more.
    fn take(&mut self, at: usize, receipt: Receipt) -> (bool, bool) {
        let Self {
            lines,
            sources,
            shelf,
            shared,
            frame_id,
            updates,
            frame_fault,
            ..
        } = self;
        let Some(line) = lines.get_mut(at) else {
            return (false, false);
        };
        updates.clear();
        match line {
            Line::Transforms(from) => {
                let book = shared.book();
                drain(from, shared, |message, _| {
                    let foreign = !message.header.frame_id.is_empty()
                        && message.header.frame_id.trim_start_matches('/') != frame_id;
                    if foreign {
                        let text = format!(
                            "frames of source {} are in \"{}\", not in the scene's frame \"{frame_id}\": they are refused",
                            message.source, message.header.frame_id
                        );
                        shared.note_refused(1);
                        *frame_fault = Some((text, receipt.now_ns));
                    }
                    let mut frame = shelf.spare();
                    fill(&mut frame, &message, &book, receipt);
                    if foreign {
                        frame.refused = Some(RejectReason::BadChain);
                    }
                    shelf.put(frame);
                })
            }
            Line::Links {
                from,
                fixed,
                sources: places,
            } => drain(from, shared, |message, _| {
                for &place in places.iter() {
                    if let Some(source) = sources.get_mut(place)
                        && source.take_links(&message, *fixed, receipt)
                    {
                        shelf.reset(place);
                        shared.say_back(&source_name(source));
                    }
                }
            }),
            Line::Pose(from, feeder) => drain(from, shared, |message, info| {
                feeder.hear(info, receipt.now_ns);
                let Some(source) = sources.get_mut(feeder.source) else {
                    return;
                };
                updates.clear();
                if source.take_pose(feeder.member, &message, receipt, updates) {
                    shelf.reset(feeder.source);
                    shared.say_back(&source_name(source));
                }
                shelf.merge(feeder.source, updates);
            }),
            Line::Odometry(from, feeder) => drain(from, shared, |message, info| {
                feeder.hear(info, receipt.now_ns);
                let Some(source) = sources.get_mut(feeder.source) else {
                    return;
                };
                updates.clear();
                if source.take_odometry(feeder.member, &message, receipt, updates) {
                    shelf.reset(feeder.source);
                    shared.say_back(&source_name(source));
                }
                shelf.merge(feeder.source, updates);
            }),
        }
    }

    /// Bodies whose chains have changed; whether there are any.
    fn look(&mut self, receipt: Receipt) -> bool {
        let (mut came, mut skew_ns) = (false, None);
        for (place, source) in self.sources.iter_mut().enumerate() {
            self.updates.clear();
            source.look(receipt, &mut self.updates);
            if !self.updates.is_empty() {
                self.shelf.merge(place, &self.updates);
                came = true;
            }
            skew_ns = skew_ns.max(source.skew_ns);
            self.shared
                .note_refused(std::mem::take(&mut source.refused));
        }
        self.shared.note_refused(self.shelf.take_passed_over());
        self.shared.set_skew(skew_ns);
        came
    }

    fn tell_faults(&mut self, now_ns: u64) {
        let mut all = Vec::new();
        let fresh = |(_, at): &(String, u64)| now_ns.saturating_sub(*at) < 4 * FAULTS_NS;
        all.extend(self.frame_fault.take_if(|fault| !fresh(fault)).and(None));
        all.extend(self.frame_fault.as_ref().map(|(text, _)| text.clone()));
        for line in &self.lines {
            if let Line::Pose(_, feeder) | Line::Odometry(_, feeder) = line {
                all.extend(feeder.fault(now_ns));
            }
        }
        for source in &self.sources {
            all.extend(source.faults(FAULTS_MAX));
        }
        all.truncate(FAULTS_MAX);
        self.shared.set_faults(all);
    }
}

fn source_name(source: &Source) -> String {
    crate::wire::name_str(&source.name)
        .unwrap_or_default()
        .to_owned()
}

/// Takes what a subscription holds.
///
/// * returns - whether something came, and whether there may be more.
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

/// A frame of the daemon from one of `~/transforms`.
fn fill(frame: &mut Frame, message: &BodyTransforms, book: &Book, receipt: Receipt) {
    frame.header = FrameHeader {
        session: message.session,
        epoch: message.epoch,
        seq: message.seq,
        sent_ns: message.sent_ns,
        stamp_ns: message.header.stamp.to_ns(),
        scene_rev: message.scene_rev,
        deadline_ns: message.deadline_ns,
        time_left_ns: message.time_left_ns,
        source: name_bytes(&message.source),
        flags: message.flags,
        clock_id: message.clock_id,
        schema: WIRE_VERSION,
        reserved: 0,
    };
    frame.received_ns = receipt.now_ns;
    frame.waited = receipt.waited;
    frame.refused = None;
    frame.transforms.clear();
    frame.velocities.clear();
    frame.stamps_ns.clear();
    frame.refused_bodies.clear();
    if message.transforms.len() > FRAME_ROWS_MAX {
        frame.refused = Some(RejectReason::OverLimit);
        return;
    }
    let rows = message.transforms.iter().map(|body| TransformRow {
        // No body has id 0: a name that nobody has is counted where unknown ids are.
        body: match body.name.as_str() {
            "" => body.body,
            name => book.id(name).unwrap_or(0),
        },
        position: body.pose.position.into(),
        orientation: body.pose.orientation.into(),
        ..TransformRow::default()
    });
    frame.transforms.extend(rows);
    let velocity = |twist: &Twist| {
        let (l, a) = (twist.linear, twist.angular);
        [l.x, l.y, l.z, a.x, a.y, a.z]
    };
    frame
        .velocities
        .extend(message.velocities.iter().map(velocity));
}
