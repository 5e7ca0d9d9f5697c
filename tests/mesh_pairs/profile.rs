//! Goal: with more work units more mesh pairs are decided, from a cold start and in motion; and without a limit
//! intervals are narrow.
//! Method: pairs of closed meshes, a third overlapping, a third within 1 % of the size, a third apart, in an engine fed
//! by hand with budgets in work units. Each verdict is compared with the truth of an unlimited twin: complete walks
//! over the other trees, without carried state.

use std::sync::Arc;

use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::shape;
use sweepd::ids::BodyId;
use sweepd::math::{Interval, Pose, Quat, Vec3, relative};
use sweepd::narrow::mesh::{Goal, Walk};
use sweepd::report::rig::{Rig, row};
use sweepd::scene::{BodySpec, PlacedSpec, Scene, SourceSpec};
use sweepd::shape::{Shape, ShapeSpec};
use sweepd::time::{Budget, Clock, ManualClock, Meter};
use sweepd::wire::{PairRow, Verdict, pair_flags};
use sweepd::world::{Parts, PlacedShape};

const SEED: u64 = 40_000_000;
/// Pairs of the profile: so many that the costs of the hard ones leave no gap of a factor of two, in which twice the
/// budget would decide no more pairs.
const PAIRS: usize = 120;
/// Ticks of motion.
const TICKS: usize = 40;
/// Rows, columns and bumps of the profile's bodies: 2,208, 3,480 and 4,900 triangles.
const BALLS: [(usize, usize, f64); 3] = [(24, 48, 0.0), (30, 60, 0.04), (36, 70, 0.06)];
/// Diameter of a body without its bumps, metres.
const DIAMETER_M: f64 = 2.0;
/// Distance at which no two of them can touch: more than twice a radius of 1.06, metres.
const FAR_M: f64 = 2.13;
/// Motion of a surface point per tick, metres: 0.5 % of the diameter, half by translation and half by rotation.
const PACE_M: f64 = 0.005 * DIAMETER_M;
/// Amplitude of a pair's motion, metres: near pairs begin and cease to touch.
const SWING_M: f64 = 0.015 * DIAMETER_M;
/// Distance between pairs, metres: no box reaches another pair's even when enlarged by [`REPORT_M`].
const SPACING_M: f64 = 20.0;
/// Pairs nearer than this are reported with their intervals, metres: all for which intervals are demanded.
const REPORT_M: f64 = 2.0;
/// The least budget of a cold start: below it hardly a hard pair's first turn is left to be shared.
const UNITS_MIN: u64 = 128;
/// Budgets per tick in motion, each twice the one before; the last exceeds the work of any tick.
const UNITS: [u64; 8] = [64, 128, 256, 512, 1_024, 2_048, 4_096, 8_192];
/// Time from frame to frame, nanoseconds.
const FRAME_NS: u64 = 10_000_000;

/// The motion of one pair: B moves about A, back and forth, and turns.
#[derive(Clone)]
struct Course {
    /// Indices of the two shapes.
    kinds: [usize; 2],
    a: Pose,
    /// Direction from A to B, unit length, world frame.
    away: Vec3,
    /// Distance of the two origins, metres.
    distance: f64,
    /// Mean of this distance, metres.
    middle: f64,
    /// Change of the distance, metres per tick.
    speed: f64,
    /// Rotation, radians per tick, world frame.
    spin: Vec3,
    turn: Quat,
}

impl Course {
    /// A pair at rest, far apart.
    fn new(place: usize, kinds: [usize; 2], away: Vec3, rng: &mut Rng) -> Self {
        let home = Vec3::new((place % 10) as f64, (place / 10) as f64, 0.0) * SPACING_M;
        let at = home + rng.vector(0.5);
        Self {
            kinds,
            a: rng.pose(at),
            away,
            distance: FAR_M,
            middle: FAR_M,
            speed: 0.0,
            spin: Vec3::zeros(),
            turn: rng.rotation(),
        }
    }

