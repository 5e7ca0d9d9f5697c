//! Requests on the tick's thread: edits wait for the next tick, queries until after one.
//!
//! In: results of the worker, outcomes of edits. Out: answers, edits, queries with their bodies.

use super::builder::Done;
use super::{Daemon, body_note};
use crate::query::Query;
use crate::record::Origin;
use crate::transport::{BodyChange, RequestToken};
use crate::wire::Answer;
use crate::world::{Edit, Put};

impl Daemon<'_> {
    /// Takes a result of the worker; returns its answer, if there is one already.
    pub(super) fn take_built(
        &mut self,
        token: RequestToken,
        built: Result<Done, String>,
    ) -> Option<Answer> {
        match built {
            Ok(Done::Batch(batch, asked)) => self.edit(batch, Origin::Asked(asked)),
            Ok(Done::Found(answer)) => return Some(*answer),
            Ok(Done::Ask(asking)) => self.asking.push_back((token, asking)),
            // It was requested by the daemon itself.
            Ok(Done::Tree(_)) => {}
            Err(why) => return Some(refusal(why)),
        }
        None
    }

    /// Looks up the bodies of the oldest query, in the state after the last tick, for the worker.
    ///
    /// One per round, and after the tick that is due: a pass over the boxes of a million bodies takes as long as a
    /// tick.
    pub(super) fn take_question(&mut self) {
        let Some((token, asking)) = self.asking.pop_front() else {
            return;
        };
        let header = self.engine.outbox().tick.header;
        let shapes = asking.shapes.as_ref();
        let query = Query::new(self.engine.world(), header, &asking.question, shapes);
        match query {
            Ok(mut query) => {
                query.warnings().extend(asking.warnings);
                self.builder.measure(token, query);
            }
            Err(why) => self.answer(token, &refusal(why)),
        }
    }

    /// Answers the requests whose edits the last tick applied or refused.
    pub(super) fn settle_edits(&mut self) {
        if self.door.follows_bodies() {
            self.tell_bodies();
        }
        if !self.ready.is_empty() {
            self.builder.forget(std::mem::take(&mut self.ready));
        }
        for at in 0..self.engine.outcomes().len() {
            let outcome = &self.engine.outcomes()[at];
            let (token, warnings) = (RequestToken(outcome.token), outcome.warnings.clone());
            let answer = match &outcome.result {
                Ok(applied) => Answer {
                    ok: true,
                    scene_rev: applied.scene_rev,
                    warnings,
                    ..Answer::default()
                },
                Err(error) => Answer {
                    error: Some(error.clone()),
                    warnings,
                    ..Answer::default()
                },
            };
            self.answer(token, &answer);
        }
    }

    /// Reports to the doors what the edits of the last tick did to bodies.
    fn tell_bodies(&mut self) {
        let world = self.engine.world();
        let done = self.ready.iter().zip(self.engine.outcomes());
        // A put without a change must not renew a subscription.
        let edits =
            done.filter(|(_, outcome)| outcome.result.as_ref().is_ok_and(|done| done.changed));
        let change = |edit: &Edit| match edit {
            Edit::Put(Put { body, shapes }) => {
                // A later edit of the same request may have removed it again: then only that edit is reported.
                let placed = world.body(world.slot_named(&body.name)?)?;
                Some(BodyChange::Put(body_note(body, placed.id, shapes)))
            }
            Edit::Remove { name } => Some(BodyChange::Removed(name.clone())),
            Edit::Attach { name, to, .. } => Some(BodyChange::Hung {
                name: name.clone(),
                attached: to.is_some(),
            }),
            _ => None,
        };
        let changes: Vec<_> = edits
            .flat_map(|(batch, _)| batch.edits.iter().filter_map(change))
            .collect();
        if !changes.is_empty() {
            self.door.bodies(&changes);
        }
    }

    /// If an answer cannot be delivered only its client is affected; the daemon continues.
    pub(super) fn answer(&mut self, token: RequestToken, answer: &Answer) {
        let json = serde_json::to_string(answer).unwrap_or_default();
        if let Err(error) = self.door.answer(token, answer.ok, &json) {
            tracing::warn!("{error}");
        }
    }
}

