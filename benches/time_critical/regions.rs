//! Approximate contacts: the quality of the regions of a pair whose work was cut off at a share of its total.
//!
//! Pairs of bumpy spheres of 19,880 triangles, each alone and cold, in random directions, overlapping by 0.25, 2.5 and
//! 20 % of the diameter measured from first contact. References: every point that the two surfaces share (all triangles
//! against all, `tests/oracle/shared.rs`), and the exact manifold.

use std::cell::RefCell;
use std::sync::Arc;

use sweepd::broad::{BroadPhase, Method};
use sweepd::builtin::Random;
use sweepd::ids::PairSlot;
use sweepd::limits::{REGION_LOOKS_FREE, REGION_TESTS_PER_PAIR};
use sweepd::math::{Point, Pose, Quat, Vec3, relative};
use sweepd::narrow::mesh::{Goal, Walk};
use sweepd::narrow::{Narrow, Order, Region, Wanted};
use sweepd::pairs::{PairDelta, PairSet};
use sweepd::shape::{Geometry, Shape};
use sweepd::time::{Clock, Meter, SystemClock};
use sweepd::wire::{FrameHeader, Inbox, WIRE_VERSION, frame_flags, name_bytes};
use sweepd::world::{Parts, PlacedShape, World};

use crate::common::{provenance, quantile, row, save};
use crate::oracle::Triangle;
use crate::oracle::shared::crossings;
use crate::stage::{DIAMETER_M, body, scene};

const SEED: u64 = 29;
/// Overlaps, as a share of the diameter, and the number of pairs for each.
const OVERLAPS: [f64; 3] = [0.0025, 0.025, 0.2];
const SHARES: [u64; 6] = [0, 5, 10, 25, 50, 100];
/// Values of the region tests per pair that are compared at a quarter of the work.
const TESTS: [u32; 3] = [0, 16, REGION_TESTS_PER_PAIR];

const WANTED: Wanted = Wanted {
    contacts: true,
    bounds: true,
    regions: false,
    order: Order::Counted,
};

/// One pair in its own world.
struct Alone {
    world: RefCell<World>,
    pairs: PairSet,
    delta: PairDelta,
    slot: PairSlot,
}

impl Alone {
    fn new(shapes: [&Arc<Shape>; 2], poses: &[Pose; 2]) -> Self {
        let scene = scene(vec![body(1), body(2)]);
        let placed = shapes.map(|shape| {
            let shape = Arc::clone(shape);
            let pose = Pose::identity();
            Parts::from([PlacedShape { shape, pose }])
        });
        let clock = SystemClock;
        let mut world = World::new(&scene, placed.to_vec(), clock.boottime_ns()).unwrap();
        let mut inbox = Inbox::default();
        let frame = inbox.push();
        frame.header = FrameHeader {
            session: 1,
            seq: 1,
            source: name_bytes("feed"),
            flags: frame_flags::FULL,
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
        frame.received_ns = clock.boottime_ns();
        frame
            .transforms
            .extend([row(1, &poses[0]), row(2, &poses[1])]);
        world.begin_tick(1, clock.boottime_ns());
        inbox.frames().iter().for_each(|f| {
            world.admit(f, clock.boottime_ns());
        });
        world.age(clock.boottime_ns());
        let (mut pairs, mut delta) = (PairSet::new(16), PairDelta::default());
        let mut broad = BroadPhase::new(Method::SweepAndPrune);
        broad.update(
            world.changes(),
            &world,
            world.filters(),
            &mut pairs,
            &mut delta,
        );
        let slot = pairs.iter().next().unwrap().0;
        Self {
            world: RefCell::new(world),
            pairs,
            delta,
            slot,
        }
    }

    /// A cold start that is cut off after so many units; returns the narrow phase and the units spent.
    fn cut_off(&self, units: Option<u64>) -> (Narrow, u64) {
        let mut narrow = Narrow::new(16);
        // Refits of deforming meshes would spend part of the units; there are none here.
        let mut world = self.world.borrow_mut();
        narrow.begin(1, &world, &self.pairs, &self.delta);
        narrow.widen(&world, &mut self.pairs.clone());
        let clock = SystemClock;
        let mut meter = Meter::new(&clock, None, units);
        narrow.spend(&mut world, WANTED, &mut meter);
        let spent = meter.spent();
        (narrow, spent)
    }
}

/// Results at one share of the work.
#[derive(Default)]
struct Tally {
    points: u64,
    inside: u64,
    radii: Vec<u64>,
    widest: Vec<u64>,
    point_errors: Vec<u64>,
    normal_errors: Vec<u64>,
    in_region: u64,
    in_cone: u64,
    cones: Vec<u64>,
    contacts: u64,
    took_ns: Vec<u64>,
    count: u64,
}

/// Converts a share of the diameter or an angle to whole millionths.
pub fn millionths(x: f64) -> u64 {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small, not negative"
    )]
    let whole = (x * 1e6).round() as u64;
    whole
}

