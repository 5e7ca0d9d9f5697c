//! Goal: walks over mesh pairs hold the truth at every interruption and end with the right verdict (laws 1, 3.2, 3.3).
//! Method: random small meshes at random, nearly touching, deep, contained and far poses against the brute-force
//! oracle of `tests/oracle`; thousands of pairs in release, hundreds in dev.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test may; its helpers are nobody's interface"
)]

mod oracle;

use oracle::meshes::{self, Soup};
use oracle::rng::Rng;
use oracle::{Placed, Truth, truth};
use sweepd::math::{Interval, Point, Pose, Quat, Vec3, relative};
use sweepd::narrow::mesh::{Goal, Walk, retest_witness};
use sweepd::shape::{Convex, Geometry, Mesh, Shape};
use sweepd::time::{ManualClock, Meter};

/// Cases of each kind: what dev can bear, or what the law asks for.
const CASES: u64 = if cfg!(debug_assertions) { 12 } else { 300 };

fn shape(soup: &Soup, solid: Option<bool>) -> Shape {
    let mesh = Mesh::new(soup.vertices.clone(), soup.faces.clone(), solid).unwrap();
    Shape {
        aabb: mesh.aabb(),
        centre: mesh.centre(),
        radius: mesh.radius(),
        geometry: Geometry::Mesh(mesh),
    }
}

/// A convex shape and the closed mesh that it is, for the oracle.
fn convex(convex: Convex) -> Shape {
    Shape {
        aabb: convex.aabb_at(&Pose::identity()),
        centre: convex.centre(),
        radius: convex.radius(),
        geometry: Geometry::Convex(convex),
    }
}

/// The mesh of a convex shape: its own faces where it is a box or a tetrahedron (by its supports), else a triangle.
fn as_mesh(shape: &Shape) -> (Vec<Point>, Vec<[u32; 3]>, bool) {
    let Geometry::Convex(convex) = &shape.geometry else {
        let mesh = mesh_of(shape);
        return (
            mesh.vertices().to_vec(),
            mesh.faces().to_vec(),
            mesh.is_solid(),
        );
    };
    let corners: Vec<Point> = convex.vertices().iter().map(|v| Point::from(*v)).collect();
    match corners.len() {
        0 => {
            let soup = meshes::cuboid(shape.aabb.half_extents());
            (soup.vertices, soup.faces, true)
        }
        3 => (corners, vec![[0, 1, 2]], false),
        _ => {
            let mut faces = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            if normal.dot(&(corners[3] - corners[0])) > 0.0 {
                faces.iter_mut().for_each(|f: &mut [u32; 3]| f.swap(1, 2));
            }
            (corners, faces, true)
        }
    }
}

fn mesh_of(shape: &Shape) -> &Mesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        _ => panic!("a mesh"),
    }
}

fn placed(shape: &Shape, pose: &Pose, from: &Vec3) -> Placed {
    let (vertices, faces, solid) = as_mesh(shape);
    Placed::new(&vertices, &faces, solid, pose, from)
}

fn truth_of(a: &Shape, b: &Shape, pose_a: &Pose, pose_b: &Pose) -> Truth {
    let from = pose_a.translation.vector;
    truth(&placed(a, pose_a, &from), &placed(b, pose_b, &from))
}

