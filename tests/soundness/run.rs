//! Four engines on the same scene, and the comparison of their results with the truth.

use std::collections::BTreeMap;
use std::sync::Arc;

use sweepd::daemon::build_shapes;
use sweepd::tick::{Engine, TickInput};
use sweepd::time::{Budget, Clock, ManualClock};
use sweepd::wire::{
    Demand, FrameHeader, Inbox, Outbox, TickCause, TransformRow, Verdict, WIRE_VERSION,
    frame_flags, name_bytes,
};
use sweepd::world::{BuiltTree, WornTree};

use crate::bends;
use crate::couples::{Couple, any_scene, depth_of, gap_of, take_meshes};
use crate::depth::Search;
use crate::fronts::{Checked, Fronts};
use crate::kinds::Solid;
use crate::oracle::rng::Rng;
use crate::regimes::Shares;
use crate::tally::{Fault, Tally};
use crate::truth::Bounds;

/// Ticks per scene.
pub const TICKS: u64 = 24;

/// Counters so far.
#[derive(Default)]
pub struct Run {
    pub shares: Shares,
    pub fronts: Checked,
    pub tally: Tally,
    undecided: [u64; 4],
    /// Results of the depth search for overlaps published as deeper than the oracle's vertices: by [`Search`].
    deeper: [u64; 3],
    /// Ticks in which the last engine continued after publishing and did not finish.
    went_on: u64,
    /// Number of rebuilt trees put in place.
    pub trees: u64,
    by_kind: BTreeMap<(usize, usize), u64>,
    within_rounding: u64,
}

/// The published result of an engine for a pair.
struct Said {
    verdict: Verdict,
    low: f64,
    high: f64,
}

impl Run {
    /// Runs a scene of couples of these kinds for [`TICKS`] ticks.
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
            couple.begin(&mut rng);
        }
        let (mut fronts, mut shares) = (Fronts::new(seed), Shares::default());
        let mut inbox = Inbox::default();
        let mut built_trees: [Option<BuiltTree>; 4] = [const { None }; 4];
        for tick in 1..=TICKS {
            fill(&mut inbox, &couples, &clock, tick);
            tick_all(&mut engines, &inbox, &clock, &mut rng);
            let what = format!("seed {seed} tick {tick}");
            for (k, couple) in couples.iter().enumerate() {
                shares.count(&couple.gap(), couple.small());
                self.compare(k, couple, &engines, &what);
                let world = engines[k % 4].world();
                let told = (&mut self.fronts, &mut self.tally);
                fronts.tick(k, couple, world, told, &what);
            }
            clock.step_each_read(100);
            self.went_on += u64::from(engines[3].work_on(rng.bits() % 20_000));
            clock.step_each_read(0);
            engines[3].validate().unwrap();
            // Trees are built from copies of one tick and put in place after a later one.
            for (engine, built) in engines.iter_mut().zip(&mut built_trees) {
                match built.take() {
                    Some(tree) => self.trees += u64::from(engine.take_tree(tree)),
                    None => *built = engine.worn_tree().map(WornTree::build),
                }
            }
            for couple in &mut couples {
                couple.step(&mut rng, &shares);
            }
        }
    }

    fn compare(&mut self, k: usize, couple: &Couple, engines: &[Engine; 4], what: &str) {
        let [a, b] = &couple.bodies;
        let (noise, missed) = (couple.noise(), couple.missed());
        let mut truth = couple.gap();
        self.shares.count(&truth, couple.small());
        *self.by_kind.entry(couple.kinds).or_default() += 1;
        for (place, engine) in engines.iter().enumerate() {
            let said = Said::of(engine.outbox(), k);
            if said.low > truth.high + missed {
                // The search may have missed the best direction: it searches more densely before a fault is counted.
                truth = gap_of(a, b, 4_000);
            }
            let tell = |fault: &str| {
                let what = format!("{fault}: {what} engine {place}");
                said.tell(&what, couple, truth)
            };
            let above = said.low > truth.high + missed;
            let mut below = said.high < truth.low - noise;
            if said.high < truth.high.min(0.0) - missed {
                // The oracle knows no point of this depth.
                let search = depth_of(a, b, -said.high - missed);
                self.deeper[search as usize] += 1;
                below |= search == Search::Refuted;
            }
            let tally = &mut self.tally;
            tally.note(Fault::Interval, u64::from(above), || {
                tell("above the truth")
            });
            tally.note(Fault::Interval, u64::from(below), || {
                tell("below the truth")
            });
            let denied = !matches!(said.verdict, Verdict::Colliding | Verdict::Possible);
            let lost = denied && truth.depth() > missed;
            // A pair that an exact query cannot distinguish from a contact collides (law 3.4): round shapes are
            // certified to 1e-7.
            let touching = said.low <= 0.0 && said.high >= 0.0;
            let within_rounding = touching && said.high - said.low <= 1e-7 * couple.large();
            let made_up =
                said.verdict == Verdict::Colliding && truth.low > noise && !within_rounding;
            tally.note(Fault::Verdict, u64::from(lost), || tell("missed"));
            tally.note(Fault::Verdict, u64::from(made_up), || tell("made up"));
            if said.verdict != Verdict::Possible {
                continue;
            }
            self.undecided[place] += 1;
            if place == 0 {
                // Without a limit only a pair that cannot be distinguished from a contact may be open.
                self.within_rounding += 1;
                let least = 1e-9 * couple.large();
                let told_apart = truth.low > least || truth.depth() > least;
                tally.note(Fault::Verdict, u64::from(told_apart), || tell("left open"));
            }
        }
    }

    pub fn fewest(&self) -> u64 {
        self.by_kind.values().copied().min().unwrap_or(0)
    }

    pub fn report(&self) {
        let (all, fronts) = (self.shares.all, self.fronts);
        let share = |n: u64| 100.0 * n as f64 / all as f64;
        println!(
            "{all} pair-ticks, each against four engines; {} kinds of pairs, at least {} each",
            self.by_kind.len(),
            self.fewest()
        );
        println!(
            "{} overlap ({:.1} %), {} are apart by no more than 1 % of the smaller body's size ({:.1} %)",
            self.shares.overlapping,
            share(self.shares.overlapping),
            self.shares.close,
            share(self.shares.close)
        );
        println!(
            "fronts in {} pair-ticks, {} times stopped and looked into, {} pairs of leaves",
            fronts.pair_ticks, fronts.covers, fronts.leaf_pairs
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
        let [found, refuted, open] = self.deeper;
        println!(
            "{} were said to be deeper than the corners of the oracle: {found} are, {refuted} are not, {open} were not told",
            found + refuted + open
        );
        println!("{} trees were built anew", self.trees);
        println!("{}", self.tally);
    }
}

