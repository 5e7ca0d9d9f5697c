//! Laws 3.1, generations, and 3.10, filters and attached bodies.

use std::path::Path;
use std::sync::Arc;

use sweepd::math::Pose;
use sweepd::scene::{PairAction, Scene};
use sweepd::wire::{BodyStatus, EndCause, Event, State, Verdict, region_flags};
use sweepd::world::{Edit, Put};

use crate::rig::{ALL, FRAME_NS, Rig, ball, has, rule, scene};

/// The edit that puts the last body of `bodies`.
fn put(bodies: &[String]) -> Edit {
    let scene = Scene::parse(&scene("", bodies), "scene.toml", Path::new(".")).unwrap();
    let shapes = sweepd::daemon::build_shapes(&scene).unwrap().bodies;
    Edit::Put(Put {
        body: Arc::new(scene.bodies.last().unwrap().clone()),
        shapes: shapes.last().unwrap().clone(),
    })
}

#[test]
fn law_3_1_remove_then_put_of_one_name_ends_and_begins_unknown() {
    let bodies = [ball(1, 0.0, ""), ball(2, 1.5, "")];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    rig.edit(
        vec![
            Edit::Remove {
                name: "b2".to_owned(),
            },
            put(&bodies),
        ],
        ALL,
    );
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End));
    assert_eq!(row.end_cause, EndCause::Removed.code());
    let shown = rig.out.bodies[1];
    assert_eq!(shown.status, BodyStatus::NotReceived.code());
    assert!(shown.generation > rig.out.bodies[0].generation);
    assert_eq!(rig.state(), State::Unknown);
    rig.send(ALL);
    assert!(has(rig.pair(1, 2).unwrap(), Event::Begin));
    assert_eq!(rig.state(), State::Colliding);
}

#[test]
fn law_3_1_another_shape_of_the_same_name_gets_no_certificate_of_the_old_one() {
    let small = "{ type = \"sphere\", radius = 0.1 }";
    let at = [2.5, 0.0, 0.0];
    let first = crate::rig::body(2, at, small, "");
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), first]));
    rig.row(1).position = [1.4, 0.0, 0.0];
    rig.row(1).position[1] = 0.9;
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    let large = crate::rig::body(2, at, "{ type = \"sphere\", radius = 1.5 }", "");
    rig.edit(vec![put(&[ball(1, 0.0, ""), large])], ALL);
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
}

#[test]
fn law_3_10_two_bodies_at_rest_are_found_when_an_edit_enables_their_pair() {
    let enables: [(Vec<Edit>, Vec<Edit>); 3] = [
        (
            vec![rule(PairAction::Ignore, "b1", "b2", None)],
            vec![Edit::DropRules {
                a: "b1".to_owned(),
                b: "b2".to_owned(),
            }],
        ),
        (
            vec![rule(PairAction::Ignore, "b*", "b*", None)],
            vec![rule(PairAction::Check, "b2", "b1", None)],
        ),
        (
            vec![Edit::Filter {
                name: "b1".to_owned(),
                group: None,
                mask: Some(2),
            }],
            vec![Edit::Filter {
                name: "b2".to_owned(),
                group: Some(2),
                mask: None,
            }],
        ),
    ];
    for crowd in [0, 60] {
        for (off, on) in &enables {
            let mut bodies = vec![ball(1, 0.0, ""), ball(2, 1.5, "")];
            bodies.extend((3..3 + crowd).map(|id| ball(id, 10.0 * id as f64, "")));
            let mut rig = Rig::new(&scene("", &bodies));
            rig.send(ALL);
            assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
            rig.edit(off.clone(), ALL);
            assert_eq!(rig.pair(1, 2).unwrap().end_cause, EndCause::Filtered.code());
            rig.send(ALL);
            assert!(rig.pair(1, 2).is_none());
            rig.edit(on.clone(), ALL);
            assert_eq!(rig.verdict(1, 2), Verdict::Colliding, "{on:?}");
        }
    }
}

