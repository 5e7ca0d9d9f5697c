//! Contact rows of convex bodies: corners, intervals, ids.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{Verdict, contact_flags};

use crate::oracle::rng::Rng;
use crate::rig::{ALL, NONE, Rig, body, scene};

/// A box of half width `half` and height 1 m, with this id.
fn cuboid(id: u64, half: f64) -> String {
    let shape = format!("{{ type = \"box\", half_extents = [{half}, {half}, 0.5] }}");
    body(id, [0.0; 3], &shape, "")
}

#[test]
fn bug_a_small_box_on_a_large_one_lost_a_corner_where_it_had_the_smaller_id() {
    let mut rng = Rng::new(5);
    for small in [1, 2] {
        let mut rig = Rig::new(&scene("", &[cuboid(small, 0.1), cuboid(3 - small, 1.0)]));
        for turn in 0..40 {
            let yaw = Quat::from_scaled_axis(Vec3::z() * rng.range(-3.0, 3.0));
            let at = Vec3::new(rng.range(-0.8, 0.8), rng.range(-0.8, 0.8), 0.9999);
            rig.place(small, &Pose::from_parts(at.into(), yaw));
            rig.place(3 - small, &Pose::identity());
            rig.send(ALL);
            let contacts = rig.out.contacts.len();
            assert_eq!(
                contacts, 4,
                "id {small}, turn {turn}: {:?}",
                rig.out.contacts
            );
        }
    }
}

#[test]
fn bug_contacts_of_shapes_far_from_their_bodies_had_intervals_without_the_truth() {
    let mut rng = Rng::new(6);
    for case in 0..20 {
        // One ball is a kilometre from its body's origin, and the body is turned by 90 degrees about that origin: exact
        // in f64 except for the sum.
        let off = 1000.0 + rng.range(0.0, 1.0);
        let far = format!("{{ type = \"sphere\", radius = 1.0, position = [{off:?}, 0, 0] }}");
        let near = "{ type = \"sphere\", radius = 1.0 }";
        let bodies = [body(1, [0.0; 3], &far, ""), body(2, [0.0; 3], near, "")];
        let mut rig = Rig::new(&scene("", &bodies));
        let turn = Quat::from_scaled_axis(Vec3::z() * rng.range(-3.0, 3.0));
        let other = turn * Vec3::new(off - 1.99, 0.0, 0.0);
        rig.place(1, &Pose::from_parts(Vec3::zeros().into(), turn));
        rig.place(2, &Pose::translation(other.x, other.y, other.z));
        rig.send(ALL);
        let pair = *rig.pair(1, 2).unwrap();
        let [contact] = &rig.out.contacts[..] else {
            panic!("{case}: {:?}", rig.out.contacts)
        };
        let told = (contact.gap_min_m, contact.gap_max_m);
        assert_eq!(told, (pair.gap_min_m, pair.gap_max_m), "{case}");
    }
}

/// Motion and rotation of a body from tick to tick, metres and radians.
const TREMBLES: [f64; 5] = [0.0, 1e-16, 1e-15, 1e-14, 1e-12];

/// A block of width 2 `half`, as a box or as the hull of its corners.
fn block(half: f64, hull: bool) -> String {
    if !hull {
        return format!("{{ type = \"box\", half_extents = [{half}, {half}, 0.5] }}");
    }
    let corners = (0..8).map(|k| {
        let side = |bit: u32, size: f64| if k >> bit & 1 == 1 { size } else { -size };
        format!("[{}, {}, {}]", side(0, half), side(1, half), side(2, 0.5))
    });
    let corners: Vec<String> = corners.collect();
    format!(
        "{{ type = \"convex\", vertices = [{}] }}",
        corners.join(", ")
    )
}

/// Sends frames with body 2 at a pose plus random motion of size `by`; asserts that each tick has the same number of
/// contacts with the same ids.
fn assert_stays(
    rig: &mut Rig,
    what: &str,
    contacts: usize,
    rng: &mut Rng,
    (pose, by): (&Pose, f64),
) {
    let what = format!("{what}, by {by:e}");
    let mut before = Vec::new();
    for tick in 0..40 {
        let mut at = pose.translation.vector + rng.vector(by);
        // For motion beyond rounding the body is lowered, since the two would be apart otherwise.
        at.z -= if by > 1e-15 { 2.0 * by } else { 0.0 };
        let turn = Quat::from_scaled_axis(rng.vector(by)) * pose.rotation;
        rig.place(2, &Pose::from_parts(at.into(), turn));
        rig.send(ALL);
        let rows = rig.out.contacts.iter();
        let seen: Vec<_> = rows.map(|r| (r.id, r.point_a_body, r.gap_m)).collect();
        let mut ids: Vec<u64> = seen.iter().map(|row| row.0).collect();
        ids.sort_unstable();
        assert_eq!(ids.len(), contacts, "{what}, tick {tick}: {seen:?}");
        assert!(
            before.is_empty() || before == ids,
            "{what}, tick {tick}: {before:?} {seen:?}"
        );
        before = ids;
    }
}

