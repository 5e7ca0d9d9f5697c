//! Two doors as one: the one that is waited on, and one beside it whose threads wake the first.

use super::{Door, RequestToken, Setting, Wake};
use crate::error::Result;
use crate::time::Clock;
use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow};

/// Marks the tokens of the door beside.
const BESIDE: u64 = 1 << 63;

/// The door that is waited on and one beside it.
pub struct Both<'a> {
    first: &'a mut dyn Door,
    beside: &'a mut dyn Door,
}

impl std::fmt::Debug for Both<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Both").finish_non_exhaustive()
    }
}

impl<'a> Both<'a> {
    /// Joins them.
    pub fn new(first: &'a mut dyn Door, beside: &'a mut dyn Door) -> Self {
        Self { first, beside }
    }
}

impl Door for Both<'_> {
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        self.first.wait(timeout_ns, clock)
    }

    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        self.first.receive(inbox, clock);
        self.beside.receive(inbox, clock);
    }

    fn demand(&mut self) -> Demand {
        let (first, beside) = (self.first.demand(), self.beside.demand());
        Demand {
            pairs: first.pairs || beside.pairs,
            contacts: first.contacts || beside.contacts,
            bodies: first.bodies || beside.bodies,
            body_verdicts: first.body_verdicts || beside.body_verdicts,
        }
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<u64> {
        Ok(self.first.publish(outbox)? + self.beside.publish(outbox)?)
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.first.publish_tick(tick)?;
        self.beside.publish_tick(tick)
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, &[u8])) {
        self.first.requests(take);
        self.beside.requests(&mut |token, header, payload| {
            take(RequestToken(token.0 | BESIDE), header, payload);
        });
    }

    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        if token.0 & BESIDE == 0 {
            self.first.answer(token, ok, json)
        } else {
            self.beside
                .answer(RequestToken(token.0 & !BESIDE), ok, json)
        }
    }

    fn settings(&mut self, take: &mut dyn FnMut(Setting)) {
        self.first.settings(take);
        self.beside.settings(take);
    }

    fn housekeeping(&mut self) {
        self.first.housekeeping();
        self.beside.housekeeping();
    }
}
