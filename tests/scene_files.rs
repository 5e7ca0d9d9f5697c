//! Goal: a scene file is read completely and strictly, and each mistake gives one error with file, line, body and the
//! fix. Method: the example scene, then one small wrong scene for each rule, compared with the words a user needs.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    reason = "tests stop at the first surprise, and compare numbers that are copied, not computed"
)]

use std::collections::BTreeSet;
use std::path::Path;

use sweepd::config::Mode;
use sweepd::ids::BodyId;
use sweepd::scene::{Request, Scene};
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
    let viewpoint = scene.config.viewpoint.as_ref().unwrap();
    assert_eq!(
        (viewpoint.body.as_deref(), viewpoint.half_m),
        (Some("camera"), Some(2.0))
    );
    assert_eq!(scene.sources[0].timeout_ns, 200_000_000);
    assert_eq!(scene.sources[1].timeout_ns, 500_000_000);
    assert_eq!(scene.bodies.len(), 13);
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
    // The least free ids, in the order of the file.
    assert_eq!(scene.bodies[0].id, BodyId(1));
    assert_eq!(scene.bodies[6].id, BodyId(6));
    assert_eq!(scene.bodies[11].id, BodyId(12));
    assert!(scene.bodies[12].deforms && !scene.bodies[11].deforms);
    assert_eq!(scene.rules.len(), 2);
    assert_eq!(scene.rules[1].report_within_m, Some(0.1));
}

#[test]
fn bug_a_viewpoint_looks_along_any_direction_that_is_not_zero() {
    for length in ["1e200", "3.0", "1e-200", "4.9e-324"] {
        let text = format!("[viewpoint]\ndirection = [0, -{length}, 0]\n");
        let scene = Scene::parse(&text, "scene.toml", Path::new("")).unwrap();
        let viewpoint = scene.config.viewpoint.unwrap();
        assert_eq!(viewpoint.direction, [0.0, -1.0, 0.0], "{length}");
    }
    let text = "[viewpoint]\ndirection = [0, 0, 0]\n";
    let error = Scene::parse(text, "scene.toml", Path::new("")).unwrap_err();
    assert!(error.to_string().contains("has no length"), "{error}");
}

/// The reader of each table lists all its keys in the error for an unknown key.
#[test]
fn the_example_scene_names_every_key_there_is() {
    let example = std::fs::read_to_string("launch-free-scripts/example_scene.toml").unwrap();
    let is_word_char = |c: char| c.is_alphanumeric() || c == '_';
    let words: BTreeSet<&str> = example.split(|c| !is_word_char(c)).collect();
    let told = |text: &str, lead: &str| -> Vec<String> {
        let error = Scene::parse(text, "keys.toml", Path::new(""))
            .unwrap_err()
            .to_string();
        let (_, words) = error.split_once(lead).expect(&error);
        words.trim().split(", ").map(str::to_owned).collect()
    };
    let of_shape = |kind: &str| format!("[[body]]\nname='b'\nshape={{type='{kind}',qqqqqqqq=1}}");
    let kinds = told(&of_shape("qqqqqqqq"), "write one of ");
    assert_eq!(kinds.len(), 10, "{kinds:?}");
    let mut scenes: Vec<String> = kinds.iter().map(|kind| of_shape(kind)).collect();
    scenes.extend(
        [
            "qqqqqqqq=1",
            "[run]\nqqqqqqqq=1",
            "[limits]\nqqqqqqqq=1",
            "[viewpoint]\nqqqqqqqq=1",
            "[[source]]\nqqqqqqqq=1",
            "[[source]]\nname='s'\nros2={type='tf',qqqqqqqq=1}",
            "[[body]]\nqqqqqqqq=1",
            "[[rule]]\nqqqqqqqq=1",
        ]
        .map(str::to_owned),
    );
    for text in scenes {
        for key in told(&text, "known keys are ") {
            assert!(words.contains(&*key), "{key} of {text}");
        }
    }
}

