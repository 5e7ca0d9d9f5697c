//! Goal: files are read as their formats specify, bad ones are refused with the line, and no input causes a panic.
//! Method: hand-written files with known results, another reader as a reference, and seeded damage.

use super::*;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/meshes");
pub(super) const DAE: &str = include_str!("../../../tests/data/meshes/inch_y_up.dae");
const OBJ: &str = include_str!("../../../tests/data/meshes/wedge.obj");
const STL_TEXT: &str = include_str!("../../../tests/data/meshes/wedge_text.stl");
const STL: &[u8] = include_bytes!("../../../tests/data/meshes/wedge.stl");

pub(super) fn ok(kind: Kind, text: &str) -> Soup {
    parse(kind, text.as_bytes()).unwrap_or_else(|flaw| panic!("{flaw:?}"))
}

/// Line and text of a refusal.
pub(super) fn refused(kind: Kind, text: &str) -> (usize, String) {
    match parse(kind, text.as_bytes()) {
        Err(Flaw {
            line,
            error: FlawKind::Format(text),
        }) => (line.unwrap_or(0), text),
        other => panic!("{other:?}"),
    }
}

pub(super) fn volume(soup: &Soup) -> f64 {
    let corner = |k: u32| soup.vertices[k as usize].coords;
    let of = |face: &[u32; 3]| corner(face[0]).dot(&corner(face[1]).cross(&corner(face[2]))) / 6.0;
    soup.faces.iter().map(of).sum()
}

/// Such a mark stands in front of what some editors save.
#[test]
fn bug_files_that_begin_with_a_mark_of_utf_8_were_refused() {
    let marked = |text: &[u8]| [b"\xEF\xBB\xBF", text].concat();
    for (kind, text) in [(Kind::Obj, OBJ), (Kind::Stl, STL_TEXT), (Kind::Dae, DAE)] {
        let plain = ok(kind, text);
        let soup = parse(kind, &marked(text.as_bytes())).unwrap();
        assert_eq!((soup.vertices, soup.faces), (plain.vertices, plain.faces));
    }
    let long = format!("solid {}", "x".repeat(100));
    assert_eq!(stl::claimed(&marked(long.as_bytes())), None);
    // The header of a binary file is any 80 bytes.
    let mut binary = STL.to_vec();
    binary[..8].copy_from_slice(b"\xEF\xBB\xBFsolid");
    assert_eq!(
        parse(Kind::Stl, &binary).unwrap().vertices.len(),
        parse(Kind::Stl, STL).unwrap().vertices.len()
    );
}

/// Places from 1 count in the whole file.
#[test]
fn bug_an_obj_whose_faces_come_before_their_vertices_was_refused() {
    let soup = ok(
        Kind::Obj,
        "v 0 0 0\nf 1 2 3 4\nv 1 0 0\nv 1 1 0\nf 1 -2 -1\nv 0 1 0\nf 1 2 4\n",
    );
    assert_eq!(soup.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 1, 3]]);
    let (line, text) = refused(Kind::Obj, "v 0 0 0\nf 1 2 9\nv 1 0 0\n\nf 1 2 7\n");
    assert_eq!(line, 2);
    assert!(
        text.contains("names vertex \"9\", but the file has 2"),
        "{text}"
    );
    let (line, text) = refused(Kind::Obj, "v 0 0 0\nf 1 2 3\nf 1 1 -2\nv 1 0 0\nv 1 1 0\n");
    assert_eq!(line, 3);
    assert!(text.contains("\"-2\", but 1 came before"), "{text}");
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
            "names vertex \"2\", but the file has 1",
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

/// A comment ends with its line, whatever its last character: the next line, here the last face, was lost with it.
#[test]
fn bug_a_comment_that_ends_in_a_backslash_joins_no_line() {
    let soup = ok(
        Kind::Obj,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n# faces, by C:\\models\\\nf 1 2 3\nf 1 \\\n 3 2 # x \\\nf 2 3 1\n",
    );
    assert_eq!(soup.faces, [[0, 1, 2], [0, 2, 1], [1, 2, 0]]);
}

#[test]
fn bug_lines_may_end_in_a_carriage_return_alone() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n";
    for end in ["\n", "\r\n", "\r"] {
        let (line, message) = refused(Kind::Obj, &text.replace('\n', end));
        assert!(line == 5 && message.contains("vertex \"9\""), "{message}");
        assert_eq!(
            ok(Kind::Obj, &text.replace("f 1 2 9", "").replace('\n', end)).faces,
            [[0, 1, 2]]
        );
        let stl = STL_TEXT.replace("\r\n", "\n").replace('\n', end);
        assert_eq!(ok(Kind::Stl, &stl).faces.len(), 8);
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
    std::fs::write(folder.join("huge.stl"), &bytes).unwrap();
    let file = File::options().append(true).open(folder.join("huge.stl"));
    file.unwrap().set_len(84 + 50 * 10_000_000).unwrap();
    let error = read(&folder, "huge.stl").unwrap_err();
    std::fs::remove_dir_all(&folder).unwrap();
    let wanted = ShapeError::TooManyTriangles {
        given: Some(10_000_000),
    };
    assert_eq!(error, wanted.of_file(&folder.join("huge.stl")));
    assert!(
        (error.to_string())
            .contains("huge.stl: the mesh has 10000000 triangles, more than 8000000: simplify it")
    );
}

/// A file that is no STL was reported as one of hundreds of millions of triangles.
#[test]
fn bug_a_count_that_the_file_has_no_room_for_is_told_as_damage() {
    let folder = std::env::temp_dir().join(format!("sweepd_short_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("short.stl"), [0xe7; 5000]).unwrap();
    let error = read(&folder, "short.stl").unwrap_err().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    let wanted = "says 3890735079 triangles, which take 194536754034 bytes, but the file has 5000: it is cut off";
    assert!(error.contains(wanted), "{error}");
}

#[test]
fn bug_a_file_that_is_too_long_is_told_to_be_simplified() {
    let folder = std::env::temp_dir().join(format!("sweepd_long_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = File::create(folder.join("long.obj")).unwrap();
    file.set_len(FILE_BYTES_MAX + 1).unwrap();
    let error = read(&folder, "long.obj").unwrap_err().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    let wanted = "long.obj: the file has 2147483649 bytes, more than 2147483648: simplify the mesh, or split it";
    assert!(error.ends_with(wanted), "{error}");
}

#[test]
fn faces_past_the_limit_are_refused_without_reading_on() {
    let mut soup = Soup {
        vertices: vec![Point::origin(); 3],
        faces: vec![[0, 1, 2]; TRIANGLES_MAX],
        warnings: vec![],
    };
    let given = None;
    match soup.face([0, 1, 2]) {
        Err(Flaw {
            error: FlawKind::Shape(error),
            ..
        }) => assert_eq!(error, ShapeError::TooManyTriangles { given }),
        other => panic!("{other:?}"),
    }
    assert_eq!(soup.faces.len(), TRIANGLES_MAX);
}

#[test]
fn a_mirroring_scale_keeps_the_outside_outside() {
    for scale in [
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [-2.0, -1.0, 3.0],
        [-1.0, -1.0, -1.0],
    ] {
        let (path, bytes) = read(Path::new(DATA), "wedge.stl").unwrap();
        let soup = load(&path, &bytes, Some(scale)).unwrap();
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

/// A small generator of its own, so that the damage is the same everywhere (`SplitMix64`: Steele, Lea, Flood 2014).
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