#[test]
fn law_3_10_the_tick_counts_ignored_pairs() {
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, ""), ball(2, 1.5, ""), ball(3, 3.0, "")],
    ));
    rig.edit(vec![rule(PairAction::Ignore, "b1", "b*", None)], ALL);
    assert_eq!(rig.out.tick.ignored, 2);
}

#[test]
fn law_3_10_an_attached_body_moves_and_is_lost_with_its_parent() {
    let bodies = [ball(1, 0.0, ""), ball(2, 50.0, ""), ball(3, 100.0, "")];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    let attach = Edit::Attach {
        name: "b2".to_owned(),
        to: Some("b1".to_owned()),
        pose: Some(Pose::translation(0.0, 5.0, 0.0)),
    };
    rig.edit(vec![attach], ALL);
    rig.rows.retain(|row| row.body != 2);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
    // The parent moves its child into the third body.
    rig.row(1).position = [100.0, -4.0, 0.0];
    rig.send(ALL);
    assert_eq!(rig.verdict(2, 3), Verdict::Colliding);
    rig.row(1).position = [f64::INFINITY; 3];
    rig.send(ALL);
    assert_eq!(rig.verdict(2, 3), Verdict::Possible);
    assert_eq!(rig.out.bodies[1].status, BodyStatus::Rejected.code());
    rig.row(1).position = [0.0; 3];
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn law_4_7_contacts_are_computed_only_for_listeners_and_owed_to_those_who_come_later() {
    let shape = "{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }";
    let bodies = [
        crate::rig::body(1, [0.0; 3], shape, ""),
        crate::rig::body(2, [0.9, 0.0, 0.0], shape, ""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    (rig.demand.contacts, rig.demand.regions) = (false, false);
    rig.demand.contact_changes = false;
    rig.send(ALL);
    assert_eq!(rig.engine.counters().manifolds, 0);
    rig.send(ALL);
    assert_eq!(rig.engine.counters().manifolds, 0);
    assert_eq!((rig.out.contacts.len(), rig.out.regions.len()), (0, 0));
    // Regions are computed from contacts, so that contacts are found even if only regions are in demand.
    rig.demand.regions = true;
    rig.idle(FRAME_NS, ALL);
    assert_eq!(
        (rig.out.contacts.len(), rig.out.regions.is_empty()),
        (0, false)
    );
    assert_eq!(rig.out.regions[0].flags, region_flags::COMPLETE);
    rig.demand.contacts = true;
    rig.idle(FRAME_NS, ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    assert_eq!(rig.out.contacts.len(), 4, "bodies at rest deliver theirs");
    let ids: Vec<u64> = rig.out.contacts.iter().map(|row| row.id).collect();
    rig.idle(FRAME_NS, ALL);
    assert_eq!(
        rig.engine.counters().queries,
        0,
        "nothing moved, nothing is asked again"
    );
    assert_eq!(
        rig.out
            .contacts
            .iter()
            .map(|row| row.id)
            .collect::<Vec<_>>(),
        ids
    );
}

#[test]
fn law_4_7_without_listeners_only_verdicts_are_worked_for() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 1.0, "")]));
    rig.demand = sweepd::wire::Demand::default();
    rig.send(ALL);
    assert_eq!(rig.state(), State::Colliding);
    let mut queries = 0;
    for k in 0..100 {
        rig.move_x(2, 1.0 + 0.001 * f64::from(k));
        rig.send(ALL);
        assert_eq!(rig.state(), State::Colliding);
        queries += rig.engine.counters().queries;
        assert!(
            rig.out.pairs.is_empty() && rig.out.contacts.is_empty() && rig.out.bodies.is_empty()
        );
    }
    assert!(
        queries < 10,
        "{queries} queries for a collision 1 m deep that stays"
    );
}

fn margin(name: Option<&str>, report_within_m: Option<f64>) -> Edit {
    Edit::Margin {
        name: name.map(ToOwned::to_owned),
        report_within_m,
    }
}

/// The verdict of bodies 1 and 2, or `None`: no row, since they are farther apart than any margin.
fn told(rig: &Rig) -> Option<Verdict> {
    rig.pair(1, 2).map(|_| rig.verdict(1, 2))
}

