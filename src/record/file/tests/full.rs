//! Recordings on disks that become full.

use std::io::{ErrorKind, Seek, SeekFrom, Write};

use super::*;

/// A disk with `left` free bytes; when space is freed on it, other programs take `lost` bytes.
struct Disk {
    file: File,
    left: usize,
    lost: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.left == 0 && !bytes.is_empty() {
            return Err(ErrorKind::StorageFull.into());
        }
        let taken = self.file.write(&bytes[..bytes.len().min(self.left)])?;
        self.left -= taken;
        Ok(taken)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

impl Medium for Disk {
    fn cut(mut self, bytes: u64) -> std::io::Result<Self> {
        let freed = usize::try_from(self.file.metadata()?.len() - bytes).unwrap();
        self.left = (self.left + freed).saturating_sub(self.lost);
        self.file = self.file.cut(bytes)?;
        Ok(self)
    }
}

/// A recording of 50 ticks on such a disk, and the number of ticks that its writer reports.
fn on_disk(left: usize, lost: usize) -> (Scrap, Option<u64>) {
    let scrap = Scrap::new();
    let file = File::create_new(&scrap.0).unwrap();
    let disk = Disk { file, left, lost };
    let Ok(mut sink) = McapSink::new(disk, "scrap", "world", &start()) else {
        return (scrap, None);
    };
    let mut failed = None;
    for tick in 1..=50 {
        let done = sink.tick(&record(tick), false);
        let flush = done.is_ok() && tick % 10 == 0;
        let done = done.and_then(|()| if flush { sink.flush() } else { Ok(()) });
        if let Err(error) = done {
            failed = Some(error.to_string());
            break;
        }
    }
    let ended = sink.end("");
    let text = failed.or(ended.err().map(|e| e.to_string()));
    assert!(
        text.is_none_or(|text| text.contains("is the disk full?")),
        "{left}"
    );
    let ticks = sink.ticks();
    (scrap, Some(ticks))
}

#[test]
fn bug_a_full_disk_left_a_file_without_its_last_record_and_ticks_were_counted_that_it_has_not() {
    let whole = std::fs::metadata(&written(50, Some("")).0).unwrap().len();
    let whole = usize::try_from(whole).unwrap();
    let mut seen = Vec::new();
    for part in 1..100 {
        let (scrap, told) = on_disk(whole * part / 100, 0);
        if told.is_some() && Reader::open(&scrap.0).is_ok() {
            let (ticks, ending) = read(&scrap);
            assert!(
                matches!(&ending, Ending::Early(why) if why.contains("is the disk full?")),
                "{part}: {ending:?}"
            );
            assert_eq!(told, Some(ticks), "{part}");
            seen.push(ticks);
        }
    }
    seen.dedup();
    assert_eq!(seen, [0, 10, 20, 30, 40, 50]);
    // There is no room for the last record either: the file is cut off, as by a kill.
    let (scrap, told) = on_disk(whole / 2, 1 << 20);
    assert_eq!(read(&scrap), (told.unwrap(), Ending::Cut));
}

#[test]
fn a_message_that_fills_its_chunk_is_in_it() {
    let scrap = Scrap::new();
    let disk = Disk {
        file: File::create_new(&scrap.0).unwrap(),
        left: 5_000_000,
        lost: 0,
    };
    let mut sink = McapSink::new(disk, "scrap", "world", &start()).unwrap();
    let mut large = record(0);
    large.out.pairs = vec![PairRow::default(); 2_500];
    let mut tick = 0;
    loop {
        tick += 1;
        large.out.tick.header.tick = tick;
        if sink.tick(&large, true).is_err() {
            break;
        }
    }
    let told = sink.ticks();
    let (mut reader, _) = Reader::open(&scrap.0).unwrap();
    let mut ticks = 0;
    let ending = loop {
        match reader.next_tick().unwrap() {
            Read::Tick(_) => ticks += 1,
            Read::End(ending) => break ending,
        }
    };
    assert!(matches!(ending, Ending::Early(_)), "{ending:?}");
    assert!(told > 3 && told < tick, "{told} of {tick}");
    assert_eq!(ticks, told);
}
