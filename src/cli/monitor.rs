//! `sweepd monitor`: shows the ticks of a running daemon on a screen or as JSON lines.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

mod face;
mod json;

use crate::error::{Error, Result};
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Heard, Message, Topics, View};
use crate::wire::{NameRow, Reason, RejectReason, State, TickRow, name_str};

use super::args::MonitorArgs;
use super::connect;
use super::out::Out;
use face::Face;

/// Longest wait between two checks of the stop flag, nanoseconds.
const LOOK_NS: u64 = 100_000_000;

/// The daemon computes only what has readers, so the first ticks come without pairs. For at most this long ticks that
/// lack requested rows are skipped, nanoseconds.
const WHOLE_WAIT_NS: u64 = 1_000_000_000;
/// After this time without a tick the screen reports silence, nanoseconds: three heartbeats of the default length; for
/// a slower daemon twice the last time between two ticks.
const SILENCE_NS: u64 = 300_000_000;

/// Follows an instance until stopped.
pub(super) fn monitor(args: &MonitorArgs, out: &mut Out) -> Result<bool> {
    let mut face = Face::of(args)?;
    let stop = face.stop()?;
    let Some(mut client) = connect(&args.which.instance, None, args.wait, &stop)? else {
        return Ok(true);
    };
    client.subscribe(Topics {
        pairs: true,
        contacts: args.contacts,
        bodies: !args.json,
        names: true,
        ..Topics::default()
    })?;
    let mut names = Names::default();
    let (clock, mut seen) = (SystemClock, 0);
    let mut heard_ns = clock.monotonic_ns();
    let mut silence_ns = SILENCE_NS;
    let mut whole_by_ns = heard_ns.saturating_add(WHOLE_WAIT_NS);
    face.open();
    let is_ended = |face: &Face| stop.load(Ordering::Relaxed) || face.is_end_typed();
    while !is_ended(&face) && args.ticks.is_none_or(|most| seen < most) {
        match client.wait_tick(LOOK_NS)? {
            Heard::Tick => {
                let before_ns = std::mem::replace(&mut heard_ns, clock.monotonic_ns());
                silence_ns = SILENCE_NS.max(2 * heard_ns.saturating_sub(before_ns));
                if heard_ns < whole_by_ns && !is_whole(client.view(), args) {
                    continue;
                }
                // Later ticks are shown as they come: rows that newer ones overtook in a queue are not waited for.
                whole_by_ns = 0;
                // A tick under way comes again when it is complete.
                seen += u64::from(!client.view().is_under_way());
                names.follow(client.view().names());
                if !is_shown(client.view(), args) {
                    continue;
                }
                face.tick(client.view(), &names, args, out)?;
            }
            Heard::Restarted(news) => {
                whole_by_ns = clock.monotonic_ns().saturating_add(WHOLE_WAIT_NS);
                face.restart(&news, &names, out)?;
            }
            Heard::Silence => {
                let silent_ns = clock.monotonic_ns().saturating_sub(heard_ns);
                if silent_ns >= args.wait {
                    return Err(Error::TimedOut(format!(
                        "no tick for {} ms; is the daemon `{}` still running?",
                        silent_ns / 1_000_000,
                        args.which.instance
                    )));
                }
                if silent_ns >= silence_ns {
                    face.silence(silent_ns, out)?;
                }
            }
        }
    }
    face.end(out)?;
    Ok(true)
}

/// Whether a tick came with all requested rows.
fn is_whole(view: &View, args: &MonitorArgs) -> bool {
    view.names().is_some()
        && view.pairs().is_some()
        && (!args.contacts || view.contacts().is_some())
        && (args.json || view.bodies().is_some())
}

/// Whether a tick is shown. Where JSON lines are counted, only complete ticks are.
fn is_shown(view: &View, args: &MonitorArgs) -> bool {
    let are_counted = args.json && args.ticks.is_some();
    !(are_counted && view.is_under_way())
}

/// Names of bodies by id.
#[derive(Debug, Default)]
pub(super) struct Names {
    by_id: BTreeMap<u64, String>,
    longest: usize,
    tick: u64,
    boot_id: u64,
}

impl Names {
    fn follow(&mut self, names: Option<&Message<NameRow>>) {
        let Some(names) = names else { return };
        if (names.header.tick, names.header.boot_id) == (self.tick, self.boot_id) {
            return;
        }
        (self.tick, self.boot_id) = (names.header.tick, names.header.boot_id);
        self.by_id.clear();
        self.longest = 0;
        for row in &names.rows {
            let name = name_str(&row.name).unwrap_or("?").to_owned();
            self.longest = self.longest.max(name.chars().count());
            self.by_id.insert(row.body, name);
        }
    }

    /// Characters of the longest name.
    #[cfg(feature = "tui")]
    pub(super) fn longest(&self) -> usize {
        self.longest
    }

    /// The name of a body, or its id if the name is unknown.
    pub(super) fn of(&self, id: u64) -> String {
        self.by_id
            .get(&id)
            .cloned()
            .unwrap_or_else(|| format!("#{id}"))
    }
}

/// The words of a tick's reason bits.
pub(super) fn reasons(tick: &TickRow) -> Vec<&'static str> {
    Reason::ALL
        .iter()
        .filter(|r| tick.reasons & r.bit() != 0)
        .map(|r| r.word())
        .collect()
}

/// The counted refusals of a tick, by name.
pub(super) fn rejects(tick: &TickRow) -> Vec<(&'static str, u64)> {
    let all = RejectReason::ALL.iter().zip(&tick.rejects);
    all.filter(|(_, count)| **count > 0)
        .map(|(reason, count)| (reason.word(), *count))
        .collect()
}

/// The word of a state code.
pub(super) fn state_word(tick: &TickRow) -> &'static str {
    State::from_code(tick.header.state).map_or("?", State::word)
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::super::args::{Cli, Command};
    use super::*;
    use crate::transport::Door as _;
    use crate::transport::memory::trial::{SECOND_NS, met, under_way};
    use crate::wire::Outbox;

    #[test]
    fn bug_where_lines_are_counted_a_tick_under_way_has_none() {
        let (mut server, mut client) = met();
        let args = |text: &str| match Cli::try_parse_from(text.split(' ')).unwrap().command {
            Command::Monitor(args) => args,
            other => panic!("{other:?}"),
        };
        let shown = |view: &View| {
            ["", " --json", " --ticks 3", " --json --ticks 3"]
                .map(|flags| is_shown(view, &args(&format!("sweepd monitor{flags}"))))
        };
        let mut out = Outbox::default();
        out.tick.header.boot_id = 7;
        out.tick.header.tick = 1;
        server.publish_tick(&under_way(1)).unwrap();
        assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
        assert_eq!(shown(client.view()), [true, true, true, false]);
        out.tick.sent_ns = 1;
        server.publish(&out).unwrap();
        assert_eq!(client.wait_tick(SECOND_NS).unwrap(), Heard::Tick);
        assert_eq!(shown(client.view()), [true; 4]);
    }
}
