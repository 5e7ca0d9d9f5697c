//! The daemon's side in memory.

use std::sync::Arc;
use std::time::Duration;

use super::{Hub, Newest, Peer, RESULT_BUFFER, Rows, Shared, State, queue};
use crate::error::{Error, Result};
use crate::limits;
use crate::time::Clock;
use crate::transport::client::Message;
use crate::transport::hello::hello;
use crate::transport::request::{UNANSWERED, refusal, unreadable};
use crate::transport::{Door, RequestToken, Wake};
use crate::wire::{
    AnswerHeader, ChangesHeader, Demand, Inbox, MessageHeader, Outbox, RejectReason, RequestHeader,
    TickRow, Undelivered, WIRE_VERSION,
};

/// The daemon's side of a [`Hub`]; dropping it frees the hub.
#[derive(Debug)]
pub struct MemoryServer {
    shared: Arc<Shared>,
    boot_id: u64,
    heartbeat_ns: u64,
    frame_rows_max: usize,
    drained_ns: Option<u64>,
    demand: Demand,
    /// A client subscribed to `changes` or `contact_changes` since these were last sent whole.
    changes_owed: bool,
    next_token: u64,
}

impl MemoryServer {
    /// Takes the hub and sends hello.
    ///
    /// # Errors
    /// `Error::Refused` when the hub has a server.
    pub fn open(hub: &Hub, boot_id: u64, heartbeat_ns: u64) -> Result<Self> {
        let shared = Arc::clone(&hub.shared);
        let mut state = shared.lock();
        if state.served {
            return Err(Error::Refused("the hub is taken by another server".into()));
        }
        let hello = hello(boot_id);
        state.served = true;
        state.newest = Newest {
            hello: Some(hello),
            ..Newest::default()
        };
        for peer in state.peers.values_mut() {
            peer.hello = Some(hello);
            peer.ready = true;
        }
        drop(state);
        shared.to_clients.notify_all();
        Ok(Self {
            shared,
            boot_id,
            heartbeat_ns,
            frame_rows_max: limits::FRAME_ROWS_MAX,
            drained_ns: None,
            demand: Demand::default(),
            changes_owed: false,
            next_token: 1,
        })
    }

    /// Sets the largest frame; frames with more rows are refused.
    #[must_use]
    pub fn with_frame_rows_max(mut self, rows: usize) -> Self {
        self.frame_rows_max = rows;
        self
    }

    fn send_all(&mut self, outbox: &Outbox) {
        let mut state = self.shared.lock();
        let State { newest, peers, .. } = &mut *state;
        macro_rules! send {
            ($topic:ident, $header:expr, $rows:expr) => {
                let message = Message {
                    header: $header,
                    rows: $rows.to_vec(),
                };
                for peer in peers.values_mut().filter(|p| p.topics.$topic) {
                    queue(&mut peer.$topic, message.clone());
                }
                newest.$topic = Some(message);
            };
        }
        // The newest message is not kept: it is useless without those before it.
        macro_rules! send_new {
            ($topic:ident, $header:expr, $rows:expr) => {
                let message = Message {
                    header: $header,
                    rows: $rows.clone(),
                };
                for peer in peers.values_mut().filter(|p| p.topics.$topic) {
                    queue(&mut peer.$topic, message.clone());
                }
            };
        }
        let whole = MessageHeader {
            truncated: 0,
            ..outbox.tick.header
        };
        if self.demand.contacts {
            send!(contacts, outbox.contacts_header, outbox.contacts);
        }
        if self.demand.regions {
            send!(regions, outbox.regions_header, outbox.regions);
        }
        if self.demand.pairs {
            send!(pairs, outbox.pairs_header, outbox.pairs);
        }
        if self.demand.changes {
            send_new!(changes, outbox.changes_header, outbox.changes);
        }
        let new_contacts = outbox.contact_changes_header;
        if self.demand.contact_changes {
            send_new!(contact_changes, new_contacts, outbox.contact_changes);
        }
        let is_whole = |read: bool, header: &ChangesHeader| !read || header.base_tick == 0;
        let all_whole = is_whole(self.demand.changes, &outbox.changes_header)
            && is_whole(self.demand.contact_changes, &new_contacts);
        self.changes_owed &= !all_whole;
        if self.demand.bodies {
            send!(bodies, outbox.bodies_header, outbox.bodies);
        }
        if self.demand.body_verdicts {
            send!(body_verdicts, whole, outbox.body_verdicts);
        }
        if outbox.names_changed {
            send!(names, whole, outbox.names);
        }
        if outbox.plan_changed {
            send!(plan, whole, outbox.plan.as_bytes());
        }
    }
}