/// Runs a walk in slices of one unit, checks every interruption, and yields where it ended.
fn run(a: &Shape, b: &Shape, pose_a: &Pose, pose_b: &Pose, goal: Goal, what: &str) -> Interval {
    let truth = truth_of(a, b, pose_a, pose_b);
    let pos12 = relative(pose_a, pose_b);
    let size = a.radius.max(b.radius);
    let tolerance = 1e-11 * (a.radius + b.radius);
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let mut walk = Walk::default();
    walk.start(a, b, &pos12);
    let mut last = Interval::UNKNOWN;
    loop {
        let now = walk.interval();
        assert!(
            now.min >= last.min && now.max <= last.max,
            "{what}: loosened from {last:?} to {now:?}"
        );
        match truth {
            Truth::Apart(d) => assert!(
                now.min <= d + tolerance && d - tolerance <= now.max,
                "{what}: {now:?} without {d}"
            ),
            Truth::Overlap(gap) => assert!(
                now.min <= gap + tolerance,
                "{what}: {now:?}, but the gap is at most {gap}"
            ),
        }
        last = now;
        if walk.advance(a, b, goal, 1, &mut meter) {
            break;
        }
        assert!(meter.spent() < 50_000_000, "{what}: no end");
    }
    let end = walk.interval();
    match truth {
        Truth::Apart(d) if d > 1e-9 * size => {
            assert!(end.min > 0.0, "{what}: {end:?} for {d}");
            if goal != Goal::Verdict {
                assert!(end.width() <= 1e-9 * size, "{what}: {end:?} for {d}");
            }
        }
        Truth::Overlap(gap) => {
            assert!(end.min <= 0.0, "{what}: {end:?} for {gap}");
            if gap < -1e-9 * size {
                assert!(end.max <= 1e-12 * size, "{what}: {end:?} for {gap}");
            }
        }
        Truth::Apart(_) => {}
    }
    if let Some(w) = walk.witness() {
        let across = w.closest.point_b - w.closest.point_a;
        assert!((w.closest.normal.norm() - 1.0).abs() < 1e-12, "{what}");
        let along = (across - w.closest.normal * w.closest.best_m).norm();
        assert!(along < 1e-9 * size, "{what}: off by {along}");
    }
    if goal == Goal::Contacts {
        assert_eq!(walk.contacts().is_empty(), end.min > 0.0, "{what} {end:?}");
    }
    if let Some(w) = walk.witness().filter(|w| w.closest.best_m > 0.0) {
        let again = retest_witness(a, b, &pos12, w.triangle_a, w.triangle_b).unwrap();
        assert_eq!(again.gap, w.closest.gap, "{what}");
    }
    end
}

/// One mesh of `kind`, and its name.
fn any_mesh(rng: &mut Rng, kind: usize) -> (Shape, &'static str) {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let (soup, name) = match kind {
        0 => (meshes::tetrahedron(rng), "tetrahedron"),
        1 => (meshes::cuboid(Vec3::new(1.0, 0.6, 0.3)), "cuboid"),
        2 => (meshes::torus(1.0, 0.3, 9, 6), "torus"),
        3 => (meshes::bumpy_sphere(7, 8, 0.1), "bumpy sphere"),
        4 => (meshes::patch(rng, 4), "patch"),
        5 => (
            meshes::cuboid(one).and(meshes::cuboid(one * 0.6).inverted()),
            "box with a cavity",
        ),
        6 => (
            meshes::bumpy_sphere(5, 6, 0.05).inverted(),
            "inverted sphere",
        ),
        7 => (meshes::height_field(rng, 4, 0.4), "height field"),
        8 => (meshes::block_with_hole(1.0, 0.5, 0.5), "block with a hole"),
        9 => (meshes::slivers(rng), "slivers"),
        10 => (
            meshes::cuboid(one).and(meshes::cuboid(one * 0.5)),
            "nested shells",
        ),
        _ => (
            meshes::cuboid(one * 0.4).moved(Vec3::x() * 0.6).and(
                meshes::tetrahedron(rng)
                    .scaled(one * 0.4)
                    .moved(Vec3::x() * -0.6),
            ),
            "two parts",
        ),
    };
    (shape(&soup, None), name)
}

const KINDS: usize = 12;

/// One convex shape whose faces the oracle can have.
fn any_convex(rng: &mut Rng) -> (Shape, &'static str) {
    match rng.below(3) {
        0 => {
            let half = Vec3::new(
                rng.range(0.05, 1.0),
                rng.range(0.05, 1.0),
                rng.range(0.05, 1.0),
            );
            (convex(Convex::cuboid(half)), "convex box")
        }
        1 => {
            let points = meshes::tetrahedron(rng).vertices;
            (convex(Convex::hull(&points).unwrap()), "convex hull")
        }
        _ => {
            let corners = [rng.point(1.0), rng.point(1.0), rng.point(1.0)];
            (convex(Convex::triangle(corners)), "triangle")
        }
    }
}

