//! Goal: if a crowd has more pairs than the set holds, none is lost, whenever pairs are counted, and at rest the crowd
//! costs nothing.
//!
//! Method: the oracle computes when missing pairs are counted, and asserts in each tick that each pair that is not
//! stored belongs to two marked bodies. The number of pairs that a method reported is read from its work counters.

use sweepd::broad::{BroadPhase, Method};
use sweepd::ids::PairKey;
use sweepd::pairs::{PairDelta, PairSet};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use crate::world::{World, at};
use crate::{run, run_short, scatter};

#[test]
fn pairs_beyond_the_limit_are_counted_marked_and_stored_when_there_is_room() {
    let setup = |w: &mut World| scatter(w, 2.0, 0.8);
    run(900, 40, 30, setup, |w, tick| {
        // The crowd spreads and gathers, so that the limit is reached again and again.
        let factor = if tick / 25 % 2 == 0 { 1.05 } else { 0.95 };
        for i in 0..40 {
            let centre = w.bodies[i].aabb.centre() * factor;
            let half = w.bodies[i].aabb.half_extents();
            if w.rng.once_in(2) {
                w.place(i, at(centre.coords.into(), half.into()));
            }
            if w.rng.once_in(50) {
                let keeps = !w.bodies[i].keeps;
                w.set_keeps(i, keeps);
            }
            if w.rng.once_in(50) {
                w.remove(i, EndCause::Removed);
            }
            if w.rng.once_in(30) {
                w.insert(i);
            }
        }
    });
}

#[test]
fn a_crowd_far_beyond_the_limit_misses_pairs_of_marked_bodies_alone_and_all_are_found_in_the_end() {
    let setup = |w: &mut World| {
        w.bodies[0].unbounded = true;
        scatter(w, 1.0, 0.8);
    };
    let ticks = 300;
    let all = run_short(3 * ticks, 40, (60, 25), setup, |w, tick| {
        // Phases: rest, partial and complete spreading, gathering, edits, bodies that leave and come.
        let phase = tick / 15 % 8;
        let ends = tick >= ticks - 30;
        let factor = if ends {
            1.3
        } else {
            [0.93, 1.08][usize::from(matches!(phase, 2 | 6))]
        };
        let once_in = [1_000, 20, 1, 2, 1, 1_000, 1, 3][phase];
        let edits = !ends && phase != 0;
        for i in 0..40 {
            let centre = w.bodies[i].aabb.centre() * factor;
            let half = w.bodies[i].aabb.half_extents();
            let near = centre.coords.norm() > 0.3 && centre.coords.norm() < 6.0;
            if (near || ends) && w.rng.once_in(if ends { 1 } else { once_in }) {
                w.place(i, at(centre.coords.into(), half.into()));
            }
            if edits && w.rng.once_in(60) {
                w.bodies[i].mask = [u32::MAX, 1, 2][w.rng.below(3)];
                w.bodies[i].group = [1, 3][w.rng.below(2)];
                w.requery(i);
            }
            if ends || edits && w.rng.once_in(80) {
                let keeps = !ends && !w.bodies[i].keeps;
                w.set_keeps(i, keeps);
            }
            if edits && w.rng.once_in(60) {
                w.remove(i, EndCause::Removed);
            }
            if edits && w.rng.once_in(25) {
                w.insert(i);
            }
        }
        if edits && tick % 11 == 4 {
            w.forced_changed = true;
            w.forced.clear();
            for _ in 0..w.rng.below(6) {
                let (a, b) = (w.rng.below(40), w.rng.below(40));
                if a != b {
                    w.forced.push(PairKey::new(World::slot(a), World::slot(b)));
                }
            }
        }
    });
    assert!(all.waited.0 > 100 && all.waited.1 > 30, "{all:?}");
    assert_eq!(all.missing, 0, "{all:?}");
}

#[test]
fn bug_a_crowd_at_rest_beyond_the_limit_was_told_of_from_both_sides_in_every_tick() {
    let n = 60;
    let mut world = World::new(1, n);
    for i in 0..n {
        world.place(i, at([0.0; 3], [0.5; 3]));
        world.insert(i);
    }
    let all = (n * (n - 1) / 2) as u64;
    let came = std::mem::take(&mut world.changes);
    for afresh in [false, true] {
        world.changes.clone_from(&came);
        let mut broad = BroadPhase::new(Method::Order);
        broad.use_afresh(afresh);
        broad.use_recount(all / 16);
        let (mut pairs, mut delta) = (PairSet::new(100), PairDelta::default());
        let mut changes = std::mem::take(&mut world.changes);
        let mut told = Vec::new();
        for tick in 0..60 {
            broad.update(&changes, &world, &world, &mut pairs, &mut delta);
            changes.clear();
            assert_eq!((pairs.len(), pairs.missing()), (100, all - 100));
            // The first body has all of its pairs.
            assert_eq!(pairs.truncated().len(), n - 1);
            if broad.work().told > 0 {
                told.push((tick, broad.work().told));
            }
            // One body has moved, and overlaps all others as before.
            if tick == 30 {
                changes.moved.push(World::slot(7));
            }
        }
        // Pairs are reported when the bodies come, not at rest, and once after the move.
        assert_eq!(told, [(0, all), (31, all)]);
        // Most bodies leave; the room is used in the same tick.
        let mut gone = ChangeSet::default();
        gone.removed.extend((15..n).map(|i| Removed {
            slot: World::slot(i),
            cause: EndCause::Removed,
        }));
        broad.update(&gone, &world, &world, &mut pairs, &mut delta);
        assert_eq!((pairs.len(), pairs.missing()), (100, 15 * 14 / 2 - 100));
    }
}
