//! Shapes, poses, and the run that checks every interruption against the truth.

use crate::oracle::meshes::{self, Soup};
use crate::oracle::rng::Rng;
use crate::oracle::{Placed, Truth, truth};
use sweepd::math::{Interval, Point, Pose, Vec3, relative};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery, Walk, Witness, retest_witness};
use sweepd::shape::{Convex, Geometry, Mesh, Shape};
use sweepd::time::{ManualClock, Meter};

/// Cases of each kind: few in debug builds, the number required by the laws in release.
pub const CASES: u64 = if cfg!(debug_assertions) { 12 } else { 300 };

pub fn shape(soup: &Soup, solid: Option<bool>) -> Shape {
    let mesh = Mesh::new(soup.vertices.clone(), soup.faces.clone(), solid).unwrap();
    Shape {
        aabb: mesh.aabb(),
        centre: mesh.centre(),
        radius: mesh.radius(),
        geometry: Geometry::Mesh(mesh),
    }
}

/// A convex shape.
pub fn convex(convex: Convex) -> Shape {
    Shape {
        aabb: convex.aabb_at(&Pose::identity()),
        centre: convex.centre(),
        radius: convex.radius(),
        geometry: Geometry::Convex(convex),
    }
}

/// The mesh of a shape for the oracle, and whether it is solid: that of a box (no vertices), a triangle or a
/// tetrahedron.
pub fn as_mesh(shape: &Shape) -> (Vec<Point>, Vec<[u32; 3]>, bool) {
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

pub fn mesh_of(shape: &Shape) -> &Mesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        _ => panic!("a mesh"),
    }
}

pub fn placed(shape: &Shape, pose: &Pose, from: &Vec3) -> Placed {
    let (vertices, faces, solid) = as_mesh(shape);
    Placed::new(&vertices, &faces, solid, pose, from)
}

pub fn truth_of(a: &Shape, b: &Shape, pose_a: &Pose, pose_b: &Pose) -> Truth {
    let from = pose_a.translation.vector;
    truth(&placed(a, pose_a, &from), &placed(b, pose_b, &from))
}

/// A resumable query of two meshes, or of a mesh and a convex shape.
trait Resumable {
    fn advance(&mut self, a: &Shape, b: &Shape, goal: Goal, meter: &mut Meter<'_>) -> bool;
    fn interval(&self) -> Interval;
    fn witness(&self) -> Option<Witness>;
    fn touches(&self) -> bool;
}

impl Resumable for Walk {
    fn advance(&mut self, a: &Shape, b: &Shape, goal: Goal, meter: &mut Meter<'_>) -> bool {
        self.advance(a, b, goal, 1, meter)
    }

    fn interval(&self) -> Interval {
        self.interval()
    }

    fn witness(&self) -> Option<Witness> {
        self.witness()
    }

    fn touches(&self) -> bool {
        !self.contacts().is_empty()
    }
}

impl Resumable for (FrontStore, MeshQuery) {
    fn advance(&mut self, a: &Shape, b: &Shape, goal: Goal, meter: &mut Meter<'_>) -> bool {
        (self.1).advance(&mut self.0, (a, b), goal, 1, meter)
    }

    fn interval(&self) -> Interval {
        self.1.interval()
    }

    fn witness(&self) -> Option<Witness> {
        self.1.witness()
    }

