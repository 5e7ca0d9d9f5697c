//! Scene edits and attached bodies.

use std::path::Path;
use std::sync::Arc;

use sweepd::ids::BodyId;
use sweepd::math::{Pose, Vec3};
use sweepd::scene::{BodySpec, PairAction};
use sweepd::shape::{ShapeSpec, build};
use sweepd::wire::{BodyStatus, EndCause, Reason, RejectReason};
use sweepd::world::{Edit, Parts, PlacedShape, Put};

use crate::support::{Bench, MS, TIMEOUT_NS, admitted, cube, fixed, frame, moving, row, rule};

fn put(spec: BodySpec) -> Edit {
    Edit::Put(Put {
        body: Arc::new(spec),
        shapes: cube(),
    })
}

fn named(name: &str) -> String {
    name.to_owned()
}

fn attach(name: &str, to: Option<&str>, pose: Option<Pose>) -> Edit {
    Edit::Attach {
        name: named(name),
        to: to.map(named),
        pose,
    }
}

/// Afterwards it was known at its old pose, with the age of its new parent, and the state was clear.
#[test]
fn bug_an_attachment_where_a_body_is_needs_bodies_that_are_not_too_old() {
    let hung = BodySpec {
        attached_to: Some("b".to_owned()),
        ..fixed("c", 3, 0.0)
    };
    let scene = || {
        let robot = BodySpec {
            source: Some(1),
            ..moving("b", 2)
        };
        let mut bench = Bench::of(vec![moving("a", 1), robot, hung.clone()]);
        bench.send(MS, "sim", 1, &[row(1, 0.0)]);
        bench.send(MS, "robot", 1, &[row(2, 5.0)]);
        bench
    };
    let hang = |name, to| attach(name, to, None);
    for (silent, other) in [("sim", "robot"), ("robot", "sim")] {
        let mut bench = scene();
        // It is stale by now, but no tick has reported this yet.
        bench.send(
            TIMEOUT_NS - 2 * MS,
            other,
            2,
            &[row(if other == "sim" { 1 } else { 2 }, 0.0)],
        );
        let now_ns = bench.now_ns + 2 * MS;
        bench.tick += 1;
        bench.world.begin_tick(bench.tick, now_ns);
        let text = bench.refused(&[hang("a", Some("b"))]);
        assert!(text.contains("wait for their frames"), "{silent}: {text}");
        if silent == "robot" {
            let text = bench.refused(&[hang("c", None)]);
            assert!(text.contains("it is not known where `c` is"), "{text}");
        }
        bench.wait(2 * MS);
        assert_eq!(
            bench.status(if silent == "sim" { "a" } else { "b" }),
            BodyStatus::Stale
        );
        let text = bench.refused(&[hang("a", Some("b"))]);
        assert!(text.contains("wait for their frames"), "{silent}: {text}");
        // With a given pose the body is known.
        bench.edit(attach(
            "a",
            Some("b"),
            Some(Pose::translation(1.0, 0.0, 0.0)),
        ));
        assert_eq!(bench.status("a"), bench.status("b"));
    }
    let mut bench = scene();
    bench.edit(hang("a", Some("b")));
    bench.edit(hang("c", None));
    assert_eq!(
        (bench.status("a"), bench.status("c")),
        (BodyStatus::Known, BodyStatus::Known)
    );
}

/// `a`, and the fixed body `c`, are attached to `b` of another source with a shorter timeout; `d` and a wall stand
/// apart.
fn hung_on_another_source() -> Bench {
    let robot = BodySpec {
        source: Some(1),
        ..moving("b", 2)
    };
    let hung = |name, id, spec: BodySpec| BodySpec {
        attached_to: Some(named("b")),
        name: named(name),
        id: BodyId(id),
        ..spec
    };
    let bodies = vec![
        hung("a", 1, moving("a", 1)),
        robot,
        hung("c", 3, fixed("c", 3, 2.0)),
        fixed("wall", 4, 9.0),
        moving("d", 5),
    ];
    let mut bench = Bench::of(bodies);
    bench.world.set_timeout(0, 100 * TIMEOUT_NS);
    bench.send(MS, "sim", 1, &[row(5, 20.0)]);
    bench
}

