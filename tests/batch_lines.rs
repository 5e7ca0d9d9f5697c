//! `query --batch` and the exact queries on bad input, and on pairs for which parry's results are wrong.
//!
//! The failures listed here were measured on parry3d-f64 0.31.1 `contact`; each has a closed-form truth.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test"
)]

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};
use sweepd::math::{Point, Pose, Quat, Vec3};
use sweepd::narrow::exact::{Closest, Warm, convex_gap, gap_to_half_space, half_space_gap};
use sweepd::narrow::gap_between;
use sweepd::shape::{Convex, ShapeSpec, build};
use sweepd::time::{Meter, SystemClock};
use sweepd::wire::Verdict;
use sweepd::world::{Body, Parts, PlacedShape};

fn ask(text: &[u8]) -> (bool, Vec<Value>) {
    let mut out = Vec::new();
    let whole = sweepd::query::batch::run(text, &mut out).unwrap();
    let lines = String::from_utf8(out).unwrap();
    (
        whole,
        lines
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect(),
    )
}

fn line(id: &str, a: &Value, b: &Value, t: [f64; 3]) -> String {
    json!({
        "id": id, "a": a, "b": b,
        "pose_a": {"t": [0.0, 0.0, 0.0], "q": [1.0, 0.0, 0.0, 0.0]},
        "pose_b": {"t": t, "q": [2.0, 0.0, 0.0, 0.0]},
    })
    .to_string()
}

fn gap(a: &Convex, b: &Convex, at: Vec3) -> Closest {
    let pose = Pose::from_parts(at.into(), Quat::identity());
    convex_gap(a, b, &pose, &mut Warm::default())
}

fn assert_gap(c: &Closest, truth: f64, size: f64) {
    assert!(c.gap.contains(truth), "{c:?} misses {truth:e}");
    assert!(
        (c.best_m - truth).abs() <= 1e-12 * size,
        "{c:?} for {truth:e}"
    );
    assert!(c.gap.width() <= 1e-6 * size, "{c:?}");
}

#[test]
fn bug_coincident_boxes_and_capsules_are_as_deep_as_they_are() {
    let cuboid = Convex::cuboid(Vec3::new(0.6, 0.52, 0.7));
    assert_gap(&gap(&cuboid, &cuboid, Vec3::zeros()), -1.04, 1.0);
    let capsule = Convex::capsule(0.505, 0.4);
    assert_gap(&gap(&capsule, &capsule, Vec3::zeros()), -1.01, 1.0);
    let sphere = Convex::sphere(0.5);
    assert_gap(&gap(&sphere, &sphere, Vec3::zeros()), -1.0, 1.0);
    let cylinder = Convex::cylinder(0.3, 0.4);
    assert_gap(&gap(&cylinder, &cylinder, Vec3::zeros()), -0.6, 1.0);
    let cone = Convex::cone(0.5, 0.1);
    assert_gap(&gap(&cone, &cone, Vec3::zeros()), -0.2, 1.0);
}

#[test]
fn bug_micrometre_shapes_have_the_gap_of_metre_shapes_scaled() {
    for s in [1e-9, 1e-6, 1e-3, 1.0, 1e6] {
        let cuboid = Convex::cuboid(Vec3::new(s, 2.0 * s, 3.0 * s));
        let c = gap(&cuboid, &cuboid, Vec3::new(2.5 * s, 0.3 * s, 0.2 * s));
        assert_gap(&c, 0.5 * s, s);
        let cylinder = Convex::cylinder(s, s);
        assert_gap(
            &gap(&cylinder, &cylinder, Vec3::new(0.0, 2.001 * s, 0.0)),
            0.001 * s,
            s,
        );
        let cone = Convex::cone(s, s);
        assert_gap(
            &gap(&cone, &cuboid, Vec3::new(0.0, 0.0, 3.9 * s)),
            -0.1 * s,
            s,
        );
    }
}

#[test]
fn bug_thin_coaxial_discs_are_apart_by_what_is_between_them() {
    let disc = Convex::cylinder(1.0, 1e-4);
    assert_gap(
        &gap(&disc, &disc, Vec3::new(0.0, 0.0, 2e-4 + 1e-6)),
        1e-6,
        1.0,
    );
    assert_gap(
        &gap(&disc, &disc, Vec3::new(0.1, 0.0, 2e-4 - 1e-6)),
        -1e-6,
        1.0,
    );
}

