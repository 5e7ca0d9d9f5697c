//! `sweepd query --batch`: shape-pair cases in, gaps out, one line of JSON each; no engine, no admission.
//!
//! In: JSON Lines with `id`, `a`, `b` (shapes), `pose_a`, `pose_b` (`t` in metres, `q` = w, x, y, z, any finite length
//! but 0); other keys are ignored. A `trimesh` is a surface (law 3.3), one with `solid: true` a solid. Out: one answer
//! per line in the order of the input, or `{id, error}`.

mod pieces;
mod solids;

use std::io::{BufRead, ErrorKind, Read, Write};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{Error, Result, nearest};
use crate::limits::REQUEST_BYTES_MAX;
use crate::math::{Point, Pose, Vec3, pose_from, relative};
use crate::narrow::exact::Closest;
use crate::shape::ShapeSpec;

use pieces::{Kind, Pieces, gap};
use solids::Known;

/// The parts of a case.
const PARTS: [&str; 5] = ["id", "a", "b", "pose_a", "pose_b"];

/// A case as written.
struct Case {
    a: ShapeSpec,
    b: ShapeSpec,
    pose_a: Placed,
    pose_b: Placed,
}

/// A pose as written; the quaternion's real part comes first.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Placed {
    t: [f64; 3],
    q: [f64; 4],
}

/// An answer; metres, world frame, points also relative to `pose_a.t`.
#[derive(Serialize)]
struct Answer {
    id: Value,
    /// `null` if a mesh surface is crossed; for a solid mesh that overlaps, an estimate or `null`.
    gap_m: Option<f64>,
    gap_min_m: f64,
    gap_max_m: f64,
    normal: [f64; 3],
    point_a: [f64; 3],
    point_b: [f64; 3],
    point_a_rel: [f64; 3],
    point_b_rel: [f64; 3],
    colliding: bool,
}

/// The output for a line that cannot be answered.
#[derive(Serialize)]
struct Refusal {
    id: Value,
    error: String,
}

/// Answers every line of `input`.
///
/// * returns - whether every line could be read; `false` asks for exit code 1.
///
/// # Errors
/// `Io` when `input` cannot be read or `output` not be written; a closed pipe on `output` is a normal end.
pub fn run(mut input: impl BufRead, output: &mut dyn Write) -> Result<bool> {
    let mut all_read = true;
    let mut line = Vec::new();
    for number in 1_u64.. {
        line.clear();
        let taken = read_line(&mut input, &mut line)
            .map_err(|e| Error::io(format!("cannot read line {number} of the cases"), e))?;
        let Some(whole) = taken else {
            break;
        };
        let text = match number {
            1 => line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&line),
            _ => &line,
        };
        let text = text.trim_ascii();
        if text.is_empty() && whole {
            continue;
        }
        let answered = if whole {
            answer_line(text)
        } else {
            Err((
                Value::Null,
                format!("it is longer than {REQUEST_BYTES_MAX} bytes"),
            ))
        };
        let written = match answered {
            Ok(answer) => write_line(output, &answer),
            Err((id, why)) => {
                all_read = false;
                let error = format!("line {number}: {why}");
                write_line(output, &Refusal { id, error })
            }
        };
        match written {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => return Ok(all_read),
            other => other.map_err(|e| Error::io("cannot write the answers", e))?,
        }
    }
    match output.flush() {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(all_read),
        Err(e) => Err(Error::io("cannot write the answers", e)),
        Ok(()) => Ok(all_read),
    }
}

/// Reads one line into `line`: `None` at the end, `Some(false)` if it was too long to keep.
fn read_line(input: &mut impl BufRead, line: &mut Vec<u8>) -> std::io::Result<Option<bool>> {
    let limit = REQUEST_BYTES_MAX as u64 + 1;
    if input.by_ref().take(limit).read_until(b'\n', line)? == 0 {
        return Ok(None);
    }
    if line.len() <= REQUEST_BYTES_MAX || line.ends_with(b"\n") {
        return Ok(Some(true));
    }
    while !line.ends_with(b"\n") {
        line.clear();
        if input.by_ref().take(1 << 20).read_until(b'\n', line)? == 0 {
            break;
        }
    }
    Ok(Some(false))
}

fn write_line(output: &mut dyn Write, row: &impl Serialize) -> std::io::Result<()> {
    serde_json::to_writer(&mut *output, row)?;
    output.write_all(b"\n")
}