/// The timeout of its own source made it known, the velocity of its former parent was kept, and a body detached from a
/// wall had the age of the last tick.
#[test]
fn bug_what_is_let_go_is_as_well_known_as_it_was_and_no_more_driven() {
    let scene = hung_on_another_source;
    let let_go = |name| attach(name, None, None);
    let mut bench = scene();
    bench.send(MS, "robot", 1, &[row(2, 5.0)]);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    bench.edit(let_go("a"));
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    let text = bench.refused(&[attach("a", Some("wall"), None)]);
    assert!(text.contains("wait for their frames"), "{text}");
    bench.send(MS, "sim", 2, &[row(1, 5.0)]);
    bench.wait(50 * TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::Known, "by its own time-out");

    let mut bench = scene();
    let now_ns = bench.now_ns + MS;
    let mut goes = frame("robot", 1, now_ns, &[row(2, 5.0)]);
    goes.velocities = vec![[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    bench.tick_at(now_ns, &[], &[goes]);
    assert!(bench.body("a").velocity.is_some() && bench.body("c").velocity.is_some());
    bench.tick_at(now_ns, &[let_go("a"), let_go("c")], &[]);
    assert_eq!(
        (bench.body("a").velocity, bench.body("c").velocity),
        (None, None)
    );
    assert_eq!(bench.status("a"), BodyStatus::Known);
    bench.wait(10 * TIMEOUT_NS);
    assert_eq!(
        bench.status("a"),
        BodyStatus::Stale,
        "by the time-out of the one it hung on"
    );
    // The same holds for a body attached to it at that time, and a body attached elsewhere has its own timeout again.
    let up = Some(Pose::translation(0.0, 0.0, 3.0));
    let mut bench = scene();
    bench.send(MS, "robot", 1, &[row(2, 5.0)]);
    bench.edit(let_go("a"));
    bench.edit(attach("d", Some("a"), up));
    assert_eq!(bench.status("d"), BodyStatus::Known);
    bench.wait(TIMEOUT_NS);
    let known = (bench.status("a"), bench.status("d"));
    assert_eq!(known, (BodyStatus::Stale, BodyStatus::Stale));
    let mut bench = scene();
    bench.send(MS, "robot", 1, &[row(2, 5.0)]);
    bench.tick_at(bench.now_ns, &[let_go("a"), let_go("c")], &[]);
    bench.edit(attach("a", Some("d"), up));
    bench.wait(2 * TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert!(
        bench
            .world
            .next_timeout()
            .is_none_or(|next_ns| next_ns > bench.now_ns)
    );
    // A fixed body keeps its pose when it is detached.
    bench.edit(attach("d", Some("c"), up));
    assert_eq!(bench.status("d"), BodyStatus::Known);
    let now_ns = bench.now_ns + 200 * TIMEOUT_NS;
    bench.tick_at(now_ns, &[let_go("d")], &[]);
    assert_eq!(
        bench.status("d"),
        BodyStatus::Known,
        "until now beyond doubt"
    );
}

#[test]
fn law_3_1_remove_then_put_of_one_name_makes_a_new_generation_with_the_same_id() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    let slot = bench.slot("a");
    bench.edit(Edit::Remove { name: named("a") });
    let removed = bench.world.changes().removed.clone();
    assert_eq!(removed.len(), 1);
    assert_eq!(
        (removed[0].slot, removed[0].cause),
        (slot, EndCause::Removed)
    );
    assert!(bench.world.body(slot).is_none() && bench.world.names_changed());
    // Rows for it find no body; valid rows for other bodies are still applied.
    let admission = bench.send(MS, "sim", 2, &[row(1, 0.0), row(2, 5.0)]);
    assert_eq!(admission, admitted(0, 1, 1));
    bench.edit(put(moving("a", 0)));
    assert_eq!(bench.body("a").id, BodyId(1), "an id stays with its name");
    assert_eq!(bench.body("a").generation, 2);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert!(!bench.world.changes().inserted.contains(&bench.slot("a")));
}

#[test]
fn law_3_1_a_put_in_place_ends_the_old_pairs_and_begins_unknown() {
    let mut bench = Bench::of(vec![moving("a", 1), fixed("wall", 2, 9.0)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    let larger = BodySpec {
        report_within_m: 0.5,
        ..moving("a", 1)
    };
    bench.edit(put(larger));
    assert_eq!(bench.removed("a"), Some(EndCause::Removed));
    assert_eq!(bench.body("a").generation, 2);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    // A fixed body leaves and returns in one tick.
    bench.edit(put(fixed("wall", 2, 8.0)));
    assert_eq!(bench.removed("wall"), Some(EndCause::Removed));
    assert!(bench.inserted("wall"));
    assert_eq!(bench.body("wall").generation, 2);
}

#[test]
fn law_6_a_put_of_the_same_content_changes_nothing() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    let rev = bench.world.scene_rev();
    bench.edit(put(moving("a", 1)));
    bench.edit(put(moving("a", 0)));
    assert_eq!(bench.world.scene_rev(), rev);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert!(!bench.world.names_changed() && !bench.world.scene_changed());
    // After an edit in between, the same put is a change again.
    bench.edit(Edit::Filter {
        name: named("a"),
        group: Some(4),
        mask: None,
    });
    assert_eq!(bench.world.scene_rev(), rev + 1);
    bench.edit(put(moving("a", 1)));
    assert_eq!(bench.world.scene_rev(), rev + 2);
}

/// The text, box and radius are unchanged, but the content of the mesh file has changed.
#[test]
fn law_6_a_put_of_a_file_that_has_changed_takes_the_place_of_the_body() {
    let mesh = |last: [u32; 3]| {
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let spec = ShapeSpec::Trimesh {
            vertices: corners.to_vec(),
            faces: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], last],
            file: None,
            scale: None,
            solid: None,
        };
        Parts::from([PlacedShape {
            shape: build(&spec, Path::new("")).unwrap().shape,
            pose: Pose::identity(),
        }])
    };
    let put = |shapes| {
        Edit::Put(Put {
            body: Arc::new(moving("a", 1)),
            shapes,
        })
    };
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let (open, closed) = ([0, 2, 1], [0, 3, 2]);
    bench.edit(put(mesh(open)));
    let rev = bench.world.scene_rev();
    bench.edit(put(mesh(open)));
    assert_eq!(bench.world.scene_rev(), rev);
    bench.edit(put(mesh(closed)));
    assert_eq!(bench.world.scene_rev(), rev + 1);
    assert_eq!(bench.body("a").generation, 3);
}

#[test]
fn law_6_a_request_is_done_as_a_whole_or_not_at_all() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let text = bench.refused(&[
        put(moving("b", 0)),
        Edit::Remove { name: named("a") },
        Edit::Remove {
            name: named("nobody"),
        },
    ]);
    assert_eq!(
        text,
        "edit 3: there is no body `nobody`: correct the name, or put the body first"
    );
    assert!(bench.world.slot_named("b").is_none());
    let mut arm = Bench::of(vec![moving("arm/hand", 1)]);
    assert_eq!(
        arm.refused(&[Edit::Remove {
            name: named("arm/hnad")
        }]),
        "edit 1: there is no body `arm/hnad`: did you mean `arm/hand`? If not, put the body first"
    );
    // Within a request, a body put earlier exists, and a removed one does not.
    bench.tick_at(bench.now_ns, &[], &[]);
    let edits = [
        put(moving("b", 0)),
        Edit::Enable {
            name: named("b"),
            enabled: false,
        },
    ];
    assert!(bench.world.apply(&edits).unwrap().changed);
    assert_eq!(bench.status("b"), BodyStatus::Disabled);
    let edits = [
        Edit::Remove { name: named("b") },
        Edit::Remove { name: named("b") },
    ];
    assert!(bench.refused(&edits).starts_with("edit 2"));
}

