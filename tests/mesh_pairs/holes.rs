//! Meshes with holes: closed except for some faces, so they are surfaces and contain nothing, whatever is inside them.
//!
//! Method: compared with the brute-force oracle, which treats them as surfaces, and with the closed box, which does
//! contain what is inside.

use crate::fronts::{Couple, drive};
use crate::oracle::Truth;
use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::{
    CASES, KINDS, any_convex, any_mesh, convex, holed, mesh_of, place, run, shape, truth_of, way,
};
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, Search};
use sweepd::shape::{Convex, Shape};
use sweepd::time::{ManualClock, Meter};

/// Half sides of the boxes, metres. The shapes put into them are less than a third as large.
const HALF: Vec3 = Vec3::new(1.0, 0.9, 1.1);

/// The box without its lid, and the closed one.
fn boxes() -> [Shape; 2] {
    let both = [meshes::open_box(HALF), meshes::cuboid(HALF)].map(|soup| shape(&soup, None));
    let solid = both.each_ref().map(|mesh| mesh_of(mesh).is_solid());
    assert_eq!(solid, [false, true]);
    both
}

#[test]
fn law_3_3_a_box_without_its_lid_holds_nothing_and_lets_it_out() {
    let [open, closed] = boxes();
    let small = HALF * 0.3;
    let others = [
        convex(Convex::cuboid(small)),
        shape(&meshes::cuboid(small), None),
        shape(&meshes::open_box(small), None),
    ];
    for case in 0..CASES {
        let seed = 47_000_000 + case;
        let mut rng = Rng::new(seed);
        let origin = rng.vector(10.0);
        let pose_a = rng.pose(origin);
        // In the middle, and half way out, at the position of the lid.
        for at in [Vec3::zeros(), Vec3::z() * HALF.z] {
            let local = Pose::from_parts((at + rng.vector(0.1)).into(), rng.rotation());
            let pose_b = pose_a * local;
            for (number, other) in others.iter().enumerate() {
                for (mesh, is_apart) in [(&open, true), (&closed, false)] {
                    let what = format!("seed {seed} at {at:?}, shape {number}, apart {is_apart}");
                    for end in [
                        run(mesh, other, &pose_a, &pose_b, Goal::Gap, &what),
                        run(other, mesh, &pose_b, &pose_a, Goal::Gap, &what),
                    ] {
                        assert_eq!(end.min > 0.0, is_apart, "{what}: {end:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn law_1_meshes_with_holes_hold_the_truth_at_every_pose_of_a_front() {
    for case in 0..CASES * 2 {
        let seed = 48_000_000 + case;
        let mut rng = Rng::new(seed);
        let (soup, name_a) = holed(&mut rng, usize::from(case % 2 == 1));
        let mesh = shape(&soup, None);
        assert!(!mesh_of(&mesh).is_solid(), "seed {seed}");
        let kind = rng.below(KINDS);
        let (other, name_b) = if rng.below(3) == 0 {
            any_convex(&mut rng)
        } else {
            any_mesh(&mut rng, kind)
        };
        let (pose_a, pose_b) = place(&mut rng, &mesh, &other, way(case));
        let what = format!("seed {seed} {name_a} - {name_b}");
        let mut couple = Couple::either_way(&mut rng, (&mesh, pose_a), (&other, pose_b));
        drive(&mut rng, &mut couple, Search::Carried, case % 4 < 2, &what);
    }
}

/// A shape moves step by step from the middle through the hole and on: it is apart all the way.
#[test]
fn law_3_3_a_front_goes_along_with_what_leaves_a_box_through_its_hole() {
    let small = shape(&meshes::cuboid(HALF * 0.3), None);
    let turn = Quat::from_scaled_axis(Vec3::new(0.3, 0.5, 0.2));
    let clock = ManualClock::new(0);
    let steps = 60_u32;
    let apart = boxes().map(|mesh| {
        let (mut store, mut front) = (FrontStore::default(), CarriedFront::default());
        let mut apart = 0;
        for step in 0..steps {
            let at = Vec3::new(0.1, 0.05, 0.05 * f64::from(step));
            let pos12 = Pose::from_parts(at.into(), turn);
            if step == 0 {
                front.start(&mut store, &mesh, &small, &pos12, Search::Carried);
            } else {
                front.move_to(&mut store, &mesh, &small, &pos12);
            }
            let mut meter = Meter::unlimited(&clock);
            assert!(front.advance(&mut store, &mesh, &small, Goal::Gap, u64::MAX, &mut meter));
            let gap = front.interval();
            match truth_of(&mesh, &small, &Pose::identity(), &pos12) {
                Truth::Apart(d) => {
                    let is_it = gap.min > 0.0 && gap.widened(1e-11).contains(d);
                    assert!(is_it && gap.width() <= 1e-9, "step {step}: {gap:?}, {d}");
                    apart += 1;
                }
                Truth::Overlap(_) => assert!(gap.min <= 0.0, "step {step}: {gap:?}"),
            }
        }
        apart
    });
    assert_eq!(apart[0], steps, "from the open box");
    assert!((1..steps).contains(&apart[1]), "{apart:?}");
}
