//! Outgoing messages: hello, the messages of a tick in order, connections of late joiners.

use iceoryx2::port::SendError;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ZeroCopySend;

use super::owed::mended;
use super::{Ipc, Server, failed};
use crate::error::Result;
use crate::transport::hello::hello;
use crate::wire::{MessageHeader, Outbox, TickRow, Undelivered};

impl Server {
    pub(super) fn say_hello(&mut self) -> Result<()> {
        self.hello
            .send_copy(hello(self.options.boot_id))
            .map(|_| ())
            .map_err(|e| failed("hello", e))
    }

    /// The order is guaranteed: a reader that has the tick has all its messages.
    pub(super) fn send_all(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        let mut unsent = self.send_rows(outbox);
        let header = &outbox.tick.header;
        let whole = MessageHeader {
            truncated: 0,
            ..*header
        };
        // Never truncated, whatever was left out elsewhere.
        if self.demand.body_verdicts {
            let handed = send(&self.body_verdicts.publisher, &whole, &outbox.body_verdicts);
            unsent.messages += handed.lost();
        }
        // Sent once: if it could not be delivered it is owed.
        self.names_owed |= outbox.names_changed;
        if self.names_owed {
            let handed = send(&self.names.publisher, &whole, &outbox.names);
            self.names_owed = handed != Handed::Over;
            unsent.messages += handed.lost();
        }
        self.plan_owed |= outbox.plan_changed;
        if self.plan_owed {
            let handed = send(&self.plan.publisher, &whole, outbox.plan.as_bytes());
            self.plan_owed = handed != Handed::Over;
            unsent.messages += handed.lost();
        }
        self.update_connections();
        self.cancelled = outbox.owed_cancelled;
        self.send_tick(&outbox.tick)?;
        Ok(unsent)
    }

    /// Sends the messages with rows of pairs or bodies, in order.
    fn send_rows(&mut self, outbox: &Outbox) -> Undelivered {
        let (demand, mut unsent) = (self.demand, Undelivered::default());
        if demand.contacts {
            let header = &outbox.contacts_header;
            unsent.messages += send(&self.contacts.publisher, header, &outbox.contacts).lost();
        }
        if demand.contact_changes {
            let header = &outbox.contact_changes_header;
            let handed = (self.contact_changes).send(header, &outbox.contact_changes);
            unsent.messages += handed.lost();
        }
        if demand.regions {
            let header = &outbox.regions_header;
            unsent.messages += send(&self.regions.publisher, header, &outbox.regions).lost();
        }
        if demand.pairs {
            let handed = self.send_pairs(outbox);
            unsent.messages += handed.lost();
            unsent.pairs = handed == Handed::ToNobody;
        }
        if demand.changes {
            let handed = (self.changes).send(&outbox.changes_header, &outbox.changes);
            unsent.messages += handed.lost();
            unsent.changes = handed == Handed::ToNobody;
        }
        if demand.bodies {
            let header = &outbox.bodies_header;
            unsent.messages += send(&self.bodies.publisher, header, &outbox.bodies).lost();
        }
        unsent
    }

    /// Sends the pairs, with what is owed to their readers.
    fn send_pairs(&self, outbox: &Outbox) -> Handed {
        let (publisher, header) = (&self.pairs.publisher, &outbox.pairs_header);
        if outbox.owed.is_empty() {
            return send(publisher, header, &outbox.pairs);
        }
        let rows = || mended(&outbox.pairs, &outbox.owed);
        let Ok(mut sample) = publisher.loan_slice_uninit(rows().count()) else {
            return Handed::ToNobody;
        };
        *sample.user_header_mut() = *header;
        let mut rows = rows();
        let sample = sample.write_from_fn(|_| rows.next().unwrap_or_default());
        Handed::of(&sample.send())
    }

    pub(super) fn send_tick(&mut self, tick: &TickRow) -> Result<()> {
        let tick = TickRow {
            cancelled_events: tick.cancelled_events + self.cancelled,
            ..*tick
        };
        self.tick.send_copy(tick).map_err(|e| failed("tick", e))?;
        // A reader that cannot be notified still finds the tick when it checks.
        let _unheard = self.ready.notify();
        Ok(())
    }

    /// Gives late joiners the newest of messages that are not sent now.
    pub(super) fn update_connections(&mut self) {
        // One broken reader is no reason to stop; the next round tries again.
        let _later = self.hello.update_connections();
        let _later = self.names.publisher.update_connections();
        let _later = self.plan.publisher.update_connections();
        let _later = self.tick.update_connections();
    }
}

