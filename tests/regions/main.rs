//! Goal: the union of a pair's regions contains every point that the two share, at any budget, in motion, for all
//! shapes; the regions are few, shrink with work, and their cones contain the normals of the exact manifold. Method:
//! scenes of two bodies in the engine, cut off at a random budget in each tick, compared with brute force over
//! triangles (`truth`), and with an engine without a limit at the same poses.
//! triangles (`truth`), and against an engine without a limit at the same poses.
#![allow(
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    clippy::print_stdout,
    unreachable_pub,
    reason = "tests"
)]

mod budget;
#[path = "../harness/mod.rs"]
mod harness;
#[path = "../oracle/mod.rs"]
mod oracle;
mod response;
mod truth;

use harness::Drive;
use oracle::meshes;
use oracle::rng::Rng;
use sweepd::builtin::Pattern;
use sweepd::math::{Point, Pose, Quat, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{ContactKind, Demand, Level, Outbox, RegionRow, Verdict, region_flags};
use truth::{Part, Thing, cross, held, shared};

const CASES: u64 = if cfg!(debug_assertions) { 40 } else { 1200 };
const TICKS: usize = 6;

const ASKED: Demand = Demand {
    pairs: true,
    contacts: true,
    regions: true,
    bodies: false,
    body_verdicts: false,
    changes: false,
    contact_changes: false,
    changes_anew: false,
};

fn mesh(rng: &mut Rng) -> Part {
    let one = Vec3::new(1.0, 1.0, 1.0);
    Part::Mesh(match rng.below(10) {
        0 => meshes::tetrahedron(rng),
        1 => meshes::cuboid(Vec3::new(1.0, 0.6, 0.3)),
        2 => meshes::torus(1.0, 0.3, 9, 6),
        3 | 4 => meshes::bumpy_sphere(7, 8, 0.1),
        5 => meshes::patch(rng, 4),
        6 => meshes::height_field(rng, 4, 0.4),
        7 => meshes::block_with_hole(1.0, 0.5, 0.5),
        8 => meshes::cuboid(one).and(meshes::cuboid(one * 0.6).inverted()),
        _ => meshes::cuboid(one * 0.4).moved(Vec3::x() * 0.6).and(
            meshes::tetrahedron(rng)
                .scaled(one * 0.4)
                .moved(Vec3::x() * -0.6),
        ),
    })
}

fn cuboid(rng: &mut Rng) -> Part {
    Part::Box(Vec3::new(
        rng.range(0.1, 1.0),
        rng.range(0.1, 1.0),
        rng.range(0.1, 1.0),
    ))
}

/// Two bodies for a kind of pair.
fn things(rng: &mut Rng, kind: usize) -> [Thing; 2] {
    let single = |part: Part| Thing::new(vec![(part, Vec3::zeros())]);
    match kind {
        // Two meshes: half of all kinds.
        0..=3 => {
            let size = rng.range(0.2, 1.0);
            let mut small = mesh(rng);
            if let (Part::Mesh(soup), 0) = (&mut small, rng.below(3)) {
                *soup = soup.clone().scaled(Vec3::new(size, size, size));
            }
            [single(mesh(rng)), single(small)]
        }
        4 => [single(mesh(rng)), single(cuboid(rng))],
        5 => [single(cuboid(rng)), single(cuboid(rng))],
        6 => {
            let body = if rng.below(2) == 0 {
                mesh(rng)
            } else {
                cuboid(rng)
            };
            [single(Part::Floor), single(body)]
        }
        _ => {
            let two = |rng: &mut Rng| {
                let (x, y) = (mesh(rng), cuboid(rng));
                Thing::new(vec![
                    (x, Vec3::new(-0.7, 0.0, 0.0)),
                    (y, Vec3::new(0.9, 0.1, 0.0)),
                ])
            };
            [two(rng), two(rng)]
        }
    }
}

fn scene(things: &[Thing; 2], poses: &[Pose; 2]) -> String {
    let mut text = "[[source]]\nname = \"feed\"\n".to_owned();
    for (k, (thing, pose)) in things.iter().zip(poses).enumerate() {
        let floor = matches!(thing.parts[0].0, Part::Floor);
        let at: [f64; 3] = if floor {
            [0.0; 3]
        } else {
            pose.translation.vector.into()
        };
        let (moves, deforms) = (!floor, thing.deforms);
        text += &format!(
            "[[body]]\nname = \"b{k}\"\nmoves = {moves}\ndeforms = {deforms}\nposition = {at:?}\nshape = {}\n",
            thing.text()
        );
    }
    text
}

/// Poses in contact: a third deep or contained, a third within 1 % of touching, the rest arbitrary; some far from the
/// origin.
fn place(rng: &mut Rng, things: &[Thing; 2]) -> [Pose; 2] {
    let floor = matches!(things[0].parts[0].0, Part::Floor);
    let far = if !floor && rng.below(4) == 0 {
        1e6
    } else {
        1.0
    };
    let a = if floor {
        Pose::identity()
    } else {
        {
            let at = rng.vector(far);
            rng.pose(at)
        }
    };
    let (turn, reach) = (rng.rotation(), things[0].radius + things[1].radius);
    let away = if floor { Vec3::z() } else { rng.direction() };
    let at = |d: f64| Pose::from_parts((a.translation.vector + away * d).into(), turn);
    let distance = match rng.below(3) {
        0 => rng.range(0.0, 0.45) * reach,
        1 => {
            let (mut low, mut high) = (0.0, 1.01 * reach);
            for _ in 0..16 {
                let middle = 0.5 * (low + high);
                if cross((&things[0], &a), (&things[1], &at(middle))) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            high + [0.01, -0.01, 1e-4, -1e-4, -1e-3, 1e-6][rng.below(6)] * rng.unit() * reach
        }
        _ => rng.range(0.2, 1.0) * reach,
    };
    [a, at(distance)]
}

fn moved(rng: &mut Rng, pose: &Pose, size: f64) -> Pose {
    let by = [0.0, 1e-9, 1e-3, 0.01, 0.05, 0.5][rng.below(6)];
    let turn = Quat::from_scaled_axis(rng.vector(by));
    let to = pose.translation.vector + rng.vector(by * size);
    Pose::from_parts(
        to.into(),
        Quat::new_normalize((turn * pose.rotation).into_inner()),
    )
}

fn point(row: [f64; 3]) -> Point {
    Point::from(Vec3::from(row))
}

/// Whether a point relative to `from` is in one of the regions.
fn inside(regions: &[RegionRow], p: &Point, from: &Vec3, slack: f64) -> bool {
    regions.iter().any(|row| {
        let centre = point(row.centre) - from;
        (p - centre).norm() <= row.radius_m + slack
    })
}

struct Run {
    things: [Thing; 2],
    poses: [Pose; 2],
    drive: Drive,
}

impl Run {
    fn new(things: &[Thing; 2], poses: &[Pose; 2]) -> Self {
        let drive = Drive::new(&scene(things, poses), Pattern::Wander, 1);
        Self {
            things: things.clone(),
            poses: *poses,
            drive,
        }
    }

    fn send(&mut self, budget: Budget) -> Outbox {
        let floor = matches!(self.things[0].parts[0].0, Part::Floor);
        let moving = if floor {
            &self.poses[1..]
        } else {
            &self.poses[..]
        };
        for (at, pose) in moving.iter().enumerate() {
            self.drive.set(at, pose);
        }
        let out = self.drive.send(budget, ASKED).clone();
        let bent = self.drive.bent();
        let deforming = self.things.iter_mut().filter(|thing| thing.deforms);
        for (thing, vertices) in deforming.zip(&bent) {
            thing.bend(vertices);
        }
        out
    }

    /// Checks a tick; returns the number of points checked.
    fn check(&self, out: &Outbox, what: &str) -> usize {
        let from = self.poses[0].translation.vector;
        let sides = [
            (&self.things[0], &self.poses[0]),
            (&self.things[1], &self.poses[1]),
        ];
        let regions = &out.regions;
        assert!(regions.len() <= 8, "{what}");
        let complete = regions
            .first()
            .is_some_and(|r| r.flags & region_flags::COMPLETE != 0);
        for (index, row) in regions.iter().enumerate() {
            assert_eq!(
                (usize::from(row.index), usize::from(row.count)),
                (index, regions.len()),
                "{what}"
            );
            assert!(
                row.radius_m >= 0.0 && row.radius_m.is_finite(),
                "{what}: {row:?}"
            );
            let units = [row.cone_axis, row.normal].map(|v| Vec3::from(v).norm());
            assert!(
                units.iter().all(|n| (n - 1.0).abs() < 1e-9),
                "{what}: {row:?}"
            );
            assert!(
                (0.0..=std::f64::consts::PI + 1e-5).contains(&row.cone_half_angle_rad),
                "{what}"
            );
            assert!(row.depth_m >= 0.0, "{what}: {row:?}");
            assert!(row.body_a < row.body_b, "{what}");
            assert_eq!(
                row.flags & region_flags::COMPLETE != 0,
                row.flags & region_flags::ESTIMATE == 0,
                "{what}"
            );
        }
        let open = out.pairs.iter().any(|row| {
            row.verdict == Verdict::Possible.code() || row.verdict == Verdict::Colliding.code()
        });
        // A possible pair may have no regions, if tests of its boxes have proved it apart.
        assert!(open || regions.is_empty(), "{what}");
        let slack = 1e-9 * (self.things[0].radius + self.things[1].radius);
        let mut count = 0;
        let all = shared(sides[0], sides[1], &from);
        for (p, convex) in &all {
            // For a finished pair of convex shapes the regions cover the contacts instead.
            if *convex && complete {
                continue;
            }
            assert!(
                inside(regions, p, &from, slack),
                "{what}: {p:?} is in none of {regions:#?}"
            );
            count += 1;
        }
        if all.is_empty() && !complete {
            for p in held(sides[0], sides[1], &from) {
                assert!(
                    inside(regions, &p, &from, slack),
                    "{what}: held {p:?} is in none of {regions:#?}"
                );
                count += 1;
            }
        }
        if complete {
            let contacts = out
                .contacts
                .iter()
                .filter(|c| c.kind == ContactKind::Contact.code());
            for contact in contacts {
                for p in [contact.point_a, contact.point_b] {
                    let p = point(p) - from;
                    assert!(
                        inside(regions, &p, &from, slack),
                        "{what}: contact {p:?} is in none of {regions:#?}"
                    );
                    count += 1;
                }
            }
        }
        count
    }
}

/// Once one surface of a mesh touched, another surface wholly inside the other body was omitted.
#[test]
fn bug_a_surface_within_the_other_was_left_out_once_another_one_touched() {
    let small = || meshes::cuboid(Vec3::repeat(0.1));
    let two = small().moved(Vec3::x()).and(small());
    let one = |part| Thing::new(vec![(part, Vec3::zeros())]);
    let things = [
        one(Part::Mesh(two)),
        one(Part::Mesh(meshes::cuboid(Vec3::repeat(1.0)))),
    ];
    let within = small().vertices;
    let (mut complete, mut cut) = (0, 0);
    for units in (0..200).map(Some).chain([None]) {
        let budget = units.map_or(Budget::UNLIMITED, Budget::units);
        let mut run = Run::new(&things, &[Pose::identity(); 2]);
        for tick in 0..3 {
            let out = run.send(budget);
            let first = out.regions.first().map(|row| row.flags);
            complete += u32::from(first.is_some_and(|f| f & region_flags::COMPLETE != 0));
            cut += u32::from(first.is_some_and(|f| f & region_flags::COMPLETE == 0));
            for p in &within {
                assert!(
                    inside(&out.regions, p, &Vec3::zeros(), 1e-9),
                    "{units:?} tick {tick}: {p:?} is in none of {:#?}",
                    out.regions
                );
            }
        }
    }
    assert!(complete > 0 && cut > 0, "{complete} {cut}");
}

/// A deforming mesh and a body of any kind.
fn bending(rng: &mut Rng) -> [Thing; 2] {
    let soft = |rng: &mut Rng| {
        let soup = match rng.below(3) {
            0 => meshes::bumpy_sphere(7, 8, 0.1),
            1 => meshes::torus(1.0, 0.3, 9, 6),
            _ => meshes::cuboid(Vec3::new(1.0, 0.6, 0.3)),
        };
        Thing {
            deforms: true,
            ..Thing::new(vec![(Part::Mesh(soup), Vec3::zeros())])
        }
    };
    let hard = |part| Thing::new(vec![(part, Vec3::zeros())]);
    match rng.below(4) {
        0 => [soft(rng), soft(rng)],
        1 => [soft(rng), hard(mesh(rng))],
        2 => [hard(cuboid(rng)), soft(rng)],
        _ => [hard(Part::Floor), soft(rng)],
    }
}

fn budget(rng: &mut Rng) -> Budget {
    match rng.below(8) {
        0 => Budget::UNLIMITED,
        1 | 2 => Budget::units(0),
        3 => Budget::units(1),
        k => Budget::units([6, 25, 80, 300][k - 4]),
    }
}

fn sweep(seed: u64, kinds: std::ops::Range<usize>) {
    sweep_of(seed, |rng| {
        let kind = kinds.start + rng.below(kinds.len());
        things(rng, kind)
    });
}

fn sweep_of(seed: u64, mut make: impl FnMut(&mut Rng) -> [Thing; 2]) {
    let (mut points, mut cut, mut complete) = (0, 0, 0);
    for case in 0..CASES {
        let mut rng = Rng::new(seed + case);
        let things = make(&mut rng);
        let mut run = Run::new(&things, &place(&mut rng, &things));
        let size = run.things[1].radius;
        for tick in 0..TICKS {
            let budget = budget(&mut rng);
            let out = run.send(budget);
            let what = format!("seed {} tick {tick} {budget:?}", seed + case);
            points += run.check(&out, &what);
            let done = out
                .regions
                .first()
                .map(|row| row.flags & region_flags::COMPLETE != 0);
            cut += u64::from(done == Some(false));
            complete += u64::from(done == Some(true));
            run.poses[1] = moved(&mut rng, &run.poses[1], size);
        }
    }
    println!("{points} points, {cut} pair-ticks cut off, {complete} complete");
    assert!(points as u64 > 100 * CASES && cut > CASES && complete > CASES / 4);
}

#[test]
fn every_point_that_two_meshes_share_is_in_a_region_at_any_budget_and_in_motion() {
    sweep(10_000, 0..4);
}

#[test]
fn so_is_every_point_of_convex_shapes_planes_and_bodies_of_several_shapes() {
    sweep(20_000, 4..8);
}

#[test]
fn regions_of_meshes_that_deform_hold_all_that_is_shared_at_any_budget() {
    sweep_of(30_000, bending);
}

/// The largest radius, relative to the mean radius of the two bodies.
fn widest(out: &Outbox, things: &[Thing; 2]) -> f64 {
    let largest = out
        .regions
        .iter()
        .map(|row| row.radius_m)
        .fold(0.0, f64::max);
    2.0 * largest / (things[0].radius + things[1].radius)
}

#[test]
fn regions_get_smaller_with_work() {
    // The mean of a few pairs has no meaning, so debug builds use as many as release.
    let mut sums = [0.0; 6];
    let mut count = 0;
    for case in 0..300 {
        let mut rng = Rng::new(30_000 + case);
        let things = things(&mut rng, 0);
        let poses = place(&mut rng, &things);
        let exact = Run::new(&things, &poses).send(Budget::UNLIMITED);
        if exact.tick.colliding == 0 {
            continue;
        }
        count += 1;
        let work = exact.tick.units;
        for (sum, share) in sums.iter_mut().zip([0, 5, 25, 50, 75, 100]) {
            let out = Run::new(&things, &poses).send(Budget::units(work * share / 100));
            *sum += widest(&out, &things);
        }
    }
    println!(
        "{count} pairs, mean of the largest radius {:?}",
        sums.map(|s| s / f64::from(count))
    );
    assert!(count > 150, "{count} pairs");
    // The intersection of the root boxes, divided evenly, is about as small as the first few boxes of a front.
    assert!(sums[1] <= 1.02 * sums[0], "{sums:?}");
    for pair in sums[1..5].windows(2) {
        // A shell that may be inside is an exception: if there are several, it is tested only after the two touch.
        assert!(pair[1] <= 1.01 * pair[0], "{sums:?}");
    }
    // Complete regions also contain the points of the manifold, which can be deeper than the shared points of the
    // surfaces.
    assert!(sums[5] <= 1.05 * sums[4], "{sums:?}");
}

#[test]
fn the_normals_of_the_exact_manifold_are_in_the_cones_of_the_regions_that_hold_their_points() {
    let (mut all, mut out_of, mut narrow) = (0, 0, 0);
    for case in 0..CASES / 2 {
        let mut rng = Rng::new(40_000 + case);
        let kind = rng.below(8);
        let things = things(&mut rng, kind);
        let poses = place(&mut rng, &things);
        let from = poses[0].translation.vector;
        let exact = Run::new(&things, &poses).send(Budget::UNLIMITED);
        for units in [0, 1, 10, 40, exact.tick.units / 4, exact.tick.units] {
            let out = Run::new(&things, &poses).send(Budget::units(units));
            for contact in exact
                .contacts
                .iter()
                .filter(|c| c.kind == ContactKind::Contact.code())
            {
                let middle =
                    nalgebra::center(&point(contact.point_a), &point(contact.point_b)) - from;
                let normal = Vec3::from(contact.normal);
                let at: Vec<&RegionRow> = (out.regions.iter())
                    .filter(|row| inside(std::slice::from_ref(*row), &middle, &from, 1e-9))
                    .collect();
                if at.is_empty() {
                    continue;
                }
                let within = |row: &&RegionRow| {
                    let angle = Vec3::from(row.cone_axis)
                        .dot(&normal)
                        .clamp(-1.0, 1.0)
                        .acos();
                    angle <= row.cone_half_angle_rad + 1e-6
                };
                all += 1;
                narrow += u64::from(at.iter().any(|row| row.cone_half_angle_rad < 1.6));
                let good = at.iter().any(within);
                out_of += u64::from(!good);
                if !good && std::env::var_os("SHOW").is_some() {
                    println!(
                        "seed {} kind {kind} units {units} of {}: {contact:?} {at:#?}",
                        40_000 + case,
                        exact.tick.units
                    );
                }
            }
        }
    }
    println!("{all} normals, {narrow} at cones narrower than a right angle, {out_of} out");
    assert_eq!(out_of, 0);
}

#[test]
fn a_pair_of_unknown_place_has_one_region_as_large_as_its_boxes_or_none_at_all() {
    let things =
        [0, 1].map(|_| Thing::new(vec![(Part::Box(Vec3::new(0.5, 0.5, 0.5)), Vec3::zeros())]));
    let at = |x: f64| Pose::translation(x, 0.0, 0.0);
    let mut run = Run::new(&things, &[at(0.0), at(0.8)]);
    run.send(Budget::UNLIMITED);
    // No frame for longer than the timeout: the shared points are unknown from then on.
    for _ in 0..60 {
        run.drive.idle(Budget::UNLIMITED, ASKED);
    }
    let out = run.drive.out();
    assert_eq!(out.tick.possible, 1);
    assert!(!out.regions.is_empty());
    for row in &out.regions {
        assert_eq!(
            (row.level, row.flags),
            (Level::Boxes.code(), region_flags::ESTIMATE)
        );
        assert!(
            row.radius_m.is_infinite() && row.cone_half_angle_rad > 3.0,
            "{row:?}"
        );
    }
}

#[test]
fn a_way_that_was_not_decided_has_a_region_that_holds_where_it_may_have_touched() {
    let wall = "[[body]]\nname = \"wall\"\nmoves = false\nposition = [0.0, 0.0, 0.0]\n\
        shape = { type = \"box\", half_extents = [0.001, 1.0, 1.0] }\n";
    let bullet = "[[body]]\nname = \"bullet\"\nmoves = true\ncontinuous = true\n\
        position = [-5.0, 0.1, 0.0]\nshape = { type = \"sphere\", radius = 0.05 }\n";
    let text = format!("[[source]]\nname = \"feed\"\n{wall}{bullet}");
    let mut drive = Drive::new(&text, Pattern::Wander, 1);
    for (x, there) in [(-5.0, false), (5.0, true), (6.0, false)] {
        drive.set(0, &Pose::translation(x, 0.1, 0.0));
        let out = drive.send(Budget::units(0), ASKED);
        assert_eq!(!out.regions.is_empty(), there, "{:#?}", out.pairs);
        if there {
            assert!(inside(
                &out.regions,
                &Point::new(0.0, 0.1, 0.0),
                &Vec3::zeros(),
                0.0
            ));
            assert!(
                out.regions
                    .iter()
                    .all(|row| row.level == Level::Boxes.code())
            );
        }
    }
}

#[test]
fn a_complete_pair_at_rest_keeps_its_regions_and_a_moved_one_does_not() {
    let mut rng = Rng::new(50_000);
    let ball = || {
        Thing::new(vec![(
            Part::Mesh(meshes::bumpy_sphere(7, 8, 0.1)),
            Vec3::zeros(),
        )])
    };
    let things = [ball(), ball()];
    let at = |x: f64| Pose::translation(x, 0.1, 0.2);
    let mut run = Run::new(&things, &[Pose::identity(), at(1.5)]);
    let first = run.send(Budget::UNLIMITED).regions;
    assert!(first.iter().all(|row| row.flags == region_flags::COMPLETE) && !first.is_empty());
    assert_eq!(run.send(Budget::UNLIMITED).regions, first);
    // There is no work left, so no units are spent, and the regions stay.
    assert_eq!(run.send(Budget::units(0)).regions, first);
    for _ in 0..20 {
        run.poses[1] = moved(&mut rng, &at(1.5), 1.0);
        let out = run.send(Budget::UNLIMITED);
        run.check(&out, "moved");
    }
    run.poses[1] = at(1.4);
    assert_ne!(run.send(Budget::UNLIMITED).regions, first);
}
