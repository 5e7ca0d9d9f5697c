//! Random frames (valid and invalid), sessions, pauses, edits and silences in any order. After every tick the structure
//! must be consistent, and the change sets alone must give a listener the bodies in the broad phase.

use std::collections::BTreeMap;

use sweepd::config::OnStale;
use sweepd::ids::BodySlot;
use sweepd::math::Pose;
use sweepd::scene::{BodySpec, PairAction};
use sweepd::wire::{Frame, TransformRow, frame_flags};
use sweepd::world::{Edit, Put};

use crate::common::Rng;
use crate::support::{Bench, MS, TIMEOUT_NS, cube, fixed, frame, moving, row, rule};

fn spec(rng: &mut Rng, id: u64) -> BodySpec {
    let name = format!("b{id}");
    if rng.once_in(4) {
        return fixed(&name, id, rng.between(-5.0, 5.0));
    }
    BodySpec {
        source: Some(rng.below(2)),
        max_speed_mps: rng.once_in(2).then_some(1.0),
        on_stale: [
            None,
            Some(OnStale::Unknown),
            Some(OnStale::Hold),
            Some(OnStale::Remove),
        ][rng.below(4)],
        report_within_m: if rng.once_in(3) { 0.25 } else { 0.0 },
        ..moving(&name, id)
    }
}

fn random_row(rng: &mut Rng) -> TransformRow {
    let mut row = row(rng.bits() % 12 + 1, rng.below(6) as f64);
    match rng.below(20) {
        0 => row.position[1] = f64::NAN,
        1 => row.orientation = [0.0; 4],
        2 => row.position[2] = 1e13,
        _ => {}
    }
    row
}

fn random_frame(rng: &mut Rng, now_ns: u64) -> Frame {
    let rows: Vec<_> = (0..rng.below(8)).map(|_| random_row(rng)).collect();
    let source = ["sim", "robot"][rng.below(2)];
    // Mostly increasing numbers.
    let seq = now_ns / MS - rng.bits() % 3;
    let mut frame = frame(source, seq, now_ns - rng.bits() % (50 * MS), &rows);
    frame.received_ns = now_ns;
    frame.header.session = 1 + u64::from(rng.once_in(10));
    frame.header.epoch = u64::from(rng.once_in(30));
    frame.header.scene_rev = if rng.once_in(20) { rng.bits() % 200 } else { 0 };
    match rng.below(10) {
        0 => {
            frame.header.flags = frame_flags::PAUSED;
            frame.transforms.clear();
        }
        1 => frame.header.flags = frame_flags::PARTIAL,
        2 => frame.velocities.resize(frame.transforms.len(), [0.5; 6]),
        _ => {}
    }
    frame
}

fn random_edit(rng: &mut Rng) -> Edit {
    let name = |rng: &mut Rng| format!("b{}", rng.below(12) + 1);
    let one = name(rng);
    match rng.below(9) {
        0..=2 => {
            let id = rng.bits() % 12 + 1;
            Edit::Put(Put {
                body: std::sync::Arc::new(spec(rng, id)),
                shapes: cube(),
            })
        }
        3 => Edit::Remove { name: one },
        4 => Edit::Enable {
            name: one,
            enabled: rng.once_in(2),
        },
        5 => Edit::Filter {
            name: one,
            group: Some(1 << rng.below(2)),
            mask: None,
        },
        6 => Edit::Rule(rule(PairAction::Ignore, &one, "b*")),
        7 => Edit::Attach {
            name: one,
            to: rng.once_in(2).then(|| name(rng)),
            pose: rng.once_in(2).then(|| Pose::translation(0.0, 0.0, 2.0)),
        },
        _ => Edit::Reset {
            source: rng.once_in(2).then(|| "sim".to_owned()),
        },
    }
}

/// The bodies in the broad phase according to the change sets, with their last seen state.
#[derive(Default)]
struct Listener {
    inside: BTreeMap<BodySlot, (u32, [u64; 6])>,
}

impl Listener {
    fn seen(bench: &Bench, slot: BodySlot) -> (u32, [u64; 6]) {
        let body = bench.world.body(slot).unwrap();
        let (low, high) = (body.proxy.min, body.proxy.max);
        let bits = [low.x, low.y, low.z, high.x, high.y, high.z].map(f64::to_bits);
        (body.generation, bits)
    }

    fn follow(&mut self, bench: &Bench) {
        let changes = bench.world.changes();
        for removed in &changes.removed {
            assert!(
                self.inside.remove(&removed.slot).is_some(),
                "left, but was not in"
            );
        }
        for &slot in &changes.inserted {
            let new = self.inside.insert(slot, Self::seen(bench, slot));
            assert!(new.is_none(), "came twice");
        }
        for &slot in &changes.moved {
            let old = self.inside.insert(slot, Self::seen(bench, slot));
            assert!(old.is_some(), "moved, but is not in");
        }
        for slot in &changes.requery {
            assert!(self.inside.contains_key(slot), "asked for, but is not in");
        }
        let inside = bench.world.bodies().filter(|(_, body)| body.in_broad);
        let wanted: BTreeMap<_, _> = inside
            .map(|(slot, _)| (slot, Self::seen(bench, slot)))
            .collect();
        assert_eq!(self.inside, wanted);
    }
}

#[test]
fn whatever_comes_the_structure_holds_and_the_change_sets_tell_all() {
    let (mut applied, mut poses) = (0, 0);
    for seed in 0..200 {
        let mut rng = Rng::new(seed);
        println!("seed {seed}");
        let mut bench = Bench::of((1..=8).map(|id| spec(&mut rng, id)).collect());
        let mut listener = Listener::default();
        listener.follow(&bench);
        for _ in 0..100 {
            let pause_ns = if rng.once_in(15) { TIMEOUT_NS } else { 20 * MS };
            let now_ns = bench.now_ns + rng.bits() % pause_ns + 1;
            bench.tick += 1;
            bench.now_ns = now_ns;
            bench.world.begin_tick(bench.tick, now_ns);
            while rng.once_in(4) {
                let edits = [random_edit(&mut rng), random_edit(&mut rng)];
                applied += u64::from(bench.world.apply(&edits).is_ok());
            }
            for _ in 0..rng.below(4) {
                let frame = random_frame(&mut rng, now_ns);
                if let sweepd::world::Admission::Admitted { poses: n, .. } =
                    bench.world.admit(&frame, now_ns)
                {
                    poses += n;
                }
            }
            if rng.once_in(30) {
                bench.world.end_session(1);
            }
            bench.world.age(now_ns);
            bench.world.validate().unwrap();
            listener.follow(&bench);
            let next = bench.world.next_timeout();
            assert!(
                next.is_none_or(|t| t > now_ns),
                "a time-out that is never over"
            );
        }
    }
    // If nearly everything were refused the test would prove nothing.
    assert!(applied > 1000 && poses > 1000, "{applied} {poses}");
}
