//! `sweepd monitor`: what a running daemon says, as a screen or as JSON lines.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Heard, Message, Restarted, Topics, View};
use crate::wire::{
    BodyRow, BodyStatus, BroadCause, BroadMode, ContactRow, EndCause, Event, Level, NameRow,
    PairRow, Reason, RejectReason, Stage, State, TickCause, TickRow, Verdict, name_str, pair_flags,
};

use super::args::MonitorArgs;
use super::connect;
use super::out::Out;
use super::screen::Screen;
use super::worst;

/// Longest wait before a look at the stop flag, nanoseconds.
const LOOK_NS: u64 = 100_000_000;

/// The daemon computes what somebody listens to, so the first ticks heard come without pairs: how long they are passed
/// over until all that was asked for is there, nanoseconds.
const WHOLE_WAIT_NS: u64 = 1_000_000_000;
/// Without a tick for so long the screen says so, nanoseconds: three heartbeats of the usual length; for a slower
/// daemon twice the last time between two ticks.
const SILENCE_NS: u64 = 300_000_000;

/// Follows an instance until stopped.
pub(super) fn monitor(args: &MonitorArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    let Some(mut client) = connect(&args.which.instance, None, args.wait, stop)? else {
        return Ok(true);
    };
    client.subscribe(Topics {
        pairs: true,
        contacts: args.contacts,
        bodies: !args.json,
        names: true,
        ..Topics::default()
    })?;
    let mut screen = Screen::new(args.which.instance.clone(), args.pairs);
    let mut names = Names::default();
    let (clock, mut seen) = (SystemClock, 0);
    let mut heard_ns = clock.monotonic_ns();
    let mut silence_ns = SILENCE_NS;
    let mut whole_by_ns = heard_ns.saturating_add(WHOLE_WAIT_NS);
    while !stop.load(Ordering::Relaxed) && args.ticks.is_none_or(|most| seen < most) {
        match client.wait_tick(LOOK_NS)? {
            Heard::Tick => {
                let before_ns = std::mem::replace(&mut heard_ns, clock.monotonic_ns());
                silence_ns = SILENCE_NS.max(2 * heard_ns.saturating_sub(before_ns));
                if heard_ns < whole_by_ns && !is_whole(client.view(), args) {
                    continue;
                }
                // Later ticks come as they are: what is overtaken in a queue is not waited for.
                whole_by_ns = 0;
                // One that is under way comes again, whole.
                seen += u64::from(!client.view().is_under_way());
                names.follow(client.view().names());
                if !is_shown(client.view(), args) {
                    continue;
                }
                if args.json {
                    out.line(&tick_json(client.view(), &names, args).to_string())?;
                    out.flush()?;
                } else {
                    screen.show(client.view(), &names, out)?;
                }
            }
            Heard::Restarted(news) => {
                whole_by_ns = clock.monotonic_ns().saturating_add(WHOLE_WAIT_NS);
                if args.json {
                    out.line(&restart_json(&news, &names).to_string())?;
                    out.flush()?;
                } else {
                    screen.note_restart();
                }
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
                if !args.json && silent_ns >= silence_ns {
                    screen.show_silence(silent_ns, out)?;
                }
            }
        }
    }
    screen.end(out)?;
    Ok(true)
}

/// Whether a tick came with all that was asked for.
fn is_whole(view: &View, args: &MonitorArgs) -> bool {
    view.names().is_some()
        && view.pairs().is_some()
        && (!args.contacts || view.contacts().is_some())
        && (args.json || view.bodies().is_some())
}

/// Whether a tick is shown: where lines are counted each is of a tick that has ended.
fn is_shown(view: &View, args: &MonitorArgs) -> bool {
    let are_counted = args.json && args.ticks.is_some();
    !(are_counted && view.is_under_way())
}

fn restart_json(news: &Restarted, names: &Names) -> Value {
    let ends = news.ends.iter().map(|row| pair_json(row, names));
    let boots = [news.old_boot, news.new_boot].map(|boot| format!("{boot:016x}"));
    json!({ "restarted": { "boots": boots, "ends": ends.collect::<Vec<_>>() } })
}

/// Names of bodies by id.
#[derive(Debug, Default)]
pub(super) struct Names {
    by_id: BTreeMap<u64, String>,
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
        for row in &names.rows {
            let name = name_str(&row.name).unwrap_or("?").to_owned();
            self.by_id.insert(row.body, name);
        }
    }

    /// The name of a body, or its number.
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

/// A budget as JSON: null where there is none.
fn limit(value: u64) -> Value {
    if value == u64::MAX {
        Value::Null
    } else {
        json!(value)
    }
}