fn take_frames(peer: &mut Peer, inbox: &mut Inbox, now_ns: u64, waited: bool, rows_max: usize) {
    for (header, rows) in peer.frames.drain(..) {
        let frame = inbox.push();
        frame.header = header;
        frame.received_ns = now_ns;
        frame.waited = waited;
        let len = match &rows {
            Rows::Poses(rows) => rows.len(),
            Rows::Moving(rows) => rows.len(),
        };
        if len > rows_max {
            frame.refused = Some(RejectReason::OverLimit);
            continue;
        }
        match rows {
            Rows::Poses(rows) => frame.set_transforms(&rows),
            Rows::Moving(rows) => frame.set_transforms_vel(&rows),
        }
    }
    for (header, rows) in peer.vertices.drain(..) {
        let frame = inbox.push_vertices();
        frame.header = header;
        (frame.received_ns, frame.waited) = (now_ns, waited);
        if rows.len() > limits::DEFORMING_VERTICES_MAX {
            frame.refused = Some(RejectReason::OverLimit);
        } else {
            frame.set_rows(&rows);
        }
    }
}

impl Door for MemoryServer {
    fn wait(&mut self, timeout_ns: u64, _clock: &dyn Clock) -> Result<Wake> {
        let state = self.shared.lock();
        let timeout = Duration::from_nanos(timeout_ns);
        let waited = self
            .shared
            .to_server
            .wait_timeout_while(state, timeout, |state| state.wake == Wake::default());
        let mut state = match waited {
            Ok((state, _)) => state,
            Err(poisoned) => poisoned.into_inner().0,
        };
        Ok(std::mem::take(&mut state.wake))
    }

    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        let now_ns = clock.boottime_ns();
        let silence_ns = self.heartbeat_ns + self.heartbeat_ns / 2;
        let waited = self
            .drained_ns
            .is_none_or(|before_ns| now_ns.saturating_sub(before_ns) > silence_ns);
        self.drained_ns = Some(now_ns);
        let mut state = self.shared.lock();
        for peer in state.peers.values_mut() {
            take_frames(peer, inbox, now_ns, waited, self.frame_rows_max);
        }
        state.peers.retain(|_, peer| {
            if peer.left && peer.session != 0 {
                inbox.end_session(peer.session);
            }
            !peer.left
        });
    }

    fn demand(&mut self) -> Demand {
        let mut state = self.shared.lock();
        let mut demand = Demand::default();
        for peer in state.peers.values_mut().filter(|peer| !peer.left) {
            demand.pairs |= peer.topics.pairs;
            demand.changes |= peer.topics.changes;
            demand.contact_changes |= peer.topics.contact_changes;
            self.changes_owed |= std::mem::take(&mut peer.changes_anew);
            demand.contacts |= peer.topics.contacts;
            demand.regions |= peer.topics.regions;
            demand.bodies |= peer.topics.bodies;
            demand.body_verdicts |= peer.topics.body_verdicts;
        }
        demand.changes_anew = (demand.changes || demand.contact_changes) && self.changes_owed;
        self.demand = demand;
        demand
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        self.send_all(outbox);
        self.publish_tick(&outbox.tick)?;
        Ok(Undelivered::default())
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        let mut state = self.shared.lock();
        state.newest.tick = Some(*tick);
        for peer in state.peers.values_mut() {
            queue(&mut peer.tick, *tick);
            peer.ready = true;
        }
        drop(state);
        self.shared.to_clients.notify_all();
        Ok(())
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
        loop {
            let token = RequestToken(self.next_token);
            let mut state = self.shared.lock();
            let Some((peer, header, bytes)) = state.requests.pop_front() else {
                return;
            };
            self.next_token += 1;
            state.asked.insert(token, (peer, header.request));
            drop(state);
            if let Some(error) = unreadable(&header, bytes.len()) {
                let _in_memory = self.answer(token, false, &refusal(error));
                continue;
            }
            take(token, header, bytes);
        }
    }

    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        let mut state = self.shared.lock();
        if let Some((peer, request)) = state.asked.remove(&token)
            && let Some(peer) = state.peers.get_mut(&peer)
        {
            let header = answer_header(self.boot_id, request, ok);
            if peer.answers.len() < RESULT_BUFFER {
                peer.answers.push_back((header, json.as_bytes().to_vec()));
            }
            peer.ready = true;
        }
        drop(state);
        self.shared.to_clients.notify_all();
        Ok(())
    }

    fn housekeeping(&mut self) {
        let mut state = self.shared.lock();
        let State { asked, peers, .. } = &mut *state;
        asked.retain(|_, (peer, _)| peers.contains_key(peer));
    }
}

impl Drop for MemoryServer {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        let State {
            asked,
            requests,
            peers,
            ..
        } = &mut *state;
        let unread = requests
            .drain(..)
            .map(|(peer, header, _)| (peer, header.request));
        let rest: Vec<_> = std::mem::take(asked).into_values().chain(unread).collect();
        for (peer, request) in rest {
            if let Some(peer) = peers.get_mut(&peer) {
                let header = answer_header(self.boot_id, request, false);
                let json = refusal(UNANSWERED.into()).into_bytes();
                peer.answers.push_back((header, json));
                peer.ready = true;
            }
        }
        state.served = false;
        state.newest = Newest::default();
        drop(state);
        self.shared.to_clients.notify_all();
    }
}

fn answer_header(boot_id: u64, request: u64, ok: bool) -> AnswerHeader {
    AnswerHeader {
        boot_id,
        request,
        schema: WIRE_VERSION,
        ok: u32::from(ok),
    }
}
