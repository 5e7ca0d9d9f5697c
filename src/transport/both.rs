//! Two doors as one: the one that is waited on, and one beside it whose threads wake the first.

use super::{BodyChange, Door, RequestToken, Setting, Wake};
use crate::error::Result;
use crate::time::Clock;
use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow, Undelivered};

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
            regions: first.regions || beside.regions,
            bodies: first.bodies || beside.bodies,
            body_verdicts: first.body_verdicts || beside.body_verdicts,
            changes: first.changes || beside.changes,
            contact_changes: first.contact_changes || beside.contact_changes,
            changes_anew: first.changes_anew || beside.changes_anew,
        }
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        Ok((self.first.publish(outbox)?).and(self.beside.publish(outbox)?))
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.first.publish_tick(tick)?;
        self.beside.publish_tick(tick)
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
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

    fn follows_bodies(&self) -> bool {
        self.first.follows_bodies() || self.beside.follows_bodies()
    }

    fn bodies(&mut self, changes: &[BodyChange]) {
        self.first.bodies(changes);
        self.beside.bodies(changes);
    }

    fn tell(&mut self, words: &str) {
        self.first.tell(words);
        self.beside.tell(words);
    }

    fn housekeeping(&mut self) {
        self.first.housekeeping();
        self.beside.housekeeping();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::time::SystemClock;
    use crate::transport::client::{Client, Heard, Topics};
    use crate::transport::memory::{Hub, MemoryServer};
    use crate::transport::{BodyChange, BodyNote};

    const SECOND_NS: u64 = 1_000_000_000;

    /// A door in memory that an operator sets, and that notes what it is told of bodies.
    struct Set {
        door: MemoryServer,
        settings: Vec<Setting>,
        told: Vec<BodyChange>,
    }

    impl Set {
        fn open(hub: &Hub) -> Self {
            Self {
                door: MemoryServer::open(hub, 7, SECOND_NS).unwrap(),
                settings: Vec::new(),
                told: Vec::new(),
            }
        }
    }

    impl Door for Set {
        fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
            self.door.wait(timeout_ns, clock)
        }
        fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
            self.door.receive(inbox, clock);
        }
        fn demand(&mut self) -> Demand {
            self.door.demand()
        }
        fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
            self.door.publish(outbox)
        }
        fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
            self.door.publish_tick(tick)
        }
        fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
            self.door.requests(take);
        }
        fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
            self.door.answer(token, ok, json)
        }
        fn settings(&mut self, take: &mut dyn FnMut(Setting)) {
            self.settings.drain(..).for_each(take);
        }
        fn follows_bodies(&self) -> bool {
            true
        }
        fn bodies(&mut self, changes: &[BodyChange]) {
            self.told.extend_from_slice(changes);
        }
        fn housekeeping(&mut self) {
            self.door.housekeeping();
        }
    }

    fn client(hub: &Hub, topics: Topics) -> Client {
        let link = Box::new(hub.link());
        let mut client = Client::over(link, Arc::new(SystemClock), None, SECOND_NS).unwrap();
        client.subscribe(topics).unwrap();
        client
    }

    #[test]
    fn what_either_side_listens_to_is_in_demand_and_both_hear_each_tick() {
        let hubs = [Hub::new(), Hub::new()];
        let [mut first, mut beside] = hubs.each_ref().map(Set::open);
        let pairs = Topics {
            pairs: true,
            ..Topics::default()
        };
        let bodies = Topics {
            bodies: true,
            ..Topics::default()
        };
        let mut clients = [client(&hubs[0], pairs), client(&hubs[1], bodies)];
        let mut both = Both::new(&mut first, &mut beside);
        let wanted = Demand {
            pairs: true,
            bodies: true,
            ..Demand::default()
        };
        assert_eq!(both.demand(), wanted);
        let mut outbox = Outbox::default();
        outbox.tick.header.boot_id = 7;
        for tick in 1..=3 {
            outbox.tick.header.tick = tick;
            assert_eq!(both.publish(&outbox).unwrap(), Undelivered::default());
            for client in &mut clients {
                assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
                assert_eq!(client.view().tick().header.tick, tick);
            }
        }
    }

    #[test]
    fn each_request_is_answered_where_it_was_asked_though_tokens_are_alike() {
        let hubs = [Hub::new(), Hub::new()];
        let [mut first, mut beside] = hubs.each_ref().map(Set::open);
        let asking = |hub: &Hub, text: &'static str| {
            let hub = hub.clone();
            std::thread::spawn(move || {
                let mut client = client(&hub, Topics::default());
                client.request(text, &[], 10 * SECOND_NS).unwrap()
            })
        };
        let threads = [
            asking(&hubs[0], "{\"edits\": \"first\"}"),
            asking(&hubs[1], "{\"edits\": \"beside\"}"),
        ];
        let mut both = Both::new(&mut first, &mut beside);
        let mut open = Vec::new();
        while open.len() < 2 {
            both.wait(1_000_000, &SystemClock).unwrap();
            both.requests(&mut |token, _, bytes| {
                open.push((token, String::from_utf8(bytes).unwrap()));
            });
        }
        assert_ne!(open[0].0, open[1].0, "told apart");
        for (token, text) in open {
            let word = if text.contains("first") {
                "first"
            } else {
                "beside"
            };
            let json = format!(r#"{{"ok": false, "scene_rev": 0, "error": "{word}"}}"#);
            both.answer(token, false, &json).unwrap();
        }
        let answers = threads.map(|thread| thread.join().unwrap().error.unwrap());
        assert_eq!(answers, ["first", "beside"]);
    }

    #[test]
    fn settings_come_from_both_and_edits_are_told_to_both() {
        let hubs = [Hub::new(), Hub::new()];
        let [mut first, mut beside] = hubs.each_ref().map(Set::open);
        first.settings.push(Setting::TickNow);
        beside.settings.push(Setting::Reset);
        let change = BodyChange::Put(BodyNote {
            name: "late".to_owned(),
            ..BodyNote::default()
        });
        let mut both = Both::new(&mut first, &mut beside);
        let mut all = Vec::new();
        both.settings(&mut |setting| all.push(setting));
        assert_eq!(all, [Setting::TickNow, Setting::Reset]);
        both.bodies(std::slice::from_ref(&change));
        assert_eq!(
            (first.told, beside.told),
            (vec![change.clone()], vec![change])
        );
    }
}
