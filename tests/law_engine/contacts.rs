//! What contact rows say of convex bodies: corners, intervals, ids.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use sweepd::math::{Pose, Quat, Vec3};

use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

/// A box of half a side `half` and 1 m high, of this id.
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
        // One ball a kilometre from its body's origin, about which the body is turned by a quarter: exact in f64 but
        // for the sum.
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

/// How far a body moves and turns from tick to tick, metres and radians.
const TREMBLES: [f64; 5] = [0.0, 1e-16, 1e-15, 1e-14, 1e-12];

/// A box with a side of 2 `half`, as a box or as the hull of its corners.
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

/// Sends one frame after the other in which body 2 is at a pose, but for this much; its contacts are so many in each,
/// with the same ids.
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
        // Beyond rounding it sinks in, or the two would be apart.
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
            let bodies = [1, 2].map(|id| body(id, [0.0; 3], &shapes[id as usize - 1], ""));
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
