//! Writes an MCAP file: CDR topics, one message after the other.

use std::collections::BTreeMap;
use std::io::{Cursor, ErrorKind, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use byteorder::LittleEndian;
use mcap::records::{MessageHeader, Metadata};
use mcap::{MAGIC, McapError, McapResult, WriteOptions, Writer};
use serde::Serialize;

use super::medium::{Counted, Medium};
use super::schemas::schema;
use super::{CDR_HEAD, END, TICKS, WHY};
use crate::error::{Error, Result};

/// Approximate bytes of a chunk, which a reader holds in memory as a whole.
const CHUNK_BYTES: usize = 1 << 20;

/// A file with a fixed list of topics.
pub(super) struct Tape<W: Medium> {
    /// `None`: the file is closed.
    writer: Option<Writer<Counted<W>>>,
    /// Name of the file in messages.
    name: String,
    channels: BTreeMap<&'static str, (u16, u32)>,
    bytes: Vec<u8>,
    /// Bytes in the current chunk.
    chunk_bytes: usize,
    /// Number of ticks written.
    ticks: u64,
    /// Number of bytes handed to the medium.
    handed: Arc<AtomicU64>,
    kept: Kept,
}

/// Complete records that have reached the medium.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    bytes: u64,
    /// Number of ticks in them.
    ticks: u64,
}

impl<W: Medium> std::fmt::Debug for Tape<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tape")
            .field("name", &self.name)
            .field("kept", &self.kept)
            .finish_non_exhaustive()
    }
}

impl<W: Medium> Tape<W> {
    /// Begins a file without messages.
    ///
    /// * `topics` - each topic with its type.
    ///
    /// # Errors
    /// `Error::Io` if it cannot be written.
    pub(super) fn new(
        to: W,
        name: &str,
        topics: impl Iterator<Item = (&'static str, &'static str)>,
    ) -> Result<Self> {
        let told = |e| told(name, e);
        let (to, handed) = Counted::new(to);
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("sweepd/", env!("CARGO_PKG_VERSION")))
            .compression(None)
            // This type ends the chunks, since it has to know their content.
            .chunk_size(None)
            // A chunk is written only when it is complete: a killed process leaves none with a wrong length.
            .disable_seeking(true)
            .create(to)
            .map_err(told)?;
        let mut channels = BTreeMap::new();
        for (topic, kind) in topics {
            let schema = writer.add_schema(kind, "ros2msg", schema(kind).as_bytes());
            let channel =
                schema.and_then(|id| writer.add_channel(id, topic, "cdr", &BTreeMap::new()));
            channels.insert(topic, (channel.map_err(told)?, 0));
        }
        Ok(Self {
            writer: Some(writer),
            name: name.to_owned(),
            channels,
            bytes: Vec::new(),
            chunk_bytes: 0,
            ticks: 0,
            handed,
            kept: Kept::default(),
        })
    }

    /// Counts a tick, which the next message makes complete.
    pub(super) fn count(&mut self) {
        self.ticks += 1;
    }

    /// Number of ticks in the file.
    pub(super) fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Writes a message of our own types: CDR of `uint8[] data`.
    pub(super) fn write_bytes(
        &mut self,
        topic: &'static str,
        time_ns: u64,
        fill: impl FnOnce(&mut Vec<u8>),
    ) -> Result<()> {
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_HEAD);
        self.bytes.extend_from_slice(&[0; 4]);
        fill(&mut self.bytes);
        let len = u32::try_from(self.bytes.len() - 8).unwrap_or(u32::MAX);
        if let Some(place) = self.bytes.get_mut(4..8) {
            place.copy_from_slice(&len.to_le_bytes());
        }
        self.write(topic, time_ns)
    }

    /// Writes a ROS 2 message.
    pub(super) fn write_message<M: Serialize>(
        &mut self,
        topic: &'static str,
        time_ns: u64,
        message: &M,
    ) -> Result<()> {
        let bytes = cdr_encoding::to_vec::<M, LittleEndian>(message)
            .map_err(|e| Error::io(format!("cannot write {topic} to {}", self.name), e))?;
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_HEAD);
        self.bytes.extend_from_slice(&bytes);
        self.write(topic, time_ns)
    }

    fn write(&mut self, topic: &'static str, time_ns: u64) -> Result<()> {
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else {
            return Ok(());
        };
        *sequence += 1;
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.with(|writer, bytes| writer.write_to_known_channel(&header, bytes))?;
        self.chunk_bytes += self.bytes.len();
        if self.chunk_bytes > CHUNK_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    /// Ends the chunk and flushes the medium: what was written then survives the end of this process.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.with(|writer, _| writer.flush())?;
        self.chunk_bytes = 0;
        self.kept = Kept {
            bytes: self.handed.load(Ordering::Relaxed),
            ticks: self.ticks,
        };
        Ok(())
    }

    /// Closes the file; one that could not be written is closed already.
    ///
    /// * `notes` - content of the last record.
    pub(super) fn end(&mut self, notes: BTreeMap<String, String>) -> Result<()> {
        if self.writer.is_none() {
            return Ok(());
        }
        self.flush()?;
        let note = Metadata {
            name: END.to_owned(),
            metadata: notes,
        };
        self.with(|writer, _| {
            writer.write_metadata(&note)?;
            writer.finish().map(drop)
        })?;
        // `finish` does not flush the medium.
        let Some(mut medium) = self.writer.take().map(Writer::into_inner) else {
            return Ok(());
        };
        medium.flush().map_err(|e| {
            let error = told(&self.name, e.into());
            self.break_off(medium, &error);
            error
        })
    }

    /// Runs a write. If it fails, the file is cut after the last complete records and closed with the reason.
    fn with(
        &mut self,
        what: impl FnOnce(&mut Writer<Counted<W>>, &[u8]) -> McapResult<()>,
    ) -> Result<()> {
        let done = match &mut self.writer {
            Some(writer) => what(writer, &self.bytes),
            None => Err(McapError::AttemptedWriteAfterFailure),
        };
        done.map_err(|error| {
            let error = told(&self.name, error);
            if let Some(writer) = self.writer.take() {
                self.break_off(writer.into_inner(), &error);
            }
            error
        })
    }

    /// Cuts off the records that were not flushed, which makes room for a last one with the reason.
    fn break_off(&mut self, medium: Counted<W>, error: &Error) {
        self.ticks = self.kept.ticks;
        let note = Metadata {
            name: END.to_owned(),
            metadata: BTreeMap::from([
                (WHY.to_owned(), error.with_causes()),
                (TICKS.to_owned(), self.kept.ticks.to_string()),
            ]),
        };
        let closed = ending_of(&note).and_then(|ending| {
            let mut medium = medium.cut(self.kept.bytes)?;
            // Without its first records the file is no MCAP file, and is left empty.
            if self.kept.bytes == 0 {
                return Ok(());
            }
            medium.write_all(&ending)?;
            Ok(medium.flush()?)
        });
        if let Err(e) = closed {
            tracing::debug!("{} could not be closed, it is cut off: {e}", self.name);
        }
    }
}

