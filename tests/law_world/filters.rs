//! Which pairs are checked (pair rules, half-spaces, report distances), compared with a twin that evaluates all rules
//! of all pairs by name.

use sweepd::ids::{BodySlot, PairKey};
use sweepd::scene::{BodySpec, PairAction, PairRule, pattern_matches};
use sweepd::world::{Because, Edit, Parts, Put, World};

use crate::support::{Bench, START_NS, cube, fixed, floor, moving, rule, scene};

/// The order of precedence in its simplest form, without any compiled structure.
fn twin(bodies: &[BodySpec], rules: &[PairRule], a: usize, b: usize) -> Because {
    let (one, other) = (&bodies[a], &bodies[b]);
    if !one.moves && !other.moves {
        return Because::CannotMove;
    }
    let sides =
        |r: &PairRule, x: &str, y: &str| pattern_matches(&r.a, x) && pattern_matches(&r.b, y);
    let matching =
        |r: &&PairRule| sides(r, &one.name, &other.name) || sides(r, &other.name, &one.name);
    if let Some(rule) = rules.iter().rfind(matching) {
        return match rule.action {
            PairAction::Check => Because::CheckRule,
            PairAction::Ignore => Because::IgnoreRule,
        };
    }
    let parent = |x: &BodySpec, y: &BodySpec| x.parent.as_deref() == Some(&*y.name);
    if parent(one, other) || parent(other, one) {
        Because::Neighbours
    } else if one.rigid_group.is_some() && one.rigid_group == other.rigid_group {
        Because::RigidGroup
    } else if one.group & other.mask != 0 && other.group & one.mask != 0 {
        Because::Masks
    } else {
        Because::MasksIgnore
    }
}

fn assert_as_twin(world: &World, bodies: &[BodySpec], rules: &[PairRule]) {
    let slot = |k: usize| world.slot_named(&bodies[k].name).unwrap();
    let mut ignored = 0;
    for a in 0..bodies.len() {
        for b in 0..a {
            let wanted = twin(bodies, rules, a, b);
            let found = world.filters().decide(slot(a), slot(b));
            assert_eq!(found, wanted, "{} {}", bodies[a].name, bodies[b].name);
            assert_eq!(found, world.filters().decide(slot(b), slot(a)));
            assert_eq!(world.filters().allows(slot(a), slot(b)), wanted.allows());
            ignored += u64::from(wanted.is_ignored());
        }
    }
    assert_eq!(world.ignored_pairs_count(), ignored);
}

/// Robots with chains of links, rigid groups, masks and walls.
fn robots() -> Vec<BodySpec> {
    let mut bodies = Vec::new();
    for robot in 0..4 {
        for link in 0..8_u32 {
            bodies.push(BodySpec {
                parent: (link > 0).then(|| format!("arm_{robot}_{}", link - 1)),
                rigid_group: (link > 5).then(|| format!("hand_{robot}")),
                group: 1 << (link % 3),
                mask: if link == 4 { 1 } else { u32::MAX },
                ..moving(&format!("arm_{robot}_{link}"), bodies.len() as u64 + 1)
            });
        }
    }
    for wall in 0..5 {
        bodies.push(fixed(&format!("wall_{wall}"), bodies.len() as u64 + 1, 9.0));
    }
    bodies
}

#[test]
fn law_3_10_rules_beat_neighbours_and_rigid_groups_which_beat_masks() {
    use PairAction::{Check, Ignore};
    let bodies = robots();
    let names: Vec<&str> = bodies.iter().map(|b| &*b.name).collect();
    let patterns = [
        "*", "arm_*", "arm_1_*", "*_3", "wall_?", "arm_?_0", "nobody*", "?",
    ];
    let mut random = 12_345_u64;
    let mut next = |end: usize| {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        usize::try_from(random >> 33).unwrap() % end
    };
    for round in 0..60 {
        let mut side = || match next(3) {
            0 => patterns[next(patterns.len())],
            _ => names[next(names.len())],
        };
        let mut rules = Vec::new();
        for at in 0..round {
            let action = if at % 2 == 0 { Ignore } else { Check };
            rules.push(rule(action, side(), side()));
        }
        let bench = Bench::with_rules(bodies.clone(), rules.clone());
        assert_as_twin(&bench.world, &bodies, &rules);
    }
}

