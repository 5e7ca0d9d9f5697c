//! Odd meshes: one triangle, doubled faces, zero-area faces, a plate of zero thickness, five million faces.
//!
//! Method: each is compared with a closed form, with the brute-force oracle, or with a plain mesh that bounds the same
//! body.

use std::f64::consts::{PI, TAU};

use crate::oracle::meshes::{self, Soup};
use crate::oracle::rng::Rng;
use crate::oracle::{Truth, crosses, triangle_distance};
use crate::support::{
    CASES, KINDS, any_convex, any_mesh, convex, mesh_of, place, placed, run, shape, truth_of, way,
};
use sweepd::math::{Interval, Point, Pose, Vec3, relative};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery, Walk, overlap};
use sweepd::shape::{Convex, Shape};
use sweepd::time::{ManualClock, Meter};

/// The goals with exact final intervals.
const GOALS: [Goal; 2] = [Goal::Gap, Goal::Contacts];
/// Poses at which two meshes that bound the same body are compared.
const POSES: u64 = if cfg!(debug_assertions) { 32 } else { 200 };

/// Runs a query in slices of one unit; each interval must contain the truth, and the final verdict must be right.
///
/// Sizes are about one metre, so tolerances are plain metres.
fn hold(truth: Interval, what: &str, mut go: impl FnMut(u64, &mut Meter<'_>) -> (bool, Interval)) {
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    // The first slice has no units: it shows the initial interval.
    let mut units = 0;
    let end = loop {
        let (done, now) = go(units, &mut meter);
        let holds = now.min <= truth.max + 1e-11 && truth.min - 1e-11 <= now.max;
        assert!(holds, "{what}: {now:?} without {truth:?}");
        if done {
            break now;
        }
        units = 1;
        assert!(meter.spent() < 50_000_000, "{what}: no end");
    };
    let is_exact = end.min > 0.0 && end.width() <= 1e-9;
    assert!(is_exact || truth.min <= 1e-9, "{what} {end:?} {truth:?}");
    let is_hit = end.min <= 0.0 && end.max <= 1e-12;
    assert!(is_hit || truth.max >= -1e-9, "{what} {end:?} {truth:?}");
}

/// A mesh and a ball, with both kinds of queries and in both orders: each must be sound all along.
fn meets_ball(mesh: &Shape, ball: &Shape, pos12: &Pose, truth: Interval, what: &str) {
    for (a, b, pos12) in [(mesh, ball, *pos12), (ball, mesh, pos12.inverse())] {
        let mut walk = Walk::default();
        walk.start(a, b, &pos12);
        hold(truth, &format!("{what}, walk"), |units, meter| {
            let done = walk.advance(a, b, Goal::Gap, units, meter);
            (done, walk.interval())
        });
        let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
        query.start(&mut store, a, b, &pos12);
        hold(truth, &format!("{what}, query"), |units, meter| {
            let done = query.advance(&mut store, (a, b), Goal::Gap, units, meter);
            (done, query.interval())
        });
        query.release(&mut store);
    }
}

/// Whether inner balls of the two prove an overlap.
fn tells_depth(a: &Shape, b: &Shape, pos12: &Pose) -> bool {
    let clock = ManualClock::new(0);
    overlap((a, b), pos12, &mut Meter::unlimited(&clock)).is_some()
}

/// Asserts that the sample is mixed: between 5 and 95 % of it collides.
fn assert_mixed(colliding: u64, of: u64) {
    let is_mixed = 20 * colliding > of && 20 * colliding < 19 * of;
    assert!(is_mixed, "{colliding} of {of} collide");
}

/// A mesh of one triangle.
fn lone(rng: &mut Rng) -> Shape {
    let corners = vec![rng.point(1.0), rng.point(1.0), rng.point(1.0)];
    shape(&Soup::new(corners, vec![[0, 1, 2]]), None)
}

#[test]
fn a_mesh_of_one_triangle_is_as_far_as_its_triangle() {
    let mut crossing = 0;
    for case in 0..CASES * 4 {
        let seed = 40_000_000 + case;
        let mut rng = Rng::new(seed);
        let (one, two) = (lone(&mut rng), lone(&mut rng));
        assert!(!mesh_of(&one).is_solid(), "seed {seed}");

        // The depth of a ball in a triangle is its radius minus the distance of its centre.
        let (radius, at) = (rng.range(0.05, 0.6), rng.vector(1.5));
        let alone = placed(&one, &Pose::identity(), &Vec3::zeros());
        let gap = alone.distance_from(&Point::from(at)) - radius;
        let (ball, pose) = (convex(Convex::sphere(radius)), rng.pose(at));
        let what = format!("seed {seed}");
        meets_ball(&one, &ball, &pose, Interval::new(gap, gap), &what);

        let cuboid = convex(Convex::cuboid(rng.vector(1.0).abs().add_scalar(0.1)));
        let (pose_a, pose_b) = place(&mut rng, &one, &cuboid, way(case));
        let goal = GOALS[rng.below(2)];
        run(&one, &cuboid, &pose_a, &pose_b, goal, &what);
        run(&cuboid, &one, &pose_b, &pose_a, goal, &what);

        let (pose_a, pose_b) = place(&mut rng, &one, &two, way(case));
        let end = run(&one, &two, &pose_a, &pose_b, goal, &what);
        let from = pose_a.translation.vector;
        let s = placed(&one, &pose_a, &from).triangles[0];
        let t = placed(&two, &pose_b, &from).triangles[0];
        if crosses(&s, &t) {
            crossing += 1;
            assert!(end.min <= 0.0 && end.max <= 1e-12, "{what}: {end:?}");
        } else {
            let d = triangle_distance(&s, &t);
            assert!(end.widened(1e-11).contains(d), "{what}: {end:?} {d}");
        }
    }
    assert_mixed(crossing, CASES * 4);
}

/// Queries two meshes with the same boundary against a third shape: equal verdicts, and equal gaps if it is apart.
///
/// For an overlap both have only bounds, which `run` compares with the oracle. Returns whether they collide.
fn same(
    [plain, twin]: &[Shape; 2],
    other: &Shape,
    [pose_a, pose_b]: [&Pose; 2],
    goal: Goal,
    what: &str,
) -> bool {
    let [one, two] = [(plain, "plain"), (twin, "twin")].map(|(mesh, name)| {
        let what = format!("{what}, {name}");
        run(mesh, other, pose_a, pose_b, goal, &what)
    });
    let size = plain.radius.max(other.radius);
    let truth = truth_of(plain, other, pose_a, pose_b);
    // A contact within rounding errors may have either verdict.
    if !matches!(truth, Truth::Apart(d) if d <= 1e-9 * size) {
        let agree = if one.min > 0.0 {
            two.min > 0.0 && (one.max - two.max).abs() <= 2e-9 * size
        } else {
            two.min <= 0.0 && one.max.max(two.max) <= 1e-9 * size
        };
        assert!(agree, "{what}: {one:?} {two:?} {truth:?}");
    }
    one.min <= 0.0
}

/// Boxes and their twins, made by `twins` from half sides, against other shapes, of which every fourth is inside.
fn compare(seed: u64, twins: impl Fn(Vec3) -> Vec<[Shape; 2]>) {
    let mut colliding = 0;
    for case in 0..POSES {
        let mut rng = Rng::new(seed + case);
        let half = rng.vector(0.8).abs().add_scalar(0.2);
        let twins = twins(half);
        let (kind, is_within) = (rng.below(KINDS), case % 4 == 3);
        let (other, name) = match case % 4 {
            3 => (shape(&meshes::cuboid(half * 0.3), None), "box within"),
            2 => any_convex(&mut rng),
            _ => any_mesh(&mut rng, kind),
        };
        let (pose_a, mut pose_b) = place(&mut rng, &twins[0][0], &other, way(case));
        if is_within {
            pose_b = pose_a * Pose::translation(0.1 * half.x, 0.0, 0.2 * half.z);
        }
        let goal = GOALS[rng.below(2)];
        for (number, pair) in twins.iter().enumerate() {
            let what = format!("seed {} pair {number} - {name}", seed + case);
            let hit = same(pair, &other, [&pose_a, &pose_b], goal, &what);
            // A solid collides with what is inside it, its surface does not.
            assert!(!is_within || hit == mesh_of(&pair[0]).is_solid(), "{what}");
            colliding += u64::from(number == 0 && hit);
        }
    }
    assert_mixed(colliding, POSES);
}

/// Each face twice, with separate vertices; the second copy is inverted if `turned`.
fn doubled(soup: &Soup, turned: bool) -> Soup {
    let again = soup.clone();
    let again = if turned { again.inverted() } else { again };
    soup.clone().and(again)
}

/// Doubled faces close a mesh as single ones do, so it is a solid by default. If both copies have the same orientation,
/// the winding number inside is 2 (law 3.3: inside means not 0): the result is that of the plain box. If the second
/// copy is inverted it is 0: the result is that of the box's surface.
#[test]
fn law_3_3_a_box_with_doubled_faces_is_the_box_or_where_they_cancel_its_surface() {
    compare(41_000_000, |half| {
        let plain = meshes::cuboid(half);
        let (twice, cancelled) = (doubled(&plain, false), doubled(&plain, true));
        let all = vec![
            [shape(&plain, None), shape(&twice, None)],
            [shape(&plain, Some(false)), shape(&cancelled, None)],
            [shape(&plain, Some(false)), shape(&twice, Some(false))],
        ];
        let solid: Vec<bool> = all.iter().map(|t| mesh_of(&t[1]).is_solid()).collect();
        assert_eq!(solid, [true, true, false]);
        all
    });
}

fn push(soup: &mut Soup, vertex: Point) -> u32 {
    soup.vertices.push(vertex);
    u32::try_from(soup.vertices.len() - 1).unwrap()
}

/// The same surface with a needle at the first side of each face: about a million times as long as wide.
fn with_needles(soup: &Soup) -> Soup {
    let mut all = Soup::new(soup.vertices.clone(), Vec::new());
    for &[a, b, c] in &soup.faces {
        let [p, q, r] = [a, b, c].map(|v| soup.vertices[v as usize]);
        let middle = p + (q - p) * 0.5;
        let near = push(&mut all, middle + (r - middle) * 1e-6);
        all.faces.extend([[a, b, near], [b, c, near], [c, a, near]]);
    }
    all
}

/// The same surface, still closed, with faces of zero area. The first side of the second face must lie along an axis,
/// so that its midpoint is collinear to the last bit.
fn with_flats(soup: &Soup) -> Soup {
    let mut all = soup.clone();
    let [a, b, c] = all.faces[1];
    let [p, q, r] = [a, b, c].map(|v| all.vertices[v as usize]);
    let middle = push(&mut all, p + (q - p) * 0.5);
    let again = push(&mut all, r);
    // A vertex in the middle of the neighbour's side, and a zero-area face that closes the crack.
    all.faces[1] = [a, middle, c];
    all.faces.extend([[middle, b, c], [a, b, middle]]);
    // Collinear vertices, in both directions.
    all.faces.extend([[a, middle, b], [b, middle, a]]);
    // A repeated vertex, twice and three times, and another vertex at the same position.
    all.faces.extend([[a, a, b], [c, c, c], [c, again, a]]);
    all
}

#[test]
fn faces_without_an_area_change_no_verdict_beside_needles_either() {
    compare(42_000_000, |half| {
        let soup = with_needles(&meshes::cuboid(half));
        let (plain, flats) = (shape(&soup, None), shape(&with_flats(&soup), None));
        assert!(mesh_of(&plain).is_solid() && mesh_of(&flats).is_solid());
        vec![[plain, flats]]
    });
}

/// Two coincident squares of half side 1, joined at the rim: closed, with an empty interior.
///
/// * `is_upright` - perpendicular to x, the direction of inside tests; otherwise perpendicular to z.
fn plate(rng: &mut Rng, is_upright: bool) -> Soup {
    let cells = [1, 4][rng.below(2)];
    let n = cells + 1;
    let mut all = Soup::new(Vec::new(), Vec::new());
    let mut sides = Vec::new();
    for place in 0..n * n {
        let (i, j) = (place / n, place % n);
        let [x, y] = [j, i].map(|k| 2.0 * k as f64 / cells as f64 - 1.0);
        let at = if is_upright { [0.0, x, y] } else { [x, y, 0.0] };
        let upper = push(&mut all, at.into());
        // Inside the rim each side has its own vertices.
        let is_rim = i % cells == 0 || j % cells == 0;
        let lower = if is_rim {
            upper
        } else {
            push(&mut all, at.into())
        };
        sides.push([upper, lower]);
    }
    for place in 0..cells * cells {
        let near = place / cells * n + place % cells;
        let corners = [near, near + 1, near + n + 1, near + n];
        let [[a, e], [b, f], [c, g], [d, h]] = corners.map(|k| sides[k]);
        all.faces
            .extend([[a, b, c], [a, c, d], [e, g, f], [e, h, g]]);
    }
    all
}

/// It is closed, so it is a solid by default; but no point is inside, so its gap to a ball is that of the square.
#[test]
fn law_3_3_a_closed_plate_of_no_thickness_holds_no_ball() {
    let mut touched = 0;
    for case in 0..CASES * 4 {
        let what = format!("seed {}", 43_000_000 + case);
        let mut rng = Rng::new(43_000_000 + case);
        let is_upright = case % 2 == 1;
        let plate = shape(&plate(&mut rng, is_upright), None);
        assert!(mesh_of(&plate).is_solid(), "{what}");

        let radius = rng.range(0.05, 0.6);
        let mut at = rng.vector(1.6);
        // Some are in the plane of the plate: beside it, or with their centre on it.
        at.z *= [0.0, 0.2, 0.5][rng.below(3)];
        let out = |x: f64| (x.abs() - 1.0).max(0.0);
        let gap = Vec3::new(out(at.x), out(at.y), at.z).norm() - radius;
        if is_upright {
            at = Vec3::new(at.z, at.x, at.y);
        }
        let (ball, pose) = (convex(Convex::sphere(radius)), rng.pose(at));
        meets_ball(&plate, &ball, &pose, Interval::new(gap, gap), &what);
        assert!(!tells_depth(&plate, &ball, &pose), "{what}");
        touched += u64::from(gap < 0.0);
    }
    assert_mixed(touched, CASES * 4);
}

#[test]
fn law_3_3_a_closed_plate_of_no_thickness_collides_where_its_surface_is_touched() {
    let mut touched = 0;
    for case in 0..CASES * 3 {
        let seed = 44_000_000 + case;
        let mut rng = Rng::new(seed);
        let soup = plate(&mut rng, case % 2 == 1);
        let plate = shape(&soup, None);
        let half = rng.vector(0.6).abs().add_scalar(0.1);
        let (other, name) = match rng.below(3) {
            0 => (convex(Convex::cuboid(half)), "convex box"),
            1 => (shape(&meshes::cuboid(half), None), "box"),
            _ => (shape(&soup, None), "plate"),
        };
        let (pose_a, pose_b) = place(&mut rng, &plate, &other, way(case));
        let (goal, what) = (GOALS[rng.below(2)], format!("seed {seed} {name}"));
        // For a surface the truth has no inside.
        let truth = truth_of(&shape(&soup, Some(false)), &other, &pose_a, &pose_b);
        for end in [
            run(&plate, &other, &pose_a, &pose_b, goal, &what),
            run(&other, &plate, &pose_b, &pose_a, goal, &what),
        ] {
            let right = match truth {
                Truth::Overlap(_) => end.min <= 0.0 && end.max <= 1e-9,
                Truth::Apart(d) => end.min > 0.0 || d < 1e-8,
            };
            assert!(right, "{what}: {end:?} for {truth:?}");
        }
        let pos12 = relative(&pose_a, &pose_b);
        assert!(!tells_depth(&plate, &other, &pos12), "{what}");
        touched += u64::from(matches!(truth, Truth::Overlap(_)));
    }
    assert_mixed(touched, CASES * 3);
}

#[test]
fn boxes_that_lie_on_a_plate_or_at_its_rim_touch_it_and_a_hair_off_they_do_not() {
    let half = Vec3::new(0.3, 0.2, 0.4);
    let solid = shape(&meshes::cuboid(half), None);
    let boxes = [convex(Convex::cuboid(half)), solid];
    for case in 0..CASES {
        let mut rng = Rng::new(45_000_000 + case);
        let plate = shape(&plate(&mut rng, false), None);
        let origin = rng.vector(10.0);
        let pose_a = rng.pose(origin);
        let on = Vec3::new(rng.range(-0.6, 0.6), rng.range(-0.6, 0.6), half.z);
        let beside = Vec3::new(1.0 + half.x, on.y, 0.0);
        for (at, away) in [(on, Vec3::z()), (beside, Vec3::x())] {
            for other in &boxes {
                let what = format!("seed {} {at:?}", 45_000_000 + case);
                let end_at = |by: Vec3| {
                    let pose_b = pose_a * Pose::translation(by.x, by.y, by.z);
                    run(&plate, other, &pose_a, &pose_b, Goal::Gap, &what)
                };
                let end = end_at(at);
                assert!(end.min <= 0.0 && end.max <= 1e-12, "{what}: {end:?}");
                let end = end_at(at + away * 1e-8);
                assert!(end.min > 0.0, "{what}: {end:?}");
            }
        }
    }
}

/// The vertices lie on a ball of radius 1. A point of a face with sides of at most `e` is within `e * e / 3` of it: the
/// square of a mean of unit vectors is 1 minus the products of the weights times the squares of the sides, and these
/// products sum up to at most a third. The gap is that of the ball, or greater by at most that much.
#[test]
#[ignore = "takes minutes: cargo test --release -- --ignored; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn a_sphere_of_five_million_triangles_is_a_ball_but_for_its_facets() {
    let (rows, columns) = (1001, 2500);
    let globe = shape(&meshes::bumpy_sphere(rows, columns, 0.0), None);
    assert_eq!(mesh_of(&globe).faces().len(), 5_000_000);
    assert!(mesh_of(&globe).is_solid());
    // The longest side spans one step along a meridian and one along a parallel.
    let side = PI / rows as f64 + TAU / columns as f64;
    let sag = side * side / 3.0;

    let radius = 0.25;
    let ball = convex(Convex::sphere(radius));
    let mut rng = Rng::new(46_000_000);
    // Apart, penetrating, contained: in all cases the gap of a ball is the distance of the centres minus both radii.
    for distance in [1.35, 1.1, 0.3] {
        let at = rng.direction() * distance;
        let gap = distance - 1.0 - radius;
        let (truth, what) = (Interval::new(gap, gap + sag), format!("{distance} m"));
        meets_ball(&globe, &ball, &rng.pose(at), truth, &what);
    }
}
