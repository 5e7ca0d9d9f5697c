//! `sweepd query --ray`: the first body that a ray hits. In: flags. Out: text, or one JSON object.

use std::sync::atomic::AtomicBool;

use serde_json::json;

use super::live::{ask, clean, end, lines, strangers, tell, told_json, triple, word, worded};
use crate::cli::args_query::{Numbers, QueryArgs};
use crate::cli::figures::{metres, time};
use crate::cli::out::Out;
use crate::error::Result;
use crate::wire::RayFound;

/// Asks the daemon, waits and prints the answer.
///
/// * `ray` - start point, metres, and direction.
pub(super) fn ray(
    ray: Numbers<6>,
    args: &QueryArgs,
    out: &mut Out,
    stop: &AtomicBool,
) -> Result<bool> {
    let Numbers([x, y, z, dx, dy, dz]) = ray;
    let mut asked = json!({ "from": [x, y, z], "direction": [dx, dy, dz] });
    if let Some(max_m) = args.ray.max {
        asked["max_m"] = json!(max_m);
    }
    if let Some(mask) = args.ray.mask {
        asked["mask"] = json!(mask);
    }
    let taken = |answer: &mut crate::wire::Answer| answer.ray.take();
    let (found, warnings) = ask(&json!({ "ray": asked }), &[], args, stop, taken)?;
    let worded = worded(&found, found.verdict);
    tell(
        (args, out),
        || told_json(worded, &found.tick_header, &warnings),
        || as_text(&found, &warnings),
    )
}

fn as_text(found: &RayFound, warnings: &[String]) -> String {
    let header = &found.tick_header;
    let mut told = match &found.body {
        Some(body) => vec![
            ("hits", clean(body)),
            (
                "at [m]",
                if found.inside {
                    "0: it begins within".to_owned()
                } else {
                    end(found.t_best_m, "not known")
                },
            ),
            (
                "proved [m]",
                format!(
                    "{} .. {}",
                    metres(found.t_min_m),
                    end(found.t_max_m, "no upper end")
                ),
            ),
            ("point", triple(found.point)),
            ("normal", triple(found.normal)),
        ],
        None => vec![
            (
                "hits",
                format!("nothing by what is known ({})", word(found.verdict)),
            ),
            ("free [m]", metres(found.t_min_m)),
        ],
    };
    told.extend(
        found
            .possible
            .iter()
            .map(|name| ("possible", format!("{}: not decided", clean(name)))),
    );
    strangers(
        &mut told,
        (&found.unknown, found.unknown_left_out),
        &[
            (
                found.left_out,
                [
                    "body in the way left out: nothing is known of it",
                    "bodies in the way left out: nothing is known of them",
                ],
            ),
            (
                found.ignored,
                [
                    "body in the way not looked at: its groups, or disabled",
                    "bodies in the way not looked at: their groups, or disabled",
                ],
            ),
        ],
    );
    let complete = if found.complete {
        "yes: nothing is hit sooner"
    } else {
        "no: something may be hit sooner"
    };
    told.push(("complete", complete.to_owned()));
    let age = found
        .age_ns
        .map(|age_ns| format!("; its pose {} old", time(age_ns)));
    told.push((
        "tick",
        format!(
            "{}, scene revision {}{}",
            header.tick,
            header.scene_rev,
            age.unwrap_or_default()
        ),
    ));
    lines(told, warnings)
}
