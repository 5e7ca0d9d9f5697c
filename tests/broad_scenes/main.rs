//! Goal: every broad phase gives the exact pairs and events in every scene class of the bench: the main method with
//! every set of vector instructions and with several threads, with churn of all bodies, and in the two cases that once
//! gave duplicate pairs.
//!
//! Method: the bench's scenes at 2,000 bodies. In each frame the pair set is compared with an exact set found by
//! another method (strips and a sweep), and the events with the difference of two such sets. 2,000 frames per scene in
//! release, 60 otherwise; `SWEEPD_FRAMES` sets another number. The soak runs 20 minutes: `cargo test --release --test
//! broad_scenes -- --ignored`, `SWEEPD_SOAK_S` sets its seconds.

#![allow(
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    dead_code,
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::approx_constant,
    reason = "a test stops at the first surprise, and shares the bench's scenes"
)]

#[path = "../common/mod.rs"]
mod common;
mod crowd;
#[path = "../../benches/broad/exact.rs"]
mod exact;
mod rig;
#[path = "../../benches/broad/scenes.rs"]
mod scenes;
mod soak;
mod stand;
mod turns;

use common::Rng;
use rig::{Rig, at};
use scenes::{Box3, Kind, Scene};
use sweepd::broad::Method;
use sweepd::simd::boxes::Level;
use sweepd::wire::{BroadCause, BroadMode};

fn frames() -> usize {
    let told = std::env::var("SWEEPD_FRAMES").ok();
    let usual = if cfg!(debug_assertions) { 60 } else { 2000 };
    told.map_or(usual, |frames| frames.parse().unwrap())
}

/// Runs one scene with one rig per instruction level and one per method; every frame must be exact in all of them.
fn run(kind: Kind, bodies: usize, frames: usize) {
    let mut scene = Scene::new(kind, bodies, 11);
    let mut rigs: Vec<Rig> = Level::available()
        .into_iter()
        .map(|level| Rig::new(level, bodies, kind == Kind::Far))
        .collect();
    let others = Method::NAMED.iter().map(|(method, _)| *method);
    let others = others.filter(|method| !matches!(method, Method::Order | Method::BruteForce));
    let far = kind == Kind::Far;
    rigs.extend(others.map(|method| Rig::of(method, bodies, far)));
    rigs.push(Rig::geared("lasting", &[false], bodies, far));
    rigs.push(Rig::geared("from scratch", &[true], bodies, far));
    rigs.extend([2, 3].map(|threads| Rig::shared(threads, bodies, far)));
    let gears = &[true, false, false, true, true, true, false];
    rigs.push(Rig::geared("shifting", gears, bodies, far));
    for rig in &mut rigs {
        rig.start(&scene.boxes);
    }
    for frame in 0..frames {
        scene.step();
        let wanted = exact::pairs(&scene.boxes);
        for rig in &mut rigs {
            rig.take(&scene);
            rig.tick(&wanted, &format!("{kind:?}, frame {frame}"));
        }
        let (first, others) = rigs.split_first().unwrap();
        for other in others {
            let what = || format!("{kind:?}, frame {frame}, {}", other.name);
            assert_eq!(first.delta.began, other.delta.began, "{}", what());
            assert_eq!(first.delta.ended, other.delta.ended, "{}", what());
        }
        if frame % 200 == 7 {
            rigs.iter().for_each(Rig::validate);
        }
    }
}

macro_rules! scenes_are_exact {
    ($($test:ident $kind:ident $bodies:literal,)+) => {
        $(#[test]
        fn $test() {
            run(Kind::$kind, $bodies, frames());
        })+
    };
}

scenes_are_exact! {
    a_gas_is_exact Gas 2000,
    one_percent_moving_is_exact OnePercent 2000,
    a_pile_is_exact Pile 2000,
    mixed_sizes_are_exact Mixed 2000,
    a_galaxy_is_exact Galaxy 2000,
    teleports_are_exact Teleport 2000,
    churn_is_exact Churn 2000,
    a_sheet_is_exact Sheet 2000,
    fast_bodies_are_exact Fast 2000,
    tumbling_rods_are_exact Tumble 2000,
    velocities_drawn_anew_are_exact Redraw 2000,
    another_percent_each_frame_is_exact Rove 2000,
    a_dense_gas_is_exact Dense 1000,
    bodies_through_a_field_are_exact Field 2000,
    a_gas_far_from_the_origin_is_exact Far 2000,
}

