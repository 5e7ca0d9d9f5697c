//! Goal: files are read as their formats say, bad ones are refused with the line, and no bytes at all cause a panic.
//! Method: hand-written files with known answers, another reader as a twin, and seeded damage.

use super::*;
use crate::math::{Aabb, Vec3};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/meshes");
const DAE: &str = include_str!("../../../tests/data/meshes/inch_y_up.dae");
const OBJ: &str = include_str!("../../../tests/data/meshes/wedge.obj");
const STL_TEXT: &str = include_str!("../../../tests/data/meshes/wedge_text.stl");
const STL: &[u8] = include_bytes!("../../../tests/data/meshes/wedge.stl");

fn ok(kind: Kind, text: &str) -> Soup {
    parse(kind, text.as_bytes()).unwrap_or_else(|flaw| panic!("{flaw:?}"))
}

/// Line and text of a refusal.
fn refused(kind: Kind, text: &str) -> (usize, String) {
    match parse(kind, text.as_bytes()) {
        Err(Flaw {
            line,
            error: FlawKind::Format(text),
        }) => (line.unwrap_or(0), text),
        other => panic!("{other:?}"),
    }
}

fn volume(soup: &Soup) -> f64 {
    let corner = |k: u32| soup.vertices[k as usize].coords;
    let of = |face: &[u32; 3]| corner(face[0]).dot(&corner(face[1]).cross(&corner(face[2]))) / 6.0;
    soup.faces.iter().map(of).sum()
}

#[test]
fn a_dae_is_read_in_metres_with_z_up_and_its_nodes_in_place() {
    let soup = ok(Kind::Dae, DAE);
    assert_eq!((soup.vertices.len(), soup.faces.len()), (16, 24));
    let inch = 0.0254;
    // In inches, y up: the first box is turned by 90 degrees about z, so 4 x 2 x 6 about (10, 0, 0); the second keeps
    // 2 x 4 x 6 about (0, 0, 100). With z up, y becomes z and z becomes -y.
    for (half, centre, from) in [
        (Vec3::new(2.0, 3.0, 1.0), Vec3::new(10.0, 0.0, 0.0), 0),
        (Vec3::new(1.0, 3.0, 2.0), Vec3::new(0.0, -100.0, 0.0), 8),
    ] {
        let bounds = Aabb::of(&soup.vertices[from..from + 8]);
        assert!(
            (bounds.half_extents() - half * inch).amax() < 1e-15,
            "{bounds:?}"
        );
        assert!(
            (bounds.centre().coords - centre * inch).amax() < 1e-15,
            "{bounds:?}"
        );
    }
    // Both face outwards, the mirrored one too.
    let wanted = 2.0 * 48.0 * inch.powi(3);
    assert!(
        (volume(&soup) - wanted).abs() < 1e-12 * wanted,
        "{}",
        volume(&soup)
    );
    assert_eq!(
        soup.warnings,
        ["1 of its 2 geometries are not in its scene and were left out"]
    );
}

#[test]
fn up_axes_and_units_are_honoured() {
    let corner = |text: &str| ok(Kind::Dae, text).vertices[14];
    let plain = DAE.replace("meter=\"0.0254\"", "meter=\"1\"");
    // Corner 14 of the file is (-1, 2, 103) in the file's axes.
    assert_eq!(
        corner(&plain.replace("Y_UP", "Z_UP")),
        Point::new(-1.0, 2.0, 103.0)
    );
    assert_eq!(corner(&plain), Point::new(-1.0, -103.0, 2.0));
    assert_eq!(
        corner(&plain.replace("Y_UP", "X_UP")),
        Point::new(-2.0, -103.0, -1.0)
    );
    let missing = plain.replace("<up_axis>Y_UP</up_axis>", "");
    let soup = ok(Kind::Dae, &missing);
    assert_eq!(soup.vertices[14], Point::new(-1.0, -103.0, 2.0));
    assert!(
        soup.warnings[0].contains("Y_UP is taken"),
        "{:?}",
        soup.warnings
    );
}

