//! Four engines on the same scene, and the comparison of what they say with the truth.

use std::collections::BTreeMap;
use std::sync::Arc;

use sweepd::daemon::build_shapes;
use sweepd::tick::{Engine, TickInput};
use sweepd::time::{Budget, Clock, ManualClock};
use sweepd::wire::{
    Demand, FrameHeader, Inbox, Outbox, TickCause, TransformRow, Verdict, WIRE_VERSION,
    frame_flags, name_bytes,
};

use crate::bends;
use sweepd::world::{BuiltTree, WornTree};

use crate::couples::{Body, Couple, any_scene, gap_of, take_meshes};
use crate::kinds::{NAMES, Solid};
use crate::oracle::rng::Rng;
use crate::truth::Bounds;

/// Ticks of a scene.
pub const TICKS: u64 = 24;

/// What was seen so far.
#[derive(Default)]
pub struct Run {
    pub pair_ticks: u64,
    pub overlapping: u64,
    pub close: u64,
    undecided: [u64; 4],
    /// Ticks after which the last engine went on and was not done.
    went_on: u64,
    /// Trees put in place that were built anew.
    pub trees: u64,
    by_kind: BTreeMap<(usize, usize), u64>,
    within_rounding: u64,
}

impl Run {
    /// A scene of couples of these kinds, for [`TICKS`] ticks.
    pub fn scene(&mut self, seed: u64, kinds: &[(usize, usize)]) {
        let mut rng = Rng::new(seed);
        let (mut couples, scene) = any_scene(&mut rng, kinds);
        let built = build_shapes(&scene).unwrap().bodies;
        take_meshes(&mut couples, &built);
        let clock = Arc::new(ManualClock::new(1_000_000_000));
        let mut engines = [0; 4].map(|_| {
            Engine::new(
                &scene,
                built.clone(),
                1,
                Arc::clone(&clock) as Arc<dyn Clock>,
            )
            .unwrap()
        });
        for couple in &mut couples {
            couple.place(&mut rng);
        }
        let mut inbox = Inbox::default();
        let mut built_trees: [Option<BuiltTree>; 4] = [const { None }; 4];
        for tick in 1..=TICKS {
            fill(&mut inbox, &couples, &clock, tick);
            let whole = run(&mut engines[0], &inbox, &clock, Budget::UNLIMITED)
                .tick
                .units;
            // Often early: then refits of what deforms are cut, too.
            let most = [0, whole, whole / 8, whole / 30][rng.below(4)];
            let stop = rng.bits() % (most + 1);
            run(&mut engines[1], &inbox, &clock, Budget::units(stop));
            run(&mut engines[2], &inbox, &clock, Budget::units(whole / 2));
            // Each look at the clock takes 100 ns, and sending is said to take 100 us: the work stops anywhere, and
            // time is left to go on.
            clock.step_each_read(100);
            let budget = Budget::time_ns(100_000 + rng.bits() % (100 * whole + 1));
            run(&mut engines[3], &inbox, &clock, budget);
            engines[3].note_sent(100_000);
            clock.step_each_read(0);
            for engine in &engines {
                engine.validate().unwrap();
            }
            for (k, couple) in couples.iter().enumerate() {
                let outs = [0, 1, 2, 3].map(|e: usize| engines[e].outbox());
                self.compare(k as u64, couple, outs, &format!("seed {seed} tick {tick}"));
            }
            clock.step_each_read(100);
            self.went_on += u64::from(engines[3].work_on(rng.bits() % 20_000));
            clock.step_each_read(0);
            engines[3].validate().unwrap();
            // Trees are built from copies of one tick and put in place after another.
            for (engine, built) in engines.iter_mut().zip(&mut built_trees) {
                match built.take() {
                    Some(tree) => self.trees += u64::from(engine.take_tree(tree)),
                    None => *built = engine.worn_tree().map(WornTree::build),
                }
            }
            for couple in &mut couples {
                couple.step(&mut rng);
            }
        }
    }