#[test]
fn law_6_an_edit_that_names_nothing_says_what_to_change() {
    let mut bench = Bench::of(vec![moving("a", 1), fixed("wall", 2, 9.0)]);
    let enable = Edit::Enable {
        name: named("x"),
        enabled: true,
    };
    let filter = Edit::Filter {
        name: named("x"),
        group: None,
        mask: None,
    };
    let drop_rules = Edit::DropRules {
        a: named("a"),
        b: named("x"),
    };
    let reset = Edit::Reset {
        source: Some(named("x")),
    };
    let parent = BodySpec {
        parent: Some(named("x")),
        ..moving("b", 0)
    };
    for edit in [
        enable,
        filter,
        drop_rules,
        reset,
        Edit::Rule(rule(PairAction::Ignore, "a", "x*")),
        attach("a", Some("x"), None),
        attach("x", Some("a"), None),
        put(parent),
    ] {
        let text = bench.refused(std::slice::from_ref(&edit));
        assert!(text.contains("`x`") || text.contains("`x*`"), "{text}");
        assert!(text.contains(": ") && text.len() > 40, "{text}");
    }
}

#[test]
fn law_6_a_body_that_cannot_be_is_refused() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let lost = BodySpec {
        source: None,
        ..moving("b", 0)
    };
    let far = BodySpec {
        source: Some(9),
        ..moving("b", 0)
    };
    let nan = BodySpec {
        pose: Pose::translation(f64::NAN, 0.0, 0.0),
        ..moving("b", 0)
    };
    let speed = BodySpec {
        max_speed_mps: Some(-1.0),
        ..moving("b", 0)
    };
    let ids = [
        moving("b", 1),
        moving("a", 7),
        moving("", 0),
        moving(&"n".repeat(105), 0),
    ];
    for spec in [lost, far, nan, speed].into_iter().chain(ids) {
        let text = bench.refused(&[put(spec.clone())]);
        assert!(text.starts_with("edit 1: body `"), "{text}");
    }
    // Two new names in one request cannot have the same id.
    let text = bench.refused(&[put(moving("b", 5)), put(moving("c", 5))]);
    assert!(text.contains("belongs to `b`"), "{text}");
}

