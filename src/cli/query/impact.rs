//! `sweepd query A B --impact TIME`: when two bodies touch first. In: flags. Out: text, or one JSON object.

use std::sync::atomic::AtomicBool;

use serde_json::json;

use super::live::{ask, clean, lines, tell, told_json, triple, word, worded};
use crate::cli::args_query::QueryArgs;
use crate::cli::figures::{metres, seconds, time};
use crate::cli::out::Out;
use crate::error::Result;
use crate::wire::ImpactFound;

/// Asks the daemon, waits and prints the answer.
pub(super) fn impact(
    a: &str,
    b: &str,
    args: &QueryArgs,
    out: &mut Out,
    stop: &AtomicBool,
) -> Result<bool> {
    let flags = &args.impact;
    let within_s = seconds(flags.impact.unwrap_or_default());
    let mut asked = json!({ "a": a, "b": b, "within_s": within_s });
    for (key, value) in [
        ("linear_a", &flags.linear_a),
        ("angular_a", &flags.angular_a),
        ("linear_b", &flags.linear_b),
        ("angular_b", &flags.angular_b),
    ] {
        if let Some(value) = value {
            asked[key] = json!(value.0);
        }
    }
    let taken = |answer: &mut crate::wire::Answer| answer.impact.take();
    let (found, warnings) = ask(&json!({ "impact": asked }), &[a, b], args, stop, taken)?;
    let as_json = || {
        let mut answer = worded(&found, found.verdict);
        (answer["a"], answer["b"]) = (json!(a), json!(b));
        told_json(answer, &found.tick_header, &warnings)
    };
    let as_text = || as_text((a, b), within_s, &found, &warnings);
    tell((args, out), as_json, as_text)
}

fn as_text(
    (a, b): (&str, &str),
    within_s: f64,
    found: &ImpactFound,
    warnings: &[String],
) -> String {
    let header = &found.tick_header;
    let when = match found.t_max_s {
        Some(end_s) => format!("{} .. {}", metres(found.t_min_s), metres(end_s)),
        None if found.t_min_s >= within_s => format!("never within {}", metres(within_s)),
        None => format!("{} .. not known", metres(found.t_min_s)),
    };
    let of = |linear, angular| {
        format!(
            "{} m/s, {} rad/s",
            triple(Some(linear)),
            triple(Some(angular))
        )
    };
    let age = match found.age_ns {
        Some(age_ns) => format!("poses {} old", time(age_ns)),
        None => "neither body moves".to_owned(),
    };
    let told = [
        ("A", clean(a)),
        ("B", clean(b)),
        ("A goes", of(found.linear_a, found.angular_a)),
        ("B goes", of(found.linear_b, found.angular_b)),
        ("verdict", word(found.verdict).to_owned()),
        ("touch [s]", when),
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
