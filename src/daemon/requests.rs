//! What becomes of requests on the tick's thread: edits wait for the next tick, questions for the moment after one.
//!
//! In: what the worker made of requests, what ticks made of edits. Out: answers, edits, questions with the bodies that
//! they are about.

use super::builder::Done;
use super::{Daemon, body_note};
use crate::query::Query;
use crate::record::Origin;
use crate::transport::{BodyChange, RequestToken};
use crate::wire::Answer;
use crate::world::Edit;

impl Daemon<'_> {
    /// Takes what the worker made of a request; its answer, where there is one already.
    pub(super) fn take_built(
        &mut self,
        token: RequestToken,
        built: Result<Done, String>,
    ) -> Option<Answer> {
        match built {
            Ok(Done::Batch(batch, asked)) => self.edit(batch, Origin::Asked(asked)),
            Ok(Done::Found(answer)) => return Some(*answer),
            Ok(Done::Ask(asking)) => self.asking.push_back((token, asking)),
            // Its asker is the daemon.
            Ok(Done::Tree(_)) => {}
            Err(why) => return Some(refusal(why)),
        }
        None
    }

    /// Looks up the bodies of the oldest question, as the last tick left them, for the worker.
    ///
    /// One a round, and behind the tick that is due: a pass over the boxes of a million bodies takes as long as a tick.
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

    /// Tells the doors what the edits of the last tick did to bodies.
    fn tell_bodies(&mut self) {
        let world = self.engine.world();
        let done = self.ready.iter().zip(self.engine.outcomes());
        let edits = done.filter(|(_, outcome)| outcome.result.is_ok());
        let change = |edit: &Edit| match edit {
            Edit::Put { body, shapes } => {
                // A later edit of the same request may have taken it out again: then that edit speaks for it.
                let placed = world.body(world.slot_named(&body.name)?)?;
                Some(BodyChange::Put(body_note(body, placed.id, shapes)))
            }
            Edit::Remove { name } => Some(BodyChange::Removed(name.clone())),
            _ => None,
        };
        let changes: Vec<_> = edits
            .flat_map(|(batch, _)| batch.edits.iter().filter_map(change))
            .collect();
        if !changes.is_empty() {
            self.door.bodies(&changes);
        }
    }

    /// An answer that cannot be handed over is its asker's loss; the other clients' daemon goes on.
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