#[test]
fn a_heap_is_exact() {
    // Every body of the heap overlaps every other, so few frames suffice.
    run(Kind::Heap, 400, frames() / 10 + 10);
}

/// Work of the main method in all frames of a scene: full sorts, boxes compared; and the number of pairs of all frames.
fn work(kind: Kind, bodies: usize, frames: usize) -> (u64, u64, u64) {
    let mut scene = Scene::new(kind, bodies, 11);
    let mut rig = Rig::new(Level::best(), bodies, false);
    rig.start(&scene.boxes);
    let mut done = (0, 0, 0);
    for frame in 0..frames {
        scene.step();
        let wanted = exact::pairs(&scene.boxes);
        rig.take(&scene);
        rig.tick(&wanted, &format!("{kind:?}, frame {frame}"));
        done.0 += rig.work().rebuilds;
        done.1 += rig.work().tests;
        done.2 += wanted.len() as u64;
    }
    done
}

#[test]
fn a_gas_is_put_in_order_a_little_in_each_tick_and_not_sorted_anew() {
    let (sorts, ..) = work(Kind::Gas, 2000, 300);
    assert!(sorts <= 1, "{sorts} sorts in 300 frames");
}

#[test]
fn bug_bodies_that_travel_among_others_at_rest_stretch_no_blocks() {
    let mut scene = Scene::new(Kind::Field, 8000, 11);
    let mut rig = Rig::new(Level::best(), 8000, false);
    rig.start(&scene.boxes);
    let mut tests = [0; 10];
    for frame in 0..400 {
        scene.step();
        let wanted = exact::pairs(&scene.boxes);
        rig.take(&scene);
        rig.tick(&wanted, &format!("frame {frame}"));
        assert!(frame == 0 || rig.work().rebuilds == 0, "frame {frame}");
        tests[frame / 40] += rig.work().tests;
    }
    let first = tests[0];
    assert!(tests.iter().all(|tests| tests * 3 < first * 4), "{tests:?}");
}

#[test]
fn pairs_that_are_sure_are_not_compared() {
    let (_, tests, pairs) = work(Kind::Heap, 500, 60);
    assert!(tests * 4 < pairs, "{tests} comparisons for {pairs} pairs");
}

#[test]
fn blocks_stay_compact_while_bodies_come_and_go_and_all_are_sorted_over_some_ticks() {
    let mut scene = Scene::new(Kind::Churn, 2000, 11);
    let mut rig = Rig::geared("from scratch", &[true], 2000, false);
    rig.start(&scene.boxes);
    let laid = rig.work().tests;
    let (mut sum, frames) = (0, 150);
    for frame in 0..frames {
        scene.step();
        rig.take(&scene);
        rig.tick(&exact::pairs(&scene.boxes), &format!("frame {frame}"));
        sum += rig.work().tests;
    }
    rig.validate();
    assert!(
        sum * 2 < laid * frames * 3,
        "{sum} comparisons in {frames} frames; {laid} in the first"
    );
}

