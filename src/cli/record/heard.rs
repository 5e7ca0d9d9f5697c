//! `sweepd record FILE`: records, as a client, what a running daemon publishes, into a file for viewers.
//!
//! In: an instance. Out: an MCAP file of ROS 2 messages. The daemon only gets one more subscriber, so any daemon can be
//! recorded at any time. Its inputs are not published; `run --record` records them.

use std::fs::File;
use std::io::BufWriter;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::args_tools::{RecordArgs, Recorded};
use crate::cli::connect;
use crate::cli::files::open_new;
use crate::cli::out::Out;
use crate::error::{Error, Result, counted};
use crate::record::FLUSH_NS;
use crate::record::file::{McapLog, Shown, buffered};
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Client, Heard, Message, Restarted, Topics, View};
use crate::wire::{MessageHeader, TickRow};

/// Longest wait between two checks of the stop flag, nanoseconds.
const LOOK_NS: u64 = 100_000_000;

/// Requested rows are missing in the first ticks of a boot that a client receives. For at most this long such ticks are
/// skipped, nanoseconds: they would be recorded without rows or without names.
const FIRST_WAIT_NS: u64 = 1_000_000_000;

type Log = McapLog<BufWriter<File>>;

/// State of the recording.
#[derive(Default)]
struct Tally {
    /// Ticks that newer ones overtook before they were received.
    missed: u64,
    /// The newest tick of this boot; tick 0: none yet.
    last: TickRow,
    /// Number of the last tick of this boot that was received complete.
    ended: u64,
    /// Boot id and tick of the names that were written last.
    names: (u64, u64),
}

/// Records until a signal, or until the requested ticks or time are over.
pub(in crate::cli) fn record(args: &RecordArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    // Without a daemon no file is touched.
    let Some(mut client) = connect(&args.which.instance, None, args.wait, stop)? else {
        return Ok(true);
    };
    let (clock, name) = (SystemClock, args.file.display().to_string());
    let file = buffered(open_new(&args.file, args.force, super::WHAT)?);
    super::tell_limit(&name);
    let since_1970_ns = clock.realtime_ns().saturating_sub(clock.boottime_ns());
    let mut log = McapLog::new(file, &name, &args.frame_id, since_1970_ns)?;
    client.subscribe(topics(args))?;
    let mut tally = Tally::default();
    let done = follow(args, &mut client, &mut log, &mut tally, stop);
    // The file is closed in every case, with the reason for the end.
    let why = done.as_ref().err().map_or(String::new(), Error::to_string);
    let closed = log.end(&why, tally.missed);
    let missed = tally.missed;
    out.line(&format!(
        "{} in {name}",
        counted(log.ticks(), "tick", "ticks")
    ))?;
    out.flush()?;
    if missed > 0 {
        tracing::warn!(
            "{} not in {name}: record less with --only, or to a faster disk",
            counted(
                missed,
                "tick was overtaken before it was heard and is",
                "ticks were overtaken before they were heard and are"
            )
        );
    }
    done.and(closed).map(|()| true)
}

/// The topics to subscribe to.
fn topics(args: &RecordArgs) -> Topics {
    let only = |topic| args.only.is_empty() || args.only.contains(&topic);
    Topics {
        pairs: only(Recorded::Pairs),
        contacts: only(Recorded::Contacts),
        bodies: only(Recorded::Bodies),
        names: true,
        ..Topics::default()
    }
}

/// Whether the rows of all these topics came.
fn has_all(view: &View, topics: Topics) -> bool {
    view.names().is_some()
        && (!topics.pairs || view.pairs().is_some())
        && (!topics.contacts || view.contacts().is_some())
        && (!topics.bodies || view.bodies().is_some())
}

