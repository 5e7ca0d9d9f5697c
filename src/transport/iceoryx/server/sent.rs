//! What goes out: hello, the messages of a tick in their order, connections of late joiners.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ZeroCopySend;

use super::{Ipc, Server, failed};
use crate::error::Result;
use crate::transport::hello::hello;
use crate::wire::{MessageHeader, Outbox, TickRow};

impl Server {
    pub(super) fn say_hello(&mut self) -> Result<()> {
        self.hello
            .send_copy(hello(self.options.boot_id))
            .map(|_| ())
            .map_err(|e| failed("hello", e))
    }

    /// Order is a promise: whoever has the tick has all that belongs to it.
    pub(super) fn send_all(&mut self, outbox: &Outbox) -> Result<u64> {
        let (demand, mut failures) = (self.demand, 0);
        if demand.contacts {
            failures += send(
                &self.contacts.publisher,
                &outbox.contacts_header,
                &outbox.contacts,
            );
        }
        if demand.regions {
            failures += send(
                &self.regions.publisher,
                &outbox.regions_header,
                &outbox.regions,
            );
        }
        if demand.pairs {
            failures += send(&self.pairs.publisher, &outbox.pairs_header, &outbox.pairs);
        }
        if demand.changes {
            failures += self.send_changes(outbox);
        }
        if demand.bodies {
            failures += send(
                &self.bodies.publisher,
                &outbox.bodies_header,
                &outbox.bodies,
            );
        }
        let header = &outbox.tick.header;
        if demand.body_verdicts {
            // never truncated, whatever was left out elsewhere
            let whole = MessageHeader {
                truncated: 0,
                ..*header
            };
            failures += send(&self.body_verdicts.publisher, &whole, &outbox.body_verdicts);
        }
        let whole = MessageHeader {
            truncated: 0,
            ..*header
        };
        // What a tick has once stays in the outbox until it is new again.
        let Owed { names, plan } = &mut self.owed;
        failures += names.send(outbox.names_changed, || {
            send(&self.names.publisher, &whole, &outbox.names)
        });
        failures += plan.send(outbox.plan_changed, || {
            send(&self.plan.publisher, &whole, outbox.plan.as_bytes())
        });
        self.update_connections();
        self.send_tick(&outbox.tick)?;
        Ok(failures)
    }

    pub(super) fn send_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.tick.send_copy(*tick).map_err(|e| failed("tick", e))?;
        // a reader that cannot be notified still finds the tick when it looks
        let _unheard = self.ready.notify();
        Ok(())
    }

    /// Late joiners get the newest of what is not sent now.
    pub(super) fn update_connections(&mut self) {
        // one broken reader is no reason to stop; the next round tries again
        let _later = self.hello.update_connections();
        let _later = self.names.publisher.update_connections();
        let _later = self.plan.publisher.update_connections();
        let _later = self.tick.update_connections();
    }
}

/// Messages that one tick has and no later one, where they could not be handed over: readers would have old ones until
/// the scene changes again.
#[derive(Debug, Default)]
pub(super) struct Owed {
    names: Debt,
    plan: Debt,
}

/// Whether a message is still to be handed over.
#[derive(Debug, Default)]
struct Debt(bool);

impl Debt {
    /// Sends what is new, or owed.
    ///
    /// * `send` - as [`send`] returns.
    fn send(&mut self, is_new: bool, send: impl FnOnce() -> u64) -> u64 {
        if !is_new && !self.0 {
            return 0;
        }
        let failures = send();
        self.0 = failures > 0;
        failures
    }
}

/// One message.
///
/// * returns - 1 when it could not be handed over.
pub(super) fn send<T, H>(publisher: &Publisher<Ipc, [T], H>, header: &H, rows: &[T]) -> u64
where
    T: std::fmt::Debug + ZeroCopySend + Copy + 'static,
    H: std::fmt::Debug + ZeroCopySend + Copy + Default + 'static,
{
    let Ok(mut sample) = publisher.loan_slice_uninit(rows.len()) else {
        return 1;
    };
    *sample.user_header_mut() = *header;
    u64::from(sample.write_from_slice(rows).send().is_err())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_names_that_could_not_be_handed_over_came_with_the_next_edit_only() {
        let mut debt = Debt::default();
        let never = || panic!("nothing to send");
        assert_eq!(debt.send(false, never), 0);
        assert_eq!(debt.send(true, || 1), 1);
        assert_eq!(debt.send(false, || 1), 1);
        assert_eq!(debt.send(false, || 0), 0);
        assert_eq!(debt.send(false, never), 0);
    }
}