#[test]
fn bug_a_thin_hull_keeps_its_corners() {
    let mut points = Vec::new();
    for (x, y, z) in [
        (0., 0., 1.),
        (1., 0., -1.),
        (1., 1., 1.),
        (0., 1., -1.),
        (0.5, 0.5, 2.),
    ] {
        points.push(Point::new(x, y, z * 1e-6));
    }
    let hull = Convex::hull(&points).unwrap();
    let ball = Convex::sphere(0.5);
    assert_gap(
        &gap(&hull, &ball, Vec3::new(0.5, 0.5, 0.5 + 3e-6)),
        1e-6,
        1.0,
    );
}

#[test]
fn a_half_space_is_met_by_the_deepest_point_in_either_order() {
    let cone = Convex::cone(0.5, 0.25);
    let turned = Quat::from_axis_angle(&Vec3::x_axis(), 0.2);
    let pose = Pose::from_parts(Vec3::new(3.0, -2.0, 0.4).into(), turned);
    let one = half_space_gap(&Vec3::z(), 0.1, &cone, &pose);
    let deepest = 0.4 - 0.25 * 0.2_f64.cos() - 0.5 * 0.2_f64.sin();
    assert_gap(&one, deepest - 0.1, 1.0);
    let other = gap_to_half_space(&cone, &Vec3::z(), 0.1, &pose.inverse());
    assert_gap(&other, deepest - 0.1, 1.0);
    let normal = pose.rotation * other.normal;
    assert!((normal + one.normal).norm() < 1e-12, "A to B, mirrored");
}

#[test]
fn swapping_a_pair_or_asking_it_again_warm_leaves_its_gap() {
    let shapes = [
        Convex::cuboid(Vec3::new(0.3, 0.5, 0.7)),
        Convex::cone(0.4, 0.6),
        Convex::cylinder(0.5, 0.2),
        Convex::capsule(0.2, 0.5),
    ];
    for (i, a) in shapes.iter().enumerate() {
        for (j, b) in shapes.iter().enumerate() {
            for k in 0..20_u32 {
                let x = f64::from(k);
                let turn = Quat::from_euler_angles(x, 2.0 * x, 3.0 * x);
                let at = Vec3::new(x.sin(), x.cos(), (1.7 * x).sin()) * (0.2 + 0.08 * x);
                let pose = Pose::from_parts(at.into(), turn);
                let one = convex_gap(a, b, &pose, &mut Warm::default());
                let back = convex_gap(b, a, &pose.inverse(), &mut Warm::default());
                assert!(
                    (one.best_m - back.best_m).abs() < 1e-7,
                    "{i} {j} {k}: {one:?} {back:?}"
                );
                let mut warm = Warm::default();
                let _ = convex_gap(a, b, &pose, &mut warm);
                let again = convex_gap(a, b, &pose, &mut warm);
                assert!((one.best_m - again.best_m).abs() < 1e-7, "{i} {j} {k}");
            }
        }
    }
}