#[test]
fn law_3_5_disabling_ends_by_cause_and_enabling_brings_the_pose_that_came_meanwhile() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    let enable = |enabled| Edit::Enable {
        name: named("a"),
        enabled,
    };
    bench.edit(enable(false));
    assert_eq!(bench.removed("a"), Some(EndCause::Disabled));
    assert!(
        bench.has_reason(Reason::NoInput),
        "nothing is watched: that is not safe"
    );
    bench.send(MS, "sim", 2, &[row(1, 3.0)]);
    assert_eq!(bench.status("a"), BodyStatus::Disabled);
    bench.edit(enable(true));
    assert!(bench.inserted("a"));
    assert_eq!(bench.body("a").pose.translation.vector.x, 3.0);
    assert!(bench.body("a").proxy.min.x > 2.0);
    // Disabled for longer than its timeout, it is stale when it is enabled again.
    bench.edit(enable(false));
    bench.wait(TIMEOUT_NS);
    bench.edit(enable(true));
    assert_eq!(bench.status("a"), BodyStatus::Stale);
}

#[test]
fn law_3_5_bug_a_body_disabled_and_enabled_in_one_request_ended_and_began_its_collisions() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2), fixed("wall", 3, 0.0)]);
    bench.send(1, "sim", 1, &[row(1, 0.0), row(2, 0.0)]);
    let enable = |name: &str, enabled| Edit::Enable {
        name: named(name),
        enabled,
    };
    bench.tick += 1;
    bench.world.begin_tick(bench.tick, bench.now_ns);
    let rev = bench.world.scene_rev();
    let there_and_back = [enable("a", false), enable("b", false), enable("a", true)];
    let applied = bench.world.apply(&there_and_back).unwrap();
    assert!(applied.changed && applied.scene_rev == rev + 1);
    assert_eq!((bench.removed("a"), bench.inserted("a")), (None, false));
    assert_eq!(bench.removed("b"), Some(EndCause::Disabled));
    assert_eq!(bench.status("b"), BodyStatus::Disabled);
    // If a later edit of the request removes or replaces the body, nothing remains to be done for it.
    let gone = [
        enable("b", true),
        Edit::Remove { name: named("b") },
        enable("a", false),
        put(moving("a", 1)),
    ];
    bench.world.apply(&gone).unwrap();
    bench.world.age(bench.now_ns);
    bench.world.validate().unwrap();
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert_eq!(bench.world.slot_named("b"), None);
}