#[test]
fn bodies_that_come_or_leave_alone_or_have_no_end_while_all_are_sorted_are_exact() {
    const BODIES: usize = 1500;
    let mut scene = Scene::new(Kind::Gas, BODIES, 11);
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&scene.boxes);
    let mut rng = Rng::new(5);
    let mut inside = [true; BODIES];
    // More frames than one coordinate frame of the space-filling curve is used for.
    for frame in 0..400 {
        scene.step();
        let mut boxes = scene.boxes.clone();
        // Two bodies are unbounded for some frames: the box of one grows without limit, the other leaves and comes back
        // unbounded.
        let endless = match frame % 10 {
            0..=2 => Some(0_u32),
            4..=6 => Some(1),
            _ => None,
        };
        if let Some(body) = endless {
            boxes[body as usize] = [[f32::NEG_INFINITY; 3], [f32::INFINITY; 3]];
        }
        let (mut left, mut came) = (Vec::new(), Vec::new());
        if matches!(frame % 10, 4 | 7) {
            left.push(1);
            came.push(1);
        }
        // Sometimes so many bodies change that the sort in progress is abandoned.
        let changes = if frame % 50 == 30 { 300 } else { 4 };
        for _ in 0..changes {
            let body = 2 + rng.below(BODIES - 2);
            let slot = body as u32;
            if !left.contains(&slot) && !came.contains(&slot) {
                let list = if inside[body] { &mut left } else { &mut came };
                list.push(slot);
                inside[body] = !inside[body];
            }
        }
        let stays = |body: &u32| inside[*body as usize] && !came.contains(body);
        let moved: Vec<u32> = scene.moved.iter().copied().filter(stays).collect();
        rig.change(&boxes, &moved, &left, &came);
        // For the exact set, absent bodies stand far away, each alone; the unbounded one overlaps all others.
        let mut seen = boxes;
        let alone = |body: &usize| !inside[*body] || endless == Some(*body as u32);
        for body in (0..BODIES).filter(alone) {
            seen[body] = at([1e6 + body as f32 * 4.0, 0.0, 0.0], 0.5);
        }
        let mut wanted = exact::pairs(&seen);
        if let Some(body) = endless {
            let others =
                (0..BODIES as u32).filter(|other| inside[*other as usize] && *other != body);
            wanted.extend(others.map(|other| (body.min(other), body.max(other))));
            wanted.sort_unstable();
        }
        rig.tick(&wanted, &format!("frame {frame}"));
        rig.validate();
    }
}

#[test]
fn candidates_are_tried_again_when_bodies_have_calmed_and_not_before() {
    let mut scene = Scene::new(Kind::Gas, 1000, 11);
    let mut rig = Rig::new(Level::best(), 1000, false);
    rig.start(&scene.boxes);
    // Returns the number of frames that were worked from scratch.
    let frames = |rig: &mut Rig, scene: &mut Scene, frames: usize, move_on: bool| {
        let mut scratch = 0;
        for frame in 0..frames {
            if move_on {
                scene.step();
            }
            rig.take(scene);
            rig.tick(&exact::pairs(&scene.boxes), &format!("frame {frame}"));
            // A list kept for a spell of ticks is compared like candidates (same mode, cause `Spell`), but counts as
            // from scratch here.
            let way = rig.work().way;
            scratch += usize::from(way.is_some_and(|(mode, cause)| {
                mode == BroadMode::Scratch || cause == BroadCause::Spell
            }));
        }
        scratch
    };
    frames(&mut rig, &mut scene, 100, true);
    assert_eq!(frames(&mut rig, &mut scene, 800, true), 800, "no trial");
    // All bodies are reported as moved, but none has changed its position.
    frames(&mut rig, &mut scene, 256, false);
    assert_eq!(frames(&mut rig, &mut scene, 100, false), 0, "candidates");
}

#[test]
fn two_bodies_that_leave_their_fat_boxes_in_one_tick_are_one_pair() {
    let mut rig = Rig::new(Level::best(), 40, false);
    let mut boxes: Vec<_> = (0..40)
        .map(|i| at([i as f32 * 3.0, 0.0, 0.0], 0.5))
        .collect();
    rig.start(&boxes);
    let mut rng = Rng::new(5);
    for tick in 0..400 {
        // Two bodies jump to one place, near or far; later jumps separate them again.
        let (a, b) = (rng.below(40), rng.below(40));
        let place = [rng.between(0.0, 120.0) as f32, 0.0, 0.0];
        boxes[a] = at(place, 0.5);
        boxes[b] = at(place.map(|x| x + 0.3), 0.5);
        rig.put(&boxes, &[a as u32, b as u32], &[]);
        rig.tick(&exact::pairs(&boxes), &format!("tick {tick}"));
        rig.validate();
    }
}

