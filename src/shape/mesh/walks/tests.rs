//! Walks arrive where they should, at once or in pieces.

use super::*;
use crate::shape::mesh::tests::sheet;

#[test]
fn a_climb_over_a_convex_surface_ends_at_its_outermost_vertex() {
    let mut random = crate::builtin::Random::new(5);
    let mut unit = || random.unit() * 2.0 - 1.0;
    let points: Vec<Point> = (0..200)
        .map(|_| Point::from(Vec3::new(unit(), unit(), unit()).normalize()))
        .collect();
    let (vertices, faces) = parry3d_f64::transformation::convex_hull(
        &points
            .iter()
            .map(|p| parry3d_f64::math::Vector::new(p.x, p.y, p.z))
            .collect::<Vec<_>>(),
    );
    let vertices = vertices.iter().map(|v| Point::new(v.x, v.y, v.z)).collect();
    let mesh = Mesh::new(vertices, faces, None).unwrap();
    let count = u32::try_from(mesh.faces().len()).unwrap();
    // The results of earlier climbs, also in other directions, shorten the way without changing the end.
    let mut trails = Trails::default();
    for _ in 0..200 {
        let direction = Vec3::new(unit(), unit(), unit()).normalize();
        let height = |v: u32| direction.dot(&mesh.vertices()[v as usize].coords);
        let highest = (0..200).map(height).fold(f64::NEG_INFINITY, f64::max);
        for face in 0..count {
            let mut climb = |beyond_m| mesh.climb(face, &direction, beyond_m, &mut trails, || true);
            let top = climb(f64::INFINITY).unwrap();
            assert!(height(top) >= highest - 1e-9, "from {face}");
            assert_eq!(climb(highest - 0.01), None);
            // Interrupted again and again, it continues by its own trail and arrives at the same place.
            let mut own = Trails::default();
            let mut asked = 0;
            let found = loop {
                let mut first = true;
                let once = || std::mem::take(&mut first);
                let found = mesh.climb(face, &direction, f64::INFINITY, &mut own, once);
                asked += 1;
                if found.is_some() || asked > 100 {
                    break found;
                }
            };
            assert_eq!(found.map(height), Some(height(top)), "from {face}");
        }
    }
}

#[test]
fn a_walk_comes_to_the_place_beneath_a_point_unless_it_is_far() {
    let mesh = sheet(40);
    let beneath = |x: f64, y: f64| mesh.beneath(0, &Point::new(x, y, 3.0), &Vec3::z(), || true);
    for (x, y) in [(0.5, 0.2), (3.25, 7.5), (14.5, 0.25), (8.5, 8.25)] {
        let (there, face) = beneath(x, y).unwrap();
        assert_eq!(
            mesh.beneath(face, &Point::new(x, y, 3.0), &Vec3::z(), || true),
            Some((there, face))
        );
        assert!((there - Point::new(x, y, 0.0)).norm() < 1e-12, "{there}");
    }
    // Beyond the faces that a walk may visit, and beyond the border.
    assert_eq!(beneath(39.5, 38.5), None);
    assert_eq!(beneath(-1.0, 2.0), None);
    // Nor along a direction from which the sheet leans by more than a walk accepts.
    let flat = Vec3::new(1.0, 0.0, 0.1).normalize();
    assert_eq!(
        mesh.beneath(0, &Point::new(5.0, 5.0, 0.5), &flat, || true),
        None
    );
}
