//! A gap asked for beside the pair set: sound wherever its work stops, and in the end that of the pair.

use sweepd::narrow::gap_between;
use sweepd::query::GapQuestion;
use sweepd::time::{ManualClock, Meter, SystemClock};
use sweepd::wire::Verdict;
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
    // Shapes, where the second one is, and the gap by hand.
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
        // The other way round: from the dumbbell down to the pyramid.
        assert!(
            found.known.normal.unwrap()[2] < 0.0
                && found.known.point_a.unwrap()[2] > found.known.point_b.unwrap()[2]
        );
    }
}
