//! `sweepd query A B`: the gap of two bodies, asked of a running daemon. In: names. Out: text, or one JSON object with
//! the keys of `query --batch` where they mean the same.

use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::{Value, json};

use crate::cli::args_tools::QueryArgs;
use crate::cli::connect;
use crate::cli::figures::{metres, time};
use crate::cli::out::Out;
use crate::error::{Error, Result};
use crate::scene::nearest;
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Client, Topics};
use crate::wire::{Answer, GapFound, Verdict, name_str};

/// Longest wait before a look at the stop flag, nanoseconds.
const LOOK_NS: u64 = 100_000_000;
/// How long to wait for the names of the scene, which only help to say what is wrong, nanoseconds.
const NAMES_WAIT_NS: u64 = 1_000_000_000;

/// Asks, waits and tells.
pub(super) fn gap(
    a: &str,
    b: &str,
    args: &QueryArgs,
    out: &mut Out,
    stop: &AtomicBool,
) -> Result<bool> {
    let until_ns = SystemClock.monotonic_ns().saturating_add(args.timeout);
    let instance = &args.which.instance;
    let Some(mut client) = connect(instance, None, args.timeout, stop)? else {
        return Err(stopped());
    };
    let request = client.ask(&json!({ "gap": { "a": a, "b": b } }).to_string(), &[])?;
    let text = loop {
        let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
        if let Some(text) = client.answer_text(request, left_ns.min(LOOK_NS))? {
            break text;
        }
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        if left_ns == 0 {
            return Err(Error::TimedOut(format!(
                "the daemon `{instance}` gave no answer within {}; give it longer with --timeout, or see `sweepd doctor`",
                time(args.timeout)
            )));
        }
    };
    let answer: Answer = serde_json::from_str(&text)
        .map_err(|e| Error::io(format!("the daemon's answer is no answer: {text}"), e))?;
    let Some(found) = &answer.gap else {
        return Err(refusal(&mut client, [a, b], answer.error, stop));
    };
    if args.json {
        out.line(&as_json(a, b, found, &answer.warnings).to_string())?;
    } else {
        out.text(&as_text(a, b, found, &answer.warnings))?;
    }
    out.flush()?;
    Ok(true)
}

fn stopped() -> Error {
    Error::TimedOut("ended by a signal before there was an answer".to_owned())
}

/// Why there is no gap to tell: a name that no body has is the user's, all else the daemon's word.
fn refusal(client: &mut Client, asked: [&str; 2], why: Option<String>, stop: &AtomicBool) -> Error {
    let why = why.unwrap_or_else(|| "the daemon refuses, and does not say why".to_owned());
    let Some(names) = names(client, stop) else {
        return Error::Refused(why);
    };
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let missing = asked.into_iter().find(|name| !known.contains(name));
    match missing {
        Some(name) => Error::Usage(unknown(name, &known)),
        None if asked[0] == asked[1] => Error::Usage(why),
        None => Error::Refused(why),
    }
}

fn unknown(name: &str, known: &[&str]) -> String {
    let mend = match nearest(name, known) {
        Some(nearest) => format!("did you mean \"{nearest}\"?"),
        None => match known {
            [] => "it has none at all".to_owned(),
            [first, ..] => format!(
                "its {} bodies have names such as \"{first}\"; `sweepd check SCENE` reads the scene file",
                known.len()
            ),
        },
    };
    format!("there is no body \"{name}\" in the daemon's scene: {mend}")
}

/// The names of the scene's bodies; `None`: they did not come.
fn names(client: &mut Client, stop: &AtomicBool) -> Option<Vec<String>> {
    let topics = Topics {
        names: true,
        ..Topics::default()
    };
    client.subscribe(topics).ok()?;
    let until_ns = SystemClock.monotonic_ns().saturating_add(NAMES_WAIT_NS);
    loop {
        if let Some(names) = client.view().names() {
            let name = |row: &crate::wire::NameRow| name_str(&row.name).map(ToOwned::to_owned);
            return Some(names.rows.iter().filter_map(name).collect());
        }
        let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
        if left_ns == 0 || stop.load(Ordering::Relaxed) {
            return None;
        }
        client.wait_tick(left_ns.min(LOOK_NS)).ok()?;
    }
}

