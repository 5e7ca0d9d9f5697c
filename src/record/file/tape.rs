//! An MCAP file as it is written: topics of CDR, one message after the other.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Seek, Write};

use byteorder::LittleEndian;
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::schemas::schema;
use super::{CDR_HEAD, END};
use crate::error::{Error, Result};

/// Bytes of a chunk, about: what a reader has in memory at least.
const CHUNK_BYTES: u64 = 1 << 20;
/// Bytes that are collected for one call of the system.
const BUFFER_BYTES: usize = 1 << 16;

/// An open file for a recording: what is written is collected for few calls of the system.
#[must_use]
pub fn buffered(file: File) -> BufWriter<File> {
    BufWriter::with_capacity(BUFFER_BYTES, file)
}

/// A file whose topics are known.
pub(super) struct Tape<W: Write + Seek> {
    writer: Writer<W>,
    /// What messages call the file.
    name: String,
    channels: BTreeMap<&'static str, (u16, u32)>,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> std::fmt::Debug for Tape<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tape")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl<W: Write + Seek> Tape<W> {
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
        let failed = |e| failed(name, e);
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("sweepd/", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is written when it is whole: a process that is killed leaves none that lies of its length.
            .disable_seeking(true)
            .create(to)
            .map_err(failed)?;
        let mut channels = BTreeMap::new();
        for (topic, kind) in topics {
            let schema = writer.add_schema(kind, "ros2msg", schema(kind).as_bytes());
            let channel =
                schema.and_then(|id| writer.add_channel(id, topic, "cdr", &BTreeMap::new()));
            channels.insert(topic, (channel.map_err(failed)?, 0));
        }
        Ok(Self {
            writer,
            name: name.to_owned(),
            channels,
            bytes: Vec::new(),
        })
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
        let done = self.writer.write_to_known_channel(&header, &self.bytes);
        done.map_err(|e| failed(&self.name, e))
    }

    /// Hands over what was written: it survives the end of this process.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.writer.flush().map_err(|e| failed(&self.name, e))
    }

    /// Writes what closes the file.
    ///
    /// * `notes` - its last record.
    pub(super) fn end(&mut self, notes: BTreeMap<String, String>) -> Result<()> {
        let note = Metadata {
            name: END.to_owned(),
            metadata: notes,
        };
        let done = self.writer.write_metadata(&note);
        done.and_then(|()| self.writer.finish().map(drop))
            .map_err(|e| failed(&self.name, e))
    }
}

fn failed(name: &str, error: McapError) -> Error {
    let why = match &error {
        McapError::Io(e) if e.kind() == ErrorKind::FileTooLarge => {
            "it is as long as a file of this process may be: `ulimit -f unlimited` in the shell that starts it, or in \
             its service's unit"
        }
        _ => "is the disk full?",
    };
    let what = format!("cannot write the recording {name}; {why}");
    match error {
        // In its own words: those around it speak of compression.
        McapError::Io(error) => Error::io(what, error),
        error => Error::io(what, error),
    }
}