fn tick_json(view: &View, names: &Names, args: &MonitorArgs) -> Value {
    let tick = view.tick();
    let stages: serde_json::Map<_, _> = Stage::ALL
        .iter()
        .map(|stage| {
            (
                format!("{stage}_ns"),
                json!(tick.stage_ns[usize::from(stage.code())]),
            )
        })
        .collect();
    let sources = tick
        .sources
        .iter()
        .take(usize::from(tick.sources_len))
        .map(|s| {
            json!({
                "name": name_str(&s.name).unwrap_or("?"),
                "alive": s.alive == 1,
                "paused": s.paused == 1,
                "age_ns": limit(s.age_ns),
                "epoch": s.epoch,
                "seq": s.seq,
                "frames": s.frames,
                "skipped": s.skipped,
                "refused": s.refused,
            })
        });
    let mut line = json!({
        "boot_id": format!("{:016x}", tick.header.boot_id),
        "tick": tick.header.tick,
        "scene_rev": tick.header.scene_rev,
        "state": state_word(tick),
        "reasons": reasons(tick),
        "cause": TickCause::from_code(tick.cause).map_or("?", TickCause::word),
        "broad": broad_json(tick),
        "bodies": tick.bodies,
        "unknown": tick.unknown,
        "candidates": tick.candidates,
        "colliding": tick.colliding,
        "possible": tick.possible,
        "near": tick.near,
        "ignored": tick.ignored,
        "truncated": tick.header.truncated,
        "budget_ns": limit(tick.budget_ns),
        "budget_units": limit(tick.budget_units),
        "floor_ns": tick.floor_ns,
        "elapsed_ns": tick.elapsed_ns,
        "units": tick.units,
        "missed": tick.missed,
        "oldest_undecided_ticks": tick.oldest_undecided_ticks,
        "stages": stages,
        "rejects": rejects(tick).into_iter().collect::<BTreeMap<_, _>>(),
        "sources": sources.collect::<Vec<_>>(),
    });
    if tick.worst_a != 0 {
        line["worst"] = json!([names.of(tick.worst_a), names.of(tick.worst_b)]);
    }
    if let Some(pairs) = view.pairs() {
        let rows = worst::pairs(&pairs.rows, args.pairs);
        line["pairs"] = rows.iter().map(|row| pair_json(row, names)).collect();
        line["pairs_shown"] = json!([args.pairs.min(pairs.rows.len()), pairs.rows.len()]);
    }
    if let Some(contacts) = view.contacts() {
        let rows = worst::contacts(&contacts.rows, args.pairs.saturating_mul(4));
        line["contacts"] = rows.iter().map(|row| contact_json(row, names)).collect();
        line["contacts_shown"] = json!([rows.len(), contacts.rows.len()]);
    }
    line
}

/// How the broad phase worked.
fn broad_json(tick: &TickRow) -> Value {
    json!({
        "mode": BroadMode::from_code(tick.broad_mode).map_or("?", BroadMode::word),
        "cause": BroadCause::from_code(tick.broad_cause).map_or("?", BroadCause::word),
        "renewed": tick.broad_renewed,
    })
}

/// A number; JSON has no infinity: an open end is null.
fn metres(value: f64) -> Value {
    if value.is_finite() {
        json!(value)
    } else {
        Value::Null
    }
}

fn pair_json(row: &PairRow, names: &Names) -> Value {
    let events = Event::ALL
        .iter()
        .filter(|e| row.events & e.bit() != 0)
        .map(|e| e.word());
    let mut pair = json!({
        "a": names.of(row.body_a),
        "b": names.of(row.body_b),
        "verdict": Verdict::from_code(row.verdict).map_or("?", Verdict::word),
        "level": Level::from_code(row.level).map_or("?", Level::word),
        "gap_min_m": metres(row.gap_min_m),
        "gap_max_m": metres(row.gap_max_m),
        "gap_m": metres(row.gap_best_m),
        "closing_mps": metres(row.closing_mps),
        "events": events.collect::<Vec<_>>(),
    });
    if row.end_cause != 0 {
        pair["end_cause"] = json!(EndCause::from_code(row.end_cause).map_or("?", EndCause::word));
        pair["end_ticks"] = json!([row.end_first_tick, row.end_last_tick]);
    }
    let has = |flag: u8| row.flags & flag != 0;
    if has(pair_flags::SWEPT_HIT) || has(pair_flags::SWEPT_OPEN) {
        pair["toi"] = json!([metres(row.toi_min), metres(row.toi_max)]);
        pair["touched_on_the_way"] = json!(has(pair_flags::SWEPT_HIT));
    }
    if has(pair_flags::TELEPORTED) {
        pair["teleported"] = json!(true);
    }
    if row.events & Event::Begin.bit() != 0 {
        pair["begin_ticks"] = json!([row.begin_first_tick, row.begin_last_tick]);
    }
    pair
}

fn contact_json(row: &ContactRow, names: &Names) -> Value {
    json!({
        "id": row.id,
        "a": names.of(row.body_a),
        "b": names.of(row.body_b),
        "point_a": row.point_a,
        "point_b": row.point_b,
        "normal": row.normal,
        "gap_m": metres(row.gap_m),
        "estimate": row.flags & crate::wire::contact_flags::ESTIMATE != 0,
    })
}

/// The word of a body's status, when its place is not known.
pub(super) fn unknown_word(body: &BodyRow) -> Option<&'static str> {
    match BodyStatus::from_code(body.status) {
        Some(BodyStatus::Known | BodyStatus::Disabled) | None => None,
        Some(status) => Some(status.word()),
    }
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
