//! Reads a recording once, from its start. A file that ends in the middle, as a killed daemon leaves it, is read up to
//! there.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{END, INPUT, OUTPUT, START, TICKS, WHY};
use crate::error::{Error, Result};
use crate::record::bytes::Damaged;
use crate::record::code::{start_of, take_input, take_output};
use crate::record::{Start, TickRecord};

/// Most bytes of one read, whatever length a record claims: memory grows only with the data that exists.
const READ_BYTES_MAX: usize = 1 << 20;
/// Longest possible record, bytes: the length of a message has 32 bits, and a chunk ends with the message that fills
/// it. A longer claim means damage.
const RECORD_BYTES_MAX: usize = (1 << 32) + (1 << 22);
/// First bytes of an MCAP file, and last bytes of a closed one.
const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// How a recording ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// As intended.
    Whole,
    /// Early, with the reason.
    Early(String),
    /// In the middle: the recorder was killed, or the file was cut off.
    Cut,
    /// In damaged data, with the error.
    Damaged(String),
}

impl Display for Ending {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole => f.write_str("whole"),
            Self::Early(why) => write!(f, "the recording ended early: {why}"),
            Self::Cut => f.write_str("the file is cut off: what was written last is missing"),
            Self::Damaged(how) => write!(f, "the file is damaged: {how}; what follows is not read"),
        }
    }
}

/// The next part of a recording.
#[derive(Debug)]
pub enum Read<'a> {
    /// A tick.
    Tick(&'a mut TickRecord),
    /// The end.
    End(Ending),
}

/// Reads a recording.
pub struct Reader {
    file: File,
    name: String,
    mcap: LinearReader,
    read_bytes: u64,
    bytes: u64,
    topics: BTreeMap<u16, String>,
    start: Option<Start>,
    record: TickRecord,
    /// The tick whose input was read, and whose output comes next.
    open: Option<u64>,
    /// Number of ticks read; a recording has all ticks from the first on.
    ticks: u64,
    /// Whether the file was closed: then no record may extend beyond its end.
    is_closed: bool,
    /// The program that wrote it.
    library: String,
    note: Option<Note>,
    /// How its chunks are compressed, which ours are not.
    compressed: Option<String>,
}

/// Content of the last record.
struct Note {
    why: String,
    ticks: Option<u64>,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Kind of a record.
enum Step {
    Start,
    Tick,
    Other,
}

impl Reader {
    /// Opens a recording; returns it with its start.
    ///
    /// # Errors
    /// `Error::Usage` if it cannot be opened, or is no recording of ours; `Error::Refused` if it is of another version,
    /// or its start is damaged; `Error::Io` if it cannot be read.
    pub fn open(path: &Path) -> Result<(Self, Start)> {
        let name = path.display().to_string();
        let unreadable = |e| Error::io(format!("cannot read the recording {name}"), e);
        let is_none = |why: &dyn Display| {
            let mend = "give a file that `sweepd run SCENE --record FILE` wrote";
            Error::Usage(format!("{name}: {why}; {mend}"))
        };
        let mut file = File::open(path).map_err(|e| is_none(&e))?;
        let about = file.metadata().map_err(unreadable)?;
        let bytes = about.len();
        if about.is_dir() {
            return Err(is_none(&"this is a folder"));
        }
        if bytes == 0 && about.is_file() {
            return Err(Error::Usage(format!(
                "{name} is empty: nothing was recorded, or the disk was full; record anew"
            )));
        }
        let is_closed = is_closed(&mut file, bytes).map_err(unreadable)?;
        let mut reader = Self {
            file,
            mcap: LinearReader::new_with_options(
                LinearReaderOptions::default()
                    .with_prevalidate_chunk_crcs(true)
                    .with_validate_data_section_crc(true)
                    .with_validate_summary_section_crc(true)
                    .with_record_length_limit(RECORD_BYTES_MAX),
            ),
            read_bytes: 0,
            bytes,
            topics: BTreeMap::new(),
            start: None,
            record: TickRecord::default(),
            open: None,
            ticks: 0,
            is_closed,
            library: String::new(),
            note: None,
            compressed: None,
            name,
        };
        while reader.start.is_none() {
            match reader.step()? {
                Ok(Step::Start | Step::Other) => {}
                Ok(Step::Tick) => {
                    let ending = Ending::Damaged("it is missing".to_owned());
                    return Err(reader.no_start(&ending));
                }
                Err(ending) => return Err(reader.no_start(&ending)),
            }
        }
        let start = reader.start.take().unwrap_or_default();
        Ok((reader, start))
    }

    /// Number of bytes read, and length of the file, bytes.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        (self.read_bytes, self.bytes)
    }