    fn b(&self) -> Pose {
        let from = self.a.translation.vector;
        Pose::from_parts((from + self.away * self.distance).into(), self.turn)
    }

    /// Advances by one tick.
    fn advance(&mut self) {
        self.distance += self.speed;
        if (self.distance - self.middle).abs() > SWING_M {
            self.speed = -self.speed;
            self.distance += 2.0 * self.speed;
        }
        let turn = Quat::from_scaled_axis(self.spin) * self.turn;
        self.turn = Quat::new_normalize(turn.into_inner());
    }

    /// The gap at the current poses from a complete walk without a limit.
    fn twin(&self, shapes: &[Arc<Shape>], goal: Goal, walk: &mut Walk) -> Interval {
        let [a, b] = self.kinds.map(|kind| &*shapes[kind]);
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        walk.start(a, b, &relative(&self.a, &self.b()));
        assert!(walk.advance(a, b, goal, u64::MAX, &mut meter));
        walk.interval()
    }

    /// Moves the two closer, each time by a share of their gap: by law 3.2 they stay apart.
    fn approach(&mut self, shapes: &[Arc<Shape>], times: usize, share: f64, walk: &mut Walk) {
        for _ in 0..times {
            let gap = self.twin(shapes, Goal::Gap, walk);
            self.distance -= share * gap.min.max(0.0);
        }
    }
}

/// Bumpy balls with these numbers of rows and columns.
fn balls(sizes: &[(usize, usize, f64)]) -> Vec<Arc<Shape>> {
    let ball = |&(rows, columns, bump): &(usize, usize, f64)| {
        Arc::new(shape(&meshes::bumpy_sphere(rows, columns, bump), None))
    };
    sizes.iter().map(ball).collect()
}

/// The pairs of the profile: apart, near and overlapping ones in turn.
fn courses(shapes: &[Arc<Shape>]) -> Vec<Course> {
    let (mut rng, mut walk) = (Rng::new(SEED), Walk::default());
    let course = |pair: usize| {
        // Near a diagonal direction the boxes overlap at any distance that occurs.
        let away = (Vec3::new(1.0, 1.0, 1.0) + rng.vector(0.2)).normalize();
        let kinds = [pair / 3 % 3, pair / 9 % 3];
        let mut course = Course::new(pair, kinds, away, &mut rng);
        // To where they almost touch, and from there apart or into each other.
        course.approach(shapes, 8, 0.999, &mut walk);
        course.distance += match pair % 3 {
            0 => rng.range(0.04, 0.3),
            // From a hundredth of the size down to a ten thousandth: some are much harder to decide than others.
            1 => [1.0, -1.0][rng.below(2)] * DIAMETER_M * 10.0_f64.powf(rng.range(-4.0, -2.0)),
            _ => -rng.range(0.04, 0.6),
        };
        course.middle = course.distance;
        course.speed = [0.5, -0.5][rng.below(2)] * PACE_M;
        course.spin = rng.direction() * (0.5 * PACE_M);
        course
    };
    (0..PAIRS).map(course).collect()
}

/// An engine, and the motion of all its pairs.
struct Stage {
    rig: Rig,
    clock: Arc<ManualClock>,
    courses: Vec<Course>,
}

impl Stage {
    fn new(shapes: &[Arc<Shape>], courses: &[Course], report_m: f64) -> Self {
        let ids = 1..=2 * courses.len() as u64;
        let scene = Scene {
            sources: vec![SourceSpec {
                name: "feed".to_owned(),
                timeout_ns: 1 << 60,
                on_stale: Default::default(),
                ros2: None,
            }],
            bodies: ids.map(|id| body(id, report_m)).collect(),
            ..Scene::default()
        };
        let placed = |kind: usize| -> Parts {
            let (shape, pose) = (Arc::clone(&shapes[kind]), Pose::identity());
            Parts::from([PlacedShape { shape, pose }])
        };
        let kinds = courses.iter().flat_map(|course| course.kinds);
        let placed: Vec<_> = kinds.map(placed).collect();
        let clock = Arc::new(ManualClock::new(FRAME_NS));
        let rig = Rig::new(&scene, &placed, Arc::clone(&clock) as Arc<dyn Clock>).unwrap();
        Self {
            rig,
            clock,
            courses: courses.to_vec(),
        }
    }

