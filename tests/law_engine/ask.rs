//! Questions for a gap, outside the pair set: the answer is sound wherever its work stops, and equals that of the pair
//! at the end.

use sweepd::narrow::gap_between;
use sweepd::query::{GapQuestion, Query};
use sweepd::scene::Question;
use sweepd::time::{ManualClock, Meter, SystemClock};
use sweepd::wire::{Verdict, VertexFrame, VertexHeader, WIRE_VERSION, name_bytes, vertex_flags};
use sweepd::world::Body;

use crate::rig::{ALL, Rig, body, scene};

const PYRAMID: &str = "{ type = \"trimesh\", vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]] }";
const DUMBBELL: &str = "[{ type = \"sphere\", radius = 0.3, position = [-1, 0, 0] }, { type = \"sphere\", radius = 0.3, position = [1, 0, 0] }]";

fn rig(bodies: &[String]) -> Rig {
    let mut rig = Rig::new(&scene("", bodies));
    rig.send(ALL);
    rig
}

fn two(rig: &Rig) -> (&Body, &Body) {
    let world = rig.engine.world();
    let of = |name: &str| world.body(world.slot_named(name).unwrap()).unwrap();
    (of("b1"), of("b2"))
}

#[test]
fn an_answer_is_sound_after_any_number_of_units_and_exact_after_all() {
    let clock = ManualClock::new(0);
    let pea = "{ type = \"sphere\", radius = 0.1 }";
    // Shapes, position of the second one, and the gap computed by hand.
    let cases = [
        (PYRAMID, pea, [0.0, 0.0, 1.3], 0.2),
        (pea, DUMBBELL, [0.0, 2.0, 0.0], 5.0_f64.sqrt() - 0.4),
        (PYRAMID, DUMBBELL, [1.0, 0.0, 3.0], 1.7),
        (DUMBBELL, DUMBBELL, [2.0, 0.0, 0.5], -0.1),
        (PYRAMID, PYRAMID, [0.0, 0.0, 1.25], 0.25),
    ];
    for (first, second, at, gap) in cases {
        let rig = rig(&[body(1, [0.0; 3], first, ""), body(2, at, second, "")]);
        let (a, b) = two(&rig);
        let mut units = 0;
        let whole = loop {
            let mut meter = Meter::new(&clock, None, Some(units));
            let asked = gap_between(a, b, 0.0, &mut meter);
            let what = format!("{first} {second} after {units} units: {asked:?}");
            assert!(
                asked.gap.min <= gap + 1e-9 && asked.gap.max >= gap - 1e-9,
                "{what}"
            );
            let wrong = if gap > 0.0 {
                Verdict::Colliding
            } else {
                Verdict::Apart
            };
            assert_ne!(asked.verdict, wrong, "{what}");
            if asked.finished {
                break asked;
            }
            assert!(units < 10_000, "{what}");
            units += 1;
        };
        assert!(
            units > 0 && whole.gap.max - whole.gap.min < 1e-6,
            "{whole:?}"
        );
        let verdict = if gap > 0.0 {
            Verdict::Apart
        } else {
            Verdict::Colliding
        };
        assert_eq!(whole.verdict, verdict);
    }
}

#[test]
fn an_answer_is_that_of_the_pair_at_the_tick_s_poses() {
    let more = "report_within_m = 2.0";
    let mut rig = rig(&[
        body(1, [0.0; 3], PYRAMID, more),
        body(2, [0.0, 0.0, 9.0], DUMBBELL, more),
    ]);
    for step in 0..40_u8 {
        let z = 2.5 - f64::from(step) * 0.06;
        rig.row(2).position = [0.3, 0.1, z];
        rig.send(ALL);
        let header = rig.out.tick.header;
        let question = GapQuestion::new(rig.engine.world(), header, "b2", "b1").unwrap();
        let found = question.answer(&SystemClock);
        let row = rig.out.pairs.iter().find(|row| row.body_a == 1).copied();
        let verdict = row.map_or(Verdict::Apart.code(), |row| row.verdict);
        assert_eq!(
            (found.known.verdict, found.tick_header),
            (verdict, header),
            "z {z}"
        );
        let Some(row) = row.filter(|row| row.gap_min_m > 0.0) else {
            continue;
        };
        let (low, high) = (
            found.known.gap_min_m.unwrap(),
            found.known.gap_max_m.unwrap(),
        );
        assert!((low - row.gap_min_m).abs() < 1e-9 && (high - row.gap_max_m).abs() < 1e-9);
        // In reverse order: the normal points from the dumbbell down to the pyramid.
        assert!(
            found.known.normal.unwrap()[2] < 0.0
                && found.known.point_a.unwrap()[2] > found.known.point_b.unwrap()[2]
        );
    }
}