struct Case {
    alone: Alone,
    work: u64,
    shared: Vec<Point>,
    /// Middle and normal of each contact.
    contacts: Vec<(Point, Vec3)>,
}

impl Tally {
    fn add(&mut self, case: &Case, units: u64, tests: u32) {
        let (mut narrow, _) = case.alone.cut_off(Some(units));
        let (clock, world) = (SystemClock, case.alone.world.borrow());
        let mut took_ns = 0;
        // The second run is the measured one; it allocates nothing.
        for _ in 0..2 {
            let start_ns = clock.monotonic_ns();
            if tests > 0 {
                let mut meter = Meter::new(&clock, None, Some(tests.into()));
                narrow.refine_regions(case.alone.slot, &world, &mut meter);
            }
            narrow.regions(case.alone.slot, &world, REGION_LOOKS_FREE);
            took_ns = clock.monotonic_ns() - start_ns;
        }
        self.took_ns.push(took_ns);
        let found = narrow.regions(case.alone.slot, &world, REGION_LOOKS_FREE);
        let all: Vec<Region> = found.map_or(Vec::new(), |found| found.all.to_vec());
        let within = |r: &Region, p: &Point| (p - r.centre).norm() <= r.radius_m + 1e-9;
        self.count += all.len() as u64;
        self.points += case.shared.len() as u64;
        let held = |p: &&Point| all.iter().any(|r| within(r, p));
        self.inside += case.shared.iter().filter(held).count() as u64;
        let widest = all.iter().map(|r| r.radius_m).fold(0.0, f64::max);
        self.widest.push(millionths(widest / DIAMETER_M));
        for region in &all {
            self.radii.push(millionths(region.radius_m / DIAMETER_M));
            self.cones
                .push(millionths(region.half_angle_rad.to_degrees()));
        }
        for (middle, normal) in &case.contacts {
            let away = |r: &&Region| millionths((r.point - middle).norm() / DIAMETER_M);
            let Some(nearest) = all.iter().min_by_key(away) else {
                continue;
            };
            self.contacts += 1;
            self.point_errors.push(away(&nearest));
            let angle = |u: &Vec3| u.dot(normal).clamp(-1.0, 1.0).acos();
            self.normal_errors
                .push(millionths(angle(&nearest.normal).to_degrees()));
            let held = || all.iter().filter(|r| within(r, middle));
            self.in_region += u64::from(held().next().is_some());
            self.in_cone += u64::from(held().any(|r| angle(&r.axis) <= r.half_angle_rad + 1e-6));
        }
    }

    fn line(&mut self) -> String {
        let at = |all: &mut Vec<u64>, share: f64| quantile(all, share) as f64 / 1e6;
        format!(
            "{:.3},{:.2},{:.2},{:.2},{:.2},{:.2},{:.1},{:.1},{:.1},{:.1},{:.1},{:.1},{:.1}",
            100.0 * self.inside as f64 / self.points.max(1) as f64,
            self.count as f64 / self.took_ns.len() as f64,
            100.0 * at(&mut self.radii, 0.5),
            100.0 * at(&mut self.radii, 0.9),
            100.0 * at(&mut self.widest, 0.5),
            100.0 * at(&mut self.point_errors, 0.5),
            at(&mut self.normal_errors, 0.5),
            at(&mut self.normal_errors, 0.9),
            at(&mut self.cones, 0.5),
            100.0 * self.in_region as f64 / self.contacts.max(1) as f64,
            100.0 * self.in_cone as f64 / self.in_region.max(1) as f64,
            quantile(&mut self.took_ns, 0.5) as f64 / 1e3,
            quantile(&mut self.took_ns, 0.99) as f64 / 1e3,
        )
    }
}

