//! Two hundred pairs of moving meshes, with world, broad phase and narrow phase called by hand.

use std::sync::Arc;

use sweepd::broad::{BroadPhase, Method};
use sweepd::builtin::Random;
use sweepd::config::Config;
use sweepd::ids::{BodyId, PairSlot};
use sweepd::math::{Point, Pose, Quat, Vec3, relative};
use sweepd::narrow::Narrow;
use sweepd::narrow::mesh::{Goal, Walk};
use sweepd::pairs::{PairDelta, PairSet};
use sweepd::scene::{BodySpec, PlacedSpec, Scene, SourceSpec};
use sweepd::shape::{Geometry, Mesh, Shape, ShapeSpec};
use sweepd::time::{Clock, Meter, SystemClock};
use sweepd::wire::{FrameHeader, Inbox, TransformRow, WIRE_VERSION, frame_flags, name_bytes};
use sweepd::world::{Parts, PlacedShape, World};

use crate::common::row;

/// Pairs of bodies; each pair is far from the others.
pub const PAIRS: usize = 200;
/// Pairs that touch at the start: two thirds.
const TOUCHING: usize = 133;
/// Diameter of a body without its bumps, metres.
pub const DIAMETER_M: f64 = 2.0;

/// A bumpy sphere of 19,880 triangles.
fn bumpy(kind: usize) -> Mesh {
    let (rows, columns) = (71_u32, 142_u32);
    let (waves, turns) = (
        [3.0, 5.0, 7.0, 4.0][kind % 4],
        [4.0, 6.0, 3.0, 5.0][kind % 4],
    );
    let mut vertices = vec![Point::new(0.0, 0.0, 1.0), Point::new(0.0, 0.0, -1.0)];
    for i in 1..rows {
        let theta = std::f64::consts::PI * f64::from(i) / f64::from(rows);
        for j in 0..columns {
            let phi = std::f64::consts::TAU * f64::from(j) / f64::from(columns);
            let r = 1.0 + 0.06 * (waves * theta).sin() * (turns * phi).cos();
            let (s, c) = theta.sin_cos();
            vertices.push(Point::new(r * s * phi.cos(), r * s * phi.sin(), r * c));
        }
    }
    let at = |i: u32, j: u32| 2 + (i - 1) * columns + j % columns;
    let mut faces = Vec::new();
    for j in 0..columns {
        faces.push([0, at(1, j), at(1, j + 1)]);
        faces.push([1, at(rows - 1, j + 1), at(rows - 1, j)]);
        for i in 1..rows - 1 {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::new(vertices, faces, None).unwrap()
}

/// A scene of these bodies, all with one source.
pub fn scene(bodies: Vec<BodySpec>) -> Scene {
    Scene {
        frame_id: "world".to_owned(),
        config: Config::default(),
        sources: vec![SourceSpec {
            name: "feed".to_owned(),
            timeout_ns: 1 << 60,
            on_stale: Default::default(),
            ros2: None,
        }],
        bodies,
        ..Scene::default()
    }
}

/// The shapes, built once because building their trees takes long.
pub fn shapes() -> Vec<Arc<Shape>> {
    let shape = |mesh: Mesh| Shape {
        aabb: mesh.aabb(),
        centre: mesh.centre(),
        radius: mesh.radius(),
        geometry: Geometry::Mesh(mesh),
    };
    (0..4).map(|kind| Arc::new(shape(bumpy(kind)))).collect()
}

/// The motion of one pair: B moves about A, between two distances, and turns.
struct Course {
    a: Pose,
    away: Vec3,
    distance: f64,
    range: [f64; 2],
    speed: f64,
    spin: Vec3,
    turn: Quat,
}

/// The motion of all pairs.
pub struct Courses(Vec<Course>);

impl Courses {
    /// * `percent` - motion of a surface point per tick, percent of the diameter; individual pairs move 0.2 to 3
    ///   times that.
    pub fn new(percent: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let all = (0..PAIRS).map(|k| course(k, percent, &mut random));
        Self(all.collect())
    }

    /// Advances by one tick.
    pub fn advance(&mut self) {
        for course in &mut self.0 {
            course.distance += course.speed;
            if !(course.range[0]..=course.range[1]).contains(&course.distance) {
                course.speed = -course.speed;
                course.distance += 2.0 * course.speed;
            }
            course.turn = Quat::new_normalize(
                (Quat::from_scaled_axis(course.spin) * course.turn).into_inner(),
            );
        }
    }

    /// Poses of the `k`th pair.
    pub fn poses(&self, k: usize) -> [Pose; 2] {
        [self.0[k].a, self.0[k].b()]
    }

    /// A frame of all bodies: two per pair, ids from 1.
    pub fn rows(&self) -> impl Iterator<Item = TransformRow> {
        (0_u64..)
            .zip(&self.0)
            .flat_map(|(k, course)| [row(2 * k + 1, &course.a), row(2 * k + 2, &course.b())])
    }
}

/// All bodies with their shapes; the two bodies of a pair have different shapes.
pub fn bodies(shapes: &[Arc<Shape>]) -> (Scene, Vec<Parts>) {
    let scene = scene((0..2 * PAIRS).map(|k| body(k as u64 + 1)).collect());
    let placed = (0..2 * PAIRS).map(|k| {
        let shape = Arc::clone(&shapes[(k / 2 + k % 2) % shapes.len()]);
        let pose = Pose::identity();
        Parts::from([PlacedShape { shape, pose }])
    });
    (scene, placed.collect())
}

/// The scene, its modules (world, broad phase, narrow phase), and its motion.
pub struct Stage {
    pub world: World,
    pub pairs: PairSet,
    pub narrow: Narrow,
    pub clock: SystemClock,
    broad: BroadPhase,
    delta: PairDelta,
    inbox: Inbox,
    courses: Courses,
    shapes: Vec<Arc<Shape>>,
    tick: u64,
}

impl Stage {
    /// * `percent` - motion of a surface point per tick, percent of the diameter; individual pairs move 0.2 to 3
    ///   times that.
    pub fn new(shapes: &[Arc<Shape>], percent: f64, seed: u64) -> Self {
        Self::reporting(shapes, percent, seed, 0.0)
    }

    /// As `new`, with the same poses.
    ///
    /// * `within_m` - pairs nearer than this are reported: their bounds are refined once all verdicts are known.
    pub fn reporting(shapes: &[Arc<Shape>], percent: f64, seed: u64, within_m: f64) -> Self {
        let (mut scene, placed) = bodies(shapes);
        for body in &mut scene.bodies {
            body.report_within_m = within_m;
        }
        let clock = SystemClock;
        let world = World::new(&scene, placed, clock.boottime_ns()).unwrap();
        let mut stage = Self {
            world,
            pairs: PairSet::new(1 << 16),
            narrow: Narrow::new(16),
            clock,
            broad: BroadPhase::new(Method::SweepAndPrune),
            delta: PairDelta::default(),
            inbox: Inbox::default(),
            courses: Courses::new(percent, seed),
            shapes: shapes.to_vec(),
            tick: 0,
        };
        stage.admit();
        stage
    }

    /// Moves every pair by one tick and updates world and broad phase.
    pub fn advance(&mut self) {
        self.courses.advance();
        self.admit();
    }

    /// Starts the narrow phase of this tick; returns the duration of its motion pass, nanoseconds.
    pub fn begin(&mut self) -> u64 {
        let from_ns = self.clock.monotonic_ns();
        self.narrow
            .begin(self.tick, &self.world, &self.pairs, &self.delta);
        self.narrow.widen(&self.world, &mut self.pairs);
        self.clock.monotonic_ns() - from_ns
    }

    /// Discards the state of the narrow phase, so that this tick starts cold.
    pub fn make_cold(&mut self) {
        self.narrow = Narrow::new(16);
        self.delta.clear();
        let slots: Vec<PairSlot> = self.pairs.iter().map(|(slot, _)| slot).collect();
        self.delta.began.extend(slots);
    }

    pub fn pose(&self, pair: usize) -> Pose {
        let [a, b] = self.courses.poses(pair);
        relative(&a, &b)
    }

    pub fn couple(&self, pair: usize) -> [&Shape; 2] {
        [0, 1].map(|k| &*self.shapes[(pair + k) % self.shapes.len()])
    }

    /// The pair at a slot of the pair set.
    pub fn pair_of(&self, slot: PairSlot) -> usize {
        let (low, _) = self.pairs.get(slot).unwrap().slots();
        let id = self.world.body(low).unwrap().id.0;
        usize::try_from((id - 1) / 2).unwrap()
    }

    /// Which pairs collide at this tick's poses: complete walks over the other trees, without state from earlier ticks.
    pub fn truth(&self, walk: &mut Walk) -> Vec<bool> {
        (0..PAIRS)
            .map(|pair| {
                let [a, b] = self.couple(pair);
                let mut meter = Meter::unlimited(&self.clock);
                walk.start(a, b, &self.pose(pair));
                assert!(walk.advance(a, b, Goal::Verdict, u64::MAX, &mut meter));
                walk.interval().min <= 0.0
            })
            .collect()
    }

    fn admit(&mut self) {
        self.tick += 1;
        self.inbox.clear();
        let frame = self.inbox.push();
        frame.header = FrameHeader {
            session: 1,
            seq: self.tick,
            source: name_bytes("feed"),
            flags: frame_flags::FULL,
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        frame.received_ns = self.clock.boottime_ns();
        frame.transforms.extend(self.courses.rows());
        self.world.begin_tick(self.tick, self.clock.boottime_ns());
        for frame in self.inbox.frames() {
            self.world.admit(frame, self.clock.boottime_ns());
        }
        self.world.age(self.clock.boottime_ns());
        self.delta.clear();
        self.broad.update(
            self.world.changes(),
            &self.world,
            self.world.filters(),
            &mut self.pairs,
            &mut self.delta,
        );
        assert_eq!(self.pairs.len(), PAIRS, "every pair is a candidate");
    }
}

impl Course {
    fn b(&self) -> Pose {
        let from = self.a.translation.vector;
        Pose::from_parts((from + self.away * self.distance).into(), self.turn)
    }
}

fn course(k: usize, percent: f64, random: &mut Random) -> Course {
    let mut vector = |size: f64| {
        Vec3::new(
            random.range(-size, size),
            random.range(-size, size),
            random.range(-size, size),
        )
    };
    #[allow(clippy::cast_precision_loss, reason = "200 pairs")]
    let home = Vec3::new((k % 15) as f64, (k / 15) as f64, 0.0) * 8.0;
    let a = Pose::from_parts(
        (home + vector(0.5)).into(),
        Quat::from_scaled_axis(vector(3.0)),
    );
    // Near a diagonal direction the boxes overlap at any distance that occurs.
    let away = (Vec3::new(1.0, 1.0, 1.0) + vector(0.3)).normalize();
    let turn = Quat::from_scaled_axis(vector(3.0));
    let spin = vector(1.0).normalize();
    let range = if k < TOUCHING {
        [1.4, 2.04]
    } else {
        [1.98, 2.25]
    };
    let distance = if k < TOUCHING {
        random.range(1.5, 1.9)
    } else {
        random.range(2.01, 2.2)
    };
    let pace = percent / 100.0 * DIAMETER_M * (random.range(-1.61, 1.1)).exp();
    Course {
        a,
        away,
        distance,
        range,
        speed: 0.5 * pace,
        spin: spin * (0.5 * pace),
        turn,
    }
}

pub fn body(id: u64) -> BodySpec {
    // The built shapes are passed separately.
    let shape = PlacedSpec {
        shape: ShapeSpec::Sphere { radius: 1.0 },
        pose: Pose::identity(),
    };
    BodySpec {
        source: Some(0),
        group: u32::MAX,
        ..BodySpec::new(format!("b{id}"), BodyId(id), vec![shape])
    }
}