/// Poses of a pair: generic, nearly touching (within 1 % of the size, either side), deep, contained.
fn place(rng: &mut Rng, a: &Shape, b: &Shape, how: usize) -> (Pose, Pose) {
    let far = if rng.below(5) == 0 { 1e7 } else { 1.0 };
    let origin = rng.vector(far);
    let pose_a = rng.pose(origin);
    let reach = a.radius + b.radius;
    let centre_a = pose_a * a.centre;
    let rotation = rng.rotation();
    let away = rng.direction();
    let at = |distance: f64| {
        let centre = centre_a + away * distance;
        Pose::from_parts(
            (centre.coords - rotation * b.centre.coords).into(),
            rotation,
        )
    };
    if how == 0 {
        return (pose_a, at(rng.range(0.6, 1.5) * reach));
    }
    if how == 1 {
        return (pose_a, at(rng.range(0.0, 0.5) * reach));
    }
    // Towards the other, each time by almost all of what is proved free, until they nearly touch.
    let mut distance = 1.1 * reach;
    for _ in 0..12 {
        if let Truth::Apart(d) = truth_of(a, b, &pose_a, &at(distance)) {
            distance -= 0.999 * d;
        }
    }
    let nudge = [0.01, -0.01, 1e-4, -1e-4, 1e-7, -1e-7][rng.below(6)];
    (
        pose_a,
        at(distance + nudge * a.radius.max(b.radius) * rng.unit()),
    )
}

fn sweep(seed: u64, how: usize, goal: Goal) {
    let mut overlapping = 0;
    for case in 0..CASES {
        let mut rng = Rng::new(seed + case);
        let (kind_a, kind_b) = (rng.below(KINDS), rng.below(KINDS));
        let ((a, name_a), (b, name_b)) = (any_mesh(&mut rng, kind_a), any_mesh(&mut rng, kind_b));
        let (pose_a, pose_b) = place(&mut rng, &a, &b, how);
        let what = format!("seed {} {name_a} - {name_b}", seed + case);
        let end = run(&a, &b, &pose_a, &pose_b, goal, &what);
        overlapping += u64::from(end.min <= 0.0);
    }
    // The sample has to be one: deep poses overlap, generic ones are mixed.
    assert!(
        how != 1 || 3 * overlapping > 2 * CASES,
        "{overlapping} overlap"
    );
    assert!(how != 0 || overlapping < CASES, "{overlapping} overlap");
}

#[test]
fn law_1_generic_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(1_000_000, 0, Goal::Gap);
}

#[test]
fn law_1_deep_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(2_000_000, 1, Goal::Gap);
}

#[test]
fn law_1_nearly_touching_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(3_000_000, 2, Goal::Gap);
}

#[test]
fn law_3_4_verdicts_of_nearly_touching_mesh_pairs_are_right() {
    sweep(4_000_000, 2, Goal::Verdict);
}

#[test]
fn law_3_4_verdicts_of_deep_mesh_pairs_are_right_when_contacts_are_wanted() {
    sweep(5_000_000, 1, Goal::Contacts);
}

#[test]
fn law_1_meshes_and_convex_shapes_hold_the_truth_at_every_interruption() {
    for case in 0..CASES * 3 {
        let mut rng = Rng::new(6_000_000 + case);
        let kind = rng.below(KINDS);
        let ((mesh, name_a), (other, name_b)) = (any_mesh(&mut rng, kind), any_convex(&mut rng));
        let (pose_a, pose_b) = place(&mut rng, &mesh, &other, usize::try_from(case % 3).unwrap());
        let goal = [Goal::Verdict, Goal::Gap, Goal::Contacts][rng.below(3)];
        let what = format!("seed {} {name_a} - {name_b}", 6_000_000 + case);
        if rng.below(2) == 0 {
            run(&mesh, &other, &pose_a, &pose_b, goal, &what);
        } else {
            run(&other, &mesh, &pose_b, &pose_a, goal, &what);
        }
    }
}

