//! Contacts belong to the poses of the tick that publishes them.

use crate::oracle::meshes::trimesh;
use crate::oracle::rng::Rng;
use crate::support::{contacts, drive, scene, sheet};
use sweepd::math::Pose;

/// A query that takes more than one turn counted as finished once it had its verdict, and its contacts were those of
/// the tick before.
#[test]
fn bug_contacts_of_a_long_query_were_those_of_the_tick_before() {
    let floor = trimesh(&sheet(&mut Rng::new(1), 60, 1.0), None);
    let cube = "{ type = \"box\", half_extents = [0.1, 0.1, 0.1] }";
    for body in [cube, "{ type = \"sphere\", radius = 0.3 }"] {
        let mut drive = drive(&scene(&floor, body, true));
        for k in 0..20 {
            let x = 0.7 * f64::from(k % 7) - 2.1;
            let rows = contacts(&mut drive, &Pose::translation(x, 0.0, 0.0999));
            assert!(!rows.is_empty());
            for row in &rows {
                assert!((row.point_b[0] - x).abs() < 0.31, "{row:?} at {x}");
            }
        }
    }
}
