//! Goal: the published results of the built-in scenes change only on purpose, and are the same in every build on every
//! machine. Method: each built-in scene with each built-in motion, for some ticks without a budget and with one in work
//! units. The published results are summed up in a line, which is compared with that in `tests/data/goldens.txt`.
//!
//! A line has two hashes, one of the integers of all pairs (ids, verdicts, events, ticks, levels, flags) and one of
//! those of all contacts (ids, shapes, kinds, flags), and the means of all gaps, and of all contact points and normals.
//! Float bits are not hashed: `sin`, `cos` and `atan2`, which the exact queries of cylinders and cones use, come from
//! the C library. Their last digit differs between libraries, and within one library between processors with and
//! without fused multiply-add. For the same reason poses are rounded to a micrometre before they are sent. The means
//! are compared to within [`CLOSE`].
//!
//! To renew the file on purpose: `SWEEPD_GOLDENS=renew cargo test --test goldens`, and commit it with the cause of the
//! change.

#![allow(clippy::unwrap_used, clippy::panic, unreachable_pub, reason = "a test")]

mod harness;

use std::fmt::Write as _;
use std::path::PathBuf;

use harness::Drive;
use sweepd::builtin::{Pattern, pile, pool};
use sweepd::time::Budget;
use sweepd::wire::{ContactRow, Demand, Outbox, PairRow};

/// Moving bodies per scene.
const BODIES: usize = 200;
/// Ticks per scene.
const TICKS: u64 = 50;
/// Work units of a limited tick: too few for a moving scene, so that ticks are cut off.
const UNITS: u64 = 12;
/// Pairs nearer than this are reported as near, metres.
const NEAR: &str = "moves = true\nreport_within_m = 0.1\n";
/// Tolerance of mean gaps, points and normals, metres. They are means of some thousand values; the last digits of
/// trigonometric functions change most of these by almost nothing, and one end of an overlapping curved pair
/// occasionally by 1e-7.
const CLOSE: f64 = 1e-8;
const WORDS: usize = 7;

/// FNV-1a, 64 bits (Fowler, Noll, Vo).
struct Hash(u64);

impl Hash {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn take(&mut self, words: &[u64]) {
        for byte in words.iter().flat_map(|word| word.to_le_bytes()) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// Mean of the finite values.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    /// * returns - the number of finite values.
    fn take(&mut self, values: &[f64]) -> u64 {
        let before = self.count;
        for value in values.iter().filter(|value| value.is_finite()) {
            self.sum += value;
            self.count += 1;
        }
        u64::from(self.count - before)
    }

