//! Rays that are hard to tell: those that graze what they meet, and those that go as far as there may be anything.

use sweepd::math::{Point, Vec3};
use sweepd::wire::Verdict;

use super::{ask, json};
use crate::rig::{ALL, Rig, body, scene};

const BALL: &str = "{ type = \"sphere\", radius = 1 }";

#[test]
fn bug_what_is_farther_than_a_shape_may_be_large_is_hit_too() {
    let corner = [1e12, 1e12, 1e12];
    for (from, at) in [
        ([0.0; 3], [1.1e9, 0.0, 0.0]),
        ([1.0, 2.0, 3.0], [-3e10, 4e10, 1.0]),
        ([-1e12, -1e12, -1e12], corner),
    ] {
        let mut rig = Rig::new(&scene("", &[body(1, at, BALL, "")]));
        rig.send(ALL);
        let way = Vec3::from(at) - Vec3::from(from);
        let found = ask(rig.engine.world(), &json(&Vec3::from(from), &way, ""));
        let (truth, slack) = (way.norm() - 1.0, 1e-13 * way.norm());
        assert_ne!(found.verdict, Verdict::Apart.code(), "{found:?}");
        assert!(found.t_min_m <= truth + slack, "{truth} {found:?}");
        if slack < 1e-2 {
            assert_eq!(found.verdict, Verdict::Colliding.code(), "{found:?}");
            let off = (found.t_best_m.unwrap() - truth).abs();
            assert!(off <= slack, "{off} {found:?}");
        }
    }
    // A half-space near by, of which all the ray is asked first.
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -5.0 }\n";
    let rig = Rig::new(&scene("", &[floor.to_owned()]));
    let found = ask(
        rig.engine.world(),
        &json(&Vec3::new(9.0, 0.0, 3.0), &-Vec3::z(), ""),
    );
    assert!((found.t_best_m.unwrap() - 8.0).abs() <= 1e-12, "{found:?}");
    let point = Point::from(found.point.unwrap());
    assert!((point.z + 5.0).abs() <= 1e-12, "{found:?}");
}
