//! Goal: a scene file is read whole and strictly, and each mistake gives one error with file, line, body and the mend.
//! Method: the example scene, then one small wrong scene for each rule, compared with the words a user needs.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    reason = "tests stop at the first surprise, and compare numbers that are copied, not computed"
)]

use std::path::Path;

use sweepd::config::Mode;
use sweepd::ids::BodyId;
use sweepd::scene::Scene;

fn example() -> Scene {
    Scene::load(Path::new("launch-free-scripts/example_scene.toml")).unwrap()
}

#[test]
fn the_example_scene_is_read_with_every_key() {
    let scene = example();
    assert_eq!(scene.frame_id, "world");
    assert_eq!(scene.config.mode, Mode::OnAll);
    assert_eq!(scene.config.budget.time_ns, Some(2_000_000));
    assert_eq!(scene.config.budget.units, Some(100_000));
    assert_eq!(scene.config.limits.bodies, 1000);
    assert_eq!(scene.sources[0].timeout_ns, 200_000_000);
    assert_eq!(scene.sources[1].timeout_ns, 500_000_000);
    assert_eq!(scene.bodies.len(), 12);
    let link = scene
        .bodies
        .iter()
        .find(|b| b.name == "arm_link_2")
        .unwrap();
    assert_eq!(
        (link.shapes.len(), link.source, link.continuous),
        (2, Some(0), true)
    );
    let base = scene.bodies.iter().find(|b| b.name == "arm_base").unwrap();
    assert_eq!((base.id, base.source), (BodyId(10), None));
    // The least free ids, in the file's order.
    assert_eq!(scene.bodies[0].id, BodyId(1));
    assert_eq!(scene.bodies[6].id, BodyId(6));
    assert_eq!(scene.bodies[11].id, BodyId(12));
    assert_eq!(scene.rules.len(), 2);
    assert_eq!(scene.rules[1].report_within_m, Some(0.1));
}

#[test]
fn an_empty_scene_is_legal() {
    let scene = Scene::parse("", "empty.toml", Path::new("")).unwrap();
    assert!(scene.bodies.is_empty() && scene.sources.is_empty());
    assert_eq!(scene.frame_id, "world");
}