#[test]
fn bug_a_box_at_rest_on_another_lost_corners_to_rounding() {
    let mut rng = Rng::new(7);
    for (half, x) in [(1.0, 0.05), (0.5, 0.0), (0.5, 0.05), (0.3, -0.05)] {
        for hulls in 0..4 {
            let shapes = [block(0.5, hulls & 1 == 1), block(half, hulls & 2 == 2)];
            let bodies =
                [(1, &shapes[0]), (2, &shapes[1])].map(|(id, shape)| body(id, [0.0; 3], shape, ""));
            for yaw in [0.0, 0.1, FRAC_PI_4, 1.0, FRAC_PI_2] {
                let turn = Quat::from_scaled_axis(Vec3::z() * yaw);
                let pose = Pose::from_parts(Vec3::new(x, 0.0, 1.0).into(), turn);
                let what = format!("{half}, {x}, hulls {hulls}, yaw {yaw}");
                for by in TREMBLES {
                    let mut rig = Rig::new(&scene("", &bodies));
                    assert_stays(&mut rig, &what, 4, &mut rng, (&pose, by));
                }
            }
        }
    }
}

/// A floor with its top at z = 0, and body 2 with this shape.
fn on_floor(floor: u64, shape: &str) -> Rig {
    let plane = "{ type = \"half_space\", normal = [0, 0, 1], offset = 0 }";
    let floor = format!("name = \"floor\"\nid = {floor}\nmoves = false\nshape = {plane}\n");
    Rig::new(&scene("", &[floor, body(2, [0.0; 3], shape, "")]))
}

/// An upright prism of height 1 m; its bases are regular hexagons of radius 1 m.
fn hexagons() -> String {
    let corners = (0..12).map(|k| {
        let angle = f64::from(k % 6) * std::f64::consts::FRAC_PI_3;
        let z = if k < 6 { -0.5 } else { 0.5 };
        format!("[{:?}, {:?}, {z:?}]", angle.cos(), angle.sin())
    });
    let corners: Vec<String> = corners.collect();
    format!(
        "{{ type = \"convex\", vertices = [{}] }}",
        corners.join(", ")
    )
}

#[test]
fn bug_a_body_at_rest_on_a_half_space_had_one_contact_that_jumped() {
    let mut rng = Rng::new(8);
    let cylinder = "{ type = \"cylinder\", radius = 0.4, half_height = 0.5 }";
    let cone = "{ type = \"cone\", radius = 0.4, half_height = 0.5 }";
    let capsule = "{ type = \"capsule\", radius = 0.2, half_height = 0.5 }";
    let (x, tip) = (Vec3::x(), (0.5_f64 / 0.75_f64.sqrt()).acos());
    let lying = Quat::from_scaled_axis(x * FRAC_PI_2);
    let upright = Quat::identity();
    let edge = Quat::from_scaled_axis(x * FRAC_PI_4);
    let corner = Quat::from_scaled_axis(x * tip) * Quat::from_scaled_axis(Vec3::z() * FRAC_PI_4);
    let slant = Quat::from_scaled_axis(x * -(FRAC_PI_2 + 0.4_f64.atan2(1.0)));
    let cases = [
        ("box", block(0.5, false), upright, 0.5, 4),
        ("hull", block(0.5, true), upright, 0.5, 4),
        ("hexagon", hexagons(), upright, 0.5, 4),
        ("cylinder", cylinder.to_owned(), upright, 0.5, 4),
        ("cone", cone.to_owned(), upright, 0.5, 4),
        (
            "box on its edge",
            block(0.5, false),
            edge,
            0.5_f64.sqrt(),
            2,
        ),
        (
            "hull on its edge",
            block(0.5, true),
            edge,
            0.5_f64.sqrt(),
            2,
        ),
        (
            "box on its corner",
            block(0.5, false),
            corner,
            0.75_f64.sqrt(),
            1,
        ),
        ("lying cylinder", cylinder.to_owned(), lying, 0.4, 2),
        ("lying capsule", capsule.to_owned(), lying, 0.2, 2),
        ("standing capsule", capsule.to_owned(), upright, 0.7, 1),
        (
            "lying cone",
            cone.to_owned(),
            slant,
            0.5 * (0.4_f64.atan2(1.0)).sin(),
            2,
        ),
    ];
    for floor in [1, 9] {
        for (what, shape, turn, height, contacts) in &cases {
            for yaw in [0.0, 0.3] {
                let turn = Quat::from_scaled_axis(Vec3::z() * yaw) * turn;
                let pose = Pose::from_parts(Vec3::new(0.3, -0.2, *height).into(), turn);
                for by in TREMBLES {
                    let mut rig = on_floor(floor, shape);
                    assert_stays(&mut rig, what, *contacts, &mut rng, (&pose, by));
                }
            }
        }
    }
}