/// The records that close a file without a summary.
fn ending_of(note: &Metadata) -> McapResult<Vec<u8>> {
    let mut writer = WriteOptions::new()
        .emit_summary_records(false)
        .emit_summary_offsets(false)
        .emit_metadata_indexes(false)
        .calculate_data_section_crc(false)
        .create(Cursor::new(Vec::new()))?;
    writer.write_metadata(note)?;
    writer.finish()?;
    let mut bytes = writer.into_inner().into_inner();
    // Drops the magic and the header (opcode, length, record), which the file has already.
    let len = bytes.get(MAGIC.len() + 1..).and_then(<[u8]>::first_chunk);
    let len = len.map_or(0, |len| u64::from_le_bytes(*len));
    let front = (MAGIC.len() + 9).saturating_add(usize::try_from(len).unwrap_or(usize::MAX));
    bytes.drain(..front.min(bytes.len()));
    Ok(bytes)
}

fn is_full(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}

fn told(name: &str, error: McapError) -> Error {
    let why = match &error {
        McapError::Io(e) if e.kind() == ErrorKind::FileTooLarge => {
            "it is as long as a file of this process may be: `ulimit -f unlimited` in the shell that starts it, or in \
             its service's unit"
        }
        McapError::Io(e) if is_full(e.kind()) => "is the disk full?",
        _ => "nothing more is recorded",
    };
    let what = format!("cannot write the recording {name}; {why}");
    match error {
        // The error itself: the texts of mcap around it speak of compression.
        McapError::Io(error) => Error::io(what, error),
        error => Error::io(what, error),
    }
}
