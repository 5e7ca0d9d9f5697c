//! `sweepd report` as users and scripts see it: its content, its exit codes, its errors.

use serde_json::Value;

use super::{code, err, head, out};
use crate::live::{Desk, output};

/// Bodies that collide now and then: a mesh, a half-space, a swept one, a deforming one, an attached one.
const MIXED: &str = r#"
[[source]]
name = "left"
[[source]]
name = "right"
[[body]]
name = "floor"
moves = false
shape = { type = "half_space", normal = [0, 0, 1] }
[[body]]
name = "terrain"
moves = false
shape = { type = "height_field", heights = [[0.0, 0.2], [0.1, 0.3]], size = [3.0, 3.0], base_m = 0.5 }
[[body]]
name = "ball"
source = "left"
continuous = true
position = [0.2, 0.0, 0.6]
shape = { type = "sphere", radius = 0.3 }
[[body]]
name = "tool"
attached_to = "ball"
position = [0.0, 0.0, 0.4]
shape = { type = "box", half_extents = [0.1, 0.1, 0.3] }
[[body]]
name = "wedge"
source = "right"
position = [0.0, 0.2, 0.9]
[body.shape]
type = "trimesh"
vertices = [[0, 0, 0], [0.6, 0, 0], [0, 0.6, 0], [0, 0, 0.6]]
faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
[[body]]
name = "cloth"
source = "right"
deforms = true
position = [0.0, 0.0, 0.7]
[body.shape]
type = "trimesh"
vertices = [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]
faces = [[0, 1, 2], [0, 2, 3]]
[[body]]
name = "compound"
source = "left"
position = [0.3, 0.3, 0.5]
[[body.shape]]
type = "capsule"
radius = 0.1
half_height = 0.3
[[body.shape]]
type = "cone"
radius = 0.2
half_height = 0.2
position = [0.2, 0.0, 0.0]
"#;

fn json(args: &[&str]) -> Value {
    let ended = output(args);
    assert_eq!(code(&ended), Some(0), "{args:?} {}", err(&ended));
    serde_json::from_str(&out(&ended)).unwrap()
}

fn scene(desk: &Desk) -> String {
    desk.scene(MIXED).to_str().unwrap().to_owned()
}

#[test]
fn error_against_counted_work_is_the_same_to_the_last_bit_and_falls_with_the_budget() {
    let desk = Desk::new();
    let path = scene(&desk);
    let args = [
        "report",
        "error",
        &path,
        "--ticks",
        "24",
        "--json",
        "--units=0,5,40,none",
    ];
    let ended = output(&args);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert_eq!(ended.stdout, output(&args).stdout, "not the same twice");
    let report: Value = serde_json::from_str(&out(&ended)).unwrap();
    let rows = report["rows"].as_array().unwrap();
    let budgets: Vec<_> = rows.iter().map(|row| row["budget_units"].clone()).collect();
    assert_eq!(budgets, [0.into(), 5.into(), 40.into(), Value::Null]);
    let shares: Vec<f64> = rows
        .iter()
        .map(|row| row["undecided_share"].as_f64().unwrap())
        .collect();
    assert!(
        shares[0] > 0.9 && shares.is_sorted_by(|a, b| a >= b),
        "{shares:?}"
    );
    assert_eq!(shares[3].to_bits(), 0, "without a limit all is decided");
    for row in rows {
        assert_eq!((&row["wrong"], &row["excluded"]), (&0.into(), &0.into()));
        assert!(
            row["time_p50_ns"].is_null(),
            "a time is never the same twice"
        );
        let spent = row["units_max"].as_u64().unwrap();
        assert!(
            row["budget_units"]
                .as_u64()
                .is_none_or(|most| spent <= most + 8),
            "{row}"
        );
    }
    // Another motion gives other figures, so they are measured.
    let other = json(&[&args[..], &["--seed", "2"]].concat());
    assert_ne!(other["rows"], report["rows"]);
    let rest = json(&[&args[..], &["--motion", "rest"]].concat());
    assert_eq!(rest["rows"][3]["onsets"], 0);
}