    /// Runs a tick at the current poses.
    fn tick(&mut self, budget: Budget) {
        self.clock.advance(FRAME_NS);
        let rows = (0_u64..).zip(&self.courses).flat_map(|(pair, course)| {
            let ids = [2 * pair + 1, 2 * pair + 2];
            [row(ids[0], &course.a), row(ids[1], &course.b())]
        });
        self.rig.tick(&[rows.collect()], budget);
        self.rig.engine().validate().unwrap();
        // Every pair is a candidate.
        assert_eq!(self.rig.out().tick.candidates, self.courses.len() as u64);
    }

    /// Rows of pairs within the report distance, with the index of the pair.
    fn told(&self) -> impl Iterator<Item = (usize, &PairRow)> {
        let rows = self.rig.out().pairs.iter();
        let there = rows.filter(|row| row.flags & pair_flags::GONE == 0);
        there.map(|row| (usize::try_from((row.body_a - 1) / 2).unwrap(), row))
    }

    /// For each pair whether it collides; `None`: undecided.
    fn verdicts(&self) -> Vec<Option<bool>> {
        let mut all = vec![Some(false); self.courses.len()];
        for (pair, row) in self.told() {
            let verdict = Verdict::from_code(row.verdict).unwrap();
            let decided = verdict != Verdict::Possible;
            all[pair] = decided.then_some(verdict == Verdict::Colliding);
        }
        let open = all.iter().filter(|verdict| verdict.is_none()).count();
        assert_eq!(self.rig.out().tick.possible, open as u64);
        all
    }
}

/// Moves every pair by one tick.
fn advance(courses: &mut [Course]) {
    courses.iter_mut().for_each(Course::advance);
}

/// For each pair whether it truly collides.
fn truth(courses: &[Course], shapes: &[Arc<Shape>], walk: &mut Walk) -> Vec<bool> {
    let mut collides = |course: &Course| course.twin(shapes, Goal::Verdict, walk).min <= 0.0;
    courses.iter().map(&mut collides).collect()
}

pub fn body(id: u64, report_within_m: f64) -> BodySpec {
    // The built shapes are passed separately.
    let shape = PlacedSpec {
        shape: ShapeSpec::Sphere { radius: 1.0 },
        pose: Pose::identity(),
    };
    BodySpec {
        source: Some(0),
        report_within_m,
        ..BodySpec::new(format!("b{id}"), BodyId(id), vec![shape])
    }
}

/// Compares the existing verdicts with the truth; returns their number.
fn judge(found: &[Option<bool>], truth: &[bool], what: &str) -> usize {
    for (pair, (said, collides)) in found.iter().zip(truth).enumerate() {
        let right = said.is_none_or(|said| said == *collides);
        assert!(right, "{what}: pair {pair} collides: {collides}");
    }
    found.iter().flatten().count()
}

#[test]
fn the_profile_rises_with_work() {
    let shapes = balls(&BALLS);
    let courses = courses(&shapes);
    rises_cold(&shapes, &courses);
    rises_in_motion(&shapes, &courses);
}