#[test]
fn a_line_that_cannot_be_read_gets_an_error_and_the_others_an_answer() {
    let ball = json!({"type": "sphere", "radius": 1.0});
    let mut text = String::from("\u{feff}");
    let good = line("good \u{1f980}", &ball, &ball, [3.0, 0.0, 0.0]);
    let _ = write!(text, "{good}\r\n\r\n   \n");
    let bad_shapes = [
        json!({"type": "sphere", "radius": -1.0}),
        json!({"type": "sphere", "radius": null}),
        json!({"type": "sphere"}),
        json!({"type": "blob"}),
        json!({"type": "convex", "vertices": []}),
        json!({"type": "trimesh", "vertices": [[0.0, 0.0, 0.0]], "faces": []}),
        json!({"type": "trimesh", "vertices": [[0.0, 0.0, 0.0]], "faces": [[0, 1, 2]]}),
        json!({"type": "box", "half_extents": [1.0, 0.0, 1.0]}),
        json!({"type": "half_space", "normal": [0.0, 0.0, 0.0]}),
        json!({"type": "convex", "file": "/etc/passwd"}),
        json!(7),
    ];
    for (k, bad) in bad_shapes.iter().enumerate() {
        let _ = writeln!(text, "{}", line(&format!("bad {k}"), &ball, bad, [0.0; 3]));
    }
    let deep = "[".repeat(5000);
    let _ = writeln!(text, "{deep}\nnot json\n{{\"id\": 1e999}}\n{{}}\n[1]");
    let zero = good.replace("[2.0,0.0,0.0,0.0]", "[0.0,0.0,0.0,0.0]");
    assert_ne!(zero, good);
    let _ = writeln!(text, "{zero}");
    let mut bytes = text.into_bytes();
    bytes.extend_from_slice(b"\xff\xfe\x00\n");
    bytes.extend_from_slice(good.as_bytes());
    let (whole, answers) = ask(&bytes);
    assert!(!whole);
    assert_eq!(answers.len(), 1 + bad_shapes.len() + 5 + 1 + 1 + 1);
    for (k, answer) in answers.iter().enumerate() {
        let first_or_last = k == 0 || k + 1 == answers.len();
        if first_or_last {
            assert_eq!(answer["id"], "good \u{1f980}");
            assert!((answer["gap_m"].as_f64().unwrap() - 1.0).abs() < 1e-14);
            assert_eq!(answer["colliding"], false);
        } else {
            assert!(
                answer["error"]
                    .as_str()
                    .is_some_and(|e| e.starts_with("line ")),
                "{answer}"
            );
            assert_eq!(answer.as_object().unwrap().len(), 2, "{answer}");
        }
        if (1..=bad_shapes.len()).contains(&k) {
            assert_eq!(answer["id"], format!("bad {}", k - 1));
        }
    }
}

#[test]
fn a_crossing_mesh_surface_has_no_gap_and_a_surface_around_a_ball_is_apart() {
    let mesh = cube(2.0, None);
    let ball = json!({"type": "sphere", "radius": 1.0});
    let floor = json!({"type": "half_space", "normal": [0.0, 0.0, 2.0], "offset": -2.5});
    let text = [
        line("inside", &mesh, &ball, [0.0, 0.0, 0.5]),
        line("crossing", &mesh, &ball, [0.0, 0.0, 1.5]),
        line("meshes", &mesh, &mesh, [0.1, 0.2, 0.3]),
        line("meshes apart", &mesh, &mesh, [0.0, 4.5, 0.0]),
        line("floor", &mesh, &floor, [0.0, 0.0, 0.0]),
    ]
    .join("\n");
    let (whole, answers) = ask(text.as_bytes());
    assert!(whole);
    let gaps: Vec<Option<f64>> = answers.iter().map(|a| a["gap_m"].as_f64()).collect();
    let near = |k: usize, truth: f64| (gaps[k].unwrap() - truth).abs() < 1e-12;
    assert!(near(0, 0.5) && near(3, 0.5) && near(4, 0.5), "{answers:?}");
    for k in [1, 2] {
        assert_eq!(gaps[k], None);
        assert_eq!(answers[k]["colliding"], true);
        assert_eq!(answers[k]["gap_max_m"], 0.0);
        assert!(answers[k]["gap_min_m"].as_f64().unwrap() < 0.0);
    }
}

#[test]
fn bug_what_is_too_far_to_compute_with_is_refused_by_id_and_no_answer() {
    let ball = json!({"type": "sphere", "radius": 1.0});
    let block = json!({"type": "box", "half_extents": [1.0, 1.0, 1.0]});
    let ground = json!({"type": "half_space", "normal": [0.0, 0.0, 1.0], "offset": 0.0});
    let tile = json!({
        "type": "trimesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "faces": [[0, 1, 2], [1, 3, 2]],
    });
    let mut text = String::new();
    for (id, a, b, t) in [
        ("balls", &ball, &ball, [1e160, 0.0, 0.0]),
        ("ground", &ground, &block, [0.0, 0.0, 2e200]),
        ("block", &block, &ground, [0.0, 0.0, -2e200]),
        ("tile", &tile, &ball, [1e200, 0.0, 0.0]),
        ("far", &ball, &ball, [1e150, 0.0, 0.0]),
    ] {
        text += &line(id, a, b, t);
        text.push('\n');
    }
    let (whole, answers) = ask(text.as_bytes());
    assert!(!whole);
    for answer in &answers[..4] {
        let error = answer["error"].as_str().unwrap();
        assert!(
            error.contains("too far") && answer.get("gap_m").is_none(),
            "{answer}"
        );
    }
    assert_eq!(answers[0]["id"], "balls");
    // A distance whose square is finite has an answer.
    assert_eq!(answers[4]["gap_m"], 1e150);
}

