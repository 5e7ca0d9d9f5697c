//! A recording is read, from the front and once: a file that ends in the middle, as a killed daemon leaves it, is read
//! as far as it goes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{END, INPUT, OUTPUT, START, WHY};
use crate::error::{Error, Result};
use crate::record::bytes::Damaged;
use crate::record::code::{start_of, take_input, take_output};
use crate::record::{Start, TickRecord};

/// Most that is read at once, bytes, whatever length a record claims: memory grows only with what is there.
const READ_BYTES_MAX: usize = 1 << 20;

/// How a recording ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// As it was meant to.
    Whole,
    /// Early, and it says why.
    Early(String),
    /// In the middle: the recorder was killed, or the file was cut off.
    Cut,
    /// What follows is damaged, and how.
    Damaged(String),
}

impl std::fmt::Display for Ending {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole => f.write_str("whole"),
            Self::Early(why) => write!(f, "the recording ended early: {why}"),
            Self::Cut => f.write_str("the file is cut off: what was written last is missing"),
            Self::Damaged(how) => write!(f, "the file is damaged: {how}; what follows is not read"),
        }
    }
}

/// What comes next in a recording.
#[derive(Debug)]
pub enum Read<'a> {
    /// A tick.
    Tick(&'a mut TickRecord),
    /// Nothing.
    End(Ending),
}

/// A recording that is read.
pub struct Reader {
    file: File,
    name: String,
    mcap: LinearReader,
    read_bytes: u64,
    bytes: u64,
    topics: BTreeMap<u16, String>,
    start: Option<Start>,
    record: TickRecord,
    /// The tick whose input was read, and whose output is next.
    open: Option<u64>,
    why: Option<String>,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// What a record of the file was.
enum Step {
    Start,
    Tick,
    Other,
}

impl Reader {
    /// Opens a recording; returns it with its start.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be read, `Error::Refused` when it is no MCAP file, none of ours, or of another
    /// version.
    pub fn open(path: &Path) -> Result<(Self, Start)> {
        let name = path.display().to_string();
        let unreadable = |e| Error::io(format!("cannot read the recording {name}"), e);
        let file = File::open(path).map_err(unreadable)?;
        let bytes = file.metadata().map_err(unreadable)?.len();
        let mut reader = Self {
            file,
            mcap: LinearReader::new_with_options(
                LinearReaderOptions::default().with_prevalidate_chunk_crcs(true),
            ),
            read_bytes: 0,
            bytes,
            topics: BTreeMap::new(),
            start: None,
            record: TickRecord::default(),
            open: None,
            why: None,
            name,
        };
        while reader.start.is_none() {
            match reader.step()? {
                Ok(Step::Start | Step::Other) => {}
                Ok(Step::Tick) => return Err(reader.not_ours()),
                Err(Ending::Damaged(how)) => return Err(reader.no_mcap(&how)),
                Err(_) => return Err(reader.not_ours()),
            }
        }
        let start = reader.start.take().unwrap_or_default();
        Ok((reader, start))
    }

    /// How much of the file was read, and how long it is, bytes.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        (self.read_bytes, self.bytes)
    }

    /// The next tick.
    ///
    /// # Errors
    /// `Error::Io` when the file cannot be read.
    pub fn next_tick(&mut self) -> Result<Read<'_>> {
        loop {
            match self.step()? {
                Ok(Step::Tick) => return Ok(Read::Tick(&mut self.record)),
                Ok(_) => {}
                Err(ending) => return Ok(Read::End(ending)),
            }
        }
    }

    /// One record of the file; an error of the inner kind is its end.
    fn step(&mut self) -> Result<std::result::Result<Step, Ending>> {
        loop {
            let event = match self.mcap.next_event() {
                Some(Ok(event)) => event,
                None => return Ok(Err(self.ending())),
                Some(Err(McapError::UnexpectedEof)) => return Ok(Err(Ending::Cut)),
                Some(Err(McapError::UnsupportedCompression(kind))) => {
                    let text = format!("its chunks are compressed ({kind}): decompress it first");
                    return Ok(Err(Ending::Damaged(text)));
                }
                Some(Err(error)) => return Ok(Err(Ending::Damaged(error.to_string()))),
            };
            match event {
                LinearReadEvent::ReadRequest(wanted) => {
                    let into = self.mcap.insert(wanted.min(READ_BYTES_MAX));
                    let read = self.file.read(into).map_err(|e| {
                        Error::io(format!("cannot read the recording {}", self.name), e)
                    })?;
                    self.mcap.notify_read(read);
                    self.read_bytes += read as u64;
                }
                LinearReadEvent::Record { data, opcode } => {
                    let record = match mcap::parse_record(opcode, data) {
                        Ok(record) => record.into_owned(),
                        Err(error) => return Ok(Err(Ending::Damaged(error.to_string()))),
                    };
                    return self.take(record);
                }
            }
        }
    }

    fn take(&mut self, record: Record<'static>) -> Result<std::result::Result<Step, Ending>> {
        match record {
            Record::Channel(channel) => {
                self.topics.insert(channel.id, channel.topic);
            }
            Record::Metadata(note) if note.name == END => {
                self.why = note
                    .metadata
                    .get(WHY)
                    .filter(|why| !why.is_empty())
                    .cloned();
            }
            Record::Message { header, data } => {
                let topic = self.topics.get(&header.channel_id).map(String::as_str);
                let is_ours = matches!(topic, Some(START | INPUT | OUTPUT));
                let Some(topic) = topic.filter(|_| is_ours) else {
                    return Ok(Ok(Step::Other));
                };
                let data = payload(&data);
                if topic == START {
                    self.start = Some(start_of(data.unwrap_or_default())?);
                    return Ok(Ok(Step::Start));
                }
                let taken = match data {
                    Some(data) if topic == INPUT => take_input(data, &mut self.record).map(Some),
                    Some(data) => take_output(data, &mut self.record.out).map(|()| None),
                    None => Err(Damaged),
                };
                return Ok(match taken {
                    Ok(Some(tick)) => {
                        self.open = Some(tick);
                        Ok(Step::Other)
                    }
                    Ok(None) if self.open.take() == Some(self.record.out.tick.header.tick) => {
                        Ok(Step::Tick)
                    }
                    _ => Err(Ending::Damaged(format!(
                        "message {} of {topic} is not what it should be",
                        header.sequence
                    ))),
                });
            }
            _ => {}
        }
        Ok(Ok(Step::Other))
    }

    fn ending(&mut self) -> Ending {
        self.why.take().map_or(Ending::Whole, Ending::Early)
    }

    fn no_mcap(&self, how: &str) -> Error {
        Error::Refused(format!(
            "{} is no MCAP file ({how}): give one that `sweepd run SCENE --record FILE` wrote",
            self.name
        ))
    }

    fn not_ours(&self) -> Error {
        Error::Refused(format!(
            "{} holds nothing that an engine was given (what `sweepd record` writes does not), so that there is nothing \
             to replay: give a file that `sweepd run SCENE --record FILE` wrote",
            self.name
        ))
    }
}

/// The bytes of `uint8[] data` in CDR.
fn payload(message: &[u8]) -> Option<&[u8]> {
    let (head, data) = message.split_at_checked(8)?;
    let len = u32::from_le_bytes(head.get(4..8)?.try_into().ok()?);
    data.get(..usize::try_from(len).ok()?)
}
