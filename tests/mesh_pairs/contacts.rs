//! Contact searches that are interrupted within a leaf pair give the contacts of an uninterrupted search.

use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::{CASES, any_two, shape, way};
use sweepd::math::{Pose, relative};
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, LeafContact, Search};
use sweepd::shape::Shape;
use sweepd::time::{Clock, ManualClock, Meter};

/// The contacts of a pair, and the number of turns that they took.
struct Told {
    covered: Option<Vec<(u32, u32)>>,
    points: Vec<[u64; 7]>,
    least_m: f64,
    turns: u64,
}

fn bits(point: &LeafContact) -> [u64; 7] {
    let closest = &point.closest;
    let [a, b] = [&closest.point_a, &closest.point_b].map(|p| p.coords.map(f64::to_bits));
    [a.x, a.y, a.z, b.x, b.y, b.z, point.feature]
}

/// The contact set of a pair, in turns that end after `reads` clock reads; 0: in one turn.
fn contacts(a: &Shape, b: &Shape, pos12: &Pose, reads: u64) -> Told {
    let clock = ManualClock::new(0);
    clock.step_each_read(1);
    let (mut store, mut front) = (FrontStore::default(), CarriedFront::default());
    front.start(&mut store, a, b, pos12, Search::Carried);
    let mut turns = 0;
    loop {
        turns += 1;
        let deadline_ns = (reads > 0).then(|| clock.monotonic_ns() + 2 + reads);
        let mut meter = Meter::new(&clock, deadline_ns, None);
        if front.advance(&mut store, a, b, Goal::Contacts, u64::MAX, &mut meter) {
            break;
        }
        assert!(turns < 1_000_000, "comes to no end");
    }
    Told {
        covered: front.covered(&store, a, b),
        points: front.contacts(&store).iter().map(bits).collect(),
        least_m: (front.contacts(&store).iter())
            .map(|c| c.closest.best_m)
            .fold(f64::INFINITY, f64::min),
        turns,
    }
}

#[test]
fn contact_sets_in_pieces_are_those_of_a_search_at_once() {
    let (mut cut, mut other) = (0, 0);
    for case in 0..CASES {
        let mut rng = Rng::new(31_000_000 + case);
        let (a, b, [pose_a, pose_b], _) = any_two(&mut rng, way(case));
        let pos12 = relative(&pose_a, &pose_b);
        let (whole, pieces) = (
            contacts(&a, &b, &pos12, 0),
            contacts(&a, &b, &pos12, 8 + case % 5),
        );
        assert!(whole.covered == pieces.covered, "case {case}");
        assert_eq!(whole.least_m, pieces.least_m, "case {case}");
        // A walk that restarts may take another path and end at another point that is equally deep.
        other += u64::from(whole.points != pieces.points);
        cut += u64::from(!whole.points.is_empty() && pieces.turns > 4);
    }
    assert!(cut > CASES / 8, "{cut}");
    assert!(other <= 1 + CASES / 100, "{other}");
}

#[test]
fn long_walks_are_cut_off_and_gone_on_with() {
    let a = shape(&meshes::bumpy_sphere(40, 50, 0.1), None);
    let b = shape(&meshes::torus(1.0, 0.3, 40, 30), None);
    for shift in [0.35, 0.7, 1.0] {
        let pos12 = Pose::translation(shift, 0.1, 0.2);
        let whole = contacts(&a, &b, &pos12, 0);
        let pieces = contacts(&a, &b, &pos12, 6);
        assert!(
            !whole.points.is_empty() && pieces.turns > 100,
            "{shift}: {} turns",
            pieces.turns
        );
        assert_eq!(whole.least_m, pieces.least_m, "{shift}");
        // As above; the number of points is equal, and most points are.
        let other = (pieces.points.iter())
            .filter(|point| !whole.points.contains(point))
            .count();
        assert!(other * 10 <= pieces.points.len(), "{shift}: {other}");
    }
}

#[test]
fn bug_walks_of_another_pair_were_gone_on_with_when_less_was_asked_for_than_contacts() {
    let large = shape(&meshes::bumpy_sphere(40, 50, 0.1), None);
    let small = shape(&meshes::bumpy_sphere(5, 6, 0.1), None);
    let pos12 = Pose::translation(0.4, 0.1, 0.2);
    let clock = ManualClock::new(0);
    let mut store = FrontStore::default();
    let mut fronts = [CarriedFront::default(), CarriedFront::default()];
    let meshes = [&small, &large];
    for (front, mesh) in fronts.iter_mut().zip(meshes) {
        front.start(&mut store, mesh, mesh, &pos12, Search::Carried);
    }
    // Contacts of both in turn, constantly interrupted; some turns only ask for the gap or the verdict.
    for turn in 0..40_000 {
        let (front, mesh) = (&mut fronts[turn % 2], meshes[turn % 2]);
        let goal = [Goal::Contacts, Goal::Gap, Goal::Verdict][turn / 2 % 3];
        let mut meter = Meter::new(&clock, None, Some(1));
        front.advance(&mut store, mesh, mesh, goal, 1, &mut meter);
    }
    for (front, mesh) in fronts.iter_mut().zip(meshes) {
        let mut meter = Meter::unlimited(&clock);
        assert!(front.advance(&mut store, mesh, mesh, Goal::Contacts, u64::MAX, &mut meter));
        let cut: Vec<_> = front.contacts(&store).to_vec();
        let whole = contacts(mesh, mesh, &pos12, 0);
        assert!(!cut.is_empty() && cut.len() >= whole.points.len() / 2);
    }
}