#[test]
fn what_a_dae_holds_and_we_do_not_read_is_refused_with_its_line() {
    for (from, to, line, wanted) in [
        ("meter=\"0.0254\"", "meter=\"-1\"", 0, "its unit is -1 m"),
        ("Y_UP", "W_UP", 6, "write X_UP, Y_UP or Z_UP"),
        (
            "<scale>-1 1 1</scale>",
            "<lookat>0 0 0 1 0 0 0 0 1</lookat>",
            49,
            "<lookat> is not read",
        ),
        (
            "<scale>-1 1 1</scale>",
            "<skew>0 0 0 1 0 0 0</skew>",
            49,
            "<skew> is not read",
        ),
        (
            "<scale>-1 1 1</scale>",
            "<scale>-1 1</scale>",
            49,
            "has 2 numbers, not 3",
        ),
        (
            "<scale>-1 1 1</scale>",
            "<instance_node url=\"#mirrored\"/>",
            48,
            "too deep, too many or in a loop",
        ),
        (
            "instance_geometry url=\"#box\"",
            "instance_geometry url=\"other.dae#box\"",
            50,
            "another file",
        ),
        (
            "instance_geometry url=\"#box\"",
            "instance_controller url=\"#box\"",
            50,
            "without its skeleton",
        ),
        ("id=\"unused\"", "id=\"box\"", 59, "which is there twice"),
        (
            "count=\"24\"",
            "count=\"27\"",
            12,
            "says 27 numbers and has 24",
        ),
        (
            "count=\"8\"",
            "count=\"4000000000\"",
            17,
            "more than its array holds",
        ),
        (
            "count=\"8\"",
            "count=\"8\" offset=\"1\"",
            17,
            "more than its array holds",
        ),
        (
            "1 6 5</p>",
            "1 6 8</p>",
            41,
            "names corner 8, but there are 8",
        ),
        ("1 6 5</p>", "1 6</p>", 41, "no whole triangles"),
        (
            "<vcount>4 4 4 4",
            "<vcount>4 4 4 3",
            37,
            "<vcount> does not count",
        ),
        (
            "<vcount>4 4 4 4",
            "<vcount>4 4 4 5",
            36,
            "do not fit together",
        ),
        (
            "<triangles count=\"4\"",
            "<triangles count=\"5\"",
            39,
            "says 5 and has 4",
        ),
        ("-1 -2 -3   1", "-1 -2 nan   1", 12, "NaN is not finite"),
        ("-1 -2 -3   1", "-1 -2 x3   1", 12, "\"x3\" is not a number"),
        ("</COLLADA>", "", 1, "was opened but never closed"),
        (
            "<COLLADA ",
            "<!DOCTYPE a [<!ENTITY b \"c\">]><COLLADA ",
            1,
            "this is not XML",
        ),
    ] {
        assert!(DAE.contains(from), "{from}");
        let (at, text) = refused(Kind::Dae, &DAE.replacen(from, to, 1));
        assert!(text.contains(wanted), "{to}: {text}");
        assert!(at == line, "{to}: line {at}, not {line}: {text}");
    }
}