/// How far a message was delivered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Handed {
    /// To all of its readers.
    Over,
    /// Not to all: the connections of some are broken.
    InPart,
    /// To none.
    ToNobody,
}

impl Handed {
    fn of(sent: &std::result::Result<usize, SendError>) -> Self {
        match sent {
            Ok(_) => Self::Over,
            // These errors come before the first connection is written to.
            Err(
                SendError::LoanError(_)
                | SendError::ConnectionError(_)
                | SendError::ConnectionBrokenSinceSenderNoLongerExists,
            ) => Self::ToNobody,
            Err(_) => Self::InPart,
        }
    }

    /// Number of messages that could not be delivered.
    pub(super) fn lost(self) -> u64 {
        u64::from(self != Self::Over)
    }
}

/// Sends one message.
pub(super) fn send<T, H>(publisher: &Publisher<Ipc, [T], H>, header: &H, rows: &[T]) -> Handed
where
    T: std::fmt::Debug + ZeroCopySend + Copy + 'static,
    H: std::fmt::Debug + ZeroCopySend + Copy + Default + 'static,
{
    let Ok(mut sample) = publisher.loan_slice_uninit(rows.len()) else {
        return Handed::ToNobody;
    };
    *sample.user_header_mut() = *header;
    Handed::of(&sample.write_from_slice(rows).send())
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::daemon::build_shapes;
    use crate::scene::Scene;
    use crate::tick::{Engine, TickInput};
    use crate::time::{Budget, Clock, ManualClock, SystemClock};
    use crate::transport::Door as _;
    use crate::transport::client::{Link, Message, Topics};
    use crate::transport::iceoryx::{IoxLink, Place, ServerOptions};
    use crate::wire::{
        Event, FrameHeader, Inbox, NameRow, PairRow, TickCause, TransformRow, WIRE_VERSION,
        frame_flags, name_bytes,
    };

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
        // As with no memory left: no sample can be loaned while others are out.
        let mut names = Vec::new();
        while let Ok(sample) = server.names.publisher.loan_slice_uninit(1) {
            names.push(sample);
        }
        let mut plans = Vec::new();
        while let Ok(sample) = server.plan.publisher.loan_slice_uninit(1) {
            plans.push(sample);
        }
        server.demand();
        assert_eq!(server.publish(&outbox).unwrap().messages, 2);
        (outbox.names_changed, outbox.plan_changed) = (false, false);
        assert_eq!(server.publish(&outbox).unwrap().messages, 2);
        drop((names, plans));
        assert_eq!(server.publish(&outbox).unwrap().messages, 0);
        let mut heard = Message::<NameRow>::default();
        let mut plan = Message::<u8>::default();
        assert!(link.names(&mut heard).unwrap() && link.plan(&mut plan).unwrap());
        assert_eq!((heard.rows.len(), &*plan.rows), (1, b"{}".as_slice()));
        assert_eq!(server.publish(&outbox).unwrap().messages, 0);
        assert!(!link.names(&mut heard).unwrap() && !link.plan(&mut plan).unwrap());
    }

    /// Two balls; the second moves along x.
    struct Balls {
        engine: Engine,
        clock: Arc<ManualClock>,
        inbox: Inbox,
        seq: u64,
    }

    impl Balls {
        fn new() -> Self {
            let ball = |id| {
                let shape = "{ type = \"sphere\", radius = 1.0 }";
                format!("[[body]]\nname = \"b{id}\"\nid = {id}\nmoves = true\nshape = {shape}\n")
            };
            let text = format!("[[source]]\nname = \"feed\"\n{}{}", ball(1), ball(2));
            let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
            let shapes = build_shapes(&scene).unwrap().bodies;
            let clock = Arc::new(ManualClock::new(1_000_000_000));
            let shown = Arc::clone(&clock) as Arc<dyn Clock>;
            Self {
                engine: Engine::new(&scene, shapes, 7, shown).unwrap(),
                clock,
                inbox: Inbox::default(),
                seq: 0,
            }
        }

        /// Runs a tick; returns what could not be delivered.
        fn tick(&mut self, server: &mut Server, x: f64) -> Undelivered {
            self.clock.advance(10_000_000);
            self.seq += 1;
            self.inbox.clear();
            let frame = self.inbox.push();
            frame.header = FrameHeader {
                session: 11,
                epoch: 1,
                seq: self.seq,
                source: name_bytes("feed"),
                flags: frame_flags::FULL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            };
            frame.received_ns = self.clock.boottime_ns();
            frame.set_transforms(&[(1, 0.0), (2, x)].map(|(body, x)| TransformRow {
                body,
                position: [x, 0.0, 0.0],
                orientation: [0.0, 0.0, 0.0, 1.0],
                ..TransformRow::default()
            }));
            let outbox = self.engine.tick(TickInput {
                inbox: &self.inbox,
                edits: &[],
                demand: server.demand(),
                budget: Budget::UNLIMITED,
                cause: TickCause::Frame,
                cause_source: None,
                woke_ns: self.clock.monotonic_ns(),
                pulse: None,
            });
            let unsent = server.publish(outbox).unwrap();
            self.engine.note_undelivered(unsent);
            unsent
        }
    }

    /// The events in a row.
    fn told(row: &PairRow) -> (u8, [u64; 2], [u64; 2]) {
        let begin = [row.begin_first_tick, row.begin_last_tick];
        (row.events, begin, [row.end_first_tick, row.end_last_tick])
    }

    /// Holds all samples that a publisher loans, as with no memory left.
    macro_rules! hold {
        ($publisher:expr) => {{
            let mut held = Vec::new();
            while let Ok(sample) = $publisher.loan_slice_uninit(1) {
                held.push(sample);
            }
            held
        }};
    }

    #[test]
    fn bug_events_of_a_message_that_could_not_be_handed_over_were_lost() {
        let place = Place::new(&format!("owed_events_{}", std::process::id())).unwrap();
        let mut server = Server::open(ServerOptions::new(place.clone(), 7)).unwrap();
        let mut link = IoxLink::open(&place, &SystemClock, u64::MAX).unwrap();
        let topics = Topics {
            pairs: true,
            changes: true,
            ..Topics::default()
        };
        link.subscribe(topics).unwrap();
        let mut balls = Balls::new();
        let (mut pairs, mut changes) = (Message::<PairRow>::default(), Message::default());
        let mut hear = |link: &mut IoxLink| {
            let heard = link.pairs(&mut pairs).unwrap().then(|| {
                let rows: Vec<_> = pairs.rows.iter().map(told).collect();
                rows
            });
            let new = link.changes(&mut changes).unwrap().then(|| {
                let rows: Vec<_> = changes.rows.iter().map(told).collect();
                rows
            });
            (heard, new)
        };
        let none = [0, 0];
        let begin = (Event::Begin.bit(), [2, 2], none);
        let persist = (Event::Persist.bit(), none, none);
        let end = (Event::End.bit(), none, [5, 5]);
        assert_eq!(balls.tick(&mut server, 3.0), Undelivered::default());
        assert_eq!(hear(&mut link), (Some(vec![]), Some(vec![])));
        let both = Undelivered {
            messages: 2,
            pairs: true,
            changes: true,
        };
        // The begin is lost in both messages, and once more in one of them.
        let held_pairs = hold!(server.pairs.publisher);
        let held_changes = hold!(server.changes.out.publisher);
        assert_eq!(balls.tick(&mut server, 1.5), both);
        assert_eq!(hear(&mut link), (None, None));
        drop(held_pairs);
        let one = Undelivered {
            messages: 1,
            pairs: false,
            changes: true,
        };
        assert_eq!(balls.tick(&mut server, 1.5), one);
        assert_eq!(hear(&mut link), (Some(vec![begin]), None));
        let others = &balls.engine.outbox().pairs;
        assert_eq!(told(&others[0]), persist, "a recording had the begin");
        drop(held_changes);
        assert_eq!(balls.tick(&mut server, 1.5), Undelivered::default());
        assert_eq!(hear(&mut link), (Some(vec![persist]), Some(vec![begin])));
        // The end is lost in both messages, and then the pair is gone.
        let held_pairs = hold!(server.pairs.publisher);
        let held_changes = hold!(server.changes.out.publisher);
        assert_eq!(balls.tick(&mut server, 30.0), both);
        drop((held_pairs, held_changes));
        assert_eq!(balls.tick(&mut server, 30.0), Undelivered::default());
        assert_eq!(hear(&mut link), (Some(vec![end]), Some(vec![end])));
        assert!(balls.engine.outbox().pairs.is_empty());
        assert_eq!(balls.tick(&mut server, 30.0), Undelivered::default());
        // The whole list, as it has no rows: no larger than a row for the pair that has left.
        assert_eq!(hear(&mut link), (Some(vec![]), Some(vec![])));
        balls.engine.validate().unwrap();
    }
}