    fn compare(&mut self, k: u64, couple: &Couple, outs: [&Outbox; 4], what: &str) {
        let [a, b] = &couple.bodies;
        let size = a.size.max(b.size);
        let noise = 1e-11 * size;
        // The search of directions creeps along the ridges that circles make.
        let curved = |body: &Body| {
            body.parts
                .iter()
                .any(|part| matches!(part.solid, Solid::Cylinder(..) | Solid::Cone(..)))
        };
        let missed = if curved(a) || curved(b) {
            1e-6 * size
        } else {
            noise
        };
        let mut truth = gap_of(a, b, 240);
        self.pair_ticks += 1;
        *self.by_kind.entry(couple.kinds).or_default() += 1;
        self.overlapping += u64::from(truth.high < 0.0);
        self.close += u64::from(truth.high.abs() < 0.02 * a.size.min(b.size));
        for (engine, out) in outs.into_iter().enumerate() {
            let ids = (2 * k + 1, 2 * k + 2);
            let row = out.pairs.iter().find(|row| (row.body_a, row.body_b) == ids);
            let row = row.filter(|row| row.verdict != Verdict::None.code());
            let verdict = row.map_or(Verdict::Apart, |row| {
                Verdict::from_code(row.verdict).unwrap()
            });
            let (low, high) =
                row.map_or((0.0, f64::INFINITY), |row| (row.gap_min_m, row.gap_max_m));
            let (one, other) = couple.kinds;
            let tell = |truth: Bounds| {
                if std::env::var_os("SWEEPD_TELL").is_some() {
                    println!("{row:?}");
                    for body in [a, b] {
                        println!("{:?}", body.pose);
                        for part in &body.parts {
                            println!("  {:?} at {:?}", part.solid, part.local);
                        }
                    }
                }
                format!(
                    "{what} engine {engine} {} - {} sizes {} {}: {verdict} [{low:e}, {high:e}], truth {truth:?}",
                    NAMES[one], NAMES[other], a.size, b.size
                )
            };
            if low > truth.high + missed {
                // The search may have missed the best direction: search again before accusing.
                truth = gap_of(a, b, 4_000);
            }
            assert!(
                low <= truth.high + missed,
                "above the truth: {}",
                tell(truth)
            );
            assert!(
                high >= truth.low - noise,
                "below the truth: {}",
                tell(truth)
            );
            if truth.high < -missed {
                assert!(
                    matches!(verdict, Verdict::Colliding | Verdict::Possible),
                    "missed: {}",
                    tell(truth)
                );
            }
            if truth.low > noise {
                assert_ne!(verdict, Verdict::Colliding, "{}", tell(truth));
            }
            if verdict == Verdict::Possible {
                self.undecided[engine] += 1;
                if engine == 0 {
                    // Without a limit only what cannot be told from touching is left open.
                    self.within_rounding += 1;
                    let open = truth.low <= 1e-9 * size && truth.high >= -1e-9 * size;
                    assert!(open, "left open: {}", tell(truth));
                }
            }
        }
    }

    pub fn fewest(&self) -> u64 {
        self.by_kind.values().copied().min().unwrap_or(0)
    }

    pub fn report(&self) {
        let share = |n: u64| 100.0 * n as f64 / self.pair_ticks as f64;
        println!(
            "{} pair-ticks, each against four engines; {} kinds of pairs, at least {} each; {:.1} % overlap, {:.1} % within 2 %",
            self.pair_ticks,
            self.by_kind.len(),
            self.fewest(),
            share(self.overlapping),
            share(self.close)
        );
        println!(
            "unresolved: {:.3} % without limit ({} within rounding of touching), {:.2} % at a random stop, {:.2} % at half the work, {:.2} % at a deadline, which went on {} times and was not done then",
            share(self.undecided[0]),
            self.within_rounding,
            share(self.undecided[1]),
            share(self.undecided[2]),
            share(self.undecided[3]),
            self.went_on
        );
        println!("{} trees were built anew", self.trees);
    }
}

fn fill(inbox: &mut Inbox, couples: &[Couple], clock: &ManualClock, seq: u64) {
    clock.advance(10_000_000);
    inbox.clear();
    let frame = inbox.push();
    frame.header = FrameHeader {
        session: 11,
        epoch: 1,
        seq,
        source: name_bytes("feed"),
        flags: frame_flags::FULL,
        schema: WIRE_VERSION,
        ..FrameHeader::default()
    };
    frame.received_ns = clock.boottime_ns();
    let bodies = couples.iter().flat_map(|couple| &couple.bodies);
    for (id, body) in (1..).zip(bodies.clone()) {
        let q = body.pose.rotation.as_vector();
        frame.transforms.push(TransformRow {
            body: id,
            position: body.pose.translation.vector.into(),
            orientation: [q.x, q.y, q.z, q.w],
            ..TransformRow::default()
        });
    }
    for (id, body) in (1..).zip(bodies) {
        if let (Some(bend), Solid::Mesh(soup, _)) = (&body.bend, &body.parts[0].solid) {
            bends::send(inbox, id, seq, bend, soup);
        }
    }
}

fn run<'a>(
    engine: &'a mut Engine,
    inbox: &Inbox,
    clock: &ManualClock,
    budget: Budget,
) -> &'a Outbox {
    engine.tick(TickInput {
        inbox,
        edits: &[],
        demand: Demand::ALL,
        budget,
        cause: TickCause::Frame,
        cause_source: None,
        woke_ns: clock.monotonic_ns(),
        pulse: None,
    })
}
