//! `sweepd query --touching NAME`, `--shape JSON`: the bodies that a body or a shape touches or would touch. In: flags.
//! Out: text, or one JSON object.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::live::{ask, clean, end, lines, strangers, tell, told_json, word, worded};
use crate::cli::args_query::QueryArgs;
use crate::cli::out::Out;
use crate::error::{Error, Result, counted};
use crate::wire::{TouchingFound, TouchingRow};

/// The remedy for an invalid shape.
const SHAPE_MEND: &str = r#"write a shape as '{"type": "sphere", "radius": 0.5}'"#;

/// Asks the daemon, waits and prints the answer.
pub(super) fn touching(args: &QueryArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    let asked = question(args)?;
    let named: Vec<&str> = args.touching.touching.as_deref().into_iter().collect();
    let taken = |answer: &mut crate::wire::Answer| answer.touching.take();
    let (found, warnings) = ask(&json!({ "touching": asked }), &named, args, stop, taken)?;
    tell(
        (args, out),
        || as_json(&found, &warnings),
        || as_text(&found, &warnings),
    )
}

fn question(args: &QueryArgs) -> Result<Value> {
    let flags = &args.touching;
    let mut asked = json!({ "within_m": flags.within, "filters": !flags.no_filters });
    if let Some(name) = &flags.touching {
        asked["body"] = json!(name);
    }
    if let Some(text) = &flags.shape {
        if text.trim().is_empty() {
            return Err(Error::Usage(format!("--shape is empty: {SHAPE_MEND}")));
        }
        asked["shape"] = serde_json::from_str(text)
            .map_err(|e| Error::Usage(format!("--shape is not JSON: {e}; {SHAPE_MEND}")))?;
    }
    if let Some(at) = flags.at {
        asked["position"] = json!(at.position);
        if let Some(orientation) = at.orientation {
            asked["orientation"] = json!(orientation);
        }
    }
    Ok(asked)
}

fn as_json(found: &TouchingFound, warnings: &[String]) -> Value {
    let mut answer = json!(found);
    let rows = found.rows.iter();
    answer["rows"] = rows.map(|row| worded(row, row.known.verdict)).collect();
    told_json(answer, &found.tick_header, warnings)
}

fn as_text(found: &TouchingFound, warnings: &[String]) -> String {
    let header = &found.tick_header;
    let what = match found.asked.as_slice() {
        [] => "the shape".to_owned(),
        [body] => clean(body),
        [body, with @ ..] => {
            let hanging = counted(with.len(), "that hangs", "that hang");
            format!("{} with {hanging} on it", clean(body))
        }
    };
    let mut told = vec![("asked for", what)];
    told.extend(
        found
            .rows
            .iter()
            .map(|row| (word(row.known.verdict), sentence(row))),
    );
    if found.rows.is_empty() {
        told.push(("nothing", "is near by what is known".to_owned()));
    }
    strangers(
        &mut told,
        (&found.unknown, found.unknown_left_out),
        &[
            (
                found.left_out,
                [
                    "pair with near boxes left out: nothing is known of it",
                    "pairs with near boxes left out: nothing is known of them",
                ],
            ),
            (
                found.ignored,
                [
                    "pair with near boxes not looked at: a filter, or disabled",
                    "pairs with near boxes not looked at: filters, or disabled",
                ],
            ),
        ],
    );
    let complete = if found.complete {
        "yes: all other bodies are proved farther"
    } else {
        "no: others may be near, too"
    };
    told.push(("complete", complete.to_owned()));
    told.push((
        "tick",
        format!("{}, scene revision {}", header.tick, header.scene_rev),
    ));
    lines(told, warnings)
}

/// One row as text: the bodies, and the proved gap in metres.
fn sentence(row: &TouchingRow) -> String {
    let of = row.a.as_deref().map(|a| format!("{} and ", clean(a)));
    let touching = if row.known.touching {
        " (touching)"
    } else {
        ""
    };
    // "not known" has no unit.
    let unit = row.known.gap_best_m.map_or("", |_| " m");
    format!(
        "{}{}{touching}: gap {}{unit}, proved {} .. {}",
        of.unwrap_or_default(),
        clean(&row.b),
        end(row.known.gap_best_m, "not known"),
        end(row.known.gap_min_m, "no lower end"),
        end(row.known.gap_max_m, "no upper end"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{GapKnown, UnknownBody, Verdict};

    #[test]
    fn what_is_not_known_is_told_and_no_cursor_is_moved() {
        let found = TouchingFound {
            rows: vec![TouchingRow {
                b: "evil\x1b[2J".to_owned(),
                known: GapKnown {
                    verdict: Verdict::Possible.code(),
                    ..GapKnown::default()
                },
                ..TouchingRow::default()
            }],
            unknown: vec![UnknownBody {
                body: "arm".to_owned(),
                status: "stale".to_owned(),
            }],
            left_out: 3,
            ..TouchingFound::default()
        };
        let text = as_text(&found, &[]);
        for words in [
            "possible    evil?[2J: gap not known, proved no lower end .. no upper end",
            "unknown     arm (stale)",
            "3 pairs",
            "complete    no",
        ] {
            assert!(text.contains(words), "`{words}` in {text}");
        }
        let json = as_json(&found, &["odd".to_owned()]);
        assert_eq!(json["rows"][0]["verdict"], "possible");
        assert!(json["rows"][0]["gap_min_m"].is_null() && json.get("tick_header").is_none());
    }
}
