//! What comes into a tick: edits, then frames, vertices and who is gone, then ages.
//!
//! In: a tick's input. Out: the world of this tick, and the end of its time as its frames ask for it.

use std::sync::Arc;

use super::floor::Laps;
use super::{EditOutcome, Engine, TickInput, beat};
use crate::plan::Seen;
use crate::time::Meter;
use crate::wire::{Frame, Inbox, SOURCE_NAME_LEN, TickCause};

impl Engine {
    pub(super) fn admit(&mut self, input: &mut TickInput<'_>, laps: &Laps) {
        let now_ns = self.now_ns;
        let asked = input.edits.iter().any(|batch| batch.validate);
        let fault = asked.then(|| self.repair()).flatten();
        self.world.begin_tick(self.tick, now_ns);
        self.edit(input, laps, fault.as_deref());
        self.admit_frames(input.inbox, now_ns);
        let limited = self.config.budget.is_limited();
        // Who has no time because only ages are judged says nothing of what the others will have.
        let ages_only = input.budget.units == Some(0) && input.cause != TickCause::Frame;
        if !ages_only {
            self.config.budget = input.budget;
        }
        let seen = self.see(input);
        let is_news = seen != std::mem::replace(&mut self.seen, seen);
        let is_edited = self.world.scene_changed();
        if is_edited || is_news || limited != self.config.budget.is_limited() {
            self.replan(is_edited);
        }
    }

    /// Applies the edits. A hundred thousand take longer than a heartbeat, and cannot be done in parts.
    ///
    /// * `fault` - what was found in the structures, for those who asked.
    fn edit(&mut self, input: &mut TickInput<'_>, laps: &Laps, fault: Option<&str>) {
        if input.edits.is_empty() {
            return;
        }
        let row = self.bare_tick(input);
        let clock = Arc::clone(&self.clock);
        let mut beat = beat(&mut input.pulse, row, clock.as_ref());
        let heartbeat_ns = self.config.heartbeat_ns;
        let mut meter =
            Meter::unlimited(clock.as_ref()).with_beat(laps.woke_ns(), heartbeat_ns, &mut beat);
        for batch in input.edits {
            let (token, mut warnings) = (batch.token, batch.warnings.clone());
            if batch.validate {
                warnings.extend(fault.map(str::to_owned));
            }
            let step = &mut || meter.charge(1);
            let result = self.world.apply_stepwise(&batch.edits, step);
            self.outcomes.push(EditOutcome {
                token,
                result,
                warnings,
            });
        }
    }

    /// What the plan is made for beside the scene: who has listened lately, and what the broad phase measured.
    fn see(&mut self, input: &TickInput<'_>) -> Seen {
        let axes = self.broad.work().axes;
        let one_left_out = axes.iter().filter(|kept| **kept).count() == 2;
        Seen {
            readers: self.audience.note(input.demand),
            skipped_axis: axes.iter().position(|kept| one_left_out && !kept),
        }
    }

    fn admit_frames(&mut self, inbox: &Inbox, now_ns: u64) {
        let frames = inbox.frames();
        for (at, frame) in frames.iter().enumerate() {
            self.end_before(
                &frame.header.source,
                frame.header.session,
                inbox,
                &frames[at..],
            );
            self.world.admit(frame, now_ns);
        }
        for vertices in inbox.vertices() {
            let header = &vertices.header;
            self.end_before(&header.source, header.session, inbox, &[]);
            self.world.admit_vertices(vertices, now_ns);
        }
        // After its last frames: a client that leaves has still said where its bodies are.
        for &session in inbox.ended() {
            self.world.end_session(session);
        }
        self.world.age(now_ns);
        // Only the newest frame of each source may shorten the tick: nobody waits for the result of the older ones.
        let (end, clock) = (&mut self.end, self.clock.as_ref());
        self.world.tell_admitted(|header, received_ns| {
            end.shorten(header, (received_ns, now_ns), clock);
        });
    }

    /// Ends the session in force of a source before another one speaks for it, where its client is gone: what it has
    /// left is among the frames before, unless some are among the `rest`.
    fn end_before(
        &mut self,
        source: &[u8; SOURCE_NAME_LEN],
        session: u64,
        inbox: &Inbox,
        rest: &[Frame],
    ) {
        for &gone in inbox.ended().iter().filter(|gone| **gone != session) {
            let more = rest.iter().any(|frame| frame.header.session == gone);
            if !more && self.world.speaks_for(gone, source) {
                self.world.end_session(gone);
            }
        }
    }
}
