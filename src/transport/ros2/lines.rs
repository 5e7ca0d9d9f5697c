//! Subscriptions: which topics a scene needs, each once, and who sends on them. In: sources, names. Out: [`Line`]s.

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

/// Frames of a client. Lockstep wants each of them, and best effort takes them from reliable senders and from others;
/// one that is lost is counted as skipped, by its number, and would come too late if it was sent again.
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
/// Links that never change: said once, perhaps long ago.
const FIXED_LINKS: In = In {
    reliable: true,
    latched: true,
    ..LINKS
};
/// The newest is all that counts.
const NEWEST: In = In { depth: 1, ..FRAMES };
/// More samples than a topic keeps.
const FORMER_MAX: usize = 1 << 16;
const TF: TypeName = ("tf2_msgs", "TFMessage");

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
    /// Simulated time, its order, and who tells it.
    Clock(Subscription<Clock>, Order, Heard),
}

impl Line {
    /// Lets a poll wake for it.
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

    /// The same of a body's own line, which is taken at each look whoever wakes for it: where it fails that is a fault
    /// until it succeeds.
    pub(super) fn wake_by(&mut self, registry: &Registry, token: Token) {
        let done = self.register(registry, token);
        if let Self::Pose(_, feeder) | Self::Odometry(_, feeder) = self {
            feeder.unwoken = done.err().map(|e| e.to_string());
        }
    }

    /// Whether nobody wakes for it.
    pub(super) fn is_unwoken(&self) -> bool {
        self.feeder().is_some_and(|feeder| feeder.unwoken.is_some())
    }

    /// Whether its messages are whole frames, which need no look at anything else.
    pub(super) fn is_whole(&self) -> bool {
        matches!(self, Self::Transforms(_))
    }

    /// Whether it tells the time.
    pub(super) fn is_clock(&self) -> bool {
        matches!(self, Self::Clock(..))
    }

    /// Gives it to a body: place of its source, and its own among those of the source.
    pub(super) fn feed(&mut self, source: usize, member: usize) {
        if let Self::Pose(_, feeder) | Self::Odometry(_, feeder) = self {
            (feeder.source, feeder.member) = (source, member);
        }
    }

    /// Whose topic it is, where it is one body's.
    pub(super) fn feeder(&self) -> Option<&Feeder> {
        match self {
            Self::Pose(_, feeder) | Self::Odometry(_, feeder) => Some(feeder),
            _ => None,
        }
    }

    /// What is wrong with who sends.
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

/// Whose topic it is, and who sends on it.
#[derive(Clone, Debug)]
pub(super) struct Feeder {
    /// Place of the source.
    pub(super) source: usize,
    /// Place of the body among those of its source.
    pub(super) member: usize,
    /// The topic's full name.
    pub(super) topic: String,
    /// Who sends on it.
    heard: Heard,
    /// Why nobody wakes for what comes.
    unwoken: Option<String>,
}

impl Feeder {
    /// A message came.
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

/// The publishers last heard of one thing, and when, nanoseconds of `CLOCK_BOOTTIME`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heard {
    /// The newest first. More that send strictly by turns are not told.
    last: [Option<(Gid, u64)>; 8],
    /// When one was heard again after another.
    together_ns: Option<u64>,
}

/// Two publishers within this time make a body jump between them, nanoseconds.
const TOGETHER_NS: u64 = 1_000_000_000;

impl Heard {
    /// One sent something.
    pub(super) fn hear(&mut self, from: Gid, now_ns: u64) {
        let is_fresh = |at: u64| now_ns.saturating_sub(at) < TOGETHER_NS;
        let mut last = self.last.iter();
        let place = last.position(|heard| heard.is_some_and(|(own, _)| own == from));
        let [newest, ..] = self.last;
        // One that starts anew is another and the first is never heard again.
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
