//! Meshes against half-spaces: the oracle is the least height over all vertices.

use crate::oracle::meshes::Soup;
use crate::oracle::rng::Rng;
use crate::support::{CASES, KINDS, any_mesh, mesh_of, shape};
use sweepd::math::{Aabb, Interval, Point, Pose, Vec3, relative};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery};
use sweepd::shape::{Geometry, Shape};
use sweepd::time::{ManualClock, Meter};

#[test]
fn half_spaces_meet_the_lowest_vertex() {
    let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
    for case in 0..CASES {
        let mut rng = Rng::new(9_000_000 + case);
        let kind = rng.below(KINDS);
        let (mesh, name) = any_mesh(&mut rng, kind);
        let normal = rng.direction();
        let plane = Shape {
            geometry: Geometry::HalfSpace {
                normal,
                offset: rng.range(-1.0, 1.0),
            },
            aabb: Aabb::empty(),
            centre: Point::origin(),
            radius: f64::INFINITY,
        };
        let Geometry::HalfSpace { offset, .. } = plane.geometry else {
            panic!("a half-space");
        };
        let (pose_p, pose_m) = (
            rng.pose(Rng::new(case).vector(3.0)),
            rng.pose(Vec3::zeros()),
        );
        let local = relative(&pose_p, &pose_m);
        let wanted = (mesh_of(&mesh).faces().iter().flatten())
            .map(|&i| normal.dot(&(local * mesh_of(&mesh).vertices()[i as usize]).coords) - offset)
            .fold(f64::INFINITY, f64::min);
        for (a, b, pos12) in [
            (&plane, &mesh, local),
            (&mesh, &plane, relative(&pose_m, &pose_p)),
        ] {
            let clock = ManualClock::new(0);
            let mut meter = Meter::unlimited(&clock);
            query.start(&mut store, a, b, &pos12);
            let mut last = Interval::UNKNOWN;
            while !query.advance(&mut store, (a, b), Goal::Gap, 1, &mut meter) {
                let now = query.interval();
                assert!(
                    now.widened(1e-12).contains(wanted),
                    "{name}: {now:?} {wanted}"
                );
                assert!(now.min >= last.min && now.max <= last.max);
                last = now;
            }
            let end = query.interval();
            assert!(
                end.width() < 1e-12 && end.widened(1e-12).contains(wanted),
                "{name} {end:?}"
            );
            let witness = query.witness().unwrap().closest;
            let across = witness.point_b - witness.point_a;
            assert!((across - witness.normal * witness.best_m).norm() < 1e-12);
            assert!(query.advance(&mut store, (a, b), Goal::Contacts, u64::MAX, &mut meter));
            assert_eq!(
                query.contacts(&store).next().is_none(),
                end.min > 0.0,
                "{name}"
            );
            assert!(query.interval().min >= end.min);
        }
    }
}

/// Heights of a deforming mesh are sums with its vertices' own coordinates, so that their accuracy is limited by these,
/// however close the plane is.
#[test]
fn bug_a_deforming_mesh_far_from_its_frame_is_known_no_better_than_its_vertices() {
    let low = Vec3::new(3_763_678.5, -657_891.75, -925_613.625);
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.5, 0.75],
        [-0.25, 1.0, 1.25],
        [0.5, -0.25, 1.5],
    ];
    let soup = Soup {
        vertices: corners.map(|c| Point::from(low + Vec3::from(c))).to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    };
    let (normal, offset) = (Vec3::new(2.0, 3.0, 6.0) / 7.0, 1e-10);
    let plane = Shape {
        geometry: Geometry::HalfSpace { normal, offset },
        aabb: Aabb::empty(),
        centre: Point::origin(),
        radius: f64::INFINITY,
    };
    // Exact: coordinates are multiples of 1/8, and the components of the normal are multiples of 2^-55.
    let wanted = {
        let whole = |x: f64, unit: f64| {
            #[allow(clippy::cast_possible_truncation, reason = "whole numbers")]
            let n = (x * unit) as i128;
            n
        };
        let unit = 2.0_f64.powi(55);
        let sum: i128 = (0..3)
            .map(|k| whole(low[k], 8.0) * whole(normal[k], unit))
            .sum();
        #[allow(clippy::cast_precision_loss, reason = "far less than the offset")]
        let height = sum as f64 / (8.0 * unit);
        height - offset
    };
    for solid in [Some(false), None] {
        let mesh = shape(&soup, solid).to_deforming().unwrap();
        for (a, b) in [(&plane, &mesh), (&mesh, &plane)] {
            let clock = ManualClock::new(0);
            let mut meter = Meter::unlimited(&clock);
            let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
            query.start(&mut store, a, b, &Pose::identity());
            assert!(query.advance(&mut store, (a, b), Goal::Gap, u64::MAX, &mut meter));
            let told = query.interval();
            assert!(
                told.contains(wanted) && told.contains(-1e-10),
                "{told:?} {wanted}"
            );
            assert!(told.width() < 1e-6, "{told:?}");
        }
    }
}
