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
        if demand.contact_changes {
            let header = &outbox.contact_changes_header;
            failures += (self.contact_changes).send(header, &outbox.contact_changes);
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
            failures += (self.changes).send(&outbox.changes_header, &outbox.changes);
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
        // Told once: what could not be handed over is owed.
        self.names_owed |= outbox.names_changed;
        if self.names_owed {
            let lost = send(&self.names.publisher, &whole, &outbox.names);
            self.names_owed = lost > 0;
            failures += lost;
        }
        self.plan_owed |= outbox.plan_changed;
        if self.plan_owed {
            let lost = send(&self.plan.publisher, &whole, outbox.plan.as_bytes());
            self.plan_owed = lost > 0;
            failures += lost;
        }
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
    use crate::time::SystemClock;
    use crate::transport::Door as _;
    use crate::transport::client::{Link, Message, Topics};
    use crate::transport::iceoryx::{IoxLink, Place, ServerOptions};
    use crate::wire::NameRow;

    #[test]
    fn bug_names_and_plan_that_could_not_be_handed_over_were_never_told() {
        let place = Place::new(&format!("owed_{}", std::process::id())).unwrap();
        let mut server = Server::open(ServerOptions::new(place.clone(), 7)).unwrap();
        let mut link = IoxLink::open(&place, &SystemClock, u64::MAX).unwrap();
        link.subscribe(Topics {
            names: true,
            plan: true,
            ..Topics::default()
        })
        .unwrap();
        let mut outbox = Outbox {
            names: vec![NameRow::default()],
            names_changed: true,
            plan: "{}".to_owned(),
            plan_changed: true,
            ..Outbox::default()
        };
        // As with no memory left: none is lent while others are out.
        let mut names = Vec::new();
        while let Ok(sample) = server.names.publisher.loan_slice_uninit(1) {
            names.push(sample);
        }
        let mut plans = Vec::new();
        while let Ok(sample) = server.plan.publisher.loan_slice_uninit(1) {
            plans.push(sample);
        }
        server.demand();
        assert_eq!(server.publish(&outbox).unwrap(), 2);
        (outbox.names_changed, outbox.plan_changed) = (false, false);
        assert_eq!(server.publish(&outbox).unwrap(), 2);
        drop((names, plans));
        assert_eq!(server.publish(&outbox).unwrap(), 0);
        let mut heard = Message::<NameRow>::default();
        let mut plan = Message::<u8>::default();
        assert!(link.names(&mut heard).unwrap() && link.plan(&mut plan).unwrap());
        assert_eq!((heard.rows.len(), &*plan.rows), (1, b"{}".as_slice()));
        assert_eq!(server.publish(&outbox).unwrap(), 0);
        assert!(!link.names(&mut heard).unwrap() && !link.plan(&mut plan).unwrap());
    }
}