    /// Reads the next tick.
    ///
    /// # Errors
    /// `Error::Io` if the file cannot be read.
    pub fn next_tick(&mut self) -> Result<Read<'_>> {
        loop {
            match self.step()? {
                Ok(Step::Tick) => return Ok(Read::Tick(&mut self.record)),
                Ok(_) => {}
                Err(ending) => return Ok(Read::End(ending)),
            }
        }
    }

    /// Reads one record; the inner error is the end of the recording.
    fn step(&mut self) -> Result<std::result::Result<Step, Ending>> {
        loop {
            let event = match self.mcap.next_event() {
                Some(Ok(event)) => event,
                None => return Ok(Err(self.ending())),
                Some(Err(McapError::UnexpectedEof)) if self.is_closed => {
                    let text = "a record ends beyond the end of the file";
                    return Ok(Err(Ending::Damaged(text.to_owned())));
                }
                Some(Err(McapError::UnexpectedEof)) => return Ok(Err(Ending::Cut)),
                Some(Err(McapError::UnsupportedCompression(kind))) => {
                    let text = format!("its chunks are compressed ({kind})");
                    self.compressed = Some(kind);
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
            Record::Header(header) => self.library = header.library,
            Record::Metadata(mut note) if note.name == END => {
                let ticks = note.metadata.get(TICKS);
                self.note = Some(Note {
                    ticks: ticks.and_then(|ticks| ticks.parse().ok()),
                    why: note.metadata.remove(WHY).unwrap_or_default(),
                });
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
                        self.next_is_there()
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

    /// Checks that the tick read follows the one before it.
    fn next_is_there(&mut self) -> std::result::Result<Step, Ending> {
        let (tick, next) = (self.record.out.tick.header.tick, self.ticks + 1);
        if tick != next {
            let how = format!("after tick {} comes tick {tick}", self.ticks);
            return Err(Ending::Damaged(how));
        }
        self.ticks = tick;
        Ok(Step::Tick)
    }

    /// The ending of a file that was closed.
    fn ending(&mut self) -> Ending {
        let Some(note) = self.note.take() else {
            if !self.has_start() {
                return Ending::Whole;
            }
            return Ending::Damaged("its last record is missing".to_owned());
        };
        if let Some(ticks) = note.ticks.filter(|ticks| *ticks != self.ticks) {
            let how = format!("{} of its {ticks} ticks are there", self.ticks);
            return Ending::Damaged(how);
        }
        if note.why.is_empty() {
            Ending::Whole
        } else {
            Ending::Early(note.why)
        }
    }

    /// Whether the file is a recording of ours: it has a topic for the start.
    fn has_start(&self) -> bool {
        self.topics.values().any(|topic| topic == START)
    }

    /// The refusal of a file that ends before its start was read.
    fn no_start(&self, ending: &Ending) -> Error {
        let ours = self.library.starts_with("sweepd/");
        let ours = ours && (self.topics.is_empty() || self.has_start());
        if let Some(kind) = &self.compressed {
            return Error::Usage(format!(
                "{0}: its chunks are compressed ({kind}): decompress it with `mcap decompress {0} -o FILE.mcap`",
                self.name
            ));
        }
        match ending {
            Ending::Damaged(how) if !ours => self.no_mcap(how),
            Ending::Damaged(how) => Error::Usage(format!(
                "the start of {} cannot be read ({how}), so that nothing of it can be replayed: record anew",
                self.name
            )),
            Ending::Cut if ours => Error::Usage(format!(
                "{} is cut off within its start, so that nothing of it can be replayed: record anew",
                self.name
            )),
            _ => self.not_ours(),
        }
    }

    fn no_mcap(&self, how: &str) -> Error {
        Error::Usage(format!(
            "{} is no MCAP file ({how}): give one that `sweepd run SCENE --record FILE` wrote",
            self.name
        ))
    }

    fn not_ours(&self) -> Error {
        Error::Usage(format!(
            "{} holds nothing that an engine was given (what `sweepd record` writes does not), so that there is nothing \
             to replay: give a file that `sweepd run SCENE --record FILE` wrote",
            self.name
        ))
    }
}

/// Whether a file ends as a closed one does. The file is rewound.
fn is_closed(file: &mut File, bytes: u64) -> std::io::Result<bool> {
    let mut tail = [0; MAGIC.len()];
    // The mark at the start of the file must not count as the one at its end.
    if bytes < 2 * tail.len() as u64 {
        return Ok(false);
    }
    file.seek(SeekFrom::Start(bytes - tail.len() as u64))?;
    file.read_exact(&mut tail)?;
    file.rewind()?;
    Ok(tail == *MAGIC)
}

/// The payload of `uint8[] data` in CDR; `None`: it is truncated.
fn payload(message: &[u8]) -> Option<&[u8]> {
    let (head, data) = message.split_at_checked(8)?;
    let len = u32::from_le_bytes(head.get(4..8)?.try_into().ok()?);
    data.get(..usize::try_from(len).ok()?)
}
