//! Files that are whole, cut off, damaged, or of other programs.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::error::Error;
use crate::record::{Facts, LAYOUT, Sink as _, Start, TickRecord};
use crate::wire::{Demand, PairRow, WIRE_VERSION};

mod full;

static NUMBERS: AtomicU64 = AtomicU64::new(0);

/// A file that is removed when this is dropped.
struct Scrap(PathBuf);

impl Scrap {
    fn new() -> Self {
        let number = NUMBERS.fetch_add(1, Ordering::Relaxed);
        let name = format!("sweepd_scrap_{}_{number}.mcap", std::process::id());
        Self(std::env::temp_dir().join(name))
    }

    fn of(bytes: &[u8]) -> Self {
        let scrap = Self::new();
        std::fs::write(&scrap.0, bytes).unwrap();
        scrap
    }

    fn create(&self) -> BufWriter<File> {
        buffered(File::create_new(&self.0).unwrap())
    }
}

impl Drop for Scrap {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn start() -> Start {
    Start {
        facts: Facts {
            layout: LAYOUT,
            wire_version: WIRE_VERSION,
            ..Facts::default()
        },
        ..Start::default()
    }
}

fn record(tick: u64) -> TickRecord {
    let mut record = TickRecord::default();
    record.ask.demand = Demand::ALL;
    record.out.tick.header.tick = tick;
    record.out.pairs = vec![PairRow::default(); 100];
    record
}

/// A recording of `ticks` ticks, with one chunk per ten ticks.
fn written(ticks: u64, why: Option<&str>) -> Scrap {
    let scrap = Scrap::new();
    let file = scrap.create();
    let mut sink = McapSink::new(file, "scrap", "world", &start()).unwrap();
    for tick in 1..=ticks {
        sink.tick(&record(tick), false).unwrap();
        if tick % 10 == 0 {
            sink.flush().unwrap();
        }
    }
    if let Some(why) = why {
        sink.end(why).unwrap();
    }
    scrap
}

/// Number of ticks that are read, and the ending.
fn read(scrap: &Scrap) -> (u64, Ending) {
    let (mut reader, _) = Reader::open(&scrap.0).unwrap();
    let mut ticks = 0;
    loop {
        match reader.next_tick().unwrap() {
            Read::Tick(record) => {
                ticks += 1;
                assert_eq!(record.out.tick.header.tick, ticks);
                assert_eq!(record.out.pairs.len(), 100);
            }
            Read::End(ending) => return (ticks, ending),
        }
    }
}

#[test]
fn what_was_written_is_read_and_how_it_ended() {
    assert_eq!(read(&written(25, Some(""))), (25, Ending::Whole));
    assert_eq!(read(&written(0, Some(""))), (0, Ending::Whole));
    let full = "the disk did not follow";
    let early = Ending::Early(full.to_owned());
    assert_eq!(read(&written(7, Some(full))), (7, early));
}

#[test]
fn a_file_that_is_cut_off_is_read_as_far_as_its_chunks_are_whole() {
    let whole = std::fs::read(&written(50, Some("")).0).unwrap();
    let mut most = 0;
    for part in 1..40 {
        let len = whole.len() * part / 40;
        let scrap = Scrap::of(&whole[..len]);
        if let Ok((_, first)) = Reader::open(&scrap.0) {
            assert_eq!(first, start());
            let (ticks, ending) = read(&scrap);
            assert_eq!(ending, Ending::Cut);
            assert!(ticks % 10 == 0 && ticks >= most, "{ticks} after {most}");
            most = ticks;
        }
    }
    assert!(most >= 40, "{most}");
}

#[test]
fn a_missing_tick_ends_the_reading_before_it() {
    let scrap = Scrap::new();
    let file = scrap.create();
    let mut sink = McapSink::new(file, "scrap", "world", &start()).unwrap();
    for tick in (1..=5).chain(7..=10) {
        sink.tick(&record(tick), false).unwrap();
    }
    sink.end("").unwrap();
    let how = Ending::Damaged("after tick 5 comes tick 7".to_owned());
    assert_eq!(read(&scrap), (5, how));
}

#[test]
fn a_changed_byte_ends_the_reading_at_its_chunk() {
    let mut bytes = std::fs::read(&written(50, Some("")).0).unwrap();
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    let (ticks, ending) = read(&Scrap::of(&bytes));
    assert!(matches!(ending, Ending::Damaged(_)), "{ending:?}");
    assert!(ticks % 10 == 0 && (10..40).contains(&ticks), "{ticks}");
}

/// Opcode and offset of each record of a file.
fn places(bytes: &[u8]) -> Vec<(u8, usize)> {
    let (mut at, mut all) = (8, Vec::new());
    while at + 8 < bytes.len() {
        all.push((bytes[at], at));
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        at += 9 + usize::try_from(len).unwrap();
    }
    all
}

/// Result of reading a recording of 50 ticks with one byte changed.
fn changed(at: usize, to: u8) -> Result<(u64, Ending), Error> {
    let mut bytes = std::fs::read(&written(50, Some("")).0).unwrap();
    assert_ne!(bytes[at], to);
    bytes[at] = to;
    let scrap = Scrap::of(&bytes);
    Reader::open(&scrap.0)?;
    Ok(read(&scrap))
}

#[test]
fn bug_a_record_that_is_not_known_any_more_or_claims_to_be_longer_is_damage() {
    const CHUNK: u8 = 6;
    const METADATA: u8 = 12;
    let whole = std::fs::read(&written(50, Some("")).0).unwrap();
    let places = places(&whole);
    let chunks: Vec<usize> = places
        .iter()
        .filter(|place| place.0 == CHUNK)
        .map(|place| place.1)
        .collect();
    assert!(chunks.len() > 5, "{places:?}");
    for (nth, at) in (0..).zip(&chunks) {
        for (at, to) in [(*at, 0xf0), (at + 4, 1), (at + 8, 0x7f)] {
            match changed(at, to) {
                Err(error) => {
                    assert!(
                        nth == 0 && error.to_string().contains("the start of"),
                        "{error}"
                    );
                }
                Ok((ticks, ending)) => {
                    assert!(matches!(ending, Ending::Damaged(_)), "{nth}: {ending:?}");
                    assert!(ticks % 10 == 0, "{ticks}");
                }
            }
        }
    }
    let note = places.iter().find(|place| place.0 == METADATA).unwrap();
    let (ticks, ending) = changed(note.1, 0xf0).unwrap();
    assert!(matches!(ending, Ending::Damaged(_)), "{ending:?}");
    assert_eq!(ticks, 50);
}

#[test]
fn bug_a_changed_bit_outside_of_the_chunks_was_not_noticed() {
    let whole = std::fs::read(&written(20, Some("")).0).unwrap();
    let mut unnoticed = Vec::new();
    for at in (0..whole.len())
        .step_by(whole.len() / 400)
        .chain(whole.len() - 700..whole.len())
    {
        let mut bytes = whole.clone();
        bytes[at] ^= 4;
        let scrap = Scrap::of(&bytes);
        if Reader::open(&scrap.0).is_ok() && read(&scrap).1 == Ending::Whole {
            unnoticed.push(at);
        }
    }
    assert_eq!(unnoticed, Vec::<usize>::new(), "of {}", whole.len());
}

#[test]
fn bug_a_recording_that_is_cut_off_within_its_start_says_so() {
    let whole = std::fs::read(&written(1, Some("")).0).unwrap();
    let first = places(&whole).iter().find(|place| place.0 == 6).unwrap().1;
    for len in [first, first + 5, first + 40, first + 300] {
        let error = Reader::open(&Scrap::of(&whole[..len]).0).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("cut off within its start"), "{len}: {text}");
    }
}

