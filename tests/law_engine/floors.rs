//! Law 4.7 for meshes on half-spaces: verdicts before contacts, pairs in contact before others, and no pair waits for
//! ever, whatever moves from tick to tick.

use std::fmt::Write as _;

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{Verdict, VertexFrame, VertexHeader, WIRE_VERSION, name_bytes, vertex_flags};

use crate::rig::{ALL, Rig, body, scene};

/// Quads along one side of the cloth.
const SIDE: usize = 60;
const FLOOR: &str = "{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }";
const RAMPS: &str = "[{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }, \
    { type = \"box\", half_extents = [1.0, 1.0, 0.5], position = [30.0, 0.0, 0.0] }]";

fn units(units: u64) -> Budget {
    Budget {
        time_ns: None,
        units: Some(units),
    }
}

/// A sheet of `2 side^2` triangles and side 1 m.
fn sheet(side: usize) -> String {
    bowl(side, 0.0)
}

/// The same sheet, curved upwards from its centre.
fn bowl(side: usize, up: f64) -> String {
    let mut text = "{ type = \"trimesh\", solid = false, vertices = [".to_owned();
    for at in 0..(side + 1) * (side + 1) {
        let [x, y] = [at % (side + 1), at / (side + 1)].map(|k| k as f64 / side as f64 - 0.5);
        let _ = write!(text, "[{x:?}, {y:?}, {:?}], ", up * (x * x + y * y));
    }
    text += "], faces = [";
    for at in 0..side * side {
        let first = at / side * (side + 1) + at % side;
        let [a, b, c, d] = [first, first + 1, first + side + 2, first + side + 1];
        let _ = write!(text, "[{a}, {b}, {c}], [{a}, {c}, {d}], ");
    }
    text + "] }"
}

fn floor(id: u64, shape: &str) -> String {
    format!("name = \"b{id}\"\nid = {id}\nmoves = false\nshape = {shape}\n")
}

