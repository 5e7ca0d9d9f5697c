//! Meshes against half-spaces: the oracle is the least height over all vertices.

use crate::oracle::rng::Rng;
use crate::support::{CASES, KINDS, any_mesh, mesh_of};
use sweepd::math::{Aabb, Interval, Point, Vec3, relative};
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
