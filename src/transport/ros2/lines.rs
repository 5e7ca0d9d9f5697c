//! Subscriptions to the topics that a scene needs, each once, and their publishers. In: sources, names. Out: [`Line`]s.

use std::collections::BTreeSet;
use std::time::Duration;

use ros2_client::{Context, Gid, MessageInfo, Node, Subscription};
use rustdds::mio1::{Interest, Registry, Token};
use serde::de::DeserializeOwned;

use super::names::Names;
use super::order::Order;
use super::poses::Source;
use super::topics::{In, TypeName, subscription};
use crate::config::RosKind;
use crate::error::{Error, Result};
use crate::transport::BodyChange;
use crate::wire::ros::{BodyTransforms, Clock, Odometry, PoseStamped, TfMessage};

/// Frames of a client. Lockstep needs each of them. Best effort matches reliable senders and others; a lost frame is
/// counted as skipped by its number, and would come too late if it was sent again.
const FRAMES: In = In {
    reliable: false,
    latched: false,
    depth: 16,
    patience: In::AT_START,
};
/// Links that change.
const LINKS: In = In {
    depth: 100,
    ..FRAMES
};
/// Links that never change: sent once, perhaps long ago.
const FIXED_LINKS: In = In {
    reliable: true,
    latched: true,
    ..LINKS
};
/// Topics of which only the newest message counts.
const NEWEST: In = In { depth: 1, ..FRAMES };
/// More samples than DDS keeps of a topic.
const FORMER_MAX: usize = 1 << 16;
const TF: TypeName = ("tf2_msgs", "TFMessage");

/// A subscription, and the receiver of its messages.
pub(super) enum Line {
    /// `~/transforms`.
    Transforms(Subscription<BodyTransforms>),
    /// Links for some sources.
    Links {
        /// The subscription.
        from: Subscription<TfMessage>,
        /// Whether they never change.
        fixed: bool,
        /// Indices of the sources.
        sources: Vec<usize>,
    },
    /// Poses of one body.
    Pose(Subscription<PoseStamped>, Feeder),
    /// Odometry of one body.
    Odometry(Subscription<Odometry>, Feeder),
    /// Simulated time, its order, and its publishers.
    Clock(Subscription<Clock>, Order, Heard),
}

impl Line {
    /// Registers it with a poll.
    pub(super) fn register(&mut self, registry: &Registry, token: Token) -> std::io::Result<()> {
        let wanted = Interest::READABLE;
        match self {
            Self::Transforms(from) => registry.register(from, token, wanted),
            Self::Links { from, .. } => registry.register(from, token, wanted),
            Self::Pose(from, _) => registry.register(from, token, wanted),
            Self::Odometry(from, _) => registry.register(from, token, wanted),
            Self::Clock(from, ..) => registry.register(from, token, wanted),
        }
    }

    /// As [`Self::register`] for the line of one body. Since every round looks at it anyway, a failure is only a fault
    /// until a later try succeeds.
    pub(super) fn wake_by(&mut self, registry: &Registry, token: Token) {
        let done = self.register(registry, token);
        if let Self::Pose(_, feeder) | Self::Odometry(_, feeder) = self {
            feeder.unwoken = done.err().map(|e| e.to_string());
        }
    }

    /// Whether its registration failed.
    pub(super) fn is_unwoken(&self) -> bool {
        self.feeder().is_some_and(|feeder| feeder.unwoken.is_some())
    }

    /// Whether its messages are whole frames, which are independent of other lines.
    pub(super) fn is_whole(&self) -> bool {
        matches!(self, Self::Transforms(_))
    }

    /// Whether it is that of `/clock`.
    pub(super) fn is_clock(&self) -> bool {
        matches!(self, Self::Clock(..))
    }

    /// Assigns it to a body: index of its source, and index of the body within the source.
    pub(super) fn feed(&mut self, source: usize, member: usize) {
        if let Self::Pose(_, feeder) | Self::Odometry(_, feeder) = self {
            (feeder.source, feeder.member) = (source, member);
        }
    }

