//! Goal: meshes are built as specified: shells, orientation, solids, tree, inside tests. Method: small solids by hand.

use super::*;

pub(super) fn cuboid(centre: [f64; 3], half: f64, inward: bool) -> (Vec<Point>, Vec<[u32; 3]>) {
    let vertices = (0..8u32)
        .map(|i| {
            let at = |k: u32| if i >> k & 1 == 1 { half } else { -half };
            Point::from(Vec3::from(centre) + Vec3::new(at(0), at(1), at(2)))
        })
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut faces: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]])
        .collect();
    if inward {
        for face in &mut faces {
            face.swap(1, 2);
        }
    }
    (vertices, faces)
}

pub(super) fn joined(parts: &[(Vec<Point>, Vec<[u32; 3]>)]) -> (Vec<Point>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (v, f) in parts {
        let first = u32::try_from(vertices.len()).unwrap();
        vertices.extend_from_slice(v);
        faces.extend(f.iter().map(|face| face.map(|i| i + first)));
    }
    (vertices, faces)
}

pub(super) fn winding(mesh: &Mesh, x: f64, y: f64, z: f64) -> i64 {
    Inside::default().run(mesh, Point::new(x, y, z), |_| true)
}

pub(super) fn says(mesh: &Mesh, text: &str) -> bool {
    mesh.warnings().iter().any(|w| w.contains(text))
}

#[test]
fn a_closed_box_is_a_solid_and_an_open_one_a_surface() {
    let (vertices, mut faces) = cuboid([0.0; 3], 1.0, false);
    let solid = Mesh::new(vertices.clone(), faces.clone(), None).unwrap();
    assert!(solid.is_solid() && solid.warnings().is_empty(), "bug: told");
    assert_eq!(winding(&solid, 0.0, 0.0, 0.0), 1);
    assert_eq!(winding(&solid, 3.0, 0.0, 0.0), 0);
    assert_eq!(winding(&solid, -3.0, 1.0, 1.0), 0, "along an edge");
    assert_eq!(winding(&solid, -3.0, 0.0, 0.0), 0, "through diagonals");
    faces.pop();
    let open = Mesh::new(vertices.clone(), faces.clone(), None).unwrap();
    let why = "surface, because it has 3 open edges and 0 edges whose faces disagree: close it, or say solid = false";
    assert!(!open.is_solid() && says(&open, why));
    let said = Mesh::new(vertices.clone(), faces.clone(), Some(false)).unwrap();
    assert!(!said.is_solid() && said.warnings().is_empty(), "bug: told");
    let refused = Mesh::new(vertices, faces, Some(true)).unwrap_err();
    assert!(refused.to_string().contains("3 open edges"), "{refused}");
}

#[test]
fn faces_that_disagree_are_turned_when_the_scene_says_solid() {
    let (vertices, mut faces) = cuboid([0.0; 3], 1.0, true);
    faces[3].swap(1, 2);
    faces[7].swap(1, 2);
    let surface = Mesh::new(vertices.clone(), faces.clone(), None).unwrap();
    assert!(!surface.is_solid());
    let solid = Mesh::new(vertices, faces, Some(true)).unwrap();
    assert!(solid.is_solid() && says(&solid, "faces turned"));
    assert_eq!(winding(&solid, 0.3, 0.2, 0.1), 1);
}

