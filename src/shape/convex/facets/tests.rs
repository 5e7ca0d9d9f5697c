//! Tests of hull surfaces: closed, around all points, exact corners.

use super::*;

/// Every point on or beneath every facet, neighbours adjacent, and the number of facets of a sphere.
fn check(points: &[Point]) -> Vec<Facet> {
    let facets = facets_of(points).unwrap();
    let mut named = vec![false; points.len()];
    for (place, facet) in (0u32..).zip(&facets) {
        let [a, b, c] = facet.corners.map(|k| &points[k as usize]);
        assert!(points.iter().all(|p| side(a, b, c, p).is_le()));
        for k in 0..3 {
            let other = &facets[facet.beside[k] as usize];
            let back = (0..3).find(|&j| {
                other.beside[j] == place && {
                    let ends = (other.corners[(j + 1) % 3], other.corners[j]);
                    ends == (facet.corners[k], facet.corners[(k + 1) % 3])
                }
            });
            assert!(back.is_some());
            named[facet.corners[k] as usize] = true;
        }
    }
    let vertices = named.iter().filter(|named| **named).count();
    assert_eq!(facets.len() + 4, 2 * vertices);
    facets
}

fn corners(points: &[Point]) -> usize {
    let all = corners_of(points, &check(points));
    all.iter().filter(|corner| **corner).count()
}

#[test]
fn hulls_of_grids_balls_and_noise_are_closed_and_hold_all_points() {
    let mut random = crate::builtin::Random::new(11);
    let mut point = || Point::from(nalgebra::Vector3::from_fn(|_, _| random.unit() * 2.0 - 1.0));
    let noise: Vec<Point> = (0..500).map(|_| point()).collect();
    check(&noise);
    let ball: Vec<Point> = noise
        .iter()
        .map(|p| Point::from(p.coords.normalize()))
        .collect();
    assert!(corners(&ball) > 490);
    // Nearly flat, nearly a line, and off by an ulp from a plane.
    for thin in [1e-3, 1e-9, 1e-15] {
        let flat: Vec<Point> = noise
            .iter()
            .map(|p| Point::new(p.x, p.y, p.z * thin))
            .collect();
        check(&flat);
        let line: Vec<Point> = noise
            .iter()
            .map(|p| Point::new(p.x, p.y * thin, p.z * thin))
            .collect();
        check(&line);
    }
}

#[test]
fn what_lies_on_a_face_or_an_edge_is_no_corner() {
    let n = 6;
    let whole = |x: i32, y: i32, z: i32| Point::new(x.into(), y.into(), z.into());
    let all =
        || (-n..=n).flat_map(|x| (-n..=n).flat_map(move |y| (-n..=n).map(move |z| (x, y, z))));
    let cube: Vec<Point> = all().map(|(x, y, z)| whole(x, y, z)).collect();
    assert_eq!(corners(&cube), 8);
    let octahedron: Vec<Point> = all()
        .filter(|(x, y, z)| x.abs() + y.abs() + z.abs() <= n)
        .map(|(x, y, z)| whole(x, y, z))
        .collect();
    assert_eq!(corners(&octahedron), 6);
    // A point an ulp above the middle of a face is a corner.
    let mut cube = cube;
    cube.push(Point::new(0.5, 0.25, f64::from(n).next_up()));
    assert_eq!(corners(&cube), 9);
}

#[test]
fn points_in_a_plane_have_no_surface() {
    let flat: Vec<Point> = (0..40)
        .map(|k| Point::new(f64::from(k % 7), f64::from(k / 7), 0.5))
        .collect();
    assert!(facets_of(&flat).is_none());
    assert!(facets_of(&flat[..7]).is_none());
    assert!(facets_of(&flat[..1]).is_none() && facets_of(&[]).is_none());
}

#[test]
fn numbers_are_told_exactly_down_to_the_least_or_not_at_all() {
    let with = |z: f64| {
        let mut points: Vec<Point> = (0..40)
            .map(|k| Point::new(f64::from(k).sin(), f64::from(k).cos(), z))
            .collect();
        points.push(Point::new(0.1, 0.2, 2.0 * z));
        points
    };
    assert_eq!(corners(&with(EXACT_MIN_M)), 41);
    assert_eq!(corners(&with(-EXACT_MIN_M)), 41);
    for z in [EXACT_MIN_M.next_down(), -1e-100, 5e-324] {
        assert!(facets_of(&with(z)).is_none());
    }
}