#[test]
fn law_3_3_a_margin_set_at_run_time_is_that_of_a_body_put_with_it() {
    // A gap of 0.5 m, in a world of two bodies and in one large enough for a broad phase with structures.
    for crowd in [0, 60] {
        let mut bodies = vec![ball(1, 0.0, ""), ball(2, 2.5, "report_within_m = 0.1\n")];
        bodies.extend((3..3 + crowd).map(|id| ball(id, 10.0 * id as f64, "")));
        let mut rig = Rig::new(&scene("", &bodies));
        rig.send(ALL);
        assert_eq!(told(&rig), None);
        rig.edit(vec![margin(Some("b1"), Some(0.6))], ALL);
        assert_eq!(told(&rig), Some(Verdict::Near));
        // This also holds at rest: an edit takes effect without a new pose.
        let frames: [(Edit, Option<Verdict>); 5] = [
            (margin(Some("b1"), Some(0.4)), None),
            (margin(None, Some(0.7)), Some(Verdict::Near)),
            (margin(None, None), None),
            (margin(Some("b2"), Some(5.0)), Some(Verdict::Near)),
            (margin(Some("b2"), None), None),
        ];
        for (edit, wanted) in frames {
            rig.edit(vec![edit.clone()], ALL);
            rig.send(ALL);
            let now = told(&rig).filter(|verdict| *verdict != Verdict::Apart);
            assert_eq!(now, wanted, "{edit:?}");
        }
        let before = rig.out.tick.header.scene_rev;
        rig.edit(vec![margin(None, None)], ALL);
        assert_eq!(rig.out.tick.header.scene_rev, before, "nothing changed");
    }
}

/// A body that does not move by itself.
fn fixed(id: u64, at: [f64; 3], shape: &str, more: &str) -> String {
    crate::rig::body(id, at, shape, more).replace("moves = true", "moves = false")
}

const BASE: &str = "{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }";
const FLOOR: &str = "{ type = \"half_space\", normal = [0, 0, 1], offset = 0.0 }";

/// Its certificates assumed that it never moves.
#[test]
fn bug_a_half_space_that_an_edit_moves_is_asked_anew() {
    let floor = fixed(3, [-50.0, 0.0, 0.0], FLOOR, "attached_to = \"b2\"");
    let at = |z| {
        let base = fixed(2, [50.0, 0.0, z], BASE, "");
        [ball(1, 0.0, ""), floor.clone(), base]
    };
    for by_put in [true, false] {
        let mut rig = Rig::new(&scene("", &at(0.0)));
        rig.row(1).position[2] = 2.0;
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 3), Verdict::Apart);
        let edit = if by_put {
            put(&at(2.0))
        } else {
            Edit::Attach {
                name: "b3".to_owned(),
                to: Some("b2".to_owned()),
                pose: Some(Pose::translation(-50.0, 0.0, 2.0)),
            }
        };
        rig.edit(vec![edit], ALL);
        assert_eq!(rig.verdict(1, 3), Verdict::Colliding, "by put: {by_put}");
        assert_eq!(rig.state(), State::Colliding);
    }
}

/// While it was attached to a moving body, no length bounded its motion.
#[test]
fn bug_a_half_space_that_was_let_go_has_no_certificate_from_when_it_moved() {
    let floor = fixed(3, [-50.0, 0.0, 0.0], FLOOR, "attached_to = \"b2\"");
    let bodies = [ball(1, 0.0, ""), ball(2, 50.0, ""), floor];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.row(1).position[2] = 2.0;
    rig.row(2).position[2] = 0.0;
    rig.send(ALL);
    rig.row(2).position[2] = 0.4;
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 3), Verdict::Apart);
    let detach = Edit::Attach {
        name: "b3".to_owned(),
        to: None,
        pose: None,
    };
    rig.edit(vec![detach], ALL);
    assert_eq!(rig.verdict(1, 3), Verdict::Apart);
    rig.row(1).position[2] = 1.3;
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 3), Verdict::Colliding, "by 0.1 m");
}