#[test]
fn repeated_vertices_of_stl_files_are_one_place() {
    let (vertices, faces) = cuboid([0.0; 3], 1.0, false);
    let soup: Vec<Point> = faces
        .iter()
        .flatten()
        .map(|&v| vertices[v as usize])
        .collect();
    let triples = (0u32..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh::new(soup, triples, None).unwrap();
    assert!(mesh.is_solid());
    assert_eq!(mesh.shells().len(), 1);
}

#[test]
fn odd_faces_are_counted_and_bad_input_is_refused() {
    let (mut vertices, mut faces) = cuboid([0.0; 3], 1.0, false);
    vertices.push(Point::new(40.0, 0.0, 0.0));
    faces.push([0, 1, 1]);
    faces.push([0, 2, 3]);
    let mesh = Mesh::new(vertices.clone(), faces.clone(), None).unwrap();
    assert!(says(&mesh, "1 faces without an area"));
    assert!(says(&mesh, "1 faces on the same corners"));
    assert!(says(&mesh, "1 vertices that no face names"));
    assert!(mesh.aabb().max.x < 2.0, "an unnamed vertex is no geometry");

    let bad = |v: Vec<Point>, f: Vec<[u32; 3]>| Mesh::new(v, f, None).unwrap_err().to_string();
    assert!(bad(vertices.clone(), vec![[0, 1, 99]]).contains("names vertex 99"));
    assert!(bad(vertices.clone(), vec![]).contains("no triangle"));
    assert!(bad(vertices.clone(), vec![[0, 1, 1]]).contains("no triangle"));
    vertices[2].y = f64::NAN;
    assert!(bad(vertices, faces).contains("vertex 2 is NaN"));
}

/// Some exporters write every face a second time the other way round. The edges cancelled, so such a box was a solid,
/// but no point was inside.
#[test]
fn bug_a_double_sided_box_was_a_solid_without_an_inside() {
    let (vertices, front) = cuboid([0.0; 3], 1.0, false);
    let back = |face: &[u32; 3]| [face[0], face[2], face[1]];
    let behind: Vec<[u32; 3]> = front
        .iter()
        .chain(&front.iter().map(back).collect::<Vec<_>>())
        .copied()
        .collect();
    let beside: Vec<[u32; 3]> = front.iter().flat_map(|face| [*face, back(face)]).collect();
    // Which of the two comes first, another from face to face.
    let mixed: Vec<[u32; 3]> = beside
        .chunks(2)
        .zip(0..)
        .flat_map(|(two, k)| {
            if k % 3 == 0 {
                [two[1], two[0]]
            } else {
                [two[0], two[1]]
            }
        })
        .collect();
    for faces in [behind, beside, mixed] {
        for said in [None, Some(true)] {
            let mesh = Mesh::new(vertices.clone(), faces.clone(), said).unwrap();
            assert!(mesh.is_solid() && mesh.faces().len() == 12);
            let volume: f64 = (0..12)
                .map(|face| {
                    let [a, b, c] = mesh.triangle(face).map(|p| p.coords);
                    a.dot(&b.cross(&c)) / 6.0
                })
                .sum();
            assert!((volume - 8.0).abs() < 1e-9, "{volume}");
            assert!(says(&mesh, "12 faces on the same corners"));
        }
        let mesh = Mesh::new(vertices.clone(), faces, Some(false)).unwrap();
        assert!(!mesh.is_solid() && mesh.faces().len() == 24);
    }
    // A wall that two boxes share stays: without it, neither is closed.
    let (more, faces) = cuboid([2.0, 0.0, 0.0], 1.0, false);
    let at = |p: &Point| vertices.iter().position(|q| q == p);
    let mut both = vertices.clone();
    let places: Vec<u32> = more
        .iter()
        .map(|p| {
            let place = at(p).unwrap_or_else(|| {
                both.push(*p);
                both.len() - 1
            });
            u32::try_from(place).unwrap()
        })
        .collect();
    let faces: Vec<[u32; 3]> = front
        .iter()
        .copied()
        .chain(faces.iter().map(|face| face.map(|v| places[v as usize])))
        .collect();
    assert_eq!(both.len(), 12);
    let mesh = Mesh::new(both, faces, None).unwrap();
    assert!(mesh.is_solid() && mesh.faces().len() == 24);
    // So do both sides of a plug in a hole: without the one, the plug would be hollow.
    let (mut block, outer) = cuboid([0.0; 3], 2.0, false);
    let first = u32::try_from(block.len()).unwrap();
    block.extend(&vertices);
    let plug = front.iter().map(|face| face.map(|v| v + first));
    let plug: Vec<[u32; 3]> = plug.collect();
    let hole: Vec<[u32; 3]> = plug.iter().map(back).collect();
    for inner in [[&hole, &plug], [&plug, &hole]] {
        let faces = [&outer, inner[0], inner[1]].into_iter().flatten().copied();
        let mesh = Mesh::new(block.clone(), faces.collect(), None).unwrap();
        assert!(mesh.is_solid() && mesh.faces().len() == 36);
    }
}

#[test]
fn the_box_at_a_pose_holds_every_vertex_and_touches_the_outermost() {
    let (vertices, faces) = cuboid([7.0, 1.0, -2.0], 0.5, false);
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    for step in 0..50 {
        let turn = Vec3::new(0.3, 0.7, -0.2) * f64::from(step);
        let pose = Pose::new(Vec3::new(1e7, -3.0, 2.0), turn);
        let tight = Aabb::of(&mesh.vertices().iter().map(|v| pose * v).collect::<Vec<_>>());
        let got = mesh.aabb_at(&pose);
        assert!(got.holds(&tight), "{got:?} {tight:?}");
        assert!(tight.widened(1e-7).holds(&got), "{got:?} {tight:?}");
    }
}

#[test]
fn the_box_of_a_large_mesh_holds_it_and_is_hardly_larger() {
    // A sphere of many triangles, the worst case of a table of directions, and a plate with its corners.
    let mut vertices = vec![Point::new(0.0, 0.0, 1.0), Point::new(0.0, 0.0, -1.0)];
    let mut faces = Vec::new();
    let (rows, columns) = (20u32, 40u32);
    for i in 1..rows {
        for j in 0..columns {
            let theta = std::f64::consts::PI * f64::from(i) / f64::from(rows);
            let phi = std::f64::consts::TAU * f64::from(j) / f64::from(columns);
            vertices.push(Point::new(
                theta.sin() * phi.cos(),
                theta.sin() * phi.sin(),
                theta.cos(),
            ));
            let at = |i: u32, j: u32| 2 + (i - 1) * columns + j % columns;
            if i > 1 {
                faces.push([at(i - 1, j), at(i, j), at(i, j + 1)]);
                faces.push([at(i - 1, j), at(i, j + 1), at(i - 1, j + 1)]);
            } else {
                faces.push([0, at(1, j), at(1, j + 1)]);
            }
            if i == rows - 1 {
                faces.push([1, at(i, j + 1), at(i, j)]);
            }
        }
    }
    let plate: Vec<Point> = (vertices.iter())
        .map(|v| Point::new(3.0 * v.x.signum() * v.x.abs().sqrt(), v.y, 0.01 * v.z))
        .collect();
    for points in [vertices, plate] {
        let mesh = Mesh::new(points, faces.clone(), None).unwrap();
        assert!(mesh.is_solid() && mesh.outline.is_some());
        for k in 0..200 {
            let turn = Vec3::new(0.31, 0.17, -0.53) * f64::from(k) * 0.1;
            let pose = Pose::new(Vec3::new(5.0, -3.0, 2.0), turn);
            let tight = Aabb::of(&mesh.vertices().iter().map(|v| pose * v).collect::<Vec<_>>());
            let got = mesh.aabb_at(&pose);
            assert!(got.holds(&tight), "{k} {got:?} {tight:?}");
            assert!(
                tight.widened(0.02 * mesh.radius()).holds(&got),
                "{k} {got:?} {tight:?}"
            );
            assert!(
                k > 0 || tight.widened(1e-6).holds(&got),
                "along its axes it is exact"
            );
        }
    }
}

/// A closed ball of 4 n (n - 1) triangles, with bumps of this size.
pub(crate) fn ball(n: u32, bump: f64) -> Mesh {
    let (mut vertices, mut faces) = (vec![Point::new(0.0, 0.0, 1.0)], Vec::new());
    for row in 1..n {
        for column in 0..2 * n {
            let (theta, phi) = (
                std::f64::consts::PI * f64::from(row) / f64::from(n),
                std::f64::consts::PI * f64::from(column) / f64::from(n),
            );
            let r = 1.0 + bump * (5.0 * theta).sin() * (3.0 * phi).cos();
            vertices.push(Point::new(
                r * theta.sin() * phi.cos(),
                r * theta.sin() * phi.sin(),
                r * theta.cos(),
            ));
        }
    }
    let last = u32::try_from(vertices.len()).unwrap();
    vertices.push(Point::new(0.0, 0.0, -1.0));
    let at = |row: u32, column: u32| 1 + (row - 1) * 2 * n + column % (2 * n);
    for column in 0..2 * n {
        faces.push([0, at(1, column), at(1, column + 1)]);
        faces.push([last, at(n - 1, column + 1), at(n - 1, column)]);
        for row in 1..n - 1 {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column + 1), at(row + 1, column));
            faces.extend([[a, d, c], [a, c, b]]);
        }
    }
    Mesh::new(vertices, faces, None).unwrap()
}

