//! Goal: shells that face inwards are turned, or kept if they lie in another. Method: small solids by hand.

use super::*;
use crate::shape::mesh::tests::{ball, cuboid, joined, says, winding};

#[test]
fn law_3_3_an_inverted_shell_is_turned_round_with_all_it_holds() {
    // Outer shell and cavity both inverted: the outer lies in no other, so both are turned.
    let parts = [
        cuboid([5.0, 0.0, 0.0], 2.0, true),
        cuboid([5.0, 0.0, 0.0], 1.0, false),
    ];
    let (vertices, faces) = joined(&parts);
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    assert!(says(&mesh, "1 of 2 shells faced inwards"));
    assert_eq!(winding(&mesh, 5.0, 0.1, 0.2), 0, "in the cavity");
    assert_eq!(winding(&mesh, 6.5, 0.1, 0.2), 1, "in the wall");
}

#[test]
fn law_3_3_a_cavity_within_a_shell_is_kept() {
    let parts = [cuboid([0.0; 3], 2.0, false), cuboid([0.0; 3], 1.0, true)];
    let (vertices, faces) = joined(&parts);
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    assert!(!says(&mesh, "faced inwards"));
    assert_eq!(mesh.shells().len(), 2);
    assert_eq!(winding(&mesh, 0.1, 0.2, 0.3), 0);
    assert_eq!(winding(&mesh, 1.5, 0.2, 0.3), 1);
}

/// A pocket was one if the face it is flush with looked to one side of x, but solid if it looked to the other.
#[test]
fn bug_law_3_3_a_pocket_flush_with_a_face_is_one_whichever_way_the_face_looks() {
    for k in 0..6 {
        let side = if k < 3 { 0.75 } else { -0.75 };
        let mut centre = [0.0; 3];
        centre[k % 3] = side;
        let parts = [cuboid([0.0; 3], 1.0, false), cuboid(centre, 0.25, true)];
        let (vertices, faces) = joined(&parts);
        let mesh = Mesh::new(vertices, faces, None).unwrap();
        assert!(!says(&mesh, "faced inwards"), "{centre:?}");
        let [x, y, z] = centre.map(|x| x + 0.01);
        assert_eq!(winding(&mesh, x, y, z), 0, "{centre:?}");
        assert_eq!(winding(&mesh, -x, -y, -z), 1, "{centre:?}");
    }
}

/// With every corner on the other's surface: a slot from wall to wall is within it, a filling of the gap of a U is not.
#[test]
fn bug_law_3_3_a_shell_that_touches_with_every_corner_is_held_where_its_middle_is() {
    let stretched = |(vertices, faces): (Vec<Point>, Vec<[u32; 3]>), by: [f64; 3]| {
        let by = Vec3::from(by);
        let all: Vec<Point> = (vertices.iter())
            .map(|v| Point::from(v.coords.component_mul(&by)))
            .collect();
        (all, faces)
    };
    for k in 0..3 {
        let mut thin = [1.0; 3];
        thin[k] = 0.25;
        let slot = stretched(cuboid([0.0; 3], 1.0, true), thin);
        let (vertices, faces) = joined(&[cuboid([0.0; 3], 1.0, false), slot]);
        let mesh = Mesh::new(vertices, faces, None).unwrap();
        assert!(!says(&mesh, "faced inwards"), "{k}");
        assert_eq!(winding(&mesh, 0.01, 0.02, 0.03), 0, "{k}");
    }
    // A U of eight corners, extruded along z, open at the top; the filling is narrower and lower than its walls.
    let outline = [
        [0.0, 0.0],
        [3.0, 0.0],
        [3.0, 3.0],
        [2.0, 3.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [0.0, 3.0],
    ];
    let u: Vec<Point> = (outline
        .iter()
        .flat_map(|[x, y]| [0.0, 3.0].map(|z| Point::new(*x, *y, z))))
    .collect();
    let ends = [
        [0, 1, 4],
        [0, 4, 5],
        [1, 2, 3],
        [1, 3, 4],
        [5, 6, 7],
        [5, 7, 0],
    ];
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for [a, b, c] in ends {
        faces.extend([[2 * a, 2 * c, 2 * b], [2 * a + 1, 2 * b + 1, 2 * c + 1]]);
    }
    for k in 0..8 {
        let (a, b) = (2 * k, 2 * ((k + 1) % 8));
        faces.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
    let block = cuboid([1.5, 1.75, 1.5], 0.5, true);
    let (vertices, faces) = joined(&[(u, faces), block]);
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    assert!(mesh.is_solid() && mesh.shells().len() == 2);
    assert!(says(&mesh, "1 of 2 shells faced inwards"));
    assert_eq!(winding(&mesh, 1.51, 1.76, 1.52), 1);
}

/// Thousands of shells next to and within each other: through the tree and face by face the results are as one by one.
#[test]
fn many_shells_are_each_held_or_turned() {
    let n = 12;
    let mut parts = Vec::new();
    let at = |i: i32| f64::from(i) / f64::from(n) - 0.49;
    for i in 0..n {
        for j in 0..n {
            // In the plate a pocket, or a pocket with a pebble; next to it a pebble that faces inwards.
            parts.push(cuboid([at(i), at(j), 0.0], 0.03, true));
            if (i + j) % 2 == 0 {
                parts.push(cuboid([at(i), at(j), 0.0], 0.01, false));
            }
            parts.push(cuboid([at(i), at(j), 2.0], 0.03, true));
        }
    }
    for outer in [cuboid([0.0; 3], 0.6, false), {
        let ball = ball(20, 0.0);
        (ball.vertices().to_vec(), ball.faces().to_vec())
    }] {
        parts.push(outer);
        let (vertices, faces) = joined(&parts);
        let mesh = Mesh::new(vertices, faces, None).unwrap();
        parts.pop();
        assert!(
            says(&mesh, "144 of 361 shells faced inwards"),
            "{:?}",
            mesh.warnings()
        );
        for i in 0..n {
            for j in 0..n {
                let (x, y) = (at(i) + 0.001, at(j) + 0.002);
                assert_eq!(winding(&mesh, x, y, 0.0005), i64::from((i + j) % 2 == 0));
                assert_eq!(winding(&mesh, x + 0.02, y, 0.0005), 0);
                assert_eq!(winding(&mesh, x, y, 0.04), 1);
                assert_eq!(winding(&mesh, x, y, 2.0), 1);
            }
        }
    }
}

#[test]
fn an_inverted_shell_beside_another_is_turned_alone() {
    let parts = [
        cuboid([0.0; 3], 1.0, false),
        cuboid([9.0, 0.0, 0.0], 0.5, true),
    ];
    let (vertices, faces) = joined(&parts);
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    assert_eq!(winding(&mesh, 9.0, 0.1, 0.2), 1);
    assert_eq!(winding(&mesh, 0.0, 0.1, 0.2), 1);
}