#[test]
fn law_3_10_links_of_one_robot_collide_unless_a_rule_says_no() {
    let bodies = robots();
    let mut bench = Bench::of(bodies.clone());
    let slot = |bench: &Bench, link: usize| bench.slot(&format!("arm_0_{link}"));
    let decide = |bench: &Bench, a, b| bench.world.filters().decide(slot(bench, a), slot(bench, b));
    assert_eq!(decide(&bench, 0, 2), Because::Masks);
    assert_eq!(decide(&bench, 0, 1), Because::Neighbours);
    bench.edit(Edit::Rule(rule(PairAction::Check, "arm_0_0", "arm_0_1")));
    assert_eq!(decide(&bench, 0, 1), Because::CheckRule);
    bench.edit(Edit::Rule(rule(PairAction::Ignore, "arm_0_*", "arm_0_*")));
    assert_eq!(decide(&bench, 0, 1), Because::IgnoreRule);
    let (a, b) = (slot(&bench, 0), slot(&bench, 1));
    assert_eq!(bench.world.filters().rule_reason(a, b), Some("test"));
}

#[test]
fn law_3_10_bodies_put_and_removed_later_are_filtered_like_those_of_the_scene() {
    let bodies = robots();
    let rules = vec![
        rule(PairAction::Ignore, "arm_*", "wall_*"),
        rule(PairAction::Check, "arm_1_7", "wall_2"),
        rule(PairAction::Ignore, "arm_0_0", "arm_2_2"),
    ];
    // Every second body is put later, in another order, and some are put twice.
    let first: Vec<_> = bodies.iter().step_by(2).cloned().collect();
    let mut bench = Bench::with_rules(Vec::new(), rules.clone());
    let put = |body: &BodySpec| {
        Edit::Put(Put {
            body: std::sync::Arc::new(BodySpec {
                parent: None,
                ..body.clone()
            }),
            shapes: cube(),
        })
    };
    let mut plain = bodies.clone();
    plain.iter_mut().for_each(|b| b.parent = None);
    for body in first.iter().chain(bodies.iter().rev()) {
        bench.edit(put(body));
    }
    assert_as_twin(&bench.world, &plain, &rules);
    for body in &first {
        bench.edit(Edit::Remove {
            name: body.name.clone(),
        });
    }
    let rest: Vec<_> = plain.iter().skip(1).step_by(2).cloned().collect();
    assert_as_twin(&bench.world, &rest, &rules);
}

#[test]
fn law_3_10_thousands_of_rules_by_name_are_no_burden() {
    // As in a simulator's scene of 200 bodies: every fourth pair is excluded by name.
    let bodies: Vec<_> = (0..200)
        .map(|k| moving(&format!("geom_{k}"), k + 1))
        .collect();
    let mut rules = Vec::new();
    for a in 0..200 {
        for b in (0..a).step_by(4) {
            let (a, b) = (&bodies[a].name, &bodies[b].name);
            rules.push(rule(PairAction::Ignore, a, b));
        }
    }
    assert_eq!(rules.len(), 5050);
    let bench = Bench::with_rules(bodies.clone(), rules.clone());
    assert_eq!(bench.world.ignored_pairs_count(), 5050);
    let decided = |a: u32, b: u32| bench.world.filters().allows(BodySlot(a), BodySlot(b));
    for a in 0..200 {
        for b in 0..a {
            assert_eq!(decided(a, b), b % 4 != 0);
        }
    }
}

#[test]
fn law_3_2_two_half_spaces_are_never_paired() {
    let bodies = vec![moving("floor", 1), moving("ramp", 2), moving("a", 3)];
    let rules = vec![rule(PairAction::Check, "*", "*")];
    let shapes = vec![floor(), floor(), cube()];
    let world = World::new(&scene(bodies, rules), shapes, START_NS).unwrap();
    let slot = |name| world.slot_named(name).unwrap();
    let decide = |a, b| world.filters().decide(slot(a), slot(b));
    assert_eq!(decide("floor", "ramp"), Because::HalfSpaces);
    assert_eq!(decide("floor", "a"), Because::CheckRule);
    assert!(world.body(slot("floor")).unwrap().unbounded);
    world.validate().unwrap();
}

