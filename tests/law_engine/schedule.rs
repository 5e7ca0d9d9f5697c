//! Law 4.7: the order in which pairs get turns if the budget does not suffice, and that no pair waits for ever.

use sweepd::math::Vec3;
use sweepd::time::Budget;
use sweepd::wire::Verdict;

use crate::oracle::meshes::{bumpy_sphere, trimesh};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

/// Position of the second ball of a pair relative to the first: at this distance, away from all axes, so that their
/// boxes overlap while the balls are apart.
fn offset(distance_m: f64, turn_rad: f64) -> [f64; 3] {
    let (s, c) = turn_rad.sin_cos();
    let (x, y) = ((c - s) / 2.0_f64.sqrt(), (c + s) / 2.0_f64.sqrt());
    let flat = distance_m * (2.0_f64 / 3.0).sqrt();
    [flat * x, flat * y, distance_m / 3.0_f64.sqrt()]
}

fn ball(id: u64, at: [f64; 3], priority: f64) -> String {
    let shape = "{ type = \"sphere\", radius = 1.0 }";
    body(id, at, shape, &format!("priority = {priority:?}"))
}

/// Pairs far from each other, each with a gap of 0.1 m.
fn pairs(priorities: &[f64]) -> Rig {
    let mut bodies = Vec::new();
    for (pair, priority) in priorities.iter().enumerate() {
        let (id, x) = (2 * pair as u64 + 1, 20.0 * pair as f64);
        let [dx, dy, dz] = offset(2.1, 0.0);
        bodies.push(ball(id, [x, 0.0, 0.0], 1.0));
        bodies.push(ball(id + 1, [x + dx, dy, dz], *priority));
    }
    Rig::new(&scene("", &bodies))
}

/// Moves the second ball of a pair to this position relative to the first.
fn put(rig: &mut Rig, pair: usize, [dx, dy, dz]: [f64; 3]) {
    let row = rig.row(2 * pair as u64 + 2);
    row.position = [20.0 * pair as f64 + dx, dy, dz];
}

/// Which pairs have a verdict in the last tick.
fn decided(rig: &Rig, pairs: usize) -> Vec<bool> {
    let possible = Verdict::Possible.code();
    let open = |pair: usize| {
        let a = 2 * pair as u64 + 1;
        let mut rows = rig.out.pairs.iter();
        rows.any(|row| row.body_a == a && row.verdict == possible)
    };
    (0..pairs).map(|pair| !open(pair)).collect()
}

/// Upper bound of the ticks that a pair waits for a turn, as stated in `narrow/order.rs`.
///
/// * `pairs` - number of pairs that wait at the same time; `turns` - turns per tick; `ratio` - greatest weight
///   divided by the least.
fn longest_wait(pairs: u64, turns: u64, ratio: u64) -> u64 {
    let round = pairs.div_ceil(turns);
    ratio * (16 + 2).max(round + 1) + round
}

/// Factor on the weight of approaching pairs.
const CLOSING: u64 = 4;

#[test]
fn law_4_7_with_random_motion_priorities_and_a_viewpoint_no_pair_waits_longer_than_is_stated() {
    const PAIRS: usize = 30;
    const UNITS: u64 = 3;
    let mut rng = Rng::new(41);
    let mut bodies = Vec::new();
    for pair in 0..PAIRS {
        let (id, x) = (2 * pair as u64 + 1, 20.0 * pair as f64);
        let priority = if rng.below(2) == 0 { 1.0 } else { 2.0 };
        let [dx, dy, dz] = offset(2.1, 0.0);
        bodies.push(ball(id, [x, 0.0, 0.0], 1.0));
        bodies.push(ball(id + 1, [x + dx, dy, dz], priority));
    }
    let view = "[viewpoint]\nposition = [200.0, -60.0, 0.0]\ndirection = [0.0, 1.0, 0.0]\nhalf_angle_rad = 0.7\nweight = 2.0\n";
    let mut rig = Rig::new(&scene(view, &bodies));
    rig.send(ALL);
    let mut waits = [0_u64; PAIRS];
    let (mut longest, mut waiting) = (0, 0);
    for _ in 0..1_500 {
        for pair in 0..PAIRS {
            // Pairs enter and leave contact, some rest: about half of the moving pairs touch at their last test.
            if rng.below(4) > 0 {
                put(
                    &mut rig,
                    pair,
                    offset(rng.range(1.9, 2.15), rng.range(0.0, 6.0)),
                );
            }
        }
        rig.send(Budget::units(UNITS));
        let decided = decided(&rig, PAIRS);
        waiting = waiting.max(decided.iter().filter(|decided| !**decided).count());
        // One turn decides a convex pair.
        for (wait, decided) in waits.iter_mut().zip(decided) {
            *wait = if decided { 0 } else { *wait + 1 };
            longest = longest.max(*wait);
        }
        assert!(longest >= rig.out.tick.oldest_undecided_ticks);
    }
    let most = longest_wait(waiting as u64 + UNITS, UNITS, 2 * CLOSING * 2);
    assert!(
        waiting > PAIRS / 2 && longest > 5,
        "{waiting} waited, {longest} ticks"
    );
    assert!(longest <= most, "{longest} of {most} ticks");
}