#[test]
fn law_3_5_a_reset_ends_all_pairs_and_forgets_all_poses() {
    let mut robot = moving("b", 2);
    robot.source = Some(1);
    let mut bench = Bench::of(vec![moving("a", 1), robot, fixed("wall", 3, 9.0)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.send(MS, "robot", 1, &[row(2, 5.0)]);
    bench.edit(Edit::Reset {
        source: Some(named("sim")),
    });
    assert_eq!(bench.removed("a"), Some(EndCause::Reset));
    assert_eq!((bench.removed("b"), bench.removed("wall")), (None, None));
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    bench.edit(Edit::Reset { source: None });
    assert_eq!(bench.removed("b"), Some(EndCause::Reset));
    assert_eq!(bench.removed("wall"), Some(EndCause::Reset));
    assert!(bench.inserted("wall") && !bench.inserted("b"));
    assert_eq!(bench.status("wall"), BodyStatus::Known);
}

/// Attached bodies end their pairs together with their root, even if the root returns in the same tick.
#[test]
fn law_4_2_what_hangs_on_a_body_is_forgotten_with_it() {
    let tool = BodySpec {
        attached_to: Some(named("arm")),
        pose: Pose::translation(0.0, 3.0, 0.0),
        ..moving("tool", 1)
    };
    // The tool has the lower slot, so it is processed before its parent.
    let mut bench = Bench::of(vec![tool, moving("arm", 2)]);
    bench.send(MS, "sim", 1, &[row(2, 0.0)]);
    assert_eq!(bench.status("tool"), BodyStatus::Known);
    let mut next = frame("sim", 1, bench.now_ns + MS, &[row(2, 0.0)]);
    next.header.epoch = 1;
    bench.tick_at(bench.now_ns + MS, &[], &[next]);
    for name in ["arm", "tool"] {
        assert_eq!(bench.removed(name), Some(EndCause::Reset), "{name}");
        assert!(bench.inserted(name), "{name}");
    }
    let mut next = frame("sim", 2, bench.now_ns + MS, &[row(2, 0.0)]);
    next.header.epoch = 1;
    let reset = Edit::Reset { source: None };
    bench.tick_at(bench.now_ns + MS, &[reset], &[next]);
    for name in ["arm", "tool"] {
        assert_eq!(bench.removed(name), Some(EndCause::Reset), "{name}");
        assert!(bench.inserted(name), "{name}");
    }
}

#[test]
fn law_3_10_an_edit_that_enables_a_pair_asks_for_its_bodies_again() {
    let mut bench = Bench::with_rules(
        vec![moving("a", 1), moving("b", 2), moving("c", 3)],
        vec![rule(PairAction::Ignore, "a", "b")],
    );
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 0.5), row(3, 9.0)]);
    let (a, b, c) = (bench.slot("a"), bench.slot("b"), bench.slot("c"));
    assert!(!bench.world.filters().allows(a, b));
    bench.edit(Edit::Rule(rule(PairAction::Check, "a", "b")));
    assert!(bench.world.filters().allows(a, b));
    let requery = bench.world.changes().requery.clone();
    assert!(requery.contains(&a) && requery.contains(&b) && !requery.contains(&c));
    // Both rules are dropped, in either order of sides; only the masks remain.
    bench.edit(Edit::DropRules {
        a: named("b"),
        b: named("a"),
    });
    assert_eq!(bench.world.changes().requery.len(), 2);
    bench.edit(Edit::Filter {
        name: named("c"),
        group: Some(0),
        mask: None,
    });
    assert_eq!(bench.world.changes().requery, [c]);
    assert!(!bench.world.filters().allows(a, c));
}

#[test]
fn law_3_10_an_attached_body_takes_pose_age_and_unknown_from_its_parent() {
    let held = BodySpec {
        attached_to: Some(named("gripper")),
        pose: Pose::translation(0.0, 0.0, 2.0),
        ..moving("held", 2)
    };
    // The scene may name the parent after the child.
    let mut bench = Bench::of(vec![held, moving("gripper", 1)]);
    assert_eq!(bench.status("held"), BodyStatus::NotReceived);
    // Rows for the attached body itself are refused.
    assert_eq!(
        bench.send(MS, "sim", 1, &[row(1, 3.0), row(2, 8.0)]),
        admitted(0, 1, 1)
    );
    assert_eq!(bench.rejects(RejectReason::NotSteerable), 1);
    assert_eq!(bench.status("held"), BodyStatus::Known);
    assert!(bench.inserted("held"));
    let at = bench.body("held").pose.translation.vector;
    assert_eq!(at, Vec3::new(3.0, 0.0, 2.0));
    bench.send(MS, "sim", 2, &[row(1, 4.0)]);
    assert_eq!(bench.body("held").pose.translation.vector.x, 4.0);
    assert!(bench.world.changes().moved.contains(&bench.slot("held")));
    assert!(bench.body("held").proxy.min.x > 3.0);
    // It is rejected, known and stale together with its parent.
    bench.send(MS, "sim", 3, &[row(1, f64::NAN)]);
    assert_eq!(bench.status("held"), BodyStatus::Rejected);
    bench.send(MS, "sim", 4, &[row(1, 4.0)]);
    assert_eq!(bench.status("held"), BodyStatus::Known);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("held"), BodyStatus::Stale);
    let (gripper, held) = (bench.slot("gripper"), bench.slot("held"));
    assert!(!bench.world.filters().allows(gripper, held));
}

