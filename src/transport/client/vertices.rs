//! Vertices of bodies that deform, as a source sends them.

use super::Client;
use crate::error::{Error, Result};
use crate::wire::{VertexHeader, VertexRow, WIRE_VERSION, name_bytes, vertex_flags};

/// Which vertices of a body are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of them.
    Full,
    /// Some, from `first` on, of a mesh that has `total`: they replace those sent before.
    Range {
        /// Index of the first.
        first: u32,
        /// Number of vertices of the mesh.
        total: u32,
    },
}

impl Client {
    /// Sends vertices of a body that deforms; they belong to the frame that is sent next.
    ///
    /// * `rows` - body frame, metres.
    /// * returns - their version.
    ///
    /// If the daemon has missed or refused vertices of the body (`bodies` says `rejected` and why), it needs all of
    /// them again.
    ///
    /// # Errors
    /// `Error::Usage` when the client was opened without a source, or a range is sent before all vertices were;
    /// `Error::Io` when they cannot be sent: the daemon then needs all vertices again for each body that this source
    /// bends.
    pub fn send_vertices(&mut self, body: u64, part: Part, rows: &[VertexRow]) -> Result<u64> {
        let source = self.source.as_deref().ok_or_else(|| {
            Error::Usage(
                "this client was opened as a reader; name a source to send vertices".into(),
            )
        })?;
        let base_version = self.versions.get(&body).copied();
        let count = u32::try_from(rows.len())
            .map_err(|_| Error::Usage(format!("{} vertices are too many", rows.len())))?;
        let (first, total, flags) = match part {
            Part::Full => (0, count, vertex_flags::FULL),
            Part::Range { .. } if base_version.is_none() => {
                return Err(Error::Usage(
                    "a range of vertices changes those sent before: send all of them first".into(),
                ));
            }
            Part::Range { first, total } => (first, total, vertex_flags::RANGE),
        };
        let base_version = base_version.unwrap_or(0);
        let header = VertexHeader {
            session: self.frame.session,
            epoch: self.frame.epoch,
            seq: self.frame.seq + 1,
            sent_ns: self.clock.boottime_ns(),
            body,
            version: base_version + 1,
            base_version,
            number: self.bent + 1,
            source: name_bytes(source),
            first,
            count,
            total,
            flags,
            schema: WIRE_VERSION,
            boot: self.boot(),
        };
        // Counted first, as with a frame.
        self.versions.insert(body, header.version);
        self.bent += 1;
        self.link.send_vertices(&header, rows)?;
        Ok(header.version)
    }
}