#[test]
fn a_ball_is_its_centre_less_its_radius() {
    for case in 0..CASES {
        let mut rng = Rng::new(7_000_000 + case);
        let kind = rng.below(KINDS);
        let (mesh, name) = any_mesh(&mut rng, kind);
        let radius = rng.range(0.01, 0.5);
        let ball = convex(Convex::sphere(radius));
        let pose = Pose::from_parts(rng.vector(1.5).into(), rng.rotation());
        let about = placed(&mesh, &Pose::identity(), &Vec3::zeros());
        let centre = Point::from(pose.translation.vector);
        let held = about.holds(&centre);
        let apart = about.distance_from(&centre) - radius;
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        let mut walk = Walk::default();
        walk.start(&mesh, &ball, &pose);
        assert!(walk.advance(&mesh, &ball, Goal::Gap, u64::MAX, &mut meter));
        let end = walk.interval();
        if held || apart < 0.0 {
            assert!(end.max <= 1e-13 && end.min < 0.0, "{name} {end:?}");
            // A centre under the surface is as deep as its distance; the ball reaches deeper or equally deep.
            assert!(!held || end.min <= -about.distance_from(&centre) + 1e-12);
        } else {
            assert!(end.widened(1e-11).contains(apart), "{name} {end:?} {apart}");
            assert!(end.width() < 1e-9);
        }
    }
}

#[test]
fn law_3_3_a_torus_round_a_rod_is_no_collision() {
    let torus = shape(&meshes::torus(1.0, 0.3, 16, 8), None);
    let rod = shape(&meshes::cuboid(Vec3::new(0.2, 0.2, 3.0)), None);
    let mut rng = Rng::new(5);
    for case in 0..CASES {
        let tilt = Quat::from_scaled_axis(rng.vector(0.1));
        let pose = Pose::from_parts(rng.vector(0.1).into(), tilt);
        let end = run(
            &torus,
            &rod,
            &Pose::identity(),
            &pose,
            Goal::Gap,
            &format!("rod {case}"),
        );
        assert!(end.min > 0.0, "{end:?}");
        let end = run(
            &rod,
            &torus,
            &pose,
            &Pose::identity(),
            Goal::Verdict,
            "torus",
        );
        assert!(end.min > 0.0, "{end:?}");
    }
}

#[test]
fn law_3_3_a_solid_in_a_solid_collides_and_a_solid_in_a_cavity_does_not() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let small = shape(&meshes::cuboid(one * 0.3), None);
    let full = shape(&meshes::cuboid(one), None);
    let hollow = shape(
        &meshes::cuboid(one).and(meshes::cuboid(one * 0.7).inverted()),
        None,
    );
    let nested = shape(&meshes::cuboid(one).and(meshes::cuboid(one * 0.7)), None);
    let skin = shape(&meshes::cuboid(one), Some(false));
    let mut rng = Rng::new(6);
    for case in 0..CASES {
        let pose = rng.pose(Rng::new(case).vector(0.1));
        let at = Pose::identity();
        for (outer, collides) in [
            (&full, true),
            (&hollow, false),
            (&nested, true),
            (&skin, false),
        ] {
            for (end, way) in [
                (
                    run(outer, &small, &at, &pose, Goal::Gap, "out-in"),
                    "out-in",
                ),
                (
                    run(&small, outer, &pose, &at, Goal::Gap, "in-out"),
                    "in-out",
                ),
                (
                    run(&small, outer, &pose, &at, Goal::Contacts, "in-out"),
                    "contacts",
                ),
            ] {
                assert_eq!(end.max < 0.0, collides, "{way} {end:?}");
                assert_eq!(end.min > 0.0, !collides, "{way} {end:?}");
            }
        }
    }
}

#[test]
fn law_3_3_an_inverted_shell_is_a_solid_like_any_other() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let small = shape(&meshes::cuboid(one * 0.3), None);
    let inverted = shape(&meshes::cuboid(one).inverted(), None);
    let end = run(
        &inverted,
        &small,
        &Pose::identity(),
        &Pose::identity(),
        Goal::Verdict,
        "inverted",
    );
    assert!(end.max < 0.0);
}