#[test]
fn bug_rows_that_the_scene_leaves_out_are_held_against_the_truth_too() {
    let desk = Desk::new();
    let path = scene(&desk);
    let cut = desk.write("cut.toml", &format!("{MIXED}\n[limits]\npair_rows = 1\n"));
    // The scene may come before or after its flags.
    let of = |path: &str| {
        json(&[
            "report", "error", "--ticks", "24", "--json", "--units", path,
        ])
    };
    let (whole, cut) = (of(&path), of(cut.to_str().unwrap()));
    let told = whole["rows"].as_array().unwrap().last().unwrap();
    assert!(told["colliding"].as_f64() > Some(1.0), "{told}");
    assert_eq!(cut["rows"], whole["rows"]);
}

#[test]
fn error_against_time_has_a_row_a_budget_a_table_and_a_page() {
    let desk = Desk::new();
    let path = scene(&desk);
    let page = desk.dir.join("page.html");
    let page_name = page.to_str().unwrap();
    let ended = output(&[
        "report",
        "error",
        &path,
        "--ticks",
        "12",
        "--budgets",
        "1s,20us,none",
        "--html",
        page_name,
    ]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert!(
        text.contains("20.0 us") && text.contains("1000.00 ms") && text.contains("no limit"),
        "{text}"
    );
    // Infinite widths are excluded from the means and counted separately.
    assert!(text.contains("endless"), "bug: {text}");
    assert!(
        text.contains("0 verdicts are wrong, 0 intervals exclude the truth"),
        "{text}"
    );
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("endless</th>"));
    assert!(html.matches("<svg").count() >= 5 && html.ends_with("</html>\n"));
    assert!(
        !html.contains("http") && !html.contains("<script"),
        "it needs nothing but itself"
    );
    let report = json(&["report", "error", &path, "--ticks", "8", "--json"]);
    let rows = report["rows"].as_array().unwrap();
    assert!(rows.len() > 4 && rows.iter().all(|row| row["time_p50_ns"].as_u64() > Some(0)));
}

#[test]
fn a_scene_that_is_decided_at_every_budget_says_so_and_one_without_pairs_too() {
    let desk = Desk::new();
    let path = scene(&desk);
    let report = json(&[
        "report",
        "error",
        &path,
        "--ticks",
        "6",
        "--json",
        "--units=100000,none",
    ]);
    assert_eq!(report["decided_everywhere"], true);
    assert!(
        report["summary"]
            .as_str()
            .unwrap()
            .contains("100000 units is enough"),
        "{report}"
    );
    let alone = desk.write("alone.toml", "[[source]]\nname = \"s\"\n[[body]]\nname = \"a\"\nshape = { type = \"sphere\", radius = 1.0 }\n");
    let report = json(&[
        "report",
        "error",
        alone.to_str().unwrap(),
        "--ticks",
        "6",
        "--json",
        "--units",
    ]);
    assert!(
        report["summary"]
            .as_str()
            .unwrap()
            .contains("nothing to decide"),
        "{report}"
    );
}

#[test]
fn stability_holds_the_truth_in_every_family_and_tells_all_points() {
    let report = json(&["report", "stability", "--json"]);
    let families = report["families"].as_array().unwrap();
    assert!(families.len() >= 15);
    assert_eq!(
        (&report["excluded"], &report["wrong"]),
        (&0.into(), &0.into())
    );
    for family in families {
        let (points, summary) = (family["points"].as_array().unwrap(), &family["summary"]);
        assert_eq!(summary["cases"], points.len());
        let values: Vec<f64> = points
            .iter()
            .map(|p| p["value"].as_f64().unwrap())
            .collect();
        let (low, high) = values
            .iter()
            .fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(
            high >= 1e4 * low,
            "{}: a sweep over decades",
            family["family"]
        );
        assert_eq!(
            summary["changes"], summary["changes_true"],
            "{}: chatter",
            family["family"]
        );
        assert_eq!(summary["open"], 0, "{}", family["family"]);
    }
    let of = |name: &str| families.iter().find(|f| f["family"] == name).unwrap();
    assert!(of("vibration")["summary"]["changes_true"].as_u64() > Some(100));
    assert!(
        of("scale")["summary"]["raw_wrong"].as_u64() > Some(0),
        "plain parry is beside it"
    );
}