    fn touches(&self) -> bool {
        self.1.contacts(&self.0).next().is_some()
    }
}

/// Runs both kinds of queries in slices of one unit, checks every interruption, and returns the final interval.
pub fn run(a: &Shape, b: &Shape, pose_a: &Pose, pose_b: &Pose, goal: Goal, what: &str) -> Interval {
    let pos12 = relative(pose_a, pose_b);
    let mut walk = Walk::default();
    walk.start(a, b, &pos12);
    let end = follow(
        &mut walk,
        a,
        b,
        pose_a,
        pose_b,
        goal,
        &format!("{what}, walk"),
    );
    let mut query = (FrontStore::default(), MeshQuery::default());
    query.1.start(&mut query.0, a, b, &pos12);
    follow(
        &mut query,
        a,
        b,
        pose_a,
        pose_b,
        goal,
        &format!("{what}, query"),
    );
    query.1.release(&mut query.0);
    end
}

fn follow(
    query: &mut impl Resumable,
    a: &Shape,
    b: &Shape,
    pose_a: &Pose,
    pose_b: &Pose,
    goal: Goal,
    what: &str,
) -> Interval {
    let truth = truth_of(a, b, pose_a, pose_b);
    let pos12 = relative(pose_a, pose_b);
    let size = a.radius.max(b.radius);
    let tolerance = 1e-11 * (a.radius + b.radius);
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let mut last = Interval::UNKNOWN;
    loop {
        let now = query.interval();
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
        if query.advance(a, b, goal, &mut meter) {
            break;
        }
        assert!(meter.spent() < 50_000_000, "{what}: no end");
    }
    let end = query.interval();
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
    if let Some(w) = query.witness() {
        let across = w.closest.point_b - w.closest.point_a;
        assert!((w.closest.normal.norm() - 1.0).abs() < 1e-12, "{what}");
        let along = (across - w.closest.normal * w.closest.best_m).norm();
        assert!(along < 1e-9 * size, "{what}: off by {along}");
    }
    if goal == Goal::Contacts {
        assert_eq!(!query.touches(), end.min > 0.0, "{what} {end:?}");
    }
    if let Some(w) = query.witness().filter(|w| w.closest.best_m > 0.0) {
        let again = retest_witness(a, b, &pos12, w.triangle_a, w.triangle_b).unwrap();
        assert_eq!(again.gap.max, w.closest.gap.max, "{what}");
        // For a leaf pair that touches only a proof that it does not is attempted.
        if w.closest.gap.min > 0.0 {
            assert_eq!(again.gap.min, w.closest.gap.min, "{what}");
        }
    }
    end
}

/// A mesh of `kind`, and its name.
pub fn any_mesh(rng: &mut Rng, kind: usize) -> (Shape, &'static str) {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let (soup, name) = match kind {
        0 => (meshes::tetrahedron(rng), "tetrahedron"),
        1 => (meshes::cuboid(Vec3::new(1.0, 0.6, 0.3)), "cuboid"),
        2 => (meshes::torus(1.0, 0.3, 9, 6), "torus"),
        3 => (meshes::bumpy_sphere(7, 8, 0.1), "bumpy sphere"),
        4 => match rng.below(3) {
            0 => (meshes::patch(rng, 4), "patch"),
            kind => holed(rng, kind - 1),
        },
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

pub const KINDS: usize = 12;

/// A closed mesh without some of its faces, one of two kinds, and its name: a surface.
pub fn holed(rng: &mut Rng, kind: usize) -> (Soup, &'static str) {
    match kind {
        0 => (meshes::open_box(Vec3::new(1.0, 0.8, 0.9)), "open box"),
        _ => (meshes::holed_sphere(rng, 7, 8, 0.1), "sphere with holes"),
    }
}

/// Whether a mesh or convex shape of this name is a surface.
pub fn is_surface(name: &str) -> bool {
    let surfaces = [
        "patch",
        "open box",
        "sphere with holes",
        "slivers",
        "triangle",
    ];
    surfaces.contains(&name)
}

/// A convex shape whose faces the oracle can build.
pub fn any_convex(rng: &mut Rng) -> (Shape, &'static str) {
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

/// Poses of a pair: generic, nearly touching (within 1 % of the size, on either side), deep or contained.
pub fn place(rng: &mut Rng, a: &Shape, b: &Shape, how: usize) -> (Pose, Pose) {
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
    // Approaches the other, each time by almost all of the proved free distance, until they nearly touch.
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

/// Two meshes of random kinds, their poses, and both names.
pub fn any_two(rng: &mut Rng, how: usize) -> (Shape, Shape, [Pose; 2], String) {
    let (kind_a, kind_b) = (rng.below(KINDS), rng.below(KINDS));
    let ((a, name_a), (b, name_b)) = (any_mesh(rng, kind_a), any_mesh(rng, kind_b));
    let (pose_a, pose_b) = place(rng, &a, &b, how);
    (a, b, [pose_a, pose_b], format!("{name_a} - {name_b}"))
}

/// Which of the three ways of [`place`] a case uses.
pub fn way(case: u64) -> usize {
    usize::try_from(case % 3).unwrap()
}

pub fn sweep(seed: u64, how: usize, goal: Goal) {
    let mut overlapping = 0;
    for case in 0..CASES {
        let mut rng = Rng::new(seed + case);
        let (a, b, [pose_a, pose_b], names) = any_two(&mut rng, how);
        let what = format!("seed {} {names}", seed + case);
        let end = run(&a, &b, &pose_a, &pose_b, goal, &what);
        overlapping += u64::from(end.min <= 0.0);
    }
    // The sample must be mixed: deep poses overlap, generic ones are of both kinds.
    assert!(
        how != 1 || 3 * overlapping > 2 * CASES,
        "{overlapping} overlap"
    );
    assert!(how != 0 || overlapping < CASES, "{overlapping} overlap");
}
