//! `sweepd query --ray`: what a ray hits first. In: flags. Out: text, or one JSON object.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::live::{ask, clean, end, lines, strangers, told_json, triple, word};
use crate::cli::args_query::QueryArgs;
use crate::cli::figures::{metres, time};
use crate::cli::out::Out;
use crate::error::{Error, Result};
use crate::wire::RayFound;

/// Asks, waits and tells.
pub(super) fn ray(args: &QueryArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    let asked = json!({ "ray": question(args)? });
    let taken = |answer: &mut crate::wire::Answer| answer.ray.take();
    let (found, warnings) = ask(&asked, &[], args, stop, taken)?;
    if args.json {
        let header = &found.tick_header;
        let told = told_json(json!(found), found.verdict, header, &warnings);
        out.line(&told.to_string())?;
    } else {
        out.text(&as_text(&found, &warnings))?;
    }
    out.flush()?;
    Ok(true)
}

fn question(args: &QueryArgs) -> Result<Value> {
    let flags = &args.ray;
    let numbers = flags.ray.as_ref().map_or(&[][..], |ray| &ray.0);
    let Some((from, direction)) = numbers.split_at_checked(3).filter(|(_, d)| d.len() == 3) else {
        return Err(Error::Usage(format!(
            "--ray has {} numbers: write 6, where it begins and where it goes",
            numbers.len()
        )));
    };
    let mut asked = json!({ "from": from, "direction": direction });
    if let Some(max_m) = flags.max {
        asked["max_m"] = json!(max_m);
    }
    if let Some(mask) = flags.mask {
        asked["mask"] = json!(mask);
    }
    Ok(asked)
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
                "bodies in the way left out: nothing is known of them",
            ),
            (
                found.ignored,
                "bodies in the way not looked at: their groups, or disabled",
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
