//! A few bodies far from all others (a tracker that lost its target, a part parked out of the way), or two groups far
//! from each other, must not make the search among the others slower: work is counted, and pairs are compared.

use sweepd::broad::{BroadPhase, Method};
use sweepd::pairs::{PairDelta, PairSet};

use crate::NO_LIMIT;
use crate::world::{World, at};

const BODIES: usize = 4_000;
const TICKS: usize = 60;

/// Returns the boxes compared in all ticks, and the number of pairs after the last one.
fn play(
    method: Method,
    centres: impl Fn(usize, [f64; 3]) -> [f64; 3],
    moving: bool,
) -> (u64, usize) {
    let mut world = World::new(5, BODIES);
    for i in 0..BODIES {
        let centre = world.random_vec(10.0);
        world.bodies[i].aabb = at(centres(i, centre), [0.25; 3]);
        world.bodies[i].inside = true;
        world.changes.inserted.push(World::slot(i));
    }
    let mut broad = BroadPhase::new(method);
    let (mut pairs, mut delta, mut tests) = (PairSet::new(NO_LIMIT), PairDelta::default(), 0);
    for tick in 0..TICKS {
        for i in (0..BODIES).filter(|i| tick > 0 && (moving || i % 50 == tick % 50)) {
            let by = world.random_vec(0.02);
            let (old, by) = (world.bodies[i].aabb, sweepd::math::Vec3::from(by));
            world.bodies[i].aabb.min = old.min + by;
            world.bodies[i].aabb.max = old.max + by;
            world.changes.moved.push(World::slot(i));
        }
        delta.clear();
        broad.update(&world.changes, &world, &world, &mut pairs, &mut delta);
        tests += broad.work().tests;
        world.changes.clear();
    }
    (tests, pairs.len())
}

fn compare(what: &str, most: f64, centres: impl Fn(usize, [f64; 3]) -> [f64; 3] + Copy) {
    for moving in [true, false] {
        let (usual, _) = play(Method::Order, |_, centre| centre, moving);
        let (tests, pairs) = play(Method::Order, centres, moving);
        let (_, exact) = play(Method::HierarchicalGrid, centres, moving);
        assert_eq!(pairs, exact, "{what}");
        assert!(
            tests as f64 <= usual as f64 * most,
            "{what}: {tests} tests, {usual} without"
        );
    }
}

#[test]
fn bug_one_body_far_away_made_the_search_among_all_others_coarse() {
    for far in [1e4, 1e6, 1e9, 1e12] {
        let outlier = |i: usize, centre: [f64; 3]| if i == 7 { [far; 3] } else { centre };
        compare(&format!("one at {far:e} m"), 1.5, outlier);
        // One body in fifty, each at another place.
        let some = |i: usize, centre: [f64; 3]| {
            if i % 50 == 7 {
                centre.map(|c| c * far / 10.0)
            } else {
                centre
            }
        };
        compare(&format!("some up to {far:e} m"), 1.5, some);
    }
}

#[test]
fn bug_two_groups_far_apart_stood_in_a_cell_each_of_the_curve() {
    for far in [1e3, 1e5] {
        let groups = |i: usize, centre: [f64; 3]| {
            if i.is_multiple_of(2) {
                centre.map(|c| c + far)
            } else {
                centre
            }
        };
        compare(&format!("two groups {far:e} m apart"), 2.5, groups);
    }
}

#[test]
fn bug_a_crowd_that_came_beyond_the_array_of_a_few_was_compared_each_with_each() {
    let mut world = World::new(5, BODIES);
    let mut broad = BroadPhase::new(Method::UniformGrid);
    let (mut pairs, mut delta) = (PairSet::new(NO_LIMIT), PairDelta::default());
    // A few bodies close together, then all others in a larger region.
    for (bodies, reach) in [(0..100, 1.0), (100..BODIES, 10.0)] {
        for i in bodies {
            // Coordinates are rounded so that all boxes have exactly the same size: a larger box would cause a rebuild.
            let centre = world.random_vec(reach).map(|c| (c * 64.0).round() / 64.0);
            world.bodies[i].aabb = at(centre, [0.25; 3]);
            world.bodies[i].inside = true;
            world.changes.inserted.push(World::slot(i));
        }
        delta.clear();
        broad.update(&world.changes, &world, &world, &mut pairs, &mut delta);
        world.changes.clear();
    }
    let tests = broad.work().tests;
    let usual = 16 * BODIES as u64;
    assert!(tests < usual, "{tests} comparisons, {usual} at most");
}