fn refusal(why: String) -> Answer {
    Answer {
        error: Some(why),
        ..Answer::default()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::super::build_shapes;
    use super::*;
    use crate::error::Result;
    use crate::scene::Scene;
    use crate::time::{Clock, SystemClock};
    use crate::transport::client::Client;
    use crate::transport::memory::{Hub, MemoryServer};
    use crate::transport::{Door, Wake};
    use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow, Undelivered};

    const SECOND_NS: u64 = 1_000_000_000;

    /// A door over memory that records the reported changes of bodies.
    struct Told(MemoryServer, Vec<BodyChange>);

    impl Door for Told {
        fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
            self.0.wait(timeout_ns, clock)
        }
        fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
            self.0.receive(inbox, clock);
        }
        fn demand(&mut self) -> Demand {
            self.0.demand()
        }
        fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
            self.0.publish(outbox)
        }
        fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
            self.0.publish_tick(tick)
        }
        fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
            self.0.requests(take);
        }
        fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
            self.0.answer(token, ok, json)
        }
        fn follows_bodies(&self) -> bool {
            true
        }
        fn bodies(&mut self, changes: &[BodyChange]) {
            self.1.extend_from_slice(changes);
        }
        fn housekeeping(&mut self) {
            self.0.housekeeping();
        }
    }

    /// What a door is told of bodies where these edits are asked for, one after another.
    fn told(edits: &[String]) -> Vec<BodyChange> {
        let hub = Hub::new();
        let scene = Scene::parse("", "empty.toml", Path::new("")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let server = MemoryServer::open(&hub, 7, SECOND_NS).unwrap();
        let mut door = Told(server, Vec::new());
        let clock = Arc::new(SystemClock);
        let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
        let mut client = Client::over(Box::new(hub.link()), clock, None, SECOND_NS).unwrap();
        for edit in edits {
            let json = format!(r#"{{"edits": [{edit}]}}"#);
            let request = client.ask(&json, &[]).unwrap();
            let until_ns = SystemClock.monotonic_ns() + 30 * SECOND_NS;
            let answer = loop {
                assert!(SystemClock.monotonic_ns() < until_ns);
                daemon.round(None).unwrap();
                if let Some(answer) = client.answer_text(request, 0).unwrap() {
                    break answer;
                }
            };
            assert!(answer.contains(r#""ok":true"#), "{answer}");
        }
        drop(daemon);
        door.1
    }

    fn put(name: &str, radius: f64) -> String {
        let shape = format!(r#"{{"type": "sphere", "radius": {radius}}}"#);
        format!(r#"{{"put": {{"name": "{name}", "moves": false, "shape": {shape}}}}}"#)
    }

    #[test]
    fn bug_a_request_that_changes_nothing_was_told_as_bodies_that_came() {
        let told = told(&[1.0, 1.0, 2.0].map(|radius| put("a", radius)));
        let radii: Vec<_> = (told.iter())
            .map(|change| match change {
                BodyChange::Put(body) => body.bounds.map(|(_, half)| half[0]),
                _ => None,
            })
            .collect();
        assert_eq!(radii, [Some(1.0), Some(2.0)]);
    }

    #[test]
    fn bug_doors_were_not_told_that_a_body_was_hung_on_another_or_let_go() {
        let hang = r#"{"attach": {"body": "a", "to": "b"}}"#.to_owned();
        let let_go = r#"{"detach": "a"}"#.to_owned();
        let told = told(&[put("a", 1.0), put("b", 1.0), hang.clone(), hang, let_go]);
        let hung = [true, false].map(|attached| BodyChange::Hung {
            name: "a".to_owned(),
            attached,
        });
        assert_eq!(told[2..], hung);
    }
}
