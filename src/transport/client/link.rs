//! What a client needs from a transport: one implementation for shared memory, one for memory within the process.

use std::fmt::Debug;

use super::follow::Message;
use crate::error::Result;
use crate::wire::{
    AnswerHeader, BodyRow, ChangesHeader, ContactRow, FrameHeader, Hello, NameRow, PairRow,
    RegionRow, RequestHeader, TickRow, TransformRow, TransformVelRow, VertexHeader, VertexRow,
};

/// Messages to subscribe to in addition to ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "one independent switch a message"
)]
pub struct Topics {
    /// `pairs`.
    pub pairs: bool,
    /// `changes`.
    pub changes: bool,
    /// `contact_changes`.
    pub contact_changes: bool,
    /// `contacts`.
    pub contacts: bool,
    /// `regions`.
    pub regions: bool,
    /// `bodies`.
    pub bodies: bool,
    /// `body_verdicts`.
    pub body_verdicts: bool,
    /// `names`.
    pub names: bool,
    /// `plan`.
    pub plan: bool,
}

impl Topics {
    /// Everything.
    pub const ALL: Self = Self {
        pairs: true,
        changes: true,
        contact_changes: true,
        contacts: true,
        regions: true,
        bodies: true,
        body_verdicts: true,
        names: true,
        plan: true,
    };
}

/// The rows of a frame.
#[derive(Clone, Copy, Debug)]
pub enum Rows<'a> {
    /// Poses.
    Poses(&'a [TransformRow]),
    /// Poses with velocities.
    Moving(&'a [TransformVelRow]),
}

/// A client's ports. Reads never wait: `None` or `false` means that there is nothing newer.
///
/// Every method fails with `Error::Io` when its port does.
pub trait Link: Debug {
    /// Opens the ports of these messages; open ones stay open.
    ///
    /// # Errors
    /// `Error::Io`.
    fn subscribe(&mut self, topics: Topics) -> Result<()>;
    /// Sends a frame and wakes the daemon.
    ///
    /// # Errors
    /// `Error::Io`.
    fn send(&mut self, header: &FrameHeader, rows: Rows<'_>) -> Result<()>;
    /// Sends vertices of one body, ahead of the frame that they belong to.
    ///
    /// # Errors
    /// `Error::Io`.
    fn send_vertices(&mut self, header: &VertexHeader, rows: &[VertexRow]) -> Result<()>;
    /// Sleeps until the daemon has sent something, a signal came, or `timeout_ns` have passed.
    ///
    /// # Errors
    /// `Error::Io`.
    fn wait(&mut self, timeout_ns: u64) -> Result<()>;
    /// The next tick.
    ///
    /// # Errors
    /// `Error::Io`.
    fn tick(&mut self) -> Result<Option<TickRow>>;
    /// The next `pairs`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn pairs(&mut self, into: &mut Message<PairRow>) -> Result<bool>;
    /// The next `changes`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn changes(&mut self, into: &mut Message<PairRow, ChangesHeader>) -> Result<bool>;
    /// Opens the port of `changes` again: messages in it are lost, and the daemon sends the whole list next.
    ///
    /// # Errors
    /// `Error::Io`.
    fn renew_changes(&mut self) -> Result<()>;
    /// The next `contact_changes`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn contact_changes(&mut self, into: &mut Message<ContactRow, ChangesHeader>) -> Result<bool>;
    /// As [`Link::renew_changes`], for `contact_changes`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn renew_contact_changes(&mut self) -> Result<()>;
    /// The next `contacts`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn contacts(&mut self, into: &mut Message<ContactRow>) -> Result<bool>;
    /// The next `regions`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn regions(&mut self, into: &mut Message<RegionRow>) -> Result<bool>;
    /// The next `bodies`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn bodies(&mut self, into: &mut Message<BodyRow>) -> Result<bool>;
    /// The next `body_verdicts`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn body_verdicts(&mut self, into: &mut Message<u8>) -> Result<bool>;
    /// The next `names`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn names(&mut self, into: &mut Message<NameRow>) -> Result<bool>;
    /// The next `plan`, JSON.
    ///
    /// # Errors
    /// `Error::Io`.
    fn plan(&mut self, into: &mut Message<u8>) -> Result<bool>;
    /// The newest `hello`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn hello(&mut self) -> Result<Option<Hello>>;
    /// Sends a request: JSON, then blobs.
    ///
    /// # Errors
    /// `Error::Io`.
    fn request(&mut self, header: &RequestHeader, json: &[u8], blobs: &[&[u8]]) -> Result<()>;
    /// The next answer to any request, its JSON in `into`.
    ///
    /// # Errors
    /// `Error::Io`.
    fn answer(&mut self, into: &mut Vec<u8>) -> Result<Option<AnswerHeader>>;
}