    fn of_all(&self) -> f64 {
        self.sum / f64::from(self.count.max(1))
    }
}

fn of_pair(row: &PairRow) -> [u64; 12] {
    [
        row.body_a,
        row.body_b,
        row.begin_first_tick,
        row.begin_last_tick,
        row.end_first_tick,
        row.end_last_tick,
        row.certified_tick,
        u64::from(row.bound_age_ticks),
        u64::from(row.verdict) << 8 | u64::from(row.certified_verdict),
        u64::from(row.events) << 8 | u64::from(row.end_cause),
        u64::from(row.level),
        u64::from(row.flags),
    ]
}

fn of_contact(row: &ContactRow) -> [u64; 9] {
    [
        row.id,
        row.body_a,
        row.body_b,
        u64::from(row.shape_a),
        u64::from(row.shape_b),
        u64::from(row.triangle_a),
        u64::from(row.triangle_b),
        u64::from(row.flags),
        u64::from(row.kind),
    ]
}

/// Everything published in a run.
struct Published {
    pairs: Hash,
    contacts: Hash,
    gaps: Mean,
    points: Mean,
}

impl Published {
    fn take(&mut self, out: &Outbox) {
        let tick = &out.tick;
        let state = u64::from(tick.header.state);
        (self.pairs).take(&[state, tick.colliding, tick.possible, tick.near]);
        for row in &out.pairs {
            self.pairs.take(&of_pair(row));
            let finite = (self.gaps).take(&[row.gap_min_m, row.gap_max_m, row.gap_best_m]);
            self.pairs.take(&[finite]);
        }
        self.contacts.take(&[out.contacts.len() as u64]);
        for row in &out.contacts {
            self.contacts.take(&of_contact(row));
            let finite = (self.gaps).take(&[row.gap_m, row.gap_min_m, row.gap_max_m]);
            self.contacts.take(&[finite]);
            for values in [&row.point_a, &row.point_b, &row.normal] {
                let finite = self.points.take(values);
                self.contacts.take(&[finite]);
            }
        }
    }
}

/// Rounds poses to the micrometre and quaternion components to a millionth.
fn round(drive: &mut Drive) {
    for row in drive.rows_mut() {
        let values = row.position.iter_mut().chain(&mut row.orientation);
        values.for_each(|value| *value = (*value * 1e6).round() / 1e6);
    }
}

/// Runs a scene and returns its line.
fn line(name: &str, scene: &str, pattern: Pattern, budget: Budget) -> String {
    let scene = scene.replace("moves = true\n", NEAR);
    let mut drive = Drive::new(&scene, pattern, 5);
    let mut all = Published {
        pairs: Hash::new(),
        contacts: Hash::new(),
        gaps: Mean::default(),
        points: Mean::default(),
    };
    let mut cut = 0;
    for tick in 0..TICKS {
        drive.place(tick);
        round(&mut drive);
        all.take(drive.send(budget, Demand::ALL));
        cut += u64::from(drive.out().tick.possible > 0);
    }
    let motion = format!("{pattern:?}").to_lowercase();
    let told = format!(
        "{name} {motion}: {cut} ticks cut off, {} gaps",
        all.gaps.count
    );
    assert!(all.gaps.count > 1_000 && all.points.count > 1_000, "{told}");
    let is_cut = budget.is_limited() && pattern != Pattern::Rest;
    assert!(cut == 0 || budget.is_limited(), "{told}");
    assert!(
        cut > TICKS / 2 || !is_cut || pattern == Pattern::Vibrate,
        "{told}"
    );
    let units = budget
        .units
        .map_or("all".to_owned(), |units| units.to_string());
    format!(
        "{name} {motion} {units} {:016x} {:016x} {:.12} {:.12}",
        all.pairs.0,
        all.contacts.0,
        all.gaps.of_all(),
        all.points.of_all()
    )
}

/// Whether two lines are equal up to the tolerance of their means.
fn is_same(one: &str, other: &str) -> bool {
    let [one, other] = [one, other].map(|line| line.split(' ').collect::<Vec<_>>());
    let (exact, close) = (0..WORDS - 2, WORDS - 2..WORDS);
    let near = |at: usize| {
        let [x, y] = [&one, &other].map(|words| words[at].parse::<f64>().unwrap());
        (x - y).abs() <= CLOSE
    };
    one.len() == WORDS
        && other.len() == WORDS
        && one[exact.clone()] == other[exact]
        && close.into_iter().all(near)
}

fn file() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/goldens.txt")
}

#[test]
fn what_is_published_of_the_built_in_scenes_is_what_it_was() {
    let mut lines = Vec::new();
    for (name, scene) in [("pool", pool(BODIES, 3)), ("pile", pile(BODIES, 4))] {
        for pattern in [
            Pattern::Wander,
            Pattern::Vibrate,
            Pattern::Spin,
            Pattern::Rest,
        ] {
            for budget in [Budget::UNLIMITED, Budget::units(UNITS)] {
                lines.push(line(name, &scene, pattern, budget));
            }
        }
    }
    if std::env::var_os("SWEEPD_GOLDENS").is_some_and(|asked| asked == "renew") {
        std::fs::write(file(), lines.join("\n") + "\n").unwrap();
        return;
    }
    let kept = std::fs::read_to_string(file()).unwrap_or_default();
    let mut kept = kept.lines();
    let mut told = String::new();
    for line in &lines {
        let was = kept.next().unwrap_or_default();
        if !is_same(was, line) {
            let _ = write!(told, "\n- {was}\n+ {line}");
        }
    }
    assert!(
        told.is_empty() && kept.next().is_none(),
        "what is published has changed (scene, motion, units, hashes of pairs and contacts, means):{told}\n\
         If it is meant to: SWEEPD_GOLDENS=renew cargo test --test goldens, and commit tests/data/goldens.txt."
    );
}

#[test]
fn a_line_is_another_when_a_verdict_or_a_gap_is() {
    let line = "pool rest all 00ff 11ee 0.250000000000 -1.000000000000";
    assert!(is_same(line, line));
    assert!(is_same(line, &line.replace("0.2500000000", "0.2500000001")));
    for (was, now) in [
        ("00ff", "00fe"),
        ("11ee", "01ee"),
        ("0.25", "0.26"),
        ("-1.0", "1.0"),
    ] {
        assert!(!is_same(line, &line.replace(was, now)), "{now}");
    }
    assert!(!is_same("", line));
}