#[test]
fn bug_contacts_that_were_confirmed_each_tick_kept_all_others_waiting() {
    const PAIRS: usize = 20;
    const CONTACTS: usize = 12;
    const UNITS: u64 = 4;
    let mut rig = pairs(&[1.0; PAIRS]);
    let place = |rig: &mut Rig, tick: usize| {
        for pair in 0..PAIRS {
            // The depth of a contact is less than the motion in a tick.
            let distance_m = if pair < CONTACTS { 1.999 } else { 2.1 };
            put(rig, pair, offset(distance_m, 0.15 * tick as f64));
        }
    };
    place(&mut rig, 0);
    rig.send(ALL);
    let most = longest_wait(PAIRS as u64, UNITS, CLOSING);
    for tick in 1..400 {
        place(&mut rig, tick);
        rig.send(Budget::units(UNITS));
        let oldest = rig.out.tick.oldest_undecided_ticks;
        assert!(oldest <= most, "{oldest} of {most} ticks in tick {tick}");
    }
}

#[test]
fn bug_pairs_that_no_turn_decided_kept_all_others_waiting() {
    // First, spheres side by side with searches that restart from the roots at each pose, since a plane would separate
    // them at once; second, a ball in the cavity of a solid, which no plane separates from it.
    let ball = bumpy_sphere(24, 48, 0.01);
    let large = |by: f64| ball.clone().scaled(Vec3::new(by, by, by));
    let hollow = large(2.0).and(large(1.06).inverted());
    no_turn_decides(
        "restart",
        [&trimesh(&ball, None), &trimesh(&ball, None)],
        2.04,
    );
    no_turn_decides(
        "carried",
        [&trimesh(&hollow, None), &trimesh(&ball, None)],
        0.0,
    );
}

/// Pairs of meshes that are never decided, with this gap and a new rotation in every tick, next to pairs of balls.
fn no_turn_decides(search: &str, meshes: [&str; 2], apart_m: f64) {
    const MESHES: usize = 4;
    const BALLS: usize = 6;
    const UNITS: u64 = 40;
    let mut bodies = Vec::new();
    for pair in 0..MESHES + BALLS {
        let (id, x) = (2 * pair as u64 + 1, 20.0 * pair as f64);
        let [dx, dy, dz] = offset(if pair < MESHES { apart_m } else { 2.1 }, 0.0);
        let places = [(id, [x, 0.0, 0.0]), (id + 1, [x + dx, dy, dz])];
        for ((id, at), mesh) in places.into_iter().zip(meshes) {
            bodies.push(if pair < MESHES {
                body(id, at, mesh, "")
            } else {
                ball(id, at, 1.0)
            });
        }
    }
    let mut rig = Rig::new(&scene(
        &format!("[run]\nmesh_search = \"{search}\""),
        &bodies,
    ));
    rig.send(ALL);
    let most = longest_wait((MESHES + BALLS) as u64, 1, CLOSING);
    let mut rng = Rng::new(42);
    let (mut waits, mut open) = ([0_u64; MESHES + BALLS], 0);
    for tick in 0..400 {
        for pair in 0..MESHES + BALLS {
            let distance_m = if pair < MESHES { apart_m } else { 2.1 };
            put(&mut rig, pair, offset(distance_m, 0.15 * f64::from(tick)));
            // After such a rotation no earlier proof is valid.
            let [x, y, z, w] = *rng.rotation().as_vector().as_ref();
            rig.row(2 * pair as u64 + 2).orientation = [x, y, z, w];
        }
        rig.send(Budget::units(UNITS));
        let decided = decided(&rig, MESHES + BALLS);
        open += decided[..MESHES]
            .iter()
            .filter(|decided| !**decided)
            .count();
        for (wait, decided) in waits.iter_mut().zip(decided).skip(MESHES) {
            *wait = if decided { 0 } else { *wait + 1 };
            assert!(
                *wait <= most,
                "{search}: {wait} of {most} ticks in tick {tick}"
            );
        }
    }
    assert!(
        open > 300 * MESHES,
        "{search}: the meshes are to be too much for the budget: {open}"
    );
}

#[test]
fn law_4_7_a_pair_has_turns_by_its_priority_and_none_waits_longer_than_its_share() {
    const PAIRS: usize = 40;
    const TICKS: usize = 200;
    const UNITS: u64 = 4;
    let mut priorities = [1.0; PAIRS];
    priorities[PAIRS - 1] = 8.0;
    let mut rig = pairs(&priorities);
    rig.send(ALL);
    let mut turns = [0_usize; PAIRS];
    let mut oldest = 0;
    for tick in 0..TICKS {
        // Each pair turns by more than its gap at a constant distance: no certificate is valid in the next tick.
        for pair in 0..PAIRS {
            put(&mut rig, pair, offset(2.1, 0.15 * tick as f64));
        }
        rig.send(Budget::units(UNITS));
        for (turns, decided) in turns.iter_mut().zip(decided(&rig, PAIRS)) {
            *turns += usize::from(decided);
        }
        oldest = oldest.max(rig.out.tick.oldest_undecided_ticks);
    }
    let (urgent, rest) = turns.split_last().unwrap();
    let mean = rest.iter().sum::<usize>() as f64 / rest.len() as f64;
    assert!(*urgent as f64 > 3.0 * mean, "{urgent} against {mean}");
    // A round takes ten ticks, and the urgent pair gets every second turn.
    assert!(oldest <= 16, "{oldest} ticks without a verdict: {turns:?}");
    assert!(rest.iter().all(|turns| *turns >= TICKS / 16), "{turns:?}");
}

