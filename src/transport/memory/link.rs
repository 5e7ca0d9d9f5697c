//! A client's ports in memory.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use super::{Peer, Rows as Queued, SOURCE_BUFFER, Shared, VERTEX_BUFFER};
use crate::error::Result;
use crate::transport::client::{Link, Message, Rows, Topics};
use crate::wire::{
    AnswerHeader, BodyRow, ChangesHeader, ContactRow, FrameHeader, Hello, NameRow, PairRow,
    RegionRow, RequestHeader, TickRow, VertexHeader, VertexRow,
};

/// A client's ports in memory; dropping it leaves cleanly.
#[derive(Debug)]
pub struct MemoryLink {
    shared: Arc<Shared>,
    peer: u64,
}

impl MemoryLink {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        let mut state = shared.lock();
        state.peers_made += 1;
        let number = state.peers_made;
        let mut peer = Peer {
            hello: state.newest.hello,
            ..Peer::default()
        };
        peer.tick.extend(state.newest.tick);
        state.peers.insert(number, peer);
        state.wake.peers_changed = true;
        drop(state);
        shared.to_server.notify_all();
        Self {
            shared,
            peer: number,
        }
    }

    fn with<R>(&self, default: R, act: impl FnOnce(&mut Peer) -> R) -> R {
        let mut state = self.shared.lock();
        match state.peers.get_mut(&self.peer) {
            Some(peer) => act(peer),
            None => default,
        }
    }
}

fn pop<M>(queue: &mut VecDeque<M>, into: &mut M) -> bool {
    match queue.pop_front() {
        Some(message) => {
            *into = message;
            true
        }
        None => false,
    }
}

impl Link for MemoryLink {
    fn subscribe(&mut self, topics: Topics) -> Result<()> {
        let mut state = self.shared.lock();
        let state = &mut *state;
        let Some(peer) = state.peers.get_mut(&self.peer) else {
            return Ok(());
        };
        // A new subscriber gets the newest message.
        macro_rules! join {
            ($($topic:ident)+) => {$(
                if topics.$topic && !peer.topics.$topic {
                    peer.topics.$topic = true;
                    peer.$topic.extend(state.newest.$topic.clone());
                }
            )+};
        }
        join!(pairs contacts regions bodies body_verdicts names plan);
        // The newest message is useless without those before it.
        peer.changes_anew |= topics.changes && !peer.topics.changes;
        peer.changes_anew |= topics.contact_changes && !peer.topics.contact_changes;
        peer.topics.changes |= topics.changes;
        peer.topics.contact_changes |= topics.contact_changes;
        state.wake.peers_changed = true;
        self.shared.to_server.notify_all();
        Ok(())
    }

    fn send(&mut self, header: &FrameHeader, rows: Rows<'_>) -> Result<()> {
        let rows = match rows {
            Rows::Poses(rows) => Queued::Poses(rows.to_vec()),
            Rows::Moving(rows) => Queued::Moving(rows.to_vec()),
        };
        let mut state = self.shared.lock();
        if let Some(peer) = state.peers.get_mut(&self.peer) {
            if peer.frames.len() == SOURCE_BUFFER {
                peer.frames.pop_front();
            }
            peer.frames.push_back((*header, rows));
            peer.session = header.session;
        }
        state.wake.notified = true;
        drop(state);
        self.shared.to_server.notify_all();
        Ok(())
    }

    fn send_vertices(&mut self, header: &VertexHeader, rows: &[VertexRow]) -> Result<()> {
        let mut state = self.shared.lock();
        if let Some(peer) = state.peers.get_mut(&self.peer) {
            if peer.vertices.len() == VERTEX_BUFFER {
                peer.vertices.pop_front();
            }
            peer.vertices.push_back((*header, rows.to_vec()));
            peer.session = header.session;
        }
        // No wake-up: the frame that they belong to comes next.
        Ok(())
    }

    fn wait(&mut self, timeout_ns: u64) -> Result<()> {
        let number = self.peer;
        let state = self.shared.lock();
        let timeout = Duration::from_nanos(timeout_ns);
        let waited = self
            .shared
            .to_clients
            .wait_timeout_while(state, timeout, |state| {
                state.peers.get(&number).is_some_and(|peer| !peer.ready)
            });
        let mut state = match waited {
            Ok((state, _)) => state,
            Err(poisoned) => poisoned.into_inner().0,
        };
        if let Some(peer) = state.peers.get_mut(&number) {
            peer.ready = false;
        }
        Ok(())
    }

    fn tick(&mut self) -> Result<Option<TickRow>> {
        Ok(self.with(None, |peer| peer.tick.pop_front()))
    }

    fn pairs(&mut self, into: &mut Message<PairRow>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.pairs, into)))
    }

    fn changes(&mut self, into: &mut Message<PairRow, ChangesHeader>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.changes, into)))
    }

    fn renew_changes(&mut self) -> Result<()> {
        self.with((), |peer| {
            peer.changes.clear();
            peer.changes_anew |= peer.topics.changes;
        });
        Ok(())
    }

    fn contact_changes(&mut self, into: &mut Message<ContactRow, ChangesHeader>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.contact_changes, into)))
    }

    fn renew_contact_changes(&mut self) -> Result<()> {
        self.with((), |peer| {
            peer.contact_changes.clear();
            peer.changes_anew |= peer.topics.contact_changes;
        });
        Ok(())
    }

    fn contacts(&mut self, into: &mut Message<ContactRow>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.contacts, into)))
    }

    fn regions(&mut self, into: &mut Message<RegionRow>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.regions, into)))
    }

    fn bodies(&mut self, into: &mut Message<BodyRow>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.bodies, into)))
    }

    fn body_verdicts(&mut self, into: &mut Message<u8>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.body_verdicts, into)))
    }

    fn names(&mut self, into: &mut Message<NameRow>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.names, into)))
    }

    fn plan(&mut self, into: &mut Message<u8>) -> Result<bool> {
        Ok(self.with(false, |peer| pop(&mut peer.plan, into)))
    }

    fn hello(&mut self) -> Result<Option<Hello>> {
        Ok(self.with(None, |peer| peer.hello.take()))
    }

    fn request(&mut self, header: &RequestHeader, json: &[u8], blobs: &[&[u8]]) -> Result<()> {
        let mut bytes = json.to_vec();
        for blob in blobs {
            bytes.extend_from_slice(blob);
        }
        let mut state = self.shared.lock();
        state.requests.push_back((self.peer, *header, bytes));
        state.wake.notified = true;
        drop(state);
        self.shared.to_server.notify_all();
        Ok(())
    }

    fn answer(&mut self, into: &mut Vec<u8>) -> Result<Option<AnswerHeader>> {
        Ok(self.with(None, |peer| {
            let (header, json) = peer.answers.pop_front()?;
            *into = json;
            Some(header)
        }))
    }
}

impl Drop for MemoryLink {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        if let Some(peer) = state.peers.get_mut(&self.peer) {
            peer.left = true;
        }
        state.wake.peers_changed = true;
        drop(state);
        self.shared.to_server.notify_all();
    }
}
