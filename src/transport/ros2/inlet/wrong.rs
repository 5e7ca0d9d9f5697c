//! Texts about faulty frames of `~/transforms`, with the fix: a sender gets no other report.
//!
//! In: messages, the scene's sources and bodies. Out: the reason for a refusal, and the newest fault of each source.

use std::collections::BTreeMap;

use super::super::RosScene;
use super::super::poses::{Receipt, off, seconds};
use super::super::tf::{no_pose, plain, sound};
use super::super::told::brief;
use super::frames::{id, velocity};
use crate::error::{NAMES_COMPARED_MAX, nearest};
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::ros::{BodyTransform, BodyTransforms, Book, Twist};
use crate::wire::{RejectReason, frame_flags};

/// Longest plausible time between sending and receipt of a frame, nanoseconds; beyond it `sent_ns` is of another clock.
const SENT_OFF_NS: u64 = 1_000_000_000;
/// Most sources listed in the text about an unknown one.
const SOURCES_TOLD_MAX: usize = 8;

/// A fault of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Wrong {
    /// Its text.
    Said(String),
    /// A name that no body has, and the source: the nearest name is searched only when the fault is reported.
    NoBody { name: String, source: String },
}

impl Wrong {
    fn words(&self, book: &Book) -> String {
        let (name, source) = match self {
            Self::Said(text) => return text.clone(),
            Self::NoBody { name, source } => (name, source),
        };
        let names = book.rows().map(|row| book.name(row.body));
        let names: Vec<&str> = names.take(NAMES_COMPARED_MAX).collect();
        let mend = match nearest(name, &names) {
            Some(nearest) => format!("did you mean \"{}\"?", brief(nearest)),
            None => "its names are on ~/names".to_owned(),
        };
        let (name, source) = (brief(name), brief(source));
        format!("body \"{name}\" of source {source}: the scene has no such body: {mend}")
    }
}

/// Data of the scene that frames are checked against.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Local {
    /// The scene's frame.
    pub(super) frame_id: String,
    /// The scene's sources by name, in its order.
    pub(super) sources: Vec<String>,
    /// Boot id of this run of the daemon.
    pub(super) boot_id: u64,
}

impl Local {
    /// The data of a scene in this run of the daemon.
    pub(in super::super) fn of(scene: &RosScene, boot_id: u64) -> Self {
        let sources = scene.sources.iter();
        Self {
            frame_id: scene.frame_id.clone(),
            sources: sources.map(|source| source.name.clone()).collect(),
            boot_id,
        }
    }

    /// Index of a source in the scene.
    pub(super) fn place(&self, source: &str) -> Option<usize> {
        self.sources.iter().position(|own| own == source)
    }

    /// The reason why the node refuses a frame as a whole: it is not in the scene's frame, or it names bodies by ids of
    /// another run of the daemon, in which they may belong to other bodies.
    pub(super) fn refuse(&self, message: &BodyTransforms) -> Option<(RejectReason, String)> {
        let source = brief(&message.source);
        let given = plain(&message.header.frame_id);
        if !given.is_empty() && given != plain(&self.frame_id) {
            let text = format!(
                "frames of source {source} are in \"{}\", not in the scene's frame \"{}\": they are refused",
                brief(given),
                self.frame_id
            );
            return Some((RejectReason::BadChain, text));
        }
        let by_id = message.transforms.iter().any(|body| body.name.is_empty());
        if !by_id || message.boot_id == self.boot_id {
            return None;
        }
        let text = format!(
            "frames of source {source} say bodies by id with boot_id {}, and this run of the daemon is {}: they are refused; send names, or ids with the boot_id of the ~/names they are from",
            message.boot_id, self.boot_id
        );
        Some((RejectReason::SessionOver, text))
    }

    /// The reason why the daemon will refuse a frame as a whole, as far as it follows from the header.
    pub(super) fn fault(&self, message: &BodyTransforms) -> Option<String> {
        let source = brief(&message.source);
        if self.place(&message.source).is_none() {
            let known = self.sources.iter().take(SOURCES_TOLD_MAX);
            let mut known: Vec<&str> = known.map(String::as_str).collect();
            if self.sources.len() > SOURCES_TOLD_MAX {
                known.push("..");
            }
            let has = match known.as_slice() {
                [] => "none".to_owned(),
                known => known.join(", "),
            };
            return Some(format!(
                "frames of source \"{source}\": the scene has no such source, it has {has}"
            ));
        }
        let paused = message.flags == frame_flags::PAUSED;
        let (poses, speeds) = (message.transforms.len(), message.velocities.len());
        let what = if message.session == 0 {
            "session 0: draw a random number at start".to_owned()
        } else if !paused && !matches!(message.flags, frame_flags::FULL | frame_flags::PARTIAL) {
            format!("flags {}: write FULL, PARTIAL or PAUSED", message.flags)
        } else if paused && poses > 0 {
            "PAUSED with poses: leave them out, or write FULL or PARTIAL".to_owned()
        } else if speeds > 0 && speeds != poses {
            "velocities: send one for each of the transforms, or none".to_owned()
        } else if poses > FRAME_ROWS_MAX {
            format!("more than {FRAME_ROWS_MAX} poses: send them in several, with PARTIAL")
        } else {
            return None;
        };
        Some(format!("frames of source {source} are refused: {what}"))
    }

