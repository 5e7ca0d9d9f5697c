//! A recording is written: bit by bit for a replay, and as ROS 2 messages for people.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use byteorder::LittleEndian;
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::schemas::schema;
use super::{CDR_HEAD, END, INPUT, NOT_SHOWN, OUTPUT, START, WHY};
use crate::error::{Error, Result};
use crate::record::code::{put_input, put_output, start_bytes};
use crate::record::{Sink, Start, TickRecord};
use crate::wire::ros::{Book, Counts, Speaker, Time};

/// Bytes of a chunk, about: what a reader has in memory at least.
const CHUNK_BYTES: u64 = 1 << 20;
/// Bytes that are collected for one call of the system.
const BUFFER_BYTES: usize = 1 << 16;

/// Topics and their types. Names come before what names them.
const TOPICS: &[(&str, &str)] = &[
    (START, "sweepd_record/msg/Start"),
    (INPUT, "sweepd_record/msg/Input"),
    (OUTPUT, "sweepd_record/msg/Output"),
    ("/sweepd/names", "sweepd_msgs/msg/Names"),
    ("/sweepd/bodies", "sweepd_msgs/msg/BodyTransforms"),
    ("/sweepd/contacts", "sweepd_msgs/msg/Contacts"),
    ("/sweepd/pairs", "sweepd_msgs/msg/Pairs"),
    ("/sweepd/state", "sweepd_msgs/msg/State"),
    ("/sweepd/tick", "sweepd_msgs/msg/Tick"),
];

/// Opens a new file for a recording.
///
/// * `over` - whether one that is there is written over.
///
/// # Errors
/// `Error::Refused` when it is there, `Error::Io` when it cannot be opened.
pub fn create(path: &Path, over: bool) -> Result<BufWriter<File>> {
    let mut how = File::options();
    how.write(true)
        .create(over)
        .create_new(!over)
        .truncate(true);
    let file = how.open(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::AlreadyExists => Error::Refused(format!(
            "{} is there already: name another file, or write over it with --force",
            path.display()
        )),
        _ => Error::io(
            format!(
                "cannot open {} for a recording; give a file in a folder that exists and that you may write to",
                path.display()
            ),
            e,
        ),
    })?;
    Ok(BufWriter::with_capacity(BUFFER_BYTES, file))
}

/// Writes a recording as MCAP.
pub struct McapSink<W: Write + Seek> {
    writer: Writer<W>,
    /// What messages call the file.
    name: String,
    channels: BTreeMap<&'static str, (u16, u32)>,
    speaker: Speaker,
    since_1970_ns: u64,
    boot_id: u64,
    /// Ticks of which nothing is there for people: the disk did not follow.
    not_shown: u64,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> std::fmt::Debug for McapSink<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("McapSink")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl<W: Write + Seek> McapSink<W> {
    /// A recording that begins with `start`.
    ///
    /// * `name` - what messages call the file.
    /// * `frame_id` - the scene's frame.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be written.
    pub fn new(to: W, name: &str, frame_id: &str, start: &Start) -> Result<Self> {
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
        for (topic, kind) in TOPICS {
            let schema = writer.add_schema(kind, "ros2msg", schema(kind).as_bytes());
            let channel =
                schema.and_then(|id| writer.add_channel(id, topic, "cdr", &BTreeMap::new()));
            channels.insert(*topic, (channel.map_err(failed)?, 0));
        }
        let facts = &start.facts;
        let mut sink = Self {
            writer,
            name: name.to_owned(),
            channels,
            speaker: Speaker {
                frame_id: frame_id.to_owned(),
                book: Book::default(),
            },
            since_1970_ns: facts.since_1970_ns,
            boot_id: facts.boot_id,
            not_shown: 0,
            bytes: Vec::new(),
        };
        let time_ns = facts.started_ns.saturating_add(facts.since_1970_ns);
        sink.write_bytes(START, time_ns, |to| {
            to.extend_from_slice(&start_bytes(start))
        })?;
        sink.writer.flush().map_err(failed)?;
        Ok(sink)
    }

    /// Writes a message of ours: CDR of `uint8[] data`.
    fn write_bytes(
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
    fn write_message<M: Serialize>(
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

    /// What people look at.
    fn show(&mut self, record: &TickRecord, time_ns: u64) -> Result<()> {
        let (out, demand) = (&record.out, record.ask.demand);
        if out.names_changed {
            self.speaker.book = self.speaker.book.next(&out.names);
            let (stamp, revision) = (Time::from_ns(time_ns), out.tick.header.scene_rev);
            for names in self.speaker.names(stamp, self.boot_id, revision) {
                self.write_message("/sweepd/names", time_ns, &names)?;
            }
        }
        if demand.bodies {
            let bodies = self.speaker.bodies(&out.tick, &out.bodies);
            self.write_message("/sweepd/bodies", time_ns, &bodies)?;
        }
        if demand.contacts {
            for contacts in self.speaker.contacts(&out.contacts_header, &out.contacts) {
                self.write_message("/sweepd/contacts", time_ns, &contacts)?;
            }
        }
        if demand.pairs {
            for pairs in self.speaker.pairs(&out.pairs_header, &out.pairs) {
                self.write_message("/sweepd/pairs", time_ns, &pairs)?;
            }
        }
        let state = self.speaker.state(&out.tick);
        self.write_message("/sweepd/state", time_ns, &state)?;
        let tick = self.speaker.tick(&out.tick, Counts::default());
        self.write_message("/sweepd/tick", time_ns, &tick)
    }
}

impl<W: Write + Seek + Send> Sink for McapSink<W> {
    fn tick(&mut self, record: &TickRecord, hurried: bool) -> Result<()> {
        let time_ns = record.out.tick.sent_ns.saturating_add(self.since_1970_ns);
        self.write_bytes(INPUT, time_ns, |to| put_input(record, to))?;
        self.write_bytes(OUTPUT, time_ns, |to| {
            put_output(&record.out, record.ask.demand, to);
        })?;
        // Names belong to what follows.
        if hurried && !record.out.names_changed {
            self.not_shown += 1;
            return Ok(());
        }
        self.show(record, time_ns)
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.flush().map_err(|e| failed(&self.name, e))
    }

    fn end(&mut self, why: &str) -> Result<()> {
        let note = Metadata {
            name: END.to_owned(),
            metadata: BTreeMap::from([
                (WHY.to_owned(), why.to_owned()),
                (NOT_SHOWN.to_owned(), self.not_shown.to_string()),
            ]),
        };
        let done = self.writer.write_metadata(&note);
        done.and_then(|()| self.writer.finish().map(drop))
            .map_err(|e| failed(&self.name, e))
    }
}

fn failed(name: &str, error: McapError) -> Error {
    Error::io(
        format!("cannot write the recording {name}; is the disk full?"),
        error,
    )
}