#[test]
fn law_3_2_a_peg_turned_in_its_hole_is_apart_until_it_touches() {
    let block = shape(&meshes::block_with_hole(1.0, 0.5, 0.5), None);
    let mut rng = Rng::new(7);
    for case in 0..CASES {
        let clearance = [1e-2, 1e-3, 1e-4][rng.below(3)];
        let half = 0.5 - clearance;
        let peg = shape(&meshes::cuboid(Vec3::new(half, half, 1.0)), None);
        for angle in [0.0, 0.01, 0.5 * clearance] {
            let turn = Quat::from_scaled_axis(rng.direction() * angle);
            let pose = Pose::from_parts(rng.vector(0.2 * clearance).into(), turn);
            let what = format!("peg {case} {clearance} {angle}");
            let end = run(&block, &peg, &Pose::identity(), &pose, Goal::Gap, &what);
            if angle < 0.01 {
                assert!(end.min > 0.0, "{what} {end:?}");
            }
        }
    }
}

#[test]
fn coplanar_and_coincident_meshes_collide_by_touching() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let cuboid = shape(&meshes::cuboid(one), None);
    let sheet = shape(&meshes::cuboid(one), Some(false));
    let mut rng = Rng::new(8);
    for case in 0..CASES {
        let pose_a = rng.pose(Rng::new(case).vector(10.0));
        let lateral = Vec3::new(rng.range(-1.5, 1.5), rng.range(-1.5, 1.5), 0.0);
        for (offset, other) in [
            (Vec3::zeros(), &cuboid),
            (Vec3::zeros(), &sheet),
            (Vec3::z() * 2.0, &cuboid),
            (lateral + Vec3::z() * 2.0, &sheet),
        ] {
            let pose_b = pose_a * Pose::translation(offset.x, offset.y, offset.z);
            let end = run(&cuboid, other, &pose_a, &pose_b, Goal::Gap, "coplanar");
            assert!(end.min <= 0.0 && end.max <= 1e-12, "{offset:?} {end:?}");
            // A hair apart is apart.
            let pose_b = pose_a
                * Pose::translation(
                    offset.x * 1.001,
                    offset.y,
                    offset.z + offset.z.signum() * 1e-8,
                );
            if offset.z > 0.0 {
                let end = run(&cuboid, other, &pose_a, &pose_b, Goal::Gap, "hair");
                assert!(end.min > 0.0, "{end:?}");
            }
        }
    }
}

#[test]
fn half_spaces_meet_the_lowest_vertex() {
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
            aabb: sweepd::math::Aabb::empty(),
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
            let mut walk = Walk::default();
            walk.start(a, b, &pos12);
            let mut last = Interval::UNKNOWN;
            while !walk.advance(a, b, Goal::Gap, 1, &mut meter) {
                let now = walk.interval();
                assert!(
                    now.widened(1e-12).contains(wanted),
                    "{name}: {now:?} {wanted}"
                );
                assert!(now.min >= last.min && now.max <= last.max);
                last = now;
            }
            let end = walk.interval();
            assert!(
                end.width() < 1e-12 && end.widened(1e-12).contains(wanted),
                "{name} {end:?}"
            );
            let witness = walk.witness().unwrap().closest;
            let across = witness.point_b - witness.point_a;
            assert!((across - witness.normal * witness.best_m).norm() < 1e-12);
            assert!(walk.advance(a, b, Goal::Contacts, u64::MAX, &mut meter));
            assert_eq!(walk.contacts().is_empty(), end.min > 0.0, "{name}");
            assert!(walk.interval().min >= end.min);
        }
    }
}