    /// The feeder, if it is the line of one body.
    pub(super) fn feeder(&self) -> Option<&Feeder> {
        match self {
            Self::Pose(_, feeder) | Self::Odometry(_, feeder) => Some(feeder),
            _ => None,
        }
    }

    /// Text of a fault of its publishers or its registration.
    pub(super) fn fault(&self, now_ns: u64) -> Option<String> {
        match self {
            Self::Pose(_, feeder) | Self::Odometry(_, feeder) => feeder.fault(now_ns),
            Self::Clock(.., heard) => heard.are_two(now_ns).then(|| {
                "/clock: two publishers tell the time, so that it may go back and forth: stop one of them"
                    .to_owned()
            }),
            _ => None,
        }
    }
}

/// The body of a topic, and the topic's publishers.
#[derive(Clone, Debug)]
pub(super) struct Feeder {
    /// Index of the source.
    pub(super) source: usize,
    /// Index of the body within the source.
    pub(super) member: usize,
    /// The topic's full name.
    pub(super) topic: String,
    /// Its publishers.
    heard: Heard,
    /// Why the registration failed, if it did.
    unwoken: Option<String>,
}

impl Feeder {
    /// Records a message.
    pub(super) fn hear(&mut self, info: &MessageInfo, now_ns: u64) {
        self.heard.hear(info.publisher_gid(), now_ns);
    }

    fn fault(&self, now_ns: u64) -> Option<String> {
        if let Some(why) = &self.unwoken {
            return Some(format!(
                "topic {}: poses are seen up to 0.1 s late, for the system does not wake this node for them: {why}; it is tried again twice a second",
                self.topic
            ));
        }
        self.heard.are_two(now_ns).then(|| {
            format!(
                "topic {}: two publishers send poses of one body: stop one of them",
                self.topic
            )
        })
    }
}

/// The last publishers of a topic, and when each was heard, nanoseconds of `CLOCK_BOOTTIME`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heard {
    /// The newest first. More publishers than this that send strictly in turn are not detected.
    last: [Option<(Gid, u64)>; 8],
    /// Time at which one was heard again after another, nanoseconds of `CLOCK_BOOTTIME`.
    together_ns: Option<u64>,
}

/// Two publishers within this time make a body jump between them, nanoseconds.
const TOGETHER_NS: u64 = 1_000_000_000;

impl Heard {
    /// Records a message of a publisher.
    pub(super) fn hear(&mut self, from: Gid, now_ns: u64) {
        let is_fresh = |at: u64| now_ns.saturating_sub(at) < TOGETHER_NS;
        let mut last = self.last.iter();
        let place = last.position(|heard| heard.is_some_and(|(own, _)| own == from));
        let [newest, ..] = self.last;
        // A restarted publisher is a new one, and the old one is never heard again: that is no fault.
        if place.is_some_and(|place| place > 0) && newest.is_some_and(|(_, at)| is_fresh(at)) {
            self.together_ns = Some(now_ns);
        }
        let end = place.unwrap_or(self.last.len() - 1);
        if let Some(newer) = self.last.get_mut(..=end) {
            newer.rotate_right(1);
        }
        self.last[0] = Some((from, now_ns));
    }

    /// Whether two send now.
    pub(super) fn are_two(&self, now_ns: u64) -> bool {
        (self.together_ns).is_some_and(|at| now_ns.saturating_sub(at) < TOGETHER_NS)
    }
}

/// What an edit did to a body, and the subscription that it needs, where it needs one of its own.
pub(super) struct Arrival {
    /// What was done.
    pub(super) change: BodyChange,
    /// Of a body that came.
    pub(super) line: Option<Line>,
}

/// Subscribes to the topic of one body.
///
/// * `patience` - how long to wait for room among new readers.
///
/// # Errors
/// `Error::Io` when DDS refuses.
pub(super) fn of_body(
    (node, context): (&mut Node, &Context),
    kind: RosKind,
    topic: &str,
    patience: Duration,
) -> Result<Line> {
    let quality = In { patience, ..NEWEST };
    let feeder = Feeder {
        source: usize::MAX,
        member: usize::MAX,
        topic: topic.to_owned(),
        heard: Heard::default(),
        unwoken: None,
    };
    Ok(if kind == RosKind::Pose {
        let kind = ("geometry_msgs", "PoseStamped");
        let from = subscription(node, context, (topic, kind), quality)?;
        pass_over_former(&from);
        Line::Pose(from, feeder)
    } else {
        let kind = ("nav_msgs", "Odometry");
        let from = subscription(node, context, (topic, kind), quality)?;
        pass_over_former(&from);
        Line::Odometry(from, feeder)
    })
}