#[test]
fn law_3_10_a_body_is_grasped_where_it_is_and_let_go_where_it_is() {
    let mut bench = Bench::of(vec![moving("gripper", 1), moving("box", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 1.0), row(2, 1.75)]);
    bench.edit(attach("box", Some("gripper"), None));
    assert_eq!(bench.world.scene_rev(), 2);
    assert_eq!(bench.body("box").pose.translation.vector.x, 1.75);
    assert!(bench.world.changes().requery.contains(&bench.slot("box")));
    bench.send(MS, "sim", 2, &[row(1, 5.0)]);
    assert_eq!(bench.body("box").pose.translation.vector.x, 5.75);
    bench.edit(attach("box", None, None));
    assert_eq!(bench.status("box"), BodyStatus::Known);
    assert_eq!(bench.body("box").pose.translation.vector.x, 5.75);
    // From now on its own source moves it, and its silence makes it stale.
    bench.send(TIMEOUT_NS, "sim", 3, &[row(1, 9.0)]);
    assert_eq!(bench.body("box").pose.translation.vector.x, 5.75);
    assert_eq!(bench.status("box"), BodyStatus::Stale);
    assert_eq!(bench.send(MS, "sim", 4, &[row(2, 2.0)]), admitted(0, 1, 0));
    assert_eq!(bench.status("box"), BodyStatus::Known);
}

#[test]
fn law_3_10_chains_hang_together_and_rings_are_refused() {
    let bodies = ["a", "b", "c", "d"]
        .iter()
        .zip(1..)
        .map(|(n, id)| moving(n, id));
    let mut bench = Bench::of(bodies.collect());
    let up = Some(Pose::translation(0.0, 0.0, 2.0));
    bench.edit(attach("b", Some("a"), up));
    bench.edit(attach("c", Some("b"), up));
    let text = bench.refused(&[attach("a", Some("c"), up)]);
    assert!(text.contains("hang on itself"), "{text}");
    let text = bench.refused(&[Edit::Remove { name: named("b") }]);
    assert!(text.contains("`c` hangs on `b`"), "{text}");
    bench.send(MS, "sim", 1, &[row(1, 1.0)]);
    assert_eq!(
        bench.body("c").pose.translation.vector,
        Vec3::new(1.0, 0.0, 4.0)
    );
    let (b, c) = (bench.slot("b"), bench.slot("c"));
    assert!(!bench.world.filters().allows(b, c), "both hang on `a`");
    // The pose of `d` is unknown, so no relative pose can be computed.
    let text = bench.refused(&[attach("d", Some("c"), None)]);
    assert!(text.contains("say where (`position`)"), "{text}");
}

#[test]
fn law_3_10_what_hangs_on_a_fixed_body_cannot_move() {
    let mut bench = Bench::of(vec![fixed("wall", 1, 9.0), moving("lamp", 2)]);
    let to = Some(Pose::translation(0.0, 1.0, 0.0));
    bench.edit(attach("lamp", Some("wall"), to));
    assert_eq!(bench.status("lamp"), BodyStatus::Known);
    assert_eq!(
        bench.body("lamp").pose.translation.vector,
        Vec3::new(9.0, 1.0, 0.0)
    );
    assert!(!bench.body("lamp").moves && bench.inserted("lamp"));
    bench.wait(10 * TIMEOUT_NS);
    assert_eq!(bench.status("lamp"), BodyStatus::Known);
    bench.edit(attach("lamp", None, None));
    assert!(bench.body("lamp").moves);
    assert_eq!(bench.status("lamp"), BodyStatus::Known, "until now it was");
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("lamp"), BodyStatus::Stale);
}

#[test]
fn a_full_scene_says_which_limit_to_raise() {
    let mut scene = crate::support::scene(vec![moving("a", 1)], Vec::new());
    scene.config.limits.bodies = 1;
    let mut world = sweepd::world::World::new(&scene, vec![cube()], 0).unwrap();
    let text = world.apply(&[put(moving("b", 0))]).unwrap_err();
    assert!(text.contains("limits.bodies"), "{text}");
    // There is room for a new body if the same request removes one.
    let edits = [Edit::Remove { name: named("a") }, put(moving("b", 0))];
    assert!(world.apply(&edits).unwrap().changed);
    world.validate().unwrap();
}