#[test]
fn bug_a_plate_with_numbers_too_small_for_their_products_keeps_its_corners() {
    let ball = json!({"type": "sphere", "radius": 1e-3});
    for (radius, count, z) in [
        (0.3, 64, 15e-324),
        (1.0, 64, 5e-324),
        (1.0, 64, 1e-320),
        (0.5, 4000, 1e-318),
        (0.5, 64, 1e-100),
    ] {
        let around = |k: u32| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(count)).sin_cos();
            [radius * cos, radius * sin, 0.0]
        };
        let mut vertices: Vec<[f64; 3]> = (0..count).map(around).collect();
        vertices.push([0.0, 0.0, z]);
        let plate = json!({"type": "convex", "vertices": vertices});
        let each = vertices.iter().step_by(vertices.len() / 64);
        let text: Vec<String> = each.map(|at| line("corner", &plate, &ball, *at)).collect();
        let (whole, answers) = ask(text.join("\n").as_bytes());
        assert!(whole);
        for answer in &answers {
            assert_eq!(answer["colliding"], true, "{radius} {z:e}: {answer}");
        }
    }
}

#[test]
fn bug_flat_hulls_of_many_points_are_answered_by_their_corners() {
    let cells = (0..70).flat_map(|x| (0..70).map(move |y| [f64::from(x), f64::from(y), 0.0]));
    let grid: Vec<[f64; 3]> = cells.collect();
    let along: Vec<[f64; 3]> = (0..5000).map(|x| [f64::from(x), 0.0, 0.0]).collect();
    let ball = json!({"type": "sphere", "radius": 1.0});
    let hull = |vertices: &[[f64; 3]]| json!({"type": "convex", "vertices": vertices});
    let text = [
        line("grid", &hull(&grid), &ball, [33.3, 44.4, 1.5]),
        line("beside", &hull(&grid), &ball, [33.3, 71.0, 0.0]),
        line("line", &hull(&along), &ball, [77.7, 0.0, 1.5]),
    ];
    let (whole, answers) = ask(text.join("\n").as_bytes());
    assert!(whole, "{answers:?}");
    for (answer, truth) in answers.iter().zip([0.5, 1.0, 0.5]) {
        let gap_m = answer["gap_m"].as_f64().unwrap();
        assert!((gap_m - truth).abs() < 1e-12, "{answer}");
    }
}

#[test]
fn bug_what_is_too_small_for_its_squares_is_refused_or_allowed_for() {
    let tiny = |side: f64| json!([[0.0, 0.0, 0.0], [side, 0.0, 0.0], [0.0, side, 0.0]]);
    let ball = json!({"type": "sphere", "radius": 1.0});
    let mut text = String::new();
    for side in [1e-200, 1e-30, 0.9e-9] {
        let triangle = json!({"type": "triangle", "vertices": tiny(side)});
        let mesh = json!({"type": "trimesh", "vertices": tiny(side), "faces": [[0, 1, 2]]});
        for small in [triangle, mesh] {
            let _ = writeln!(text, "{}", line("small", &small, &ball, [0.0; 3]));
        }
    }
    let (whole, answers) = ask(text.as_bytes());
    assert!(!whole && answers.len() == 6);
    for answer in &answers {
        let error = answer["error"].as_str().unwrap();
        assert!(error.contains("a: the extent of the "), "{error}");
    }
    // A single point, and a tiny triangle within a large mesh: the extent is not an error here.
    let place = json!({"type": "convex", "vertices": [[0.0, 0.0, 0.0]]});
    let mesh = json!({
        "type": "trimesh",
        "vertices": [[0.0, 0.0, 0.0], [1e-200, 0.0, 0.0], [0.0, 1e-200, 0.0], [-1.0, 5.0, 0.0], [1.0, 5.0, 0.0], [0.0, 6.0, 0.0]],
        "faces": [[0, 1, 2], [3, 4, 5]],
    });
    for (a, b, truth) in [
        (&place, &place, 0.0),
        (&place, &place, 1e-170),
        (&place, &place, 1e-120),
        (&mesh, &place, 3e-200),
    ] {
        let (_, answers) = ask(line("near", a, b, [0.0, 0.0, truth]).as_bytes());
        let end = |key: &str| answers[0][key].as_f64().unwrap();
        let holds = end("gap_min_m") <= truth && truth <= end("gap_max_m");
        assert!(
            holds && end("gap_max_m") < 1.001 * truth + 1e-150,
            "{truth:e}: {answers:?}"
        );
        assert_eq!(answers[0]["colliding"], truth < 1e-150, "{answers:?}");
    }
}

