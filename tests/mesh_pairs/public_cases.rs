//! The public cases with a mesh, solved by an engine without a limit and by a single query, compared with their
//! 50-digit truth.
//!
//! Method: scored as in `tests/geometry_cases.rs`, which tests triangle by triangle without a tree. In both orders,
//! with the mesh as a surface and as by default from its topology (no case has one shape inside another, so the gaps
//! are equal), and with boxes and hulls replaced by their meshes.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use crate::oracle::meshes;
use crate::profile::body;
use crate::support::shape;
use sweepd::math::{Interval, Pose, Vec3, pose_from, relative};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery};
use sweepd::report::rig::{Rig, row};
use sweepd::scene::{Scene, SourceSpec};
use sweepd::shape::{Geometry, Shape, ShapeSpec, build};
use sweepd::time::{Budget, ManualClock, Meter};
use sweepd::wire::Verdict;
use sweepd::world::{Parts, PlacedShape};

const CASES: &str = include_str!("../data/cases_public.jsonl");
/// Least number of cases with a mesh.
const CASES_MIN: usize = 13;
/// Least number of cases with two meshes.
const OF_TWO_MESHES_MIN: usize = 4;
/// Pairs nearer than this are reported with their intervals, metres: all cases are.
const REPORT_M: f64 = 2.0;

/// A case that has a mesh.
struct Case {
    id: String,
    specs: [ShapeSpec; 2],
    poses: [Pose; 2],
    /// The true gap, metres; `None`: the surfaces cross.
    truth: Option<Interval>,
    /// Whether the two touch within rounding errors: then either verdict is right.
    touching: bool,
    overlapping: bool,
    /// Size of the larger shape, metres.
    size: f64,
    /// Greatest error of the gap, relative to the size.
    error_max: f64,
    /// Greatest width of the interval, relative to the size.
    width_max: f64,
}

/// The computed result of a case.
#[derive(Debug)]
struct Said {
    apart: bool,
    colliding: bool,
    gap: Interval,
    best_m: f64,
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|k| value[k].as_f64().unwrap())
}

fn pose(value: &Value) -> Pose {
    let [w, x, y, z]: [f64; 4] = numbers(&value["q"]);
    pose_from(numbers(&value["t"]), [x, y, z, w]).unwrap()
}

impl Case {
    /// Reads a case; `None`: it has no mesh.
    fn read(line: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(line).unwrap();
        let sides = [&value["a"], &value["b"]];
        if sides.iter().all(|side| side["type"] != "trimesh") {
            return None;
        }
        let (error_max, width_max) = match value["tolerance_class"].as_str() {
            Some("A") => (1e-9, 1e-8),
            Some("B") => (1e-7, 1e-6),
            other => panic!("{other:?}: a class that is not known here"),
        };
        let is_known = !value["signed_distance"].is_null();
        let [low, high]: [f64; 2] = if is_known {
            numbers(&value["bounds"])
        } else {
            [0.0; 2]
        };
        Some(Self {
            id: value["id"].as_str().unwrap().to_owned(),
            specs: sides.map(|side| serde_json::from_value(side.clone()).unwrap()),
            poses: [pose(&value["pose_a"]), pose(&value["pose_b"])],
            truth: is_known.then(|| Interval::new(low, high)),
            touching: value["touching"].as_bool().unwrap(),
            overlapping: value["overlapping"].as_bool().unwrap(),
            size: value["length_scale"].as_f64().unwrap(),
            error_max,
            width_max,
        })
    }

    fn check(&self, said: &Said, what: &str) {
        let (gap, size) = (said.gap, self.size);
        let what = format!("{} {what}: {said:?} for {:?}", self.id, self.truth);
        assert!(gap.min <= gap.max, "{what}");
        let Some(truth) = self.truth else {
            assert!(self.overlapping && said.colliding, "{what}");
            assert!(gap.min <= 0.0 && gap.max <= 1e-12 * size, "{what}");
            return;
        };
        assert!(gap.min <= truth.max && truth.min <= gap.max, "{what}");
        assert!(gap.width() <= self.width_max * size, "{what}");
        let off_m = (truth.min - said.best_m).max(said.best_m - truth.max);
        let scale = size.max(truth.min.abs());
        assert!(off_m <= self.error_max * scale, "{what}");
        // Closer to contact the sign is not checked.
        if truth.min.abs() > 1e-5 * size && !self.touching {
            let right = (said.colliding, said.apart) == (self.overlapping, !self.overlapping);
            assert!(right, "{what}");
        }
    }
}