#[test]
fn the_edits_that_the_message_contract_shows_are_edits() {
    let contract = std::fs::read_to_string("msgs/README.md").unwrap();
    let (_, edits) = contract.split_once("## Edits").unwrap();
    let (_, json) = edits.split_once("```json\n").unwrap();
    let (json, _) = json.split_once("```").unwrap();
    let corners: Vec<u8> = (0..8_u8)
        .flat_map(|corner| [0, 1, 2].map(|axis| f64::from((corner >> axis) & 1)))
        .flat_map(f64::to_le_bytes)
        .collect();
    let faces = [[0_u32, 1, 3], [0, 3, 2]].concat();
    let faces = faces
        .iter()
        .cycle()
        .take(36)
        .flat_map(|at| at.to_le_bytes());
    let blobs: Vec<u8> = corners.into_iter().chain(faces).collect();
    let Request::Edits(request) = Request::parse(json.as_bytes(), &blobs).unwrap() else {
        panic!("a question");
    };
    assert_eq!(request.edits.len(), 11);
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
    assert_eq!(built.shapes.len(), 13);
    assert_eq!(library.len(), 14, "each shape once");
    assert!(built.shapes[12][0].is_deforming());
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
fn a_scene_is_built_again_of_its_text_and_the_files_that_were_kept() {
    let path = Path::new("launch-free-scripts/example_scene.toml");
    let (scene, mut library) = (example(), Library::keeping());
    let built = scene.build_shapes(&mut library, |_, _| {}).unwrap();
    let kept = library.take_kept();
    let names: Vec<_> = kept.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "../tests/data/meshes/wedge.obj",
            "../tests/data/meshes/wedge.stl"
        ]
    );
    // Files that were read are not read and stored again.
    scene.build_shapes(&mut library, |_, _| {}).unwrap();
    assert!(library.take_kept().is_empty());
    // With a path whose folder does not exist.
    let text = Scene::read_text(path).unwrap();
    let twin = Scene::parse_kept(&text, "/nowhere/scene.toml").unwrap();
    assert_eq!(twin.bodies, scene.bodies);
    let again = twin.build_shapes(&mut Library::of_kept(kept), |_, _| {});
    let show = |shape: &std::sync::Arc<sweepd::shape::Shape>| format!("{shape:?}");
    for (one, two) in built.shapes.iter().zip(&again.unwrap().shapes) {
        let (one, two): (Vec<_>, Vec<_>) = (
            one.iter().map(show).collect(),
            two.iter().map(show).collect(),
        );
        assert!(one == two);
    }
    let error = twin.build_shapes(&mut Library::of_kept(Default::default()), |_, _| {});
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("not among the files that were kept"),
        "{error}"
    );
}

#[test]
fn a_file_that_has_changed_is_kept_anew_and_takes_the_place_of_the_first() {
    let dir = std::env::temp_dir().join(format!("sweepd_kept_{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let text = |top: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {top}\nf 1 2 3\nf 1 2 4\n");
    let spec = ShapeSpec::Trimesh {
        vertices: vec![],
        faces: vec![],
        file: Some("a.obj".to_owned()),
        scale: None,
        solid: Some(false),
    };
    let high = |library: &mut Library| {
        let built = library.get(&spec, &dir).unwrap();
        built.shape.aabb.max.z.round()
    };
    let mut library = Library::keeping();
    let mut twin = Library::of_kept(Default::default());
    for (top, wanted) in [("1", 1.0), ("22.0", 22.0), ("1", 1.0)] {
        std::fs::write(dir.join("a.obj"), text(top)).unwrap();
        assert_eq!(high(&mut library), wanted);
        twin.add_kept(library.take_kept());
        assert_eq!(high(&mut twin), wanted);
    }
    std::fs::remove_dir_all(&dir).unwrap();
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

/// The error of a scene text; sources `one` and `two` are added if it has none of its own.
fn error(text: &str) -> String {
    match Scene::parse(text, "bad.toml", Path::new("tests/data/meshes")) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("this scene should be refused:\n{text}"),
    }
}

/// A ball that does not move, with further keys.
fn ball(name: &str, keys: &str) -> String {
    format!(
        "[[body]]\nname = \"{name}\"\nmoves = false\n{keys}\nshape = {{ type = \"sphere\", radius = 1 }}\n"
    )
}

/// A body that does not move, with this shape in line 4.
fn shaped(shape: &str) -> String {
    format!("[[body]]\nname = \"b\"\nmoves = false\nshape = {{ {shape} }}\n")
}

/// The cases of a file: lines `=> WANTED`, each followed by the text of a wrong scene; lines with `##` are comments.
fn cases(name: &str) -> Vec<(String, String)> {
    let path = format!("tests/data/scenes/{name}");
    let mut cases: Vec<(String, String)> = Vec::new();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        if let Some(wanted) = line.strip_prefix("=> ") {
            cases.push((String::new(), wanted.to_owned()));
        } else if let Some((text, _)) = cases.last_mut() {
            text.push_str(line);
            text.push('\n');
        } else {
            assert!(line.starts_with("##"), "{line}");
        }
    }
    cases
}