#[test]
fn what_is_wrong_in_a_line_is_told_with_the_part_it_stands_in() {
    let ball = json!({"type": "sphere", "radius": 1.0});
    let good: Value = serde_json::from_str(&line("a", &ball, &ball, [0.0; 3])).unwrap();
    let wrong = |change: &dyn Fn(&mut Value)| {
        let mut text = good.clone();
        change(&mut text);
        let (whole, rows) = ask(text.to_string().as_bytes());
        assert!(!whole);
        rows[0]["error"].as_str().unwrap().to_owned()
    };
    let misspelt = wrong(&|line| line["b"] = json!({"type": "sphere", "raduis": 1.0}));
    assert!(
        misspelt.starts_with("line 1: b: unknown field `raduis`"),
        "{misspelt}"
    );
    let short = wrong(&|line| line["pose_b"]["t"] = json!([0.0, 0.0]));
    assert!(short.starts_with("line 1: pose_b: "), "{short}");
    let renamed =
        wrong(&|line| line["pose"] = line.as_object_mut().unwrap().remove("pose_a").unwrap());
    assert_eq!(renamed, "line 1: it has no `pose_a`; is `pose` meant?");
    let unknown = wrong(&|line| line["pose_a"]["scale"] = json!(2.0));
    assert!(
        unknown.starts_with("line 1: pose_a: unknown field `scale`"),
        "{unknown}"
    );
    let (_, rows) = ask(b"[1, 2]");
    let listed = rows[0]["error"].as_str().unwrap();
    assert!(listed.starts_with("line 1: it is no object"), "{listed}");
}

/// The true distance is from exact rational arithmetic. Where rounding suggests an overlap, the reported gap was
/// smaller than the true one.
#[test]
fn bug_a_sliver_that_is_just_apart_was_told_nearer_than_it_is() {
    let sliver = json!({"type": "triangle", "vertices": [
        [-0.625, -0.75, 1.0], [-0.375, 0.0, -0.625], [-0.554935150738665, -0.5398054587597252, 0.5445784915412667],
    ]});
    let other = json!({"type": "triangle", "vertices": [[1.0, 0.5, -0.875], [0.5, 1.0, 0.625], [-1.0, -0.625, -0.375]]});
    let t = [
        -1.0079935920040402,
        -1.3989807767762772,
        -0.3855416519696748,
    ];
    let (whole, rows) = ask(line("sliver", &sliver, &other, t).as_bytes());
    assert!(whole);
    let end = |key: &str| rows[0][key].as_f64().unwrap();
    let truth = 5.845403e-10;
    assert!(
        end("gap_min_m") <= truth && truth <= end("gap_max_m"),
        "{rows:?}"
    );
}

/// A closed cube of half side `h`, with outward faces.
fn cube(h: f64, solid: Option<bool>) -> Value {
    let corners: Vec<[f64; 3]> = (0..8)
        .map(|k| [4, 2, 1].map(|bit| if k & bit == 0 { -h } else { h }))
        .collect();
    let faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    let mut mesh = json!({"type": "trimesh", "vertices": corners, "faces": faces});
    if let Some(solid) = solid {
        mesh["solid"] = json!(solid);
    }
    mesh
}

/// The result of a daemon for the same two shapes; meshes are solids or surfaces according to their `solid`.
fn as_in_a_daemon(a: &Value, b: &Value, t: [f64; 3]) -> (f64, f64, bool) {
    let body = |shape: &Value, at: [f64; 3]| {
        let spec: ShapeSpec = serde_json::from_value(shape.clone()).unwrap();
        let parts = Parts::from([PlacedShape {
            shape: build(&spec, Path::new(".")).unwrap().shape,
            pose: Pose::identity(),
        }]);
        Body::of_shapes(
            parts,
            &Pose::from_parts(Vec3::from(at).into(), Quat::identity()),
        )
    };
    let mut meter = Meter::unlimited(&SystemClock);
    let asked = gap_between(&body(a, [0.0; 3]), &body(b, t), 0.0, &mut meter);
    (
        asked.gap.min,
        asked.gap.max,
        asked.verdict == Verdict::Colliding,
    )
}