    /// Faults of single rows of an accepted frame: an invalid pose, a body that does not exist or that another source
    /// moves, or a stamp far from the node's clock if the frame claims that clock.
    pub(super) fn odd(
        &self,
        message: &BodyTransforms,
        receipt: Receipt,
        book: &Book,
    ) -> Option<Wrong> {
        let place = self.place(&message.source)?;
        let source = brief(&message.source);
        let mut speeds = message.velocities.iter();
        let mut bodies = message.transforms.iter();
        let odd =
            bodies.find_map(|body| self.odd_body((place, &source), body, speeds.next(), book));
        let sent = sent(&source, message.sent_ns, receipt.now_ns).map(Wrong::Said);
        if let Some(odd) = odd.or(sent) {
            return Some(odd);
        }
        if message.clock_id != 0 {
            return None;
        }
        let text = off(
            ("source", &source),
            message.header.stamp.to_ns(),
            receipt,
            0,
        )?;
        let mend = "frames of another clock have a clock_id other than 0";
        Some(Wrong::Said(format!("{text}; {mend}")))
    }

    fn odd_body(
        &self,
        (place, source): (usize, &str),
        body: &BodyTransform,
        speed: Option<&Twist>,
        book: &Book,
    ) -> Option<Wrong> {
        let id = id(body, book);
        let name = match body.name.as_str() {
            "" => body.body.to_string(),
            name => brief(name).into_owned(),
        };
        if !book.holds(id) {
            return Some(match body.name.as_str() {
                "" => Wrong::Said(format!(
                    "body {name} of source {source}: the scene has no body of this id: send names, or the ids of the newest ~/names"
                )),
                name => Wrong::NoBody {
                    name: name.to_owned(),
                    source: source.to_owned(),
                },
            });
        }
        let (position, orientation) = (body.pose.position.into(), body.pose.orientation.into());
        if let Err(reason) = sound(position, orientation) {
            let what = no_pose(reason);
            return Some(Wrong::Said(format!(
                "body {name}: its pose from source {source} is {what}"
            )));
        }
        if speed.is_some_and(|speed| !velocity(speed).iter().all(|v| v.is_finite())) {
            let (reason, mend) = (RejectReason::NotFinite, RejectReason::NotFinite.mend());
            return Some(Wrong::Said(format!(
                "body {name}: its velocity from source {source} is {reason}: {mend}"
            )));
        }
        let text = match book.source(id) {
            Some(owner) if owner == place => return None,
            Some(owner) => {
                let owner = self.sources.get(owner).map_or("?", String::as_str);
                format!(
                    "body {name}: source {source} sends it on ~/transforms, but the scene has source {owner} move it: what {source} says of it is refused"
                )
            }
            None => format!(
                "body {name}: source {source} sends it, but the scene has no source move it: what {source} says of it is refused; give it a source there"
            ),
        };
        Some(Wrong::Said(text))
    }
}

/// Fault of `sent_ns`, which must be on `CLOCK_BOOTTIME` of this machine; 0 is not checked.
fn sent(source: &str, sent_ns: u64, now_ns: u64) -> Option<String> {
    let (ahead, behind) = (
        sent_ns.saturating_sub(now_ns),
        now_ns.saturating_sub(sent_ns),
    );
    let mend = "sent_ns is CLOCK_BOOTTIME of the machine that sweepd runs on: a sender on another machine writes 0";
    match sent_ns {
        0 => None,
        _ if behind > SENT_OFF_NS => Some(format!(
            "frames of source {source} come, but their sent_ns is {:.3} s old, and so are its bodies: {mend}",
            seconds(behind)
        )),
        _ if ahead > SENT_OFF_NS => Some(format!(
            "frames of source {source}: their sent_ns lies {:.3} s in the future: {mend}",
            seconds(ahead)
        )),
        _ => None,
    }
}

/// The newest fault of each source's frames; all unknown sources share one entry.
#[derive(Debug, Default)]
pub(super) struct Wrongs {
    newest: BTreeMap<Option<usize>, (Wrong, u64)>,
    orders: BTreeMap<usize, (u64, (u64, u64))>,
}

impl Wrongs {
    /// Records a frame and its fault.
    pub(super) fn note(
        &mut self,
        local: &Local,
        (message, refused): (&BodyTransforms, Option<&str>),
        receipt: Receipt,
        book: &Book,
    ) {
        let place = local.place(&message.source);
        let said = local.fault(message).or_else(|| refused.map(str::to_owned));
        let said = said.or_else(|| self.old(place?, message));
        let wrong = said.map(Wrong::Said);
        if let Some(wrong) = wrong.or_else(|| local.odd(message, receipt, book)) {
            self.newest.insert(place, (wrong, receipt.now_ns));
        }
    }

    /// Text about a frame that is not newer than the previous one of its session.
    fn old(&mut self, place: usize, message: &BodyTransforms) -> Option<String> {
        let order = (message.epoch, message.seq);
        let (session, newest) = self.orders.entry(place).or_insert((0, order));
        if *session == message.session && order <= *newest {
            let (source, mend) = (brief(&message.source), RejectReason::OldFrame.mend());
            return Some(format!(
                "frames of source {source} are refused: not newer than the one before: {mend}"
            ));
        }
        (*session, *newest) = (message.session, order);
        None
    }

    /// Texts of the current faults.
    ///
    /// * `young_ns` - faults older than this are over, nanoseconds.
    pub(super) fn words(&mut self, book: &Book, now_ns: u64, young_ns: u64) -> Vec<String> {
        let is_young = |at_ns: u64| now_ns.saturating_sub(at_ns) < young_ns;
        self.newest.retain(|_, (_, at_ns)| is_young(*at_ns));
        let newest = self.newest.values();
        newest.map(|(wrong, _)| wrong.words(book)).collect()
    }
}

#[cfg(test)]
mod tests;