/// A cube of side 1 m, each side divided into `n` times `n` squares of two triangles.
fn cube(n: usize) -> String {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-0.5, 0.5] {
            let first = vertices.len();
            for place in 0..(n + 1) * (n + 1) {
                let step = |k: usize| k as f64 / n as f64 - 0.5;
                let mut corner = [side; 3];
                corner[(axis + 1) % 3] = step(place % (n + 1));
                corner[(axis + 2) % 3] = step(place / (n + 1));
                vertices.push(corner);
            }
            for square in 0..n * n {
                let p = first + square / n * (n + 1) + square % n;
                let (right, up) = (p + 1, p + n + 1);
                let mut halves = [[p, right, up + 1], [p, up + 1, up]];
                if side < 0.0 {
                    halves = halves.map(|[a, b, c]| [a, c, b]);
                }
                faces.extend(halves);
            }
        }
    }
    format!("{{ type = \"trimesh\", solid = true, vertices = {vertices:?}, faces = {faces:?} }}")
}

#[test]
fn bug_solids_that_overlap_along_faces_in_line_are_no_touch() {
    let corner = "{ type = \"trimesh\", solid = true, vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }";
    let octahedron = "{ type = \"trimesh\", solid = true, vertices = [[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0.5], [0, 0, -0.5]], faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]] }";
    let (plain, fine) = (&*cube(1), &*cube(4));
    let boxy = "{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }";
    // Shapes, position of the second one, and the greatest possible depth; 0: they touch.
    let cases = [
        (plain, plain, [0.0; 3], 0.5),
        (plain, plain, [0.5, 0.0, 0.0], 0.5),
        (plain, plain, [0.25, 0.25, 0.0], 0.5),
        (plain, plain, [0.95, 0.0, 0.0], 0.05),
        (plain, plain, [0.95, 0.95, 0.0], 0.05),
        (plain, plain, [0.999, 0.999, 0.999], 0.001),
        (fine, fine, [0.25, 0.25, 0.0], 0.5),
        (fine, fine, [0.975, 0.0, 0.0], 0.025),
        (plain, fine, [0.9, 0.5, 0.0], 0.1),
        (corner, octahedron, [0.0; 3], 0.5 / 3.0_f64.sqrt()),
        (plain, boxy, [0.0; 3], 0.5),
        (plain, boxy, [0.95, 0.0, 0.0], 0.05),
        (plain, plain, [1.0, 0.0, 0.0], 0.0),
        (fine, fine, [1.0, 0.25, 0.0], 0.0),
        (plain, plain, [1.0, 1.0, 1.0], 0.0),
    ];
    for (first, second, at, depth) in cases {
        let mut rig = rig(&[body(1, [0.0; 3], first, ""), body(2, at, second, "")]);
        let mut meter = Meter::unlimited(&SystemClock);
        let asked = {
            let (a, b) = two(&rig);
            gap_between(a, b, 0.0, &mut meter)
        };
        let what = format!("{at:?}: {asked:?} in {} units", meter.spent());
        assert_eq!(asked.verdict, Verdict::Colliding, "{what}");
        assert!(asked.finished && asked.gap.min <= -depth + 1e-9, "{what}");
        assert_eq!(asked.touching, depth == 0.0, "{what}");
        assert_eq!(asked.gap.max <= 0.0, depth > 0.0, "{what}");
        assert!(asked.gap.max >= -depth - 1e-9, "{what}");
        // The ticks of the engine agree.
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding, "{what}");
        let row = rig.pair(1, 2).unwrap();
        assert_eq!(row.gap_max_m <= 0.0, depth > 0.0, "{what} {row:?}");
        assert!(row.gap_best_m.is_nan() || row.gap_best_m <= row.gap_max_m);
    }
}

/// A tent of side 2 m above the first body.
const TENT: &str = "{ type = \"trimesh\", solid = false, vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]] }";

