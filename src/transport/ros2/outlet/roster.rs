//! Bodies that edits add, change and remove while the node runs: their boxes and subscriptions.
//!
//! In: changes by edits. Out: subscriptions for the receiving thread. A body with an unchanged topic keeps its
//! subscription, and a failed one is tried again.

use std::collections::VecDeque;

use super::super::RosScene;
use super::super::lines::{Arrival, Line, of_body};
use super::super::open;
use super::super::shared::Say;
use super::super::topics::In;
use super::{Outlet, Topics};
use crate::config::RosKind;
use crate::error::Error;
use crate::time::{Clock as _, SystemClock};
use crate::transport::{BodyChange, BodyNote};

/// Time between two tries of failed subscriptions, nanoseconds.
const RETRY_NS: u64 = 1_000_000_000;
/// Bodies tried again at a time: each that fails again costs a look for files.
const RETRIES_MAX: usize = 8;
/// How long this thread may subscribe before it sends again, nanoseconds: one subscription can wait 50 ms for its
/// reader, and an edit can bring thousands of bodies.
const TRIES_NS: u64 = 20_000_000;

/// Bodies that need a subscription and have none.
#[derive(Debug, Default)]
pub(in super::super) struct Unheard {
    /// Not tried yet, in the order in which they came.
    untried: VecDeque<BodyNote>,
    /// Tried in vain, with the error that was logged; the one that waits longest in front.
    failed: VecDeque<(BodyNote, String)>,
    tried_ns: u64,
}

impl Unheard {
    /// The bodies of a scene that was opened in spite of failed subscriptions.
    pub(in super::super) fn of(scene: &RosScene, topics: &Topics) -> Self {
        let is_one = |body: &&BodyNote| {
            let source = body.source.and_then(|place| scene.sources.get(place));
            let own = source.and_then(|source| source.ros2.as_ref());
            own.is_some_and(|ros| ros.kind != RosKind::Tf) && !topics.hears(body)
        };
        let bodies = scene.bodies.iter().filter(is_one);
        Self {
            failed: bodies.map(|body| (body.clone(), String::new())).collect(),
            ..Self::default()
        }
    }

    /// Failed ones that are due for another try, taken out.
    fn due(&mut self, now_ns: u64) -> VecDeque<(BodyNote, String)> {
        if self.failed.is_empty() || now_ns.saturating_sub(self.tried_ns) < RETRY_NS {
            return VecDeque::new();
        }
        self.tried_ns = now_ns;
        let count = self.failed.len().min(RETRIES_MAX);
        self.failed.drain(..count).collect()
    }

    /// Notes that a body that waits for its subscription is attached to another body now, or no longer.
    fn hang(&mut self, name: &str, attached: bool) {
        let failed = self.failed.iter_mut().map(|(body, _)| body);
        let mut waiting = failed.chain(&mut self.untried);
        if let Some(body) = waiting.find(|body| body.name == name) {
            body.attached = attached;
        }
    }

    fn remove(&mut self, name: &str) {
        self.untried.retain(|body| body.name != name);
        self.failed.retain(|(body, _)| body.name != name);
    }
}

impl Outlet {
    /// Updates boxes and subscriptions after edits: only this thread has the node.
    ///
    /// Cost: at most [`TRIES_NS`] and one subscription more; bodies that are left are subscribed to at the next call.
    pub(super) fn follow_edits(&mut self) {
        let until_ns = SystemClock.monotonic_ns().saturating_add(TRIES_NS);
        let changes = std::mem::take(&mut *open(&self.shared.changes));
        for change in changes {
            let line = match &change {
                BodyChange::Put(body) => {
                    match body.bounds {
                        Some(bounds) => self.boxes.insert(body.id, bounds),
                        None => self.boxes.remove(&body.id),
                    };
                    // A second subscription needs files, and receives nothing until it is discovered.
                    let stays = self.topics.hears(body);
                    (!stays).then(|| self.meet(body, until_ns)).flatten()
                }
                BodyChange::Removed(name) => {
                    self.part(name);
                    None
                }
                BodyChange::Hung { name, attached } => {
                    self.unheard.hang(name, *attached);
                    None
                }
            };
            open(&self.shared.arrivals).push(Arrival { change, line });
        }
        self.try_untried(until_ns);
        self.try_again(SystemClock.boottime_ns(), until_ns);
    }