/// Discards the samples that a new subscription already holds.
///
/// `RustDDS` 0.15 keeps the last samples of a topic for as long as the participant lives, and gives them to each new
/// reader as if they had just been received. Of a topic that was subscribed to before they may be of any age, and no
/// evidence of where the body is.
fn pass_over_former<M: DeserializeOwned + 'static>(from: &Subscription<M>) {
    for _ in 0..FORMER_MAX {
        if matches!(from.take(), Ok(None)) {
            return;
        }
    }
}

/// The bodies that have a subscription: place of the source, and the body's own among those of the source.
pub(super) fn fed(lines: &[Line]) -> BTreeSet<(usize, usize)> {
    let feeders = lines.iter().filter_map(Line::feeder);
    feeders
        .map(|feeder| (feeder.source, feeder.member))
        .collect()
}

/// Subscribes to what the scene needs, each topic once.
///
/// * `again` - another node of the scene has run: a body that an edit has brought since may have a topic that cannot be
///   heard, and must not keep the node from opening.
/// * returns - the lines, and what was wrong with topics that are not heard.
///
/// # Errors
/// `Error::Usage` when a name is none, or is that of another topic; `Error::Io` when DDS refuses.
pub(super) fn subscribe(
    node: &mut Node,
    context: &Context,
    names: &mut Names,
    sources: &[Source],
    again: bool,
) -> Result<(Vec<Line>, Vec<String>)> {
    let own = names.claim("~/transforms").map_err(Error::Usage)?;
    let kind = ("sweepd_msgs", "BodyTransforms");
    let own = subscription(node, context, (&own, kind), FRAMES)?;
    let clock = names.claim("/clock").map_err(Error::Usage)?;
    let kind = ("rosgraph_msgs", "Clock");
    let clock = subscription(node, context, (&clock, kind), NEWEST)?;
    let clock = Line::Clock(clock, Order::default(), Heard::default());
    // The clock first: what comes in one round with a time is stamped with that.
    let mut lines = vec![clock, Line::Transforms(own)];
    let mut odd = Vec::new();
    let mut trees: Vec<(String, bool, Vec<usize>)> = Vec::new();
    // Bodies last: one that an edit has brought must not take a topic away that the scene says.
    let (links, others) = (sources.iter().enumerate())
        .partition::<Vec<_>, _>(|(_, source)| source.kind == RosKind::Tf);
    for (place, source) in links {
        for (given, fixed) in [(&source.topic, false), (&source.static_topic, true)] {
            let kind = if fixed { "fixed links" } else { "links" };
            let full = names.share(given, kind).map_err(Error::Usage)?;
            match trees.iter_mut().find(|(known, ..)| *known == full) {
                Some((.., places)) => places.push(place),
                None => trees.push((full, fixed, vec![place])),
            }
        }
    }
    for (place, source) in others {
        for (member, given) in source.topics().enumerate() {
            let full = names.claim_for_body(given).map_err(Error::Usage);
            let subscribed = full
                .and_then(|full| of_body((&mut *node, context), source.kind, &full, In::AT_START));
            match subscribed {
                Ok(mut line) => {
                    line.feed(place, member);
                    lines.push(line);
                }
                Err(e) if again => odd.push(format!("topic {given}: no poses can come: {e}")),
                Err(e) => return Err(e),
            }
        }
    }
    for (full, fixed, sources) in trees {
        let quality = if fixed { FIXED_LINKS } else { LINKS };
        let from = subscription(node, context, (&full, TF), quality)?;
        lines.push(Line::Links {
            from,
            fixed,
            sources,
        });
    }
    Ok((lines, odd))
}
