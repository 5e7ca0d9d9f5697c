//! A tick as one line of JSON.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::{Names, reasons, rejects, state_word};
use crate::cli::args::MonitorArgs;
use crate::cli::worst;
use crate::transport::client::{Restarted, View};
use crate::wire::{
    BroadCause, BroadMode, ContactRow, EndCause, Event, Level, PairRow, Stage, TickCause, TickRow,
    Verdict, name_str, pair_flags,
};

/// A tick and the rows that came with it.
pub(super) fn tick(view: &View, names: &Names, args: &MonitorArgs) -> Value {
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
        "broad": broad(tick),
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
        line["pairs"] = rows.iter().map(|row| pair(row, names)).collect();
        line["pairs_shown"] = json!([args.pairs.min(pairs.rows.len()), pairs.rows.len()]);
    }
    if let Some(contacts) = view.contacts() {
        let rows = worst::contacts(&contacts.rows, args.pairs.saturating_mul(4));
        line["contacts"] = rows.iter().map(|row| contact(row, names)).collect();
        line["contacts_shown"] = json!([rows.len(), contacts.rows.len()]);
    }
    line
}

/// Mode and cause of the broad phase, and the number of bodies whose fat box it renewed.
fn broad(tick: &TickRow) -> Value {
    json!({
        "mode": BroadMode::from_code(tick.broad_mode).map_or("?", BroadMode::word),
        "cause": BroadCause::from_code(tick.broad_cause).map_or("?", BroadCause::word),
        "renewed": tick.broad_renewed,
    })
}

/// A number; null if it is infinite, which JSON cannot express.
fn metres(value: f64) -> Value {
    if value.is_finite() {
        json!(value)
    } else {
        Value::Null
    }
}

fn pair(row: &PairRow, names: &Names) -> Value {
    let events = row.told_events().map(Event::word);
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

fn contact(row: &ContactRow, names: &Names) -> Value {
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

/// A restart of the daemon, and the published pairs that ended by it.
pub(super) fn restart(news: &Restarted, names: &Names) -> Value {
    let ends = news.ends.iter().map(|row| pair(row, names));
    let boots = [news.old_boot, news.new_boot].map(|boot| format!("{boot:016x}"));
    json!({ "restarted": { "boots": boots, "ends": ends.collect::<Vec<_>>() } })
}

/// A limit or an age as JSON; null if there is none.
fn limit(value: u64) -> Value {
    if value == u64::MAX {
        Value::Null
    } else {
        json!(value)
    }
}
