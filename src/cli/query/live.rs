//! Sends questions to a running daemon, waits for answers and explains why there is none. In: JSON. Out: the answer,
//! and its parts as text for users.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;
use serde_json::{Value, json};

use crate::cli::args_query::QueryArgs;
use crate::cli::connect;
use crate::cli::figures::{metres, time};
use crate::cli::out::Out;
use crate::error::{Error, Result, counted, nearest};
use crate::scene::Request;
use crate::shape::{ShapeSpec, build};
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Client, Topics};
use crate::wire::{Answer, MessageHeader, UnknownBody, Verdict, name_str};

/// Longest wait between two checks of the stop flag, nanoseconds.
const LOOK_NS: u64 = 100_000_000;
/// Longest wait for the names of the scene, which are only used in error messages, nanoseconds.
const NAMES_WAIT_NS: u64 = 1_000_000_000;

/// Prefixes of error texts, which name the kind of question.
const KINDS: [&str; 4] = ["gap: ", "touching: ", "ray: ", "impact: "];
/// Keys of questions, and the flags that messages name instead of them.
const FLAGS: [(&str, &str); 11] = [
    ("position", "--at"),
    ("orientation", "--at"),
    ("within_m", "--within"),
    ("from", "--ray"),
    ("direction", "--ray"),
    ("max_m", "--max"),
    ("within_s", "--impact"),
    ("linear_a", "--linear-a"),
    ("angular_a", "--angular-a"),
    ("linear_b", "--linear-b"),
    ("angular_b", "--angular-b"),
];

/// Units of keys with these endings. Messages name the unit of the key, since a flag has its own units.
const UNITS: [(&str, &str); 2] = [("_m", "metres"), ("_s", "seconds")];

/// Parses a question as the daemon will. An error in it is the user's, and needs no daemon to be found.
fn check(question: &Value) -> Result<()> {
    let of_shape = |why: &str| Error::Usage(format!("--shape: {}", bare(why)));
    // An error in a shape begins with the name of its number, which other flags may have, too: the shape is parsed
    // alone.
    if let Some(shape) = question["touching"].get("shape") {
        let alone = json!({ "touching": { "shape": shape } }).to_string();
        Request::parse(alone.as_bytes(), &[]).map_err(|why| of_shape(&why))?;
    }
    let wrong = |why: String| {
        let said = bare(&why);
        let word = said.split([' ', ':', '.']).next().unwrap_or_default();
        let word = word.trim_matches('`');
        let unit = UNITS.iter().find(|(ending, _)| word.ends_with(ending));
        match (FLAGS.iter().find(|(key, _)| *key == word), unit) {
            (Some((key, flag)), Some((_, unit))) if said.starts_with(key) => {
                Error::Usage(format!("{flag}, in {unit},{}", &said[key.len()..]))
            }
            (Some((_, flag)), _) => Error::Usage(format!("{flag}: {said}")),
            (None, _) => Error::Usage(said.to_owned()),
        }
    };
    let text = question.to_string();
    let Request::Ask(question) = Request::parse(text.as_bytes(), &[]).map_err(wrong)? else {
        return Ok(());
    };
    for spec in question.shapes() {
        // The mesh file is beside the daemon's scene file.
        let is_elsewhere = matches!(
            &spec.shape,
            ShapeSpec::Convex { file: Some(_), .. } | ShapeSpec::Trimesh { file: Some(_), .. }
        );
        if !is_elsewhere {
            build(&spec.shape, Path::new("")).map_err(|e| of_shape(&e.to_string()))?;
        }
    }
    Ok(())
}

/// The text of an error without the prefix of its question.
fn bare(why: &str) -> &str {
    let said = KINDS.iter().find_map(|kind| why.strip_prefix(kind));
    said.unwrap_or(why)
}

/// Sends a question and waits for the answer.
///
/// * `named` - the body names in the question, to find an unknown one.
/// * `found` - takes the result out of the answer, if it has one.
pub(super) fn ask<T>(
    question: &Value,
    named: &[&str],
    args: &QueryArgs,
    stop: &AtomicBool,
    found: impl Fn(&mut Answer) -> Option<T>,
) -> Result<(T, Vec<String>)> {
    check(question)?;
    let until_ns = SystemClock.monotonic_ns().saturating_add(args.wait);
    let instance = &args.which.instance;
    let Some(mut client) = connect(instance, None, args.wait, stop)? else {
        return Err(stopped());
    };
    let request = client.ask(&question.to_string(), &[])?;
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
                "the daemon `{instance}` gave no answer within {}; wait longer with --wait, or see `sweepd doctor`",
                time(args.wait)
            )));
        }
    };
    let mut answer: Answer = serde_json::from_str(&text)
        .map_err(|e| Error::io(format!("the daemon's answer cannot be read: {text}"), e))?;
    match found(&mut answer) {
        Some(found) => Ok((found, answer.warnings)),
        None => match answer.error {
            Some(why) if is_of_file(&question["touching"]["shape"], &why) => {
                Err(Error::Usage(format!("--shape: {why}")))
            }
            why => Err(refusal(&mut client, named, why, stop)),
        },
    }
}

/// Whether an error is about a mesh file of a shape, or of one in a list of shapes.
fn is_of_file(shape: &Value, why: &str) -> bool {
    match shape {
        Value::Array(shapes) => shapes.iter().any(|shape| is_of_file(shape, why)),
        shape => shape["file"]
            .as_str()
            .is_some_and(|file| why.contains(file)),
    }
}

