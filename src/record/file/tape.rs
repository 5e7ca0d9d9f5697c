//! An MCAP file as it is written: topics of CDR, one message after the other.

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

/// Bytes of a chunk, about: what a reader has in memory at least.
const CHUNK_BYTES: usize = 1 << 20;

/// A file whose topics are known.
pub(super) struct Tape<W: Medium> {
    /// `None`: it was closed.
    writer: Option<Writer<Counted<W>>>,
    /// What messages call the file.
    name: String,
    channels: BTreeMap<&'static str, (u16, u32)>,
    bytes: Vec<u8>,
    /// Bytes of the chunk that is being filled.
    chunk_bytes: usize,
    /// How many ticks were written.
    ticks: u64,
    /// How many bytes were handed to the medium.
    handed: Arc<AtomicU64>,
    kept: Kept,
}

/// Whole records that have arrived where they are to be.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    bytes: u64,
    /// How many ticks are in them.
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
    /// A file without messages.
    ///
    /// * `topics` - with the type of each.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be written.
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
            // They end where this tape says, for it has to know what is in them.
            .chunk_size(None)
            // A chunk is written when it is whole: a process that is killed leaves none that lies of its length.
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

    /// The message that is written next makes a tick whole.
    pub(super) fn count(&mut self) {
        self.ticks += 1;
    }

    /// How many ticks the file has.
    pub(super) fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Writes a message of ours: CDR of `uint8[] data`.
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

    /// Hands over what was written: it survives the end of this process.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.with(|writer, _| writer.flush())?;
        self.chunk_bytes = 0;
        self.kept = Kept {
            bytes: self.handed.load(Ordering::Relaxed),
            ticks: self.ticks,
        };
        Ok(())
    }

    /// Writes what closes the file; one that could not be written is closed already.
    ///
    /// * `notes` - its last record.
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
        // That has not flushed it.
        let Some(mut medium) = self.writer.take().map(Writer::into_inner) else {
            return Ok(());
        };
        medium.flush().map_err(|e| {
            let error = told(&self.name, e.into());
            self.break_off(medium, &error);
            error
        })
    }

    /// Does what may fail; when it does, the file ends with what had arrived, and says why.
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

    /// Takes back the part of a record that was written last, which leaves room for a last one that says why.
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
            // Without its front it is no file of this kind, and ends empty.
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

/// What closes a file that has no summary.
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
    // The front of the file and its header, which the file has: opcode, length, record.
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
        // In its own words: those around it speak of compression.
        McapError::Io(error) => Error::io(what, error),
        error => Error::io(what, error),
    }
}
