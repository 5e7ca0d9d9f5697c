//! Law 8: work that a scene and its readers do not need is omitted, and the plan reports this, also after changes.

use crate::rig::{ALL, Rig, ball, body, scene};
use sweepd::wire::Demand;

/// The choice for `part` in the plan, and its reason.
fn chosen(rig: &Rig, part: &str) -> Option<String> {
    let mut choices = rig.engine.plan().choices.iter();
    choices
        .find(|choice| choice.part == part)
        .map(|choice| format!("{} ({})", choice.chosen, choice.why))
}

fn is_left_out(rig: &Rig, what: &str) -> bool {
    let mut left_out = rig.engine.plan().left_out.iter();
    left_out.any(|part| part.part.starts_with(what))
}

#[test]
fn the_plan_says_what_is_computed_for_readers_when_they_come_and_a_while_after_they_go() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 9.0, "")]));
    rig.demand = Demand::default();
    rig.send(ALL);
    rig.engine.note_sent(0);
    assert!(is_left_out(&rig, "contacts") && is_left_out(&rig, "regions"));
    assert!(is_left_out(&rig, "bounds") && chosen(&rig, "contacts").is_none());
    rig.send(ALL);
    assert!(!rig.out.plan_changed);
    rig.demand.contacts = true;
    rig.send(ALL);
    assert!(rig.out.plan_changed && !is_left_out(&rig, "contacts"));
    assert!(chosen(&rig, "contacts").unwrap().contains("reads"));
    assert!(!is_left_out(&rig, "bounds") && is_left_out(&rig, "regions"));
    // A reader that is gone for a few ticks does not change the plan.
    rig.engine.note_sent(0);
    rig.demand.contacts = false;
    (0..10).for_each(|_| assert!(!rig.send(ALL).plan_changed));
    rig.demand.contacts = true;
    assert!(!rig.send(ALL).plan_changed);
    rig.demand.contacts = false;
    let told = (1..=100).find(|_| rig.send(ALL).plan_changed);
    assert!(told.is_some_and(|ticks| ticks > 10), "{told:?}");
    assert!(is_left_out(&rig, "contacts"));
}

#[test]
fn the_plan_tells_the_axis_that_sweep_and_prune_leaves_out_on_a_floor() {
    // 12 by 12 boxes of side 0.9 m next to each other at one height: all of them overlap along z.
    let shape = "{ type = \"box\", half_extents = [0.45, 0.45, 0.45] }";
    let boxes: Vec<String> = (0..144_u64)
        .map(|at| body(at + 1, [(at % 12) as f64, (at / 12) as f64, 0.0], shape, ""))
        .collect();
    let head = "[run]\nbroad_phase = \"sap\"\n";
    let mut rig = Rig::new(&scene(head, &boxes));
    rig.checked = false;
    assert!(chosen(&rig, "axes").unwrap().starts_with("x, y and z"));
    let mut told_at = None;
    for tick in 0..200_u64 {
        for at in 0..144_u64 {
            // Each box moves up and down with its own phase, so that along z a few ends pass each other in each tick.
            let phase = (at * 7 + tick) % 200;
            rig.row(at + 1).position[2] = phase.abs_diff(100) as f64 * 1e-3;
        }
        if rig.send(ALL).plan_changed && tick > 0 && told_at.is_none() {
            told_at = Some(tick);
        }
        rig.engine.note_sent(0);
    }
    let axes = chosen(&rig, "axes").unwrap();
    assert!(told_at.is_some() && axes.starts_with("x and y"), "{axes}");
}

#[test]
fn the_plan_tells_how_the_sizes_spread_and_whether_rules_decide() {
    let pebble = "{ type = \"sphere\", radius = 0.005 }";
    let mut bodies = vec![ball(1, 0.0, ""), body(2, [3.0, 0.0, 0.0], pebble, "")];
    let rig = Rig::new(&scene("", &bodies));
    let broad = chosen(&rig, "broad phase").unwrap();
    assert!(broad.contains("0.01 to 2 m across"), "{broad}");
    assert_eq!(rig.engine.plan().size_m, Some([0.01, 2.0]));
    assert!(is_left_out(&rig, "filters") && chosen(&rig, "filters").is_none());
    let rule = "[[rule]]\naction = \"ignore\"\na = \"b1\"\nb = \"b2\"\nreason = \"test\"\n";
    bodies[1].push_str(&format!("\n{rule}"));
    let rig = Rig::new(&scene("", &bodies));
    assert!(!is_left_out(&rig, "filters"));
    let filters = chosen(&rig, "filters").unwrap();
    assert!(
        filters.contains("rules: 1; pairs ignored by them, as neighbours or in groups: 1"),
        "{filters}"
    );
}
