//! Plane faces of a hull, from the triangles of its surface.
//!
//! In: points and their facets. Out: per face a normal and its corners, all of them or the few that tell most of it.
//! Contacts are clipped from faces; gaps are told from points alone, so that none hangs on what is taken for plane.

use super::facets::Facet;
use crate::math::{Point, Vec3};

/// Corners that contacts are clipped from.
pub(crate) const RING_MAX: usize = 8;

/// What lies this near to the plane of a large triangle, and leans by no more than [`FACE_LEAN`], is of its face, as a
/// share of the hull's size. Points that are kept as f32 (binary STL) or with six digits are this far from a plane;
/// with less their faces fall into triangles, and a body at rest stands on one of them.
const FACE_THICK: f64 = 2e-6;
/// Sine of the angle between triangles of one face: a tenth of a degree. A chamfer leans further.
const FACE_LEAN: f64 = 1.75e-3;
/// What lies nearer than this is of the face however it leans: a sliver whose corners are rounded leans anyhow.
const FACE_SLIVER: f64 = 3e-7;
/// The sides of a thin plate are no part of its faces: the same as shares of its thickness.
const THIN_SHARE: f64 = 1e-3;
/// How near lies what is plane but for the rounding of f64, as a share of the size.
const EVEN: f64 = 1e-9;
/// A triangle of twice this area has no normal, as a share of the size's square.
const NO_AREA: f64 = 1e-12;

/// How far from its plane what is of a face may lie, metres.
#[derive(Debug)]
pub(super) struct Thick {
    near_m: f64,
    /// However it leans.
    sliver_m: f64,
    /// A triangle has an area from here on, twice the area, square metres.
    area_m2: f64,
}

impl Thick {
    /// * `thin_m`, `size_m` - of the points: least extent or about that, and greatest.
    pub(super) fn of(thin_m: f64, size_m: f64) -> Self {
        let share = |of_size: f64| {
            (of_size * size_m)
                .min(THIN_SHARE * thin_m)
                .max(EVEN * size_m)
        };
        Self {
            near_m: share(FACE_THICK),
            sliver_m: share(FACE_SLIVER),
            area_m2: NO_AREA * size_m * size_m,
        }
    }
}

/// Facets beside each other that lie in the plane of the largest of them. Normal, outward, and corners in any order,
/// with some that lie on the face's edges.
pub(super) fn of(points: &[Point], facets: &[Facet], thick: &Thick) -> Vec<(Vec3, Vec<u32>)> {
    let across = |facet: usize| {
        let [a, b, c] = facets[facet].corners.map(|k| points[k as usize]);
        (b - a).cross(&(c - a))
    };
    let mut largest: Vec<(f64, usize)> = (0..facets.len())
        .map(|facet| (across(facet).norm(), facet))
        .filter(|(area, _)| *area > thick.area_m2)
        .collect();
    largest.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    let mut face_of = vec![usize::MAX; facets.len()];
    let mut faces = Vec::new();
    for (area, seed) in largest {
        if face_of[seed] != usize::MAX {
            continue;
        }
        let normal = across(seed) / area;
        let from = points[facets[seed].corners[0] as usize];
        let off = |k: u32| normal.dot(&(points[k as usize] - from)).abs();
        let is_of_it = |facet: usize| {
            let off_m = facets[facet]
                .corners
                .map(off)
                .into_iter()
                .fold(0.0, f64::max);
            let across = across(facet);
            let leans = across.cross(&normal).norm() > FACE_LEAN * across.norm();
            across.dot(&normal) >= 0.0
                && (off_m <= thick.sliver_m || (off_m <= thick.near_m && !leans))
        };
        face_of[seed] = faces.len();
        let (mut all, mut done) = (vec![seed], 0);
        while let Some(&at) = all.get(done) {
            done += 1;
            for other in facets[at].beside.map(|other| other as usize) {
                if face_of[other] == usize::MAX && is_of_it(other) {
                    face_of[other] = faces.len();
                    all.push(other);
                }
            }
        }
        // What no other face meets at is within this one.
        let face = faces.len();
        let mut corners: Vec<u32> = Vec::new();
        for facet in all.into_iter().map(|facet| &facets[facet]) {
            let sides = (0..3).filter(|&k| face_of[facet.beside[k] as usize] != face);
            corners.extend(sides.flat_map(|k| [facet.corners[k], facet.corners[(k + 1) % 3]]));
        }
        corners.sort_unstable();
        corners.dedup();
        faces.push((normal, corners));
    }
    faces
}

/// Sorts corners of a convex face counter-clockwise about its normal.
pub(super) fn order_around(points: &[Vec3], normal: &Vec3, corners: &mut [u32]) {
    let at = |k: u32| points[k as usize];
    let Some(&first) = corners.first() else {
        return;
    };
    let middle: Vec3 = corners.iter().map(|&k| at(k)).sum::<Vec3>() / corners.len() as f64;
    let x = at(first) - middle;
    let y = normal.cross(&x);
    let angle = |k: u32| {
        let p = at(k) - middle;
        p.dot(&y).atan2(p.dot(&x))
    };
    corners.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)).then(a.cmp(&b)));
}