impl Said {
    /// The result for the couple at this index of the scene.
    fn of(out: &Outbox, place: usize) -> Self {
        let first = 2 * place as u64 + 1;
        let of_couple = |body_a: u64, body_b: u64| (body_a, body_b) == (first, first + 1);
        let row = (out.pairs.iter()).find(|row| of_couple(row.body_a, row.body_b));
        let row = row.filter(|row| row.verdict != Verdict::None.code());
        row.map_or(
            Self {
                verdict: Verdict::Apart,
                low: 0.0,
                high: f64::INFINITY,
            },
            |row| Self {
                verdict: Verdict::from_code(row.verdict).unwrap(),
                low: row.gap_min_m,
                high: row.gap_max_m,
            },
        )
    }

    fn tell(&self, what: &str, couple: &Couple, truth: Bounds) -> String {
        if std::env::var_os("SWEEPD_TELL").is_some() {
            for body in &couple.bodies {
                println!("{:?}", body.pose);
                for part in &body.parts {
                    println!("  {:?} at {:?}", part.solid, part.local);
                }
            }
        }
        let (verdict, low, high) = (self.verdict, self.low, self.high);
        let names = couple.names();
        format!("{what} {names}: {verdict} [{low:e}, {high:e}], truth {truth:?}")
    }
}

/// Runs one tick of each engine with its budget.
fn tick_all(engines: &mut [Engine; 4], inbox: &Inbox, clock: &ManualClock, rng: &mut Rng) {
    let whole = run(&mut engines[0], inbox, clock, Budget::UNLIMITED)
        .tick
        .units;
    // Often a small limit, so that refits of deforming bodies are cut off too.
    let most = [0, 1, whole, whole / 8, whole / 30][rng.below(5)];
    let stop = rng.bits() % (most + 1);
    run(&mut engines[1], inbox, clock, Budget::units(stop));
    run(&mut engines[2], inbox, clock, Budget::units(whole / 2));
    // Each clock read takes 100 ns, and sending is reported to take 100 us: the work stops anywhere, and there is time
    // to continue.
    clock.step_each_read(100);
    let budget = Budget::time_ns(100_000 + rng.bits() % (100 * whole + 1));
    run(&mut engines[3], inbox, clock, budget);
    engines[3].note_sent(100_000);
    clock.step_each_read(0);
    for engine in engines {
        engine.validate().unwrap();
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
