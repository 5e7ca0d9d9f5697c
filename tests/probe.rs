#![allow(
    clippy::all,
    missing_docs,
    unreachable_pub,
    missing_debug_implementations
)]
mod common;
use common::boxes::{Boxes, Everything};
use std::time::Instant;
use sweepd::broad::{BroadPhase, Method};
use sweepd::ids::BodySlot;
use sweepd::math::{Aabb, Point, Vec3};
use sweepd::pairs::{PairDelta, PairPolicy, PairSet};
use sweepd::world::ChangeSet;

fn rss() -> (u64, u64) {
    let s = std::fs::read_to_string("/proc/self/status").unwrap();
    let get = |k: &str| {
        s.lines()
            .find(|l| l.starts_with(k))
            .unwrap()
            .split_whitespace()
            .nth(1)
            .unwrap()
            .parse::<u64>()
            .unwrap()
            / 1024
    };
    (get("VmRSS"), get("VmHWM"))
}
struct Nothing;
impl PairPolicy for Nothing {
    fn allows(&self, _: BodySlot, _: BodySlot) -> bool {
        false
    }
}

fn put(boxes: &mut Boxes, i: usize, at: [f64; 3]) {
    let p = Point::from(at);
    boxes.all[i] = Aabb {
        min: p,
        max: p + Vec3::new(1.0, 1.0, 1.0),
    };
}

fn crowd(n: usize, policy: &impl PairPolicy, ticks: usize) {
    let mut boxes = Boxes::new(n);
    for i in 0..n {
        put(&mut boxes, i, [0.0; 3]);
    }
    let mut broad = BroadPhase::new(Method::Order);
    let (mut pairs, mut delta) = (PairSet::new(1 << 22), PairDelta::default());
    let mut changes = ChangeSet::default();
    changes.inserted.extend((0..n as u32).map(BodySlot));
    let mut times = Vec::new();
    for t in 0..ticks + 4 {
        let at = Instant::now();
        delta.clear();
        broad.update(&changes, &boxes, policy, &mut pairs, &mut delta);
        times.push(at.elapsed().as_secs_f64() * 1e3);
        changes.clear();
        if t < 3 {
            changes.moved.extend((0..n as u32).map(BodySlot));
        }
    }
    let rest = &times[4..];
    let mean = rest.iter().sum::<f64>() / rest.len() as f64;
    println!(
        "crowd {n}: first {:.1} ms, then {:.1} {:.1} {:.1}; rest mean {:.3} max {:.1}; missing {} marked {}; rss {:?}",
        times[0],
        times[1],
        times[2],
        times[3],
        mean,
        rest.iter().fold(0.0f64, |a, b| a.max(*b)),
        pairs.missing(),
        pairs.truncated().len(),
        rss()
    );
}

#[test]
fn probe() {
    let what = std::env::var("PROBE").unwrap_or_default();
    let n: usize = std::env::var("N")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(2898);
    let ticks: usize = std::env::var("T")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(8);
    match what.as_str() {
        "crowd" => crowd(n, &Everything, ticks),
        "masks" => crowd(n, &Nothing, ticks),
        "ids" => {
            // A gas in which many pairs come and go, ids in order and not.
            for round in 0..3 {
                for kind in ["ascending", "one reused", "shuffled"] {
                    let mut boxes = Boxes::new(n);
                    let mut state = 1u64;
                    let mut next = || {
                        state = state
                            .wrapping_mul(6364136223846793005)
                            .wrapping_add(1442695040888963407);
                        (state >> 33) as f64 / (1u64 << 31) as f64
                    };
                    match kind {
                        "one reused" => boxes.ids[7] = n as u64 + 1,
                        "shuffled" => {
                            for i in (1..n).rev() {
                                let j = (next() * (i + 1) as f64) as usize;
                                boxes.ids.swap(i, j);
                            }
                        }
                        _ => {}
                    }
                    let side = (n as f64 / 0.8).cbrt();
                    let mut at: Vec<[f64; 3]> = (0..n)
                        .map(|_| [next() * side, next() * side, next() * side])
                        .collect();
                    let mut v: Vec<[f64; 3]> = (0..n)
                        .map(|_| {
                            [
                                (next() - 0.5) * 0.3,
                                (next() - 0.5) * 0.3,
                                (next() - 0.5) * 0.3,
                            ]
                        })
                        .collect();
                    let mut broad = BroadPhase::new(Method::Order);
                    let (mut pairs, mut delta) = (PairSet::new(1 << 22), PairDelta::default());
                    let mut changes = ChangeSet::default();
                    changes.inserted.extend((0..n as u32).map(BodySlot));
                    let (mut time, mut began, mut sum) = (0.0, 0, 0u64);
                    for t in 0..60 {
                        for i in 0..n {
                            for k in 0..3 {
                                at[i][k] += v[i][k];
                                if at[i][k] < 0.0 || at[i][k] > side {
                                    v[i][k] = -v[i][k];
                                }
                            }
                            put(&mut boxes, i, at[i]);
                        }
                        let from = Instant::now();
                        delta.clear();
                        broad.update(&changes, &boxes, &Everything, &mut pairs, &mut delta);
                        if t >= 10 {
                            time += from.elapsed().as_secs_f64() * 1e3;
                            began += delta.began.len();
                        }
                        for s in &delta.began {
                            sum = sum.wrapping_mul(31).wrapping_add(s.0 as u64);
                        }
                        for e in &delta.ended {
                            let (a, b) = e.key.slots();
                            sum = sum.wrapping_mul(31).wrapping_add(
                                (e.slot.0 as u64) << 40 ^ (a.0 as u64) << 20 ^ b.0 as u64,
                            );
                        }
                        changes.clear();
                        changes.moved.extend((0..n as u32).map(BodySlot));
                    }
                    println!(
                        "ids {n} {kind} round {round}: mean {:.3} ms, {} begin a tick, sum {sum:x}",
                        time / 50.0,
                        began / 50
                    );
                }
            }
        }
        _ => {}
    }
}
