//! What contact rows say of convex bodies: corners, intervals.

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
