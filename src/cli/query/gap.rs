//! `sweepd query A B`: the gap of two bodies. In: names. Out: text, or one JSON object with the keys of `query --batch`
//! where they mean the same.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::live::{ask, clean, end, lines, tell, told_json, triple, word};
use crate::cli::args_query::QueryArgs;
use crate::cli::figures::time;
use crate::cli::out::Out;
use crate::error::Result;
use crate::wire::{GapFound, Verdict};

/// Asks the daemon, waits and prints the answer.
pub(super) fn gap(
    a: &str,
    b: &str,
    args: &QueryArgs,
    out: &mut Out,
    stop: &AtomicBool,
) -> Result<bool> {
    let question = json!({ "gap": { "a": a, "b": b } });
    let (found, warnings) = ask(&question, &[a, b], args, stop, |answer| answer.gap)?;
    tell(
        (args, out),
        || as_json(a, b, &found, &warnings),
        || as_text(a, b, &found, &warnings),
    )
}

fn as_json(a: &str, b: &str, found: &GapFound, warnings: &[String]) -> Value {
    let known = &found.known;
    let answer = json!({
        "a": a,
        "b": b,
        "verdict": word(known.verdict),
        "colliding": known.verdict == Verdict::Colliding.code(),
        "touching": known.touching,
        "gap_m": known.gap_best_m,
        "gap_min_m": known.gap_min_m,
        "gap_max_m": known.gap_max_m,
        "normal": known.normal,
        "point_a": known.point_a,
        "point_b": known.point_b,
        "age_ns": found.age_ns,
    });
    told_json(answer, &found.tick_header, warnings)
}

fn as_text(a: &str, b: &str, found: &GapFound, warnings: &[String]) -> String {
    let known = &found.known;
    let touching = if known.touching { " (touching)" } else { "" };
    let header = &found.tick_header;
    let age = match found.age_ns {
        Some(age_ns) => format!("poses {} old", time(age_ns)),
        None => "neither body moves".to_owned(),
    };
    let proved = format!(
        "{} .. {}",
        end(known.gap_min_m, "no lower end"),
        end(known.gap_max_m, "no upper end")
    );
    let told = [
        ("A", clean(a)),
        ("B", clean(b)),
        ("verdict", format!("{}{touching}", word(known.verdict))),
        ("gap [m]", end(known.gap_best_m, "not known")),
        ("proved [m]", proved),
        ("point on A", triple(known.point_a)),
        ("point on B", triple(known.point_b)),
        ("normal", triple(known.normal)),
        (
            "tick",
            format!(
                "{}, scene revision {}; {age}",
                header.tick, header.scene_rev
            ),
        ),
    ];
    lines(told, warnings)
}

#[cfg(test)]
mod tests {
    use super::*;

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