/// A sheet of `n` by `n` squares of side 1 in z = 0, each of two triangles.
pub(super) fn sheet(n: u32) -> Mesh {
    let at = |i: u32, j: u32| Point::new(f64::from(i), f64::from(j), 0.0);
    let vertices = (0..=n).flat_map(|i| (0..=n).map(move |j| at(i, j)));
    let square = |i: u32, j: u32| {
        let (a, b) = (i * (n + 1) + j, (i + 1) * (n + 1) + j);
        [[a, b, b + 1], [a, b + 1, a + 1]]
    };
    let faces = (0..n).flat_map(|i| (0..n).flat_map(move |j| square(i, j)));
    Mesh::new(vertices.collect(), faces.collect(), Some(false)).unwrap()
}

/// If a vertex lists its neighbours, they are those found face by face; on a border, and where two rings touch, it
/// lists none.
#[test]
fn the_ring_of_a_vertex_holds_each_neighbour_once() {
    let ball = ball(12, 0.1);
    let sides = u32::try_from(3 * ball.faces().len()).unwrap();
    for side in 0..sides {
        let mut round = Vec::new();
        let faces = ball
            .go_round(side, |side| round.push(ball.start_of(side)))
            .unwrap();
        let mut ring = ball.rings.of(ball.start_of(side)).to_vec();
        assert_eq!(ring.len(), faces as usize);
        for all in [&mut round, &mut ring] {
            all.sort_unstable();
            all.dedup();
        }
        assert_eq!(ring, round);
        assert_eq!(ring.len(), faces as usize);
    }
    let sheet = sheet(4);
    let listed = |v: u32| !sheet.rings.of(v).is_empty();
    assert_eq!((0..25).filter(|v| listed(*v)).count(), 9, "the inner ones");
    // Two boxes that share one corner by index.
    let (mut vertices, mut faces) = cuboid([0.0; 3], 1.0, false);
    let (more, other) = cuboid([2.0; 3], 1.0, false);
    let shared = |v: u32| (more[v as usize] - Point::new(1.0, 1.0, 1.0)).norm() < 1e-12;
    let corner = vertices
        .iter()
        .position(|v| (v - Point::new(1.0, 1.0, 1.0)).norm() < 1e-12);
    let corner = u32::try_from(corner.unwrap()).unwrap();
    let first = u32::try_from(vertices.len()).unwrap();
    let name = |v: u32| if shared(v) { corner } else { first + v };
    faces.extend(other.into_iter().map(|face| face.map(name)));
    vertices.extend(&more);
    let mesh = Mesh::new(vertices, faces, Some(false)).unwrap();
    for (v, ring) in (0..16).map(|v| (v, mesh.rings.of(v))) {
        let none = v == corner || (v >= first && shared(v - first));
        assert_eq!(ring.is_empty(), none, "vertex {v}");
    }
}