/// Leaves [`RING_MAX`] of the ordered corners: one after the other goes the one that takes the least area with it.
/// Every second would leave nothing of a plate with one round corner, where all the others are.
///
/// Cost: O(n^2) at worst, as the shape is built.
pub(super) fn thin(points: &[Vec3], normal: &Vec3, corners: &mut Vec<u32>) {
    let area = |ring: &[u32], k: usize| {
        let count = ring.len();
        let [before, here, after] =
            [k + count - 1, k, k + 1].map(|place| points[ring[place % count] as usize]);
        normal.dot(&(here - before).cross(&(after - here)))
    };
    let mut areas: Vec<f64> = (0..corners.len()).map(|k| area(corners, k)).collect();
    while corners.len() > RING_MAX {
        let least = (0..areas.len()).min_by(|&x, &y| areas[x].total_cmp(&areas[y]));
        let Some(least) = least else {
            return;
        };
        corners.remove(least);
        areas.remove(least);
        let count = corners.len();
        for k in [(least + count - 1) % count, least % count] {
            areas[k] = area(corners, k);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::math::{Point, Vec3};
    use crate::shape::convex::Hull;

    /// Twice the area of a ring of corners in a plane across z.
    fn area(hull: &Hull, ring: &[u32]) -> f64 {
        let at = |k: usize| hull.points()[ring[k % ring.len()] as usize];
        (0..ring.len()).map(|k| at(k).cross(&at(k + 1)).z).sum()
    }

    /// A plate with one corner rounded in `steps` parts.
    fn plate(steps: u32) -> Vec<Point> {
        let sharp = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        let round = (0..=steps).map(|k| {
            let angle = std::f64::consts::FRAC_PI_2 * f64::from(k) / f64::from(steps);
            (0.95 + 0.05 * angle.cos(), 0.95 + 0.05 * angle.sin())
        });
        sharp
            .into_iter()
            .chain(round)
            .flat_map(|(x, y)| [-0.1, 0.1].map(|z| Point::new(x, y, z)))
            .collect()
    }

    #[test]
    fn bug_of_a_face_with_many_corners_a_strip_was_left_beside_the_round_one() {
        for steps in [4, 5, 6, 13, 14, 60, 500] {
            let hull = Hull::build(&plate(steps)).unwrap();
            let tops = hull.faces().iter().filter(|face| face.normal.z > 0.99);
            let [top] = tops.collect::<Vec<_>>()[..] else {
                panic!("{steps}: one face is on top");
            };
            let (all, ring) = (hull.corners(top), hull.ring(top));
            assert_eq!(
                (all.len(), ring.len()),
                (steps as usize + 4, 8.min(steps as usize + 4))
            );
            assert!(ring.iter().all(|k| all.contains(k)));
            let share = area(&hull, ring) / area(&hull, all);
            assert!(share > 0.9995 && share <= 1.0 + 1e-12, "{steps}: {share}");
        }
    }

    #[test]
    fn bug_points_that_were_kept_as_f32_lost_their_plane_faces() {
        let mut random = crate::builtin::Random::new(5);
        let mut number = || random.unit() * 2.0 - 1.0;
        for round in 0..300 {
            let turn = Vec3::new(number(), number(), number()) * 3.0;
            let turn = nalgebra::Rotation3::from_scaled_axis(turn);
            let size = 10.0_f64.powf(2.0 * number());
            // Alone, and with corners within the edges and the faces.
            let steps = if round % 2 == 0 { 1 } else { 3 };
            let cells = 0..=steps;
            let corners = cells.clone().flat_map(|x| {
                let cells = cells.clone();
                cells
                    .clone()
                    .flat_map(move |y| cells.clone().map(move |z| [x, y, z]))
            });
            let points: Vec<Point> = corners
                .map(|cell| {
                    let p = Vec3::from(cell.map(|k| f64::from(k) / f64::from(steps) - 0.5));
                    let p = turn * p.component_mul(&Vec3::new(1.0, 0.7, 0.3)) * size;
                    #[allow(clippy::cast_possible_truncation, reason = "the point of it")]
                    Point::from(p.map(|x| f64::from(x as f32)))
                })
                .collect();
            let hull = Hull::build(&points).unwrap();
            for k in 0..3 {
                for side in [-1.0, 1.0] {
                    let dir = turn * Vec3::ith(k, side);
                    let most = hull.faces().iter().max_by(|x, y| {
                        let along = |face: &super::super::hull::HullFace| face.normal.dot(&dir);
                        along(x).total_cmp(&along(y))
                    });
                    let places = hull.ring(most.unwrap());
                    // The four outermost are of it.
                    let reach = Vec3::new(1.0, 0.7, 0.3) * (size / 2.0);
                    let outer = places.iter().filter(|place| {
                        let p = turn.inverse() * hull.points()[**place as usize];
                        (0..3).all(|k| p[k].abs() > 0.99 * reach[k])
                    });
                    assert_eq!(outer.count(), 4, "{round} {k} {side}");
                }
            }
        }
    }

    #[test]
    fn chamfers_and_the_sides_of_thin_plates_are_faces_of_their_own() {
        // A chamfer by 0.2 degrees, so narrow that it lies near the face.
        let (low, drop) = (1.0 - 5e-4, 5e-4 * 0.0035);
        let corners = [(0.0, 0.0), (0.0, low), (drop, 1.0), (1.0, 1.0), (1.0, 0.0)];
        let points: Vec<Point> = (corners.iter())
            .flat_map(|&(down, x)| [0.0, 1.0].map(|y| Point::new(x, y, -down)))
            .collect();
        assert_eq!(Hull::build(&points).unwrap().faces().len(), 7);
        for thin in [1e-5, 1e-7, 1e-8] {
            let cells = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from));
            let points: Vec<Point> = cells.map(|[x, y, z]| Point::new(x, y, thin * z)).collect();
            let faces = Hull::build(&points).unwrap().faces().len();
            assert_eq!(faces, 6, "{thin}");
        }
    }
}