/// The shapes that one side of a case is built as: a mesh as a surface and as by default; a polytope also as its mesh.
fn forms(spec: &ShapeSpec) -> Vec<Arc<Shape>> {
    let built = |spec: &ShapeSpec| build(spec, Path::new(".")).unwrap().shape;
    let twin = match spec {
        ShapeSpec::Trimesh { .. } => {
            let mut surface = spec.clone();
            if let ShapeSpec::Trimesh { solid, .. } = &mut surface {
                *solid = Some(false);
            }
            Some(built(&surface))
        }
        ShapeSpec::Box { half_extents } => {
            let soup = meshes::cuboid(Vec3::from(*half_extents));
            Some(Arc::new(shape(&soup, Some(true))))
        }
        ShapeSpec::Convex { vertices, .. } => {
            let points: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
            Some(Arc::new(shape(&meshes::hull(&points), Some(true))))
        }
        _ => None,
    };
    [built(spec)].into_iter().chain(twin).collect()
}

fn is_mesh(shape: &Shape) -> bool {
    matches!(shape.geometry, Geometry::Mesh(_))
}

/// Runs one tick of a scene of two bodies without a limit.
fn by_engine([a, b]: [&Arc<Shape>; 2], poses: [&Pose; 2]) -> Said {
    let scene = Scene {
        sources: vec![SourceSpec {
            name: "feed".to_owned(),
            timeout_ns: 1 << 60,
            on_stale: Default::default(),
            ros2: None,
        }],
        bodies: vec![body(1, REPORT_M), body(2, REPORT_M)],
        ..Scene::default()
    };
    let placed = [a, b].map(|shape| {
        let (shape, pose) = (Arc::clone(shape), Pose::identity());
        Parts::from([PlacedShape { shape, pose }])
    });
    let clock = Arc::new(ManualClock::new(1_000_000));
    let mut rig = Rig::new(&scene, &placed, clock).unwrap();
    let rows = vec![row(1, poses[0]), row(2, poses[1])];
    rig.tick(&[rows], Budget::UNLIMITED);
    rig.engine().validate().unwrap();
    let mut told = rig.out().pairs.iter();
    let told = told.find(|row| (row.body_a, row.body_b) == (1, 2)).unwrap();
    let verdict = Verdict::from_code(told.verdict).unwrap();
    Said {
        apart: matches!(verdict, Verdict::Apart | Verdict::Near),
        colliding: verdict == Verdict::Colliding,
        gap: Interval::new(told.gap_min_m, told.gap_max_m),
        best_m: told.gap_best_m,
    }
}

/// Runs one query at one pose to its end.
fn by_query([a, b]: [&Shape; 2], poses: [&Pose; 2]) -> Said {
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
    query.start(&mut store, a, b, &relative(poses[0], poses[1]));
    assert!(query.advance(&mut store, (a, b), Goal::Gap, u64::MAX, &mut meter));
    let gap = query.interval();
    let said = Said {
        apart: gap.min > 0.0,
        colliding: gap.min <= 0.0 && (gap.max <= 0.0 || query.is_certain()),
        gap,
        best_m: query.witness().map_or(f64::NAN, |w| w.closest.best_m),
    };
    query.release(&mut store);
    said
}

#[test]
fn the_public_cases_with_a_mesh_are_answered_by_engine_and_query_as_well_as_is_wanted() {
    let lines = CASES.lines().filter(|line| !line.trim().is_empty());
    let cases: Vec<Case> = lines.filter_map(Case::read).collect();
    let (mut of_two_meshes, mut asked) = (0, 0);
    for case in &cases {
        let [of_a, of_b] = case.specs.each_ref().map(forms);
        let pairs = of_a.iter().flat_map(|a| of_b.iter().map(move |b| (a, b)));
        let mut has_two_meshes = false;
        for (number, (a, b)) in pairs.enumerate() {
            has_two_meshes |= is_mesh(a) && is_mesh(b);
            let [p, q] = case.poses.each_ref();
            for (shapes, poses, way) in [([a, b], [p, q], "a - b"), ([b, a], [q, p], "b - a")] {
                let what = format!("form {number}, {way}");
                let said = by_engine(shapes, poses);
                case.check(&said, &format!("{what}, engine"));
                let said = by_query(shapes.map(|shape| &**shape), poses);
                case.check(&said, &format!("{what}, query"));
                asked += 1;
            }
        }
        of_two_meshes += usize::from(has_two_meshes);
    }
    println!(
        "{} cases, {of_two_meshes} as two meshes, {asked} pairs",
        cases.len()
    );
    assert!(cases.len() >= CASES_MIN, "{} cases", cases.len());
    assert!(of_two_meshes >= OF_TWO_MESHES_MIN, "{of_two_meshes} cases");
}
