//! The port of `changes` or `contact_changes`, which is opened again when a message was missed.

use std::fmt::Debug;

use iceoryx2::prelude::{Node, ZeroCopySend};

use super::read::{Reader, read};
use crate::error::Result;
use crate::limits;
use crate::transport::client::Message;
use crate::transport::iceoryx::place::Place;
use crate::transport::iceoryx::qos::{self, Ipc, Open, PubSub, failed};
use crate::transport::iceoryx::unmet::Unmet;
use crate::wire::ChangesHeader;

/// A port, if it is subscribed.
pub(super) struct News<T: Debug + ZeroCopySend + 'static> {
    topic: &'static str,
    reader: Reader<T, ChangesHeader>,
    /// Its place went to another reader when it was to be opened again.
    pub(super) owed: bool,
}

/// Where a client's ports are opened.
pub(super) struct Spot {
    pub(super) unmet: Unmet,
    pub(super) node: Node<Ipc>,
    pub(super) place: Place,
}

impl<T: Debug + ZeroCopySend + Copy + 'static> News<T> {
    pub(super) fn new(topic: &'static str) -> Self {
        Self {
            topic,
            reader: None,
            owed: false,
        }
    }

    /// Opens it, unless it is open.
    pub(super) fn open(&mut self, spot: &Spot) -> Result<()> {
        if self.reader.is_none() {
            self.listen(&self.service(spot)?, spot)?;
        }
        Ok(())
    }

    /// Opens it again if it is open, or was before its place was lost; returns whether it is open now.
    pub(super) fn renew(&mut self, spot: &Spot) -> Result<bool> {
        let service = match self.service(spot) {
            // Without a daemon everything stays as it is.
            Err(e) if qos::is_away(&e) => return Ok(false),
            service => service?,
        };
        // The old one goes first, since it takes a reader's place. The service is held meanwhile: while a daemon
        // restarts there may be no other holder, and the last one to release it removes it.
        self.owed |= self.reader.take().is_some();
        if self.owed {
            self.listen(&service, spot)?;
            self.owed = false;
            return Ok(true);
        }
        Ok(false)
    }

    /// The next message.
    pub(super) fn read(&self, into: &mut Message<T, ChangesHeader>) -> Result<bool> {
        read(&self.reader, limits::ROWS_MAX, into)
    }

    fn service(&self, spot: &Spot) -> Result<PubSub<Ipc, [T], ChangesHeader>> {
        qos::changes(&spot.node, &spot.place, self.topic, Open::Existing)
    }

    fn listen(&mut self, service: &PubSub<Ipc, [T], ChangesHeader>, spot: &Spot) -> Result<()> {
        let reader = service
            .subscriber_builder()
            .set_degradation_handler(spot.unmet.handler())
            .create();
        self.reader = Some(reader.map_err(|e| failed(self.topic, e))?);
        Ok(())
    }
}