fn follow(
    args: &RecordArgs,
    client: &mut Client,
    log: &mut Log,
    tally: &mut Tally,
    stop: &AtomicBool,
) -> Result<()> {
    let clock = SystemClock;
    let start_ns = clock.monotonic_ns();
    let until_ns = args.time.map(|time| start_ns.saturating_add(time));
    let (mut heard_ns, mut flushed_ns) = (start_ns, start_ns);
    let topics = topics(args);
    let mut is_begun = false;
    let mut begun_by_ns = start_ns.saturating_add(FIRST_WAIT_NS);
    while !stop.load(Ordering::Relaxed) && args.ticks.is_none_or(|most| log.ticks() < most) {
        let now_ns = clock.monotonic_ns();
        let left_ns = until_ns.map_or(LOOK_NS, |until| until.saturating_sub(now_ns));
        if left_ns == 0 {
            break;
        }
        match client.wait_tick(left_ns.min(LOOK_NS))? {
            Heard::Tick => {
                heard_ns = now_ns;
                is_begun = is_begun || now_ns >= begun_by_ns || has_all(client.view(), topics);
                if is_begun {
                    tally.tick(log, client.view())?;
                }
            }
            Heard::Restarted(news) => {
                is_begun = false;
                begun_by_ns = now_ns.saturating_add(FIRST_WAIT_NS);
                tally.restart(log, &news)?;
            }
            Heard::Silence if now_ns.saturating_sub(heard_ns) >= args.wait => {
                return Err(Error::TimedOut(format!(
                    "no tick for {} ms; is the daemon `{}` still running?",
                    now_ns.saturating_sub(heard_ns) / 1_000_000,
                    args.which.instance
                )));
            }
            Heard::Silence => {}
        }
        if now_ns.saturating_sub(flushed_ns) >= FLUSH_NS {
            log.flush()?;
            flushed_ns = now_ns;
        }
    }
    Ok(())
}

impl Tally {
    fn tick(&mut self, log: &mut Log, view: &View) -> Result<()> {
        let tick = view.tick();
        let now = tick.header.tick;
        if self.last.header.tick == 0 {
            // Ticks before the first received one are not missed.
            self.ended = now.saturating_sub(1);
        }
        // A long tick is received several times under one number; it is complete only at its end.
        let has_ended = !view.is_under_way();
        if has_ended {
            self.missed += now.saturating_sub(self.ended + 1);
            self.ended = now;
        }
        self.last = *tick;
        let names = view.names().filter(|names| {
            let these = (names.header.boot_id, names.header.tick);
            std::mem::replace(&mut self.names, these) != these
        });
        let shown = Shown {
            tick,
            names: names.map(|names| names.rows.as_slice()),
            bodies: view.bodies().map(|bodies| bodies.rows.as_slice()),
            contacts: view.contacts().map(parts),
            pairs: view.pairs().map(parts),
        };
        log.tick(&shown, has_ended)
    }

    fn restart(&mut self, log: &mut Log, news: &Restarted) -> Result<()> {
        let last = std::mem::take(&mut self.last);
        log.restart(&last, &news.ends)
    }
}

fn parts<T>(message: &Message<T>) -> (&MessageHeader, &[T]) {
    (&message.header, &message.rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Door as _;
    use crate::transport::memory::trial::{SECOND_NS, met, under_way};
    use crate::wire::Outbox;

    #[test]
    fn bug_a_tick_that_is_under_way_is_written_and_counts_once_it_has_ended() {
        let (mut server, mut client) = met();
        let path = std::env::temp_dir().join(format!("sweepd_heard_{}.mcap", std::process::id()));
        let file = buffered(File::create(&path).unwrap());
        let mut log = McapLog::new(file, "heard", "world", 0).unwrap();
        let mut tally = Tally::default();
        let mut out = Outbox::default();
        out.tick.header.boot_id = 7;
        out.tick.header.tick = 1;
        server.publish_tick(&under_way(1)).unwrap();
        out.tick.sent_ns = 1;
        for ticks in 0..=1 {
            assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
            tally.tick(&mut log, client.view()).unwrap();
            assert_eq!((log.ticks(), tally.missed), (ticks, 0));
            server.publish(&out).unwrap();
        }
        // A tick whose end was overtaken is missed.
        for (tick, is_whole, missed) in [(2, false, 0), (3, true, 1), (4, false, 1), (6, true, 3)] {
            out.tick.header.tick = tick;
            if is_whole {
                server.publish(&out).unwrap();
            } else {
                server.publish_tick(&under_way(tick)).unwrap();
            }
            assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
            tally.tick(&mut log, client.view()).unwrap();
            assert_eq!(tally.missed, missed, "tick {tick}");
        }
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn bug_the_first_tick_was_often_written_without_what_was_to_be_recorded() {
        let (mut server, mut client) = met();
        let topics = Topics {
            pairs: true,
            bodies: true,
            names: true,
            ..Topics::default()
        };
        client.subscribe(topics).unwrap();
        let mut out = Outbox {
            names_changed: true,
            ..Outbox::default()
        };
        // A daemon that does not know its subscribers yet publishes only names.
        for (tick, comes) in [(1, false), (2, true)] {
            for header in [
                &mut out.tick.header,
                &mut out.pairs_header,
                &mut out.bodies_header,
            ] {
                (header.boot_id, header.tick) = (7, tick);
            }
            if comes {
                assert!(server.demand().bodies);
            }
            server.publish(&out).unwrap();
            assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
            assert_eq!(has_all(client.view(), topics), comes, "tick {tick}");
        }
    }
}