#[test]
fn bug_two_bodies_with_half_spaces_were_no_pair_though_they_had_other_shapes() {
    let both = || Parts::from([floor()[0].clone(), cube()[0].clone()]);
    let bodies = ["a", "b", "floor", "ramp", "c"].into_iter().zip(1..);
    let bodies: Vec<BodySpec> = bodies.map(|(name, id)| moving(name, id)).collect();
    let shapes = vec![both(), both(), floor(), floor(), cube()];
    let rules = vec![rule(PairAction::Ignore, "*", "*")];
    let world =
        |rules| World::new(&scene(bodies.clone(), rules), shapes.clone(), START_NS).unwrap();
    let free = world(Vec::new());
    let slot = |name| free.slot_named(name).unwrap();
    let decide = |a, b| free.filters().decide(slot(a), slot(b));
    assert_eq!(decide("a", "b"), Because::Masks);
    assert_eq!(decide("a", "floor"), Because::Masks);
    assert_eq!(decide("ramp", "floor"), Because::HalfSpaces);
    free.validate().unwrap();
    // All pairs are ignored, except for that of the two half-spaces, which does not count.
    assert_eq!(world(rules).ignored_pairs_count(), 9);
}

#[test]
fn law_3_4_a_rule_overrides_the_larger_of_the_two_report_distances() {
    let reports = |name, id, report_within_m| BodySpec {
        report_within_m,
        ..moving(name, id)
    };
    let bodies = vec![
        reports("a", 1, 0.1),
        reports("b", 2, 0.3),
        reports("c", 3, 0.0),
    ];
    let within = |action, a: &str, b: &str, m| PairRule {
        report_within_m: Some(m),
        ..rule(action, a, b)
    };
    let rules = vec![
        within(PairAction::Check, "a", "c", 5.0),
        within(PairAction::Check, "b", "c", 0.2),
    ];
    let mut bench = Bench::with_rules(bodies, rules);
    let (a, b, c) = (bench.slot("a"), bench.slot("b"), bench.slot("c"));
    assert_eq!(bench.world.report_within(a, b), 0.3);
    assert_eq!(bench.world.report_within(c, a), 5.0);
    assert_eq!(bench.world.report_within(b, c), 0.2);
    // Only the pair whose boxes are not enlarged far enough is forced.
    assert_eq!(bench.world.filters().forced_pairs(), [PairKey::new(a, c)]);
    // The last matching rule alone applies.
    bench.edit(Edit::Rule(rule(PairAction::Ignore, "a", "*")));
    assert!(bench.world.filters().forced_pairs().is_empty());
    assert!(bench.world.scene_changed());
}

#[test]
fn law_3_4_a_rule_of_very_many_pairs_widens_their_boxes_instead() {
    let bodies: Vec<_> = (0..100).map(|k| moving(&format!("b{k}"), k + 1)).collect();
    let far = PairRule {
        report_within_m: Some(3.0),
        ..rule(PairAction::Check, "*", "*")
    };
    let mut bench = Bench::with_rules(bodies, vec![far]);
    assert!(bench.world.filters().forced_pairs().is_empty());
    let rows = [crate::support::row(1, 0.0), crate::support::row(2, 3.9)];
    bench.send(1, "sim", 1, &rows);
    // The gap is 2.9 m and the report distance 3 m: the boxes overlap.
    let (one, other) = (bench.body("b0"), bench.body("b1"));
    assert!(one.proxy.overlaps(&other.proxy));
    bench.edit(Edit::DropRules {
        a: "*".to_owned(),
        b: "*".to_owned(),
    });
    assert!(bench.body("b0").proxy.max.x < 0.6);
    assert!(bench.world.changes().moved.contains(&bench.slot("b0")));
}