#[test]
fn a_closed_meter_stops_the_walk_at_once_and_it_resumes_where_it_was() {
    let a = shape(&meshes::bumpy_sphere(12, 14, 0.1), None);
    let b = shape(&meshes::torus(1.0, 0.3, 12, 8), None);
    let pose = Pose::new(Vec3::new(2.3, 0.1, 0.2), Vec3::new(0.3, 0.2, 0.1));
    let clock = ManualClock::new(0);
    let mut whole = Walk::default();
    let mut meter = Meter::unlimited(&clock);
    whole.start(&a, &b, &pose);
    assert!(whole.advance(&a, &b, Goal::Gap, u64::MAX, &mut meter));
    let units = meter.spent();

    let mut sliced = Walk::default();
    sliced.start(&a, &b, &pose);
    let mut spent = 0;
    loop {
        // At most one unit past the end: the second of two node tests.
        let mut meter = Meter::new(&clock, None, Some(7));
        let done = sliced.advance(&a, &b, Goal::Gap, u64::MAX, &mut meter);
        assert!(meter.spent() <= 8);
        spent += meter.spent();
        if done {
            break;
        }
    }
    assert_eq!(spent, units);
    assert_eq!(sliced.interval(), whole.interval());

    let mut closed = Meter::new(&clock, None, Some(0));
    let mut walk = Walk::default();
    walk.start(&a, &b, &pose);
    assert!(!walk.advance(&a, &b, Goal::Verdict, u64::MAX, &mut closed));
    assert_eq!(closed.spent(), 0);
    assert!(walk.interval().max.is_finite());
}

#[test]
#[ignore = "timing; run by hand in release"]
fn timing_of_bumpy_spheres_against_parry() {
    let clock = sweepd::time::SystemClock;
    let now = || sweepd::time::Clock::monotonic_ns(&clock);
    println!(
        "triangles,gap,sweepd_verdict_us,sweepd_gap_us,units,aabb_ns,parry_distance_us,difference"
    );
    for (rows, columns) in [(26, 50), (51, 100)] {
        let soup = meshes::bumpy_sphere(rows, columns, 0.1);
        let a = shape(&soup, None);
        let vertices = soup
            .vertices
            .iter()
            .map(|p| parry3d_f64::math::Vector::new(p.x, p.y, p.z));
        let parry =
            parry3d_f64::shape::TriMesh::new(vertices.collect(), soup.faces.clone()).unwrap();
        for gap in [0.3, 0.12, -0.2] {
            let pose = Pose::new(
                Vec3::new(1.2, 1.1, 1.0).normalize() * (2.05 + gap),
                Vec3::new(0.4, 0.5, 0.6),
            );
            let rounds = 20;
            let mut walk = Walk::default();
            let mut meter = Meter::unlimited(&clock);
            let start = now();
            for _ in 0..rounds {
                walk.start(&a, &a, &pose);
                walk.advance(&a, &a, Goal::Verdict, u64::MAX, &mut meter);
            }
            let verdict = now() - start;
            let mut meter = Meter::unlimited(&clock);
            let start = now();
            for _ in 0..rounds {
                walk.start(&a, &a, &pose);
                walk.advance(&a, &a, Goal::Gap, u64::MAX, &mut meter);
            }
            let exact = now() - start;
            let start = now();
            for _ in 0..rounds {
                std::hint::black_box(mesh_of(&a).aabb_at(std::hint::black_box(&pose)));
            }
            let boxes = now() - start;
            let (t, q) = (pose.translation.vector, pose.rotation.into_inner().coords);
            let there = parry3d_f64::math::Pose {
                rotation: parry3d_f64::math::Rotation::from_xyzw(q.x, q.y, q.z, q.w),
                translation: parry3d_f64::math::Vector::new(t.x, t.y, t.z),
            };
            let start = now();
            let theirs = parry3d_f64::query::distance(
                &parry3d_f64::math::Pose::IDENTITY,
                &parry,
                &there,
                &parry,
            )
            .unwrap();
            let their_time = now() - start;
            let us = |ns: u64| ns as f64 / 1e3 / f64::from(rounds);
            println!(
                "{},{gap},{:.1},{:.1},{},{},{:.1},{:e}",
                soup.faces.len(),
                us(verdict),
                us(exact),
                meter.spent() / u64::try_from(rounds).unwrap(),
                boxes / u64::try_from(rounds).unwrap(),
                their_time as f64 / 1e3,
                walk.interval().max - theirs.distance
            );
        }
    }
}