#[test]
fn balls_are_within_the_solid_whatever_its_faces_and_none_is_of_a_surface() {
    let (mut vertices, mut faces) = joined(&[
        cuboid([0.0; 3], 1.0, false),
        cuboid([5.0, 0.0, 0.0], 0.3, false),
        cuboid([0.0; 3], 0.4, true),
    ]);
    // A face split into slivers by a corner next to its edge.
    let [a, b, c] = faces[0];
    let [p, q] = [a, b].map(|v| vertices[v as usize].coords);
    vertices.push(Point::from((p + q) * 0.5));
    let middle = u32::try_from(vertices.len() - 1).unwrap();
    faces[0] = [a, middle, c];
    faces.push([middle, b, c]);
    faces.push([a, b, middle]);
    let solid = Mesh::new(vertices.clone(), faces.clone(), Some(true)).unwrap();
    let balls = solid.balls().unwrap().all();
    assert!(
        balls.iter().any(|ball| ball.centre.x > 4.0),
        "one in each part"
    );
    assert!(
        balls
            .windows(2)
            .all(|pair| pair[0].radius_m <= balls[0].radius_m),
        "the largest first"
    );
    for ball in balls {
        for k in 0..400_u32 {
            // Evenly over the ball (a Fibonacci lattice).
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 400.0;
            let (s, c) = (2.399_963 * f64::from(k)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let on = ball.centre + Vec3::new(across * c, across * s, z) * ball.radius_m;
            assert_ne!(winding(&solid, on.x, on.y, on.z), 0, "{ball:?} at {on}");
        }
    }
    let surface = Mesh::new(vertices, faces, Some(false)).unwrap();
    assert!(surface.balls().is_none());
    let (vertices, faces) = cuboid([0.0; 3], 1.0, false);
    let bending = Mesh::new(vertices, faces, Some(true)).unwrap();
    assert!(bending.balls().is_some());
    assert!(bending.into_deforming().unwrap().balls().is_none());
}