/// The vertices of the cloth with a travelling wave of amplitude 0.15 mm.
fn waved(tick: u64) -> VertexFrame {
    let row = |at: usize| {
        let [x, y] = [at % (SIDE + 1), at / (SIDE + 1)];
        let z = 1.5e-4 * (0.3 * x as f64 + 0.2 * y as f64 + 2.1 * tick as f64).sin();
        let [x, y] = [x, y].map(|k| k as f64 / SIDE as f64 - 0.5);
        [x, y, z].map(|x| {
            #[allow(clippy::cast_possible_truncation, reason = "as on the wire")]
            let x = x as f32;
            x
        })
    };
    let rows: Vec<_> = (0..(SIDE + 1) * (SIDE + 1)).map(row).collect();
    let count = u32::try_from(rows.len()).unwrap();
    VertexFrame {
        header: VertexHeader {
            session: 11,
            epoch: 1,
            body: 1,
            version: tick + 1,
            source: name_bytes("feed"),
            count,
            total: count,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        rows,
        ..VertexFrame::default()
    }
}

/// Of 40 ticks with 5,000 units: the number with the cloth reported as colliding, and the number with new contacts.
fn told(on: &str, bends: bool) -> [u32; 2] {
    let at = [0.0, 0.0, -2e-4];
    let more = if bends { "deforms = true\n" } else { "" };
    let mut rig = Rig::new(&scene("", &[body(1, at, &sheet(SIDE), more), floor(2, on)]));
    rig.checked = false;
    rig.demand.regions = false;
    let (mut told, mut before) = ([0; 2], Vec::new());
    for tick in 0..40 {
        if bends {
            rig.vertices = vec![waved(tick)];
        } else {
            let z = -2e-4 + 1.5e-4 * (2.1 * tick as f64).sin();
            rig.place(1, &Pose::translation(0.0, 0.0, z));
        }
        rig.send(units(5_000));
        told[0] += u32::from(rig.verdict(1, 2) == Verdict::Colliding);
        let newest = rig
            .out
            .contacts
            .iter()
            .map(|contact| contact.gap_m.to_bits());
        let newest: Vec<u64> = newest.collect();
        if !newest.is_empty() && newest != before {
            before = newest;
            told[1] += 1;
        }
    }
    told
}

#[test]
fn law_4_7_bug_the_verdict_of_a_cloth_on_a_floor_waits_for_no_contacts_of_an_older_pose() {
    let cases = [(FLOOR, false), (FLOOR, true), (RAMPS, false), (RAMPS, true)];
    let all = cases.map(|(on, bends)| told(on, bends));
    assert!(all.iter().all(|[colliding, _]| *colliding >= 39), "{all:?}");
    assert!(
        all[..2].iter().all(|[_, contacts]| *contacts >= 1),
        "{all:?}"
    );
}

/// The cloth touches, is near, touches for too short a time to find its contacts, is near, and touches again.
#[test]
fn bug_contacts_of_a_collision_that_was_over_were_told_in_the_next_one() {
    let cloth = body(1, [0.0; 3], &sheet(SIDE), "report_within_m = 0.05\n");
    let mut rig = Rig::new(&scene("", &[cloth, floor(2, FLOOR)]));
    rig.demand.regions = false;
    for z in [-1e-4, 0.01] {
        rig.place(1, &Pose::translation(0.0, 0.0, z));
        rig.send(ALL);
    }
    for (z, verdict) in [(-2e-4, Verdict::Colliding), (0.01, Verdict::Near)] {
        rig.place(1, &Pose::translation(0.0, 0.0, z));
        rig.send(units(1_000));
        assert_eq!(rig.verdict(1, 2), verdict);
        assert!(rig.out.contacts.len() <= 1, "the closest points at most");
    }
    rig.place(1, &Pose::translation(0.0, 0.0, -4e-4));
    let mut ticks = 0;
    while {
        rig.send(units(1_000));
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
        rig.out.contacts.is_empty()
    } {
        ticks += 1;
        assert!(ticks < 100);
    }
    assert!(ticks > 1, "found in one tick: nothing was cut off");
    for row in &rig.out.contacts {
        assert!(row.gap_m < -3e-4, "{row:?}");
    }
}

#[test]
fn contacts_on_a_floor_are_those_of_the_tick_where_the_budget_reaches() {
    let mut rig = Rig::new(&scene(
        "",
        &[body(1, [0.0; 3], &sheet(4), ""), floor(2, FLOOR)],
    ));
    for tick in 1..20_i32 {
        let z = -1e-3 * f64::from(tick);
        rig.place(1, &Pose::translation(0.0, 0.0, z));
        rig.send(units(1_000));
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
        let pair = rig.pair(1, 2).unwrap();
        assert!((pair.gap_min_m - z).abs() < 1e-9 && (pair.gap_max_m - z).abs() < 1e-9);
        assert!(!rig.out.contacts.is_empty());
        for contact in &rig.out.contacts {
            assert!((contact.gap_m - z).abs() < 1e-9, "tick {tick}: {contact:?}");
        }
    }
}

/// Moving sheets that penetrate the floor, with one unit for each.
#[test]
fn law_4_7_bug_a_touch_on_a_floor_is_confirmed_by_one_unit() {
    const SHEETS: u64 = 8;
    let mut bodies: Vec<String> = (1..=SHEETS)
        .map(|id| body(id, [3.0 * id as f64, 0.0, -0.01], &sheet(12), ""))
        .collect();
    bodies.push(floor(99, FLOOR));
    let mut rig = Rig::new(&scene("", &bodies));
    (rig.demand.contacts, rig.demand.regions) = (false, false);
    rig.send(ALL);
    for tick in 0..20_i32 {
        for id in 1..=SHEETS {
            // Deeper than the sheets move in a tick, but less deep than two ticks of motion: only proofs of the last
            // tick help.
            let z = -0.01 - 0.02 * f64::from(tick % 2);
            let x = 3.0 * id as f64 + 0.05 * f64::from(tick);
            rig.place(id, &Pose::translation(x, 0.0, z));
        }
        rig.send(units(SHEETS));
        let colliding = |id: &u64| rig.verdict(*id, 99) == Verdict::Colliding;
        assert_eq!((1..=SHEETS).filter(colliding).count(), 8, "tick {tick}");
    }
}

/// Bowls that have just left the floor: their witnesses prove nothing any more, and there is one unit for each.
#[test]
fn law_4_7_bug_pairs_that_part_do_not_spend_all_units_on_their_last_touch() {
    const BOWLS: u64 = 8;
    for on in [FLOOR, RAMPS] {
        let x = |id: u64| 3.0 * id as f64 - 15.0;
        let mut bodies: Vec<String> = (1..=BOWLS)
            .map(|id| body(id, [x(id), 0.0, -0.01], &bowl(12, 1.0), ""))
            .collect();
        bodies.push(floor(99, on));
        let mut rig = Rig::new(&scene("", &bodies));
        (rig.demand.contacts, rig.demand.regions) = (false, false);
        rig.send(ALL);
        let mut last = 0;
        for tick in 0..400_i32 {
            for id in 1..=BOWLS {
                // Each bowl oscillates about its position.
                let z = 0.01 + 0.001 * f64::from(tick % 2);
                rig.place(id, &Pose::translation(x(id), 0.0, z));
            }
            rig.send(units(BOWLS));
            let apart = |id: &u64| rig.verdict(*id, 99) == Verdict::Apart;
            last = (1..=BOWLS).filter(apart).count();
        }
        assert_eq!(last, 8, "{on}");
    }
}

#[test]
fn law_4_6_bug_a_mesh_that_moves_over_a_floor_with_ramps_is_decided_in_parts() {
    let mut rig = Rig::new(&scene(
        "",
        &[
            body(1, [0.0, 0.0, 0.5], &bowl(40, 1.0), ""),
            floor(2, RAMPS),
        ],
    ));
    (rig.demand.contacts, rig.demand.regions) = (false, false);
    let mut decided = 0;
    for tick in 0..60_i32 {
        let x = 1e-5 * f64::from(tick);
        // Tilted, its boxes reach about a centimetre lower than the surface.
        let tilt = Quat::from_axis_angle(&Vec3::x_axis(), 0.2);
        let at = Vec3::new(x, 0.0, 0.0111);
        rig.place(1, &Pose::from_parts(at.into(), tilt));
        rig.send(units(32));
        decided += i32::from(rig.verdict(1, 2) == Verdict::Apart);
    }
    assert!(decided >= 40, "{decided} of 60");
}

/// Tilted bowls just above the floor that turn farther in a tick than any walk of an earlier pose allows, with units
/// for fewer than two walks per tick.
#[test]
fn law_4_7_bug_turns_on_half_spaces_did_not_grow_while_a_pair_waits() {
    const BOWLS: u64 = 8;
    let x = |id: u64| 3.0 * id as f64;
    let mut bodies: Vec<String> = (1..=BOWLS)
        .map(|id| body(id, [x(id), 0.0, 0.5], &bowl(40, 1.0), ""))
        .collect();
    bodies.push(floor(99, FLOOR));
    let mut rig = Rig::new(&scene("", &bodies));
    (rig.demand.contacts, rig.demand.regions) = (false, false);
    let mut decided = vec![0; bodies.len() - 1];
    for tick in 0..100_i32 {
        for id in 1..=BOWLS {
            let tilt = Quat::from_axis_angle(&Vec3::x_axis(), 0.2);
            let turn = Quat::from_axis_angle(&Vec3::z_axis(), 0.1 * f64::from(tick));
            let at = Vec3::new(x(id), 0.0, 0.0111);
            rig.place(id, &Pose::from_parts(at.into(), turn * tilt));
        }
        rig.send(units(512));
        for (id, times) in (1..).zip(&mut decided) {
            let apart = rig.verdict(id, 99) == Verdict::Apart;
            *times += u32::from(apart);
        }
    }
    assert!(decided.iter().all(|times| *times >= 4), "{decided:?}");
}