#[test]
fn strips_fans_and_polygons_with_several_lists_are_triangles() {
    let with = |primitive: &str| {
        let text = format!(
            "<COLLADA version=\"1.5.0\"><asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>
            <source id=\"s\"><float_array id=\"a\" count=\"15\">0 0 0  1 0 0  0 1 0  1 1 0  0 2 0</float_array>
            <technique_common><accessor source=\"#a\" count=\"5\" stride=\"3\"/></technique_common></source>
            <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices>
            {primitive}
            </mesh></geometry></library_geometries></COLLADA>"
        );
        ok(Kind::Dae, &text).faces
    };
    let input = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>";
    assert_eq!(
        with(&format!(
            "<tristrips count=\"1\">{input}<p>0 1 2 3 4</p></tristrips>"
        )),
        [[0, 1, 2], [2, 1, 3], [2, 3, 4]]
    );
    assert_eq!(
        with(&format!(
            "<trifans count=\"2\">{input}<p>0 1 3 2</p><p>2 3 4</p></trifans>"
        )),
        [[0, 1, 3], [0, 3, 2], [2, 3, 4]]
    );
    assert_eq!(
        with(&format!(
            "<polygons count=\"2\">{input}<p>0 1 3 2</p><p>2 3 4</p></polygons>"
        )),
        [[0, 1, 3], [0, 3, 2], [2, 3, 4]]
    );
    assert!(with(&format!("<lines count=\"1\">{input}<p>0 1</p></lines>")).is_empty());
}

#[test]
fn an_obj_has_negative_places_long_lines_and_polygons() {
    let soup = ok(
        Kind::Obj,
        "# a comment\no thing\nv 0 0 0 1\nv 2.5e-1 0 0\nv 1 1 0 # behind\nv 0 1 0\nvn 0 0 1\nf -4//1 \\\n -3//1 -2//1\nf 1/1/1 3/2/1 4/3/1\nf 1 2 3 4\n",
    );
    assert_eq!(soup.vertices.len(), 4);
    assert_eq!(soup.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3]]);
    for (text, line, wanted) in [
        ("v 0 0\n", 1, "three coordinates"),
        ("v 0 0 0\nv 1 x 0\n", 2, "\"x\" is not a number"),
        ("v 0 0 inf\n", 1, "inf is not finite"),
        (
            "v 0 0 0\nf 1 1 2\n",
            2,
            "names vertex \"2\", but 1 came before",
        ),
        ("v 0 0 0\nf 0 1 1\n", 2, "names vertex \"0\""),
        ("v 0 0 0\nf -2 1 1\n", 2, "names vertex \"-2\""),
        ("v 0 0 0\nf 1 1\n", 2, "has 2 corners"),
        ("v 0 0 0\nsurf 0 1 0 1\n", 2, "free-form surfaces are not"),
    ] {
        let (at, message) = refused(Kind::Obj, text);
        assert!(
            at == line && message.contains(wanted),
            "{text}: {at} {message}"
        );
    }
}

#[test]
fn an_stl_that_is_cut_off_or_damaged_is_refused() {
    let binary = |bytes: &[u8]| match parse(Kind::Stl, bytes) {
        Err(Flaw {
            error: FlawKind::Format(text),
            ..
        }) => text,
        other => panic!("{other:?}"),
    };
    assert!(
        binary(&STL[..STL.len() - 1])
            .contains("says 8 triangles, which take 484 bytes, but the file has 483")
    );
    assert!(binary(&STL[..50]).contains("neither a text STL"));
    assert!(binary(b"").contains("0 bytes are neither"));
    let newline = [STL, b"\n"].concat();
    assert_eq!(parse(Kind::Stl, &newline).unwrap().faces.len(), 8);
    for (from, to, line, wanted) in [
        (
            "endsolid wedge",
            "",
            58,
            "the file ends before `facet or endsolid`",
        ),
        (
            "endloop",
            "vertex 0 0 0",
            7,
            "expected `endloop`, found \"vertex\"",
        ),
        ("vertex 0 0", "vertex 0 zero", 4, "\"zero\" is not a number"),
        ("vertex 0 0", "vertex 0 1e999", 4, "inf is not finite"),
        (
            "outer loop",
            "outer lop",
            3,
            "expected `loop`, found \"lop\"",
        ),
    ] {
        let (at, text) = refused(Kind::Stl, &STL_TEXT.replacen(from, to, 1));
        assert!(at == line && text.contains(wanted), "{to}: {at} {text}");
    }
}