/// A pair that has moved by `overlap` (share of the diameter) beyond its first contact on the way in.
fn case(shapes: &[Arc<Shape>], overlap: f64, random: &mut Random) -> Case {
    let mut vector = |size: f64| {
        Vec3::new(
            random.range(-size, size),
            random.range(-size, size),
            random.range(-size, size),
        )
    };
    let a = Pose::from_parts(vector(5.0).into(), Quat::from_scaled_axis(vector(3.0)));
    let (turn, away) = (Quat::from_scaled_axis(vector(3.0)), vector(1.0).normalize());
    let pick = |x: f64| if x < 0.0 { 0 } else { 2 };
    let (one, other) = (&shapes[pick(turn.i)], &shapes[1 + pick(turn.j)]);
    let at = |d: f64| Pose::from_parts((a.translation.vector + away * d).into(), turn);
    let mut walk = Walk::default();
    let clock = SystemClock;
    let mut touches = |d: f64| {
        walk.start(one, other, &relative(&a, &at(d)));
        assert!(walk.advance(
            one,
            other,
            Goal::Verdict,
            u64::MAX,
            &mut Meter::unlimited(&clock)
        ));
        walk.interval().min <= 0.0
    };
    let (mut low, mut high) = (1.2, 2.4);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if touches(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let b = at(high - overlap * DIAMETER_M);
    let alone = Alone::new([one, other], &[a, b]);
    let rel = relative(&a, &b);
    let (narrow, work) = alone.cut_off(None);
    let contacts = narrow.contacts(alone.slot).0.iter();
    let contacts = contacts.map(|c| (nalgebra::center(&c.point_a, &(rel * c.point_b)), c.normal));
    Case {
        contacts: contacts.collect(),
        shared: shared([one, other], &rel),
        alone,
        work,
    }
}

/// Every point that the surfaces share, in A's frame.
fn shared(shapes: [&Arc<Shape>; 2], rel: &Pose) -> Vec<Point> {
    let placed = [(shapes[0], Pose::identity()), (shapes[1], *rel)].map(|(shape, pose)| {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            return Vec::new();
        };
        let face = |f: &[u32; 3]| f.map(|i| pose * mesh.vertices()[i as usize]);
        mesh.faces().iter().map(face).collect::<Vec<Triangle>>()
    });
    let mut all = Vec::new();
    crossings(&placed[0], &placed[1], |p| all.push(p));
    all
}

pub fn run(shapes: &[Arc<Shape>], quick: bool) {
    let count = if quick { 4 } else { 40 };
    let from = provenance();
    let columns = "overlap_percent,work_percent,tests,pairs,work_units_mean,shared_points_inside_percent,regions_mean,\
         radius_p50_percent,radius_p90_percent,widest_p50_percent,point_error_p50_percent,normal_error_p50_deg,\
         normal_error_p90_deg,cone_p50_deg,contacts_in_regions_percent,their_normals_in_cones_percent,took_p50_us,took_p99_us";
    let mut csv = format!("machine,commit,compiler,seed,{columns}\n");
    println!("{columns}");
    let mut random = Random::new(SEED);
    let mut every: Vec<(f64, Vec<Case>)> = Vec::new();
    for overlap in OVERLAPS {
        let cases = (0..count).map(|_| case(shapes, overlap, &mut random));
        every.push((overlap, cases.collect()));
    }
    let mut add = |name: &str, cases: &[&Case], share: u64, tests: u32| {
        let mut tally = Tally::default();
        let work: u64 = cases.iter().map(|case| case.work).sum();
        for case in cases {
            tally.add(case, case.work * share / 100, tests);
        }
        let work = work as f64 / cases.len() as f64;
        let line = format!(
            "{name},{share},{tests},{},{work:.0},{}",
            cases.len(),
            tally.line()
        );
        println!("{line}");
        csv += &format!("{from},{SEED},{line}\n");
    };
    let all: Vec<&Case> = every.iter().flat_map(|(_, cases)| cases).collect();
    for share in SHARES {
        add("all", &all, share, REGION_TESTS_PER_PAIR);
        for (overlap, cases) in &every {
            let cases: Vec<&Case> = cases.iter().collect();
            add(
                &format!("{}", overlap * 100.0),
                &cases,
                share,
                REGION_TESTS_PER_PAIR,
            );
        }
    }
    for tests in TESTS {
        add("all", &all, 25, tests);
    }
    save("regions.csv", &csv);
}
