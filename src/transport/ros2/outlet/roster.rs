//! Bodies that come, change and go while the node runs: their boxes, and the subscriptions that they need.
//!
//! In: what edits did. Out: subscriptions for the receiving thread; a body that is heard where it was keeps its own.

use super::super::lines::{Arrival, Line, of_body};
use super::super::open;
use super::super::shared::Say;
use super::Outlet;
use crate::config::RosKind;
use crate::error::Error;
use crate::transport::{BodyChange, BodyNote};

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
                    (!stays).then(|| self.meet(body)).flatten()
                }
                BodyChange::Removed(name) => {
                    self.part(name);
                    None
                }
            };
            open(&self.shared.arrivals).push(Arrival { change, line });
        }
    }

    /// Takes a body that came, or is heard elsewhere now; the subscription it needs, if it needs one.
    fn meet(&mut self, body: &BodyNote) -> Option<Line> {
        self.part(&body.name);
        let kind = self.sources.get(body.source?)?.ros2.as_ref()?.kind;
        if kind == RosKind::Tf {
            return None;
        }
        let topic = self.topics.put(body, &mut self.names).map_err(Error::Usage);
        if let Ok(topic) = &topic {
            self.strangers.meet(topic, kind);
        }
        let line = topic.and_then(|topic| of_body(&mut self.node, &self.context, kind, &topic));
        match line {
            Ok(line) => {
                self.topics.note_heard(&body.name);
                Some(line)
            }
            Err(e) => {
                let text = format!("body {}: no poses of it can come: {e}", body.name);
                self.shared.say(Say::Error, &text);
                None
            }
        }
    }

    /// Gives back the topic of a body that has left, or comes anew.
    fn part(&mut self, name: &str) {
        if let Some(topic) = self.topics.remove(name, &mut self.names) {
            self.strangers.part(&topic);
        }
    }
}