/// Pairs 20 m apart along x, in the view of a viewpoint; all move in each tick. Returns the number of turns of each.
///
/// * `camera_m` - x of a body beside the pairs that looks along y.
fn turns_in_view(viewpoint: &str, camera_m: Option<f64>) -> Vec<usize> {
    const PAIRS: usize = 24;
    let mut bodies = Vec::new();
    for pair in 0..PAIRS {
        let (id, x) = (2 * pair as u64 + 1, 20.0 * pair as f64);
        let [dx, dy, dz] = offset(2.1, 0.0);
        bodies.push(ball(id, [x, 0.0, 0.0], 1.0));
        bodies.push(ball(id + 1, [x + dx, dy, dz], 1.0));
    }
    let shape = "{ type = \"sphere\", radius = 0.1 }";
    bodies.extend(camera_m.map(|x| body(900, [x, -60.0, 0.0], shape, "")));
    let mut rig = Rig::new(&scene(&format!("[viewpoint]\n{viewpoint}\n"), &bodies));
    if camera_m.is_some() {
        let quarter = 0.5_f64.sqrt();
        rig.row(900).orientation = [0.0, 0.0, quarter, quarter];
    }
    rig.send(ALL);
    let mut turns = vec![0; PAIRS];
    let mut oldest = 0;
    for tick in 0..200 {
        for pair in 0..PAIRS {
            put(&mut rig, pair, offset(2.1, 0.15 * tick as f64));
        }
        rig.send(Budget::units(4));
        for (turns, decided) in turns.iter_mut().zip(decided(&rig, PAIRS)) {
            *turns += usize::from(decided);
        }
        oldest = oldest.max(rig.out.tick.oldest_undecided_ticks);
    }
    assert!(turns.iter().all(|turns| *turns >= 10), "{turns:?}");
    assert!(oldest <= 24, "{oldest} ticks without a verdict: {turns:?}");
    turns
}

#[test]
fn law_4_7_what_is_in_view_has_turns_before_what_is_not_and_its_middle_before_its_edge() {
    // Side view of pair 10; at 60 m a half-angle of 0.7 rad covers two neighbours on each side.
    let view = "position = [200.0, -60.0, 0.0]\ndirection = [0.0, 2.0, 0.0]\nhalf_angle_rad = 0.7\nweight = 8.0";
    let turns = turns_in_view(view, None);
    let unseen = [&turns[..7], &turns[14..]].concat();
    let mean = unseen.iter().sum::<usize>() as f64 / unseen.len() as f64;
    assert!(turns[10] as f64 > 2.5 * mean, "{turns:?}");
    assert!(turns[8].min(turns[12]) as f64 > 1.5 * mean, "{turns:?}");
    assert!(turns[10] > turns[8].max(turns[12]), "{turns:?}");
}

#[test]
fn law_4_7_of_what_is_in_view_the_near_has_turns_before_the_far() {
    let view = "position = [-5.0, 0.0, 0.0]\nhalf_angle_rad = 1.0\nweight = 20.0\nhalf_m = 20.0";
    let turns = turns_in_view(view, None);
    let mean = |turns: &[usize]| turns.iter().sum::<usize>() as f64 / turns.len() as f64;
    let thirds = [&turns[..8], &turns[8..16], &turns[16..]].map(mean);
    assert!(thirds[0] > 1.5 * thirds[1], "{turns:?}");
    assert!(thirds[1] > thirds[2], "{turns:?}");
}

#[test]
fn law_4_7_a_viewpoint_is_where_the_body_that_carries_it_is() {
    let view = "body = \"b900\"\nhalf_angle_rad = 0.3\nweight = 8.0";
    let most = |x: f64| {
        let turns = turns_in_view(view, Some(x));
        (0..turns.len()).max_by_key(|pair| turns[*pair]).unwrap()
    };
    assert_eq!((most(100.0), most(360.0)), (5, 18));
}

#[test]
fn law_4_7_what_comes_nearer_is_asked_before_what_moves_away() {
    let mut rig = pairs(&[1.0, 1.0]);
    rig.send(ALL);
    assert_eq!(decided(&rig, 2), [true, true]);
    // Both balls move by 0.15 m, more than their gaps.
    put(&mut rig, 0, offset(2.25, 0.0));
    put(&mut rig, 1, offset(1.95, 0.0));
    rig.send(Budget::units(1));
    assert_eq!(decided(&rig, 2), [false, true]);
    assert_eq!(rig.out.tick.colliding, 1);
}