#[test]
fn too_many_triangles_are_refused_by_the_head_of_the_file() {
    let folder = std::env::temp_dir().join(format!("sweepd_load_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut bytes = vec![0; 80];
    bytes.extend(10_000_000_u32.to_le_bytes());
    bytes.extend([0; 100]);
    std::fs::write(folder.join("huge.stl"), &bytes).unwrap();
    let error = load(&folder, "huge.stl", None).unwrap_err();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(error, ShapeError::TooManyTriangles { given: 10_000_000 });
}

#[test]
fn a_mirroring_scale_keeps_the_outside_outside() {
    for scale in [
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [-2.0, -1.0, 3.0],
        [-1.0, -1.0, -1.0],
    ] {
        let soup = load(Path::new(DATA), "wedge.stl", Some(scale)).unwrap();
        let wanted = 1.5 * scale.iter().product::<f64>().abs();
        assert!((volume(&soup) - wanted).abs() < 1e-12, "{scale:?}");
        assert_eq!(soup.vertices.len(), 6);
    }
}

#[test]
fn another_reader_sees_the_same_triangles() {
    let loader = mesh_loader::Loader::default().merge_meshes(true);
    for (kind, bytes, name) in [
        (Kind::Stl, STL, "a.stl"),
        (Kind::Stl, STL_TEXT.as_bytes(), "a.stl"),
        (Kind::Obj, OBJ.as_bytes(), "a.obj"),
    ] {
        let ours = parse(kind, bytes).unwrap();
        let theirs = loader.load_from_slice(bytes, name).unwrap();
        let mesh = &theirs.meshes[0];
        assert_eq!(ours.faces.len(), mesh.faces.len());
        for (a, b) in ours.faces.iter().zip(&mesh.faces) {
            for k in 0..3 {
                let (p, q) = (ours.vertices[a[k] as usize], mesh.vertices[b[k] as usize]);
                assert_eq!(p, Point::from(q.map(f64::from)));
            }
        }
    }
}

/// A small generator of its own, so that the damage is the same everywhere (Steele, Lea, Flood 2014, SplitMix64).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((z ^ (z >> 31)) % bound as u64).unwrap_or(0)
    }
}

#[test]
fn no_damage_to_a_file_causes_a_panic() {
    let words: &[&[u8]] = &[
        b"-1",
        b"4294967296",
        b"1e308",
        b"nan",
        b"<",
        b"/>",
        b"\"",
        b"\0",
        b"\xff",
        b"f 1 2 3\n",
        b"#box",
        b" ",
        b"\\\n",
        b"vertex",
        b"<node>",
        b"</mesh>",
        b"solid",
    ];
    for seed in 0..4000 {
        let mut random = Random(seed);
        let (kind, whole) = [
            (Kind::Dae, DAE.as_bytes()),
            (Kind::Obj, OBJ.as_bytes()),
            (Kind::Stl, STL_TEXT.as_bytes()),
            (Kind::Stl, STL),
        ][random.below(4)];
        let mut bytes = whole.to_vec();
        for _ in 0..=random.below(4) {
            let at = random.below(bytes.len().max(1)).min(bytes.len());
            let end = (at + random.below(20)).min(bytes.len());
            match random.below(4) {
                0 => drop(bytes.drain(at..end)),
                1 => drop(bytes.splice(at..end, words[random.below(words.len())].iter().copied())),
                2 if at < bytes.len() => bytes[at] = random.below(256).to_le_bytes()[0],
                _ => bytes.truncate(end),
            }
        }
        let read = std::panic::catch_unwind(|| {
            if let Ok(mut soup) = parse(kind, &bytes) {
                assert!(
                    soup.faces
                        .iter()
                        .flatten()
                        .all(|k| (*k as usize) < soup.vertices.len())
                );
                weld::weld(&mut soup);
                assert!(
                    soup.faces
                        .iter()
                        .flatten()
                        .all(|k| (*k as usize) < soup.vertices.len())
                );
            }
        });
        assert!(read.is_ok(), "seed {seed}");
    }
}
