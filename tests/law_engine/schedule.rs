//! 4.7: who has a turn first when the budget does not reach for all, and that nobody waits for ever.

use sweepd::time::Budget;
use sweepd::wire::Verdict;

use crate::rig::{ALL, Rig, body, scene};

/// Where the second ball of a pair stands, seen from the first: at this distance, off all axes, so that their boxes
/// overlap while the balls are apart.
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

/// Pairs far from one another, each apart by 0.1 m.
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

/// Puts the second ball of a pair.
fn put(rig: &mut Rig, pair: usize, [dx, dy, dz]: [f64; 3]) {
    let row = rig.row(2 * pair as u64 + 2);
    row.position = [20.0 * pair as f64 + dx, dy, dz];
}

/// Pairs that have a verdict in the last tick.
fn decided(rig: &Rig, pairs: usize) -> Vec<bool> {
    let possible = Verdict::Possible.code();
    let open = |pair: usize| {
        let a = 2 * pair as u64 + 1;
        let mut rows = rig.out.pairs.iter();
        rows.any(|row| row.body_a == a && row.verdict == possible)
    };
    (0..pairs).map(|pair| !open(pair)).collect()
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
        // Each pair turns by more than its gap, neither nearer nor farther: no certificate outlives a tick.
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
    // Ten ticks a round, and a turn in two for the urgent one.
    assert!(oldest <= 16, "{oldest} ticks without a verdict: {turns:?}");
    assert!(rest.iter().all(|turns| *turns >= TICKS / 16), "{turns:?}");
}

/// Pairs 20 m from one another along x, seen as a viewpoint says; how many turns each has had, all moving in each tick.
///
/// * `camera_m` - x of a body that stands aside of them and looks along y.
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
    // From the side onto the tenth pair; at 60 m, 0.7 rad to each side reach over two neighbours.
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
    // Both by 0.15 m, more than their gaps.
    put(&mut rig, 0, offset(2.25, 0.0));
    put(&mut rig, 1, offset(1.95, 0.0));
    rig.send(Budget::units(1));
    assert_eq!(decided(&rig, 2), [false, true]);
    assert_eq!(rig.out.tick.colliding, 1);
}