/// Budgets from a cold start, doubled until all pairs are decided: each step must decide more pairs.
fn rises_cold(shapes: &[Arc<Shape>], courses: &[Course]) {
    let truth = truth(courses, shapes, &mut Walk::default());
    // The sample must be mixed.
    let colliding = truth.iter().filter(|collides| **collides).count();
    let (least, most) = (PAIRS / 3, 2 * PAIRS / 3);
    assert!((least..=most).contains(&colliding), "{colliding}");
    let (mut decided, mut units) = (0, UNITS_MIN);
    while decided < PAIRS {
        let mut stage = Stage::new(shapes, courses, 0.0);
        stage.tick(Budget::units(units));
        let what = format!("seed {SEED}, cold, {units} units");
        let now = judge(&stage.verdicts(), &truth, &what);
        assert!(now > decided, "{what}: {now} pairs after {decided}");
        (decided, units) = (now, 2 * units);
    }
    // With fewer than four budgets there would be no profile.
    assert!(units >= 16 * UNITS_MIN, "{units}");
}

/// The same budget in each tick, one run per budget: the share of decided pairs over a whole run must rise.
fn rises_in_motion(shapes: &[Arc<Shape>], courses: &[Course]) {
    let (mut moving, mut walk) = (courses.to_vec(), Walk::default());
    let truth = |_| {
        let truth = truth(&moving, shapes, &mut walk);
        advance(&mut moving);
        truth
    };
    let truths: Vec<Vec<bool>> = (0..TICKS).map(truth).collect();
    let mut shares: Vec<f64> = Vec::new();
    let budgets = UNITS.map(Budget::units).into_iter();
    for budget in budgets.chain([Budget::UNLIMITED]) {
        let mut stage = Stage::new(shapes, courses, 0.0);
        let what = format!("seed {SEED}, {:?} units a tick", budget.units);
        let mut decided = 0;
        for (tick, truth) in truths.iter().enumerate() {
            stage.tick(budget);
            let at = format!("{what}, tick {tick}");
            decided += judge(&stage.verdicts(), truth, &at);
            advance(&mut stage.courses);
        }
        let share = decided as f64 / (PAIRS * TICKS) as f64;
        let last = shares.last().copied().unwrap_or(0.0);
        // For a tick or two motion may favour the smaller budget, since turns go to other pairs.
        assert!(share >= last - 0.01, "{what}: {share} after {last}");
        shares.push(share);
    }
    assert_eq!(shares.last(), Some(&1.0), "{shares:?}");
    assert!(shares[0] < 0.99, "nothing is left to rise: {shares:?}");
}

#[test]
fn without_a_limit_intervals_are_narrow() {
    // 19,880 triangles each.
    let shapes = balls(&[(71, 142, 0.06), (71, 142, 0.03)]);
    let seed = SEED + 1;
    let (mut rng, mut walk) = (Rng::new(seed), Walk::default());
    let course = |pair: usize| {
        let away = rng.direction();
        let mut course = Course::new(pair, [pair % 2, pair / 2 % 2], away, &mut rng);
        course.distance = rng.range(FAR_M, 3.0);
        let times = rng.below(3);
        course.approach(&shapes, times, 0.9, &mut walk);
        course
    };
    let courses: Vec<Course> = (0..40).map(course).collect();
    let mut stage = Stage::new(&shapes, &courses, REPORT_M);
    stage.tick(Budget::UNLIMITED);
    let mut told = 0;
    for (pair, row) in stage.told() {
        let gap = Interval::new(row.gap_min_m, row.gap_max_m);
        let verdict = Verdict::from_code(row.verdict).unwrap();
        let what = format!("seed {seed}, pair {pair}: {verdict}, {gap:?}");
        // The pairs are apart and within the report distance: near, not `possible`.
        assert_eq!(verdict, Verdict::Near, "{what}");
        assert!(gap.width() <= 1e-9 * DIAMETER_M, "{what}");
        let twin = courses[pair].twin(&shapes, Goal::Gap, &mut walk);
        let both = gap.widened(1e-11 * DIAMETER_M);
        let meet = both.min <= twin.max && twin.min <= both.max;
        assert!(meet, "{what}, by the twin {twin:?}");
        told += 1;
    }
    assert_eq!(told, courses.len());
}
