//! Vertices of bodies that deform: their row, their header, and a decoded frame of them.

use iceoryx2::prelude::ZeroCopySend;

use super::codes::RejectReason;
use super::rows::SOURCE_NAME_LEN;

/// One vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Vertex")]
pub struct VertexRow {
    /// In the body's frame, metres.
    pub position: [f32; 3],
}

/// User header of `vertices`: whose they are, which of them, and which version they make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.VertexHeader")]
pub struct VertexHeader {
    /// Session of the client, the same as in its frames; never 0.
    pub session: u64,
    /// Epoch of the frame that they belong with.
    pub epoch: u64,
    /// Number of the frame that they belong with: they are taken with the first that is not older, or, but for those of
    /// the source that `on_frame` names, after a time-out of their source. 0: at once, behind what the session sent
    /// before.
    pub seq: u64,
    /// When the client sent them, nanoseconds of `CLOCK_BOOTTIME`; 0: not said.
    pub sent_ns: u64,
    /// Body id.
    pub body: u64,
    /// Version of the vertices after this message, from 1; raised with each message of a body.
    pub version: u64,
    /// Of a range: the version that it is applied to. Any other, and it is refused.
    pub base_version: u64,
    /// Which message of vertices of the session this is, from 1: a gap says that some were lost, and all that the
    /// source bent is unknown until all of its vertices come again. 0: not said.
    pub number: u64,
    /// Name of the source, NUL-padded UTF-8.
    pub source: [u8; SOURCE_NAME_LEN],
    /// Place of the first row in the mesh's list of vertices; 0 where all are sent.
    pub first: u32,
    /// How many rows follow.
    pub count: u32,
    /// How many vertices the mesh has.
    pub total: u32,
    /// `vertex_flags`: full or range.
    pub flags: u32,
    /// `WIRE_VERSION` of the sender.
    pub schema: u32,
    /// Low half of the `boot_id` whose body ids the rows have; 0: not said. What is of another boot is refused.
    pub boot: u32,
}

/// Vertices of one body, copied out of the transport, not yet checked.
#[derive(Clone, Debug, Default)]
pub struct VertexFrame {
    /// As the client wrote it.
    pub header: VertexHeader,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub received_ns: u64,
    /// `[count]` positions, body frame, metres.
    pub rows: Vec<[f32; 3]>,
    /// Whether it waited while the daemon was silent for longer than a heartbeat.
    pub waited: bool,
    /// Why the transport left its rows behind (too many to copy).
    pub refused: Option<RejectReason>,
}

impl VertexFrame {
    /// Takes rows as they came.
    pub fn set_rows(&mut self, rows: &[VertexRow]) {
        self.rows.clear();
        self.rows.extend(rows.iter().map(|row| row.position));
    }

    /// Empties it, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.header = VertexHeader::default();
        self.received_ns = 0;
        self.waited = false;
        self.refused = None;
        self.rows.clear();
    }
}

/// The vertex frames of one tick, in order of receipt. Cleared ones are kept and reused.
#[derive(Clone, Debug, Default)]
pub(super) struct VertexFrames {
    all: Vec<VertexFrame>,
    len: usize,
}

impl VertexFrames {
    pub(super) fn push(&mut self) -> &mut VertexFrame {
        if self.len == self.all.len() {
            self.all.push(VertexFrame::default());
        }
        let frame = &mut self.all[self.len];
        self.len += 1;
        frame.clear();
        frame
    }

    pub(super) fn all(&self) -> &[VertexFrame] {
        &self.all[..self.len]
    }

    pub(super) fn all_mut(&mut self) -> &mut [VertexFrame] {
        &mut self.all[..self.len]
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
    }
}