#[test]
fn each_wrong_shape_is_one_error_with_file_line_body_and_mend() {
    let text = std::fs::read_to_string("tests/data/scenes/wrong_shapes.txt").unwrap();
    let mut seen = 0;
    for line in text.lines().filter(|line| !line.starts_with("##")) {
        let (shape, wanted) = line.split_once(" => ").unwrap();
        let text = error(&shaped(shape));
        assert!(
            text.starts_with("bad.toml:4: body \"b\": "),
            "{shape}: {text}"
        );
        assert!(
            text.contains(wanted) && !text.contains('\n'),
            "{shape}: {text}"
        );
        seen += 1;
    }
    assert_eq!(seen, 45);
}

#[test]
fn each_wrong_body_and_setting_is_one_error_with_file_line_and_mend() {
    let mut seen = Vec::new();
    for name in ["wrong_bodies.txt", "wrong_settings.txt"] {
        let cases = cases(name);
        for (text, wanted) in &cases {
            let error = error(text);
            assert!(error.contains(wanted), "{text}\n{error}");
            assert!(
                error.starts_with("bad.toml:") && !error.contains('\n'),
                "{error}"
            );
        }
        seen.push(cases.len());
    }
    assert_eq!(seen, [40, 33]);
}

#[test]
fn a_file_that_cannot_be_read_is_told_by_its_name() {
    let error = Scene::load(Path::new("tests/data/scenes/none.toml")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("tests/data/scenes/none.toml: the scene file cannot be read")
    );
    assert_eq!(error.exit_code(), 2);
    let error = Scene::load(Path::new("tests/data/meshes/wedge.stl")).unwrap_err();
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn a_mesh_that_fails_when_it_is_built_names_file_line_and_body() {
    let folder = std::env::temp_dir().join(format!("sweepd_scene_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("empty.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n").unwrap();
    std::fs::write(folder.join("broken.obj"), "v 0 0 0\nv 1 oops 0\n").unwrap();
    let mut results = Vec::new();
    // A binary STL whose header announces ten million triangles.
    let head = [&[0; 80][..], &10_000_000_u32.to_le_bytes()].concat();
    std::fs::write(folder.join("huge.stl"), head).unwrap();
    let file = std::fs::File::options()
        .append(true)
        .open(folder.join("huge.stl"));
    file.unwrap().set_len(84 + 50 * 10_000_000).unwrap();
    std::fs::write(
        folder.join("far.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 2e9 0\nf 1 2 3\n",
    )
    .unwrap();
    for file in ["empty.obj", "broken.obj", "huge.stl", "far.obj"] {
        let text = ball("first", "") + &shaped(&format!("type = \"trimesh\", file = \"{file}\""));
        let scene = Scene::parse(&text, "scene.toml", &folder).unwrap();
        results.push(
            scene
                .build_shapes(&mut Library::new(), |_, _| {})
                .unwrap_err()
                .to_string(),
        );
    }
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(
        results[0].starts_with("scene.toml:9: body \"b\": ")
            && results[0].contains("empty.obj: the mesh has no triangle"),
        "{}",
        results[0]
    );
    assert!(
        results[1].starts_with("scene.toml:9: body \"b\": ")
            && results[1].contains("broken.obj:2: \"oops\""),
        "{}",
        results[1]
    );
    assert_eq!(
        results[2],
        format!(
            "scene.toml:9: body \"b\": {}: the mesh has 10000000 triangles, more than 8000000: simplify it, or split \
             it over several bodies",
            folder.join("huge.stl").display()
        )
    );
    assert!(
        results[3].contains("far.obj: the extent of the mesh is 2000000000 m: write a size"),
        "{}",
        results[3]
    );
}

#[test]
fn bug_that_a_mesh_is_what_the_scene_says_or_a_closed_one_a_solid_is_no_warning() {
    let tetra = "[[0,1,2],[0,3,1],[1,3,2],[0,2,3]]";
    let built = |faces: &str, solid: &str| {
        let corners = "vertices = [[0,0,0],[0,1,0],[1,0,0],[0,0,1]]";
        let shape = format!("type = \"trimesh\", {corners}, faces = {faces}{solid}");
        let scene = Scene::parse(&shaped(&shape), "scene.toml", Path::new("")).unwrap();
        let built = scene.build_shapes(&mut Library::new(), |_, _| {}).unwrap();
        (built.warnings, built.notes)
    };
    let line = "scene.toml:4: body \"b\": ";
    let solid = format!("{line}solid, because it is closed and consistently oriented");
    assert_eq!(built(tetra, ""), (vec![], vec![solid]));
    for said in [", solid = true", ", solid = false"] {
        assert_eq!(built(tetra, said), (vec![], vec![]));
    }
    let open = "[[0,1,2],[0,3,1],[1,3,2]]";
    assert_eq!(built(open, ", solid = false"), (vec![], vec![]));
    let (warnings, notes) = built(open, "");
    assert_eq!((warnings.len(), notes.len()), (1, 0), "{warnings:?}");
    assert!(
        warnings[0].starts_with(&format!("{line}surface, because it has 3 open edges"))
            && warnings[0].ends_with("close it, or say solid = false"),
        "{warnings:?}"
    );
}

#[test]
fn a_flat_hull_and_odd_sizes_are_told_when_they_are_built() {
    let built = |shape: &str| {
        let scene = Scene::parse(&shaped(shape), "scene.toml", Path::new("")).unwrap();
        scene.build_shapes(&mut Library::new(), |_, _| {})
    };
    let flat = built("type = \"convex\", vertices = [[0,0,0],[1,0,0],[0,1,0],[1,1,0]]");
    let error = flat.unwrap_err().to_string();
    assert!(
        error.starts_with("scene.toml:4: body \"b\": ") && error.contains("flat"),
        "{error}"
    );
    for (radius, wanted) in [("0.0004", "under 1 mm"), ("51", "over 100 m")] {
        let warnings = built(&format!("type = \"sphere\", radius = {radius}"))
            .unwrap()
            .warnings;
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(
            warnings[0].starts_with("scene.toml:4: body \"b\": ") && warnings[0].contains(wanted),
            "{warnings:?}"
        );
    }
    for radius in ["0.0005", "50"] {
        assert!(
            built(&format!("type = \"sphere\", radius = {radius}"))
                .unwrap()
                .warnings
                .is_empty()
        );
    }
}

#[test]
fn bug_a_scene_that_begins_with_a_mark_of_utf_8_is_read() {
    let scene = |text: &str| Scene::parse(text, "a.toml", Path::new("")).unwrap();
    assert_eq!(
        scene(&format!("\u{feff}{}", ball("a", ""))).bodies[0].name,
        "a"
    );
}

#[test]
fn odd_but_legal_things_are_notes() {
    let notes = |text: &str| Scene::parse(text, "a.toml", Path::new("")).unwrap().notes();
    assert!(notes("")[0].contains("no body"));
    // The example contains every key.
    assert!(example().notes().is_empty(), "{:?}", example().notes());
    let still = notes(&ball("a", "continuous = true"));
    assert!(still[0].contains("cannot move"), "{still:?}");
    let unread = notes(&ball("a", "teleport_m = 1.0"));
    assert!(unread[0].contains("teleport_m"), "{unread:?}");
    let hung = ball("a", "") + &ball("b", "attached_to = \"a\"\non_stale = \"hold\"");
    assert!(notes(&hung)[0].contains("on_stale"), "{:?}", notes(&hung));
    let run = "[run]\nbroad_phase = \"sap\"\nthreads = 2\n".to_owned() + &ball("a", "");
    assert!(notes(&run)[0].contains("threads"), "{:?}", notes(&run));
    let plane = "shape = { type = \"half_space\", normal = [0, 0, 1] }";
    let two = format!(
        "[[body]]\nname = \"a\"\nmoves = false\n{plane}\n[[body]]\nname = \"b\"\nmoves = false\n{plane}\n"
    );
    assert!(notes(&two)[0].ends_with("two half-spaces are never paired"));
    let more = two.replacen(
        plane,
        "shape = [{ type = \"half_space\", normal = [0, 0, 1] }, { type = \"sphere\", radius = 1.0 }]",
        1,
    );
    let more = notes(&more);
    assert!(more[0].contains("have half-spaces") && more[0].ends_with("their other shapes are"));
    let rule = "[[source]]\nname = \"s\"\n[[rule]]\naction = \"ignore\"\na = \"x*\"\nb = \"b\"\n"
        .to_owned()
        + &ball("b", "");
    let all = notes(&rule);
    assert!(all[0].contains("source \"s\" has no body"), "{all:?}");
    assert!(
        all[1].contains("rule 1: no body has the pattern \"x*\""),
        "{all:?}"
    );
    assert!(all[2].contains("no reason"), "{all:?}");
}

#[test]
fn the_last_rule_that_matches_decides_either_way_round() {
    let scene = example();
    assert_eq!(scene.rule_for("fixture", "parcel_2").unwrap().a, "parcel_*");
    assert_eq!(
        scene
            .rule_for("arm_base", "gripper")
            .unwrap()
            .report_within_m,
        Some(0.1)
    );
    assert!(scene.rule_for("parcel_1", "parcel_2").is_none());
}

#[test]
fn ten_thousand_bodies_share_one_shape() {
    let mut text = "[[source]]\nname = \"sim\"\n".to_owned();
    for k in 0..10_000 {
        text += &format!(
            "[[body]]\nname = \"part_{k}\"\nposition = [{k}, 0, 0]\nshape = {{ type = \"box\", half_extents = [0.1, 0.2, 0.3] }}\n"
        );
    }
    let scene = Scene::parse(&text, "many.toml", Path::new("")).unwrap();
    let mut library = Library::new();
    let built = scene.build_shapes(&mut library, |_, _| {}).unwrap();
    assert_eq!((built.shapes.len(), library.len()), (10_000, 1));
    assert_eq!(scene.origin.shape_lines[9_999], [2 + 4 * 10_000]);
}

#[test]
fn no_damage_to_a_scene_causes_a_panic() {
    let whole = std::fs::read_to_string("launch-free-scripts/example_scene.toml").unwrap();
    let words = [
        "nan",
        "-1",
        "1e400",
        "[",
        "]",
        "{",
        "}",
        "\"",
        "=",
        "\n",
        "[[body]]",
        "#",
        "0x",
        "id = 1\n",
        "'''",
        "\u{0}",
        "ü",
        ",",
        "1979-05-27",
    ];
    let mut state = 0x5eed_u64;
    let mut random = |bound: usize| {
        // SplitMix64 (Steele, Lea, Flood 2014), so that the damage is the same on every machine.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((z ^ (z >> 31)) % bound as u64).unwrap()
    };
    let mut refused = 0;
    for round in 0..1500 {
        let mut letters: Vec<char> = whole.chars().collect();
        for _ in 0..=random(3) {
            let at = random(letters.len());
            let end = (at + random(30)).min(letters.len());
            match random(3) {
                0 => drop(letters.drain(at..end)),
                1 => drop(letters.splice(at..end, words[random(words.len())].chars())),
                _ => drop(letters.splice(at..at, words[random(words.len())].chars())),
            }
        }
        let text: String = letters.into_iter().collect();
        let read = std::panic::catch_unwind(|| {
            Scene::parse(&text, "a.toml", Path::new("launch-free-scripts"))
        });
        match read.unwrap_or_else(|_| panic!("round {round} (seed 0x5eed) panics")) {
            Ok(scene) => assert_eq!(scene.origin.shape_lines.len(), scene.bodies.len()),
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("a.toml:"), "{error}");
            }
        }
    }
    assert!(refused > 500, "{refused}");
}
