//! The readers of `changes` or `contact_changes`: a new one cannot use them until it has the whole list.

use std::fmt::Debug;

use iceoryx2::prelude::{CallbackProgression, Node, PortFactory as _, ZeroCopySend};

use super::sent::Handed;
use super::{Ipc, Out};
use crate::error::Result;
use crate::transport::iceoryx::place::Place;
use crate::transport::iceoryx::qos::{self, Open};
use crate::transport::iceoryx::unmet::Unmet;
use crate::wire::ChangesHeader;

/// A message with changes, and its readers.
pub(super) struct Changes<T: Debug + ZeroCopySend + 'static> {
    pub(super) out: Out<T, ChangesHeader>,
    /// Ports of the readers at this check, and at the last one.
    now: Vec<u128>,
    before: Vec<u128>,
    /// A reader came, or a message was lost, since the whole list was last sent.
    owed: bool,
}

impl<T: Debug + ZeroCopySend + Copy + 'static> Changes<T> {
    pub(super) fn open(
        node: &Node<Ipc>,
        place: &Place,
        topic: &str,
        unmet: &Unmet,
    ) -> Result<Self> {
        let service = qos::changes(node, place, topic, Open::Create)?;
        Ok(Self {
            out: Out::of(service, unmet)?,
            now: Vec::new(),
            before: Vec::new(),
            owed: false,
        })
    }

    /// Returns whether it has readers, and whether the whole list is owed. Compares ports, not their number: one may
    /// have replaced another.
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
        let is_read = !self.now.is_empty();
        // Nothing is owed to readers that have gone.
        self.owed &= is_read;
        self.owed |= self.now.iter().any(|port| !self.before.contains(port));
        (is_read, self.owed)
    }

    /// Sends the message.
    pub(super) fn send(&mut self, header: &ChangesHeader, rows: &[T]) -> Handed {
        let handed = super::sent::send(&self.out.publisher, header, rows);
        if handed != Handed::Over || header.base_tick == 0 {
            self.owed = handed != Handed::Over;
        }
        handed
    }
}
