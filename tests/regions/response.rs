//! Goal: approximate contacts are good enough for a response. Method: two bodies of meshes that overlap by a fifth of
//! their diameter, with a tenth of the work units of a full query; in each tick one of them moves according to the
//! estimate of the deepest region, and nothing else is used. A twin without a limit measures the remaining overlap.

use std::collections::BTreeMap;

use sweepd::math::{Point, Pose, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{Demand, Outbox, contact_flags, region_flags};

use super::oracle::rng::Rng;
use super::{ASKED, Part, Run, Thing, meshes};

const SEEDS: u64 = if cfg!(debug_assertions) { 3 } else { 16 };
/// Most ticks until they are apart, or nearly.
const TICKS: usize = 40;
/// Divisor of the work of a full query, which gives the budget.
const PARTS: u64 = 10;
/// Initial overlap, as a share of the diameter.
const OVERLAP: f64 = 0.2;
/// Allowed final overlap, as a share of the diameter.
const TOUCH: f64 = 0.01;
/// Bisection steps to measure an overlap.
const HALVINGS: usize = 14;

const VERDICTS: Demand = Demand {
    contacts: false,
    regions: false,
    ..ASKED
};

/// A closed box whose sides are divided into `cells` by `cells` squares.
fn fine_cuboid(half: Vec3, cells: u32) -> meshes::Soup {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let mut names: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut name = |place: [u32; 3]| {
        *names.entry(place).or_insert_with(|| {
            let at = |k: usize| half[k] * (2.0 * f64::from(place[k]) / f64::from(cells) - 1.0);
            vertices.push(Point::new(at(0), at(1), at(2)));
            u32::try_from(vertices.len() - 1).unwrap()
        })
    };
    for axis in 0..3 {
        for (side, upper) in [(0, false), (cells, true)] {
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                let square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let [a, b, c, d] = square.map(|(u, v)| {
                    let mut place = [side; 3];
                    (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (u, v);
                    name(place)
                });
                faces.extend(if upper {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, c, b], [a, d, c]]
                });
            }
        }
    }
    meshes::Soup::new(vertices, faces)
}

fn diameter_m(things: &[Thing; 2]) -> f64 {
    things[0].radius + things[1].radius
}

fn shifted(pose: &Pose, by: Vec3) -> Pose {
    Pose::from_parts((pose.translation.vector + by).into(), pose.rotation)
}

/// Whether the two collide at these poses.
fn collide(twin: &mut Run, poses: &[Pose; 2]) -> bool {
    for (at, pose) in poses.iter().enumerate() {
        twin.drive.set(at, pose);
    }
    let tick = &twin.drive.send(Budget::UNLIMITED, VERDICTS).tick;
    assert_eq!(tick.possible, 0);
    tick.colliding > 0
}

/// The distance that the second body must move straight away from the first until they are apart, metres; 0: they are
/// apart.
fn overlap_m(twin: &mut Run, poses: &[Pose; 2]) -> f64 {
    if !collide(twin, poses) {
        return 0.0;
    }
    let between = poses[1].translation.vector - poses[0].translation.vector;
    let away = between.normalize();
    let (mut low, mut high) = (0.0, 1.01 * diameter_m(&twin.things) - between.norm());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if collide(twin, &[poses[0], shifted(&poses[1], away * middle)]) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Whether the output shows that contacts are incomplete: no region is of a complete pair, and no contact is exact.
fn is_cut_off(out: &Outbox) -> bool {
    let complete = |flags: u32| flags & region_flags::COMPLETE != 0;
    let exact = |flags: u32| flags & contact_flags::ESTIMATE == 0;
    !out.regions.is_empty()
        && !out.regions.iter().any(|row| complete(row.flags))
        && !out.contacts.iter().any(|row| exact(row.flags))
}

/// Motion of a body according to the deepest estimate: half of its depth along its normal, which points from A to B,
/// with the sign for this body.
fn push(out: &Outbox, body: u64) -> Option<Vec3> {
    let regions = out.regions.iter();
    let deepest = regions.max_by(|x, y| x.depth_m.total_cmp(&y.depth_m))?;
    let sign = if deepest.body_b == body { 1.0 } else { -1.0 };
    Some(Vec3::from(deepest.normal) * (0.5 * sign * deepest.depth_m))
}

/// Overlapping poses, with the second body in a random direction from the first.
fn overlapping(rng: &mut Rng, things: &[Thing; 2]) -> [Pose; 2] {
    let middle = rng.vector(5.0);
    let (a, turn, away) = (rng.pose(middle), rng.rotation(), rng.direction());
    let put =
        |distance_m: f64| Pose::from_parts((a.translation.vector + away * distance_m).into(), turn);
    let diameter_m = diameter_m(things);
    let near_m = 0.25 * diameter_m;
    let near = [a, put(near_m)];
    let apart_m = near_m + overlap_m(&mut Run::new(things, &near), &near);
    [a, put(apart_m - OVERLAP * diameter_m)]
}

/// Lets one of the two respond until they are apart or nearly; returns the number of ticks, and how many of them had
/// incomplete contacts.
fn respond(run: &mut Run, twin: &mut Run, moving: usize, what: &str) -> (usize, usize) {
    let body = run.drive.rows_mut()[moving].body;
    let work = Run::new(&run.things, &run.poses).send(Budget::UNLIMITED);
    let budget = Budget::units(work.tick.units / PARTS);
    let diameter_m = diameter_m(&run.things);
    let first_m = overlap_m(twin, &run.poses);
    assert!(first_m > 0.75 * OVERLAP * diameter_m, "{what}: {first_m} m");
    let (mut left_m, mut ticks, mut cut) = (first_m, 0, 0);
    while left_m >= TOUCH * diameter_m {
        let of = format!("{what}, {budget:?}, tick {ticks}: {left_m} of {first_m} m");
        assert!(ticks < TICKS, "{of}");
        let out = run.send(budget);
        let is_cut = is_cut_off(&out);
        assert!(ticks > 0 || is_cut, "{of}: all was found");
        if let Some(by) = push(&out, body) {
            run.poses[moving] = shifted(&run.poses[moving], by);
        }
        left_m = overlap_m(twin, &run.poses);
        ticks += 1;
        cut += usize::from(is_cut);
        assert!(left_m < 1.25 * first_m, "{of}: then {left_m} m");
        assert!(ticks < TICKS / 2 || left_m < 0.5 * first_m, "{of}");
    }
    (ticks, cut)
}

fn drive_apart(from: u64, part: &Part) {
    for seed in from..from + SEEDS {
        let mut rng = Rng::new(seed);
        let things = [0, 1].map(|_| Thing::new(vec![(part.clone(), Vec3::zeros())]));
        let poses = overlapping(&mut rng, &things);
        let (mut run, mut twin) = (Run::new(&things, &poses), Run::new(&things, &poses));
        let moving = usize::from(seed % 2 == 1);
        let what = format!("seed {seed}");
        let (ticks, cut) = respond(&mut run, &mut twin, moving, &what);
        println!("{what}: nearly apart after {ticks} ticks, contacts cut off in {cut}");
    }
}

#[test]
fn the_deepest_guess_of_two_bumpy_balls_that_are_cut_off_drives_them_apart() {
    drive_apart(90_000, &Part::Mesh(meshes::bumpy_sphere(24, 44, 0.05)));
}

#[test]
fn so_does_that_of_a_box_in_a_box() {
    let half = Vec3::new(1.0, 0.9, 0.8);
    drive_apart(95_000, &Part::Mesh(fine_cuboid(half, 12)));
}
