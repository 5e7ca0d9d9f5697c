//! Who reads `changes`: to one who has just come it says nothing until it has the whole list.

use iceoryx2::prelude::{CallbackProgression, PortFactory as _};

use super::{Out, Server};
use crate::wire::{ChangesHeader, Outbox, PairRow};

/// `changes` and who reads it.
pub(super) struct Changes {
    pub(super) out: Out<PairRow, ChangesHeader>,
    /// Ports of the readers at this look, and at the one before.
    now: Vec<u128>,
    before: Vec<u128>,
    /// Somebody came, or a message was lost, since the whole list was last sent.
    owed: bool,
}

impl Changes {
    pub(super) fn new(out: Out<PairRow, ChangesHeader>) -> Self {
        Self {
            out,
            now: Vec::new(),
            before: Vec::new(),
            owed: false,
        }
    }

    /// Whether somebody reads it, and whether the whole list is owed. By ports, not by their number: one may have come
    /// in the place of another.
    pub(super) fn look(&mut self) -> (bool, bool) {
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.clear();
        if self.out.read() {
            let now = &mut self.now;
            self.out.service.dynamic_config().list_subscribers(|port| {
                now.push(port.subscriber_id.value());
                CallbackProgression::Continue
            });
        }
        self.owed |= self.now.iter().any(|port| !self.before.contains(port));
        (!self.now.is_empty(), self.owed)
    }
}

impl Server {
    /// Sends it.
    ///
    /// * returns - 1 when it could not be handed over.
    pub(super) fn send_changes(&mut self, outbox: &Outbox) -> u64 {
        let (port, header) = (&self.changes.out.publisher, &outbox.changes_header);
        let lost = super::sent::send(port, header, &outbox.changes);
        if lost > 0 || header.base_tick == 0 {
            self.changes.owed = lost > 0;
        }
        lost
    }
}