#[test]
fn a_slot_that_another_body_takes_in_the_same_tick_keeps_no_pair() {
    let mut rig = Rig::new(Level::best(), 60, false);
    let mut rng = Rng::new(6);
    let mut place = || std::array::from_fn(|_| rng.between(0.0, 4.0) as f32);
    let mut boxes: Vec<_> = (0..60).map(|_| at(place(), 0.5)).collect();
    rig.start(&boxes);
    for tick in 0..400_u32 {
        // Four bodies leave, and others take their slots and thereby their lanes; two of these at the same place.
        let churned: Vec<u32> = (0..4).map(|k| (tick * 7 + k * 13) % 60).collect();
        for (k, body) in churned.iter().enumerate() {
            if k > 1 {
                boxes[*body as usize] = at(place(), 0.5);
            }
        }
        rig.put(&boxes, &[], &churned);
        rig.tick(&exact::pairs(&boxes), &format!("tick {tick}"));
        rig.validate();
    }
}

#[test]
fn bodies_that_crowd_to_one_place_while_all_are_sorted_lose_no_event() {
    const BODIES: usize = 2000;
    let mut scene = Scene::new(Kind::Gas, BODIES, 12);
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&scene.boxes);
    let mut rng = Rng::new(9);
    let mut place = [0.0; 3];
    for frame in 0..900 {
        scene.step();
        let mut boxes = scene.boxes.clone();
        // In half of the spells an increasing number of bodies goes to one place, until its lanes are full.
        let crowd = [0, 0, 0, 0, 0, 45, 45, 45, 45, 45][frame / 3 % 10];
        if frame % 30 == 15 {
            place = std::array::from_fn(|_| rng.between(2.0, 8.0) as f32);
        }
        for k in 0..crowd * (frame % 15 + 1) / 2 {
            let body = (k * 7 + frame / 30) % BODIES;
            boxes[body] = at(place.map(|x| x + (k % 9) as f32 * 0.01), 0.05);
        }
        rig.put(&boxes, &scene.moved, &[]);
        rig.tick(&exact::pairs(&boxes), &format!("frame {frame}"));
    }
}

#[test]
fn a_crowd_that_drifts_away_is_listed_and_measured_from_elsewhere_in_time() {
    const BODIES: usize = 800;
    let mut scene = Scene::new(Kind::Gas, BODIES, 13);
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&scene.boxes);
    let mut listed = 0;
    for frame in 0..2400 {
        scene.step();
        // The distance grows to many times the width of the crowd.
        let by = 0.04 * frame as f32;
        let gone = |one: &Box3| one.map(|[x, y, z]| [x + by, y, z - 2.0 * by]);
        let boxes: Vec<Box3> = scene.boxes.iter().map(gone).collect();
        rig.put(&boxes, &scene.moved, &[]);
        rig.tick(&exact::pairs(&boxes), &format!("frame {frame}"));
        if frame % 10 == 0 {
            rig.validate();
        }
        listed += usize::from(rig.work().way.is_some_and(|way| way.0 == BroadMode::List));
    }
    assert!(listed > 1200, "{listed}");
}

#[test]
fn bodies_that_wander_are_listed_and_so_are_those_that_go_on_again() {
    const BODIES: usize = 700;
    let mut ways = [Kind::Redraw, Kind::Gas].map(|kind| Scene::new(kind, BODIES, 16));
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&ways[0].boxes);
    let mut listed = [0; 2];
    for frame in 0..1600 {
        // From one kind of motion to the other and back; all bodies change position then.
        let way = frame / 400 % 2;
        let scene = &mut ways[way];
        scene.step();
        rig.put(&scene.boxes, &scene.moved, &[]);
        rig.tick(&exact::pairs(&scene.boxes), &format!("frame {frame}"));
        if frame % 10 == 0 {
            rig.validate();
        }
        listed[way] += usize::from(rig.work().way.is_some_and(|way| way.0 == BroadMode::List));
        // The method knows before the first list that bodies wander: none of its lists fails.
        assert!(frame != 40 || listed[0] > 30, "{listed:?}");
    }
    assert!(listed.iter().all(|ticks| *ticks > 400), "{listed:?}");
}