#[test]
fn what_is_no_recording_of_ours_is_refused_by_name() {
    let error = |scrap: &Scrap| Reader::open(&scrap.0).unwrap_err().to_string();
    let text = error(&Scrap::of(b""));
    assert!(text.contains("is empty: "), "{text}");
    for bytes in [&b"[[body]]\nname = \"a\"\n"[..], &[0; 4096]] {
        let error = error(&Scrap::of(bytes));
        assert!(
            error.contains("is no MCAP file") || error.contains("nothing to replay"),
            "{error}"
        );
    }
    let text = error(&Scrap::of(b"[[body]]\nname = \"some text\"\n"));
    assert!(text.contains("is no MCAP file"), "{text}");
    // An MCAP file of another program.
    let scrap = Scrap::new();
    let mut writer = mcap::Writer::new(scrap.create()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let text = error(&scrap);
    assert!(text.contains("run SCENE --record FILE"), "{text}");
    assert!(Reader::open(&PathBuf::from("/nowhere/x.mcap")).is_err());
}

#[test]
fn in_a_hurry_what_is_for_people_is_left_out_and_counted_and_all_that_is_replayed_is_there() {
    let scrap = Scrap::new();
    let file = scrap.create();
    let mut sink = McapSink::new(file, "scrap", "world", &start()).unwrap();
    for tick in 1..=30 {
        let mut record = record(tick);
        // Later messages need names, which are never left out.
        record.out.names_changed = tick == 9;
        sink.tick(&record, tick % 3 == 0).unwrap();
    }
    sink.end("").unwrap();
    drop(sink);
    assert_eq!(read(&scrap), (30, Ending::Whole));
    let bytes = std::fs::read(&scrap.0).unwrap();
    let of = |topic: &str| {
        let messages = mcap::MessageStream::new(&bytes).unwrap();
        let ours = messages.filter(|message| message.as_ref().unwrap().channel.topic == topic);
        ours.count()
    };
    assert_eq!((of(INPUT), of(OUTPUT)), (30, 30));
    assert_eq!(
        (
            of("/sweepd/pairs"),
            of("/sweepd/state"),
            of("/sweepd/names")
        ),
        (21, 21, 1)
    );
    let mut records = mcap::read::LinearReader::new(&bytes).unwrap();
    let left_out = records.find_map(|record| match record.unwrap() {
        mcap::records::Record::Metadata(note) => note.metadata.get(NOT_SHOWN).cloned(),
        _ => None,
    });
    assert_eq!(left_out.as_deref(), Some("9"));
}

#[test]
fn bug_a_recording_that_somebody_compressed_was_called_no_recording() {
    let text = |text: &str| {
        let len = u32::try_from(text.len()).unwrap().to_le_bytes();
        [&len, text.as_bytes()].concat()
    };
    let of_record = |opcode: u8, body: &[u8]| {
        let len = (body.len() as u64).to_le_bytes();
        [&[opcode], &len[..], body].concat()
    };
    for library in ["sweepd/0", "mcap-cli"] {
        let header = of_record(1, &[text("ros2"), text(library)].concat());
        let times_size_and_crc = [0_u8; 28];
        let records = [&4_u64.to_le_bytes()[..], &[0x28, 0xb5, 0x2f, 0xfd]].concat();
        let chunk = [&times_size_and_crc[..], &text("zstd"), &records].concat();
        let bytes = [mcap::MAGIC, &header, &of_record(6, &chunk)].concat();
        let scrap = Scrap::of(&bytes);
        let error = Reader::open(&scrap.0).map(|_| ()).unwrap_err();
        let told = error.to_string();
        assert!(told.contains("compressed (zstd)"), "{told}");
        assert!(told.contains("`mcap decompress "), "{told}");
        assert!(
            !told.contains("anew") && !told.contains("no MCAP"),
            "{told}"
        );
    }
}
