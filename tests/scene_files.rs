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
use sweepd::shape::{Geometry, Library, ShapeSpec, build};

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

#[test]
fn the_example_scene_is_built_and_equal_shapes_are_one() {
    let mut library = Library::new();
    let built = example().build_shapes(&mut library, |_, _| {}).unwrap();
    assert_eq!(built.shapes.len(), 12);
    assert_eq!(library.len(), 13, "each shape once");
    let again = example().build_shapes(&mut library, |_, _| {}).unwrap();
    assert!(std::sync::Arc::ptr_eq(
        &built.shapes[0][0],
        &again.shapes[0][0]
    ));
    drop((built, again));
    library.prune();
    assert!(library.is_empty());
}

#[test]
fn the_three_wedges_are_the_same_solid() {
    for file in ["wedge.obj", "wedge.stl", "wedge_text.stl"] {
        let spec = ShapeSpec::Trimesh {
            vertices: vec![],
            faces: vec![],
            file: Some(file.to_owned()),
            scale: None,
            solid: None,
        };
        let built = build(&spec, Path::new("tests/data/meshes")).unwrap();
        let Geometry::Mesh(mesh) = &built.shape.geometry else {
            panic!("a mesh");
        };
        assert!(mesh.is_solid(), "{file}");
        assert_eq!(
            (mesh.vertices().len(), mesh.faces().len()),
            (6, 8),
            "{file}"
        );
        let volume: f64 = (0..8)
            .map(|k| mesh.triangle(k).map(|p| p.coords))
            .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
            .sum();
        assert!((volume - 1.5).abs() < 1e-12, "{file} {volume}");
    }
}