fn bent(version: u64, rows: Vec<[f32; 3]>) -> VertexFrame {
    let count = u32::try_from(rows.len()).unwrap();
    VertexFrame {
        header: VertexHeader {
            session: 11,
            epoch: 1,
            body: 2,
            version,
            source: name_bytes("feed"),
            count,
            total: 5,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        rows,
        ..VertexFrame::default()
    }
}

fn tent(z: f32) -> Vec<[f32; 3]> {
    let corners = [
        [-1.0, -1.0],
        [1.0, -1.0],
        [1.0, 1.0],
        [-1.0, 1.0],
        [0.0, 0.0],
    ];
    let rows = corners.iter().zip([0.0, 0.0, 0.0, 0.0, 1.0]);
    rows.map(|(&[x, y], up)| [x, y, z + up]).collect()
}

#[test]
fn bug_boxes_that_no_pair_has_had_fitted_are_fitted_for_a_question() {
    let bodies = [
        body(
            1,
            [0.0, 0.0, 50.0],
            "{ type = \"sphere\", radius = 1.0 }",
            "",
        ),
        body(2, [0.0; 3], TENT, "deforms = true\n"),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    for version in 1..200_u64 {
        let z = if version % 2 == 0 { 0.0 } else { 0.05 };
        rig.vertices = vec![bent(version, tent(z))];
        rig.send(ALL);
    }
    let (_, cloth) = two(&rig);
    assert!(cloth.lags());
    let mut own = cloth.still();
    own.fit_boxes();
    assert!(
        !own.lags() && cloth.lags(),
        "what others hold stays as it was"
    );
    let world = rig.engine.world();
    let ask = |asked: Question| {
        let header = rig.out.tick.header;
        let query = Query::new(world, header, &asked, None).unwrap();
        // Each clock read takes so long that only a few fit in the time limit.
        let clock = ManualClock::new(1);
        clock.step_each_read(20_000_000);
        query.answer(&clock)
    };
    let gap = ask(Question::Gap {
        a: "b1".to_owned(),
        b: "b2".to_owned(),
    });
    let gap = gap.gap.unwrap().known;
    let truth = 48.0 - 0.05;
    let (low, high) = (gap.gap_min_m.unwrap(), gap.gap_max_m.unwrap());
    assert!(low <= truth + 1e-6 && high >= truth - 1e-6, "{gap:?}");
    assert!(high - low < 1e-3, "{gap:?}");
}

#[test]
fn bug_an_answer_says_what_has_not_come_of_a_body_or_of_what_it_hangs_on() {
    let bodies = [
        body(
            1,
            [0.0, 0.0, 50.0],
            "{ type = \"sphere\", radius = 1.0 }",
            "",
        ),
        body(2, [0.0; 3], TENT, "deforms = true\n"),
        body(
            3,
            [0.0; 3],
            "{ type = \"sphere\", radius = 1.0 }",
            "attached_to = \"b2\"\n",
        ),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    let why = |rig: &Rig, name: &str| {
        let header = rig.out.tick.header;
        GapQuestion::new(rig.engine.world(), header, "b1", name).unwrap_err()
    };
    rig.idle(1, ALL);
    let told = GapQuestion::new(rig.engine.world(), rig.out.tick.header, "b1", "b2").unwrap_err();
    assert!(
        told.contains("\"b1\" is not_received: no pose of it has come yet"),
        "{told}"
    );
    rig.send(ALL);
    let told = why(&rig, "b2");
    assert!(
        told.contains("\"b2\" is not_received: no vertices of it have come yet"),
        "{told}"
    );
    let told = why(&rig, "b3");
    assert!(
        told.contains("no vertices of \"b2\", on which it hangs, have come yet"),
        "{told}"
    );
    rig.vertices = vec![bent(1, tent(0.0))];
    rig.send(ALL);
    assert!(GapQuestion::new(rig.engine.world(), rig.out.tick.header, "b1", "b3").is_ok());
    let mut nan = tent(0.0);
    nan[0][0] = f32::NAN;
    rig.vertices = vec![bent(2, nan)];
    rig.send(ALL);
    let told = why(&rig, "b2");
    assert!(
        told.contains("its newest vertices were refused (not_finite)"),
        "{told}"
    );
    let told = why(&rig, "b3");
    assert!(
        told.contains("the newest vertices of \"b2\", on which it hangs, were refused"),
        "{told}"
    );
}