/// A few boxes are compared pair by pair. The plan keeps this for slightly more bodies, and returns to it once there
/// are few again.
#[test]
fn the_plan_follows_the_scene_and_says_so_in_the_tick_of_the_edit() {
    let bodies: Vec<String> = (1..=33).map(|id| ball(id, 10.0 * id as f64, "")).collect();
    let mut rig = Rig::new(&scene("", &bodies[..20]));
    let method = |rig: &Rig| {
        let plan: serde_json::Value = serde_json::from_str(&rig.engine.outbox().plan).unwrap();
        let chosen = plan["choices"][0]["chosen"].as_str().unwrap().to_owned();
        (chosen.starts_with("every pair"), plan["bodies"].as_u64())
    };
    rig.send(ALL);
    assert_eq!(method(&rig), (true, Some(20)));
    let grown = |upto: usize| (21..=upto).map(|n| put(&bodies[..n])).collect::<Vec<_>>();
    rig.edit(grown(32), ALL);
    assert_eq!(method(&rig), (true, Some(32)), "it stays a little longer");
    rig.edit(vec![put(&bodies[..33])], ALL);
    assert_eq!(method(&rig), (false, Some(33)));
    let remove = |id: usize| Edit::Remove {
        name: format!("b{id}"),
    };
    rig.edit((25..=33).map(remove).collect(), ALL);
    assert_eq!(method(&rig), (true, Some(24)));
    // Pairs are found after each change of the method.
    rig.move_x(2, 11.0);
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
}

/// The plan changes the broad phase in the tick of an edit; the ends, begins and replacements of that edit must be
/// published as in any other tick.
#[test]
fn bug_the_tick_in_which_the_broad_phase_changed_forgot_what_else_had_changed() {
    // Each ball overlaps its neighbours.
    let bodies: Vec<String> = (1..=40).map(|id| ball(id, 1.5 * id as f64, "")).collect();
    let remove = |id: usize| Edit::Remove {
        name: format!("b{id}"),
    };
    let ignore = rule(PairAction::Ignore, "b3", "b4", None);
    let disable = Edit::Enable {
        name: "b6".to_owned(),
        enabled: false,
    };
    // Replaces ball 9 by a larger one, which also reaches ball 11.
    let larger = ball(9, 13.5, "").replace("radius = 1.0", "radius = 2.9");
    for method in ["auto", "order", "brute"] {
        let head = format!("[run]\nbroad_phase = \"{method}\"\n");
        let mut rig = Rig::new(&scene(&head, &bodies[..25]));
        rig.send(ALL);
        assert_eq!(rig.verdict(24, 25), Verdict::Colliding);
        let edits = vec![
            remove(25),
            ignore.clone(),
            disable.clone(),
            put(std::slice::from_ref(&larger)),
        ];
        rig.send_with(edits, ALL);
        let end = |rig: &Rig, a, b| {
            rig.pair(a, b)
                .map(|row| (has(row, Event::End), row.end_cause))
        };
        let ended = |cause: EndCause| Some((true, cause.code()));
        assert_eq!(end(&rig, 24, 25), ended(EndCause::Removed), "{method}");
        assert_eq!(end(&rig, 3, 4), ended(EndCause::Filtered), "{method}");
        assert_eq!(end(&rig, 5, 6), ended(EndCause::Disabled), "{method}");
        assert_eq!(
            rig.verdict(9, 11),
            Verdict::Colliding,
            "{method}: as it is now"
        );
        // Back to the other method: enough bodies for it, and one removal.
        let grow: Vec<Edit> = (26..=40).map(|n| put(&bodies[..n])).collect();
        rig.edit(grow.into_iter().chain([remove(1)]).collect(), ALL);
        assert_eq!(end(&rig, 1, 2), ended(EndCause::Removed), "{method}");
        rig.edit(vec![put(&bodies[..1])], ALL);
        assert_eq!(
            rig.verdict(1, 2),
            Verdict::Apart,
            "{method}: not received yet"
        );
        rig.engine.validate().unwrap();
    }
}
