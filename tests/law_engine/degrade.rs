//! Law 4.7: the order in which work is omitted if the budget does not suffice: contacts first, then bounds.

use std::collections::BTreeSet;

use sweepd::math::Vec3;
use sweepd::time::Budget;
use sweepd::wire::{Level, PairRow, Verdict, contact_flags};

use crate::oracle::meshes::{bumpy_sphere, trimesh};
use crate::rig::{ALL, Rig, body, scene};

/// Pairs far from each other, alternately in contact and near.
const PAIRS: usize = 24;

fn place(rig: &mut Rig, tick: u32) {
    for pair in 0..PAIRS {
        let distance_m = if pair % 2 == 0 { 1.9 } else { 2.2 };
        // The second balls move on circles by too little to make a verdict open.
        let (s, c) = (0.7 + 0.005 * f64::from(tick)).sin_cos();
        rig.row(2 * pair as u64 + 2).position =
            [20.0 * pair as f64 + distance_m * c, distance_m * s, 0.0];
    }
}

fn pairs(shape: &str) -> Rig {
    let bodies: Vec<String> = (0..2 * PAIRS as u64)
        .map(|k| {
            let x = 20.0 * (k / 2) as f64 + 2.5 * (k % 2) as f64;
            body(k + 1, [x, 0.0, 0.0], shape, "report_within_m = 0.5")
        })
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    place(&mut rig, 0);
    rig.send(ALL);
    rig
}

fn is_fresh(row: &PairRow) -> bool {
    row.bound_age_ticks == 0 && row.level == Level::Exact.code()
}

/// In the last tick: the pairs with bounds at its poses, and the colliding pairs with contacts at its poses.
fn fresh(rig: &Rig) -> (BTreeSet<u64>, BTreeSet<u64>) {
    let rows = &rig.out.pairs;
    assert_eq!(rows.len(), PAIRS, "each pair is told of");
    let bounds = rows
        .iter()
        .filter(|row| is_fresh(row))
        .map(|row| row.body_a);
    let colliding = |a: u64| {
        let verdict = Verdict::Colliding.code();
        (rows.iter()).any(|row| row.body_a == a && row.verdict == verdict)
    };
    let exact = (rig.out.contacts.iter()).filter(|row| row.flags & contact_flags::ESTIMATE == 0);
    let contacts = exact.map(|row| row.body_a).filter(|&a| colliding(a));
    (bounds.collect(), contacts.collect())
}

#[test]
fn law_4_7_contacts_have_what_bounds_leave_and_bounds_what_verdicts_leave() {
    let mut rig = pairs("{ type = \"sphere\", radius = 1.0 }");
    let near = PAIRS / 2;
    let mut tick = 0;
    for units in [100, 23, 5, 1, 0, 13, 30, 24, 20, 100] {
        for nth in 0..4 {
            tick += 1;
            place(&mut rig, tick);
            rig.send(Budget::units(units));
            let (bounds, contacts) = fresh(&rig);
            let told = format!("{units} units, {nth}: {bounds:?} {contacts:?}");
            assert_eq!(rig.out.tick.oldest_undecided_ticks, 0, "{told}");
            let near_bounds = bounds.iter().filter(|a| (**a / 2) % 2 == 1).count();
            assert!(contacts.is_empty() || near_bounds == near, "{told}");
            let whole = usize::try_from(units).unwrap();
            if nth > 0 && whole < PAIRS {
                // Too few units for all bounds; the narrow phase has learned this by now.
                assert!(contacts.is_empty(), "{told}");
                assert_eq!(bounds.len(), whole, "{told}");
            }
            if nth > 1 && whole >= PAIRS {
                // For a colliding pair one query yields both.
                assert_eq!((bounds.len(), contacts.len()), (PAIRS, near), "{told}");
            }
        }
    }
}

#[test]
fn law_4_7_bounds_of_all_meshes_come_before_the_contacts_of_any() {
    let ball = bumpy_sphere(16, 32, 0.01);
    let mut rig = pairs(&trimesh(&ball.scaled(Vec3::new(1.0, 1.0, 1.0)), None));
    let (mut with, mut without) = (0, 0);
    for tick in 1..60 {
        place(&mut rig, tick);
        rig.send(Budget::units(u64::from(tick % 20) * 700));
        let (bounds, contacts) = fresh(&rig);
        assert!(
            contacts.is_empty() || bounds.len() == PAIRS,
            "tick {tick}: {bounds:?} {contacts:?}"
        );
        with += usize::from(!contacts.is_empty());
        without += usize::from(contacts.len() < PAIRS / 2);
    }
    assert!(
        with > 5 && without > 20,
        "{with} with contacts, {without} not with all"
    );
}