#[test]
fn contacts_on_a_half_space_are_on_both_and_none_is_deeper_than_the_gap() {
    let mut rng = Rng::new(9);
    let cylinder = "{ type = \"cylinder\", radius = 0.4, half_height = 0.5 }";
    let shapes = [block(0.5, false), hexagons(), cylinder.to_owned()];
    for case in 0..200 {
        let mut rig = on_floor([1, 9][case % 2], &shapes[case % 3]);
        let lean = 10.0_f64.powf(rng.range(-7.0, -0.5));
        let lean = Quat::from_scaled_axis(rng.vector(lean));
        let at = Vec3::new(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), 0.45);
        rig.place(2, &Pose::from_parts(at.into(), lean));
        rig.send(ALL);
        let gap_m = rig.out.pairs[0].gap_best_m;
        let rows = &rig.out.contacts;
        let least = rows.iter().map(|r| r.gap_m).fold(f64::INFINITY, f64::min);
        assert!((1..=4).contains(&rows.len()), "{case}: {rows:?}");
        assert!((least - gap_m).abs() < 1e-5, "{case}: {least} {gap_m}");
        assert!(least >= rig.out.pairs[0].gap_min_m - 1e-12, "{case}");
        for row in rows {
            let (below, on) = if row.body_a == 2 {
                (row.point_a, row.point_b)
            } else {
                (row.point_b, row.point_a)
            };
            assert!(on[2].abs() < 1e-12 && row.gap_m <= 1e-6, "{case}: {row:?}");
            assert!((below[2] - row.gap_m).abs() < 1e-12, "{case}: {row:?}");
            let [x, y, z] = if row.body_a == 2 {
                row.point_a_body
            } else {
                row.point_b_body
            };
            assert!(
                x.hypot(y) < 1.01 && (z + 0.5).abs() < 1e-12,
                "{case}: {row:?}"
            );
        }
    }
}

#[test]
fn bug_a_begin_within_a_tight_budget_showed_contacts_of_a_collision_long_over() {
    // The budget is one unit too small for contacts: it covers only a retest of the witness.
    let bodies = [cuboid(1, 0.5), cuboid(2, 0.5)].map(|body| body + "report_within_m = 1.0\n");
    for (away, goes_on) in [(2, true), (50, false)] {
        let mut rig = Rig::new(&scene("", &bodies));
        let at = |rig: &mut Rig, x: f64, z: f64| {
            rig.place(1, &Pose::identity());
            rig.place(2, &Pose::translation(x, 0.0, z));
        };
        at(&mut rig, 0.0, 0.999);
        rig.send(ALL);
        let ids: Vec<u64> = rig.out.contacts.iter().map(|row| row.id).collect();
        assert_eq!(ids.len(), 4);
        for tick in 0..away {
            at(&mut rig, 0.004 * f64::from(tick), 1.001);
            rig.send(ALL);
            assert_eq!(rig.pair(1, 2).unwrap().verdict, Verdict::Near.code());
        }
        let x = 0.004 * f64::from(away);
        at(&mut rig, x, 0.999);
        for units in [1, 2] {
            rig.send(Budget {
                time_ns: None,
                units: Some(units),
            });
            let colliding = rig.pair(1, 2).unwrap().verdict == Verdict::Colliding.code();
            for row in rig.out.contacts.iter().filter(|_| colliding) {
                assert!(
                    row.gap_m < 0.0 && row.flags == 0,
                    "{away}, {units}: {row:?}"
                );
            }
        }
        rig.send(ALL);
        let again: Vec<u64> = rig.out.contacts.iter().map(|row| row.id).collect();
        assert_eq!(again.len(), 4);
        assert_eq!(again == ids, goes_on, "{away}: {ids:?} {again:?}");
    }
}