/// Each bouncing body left its swept box some ticks after it turned back: 34 strays per tick, 2 of them at the rim.
#[test]
fn bug_who_bounces_in_a_layer_strayed() {
    const BODIES: usize = 2000;
    let mut scene = Scene::new(Kind::Sheet, BODIES, 17);
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&scene.boxes);
    let (mut strays, mut listed) = (0, 0);
    for frame in 0..400 {
        scene.step();
        rig.put(&scene.boxes, &scene.moved, &[]);
        rig.tick(&exact::pairs(&scene.boxes), &format!("frame {frame}"));
        if rig.work().way.is_some_and(|way| way.0 == BroadMode::List) {
            listed += 1;
            strays += rig.work().renewed;
        }
    }
    println!("{strays} strays in {listed} ticks");
    assert!(
        listed > 300 && strays < 6 * listed,
        "{strays} strays in {listed} ticks"
    );
}

#[test]
fn bodies_that_swerve_jump_come_and_leave_while_the_next_list_is_made_are_exact() {
    const BODIES: usize = 700;
    let mut scene = Scene::new(Kind::Gas, BODIES, 14);
    let mut rig = Rig::geared("from scratch", &[true], BODIES, false);
    rig.start(&scene.boxes);
    let mut rng = Rng::new(15);
    let mut off = vec![[0.0_f32; 3]; BODIES];
    let mut listed = 0;
    for frame in 0..1200 {
        scene.step();
        // Spells in which a few bodies, the same ones again and again, move off by a little or by far.
        for k in 0..[0, 6, 1, 20][frame / 40 % 4] {
            let body = (frame / 3 * 5 + k * 37) % BODIES;
            let far = if rng.below(3) == 0 { 3.0 } else { 0.3 };
            off[body] = std::array::from_fn(|_| rng.between(-far, far) as f32);
        }
        let churned: Vec<u32> = (0..rng.below(4))
            .map(|k| ((frame * 11 + k * 101) % BODIES) as u32)
            .collect();
        let gone = |(one, off): (&Box3, &[f32; 3])| {
            one.map(|corner| std::array::from_fn(|k| corner[k] + off[k]))
        };
        let boxes: Vec<Box3> = scene.boxes.iter().zip(&off).map(gone).collect();
        let churned_not = |body: &u32| !churned.contains(body);
        let moved: Vec<u32> = (0..BODIES as u32).filter(churned_not).collect();
        rig.put(&boxes, &moved, &churned);
        rig.tick(&exact::pairs(&boxes), &format!("frame {frame}"));
        rig.validate();
        listed += usize::from(rig.work().way.is_some_and(|way| way.0 == BroadMode::List));
    }
    assert!(listed > 600, "{listed}");
}

#[test]
fn bodies_that_jump_together_keep_their_pair_without_an_event() {
    let mut rig = Rig::geared("from scratch", &[true], 900, false);
    let mut rng = Rng::new(8);
    let mut place = || std::array::from_fn(|_| rng.between(0.0, 12.0) as f32);
    // Groups of three overlapping bodies that stay together.
    let three =
        |place: [f32; 3], k: usize| at([place[0] + 0.2 * k as f32, place[1], place[2]], 0.4);
    let mut places: Vec<[f32; 3]> = (0..300).map(|_| place()).collect();
    let all = |places: &[[f32; 3]]| -> Vec<_> {
        let threes = places
            .iter()
            .flat_map(|at| (0..3).map(move |k| three(*at, k)));
        threes.collect()
    };
    rig.start(&all(&places));
    for tick in 0..300_u32 {
        // Some groups jump, into lanes that others have just left; in some of them one body leaves and another comes.
        let jump: Vec<u32> = (0..1 + tick % 25)
            .map(|k| (tick * 31 + k * 7) % 300)
            .collect();
        for one in &jump {
            places[*one as usize] = place();
        }
        let churned: Vec<u32> = jump.iter().step_by(9).map(|one| one * 3 + 1).collect();
        let moved: Vec<u32> = (0..900).filter(|body| !churned.contains(body)).collect();
        let now = all(&places);
        rig.put(&now, &moved, &churned);
        rig.tick(&exact::pairs(&now), &format!("tick {tick}"));
        rig.validate();
    }
}