#[test]
fn one_family_has_a_table_a_page_and_its_own_line() {
    let desk = Desk::new();
    let page = desk.dir.join("page.html");
    let ended = output(&[
        "report",
        "stability",
        "--family",
        "bullet",
        "--family",
        "nested",
        "--html",
        page.to_str().unwrap(),
    ]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert!(
        text.contains("bullet") && text.contains("nested") && !text.contains("vibration"),
        "{text}"
    );
    // The output explains why some values differ by more than the tolerance although nothing is wrong.
    let mut nested = text.lines().filter(|line| line.starts_with("nested"));
    let why = " beyond the tolerance have a proved interval and no estimate";
    assert!(nested.next_back().unwrap().contains(why), "{text}");
    let html = std::fs::read_to_string(&page).unwrap();
    assert_eq!(html.matches("<svg").count(), 2);
    let list = out(&output(&["report", "stability", "--list"]));
    assert!(
        list.contains("far_origin") && list.contains("rad"),
        "{list}"
    );
}

#[test]
fn bug_who_reads_no_table_got_no_page_either() {
    let desk = Desk::new();
    let path = scene(&desk);
    let page = desk.dir.join("page.html");
    let html = ["--html", page.to_str().unwrap()];
    for args in [
        &["stability", "--family", "bullet"][..],
        &["error", &path, "--ticks", "4", "--budgets", "none"],
    ] {
        let ended = head(&[&["report"], args, &html].concat(), 0);
        assert_eq!(code(&ended), Some(0), "{args:?} {}", err(&ended));
        let text = std::fs::read_to_string(&page).unwrap();
        assert!(text.ends_with("</html>\n"), "{args:?}");
        std::fs::remove_file(&page).unwrap();
    }
}

#[test]
fn what_cannot_be_meant_is_refused_with_what_to_change() {
    let desk = Desk::new();
    let path = scene(&desk);
    let nowhere = desk.dir.join("no/such/page.html");
    let nowhere = nowhere.to_str().unwrap();
    let bad: [(&[&str], &str); 8] = [
        (&["stability", "--family", "fast"], "--list"),
        (&["error", &path, "--budgets", "5"], "such as 2ms"),
        (&["error", &path, "--units=many"], "whole number"),
        (
            &["error", &path, "--units=1", "--budgets", "1ms"],
            "cannot be used with",
        ),
        (&["error", &path, "--ticks", "0"], "from 1 to 1000000"),
        (&["error", &path, "--rate", "nan"], "frames per second"),
        (&["error", &path, "--html", &path], "this is the scene file"),
        (&["error", "missing.toml"], "missing.toml"),
    ];
    let text = std::fs::read(&path).unwrap();
    for (args, wanted) in bad {
        let ended = output(&[&["report"], args].concat());
        assert_eq!(code(&ended), Some(2), "{args:?} {}", err(&ended));
        assert!(err(&ended).contains(wanted), "{args:?}: {}", err(&ended));
        assert!(ended.stdout.is_empty(), "{args:?}");
    }
    assert_eq!(std::fs::read(&path).unwrap(), text);
    // Like every command, it reports a file that it cannot write, here before minutes of work.
    for args in [&["stability", "--family", "gap"][..], &["error", &path]] {
        let ended = output(&[&["report"], args, &["--html", nowhere]].concat());
        assert_eq!(code(&ended), Some(4), "{args:?} {}", err(&ended));
        let told = err(&ended);
        assert!(told.contains("folder that exists"), "{args:?}: {told}");
    }
    assert_eq!(code(&output(&["report"])), Some(2));
    for command in ["error", "stability"] {
        let help = ["report", command, "--help"];
        let ended = output(&help);
        assert_eq!(code(&ended), Some(0), "{help:?}");
        assert!(out(&ended).contains("code 1"), "{help:?} {}", out(&ended));
    }
}