fn verdict(found: &GapFound) -> Option<Verdict> {
    Verdict::from_code(found.verdict)
}

fn as_json(a: &str, b: &str, found: &GapFound, warnings: &[String]) -> Value {
    let header = &found.tick_header;
    json!({
        "a": a,
        "b": b,
        "verdict": verdict(found).map_or("?", Verdict::word),
        "colliding": verdict(found) == Some(Verdict::Colliding),
        "touching": found.touching,
        "gap_m": found.gap_best_m,
        "gap_min_m": found.gap_min_m,
        "gap_max_m": found.gap_max_m,
        "normal": found.normal,
        "point_a": found.point_a,
        "point_b": found.point_b,
        "boot_id": format!("{:016x}", header.boot_id),
        "tick": header.tick,
        "scene_rev": header.scene_rev,
        "age_ns": found.age_ns,
        "warnings": warnings,
    })
}

fn as_text(a: &str, b: &str, found: &GapFound, warnings: &[String]) -> String {
    let word = verdict(found).map_or("?", Verdict::word);
    let touching = if found.touching { " (touching)" } else { "" };
    let end = |value: Option<f64>, open: &str| value.map_or_else(|| open.to_owned(), metres);
    let triple = |values: Option<[f64; 3]>| match values {
        Some([x, y, z]) => format!("{} {} {}", metres(x), metres(y), metres(z)),
        None => "not known".to_owned(),
    };
    let header = &found.tick_header;
    let age = match found.age_ns {
        Some(age_ns) => format!("poses {} old", time(age_ns)),
        None => "neither body moves".to_owned(),
    };
    let lines = [
        ("verdict", format!("{word}{touching}")),
        ("gap [m]", end(found.gap_best_m, "not known")),
        (
            "proved [m]",
            format!(
                "{} .. {}",
                end(found.gap_min_m, "no lower end"),
                end(found.gap_max_m, "no upper end")
            ),
        ),
        ("point on A", triple(found.point_a)),
        ("point on B", triple(found.point_b)),
        ("normal", triple(found.normal)),
        (
            "tick",
            format!(
                "{}, scene revision {}; {age}",
                header.tick, header.scene_rev
            ),
        ),
    ];
    let mut text = format!("{:<11} {}\n", "A", clean(a)) + &format!("{:<11} {}\n", "B", clean(b));
    for (what, value) in lines {
        text += &format!("{what:<11} {value}\n");
    }
    for warning in warnings {
        text += &format!("{:<11} {}\n", "warning", clean(warning));
    }
    text
}

/// What would move the cursor is not shown.
fn clean(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_name_is_told_with_one_that_is_near_or_one_that_is_there() {
        let known = ["arm/hand", "table"];
        assert!(unknown("arm/hnad", &known).contains("did you mean \"arm/hand\"?"));
        let text = unknown("zeppelin", &known);
        assert!(
            text.contains("2 bodies") && text.contains("\"arm/hand\""),
            "{text}"
        );
        assert!(unknown("x", &[]).contains("none at all"));
    }

    #[test]
    fn what_is_not_known_is_said_and_null() {
        let nothing = GapFound::default();
        let text = as_text("a", "b\x1b", &nothing, &["odd".to_owned()]);
        assert!(text.contains("no lower end .. no upper end"), "{text}");
        assert!(
            text.contains("warning     odd") && !text.contains('\x1b'),
            "{text}"
        );
        let json = as_json("a", "b", &nothing, &[]);
        assert!(
            json["gap_m"].is_null() && json["age_ns"].is_null(),
            "{json}"
        );
    }
}
