//! All motions mixed while bodies come and go: a short run in every test run, twenty minutes on request.

use sweepd::simd::boxes::Level;

use crate::common::Rng;
use crate::rig::{Rig, at};
use crate::{exact, frames};

#[test]
fn motions_mixed_while_bodies_come_and_go_stay_exact() {
    soak(frames() / 4, 1500, 17);
}

#[test]
#[ignore = "takes 20 minutes; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn soak_for_twenty_minutes() {
    let seconds = std::env::var("SWEEPD_SOAK_S").map_or(1200, |s| s.parse().unwrap());
    let clock = sweepd::time::SystemClock;
    let now = || sweepd::time::Clock::monotonic_ns(&clock);
    let (start, mut seed) = (now(), 0);
    while now() - start < seconds * 1_000_000_000 {
        soak(600, 100_000, seed);
        seed += 1;
    }
}

/// Bodies come up to `most` and leave again to none; the kind of motion changes every nine ticks; every tick must be
/// exact.
fn soak(ticks: usize, most: usize, seed: u64) {
    let mut rig = Rig::new(Level::best(), most, false);
    rig.use_threads(2);
    let mut rng = Rng::new(seed);
    let reach = (most as f64 / 0.7).cbrt();
    let mut boxes = vec![at([0.0; 3], 0.5); most];
    let mut inside = vec![false; most];
    let mut ways = vec![[0.0_f32; 3]; most];
    for tick in 0..ticks {
        let phase = tick * 8 / ticks;
        let growing = phase.is_multiple_of(2);
        let step = most * 10 / ticks.max(1) + 1;
        let (mut came, mut left, mut moved) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..step {
            let body = rng.below(most);
            if growing && !inside[body] {
                let place = std::array::from_fn(|_| rng.between(0.0, reach) as f32);
                boxes[body] = at(place, 0.05 * 20.0_f64.powf(rng.unit()) as f32);
                inside[body] = true;
                came.push(body as u32);
            } else if !growing && inside[body] && !came.contains(&(body as u32)) {
                inside[body] = false;
                left.push(body as u32);
            }
        }
        // Seven kinds of motion: none; a fixed few; changing few; all, steadily; all, redrawn each tick; all, far;
        // jumps.
        let way = tick / 9 % 7;
        for body in (0..most).filter(|body| inside[*body] && way != 0) {
            let mine = match way {
                1 => body.is_multiple_of(100),
                2 => body % 100 == tick % 100,
                6 => rng.once_in(20),
                _ => true,
            };
            if !mine || came.contains(&(body as u32)) {
                continue;
            }
            let far = [0.0, 0.03, 0.03, 0.03, 0.03, 0.5, reach][way];
            if way != 3 || rng.once_in(50) {
                ways[body] = std::array::from_fn(|_| rng.between(-far, far) as f32);
            }
            for corner in &mut boxes[body] {
                for (x, v) in corner.iter_mut().zip(ways[body]) {
                    *x += v;
                }
            }
            moved.push(body as u32);
        }
        if phase == 7 && tick.is_multiple_of(5) {
            // All bodies leave; the next ticks insert some again.
            left.extend(
                (0..most as u32).filter(|body| inside[*body as usize] && !came.contains(body)),
            );
            left.iter().for_each(|body| inside[*body as usize] = false);
            moved.clear();
        }
        rig.change(&boxes, &moved, &left, &came);
        // For the exact set, absent bodies stand far away, each alone.
        let mut seen = boxes.clone();
        for (body, inside) in inside.iter().enumerate() {
            if !inside {
                seen[body] = at([1e6 + body as f32 * 4.0, 0.0, 0.0], 0.5);
            }
        }
        rig.tick(&exact::pairs(&seen), &format!("seed {seed}, tick {tick}"));
        if tick.is_multiple_of(50) {
            rig.validate();
        }
    }
}