    /// Takes a body that is new or has another topic; returns its subscription, if it needs one and time is left.
    fn meet(&mut self, body: &BodyNote, until_ns: u64) -> Option<Line> {
        self.part(&body.name);
        // An earlier body that still waits comes first.
        if is_over(until_ns) || !self.unheard.untried.is_empty() {
            self.unheard.untried.push_back(body.clone());
            return None;
        }
        self.subscribe(body, "")
    }

    /// Subscribes for bodies that came when no time was left.
    fn try_untried(&mut self, until_ns: u64) {
        while !is_over(until_ns)
            && let Some(body) = self.unheard.untried.pop_front()
        {
            if let Some(line) = self.subscribe(&body, "") {
                self.deliver(body, line);
            }
        }
    }

    /// Tries failed subscriptions again.
    fn try_again(&mut self, now_ns: u64, until_ns: u64) {
        let mut due = self.unheard.due(now_ns);
        while !is_over(until_ns)
            && let Some((body, said)) = due.pop_front()
        {
            if let Some(line) = self.subscribe(&body, &said) {
                let text = format!("body {}: its poses can come now", body.name);
                self.shared.say(Say::Info, &text);
                self.deliver(body, line);
            }
        }
        while let Some(left) = due.pop_back() {
            self.unheard.failed.push_front(left);
        }
    }

    /// Hands the receiving thread the subscription of a body that it knows already.
    fn deliver(&self, body: BodyNote, line: Line) {
        let (change, line) = (BodyChange::Put(body), Some(line));
        open(&self.shared.arrivals).push(Arrival { change, line });
    }

    /// The subscription that a body needs, if it needs one; a body whose subscription fails is tried again later.
    ///
    /// * `said` - the error that was logged when this failed last.
    fn subscribe(&mut self, body: &BodyNote, said: &str) -> Option<Line> {
        let kind = self.sources.get(body.source?)?.ros2.as_ref()?.kind;
        if kind == RosKind::Tf {
            return None;
        }
        // The topic of an earlier try is given back.
        self.part(&body.name);
        let topic = self.topics.put(body, &mut self.names).map_err(Error::Usage);
        if let Ok(topic) = &topic {
            self.strangers.meet(topic, kind);
        }
        let with = (&mut self.node, &self.context);
        let line = topic.and_then(|topic| of_body(with, kind, &topic, In::BESIDE_TICKS));
        match line {
            Ok(line) => {
                self.topics.note_heard(&body.name);
                Some(line)
            }
            Err(e) => {
                let text = format!("body {}: no poses of it can come: {e}", body.name);
                if text != said {
                    self.shared.say(Say::Error, &text);
                }
                self.unheard.failed.push_back((body.clone(), text));
                None
            }
        }
    }

    /// Releases the topic of a body that was removed or is put again.
    fn part(&mut self, name: &str) {
        self.unheard.remove(name);
        if let Some(topic) = self.topics.remove(name, &mut self.names) {
            self.strangers.part(&topic);
            self.readers.misfits.part(&topic);
        }
    }
}

fn is_over(until_ns: u64) -> bool {
    SystemClock.monotonic_ns() >= until_ns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_without_a_subscription_are_tried_by_turns_and_not_all_the_time() {
        let names = (0..RETRIES_MAX + 2).map(|n| format!("b{n}"));
        let note = |name: String| {
            let body = BodyNote {
                name,
                ..BodyNote::default()
            };
            (body, "no files".to_owned())
        };
        let mut unheard = Unheard {
            failed: names.map(note).collect(),
            ..Unheard::default()
        };
        let first = unheard.due(RETRY_NS);
        assert_eq!((first.len(), first[0].0.name.as_str()), (RETRIES_MAX, "b0"));
        assert_eq!(first[0].1, "no files");
        unheard.failed.extend(first);
        assert!(unheard.due(2 * RETRY_NS - 1).is_empty());
        unheard.remove("b8");
        let names = unheard.due(2 * RETRY_NS).into_iter().map(|(b, _)| b.name);
        assert_eq!(names.take(2).collect::<Vec<_>>(), ["b9", "b0"]);
    }
}
