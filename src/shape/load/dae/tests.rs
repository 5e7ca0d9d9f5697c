//! Goal: a DAE is placed by its nodes, unit and up-axis, and content that is not supported is refused with its line.
//! Method: a hand-written file with known results, then one change to it per case.

use crate::math::{Aabb, Point, Vec3};
use crate::shape::load::Kind;
use crate::shape::load::tests::{DAE, ok, refused, volume};

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

/// The change to the file, and the line and text of the refusal.
const REFUSED: &[(&str, &str, usize, &str)] = &[
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
        "count=\"8\" stride=\"3\"",
        "count=\"4000000000\" stride=\"0\"",
        17,
        "has stride 0, but a corner takes 3 numbers",
    ),
    (
        "count=\"8\" stride=\"3\"",
        "count=\"8\" stride=\"2\"",
        17,
        "has stride 2, but a corner takes 3 numbers",
    ),
    (
        "count=\"8\" stride=\"3\"",
        "count=\"8\"",
        17,
        "has no stride, which means 1, but a corner takes 3 numbers",
    ),
    (
        "count=\"8\" stride=\"3\"",
        "count=\"8\" stride=\"4\"",
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
        "names corner \"8\", but there are 8",
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
];

#[test]
fn what_a_dae_holds_and_we_do_not_read_is_refused_with_its_line() {
    for (from, to, line, wanted) in REFUSED {
        assert!(DAE.contains(*from), "{from}");
        let (at, text) = refused(Kind::Dae, &DAE.replacen(from, to, 1));
        assert!(text.contains(wanted), "{to}: {text}");
        assert!(at == *line, "{to}: line {at}, not {line}: {text}");
    }
}

/// Each source is a separate list: a face of the first could reach into the second.
#[test]
fn bug_faces_of_a_list_that_was_read_before_stay_in_it() {
    let with = |last: u32| {
        let source = |id: &str| {
            format!(
                "<source id=\"{id}\"><float_array id=\"{id}a\" count=\"9\">0 0 0  1 0 0  0 1 0</float_array>
                <technique_common><accessor source=\"#{id}a\" count=\"3\" stride=\"3\"/></technique_common></source>
                <vertices id=\"{id}v\"><input semantic=\"POSITION\" source=\"#{id}\"/></vertices>"
            )
        };
        let face = |id: &str, last: u32| {
            format!(
                "<triangles count=\"1\"><input semantic=\"VERTEX\" source=\"#{id}v\" offset=\"0\"/><p>0 1 {last}</p></triangles>"
            )
        };
        format!(
            "<COLLADA version=\"1.5.0\"><asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>
            {}{}{}{}{}
            </mesh></geometry></library_geometries></COLLADA>",
            source("s"),
            source("t"),
            face("s", 2),
            face("t", 2),
            face("s", last)
        )
    };
    assert_eq!(
        ok(Kind::Dae, &with(2)).faces,
        [[0, 1, 2], [3, 4, 5], [0, 1, 2]]
    );
    let (_, text) = refused(Kind::Dae, &with(3));
    assert!(
        text.contains("names corner \"3\", but there are 3"),
        "{text}"
    );
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