#[test]
fn an_empty_scene_is_a_world_without_input() {
    let mut bench = Bench::of(Vec::new());
    assert!(bench.has_reason(Reason::NoInput));
    bench.edit(put(fixed("wall", 0, 0.0)));
    assert_eq!(bench.world.counts().bodies, 1);
    assert_eq!(bench.body("wall").id, BodyId(1));
}

#[test]
fn a_scene_that_does_not_hold_together_is_no_world() {
    let new = |bodies: Vec<BodySpec>| {
        let scene = crate::support::scene(bodies.clone(), Vec::new());
        let shapes = bodies.iter().map(|_| cube()).collect();
        sweepd::world::World::new(&scene, shapes, 0)
    };
    let text = new(vec![moving("a", 1), moving("b", 1)])
        .unwrap_err()
        .to_string();
    assert!(text.starts_with("body `b`"), "{text}");
    let lost = BodySpec {
        attached_to: Some(named("x")),
        ..moving("a", 1)
    };
    assert!(new(vec![lost]).unwrap_err().to_string().contains("`x`"));
}

#[test]
fn law_6_a_margin_that_is_none_or_of_nobody_is_refused_with_what_to_write() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    for (name, report_within_m, said) in [
        (Some("a"), -0.1, "write metres from 0"),
        (None, f64::NAN, "write metres from 0"),
        (None, f64::INFINITY, "write metres from 0"),
        (Some("z"), 0.1, "there is no body `z`"),
    ] {
        let text = bench.refused(&[Edit::Margin {
            name: name.map(named),
            report_within_m: Some(report_within_m),
        }]);
        assert!(text.contains(said), "{text}");
    }
}

#[test]
fn law_6_a_body_put_again_after_a_margin_was_set_has_its_own() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let own_m = bench.body("a").report_within_m;
    let margin = |report_within_m| Edit::Margin {
        name: None,
        report_within_m,
    };
    bench.edit(margin(Some(own_m + 0.5)));
    assert_eq!(
        bench.body("a").report_within_m.to_bits(),
        (own_m + 0.5).to_bits()
    );
    bench.edit(put(moving("b", 2)));
    assert_eq!(bench.body("b").report_within_m.to_bits(), own_m.to_bits());
    bench.edit(put(moving("a", 1)));
    assert_eq!(bench.body("a").report_within_m.to_bits(), own_m.to_bits());
    let rev = bench.world.scene_rev();
    bench.edit(margin(None));
    assert_eq!(bench.world.scene_rev(), rev);
}

/// The message named the key `pose`, which requests do not have.
#[test]
fn bug_an_attachment_without_a_place_names_the_key_to_write() {
    let mut bench = Bench::of(vec![fixed("wall", 1, 9.0), moving("lamp", 2)]);
    let text = bench.refused(&[attach("lamp", Some("wall"), None)]);
    assert!(text.contains("say where (`position`)"), "{text}");
    let place = Some(Pose::translation(0.0, 1.0, 0.0));
    let text = bench.refused(&[attach("lamp", None, place)]);
    assert!(text.contains("leave out `position`"), "{text}");
}

/// After that request no source moves the body it is attached to, so a reset of the source must not affect it.
#[test]
fn bug_a_body_hung_on_another_was_reset_with_the_source_that_the_same_request_took_it_from() {
    let bodies = vec![fixed("base", 1, 0.0), moving("b", 2), moving("c", 3)];
    let mut bench = Bench::of(bodies);
    bench.send(MS, "sim", 1, &[row(2, 2.0), row(3, 5.0)]);
    let reset = Edit::Reset {
        source: Some(named("sim")),
    };
    bench.world.begin_tick(2 + bench.tick, bench.now_ns);
    let request = [attach("b", Some("base"), None), reset];
    bench.world.apply(&request).unwrap();
    bench.world.age(bench.now_ns);
    bench.world.validate().unwrap();
    assert_eq!(
        (bench.removed("b"), bench.removed("c")),
        (None, Some(EndCause::Reset))
    );
    assert_eq!(bench.status("b"), BodyStatus::Known);
    assert_eq!(bench.status("c"), BodyStatus::NotReceived);
}
