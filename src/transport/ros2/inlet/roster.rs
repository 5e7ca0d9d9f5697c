//! Bodies that come and go while the node runs: their places, their subscriptions.
//!
//! In: what edits did, with the subscriptions that the sending thread made. Out: lines and places in step with the
//! scene.

use rustdds::mio1::Token;

use super::super::lines::{Arrival, Feeder};
use super::super::open;
use super::super::poses::Source;
use super::super::shared::Say;
use super::Inlet;
use crate::transport::{BodyChange, BodyNote};

/// Token of lines that came later: it only wakes, and every round looks at every line.
const LATER: Token = Token(usize::MAX - 1);

impl Inlet {
    /// Bodies that edits put, changed or took out.
    pub(super) fn follow_edits(&mut self) {
        let arrivals = std::mem::take(&mut *open(&self.shared.arrivals));
        for Arrival { change, line } in arrivals {
            let (BodyChange::Put(BodyNote { name, .. }) | BodyChange::Removed(name)) = &change;
            for (at, source) in self.sources.iter_mut().enumerate() {
                let Some(member) = source.remove_body(name) else {
                    continue;
                };
                self.shelf.set_member(at, member, 0);
                let own = |f: &Feeder| (f.source, f.member) == (at, member);
                self.lines.retain(|line| !line.feeder().is_some_and(own));
            }
            let BodyChange::Put(body) = change else {
                continue;
            };
            let of_body = |source: &Source| Some(source.place) == body.source;
            let Some(at) = self.sources.iter().position(of_body) else {
                continue;
            };
            let member = self
                .sources
                .get_mut(at)
                .map(|source| source.put_body(&body));
            let Some(member) = member else { continue };
            self.shelf.set_member(at, member, body.id);
            let Some(mut line) = line else { continue };
            line.feed(at, member);
            match line.register(self.poll.registry(), LATER) {
                Ok(()) => self.lines.push(line),
                Err(e) => {
                    let text = format!("body {}: no poses of it can come: {e}", body.name);
                    self.shared.say(Say::Error, &text);
                }
            }
        }
    }

    /// Topics of which one moves two bodies: a scene file is refused for it, edits can bring it about.
    pub(super) fn shared_topics(&self) -> Vec<String> {
        let mut topics: Vec<&str> = (self.lines.iter())
            .filter_map(|line| Some(line.feeder()?.topic.as_str()))
            .collect();
        topics.sort_unstable();
        let twice = topics.windows(2).filter(|two| two[0] == two[1]);
        let text = |two: &[&str]| {
            format!(
                "topic {}: it moves more than one body: give each a ros_topic of its own",
                two[0]
            )
        };
        twice.map(text).collect()
    }
}