/// The pair was proved apart by the distance to the surface.
#[test]
fn bug_what_is_inside_a_solid_mesh_collides_with_it() {
    let others = [
        (0.2, json!({"type": "sphere", "radius": 0.2})),
        (0.2, json!({"type": "box", "half_extents": [0.2, 0.2, 0.2]})),
        (0.3, cube(0.3, Some(true))),
        (0.3, cube(0.3, None)),
        (0.3, cube(0.3, Some(false))),
    ];
    for (half, other) in &others {
        for z in [0.0, 0.3, 0.6, 0.95, 2.0] {
            let at = [0.05, 0.02, z];
            let back = at.map(|x: f64| -x);
            let gap = z - 1.0 - half;
            let solid = cube(1.0, Some(true));
            for (a, b, t) in [(&solid, other, at), (other, &solid, back)] {
                let (_, told) = ask(line("x", a, b, t).as_bytes());
                let told = &told[0];
                let what = format!("{half} {z}: {told}");
                let number = |key: &str| told[key].as_f64().unwrap();
                let (low, high) = (number("gap_min_m"), number("gap_max_m"));
                assert_eq!(told["colliding"], gap < 0.0, "{what}");
                if gap < 0.0 {
                    assert!(high <= 0.0, "{what}");
                } else {
                    assert!(low <= gap && gap <= high && high - low < 1e-9, "{what}");
                }
                // Without `solid` a mesh is a surface here; a daemon would decide by its topology.
                if other["solid"].is_null() && other["type"] == "trimesh" {
                    continue;
                }
                assert_eq!(as_in_a_daemon(a, b, t), (low, high, gap < 0.0), "{what}");
            }
            // A surface has no interior.
            for surface in [cube(1.0, None), cube(1.0, Some(false))] {
                if other["solid"] == true {
                    continue;
                }
                let (_, told) = ask(line("x", &surface, other, at).as_bytes());
                let inside = z + half < 1.0;
                assert_eq!(
                    told[0]["colliding"],
                    gap < 0.0 && !inside,
                    "{z}: {}",
                    told[0]
                );
            }
        }
    }
    // Half-spaces collide with solids too; and a mesh that is not closed cannot be a solid.
    let floor = json!({"type": "half_space", "normal": [0, 0, 1], "offset": -3.0});
    let (_, told) = ask(line("x", &floor, &cube(1.0, Some(true)), [0.0, 0.0, 0.5]).as_bytes());
    assert!(
        (told[0]["gap_m"].as_f64().unwrap() - 2.5).abs() < 1e-12,
        "{}",
        told[0]
    );
    let mut open = cube(1.0, Some(true));
    open["faces"].as_array_mut().unwrap().pop();
    let (whole, told) = ask(line("x", &open, &others[0].1, [0.0; 3]).as_bytes());
    assert!(
        !whole && told[0]["error"].as_str().unwrap().contains("a: "),
        "{}",
        told[0]
    );
}

/// The engine of a daemon, whose code answers these queries, never gets such positions and is not designed for them.
#[test]
fn solids_that_are_too_far_to_compute_with_are_told_as_such() {
    let others = [
        json!({"type": "sphere", "radius": 0.2}),
        cube(1.0, Some(true)),
        cube(1.0, None),
        json!({"type": "half_space", "normal": [0, 0, 1], "offset": 0.0}),
        json!({"type": "half_space", "normal": [0, 0, 1], "offset": 1e200}),
    ];
    for far in [1e100, 1e160, 1e200, 1e308] {
        for other in &others {
            for t in [[far, 0.0, far], [0.0, -far, 1.0]] {
                let (whole, told) = ask(line("x", &cube(1.0, Some(true)), other, t).as_bytes());
                let told = &told[0];
                if far > 1e150 || other["offset"] == 1e200 {
                    let why = told["error"].as_str().unwrap();
                    assert!(!whole && why.contains("too far"), "{far} {told}");
                } else {
                    let ends = ["gap_min_m", "gap_max_m"].map(|key| told[key].as_f64().unwrap());
                    assert!(ends[0] <= ends[1] && ends[1].is_finite(), "{far} {told}");
                }
            }
        }
    }
}
