//! Scores the public narrow-phase cases through `sweepd query --batch`, by the rules published with them.
//!
//! Truth: 50-digit arithmetic with certified bounds. Checked: sign, error per class, angle, interval and width.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::float_cmp,
    reason = "a test"
)]

use std::collections::BTreeMap;

use serde_json::Value;

const CASES: &str = include_str!("data/cases_public.jsonl");
const CASES_FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/cases_public.jsonl");

fn number(v: &Value, key: &str) -> f64 {
    v[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} of {}", v["id"]))
}

fn vector(v: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| v[k].as_f64().unwrap())
}

/// Measurements of one class.
#[derive(Default)]
struct Class {
    errors: Vec<f64>,
    widths: Vec<f64>,
    angles: Vec<f64>,
    misses: Vec<String>,
    wrong_signs: Vec<String>,
}

fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    if sorted.is_empty() {
        return 0.0;
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small"
    )]
    let place = ((sorted.len() as f64 * q).ceil() as usize).clamp(1, sorted.len()) - 1;
    sorted[place]
}

fn score(cases: &str) -> BTreeMap<String, Class> {
    let ended = std::process::Command::new(env!("CARGO_BIN_EXE_sweepd"))
        .args(["query", "--batch", CASES_FILE])
        .output()
        .unwrap();
    assert!(ended.status.success(), "every case can be read");
    assert!(ended.stderr.is_empty());
    let answers: Vec<Value> = String::from_utf8(ended.stdout)
        .unwrap()
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    let mut classes: BTreeMap<String, Class> = BTreeMap::new();
    let mut count = 0;
    for (line, answer) in cases.lines().filter(|l| !l.trim().is_empty()).zip(&answers) {
        let case: Value = serde_json::from_str(line).unwrap();
        assert_eq!(case["id"], answer["id"]);
        count += 1;
        let class = classes
            .entry(case["tolerance_class"].as_str().unwrap().to_owned())
            .or_default();
        score_case(&case, answer, class);
    }
    assert_eq!(count, answers.len());
    classes
}

fn score_case(case: &Value, answer: &Value, class: &mut Class) {
    let id = case["id"].as_str().unwrap().to_owned();
    let size = number(case, "length_scale");
    let overlapping = case["overlapping"].as_bool().unwrap();
    let touching = case["touching"].as_bool().unwrap();
    let (low, high) = (number(answer, "gap_min_m"), number(answer, "gap_max_m"));
    assert!(low <= high && low.is_finite() && high.is_finite(), "{id}");
    for key in ["normal", "point_a", "point_b", "point_a_rel", "point_b_rel"] {
        assert!(
            vector(&answer[key]).iter().all(|v| v.is_finite()),
            "{id} {key}"
        );
    }
    let Some(truth) = case["signed_distance"].as_f64() else {
        if answer["colliding"] != overlapping
            || low > 0.0
            || high != 0.0
            || !answer["gap_m"].is_null()
        {
            class.wrong_signs.push(id);
        }
        return;
    };
    let got = number(answer, "gap_m");
    let (b0, b1) = (vector2(&case["bounds"]).0, vector2(&case["bounds"]).1);
    let error = (b0 - got).max(got - b1).max(0.0) / size.max(truth.abs());
    class.errors.push(error);
    class.widths.push((high - low) / size);
    if truth.abs() > 1e-5 * size && !touching {
        let wrong = (got < 0.0) != overlapping || answer["colliding"] != overlapping;
        if wrong {
            class.wrong_signs.push(id.clone());
        }
    }
    if !(low <= b1 && b0 <= high) {
        class
            .misses
            .push(format!("{id}: [{low:e}, {high:e}] misses [{b0:e}, {b1:e}]"));
    }
    let mut angle = 0.0;
    if !case["normal"].is_null() && truth.abs() > 1e-6 * size {
        let (n, m) = (vector(&case["normal"]), vector(&answer["normal"]));
        let d = [0, 1, 2].map(|k| n[k] - m[k]);
        angle = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            .sqrt()
            .to_degrees();
        class.angles.push(angle);
    }
    if error > 1e-9 || (high - low) / size > 1e-8 || angle > 0.01 {
        println!(
            "{id:32} truth {truth:+.6e} e {error:.1e} width {:.1e} angle {angle:.1e} ({} {})",
            (high - low) / size,
            case["a"]["type"],
            case["b"]["type"]
        );
    }
}

fn vector2(v: &Value) -> (f64, f64) {
    (v[0].as_f64().unwrap(), v[1].as_f64().unwrap())
}

#[test]
fn the_public_cases_are_answered_as_well_as_is_wanted() {
    let classes = score(CASES);
    println!(
        "class   n   e p50     e p95     e max     width p95 width max angle max  signs misses"
    );
    for (name, c) in &classes {
        println!(
            "{name:5} {:4}  {:.1e}   {:.1e}   {:.1e}   {:.1e}   {:.1e}   {:.1e}   {:3} {:3}",
            c.errors.len(),
            quantile(&c.errors, 0.5),
            quantile(&c.errors, 0.95),
            quantile(&c.errors, 1.0),
            quantile(&c.widths, 0.95),
            quantile(&c.widths, 1.0),
            quantile(&c.angles, 1.0),
            c.wrong_signs.len(),
            c.misses.len(),
        );
    }
    for (name, c) in &classes {
        assert!(c.wrong_signs.is_empty(), "{name}: {:?}", c.wrong_signs);
        assert!(c.misses.is_empty(), "{name}: {:?}", c.misses);
    }
    let (a, b) = (&classes["A"], &classes["B"]);
    assert!(quantile(&a.errors, 0.95) <= 1e-12 && quantile(&a.errors, 1.0) <= 1e-9);
    assert!(quantile(&b.errors, 0.95) <= 1e-10 && quantile(&b.errors, 1.0) <= 1e-7);
    assert!(quantile(&a.widths, 0.95) <= 1e-8);
    assert!(quantile(&b.widths, 0.95) <= 1e-6);
}