/// The answer to one line, or its id and the error.
fn answer_line(text: &[u8]) -> std::result::Result<Answer, (Value, String)> {
    let mut value: Value = serde_json::from_slice(text).map_err(|e| (Value::Null, not_json(&e)))?;
    let id = value.get_mut("id").map_or(Value::Null, Value::take);
    match Case::read(&value).and_then(|case| answer(&case)) {
        Ok(answer) => Ok(Answer { id, ..answer }),
        Err(why) => Err((id, why)),
    }
}

/// Where it ends to be JSON: the line is that of the file, which is told before.
fn not_json(e: &serde_json::Error) -> String {
    let why = e.to_string();
    format!(
        "not JSON: {}",
        why.replace(" at line 1 column", " at column")
    )
}

fn answer(case: &Case) -> std::result::Result<Answer, String> {
    let pose_a = case.pose_a.read("pose_a")?;
    let pose_b = case.pose_b.read("pose_b")?;
    let a = Pieces::build(&case.a).map_err(|e| format!("a: {e}"))?;
    let b = Pieces::build(&case.b).map_err(|e| format!("b: {e}"))?;
    let pos12 = relative(&pose_a, &pose_b);
    // By brute force: seconds, for two meshes of many triangles.
    let surfaces = || gap(&a, &b, &pos12);
    if let Some(known) = solids::gap((&case.a, &case.b), &pos12, surfaces)? {
        return Ok(of_solids(&known, &pose_a));
    }
    let closest = surfaces()?;
    let surface = a.kind == Kind::Surface || b.kind == Kind::Surface;
    Ok(shown(&closest, &pose_a, surface))
}

/// As a daemon answers for two bodies.
fn of_solids(known: &Known, pose_a: &Pose) -> Answer {
    let places = (known.normal, known.point_a, known.point_b);
    Answer {
        gap_m: known.best_m,
        gap_min_m: known.gap.min,
        gap_max_m: known.gap.max,
        colliding: known.collides,
        ..placed(places, pose_a)
    }
}

/// The answer from pieces.
fn shown(closest: &Closest, pose_a: &Pose, surface: bool) -> Answer {
    let crossed = surface && closest.gap.max < 0.0;
    let places = (closest.normal, closest.point_a, closest.point_b);
    Answer {
        gap_m: (!crossed).then_some(closest.best_m),
        gap_min_m: closest.gap.min,
        gap_max_m: if crossed { 0.0 } else { closest.gap.max },
        colliding: closest.collides(),
        ..placed(places, pose_a)
    }
}

/// Normal and points, from A's frame to the world's.
fn placed((normal, point_a, point_b): (Vec3, Point, Point), pose_a: &Pose) -> Answer {
    let turned = |v: &Vec3| pose_a.rotation * v;
    let (a, b) = (turned(&point_a.coords), turned(&point_b.coords));
    let at = &pose_a.translation.vector;
    Answer {
        id: Value::Null,
        gap_m: None,
        gap_min_m: f64::NEG_INFINITY,
        gap_max_m: f64::INFINITY,
        normal: turned(&normal).into(),
        point_a: (a + at).into(),
        point_b: (b + at).into(),
        point_a_rel: a.into(),
        point_b_rel: b.into(),
        colliding: false,
    }
}

impl Case {
    /// Part by part, so that an error names its part.
    fn read(line: &Value) -> std::result::Result<Self, String> {
        let Value::Object(parts) = line else {
            return Err("it is no object: write {\"id\": .., \"a\": .., \"b\": .., \"pose_a\": .., \"pose_b\": ..}".to_owned());
        };
        Ok(Self {
            a: part(parts, "a")?,
            b: part(parts, "b")?,
            pose_a: part(parts, "pose_a")?,
            pose_b: part(parts, "pose_b")?,
        })
    }
}

/// One part of a case.
fn part<'a, T: Deserialize<'a>>(
    parts: &'a Map<String, Value>,
    key: &str,
) -> std::result::Result<T, String> {
    let Some(value) = parts.get(key) else {
        let others = parts.keys().map(String::as_str);
        let others: Vec<&str> = others.filter(|other| !PARTS.contains(other)).collect();
        let meant = nearest(key, &others);
        let meant = meant.map_or(String::new(), |other| format!("; is `{other}` meant?"));
        return Err(format!("it has no `{key}`{meant}"));
    };
    T::deserialize(value).map_err(|e| format!("{key}: {e}"))
}

impl Placed {
    fn read(&self, what: &str) -> std::result::Result<Pose, String> {
        let [w, x, y, z] = self.q;
        pose_from(self.t, [x, y, z, w]).ok_or_else(|| {
            format!(
                "{what} is not a pose: write finite numbers, and a `q` (w, x, y, z) that is not 0"
            )
        })
    }
}
