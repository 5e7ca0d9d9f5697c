//! `sweepd replay FILE`: runs the engine again on a recording, and reports the first tick that differs.

use std::sync::atomic::{AtomicBool, Ordering};

use super::args::ReplayArgs;
use super::out::Out;
use super::progress::Progress;
use crate::error::{Error, Result, counted};
use crate::record::file::{Ending, Read, Reader};
use crate::record::{Difference, Facts, Replay, TIMES, Tally};

/// Result of a replay.
struct Found {
    facts: Facts,
    /// Number of ticks run, whether compared or not.
    ticks: u64,
    tally: Tally,
    difference: Option<Difference>,
    /// How the file ended; `None`: it was not read to its end.
    ending: Option<Ending>,
}

/// Replays a recording; `false` if it differs, nothing was compared, or the file is damaged or ended early.
pub(super) fn replay(args: &ReplayArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    let (from, until) = (args.from.unwrap_or(0), args.until.unwrap_or(u64::MAX));
    if from > until {
        return Err(Error::Usage(format!(
            "--from {from} --until {until}: no tick lies between them; the first tick must not come after the last"
        )));
    }
    let found = run(args, stop)?;
    if args.json {
        out.line(&json(&found).to_string())?;
    } else {
        tell(&found, out)?;
    }
    out.flush()?;
    let is_part = matches!(found.ending, Some(Ending::Damaged(_) | Ending::Early(_)));
    Ok(found.difference.is_none() && found.compared() > 0 && !is_part)
}

impl Found {
    /// Number of ticks compared, bit by bit or by the law.
    fn compared(&self) -> u64 {
        self.tally.exact + self.tally.lawful
    }
}

fn run(args: &ReplayArgs, stop: &AtomicBool) -> Result<Found> {
    let (mut reader, start) = Reader::open(&args.file)?;
    let facts = start.facts.clone();
    if facts.sweepd_version != env!("CARGO_PKG_VERSION") {
        tracing::warn!(
            "recorded by sweepd {}, replayed by {}: a difference may come from a change between these versions",
            facts.sweepd_version,
            env!("CARGO_PKG_VERSION")
        );
    }
    let mut replay = Replay::new(&start)?;
    drop(start);
    let mut progress = Progress::new();
    let (from, until) = (args.from.unwrap_or(0), args.until.unwrap_or(u64::MAX));
    let (mut ticks, mut difference, mut ending) = (0, None, None);
    while difference.is_none() && ticks < until {
        if stop.load(Ordering::Relaxed) {
            let text = "stopped by a signal before the replay was done; there is no result";
            return Err(Error::Refused(text.to_owned()));
        }
        let (done, all) = reader.progress();
        progress.tell(done, all, &format!("bytes, tick {ticks}"));
        match reader.next_tick()? {
            Read::End(how) => {
                ending = Some(how);
                break;
            }
            Read::Tick(record) => {
                ticks = record.out.tick.header.tick;
                difference = replay.tick(record, ticks >= from)?;
            }
        }
    }
    Ok(Found {
        facts,
        ticks,
        tally: replay.tally(),
        difference,
        ending,
    })
}

fn tell(found: &Found, out: &mut Out) -> Result<()> {
    let (facts, tally) = (&found.facts, &found.tally);
    out.line(&format!(
        "{}, recorded by sweepd {}: {} replayed",
        facts.scene_file,
        facts.sweepd_version,
        counted(found.ticks, "tick", "ticks")
    ))?;
    if tally.exact > 0 || tally.lawful == 0 {
        out.line(&format!(
            "{} compared bit by bit; left out as measured times: {}",
            counted(tally.exact, "tick", "ticks"),
            TIMES.join(", ")
        ))?;
    }
    if tally.lawful > 0 {
        let judged = &tally.judged;
        out.line(&format!(
            "{} limited by time, or came after such: replayed without a limit and held against the law; {} \
             rows, {} collisions, {} of them told as not decided",
            counted(tally.lawful, "tick was", "ticks were"),
            judged.rows,
            judged.collisions,
            judged.open
        ))?;
    }
    match &found.ending {
        None | Some(Ending::Whole) => {}
        Some(ending) => out.line(&ending.to_string())?,
    }
    match &found.difference {
        Some(difference) => out.line(&format!("first difference: {difference}")),
        None if found.compared() == 0 => out.line(match found.ticks {
            0 => "nothing was compared: no tick could be read",
            _ => "nothing was compared: no tick of the recording was asked for",
        }),
        None => out.line("no difference"),
    }
}

fn json(found: &Found) -> serde_json::Value {
    let (facts, tally) = (&found.facts, &found.tally);
    let ending = found.ending.as_ref();
    let word = ending.map(|ending| match ending {
        Ending::Whole => "whole",
        Ending::Early(_) => "early",
        Ending::Cut => "cut",
        Ending::Damaged(_) => "damaged",
    });
    let why = ending.filter(|ending| **ending != Ending::Whole);
    serde_json::json!({
        "scene": facts.scene_file,
        "sweepd_version": facts.sweepd_version,
        "boot_id": format!("{:016x}", facts.boot_id),
        "ticks": found.ticks,
        "ticks_exact": tally.exact,
        "ticks_by_law": tally.lawful,
        "rows_by_law": tally.judged.rows,
        "collisions_by_law": tally.judged.collisions,
        "collisions_open": tally.judged.open,
        "fields_left_out": TIMES,
        "ending": word,
        "why": why.map(ToString::to_string),
        "difference": found.difference,
    })
}