/// A solid mesh cube of side 1 m, at a position in its body.
fn mesh_at([x, y, z]: [f64; 3]) -> String {
    let corners = (0..8).map(|k| {
        let side = |bit: u32| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
        format!("[{}, {}, {}]", side(0), side(1), side(2))
    });
    let corners: Vec<String> = corners.collect();
    format!(
        "{{ type = \"trimesh\", vertices = [{}], faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], \
         [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]], position = [{x}, {y}, {z}] }}",
        corners.join(", ")
    )
}

#[test]
fn bug_closest_points_of_compounds_with_meshes_were_missing_or_of_other_shapes() {
    let ball = |[x, y, z]: [f64; 3]| {
        format!("{{ type = \"sphere\", radius = 0.5, position = [{x}, {y}, {z}] }}")
    };
    let [left, right] = [[-1.5, 0.0, 0.1], [1.5, 0.0, 0.0]];
    let plane = "{ type = \"half_space\", normal = [0, 0, 1] }".to_owned();
    let sides: [Vec<String>; 6] = [
        vec![mesh_at([0.0; 3])],
        vec![mesh_at(left), mesh_at(right)],
        vec![ball(left), mesh_at(right)],
        vec![mesh_at(left), ball(right), ball([0.0, 1.2, 0.0])],
        vec![ball(left), ball(right)],
        vec![plane],
    ];
    let mut rng = Rng::new(9);
    for (one, other) in (0..6).flat_map(|one| (0..5).map(move |other| (one, other))) {
        let list = |side: &Vec<String>| format!("[{}]", side.join(", "));
        let bodies = [
            body(1, [0.0; 3], &list(&sides[one]), "report_within_m = 3.0"),
            body(2, [0.0; 3], &list(&sides[other]), ""),
        ];
        let mut rig = Rig::new(&scene("", &bodies));
        let mut at = Vec3::new(0.0, 0.0, 1.9);
        for step in 0..60 {
            at.x = 4.0 * (f64::from(step) * 0.21).sin();
            at.z = rng.range(1.2, 2.2);
            let tilt = Quat::from_scaled_axis(Vec3::y() * rng.range(-0.2, 0.2));
            rig.place(2, &Pose::from_parts(at.into(), tilt));
            rig.send(ALL);
            let case = format!("sides {one} and {other}, step {step}");
            let Some(pair) = rig
                .pair(1, 2)
                .filter(|pair| pair.verdict == Verdict::Near.code())
            else {
                continue;
            };
            let [told] = &rig.out.contacts[..] else {
                panic!("{case}: {:?}", rig.out.contacts)
            };
            let points = [told.point_a, told.point_b].map(Vec3::from);
            let length_m = (points[1] - points[0]).norm();
            let holds = |m: f64| (pair.gap_min_m - 1e-9..=pair.gap_max_m + 1e-9).contains(&m);
            assert!(holds(length_m), "{case}: {length_m} of {pair:?}");
            assert!(
                holds(told.gap_m) && holds(pair.gap_best_m),
                "{case}: {told:?} of {pair:?}"
            );
            assert_eq!(told.flags, 0, "{case}");
        }
    }
}

/// A contact kept from an earlier pose had the interval of that pose.
#[test]
fn bug_contacts_of_an_older_pose_had_intervals_without_the_truth() {
    let mut rig = Rig::new(&scene("", &[cuboid(1, 0.5), cuboid(2, 0.5)]));
    rig.move_x(2, 0.98);
    rig.send(ALL);
    assert!(rig.out.contacts.iter().all(|row| row.flags == 0) && !rig.out.contacts.is_empty());
    rig.move_x(2, 0.995);
    rig.send(NONE);
    assert_eq!(rig.out.contacts.len(), 4);
    for row in &rig.out.contacts {
        assert_eq!(row.flags, contact_flags::ESTIMATE);
        assert!(
            row.gap_min_m <= -0.005 && -0.005 <= row.gap_max_m,
            "{row:?}"
        );
    }
}
