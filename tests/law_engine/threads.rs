//! The number of threads a tick may use: set by the scene, published in the plan.

use std::path::Path;

use sweepd::scene::Scene;

use crate::rig::{Rig, ball, scene};

#[test]
fn threads_are_set_by_the_scene_and_told_in_the_plan_where_they_matter() {
    let read = |run: &str, bodies: &[String]| {
        Scene::parse(&scene(run, bodies), "scene.toml", Path::new("."))
    };
    let two = [ball(1, 0.0, ""), ball(2, 9.0, "")];
    assert_eq!(read("", &two).unwrap().config.threads, None);
    let said = read("[run]\nthreads = 3", &two).unwrap();
    assert_eq!(
        (said.config.threads, said.config.threads_here()),
        (Some(3), 3)
    );
    assert!(
        !plan_of(&said).contains("threads"),
        "few boxes share nothing"
    );
    for wrong in ["0", "9", "1.5", "\"two\""] {
        let fault = read(&format!("[run]\nthreads = {wrong}"), &two).unwrap_err();
        assert!(fault.to_string().contains("from 1 to 8"), "{fault}");
    }
    let many: Vec<String> = (1..=6_000)
        .map(|id| ball(id, 3.0 * id as f64, ""))
        .collect();
    let said = read("[run]\nthreads = 3", &many).unwrap();
    assert!(plan_of(&said).contains("3 at most"));
    let said = read("[run]\nthreads = 1", &many).unwrap();
    assert!(!plan_of(&said).contains("\"threads\""));
}

/// The plan of an engine for this scene, as JSON.
fn plan_of(scene: &Scene) -> String {
    let rig = Rig::of(scene);
    rig.engine.plan().to_json()
}
