//! Bodies that come, change and go while the node runs: their boxes, and the subscriptions that they need.
//!
//! In: what edits did. Out: subscriptions for the receiving thread; a body that is heard where it was keeps its own,
//! and one whose subscription failed is tried again.

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

/// Between two tries of bodies whose subscription failed, nanoseconds.
const RETRY_NS: u64 = 1_000_000_000;
/// Bodies tried at a time: each that fails again costs a look for files.
const RETRIES_MAX: usize = 8;

/// Bodies that need a subscription and have none, and what was said of each: who waits longest in front.
#[derive(Debug, Default)]
pub(in super::super) struct Unheard {
    of: VecDeque<(BodyNote, String)>,
    tried_ns: u64,
}

impl Unheard {
    /// Those of a scene that was opened all the same.
    pub(in super::super) fn of(scene: &RosScene, topics: &Topics) -> Self {
        let is_one = |body: &&BodyNote| {
            let source = body.source.and_then(|place| scene.sources.get(place));
            let own = source.and_then(|source| source.ros2.as_ref());
            own.is_some_and(|ros| ros.kind != RosKind::Tf) && !topics.hears(body)
        };
        let bodies = scene.bodies.iter().filter(is_one);
        Self {
            of: bodies.map(|body| (body.clone(), String::new())).collect(),
            tried_ns: 0,
        }
    }

    /// Those whose turn it is, taken out.
    fn due(&mut self, now_ns: u64) -> Vec<(BodyNote, String)> {
        if self.of.is_empty() || now_ns.saturating_sub(self.tried_ns) < RETRY_NS {
            return Vec::new();
        }
        self.tried_ns = now_ns;
        self.of.drain(..self.of.len().min(RETRIES_MAX)).collect()
    }

    /// A body that waits for its subscription hangs on another one now, or does no more.
    fn hang(&mut self, name: &str, attached: bool) {
        let mut waiting = self.of.iter_mut();
        if let Some((body, _)) = waiting.find(|(body, _)| body.name == name) {
            body.attached = attached;
        }
    }

    fn remove(&mut self, name: &str) {
        self.of.retain(|(body, _)| body.name != name);
    }
}

impl Outlet {
    /// Boxes and subscriptions of bodies that edits put: only this thread has the node.
    pub(super) fn follow_edits(&mut self) {
        let changes = std::mem::take(&mut *open(&self.shared.changes));
        for change in changes {
            let line = match &change {
                BodyChange::Put(body) => {
                    match body.bounds {
                        Some(bounds) => self.boxes.insert(body.id, bounds),
                        None => self.boxes.remove(&body.id),
                    };
                    // A second subscription takes files that may not be there, and until it is found nothing comes.
                    let stays = self.topics.hears(body);
                    (!stays).then(|| self.meet(body, "")).flatten()
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
        self.try_again(SystemClock.boottime_ns());
    }

    /// Bodies whose subscription failed: what was in its way may be gone.
    fn try_again(&mut self, now_ns: u64) {
        for (body, said) in self.unheard.due(now_ns) {
            let Some(line) = self.meet(&body, &said) else {
                continue;
            };
            let text = format!("body {}: its poses can come now", body.name);
            self.shared.say(Say::Info, &text);
            let (change, line) = (BodyChange::Put(body), Some(line));
            open(&self.shared.arrivals).push(Arrival { change, line });
        }
    }

    /// Takes a body that came, or is heard elsewhere now; the subscription it needs, if it needs one.
    ///
    /// * `said` - what was said of it when this failed last.
    fn meet(&mut self, body: &BodyNote, said: &str) -> Option<Line> {
        self.part(&body.name);
        let kind = self.sources.get(body.source?)?.ros2.as_ref()?.kind;
        if kind == RosKind::Tf {
            return None;
        }
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
                self.unheard.of.push_back((body.clone(), text));
                None
            }
        }
    }

    /// Gives back the topic of a body that has left, or comes anew.
    fn part(&mut self, name: &str) {
        self.unheard.remove(name);
        if let Some(topic) = self.topics.remove(name, &mut self.names) {
            self.strangers.part(&topic);
            self.readers.misfits.part(&topic);
        }
    }
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
            of: names.map(note).collect(),
            tried_ns: 0,
        };
        let first = unheard.due(RETRY_NS);
        assert_eq!((first.len(), first[0].0.name.as_str()), (RETRIES_MAX, "b0"));
        assert_eq!(first[0].1, "no files");
        unheard.of.extend(first);
        assert!(unheard.due(2 * RETRY_NS - 1).is_empty());
        unheard.remove("b8");
        let names = unheard.due(2 * RETRY_NS).into_iter().map(|(b, _)| b.name);
        assert_eq!(names.take(2).collect::<Vec<_>>(), ["b9", "b0"]);
    }
}