/// Prints an answer, as one JSON object or as text.
pub(super) fn tell(
    (args, out): (&QueryArgs, &mut Out),
    as_json: impl FnOnce() -> Value,
    as_text: impl FnOnce() -> String,
) -> Result<bool> {
    if args.json {
        out.line(&as_json().to_string())?;
    } else {
        out.text(&as_text())?;
    }
    out.flush()?;
    Ok(true)
}

fn stopped() -> Error {
    Error::TimedOut("ended by a signal before there was an answer".to_owned())
}

/// The error if there is no result: an unknown or repeated name is the user's mistake, all else the daemon's refusal.
fn refusal(client: &mut Client, asked: &[&str], why: Option<String>, stop: &AtomicBool) -> Error {
    let why = why.unwrap_or_else(|| "the daemon refuses, and does not say why".to_owned());
    let Some(names) = names(client, stop) else {
        return Error::Refused(why);
    };
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let missing = asked.iter().find(|name| !known.contains(name));
    match (missing, asked) {
        (Some(name), _) => Error::Usage(unknown(name, &known)),
        (None, [a, b]) if a == b => Error::Usage(why),
        (None, _) => Error::Refused(why),
    }
}

fn unknown(name: &str, known: &[&str]) -> String {
    let mend = match nearest(name, known) {
        Some(nearest) => format!("did you mean \"{nearest}\"?"),
        None => match known {
            [] => "it has none at all".to_owned(),
            [first, ..] => format!(
                "its {} such as \"{first}\"; `sweepd check SCENE` reads the scene file",
                counted(known.len(), "body has a name", "bodies have names")
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

/// An answer as JSON for users: keys of the tick in place of its header.
pub(super) fn told_json(mut answer: Value, header: &MessageHeader, warnings: &[String]) -> Value {
    if let Value::Object(keys) = &mut answer {
        keys.remove("tick_header");
    }
    answer["boot_id"] = json!(format!("{:016x}", header.boot_id));
    answer["tick"] = json!(header.tick);
    answer["scene_rev"] = json!(header.scene_rev);
    answer["warnings"] = json!(warnings);
    answer
}

/// A result with a verdict as JSON, with the verdict's word in place of the code.
pub(super) fn worded(what: &impl Serialize, verdict: u8) -> Value {
    let mut told = json!(what);
    told["verdict"] = json!(word(verdict));
    told
}

/// Adds lines for bodies of unknown pose, and for the numbers of those left out, by reason.
///
/// * `counts` - numbers, each with its text for one and for many.
pub(super) fn strangers(
    told: &mut Vec<(&str, String)>,
    (unknown, more): (&[UnknownBody], u64),
    counts: &[(u64, [&str; 2])],
) {
    let unknown = unknown.iter();
    told.extend(unknown.map(|it| ("unknown", format!("{} ({})", clean(&it.body), it.status))));
    let counts = counts.iter().copied();
    let more = (more, ["more whose place is not known"; 2]);
    for (count, [one, many]) in [more].into_iter().chain(counts) {
        if count > 0 {
            told.push(("and", counted(count, one, many)));
        }
    }
}

/// The word of a verdict's code.
pub(super) fn word(verdict: u8) -> &'static str {
    Verdict::from_code(verdict).map_or("?", Verdict::word)
}

/// An end of an interval, in metres; `open` if there is none.
pub(super) fn end(value: Option<f64>, open: &str) -> String {
    value.map_or_else(|| open.to_owned(), metres)
}

/// Three coordinates as text.
pub(super) fn triple(values: Option<[f64; 3]>) -> String {
    match values {
        Some([x, y, z]) => format!("{} {} {}", metres(x), metres(y), metres(z)),
        None => "not known".to_owned(),
    }
}

/// One line per label and value, then the warnings.
pub(super) fn lines<'a>(
    told: impl IntoIterator<Item = (&'a str, String)>,
    warnings: &[String],
) -> String {
    let mut text = String::new();
    for (what, value) in told {
        text += &format!("{what:<11} {value}\n");
    }
    for warning in warnings {
        text += &format!("{:<11} {}\n", "warning", clean(warning));
    }
    text
}

/// Replaces control characters, which could move the cursor.
pub(super) fn clean(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_what_is_wrong_with_a_question_is_the_users_and_names_its_flag() {
        for (question, words) in [
            (
                json!({ "impact": { "a": "a", "b": "b", "within_s": 0.0 } }),
                "--impact, in seconds, is 0",
            ),
            (
                json!({ "ray": { "from": [0, 0, 0], "direction": [0, 0, 0] } }),
                "--ray: direction is all 0",
            ),
            (
                json!({ "touching": { "shape": { "type": "sphere", "radius": -1.0 } } }),
                "--shape: radius is -1",
            ),
            (
                json!({ "touching": { "shape": { "type": "convex",
                    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]] } } }),
                "--shape: the hull",
            ),
            (
                json!({ "touching": { "position": [0, 0, 0],
                    "shape": { "type": "sphere", "radius": 1.0, "position": [1e13, 0, 0] } } }),
                "--shape: position holds",
            ),
            (
                json!({ "touching": { "position": [1e13, 0, 0], "shape": { "type": "sphere", "radius": 1.0 } } }),
                "--at: position holds",
            ),
            (
                json!({ "touching": { "shape": [] } }),
                "--shape: `shape` is",
            ),
            (
                json!({ "touching": { "body": "a", "position": [1e13, 0, 0] } }),
                "--at: position holds",
            ),
        ] {
            let error = check(&question).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().starts_with(words), "{error}");
        }
        let good = json!({ "touching": { "shape": { "type": "sphere", "radius": 1.0 } } });
        check(&good).unwrap();
    }

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
}
