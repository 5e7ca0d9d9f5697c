//! Requests with several edits: each edit sees the scene as the earlier ones leave it.

use std::sync::Arc;

use sweepd::ids::BodyId;
use sweepd::math::Pose;
use sweepd::scene::BodySpec;
use sweepd::wire::BodyStatus;
use sweepd::world::{Edit, Put};

use crate::support::{Bench, MS, cloth, cube, fixed, moving, row};

fn put(spec: BodySpec) -> Edit {
    Edit::Put(Put {
        body: Arc::new(spec),
        shapes: cube(),
    })
}

fn remove(name: &str) -> Edit {
    Edit::Remove {
        name: name.to_owned(),
    }
}

fn attach(name: &str, to: &str, at_x: Option<f64>) -> Edit {
    Edit::Attach {
        name: name.to_owned(),
        to: Some(to.to_owned()),
        pose: at_x.map(|x| Pose::translation(x, 0.0, 0.0)),
    }
}

fn detach(name: &str) -> Edit {
    Edit::Attach {
        name: name.to_owned(),
        to: None,
        pose: None,
    }
}

fn hung(name: &str, to: &str, at_x: f64) -> BodySpec {
    BodySpec {
        attached_to: Some(to.to_owned()),
        pose: Pose::translation(at_x, 0.0, 0.0),
        ..moving(name, 0)
    }
}

/// Runs a tick with one request.
fn request(bench: &mut Bench, edits: &[Edit]) {
    bench.tick += 1;
    bench.world.begin_tick(bench.tick, bench.now_ns);
    bench.world.apply(edits).unwrap();
    bench.world.age(bench.now_ns);
    bench.world.validate().unwrap();
}

fn x_of(bench: &Bench, name: &str) -> f64 {
    bench.body(name).pose.translation.vector.x
}

/// `x` at 5 m and `z` at 6.5 m, both received; a floor at 0.
fn grasp() -> Bench {
    let mut bench = Bench::of(vec![moving("x", 1), moving("z", 2), fixed("floor", 3, 0.0)]);
    bench.send(MS, "sim", 1, &[row(1, 5.0), row(2, 6.5)]);
    bench
}

#[test]
fn bug_an_id_that_a_request_asks_for_was_given_to_another_name_of_it() {
    let mut bench = Bench::of((1..5).map(|id| moving(&format!("b{id}"), id)).collect());
    request(&mut bench, &[put(moving("p", 0)), put(moving("q", 5))]);
    assert_eq!(bench.body("p").id, BodyId(6));
    assert_eq!(bench.body("q").id, BodyId(5));
    assert_eq!(bench.world.bodies().count(), 6);
    // A name that asks for an id only in its second put gets this id, and no other.
    request(&mut bench, &[put(moving("r", 0)), put(moving("r", 9))]);
    assert_eq!(bench.body("r").id, BodyId(9));
    let text = bench.refused(&[put(moving("s", 7)), put(moving("s", 8))]);
    assert!(text.contains("has the id 7"), "{text}");
    // The id stays with the name, even if its body is removed again.
    let text = bench.refused(&[put(moving("s", 7)), remove("s"), put(moving("t", 7))]);
    assert!(text.contains("belongs to `s`"), "{text}");
}

#[test]
fn bug_a_body_hung_where_it_is_moved_where_the_request_moves_what_it_hangs_on() {
    let mut bench = grasp();
    let edits = [attach("x", "floor", Some(0.0)), attach("z", "x", None)];
    request(&mut bench, &edits);
    assert_eq!((x_of(&bench, "x"), x_of(&bench, "z")), (0.0, 6.5));
    // As with two requests: an attached body moves with its parent, and is detached at the resulting pose.
    let mut bench = grasp();
    let edits = [
        attach("z", "x", None),
        attach("x", "floor", Some(0.0)),
        detach("z"),
    ];
    request(&mut bench, &edits);
    assert_eq!((x_of(&bench, "x"), x_of(&bench, "z")), (0.0, 1.5));
    assert_eq!(bench.status("z"), BodyStatus::Known);
    // This includes the start pose of a body that replaces the parent.
    let mut bench = grasp();
    bench.edit(attach("z", "x", None));
    request(&mut bench, &[put(fixed("x", 1, 2.0)), detach("z")]);
    assert_eq!((x_of(&bench, "x"), x_of(&bench, "z")), (2.0, 3.5));
    // And a body that the request itself has attached.
    let lamp = BodySpec {
        attached_to: Some("x".to_owned()),
        ..fixed("lamp", 0, 1.0)
    };
    let reset = Edit::Reset { source: None };
    request(&mut bench, &[put(lamp), detach("lamp"), reset]);
    assert_eq!(x_of(&bench, "lamp"), 3.0);
    assert_eq!(bench.status("lamp"), BodyStatus::Known);
    // If the parent is removed, the body stays where it was.
    let mut bench = grasp();
    bench.edit(attach("z", "x", None));
    let edits = [remove("x"), attach("z", "floor", None)];
    request(&mut bench, &edits);
    assert_eq!(x_of(&bench, "z"), 6.5);
}

#[test]
fn bug_a_start_pose_that_was_never_received_became_an_offset() {
    let mut bench = Bench::of(vec![moving("x", 1), moving("y", 2), fixed("floor", 3, 0.0)]);
    bench.send(MS, "sim", 1, &[row(1, 5.0)]);
    let text = bench.refused(&[detach("y"), attach("y", "x", None)]);
    assert!(
        text.starts_with("edit 2: it is not known where `y`"),
        "{text}"
    );
    let text = bench.refused(&[attach("x", "y", Some(1.0)), attach("x", "floor", None)]);
    assert!(
        text.starts_with("edit 2: it is not known where `x`"),
        "{text}"
    );
    // The same holds for a body whose pose the request has reset.
    let reset = Edit::Reset { source: None };
    let text = bench.refused(&[reset, attach("x", "floor", None)]);
    assert!(
        text.starts_with("edit 2: it is not known where `x`"),
        "{text}"
    );
}

#[test]
fn bug_a_body_put_on_another_counted_as_where_it_hangs_of_the_scene() {
    let mut bench = grasp();
    let edits = [put(hung("g", "x", 1.0)), attach("g", "floor", None)];
    request(&mut bench, &edits);
    assert_eq!(x_of(&bench, "g"), 6.0);
}

#[test]
fn bug_edits_were_held_against_the_bodies_of_before_the_request() {
    let mut bench = grasp();
    let text = bench.refused(&[cloth(), attach("cloth", "x", Some(0.0))]);
    assert!(text.starts_with("edit 2: body `cloth` deforms"), "{text}");
    let lost = || BodySpec {
        source: None,
        ..hung("g", "x", 1.0)
    };
    let text = bench.refused(&[put(lost()), detach("g")]);
    assert!(text.contains("no source may move it"), "{text}");
    // The other way round: a body that replaces it can be detached.
    bench.edit(put(lost()));
    request(&mut bench, &[put(hung("g", "x", 2.0)), detach("g")]);
    assert_eq!(x_of(&bench, "g"), 7.0);
    bench.edit(cloth());
    let edits = [put(moving("cloth", 0)), attach("cloth", "x", Some(0.0))];
    request(&mut bench, &edits);
    assert_eq!(x_of(&bench, "cloth"), 5.0);
}

#[test]
fn bug_a_put_after_edits_that_changed_nothing_made_a_new_generation() {
    let enable = |enabled| Edit::Enable {
        name: "x".to_owned(),
        enabled,
    };
    let filter = |group| Edit::Filter {
        name: "x".to_owned(),
        group: Some(group),
        mask: None,
    };
    let mut bench = grasp();
    bench.edit(detach("x"));
    bench.edit(enable(false));
    bench.edit(enable(true));
    bench.edit(filter(2));
    bench.edit(filter(moving("x", 1).group));
    bench.edit(attach("x", "floor", Some(0.0)));
    bench.edit(detach("x"));
    let rev = bench.world.scene_rev();
    bench.edit(put(moving("x", 1)));
    assert_eq!(bench.world.scene_rev(), rev);
    assert_eq!(bench.body("x").generation, 1);
    // A fixed body is at the pose it is put with.
    bench.edit(attach("floor", "x", Some(1.0)));
    bench.edit(detach("floor"));
    bench.edit(put(fixed("floor", 3, 0.0)));
    assert_eq!(bench.body("floor").generation, 2);
    assert_eq!(x_of(&bench, "floor"), 0.0);
}

#[test]
fn bug_names_kept_the_source_of_a_body_that_was_hung_or_let_go() {
    let mut bench = grasp();
    for edit in [attach("z", "floor", None), detach("z")] {
        bench.edit(edit);
        assert!(bench.world.names_changed());
    }
    // Its source is still the same.
    for edit in [attach("z", "x", None), detach("z")] {
        bench.edit(edit);
        assert!(!bench.world.names_changed());
    }
}

/// Walking the chain from each of its ends would take minutes.
#[test]
fn bug_a_long_chain_in_one_request_was_walked_from_each_of_its_bodies() {
    const LEN: u64 = 20_000;
    let mut bench = grasp();
    let name = |at: u64| match at {
        0 => "x".to_owned(),
        at => format!("link{at}"),
    };
    let link = |at: u64| put(hung(&name(at), &name(at - 1), 0.25));
    let mut edits: Vec<Edit> = (1..=LEN).map(link).collect();
    request(&mut bench, &edits);
    let last = name(LEN);
    assert_eq!(x_of(&bench, &last), 5.0 + 0.25 * LEN as f64);
    // Each link is detached and attached again at its pose, from the first on; then they are removed.
    edits = vec![attach("z", "floor", Some(1.0))];
    edits.extend(
        (1..=LEN).flat_map(|at| [detach(&name(at)), attach(&name(at), &name(at - 1), None)]),
    );
    request(&mut bench, &edits);
    assert_eq!(x_of(&bench, &last), 5.0 + 0.25 * LEN as f64);
    edits = (1..=LEN).map(|at| remove(&name(at))).collect();
    request(&mut bench, &edits);
    assert_eq!(bench.world.bodies().count(), 3);
}

/// The same from the far end, with a known root and with one that was never received.
#[test]
fn bug_a_long_chain_that_is_let_go_from_its_end_was_walked_from_each_of_its_bodies() {
    const LEN: u64 = 20_000;
    for (mut bench, status) in [
        (grasp(), BodyStatus::Known),
        (Bench::of(vec![moving("x", 1)]), BodyStatus::NotReceived),
    ] {
        let name = |at: u64| match at {
            0 => "x".to_owned(),
            at => format!("link{at}"),
        };
        let link = |at: u64| put(hung(&name(at), &name(at - 1), 0.25));
        let edits: Vec<Edit> = (1..=LEN).map(link).collect();
        request(&mut bench, &edits);
        let (last, was_x) = (name(LEN), x_of(&bench, &name(LEN)));
        let edits: Vec<Edit> = (1..=LEN).rev().map(|at| detach(&name(at))).collect();
        request(&mut bench, &edits);
        assert_eq!((x_of(&bench, &last), bench.status(&last)), (was_x, status));
        // Attached and detached once more after something has moved.
        let mut edits: Vec<Edit> = (1..=LEN)
            .map(|at| attach(&name(at), &name(at - 1), Some(0.5)))
            .collect();
        edits.extend((1..=LEN).rev().map(|at| detach(&name(at))));
        request(&mut bench, &edits);
        let far_x = x_of(&bench, "x") + 0.5 * LEN as f64;
        assert_eq!((x_of(&bench, &last), bench.status(&last)), (far_x, status));
    }
}

#[test]
fn bug_a_chain_of_bodies_that_cannot_move_was_walked_from_each_that_is_let_go() {
    const LEN: u64 = 20_000;
    let name = |at: u64| match at {
        0 => "x".to_owned(),
        at => format!("link{at}"),
    };
    for mut bench in [Bench::of(vec![moving("x", 1), moving("z", 2)]), grasp()] {
        let link = |at: u64| BodySpec {
            moves: false,
            source: None,
            ..hung(&name(at), &name(at - 1), 0.25)
        };
        request(
            &mut bench,
            &(1..=LEN).map(|at| put(link(at))).collect::<Vec<_>>(),
        );
        let mut edits = Vec::new();
        for at in (1..=LEN).rev() {
            edits.push(Edit::Attach {
                name: name(at),
                to: None,
                pose: Some(Pose::translation(at as f64, 0.0, 0.0)),
            });
            // Another body is attached in between.
            edits.push(attach("z", "x", Some(1.0)));
        }
        request(&mut bench, &edits);
        assert_eq!(x_of(&bench, &name(LEN)), LEN as f64);
        assert_eq!(bench.status(&name(1)), BodyStatus::Known);
    }
}

#[test]
fn bug_a_body_that_cannot_move_was_let_go_and_lost_its_pose_with_those_that_a_reset_forgets() {
    let mut bench = grasp();
    bench.edit(attach("floor", "x", Some(1.0)));
    request(&mut bench, &[detach("floor"), Edit::Reset { source: None }]);
    assert_eq!(bench.status("floor"), BodyStatus::Known);
    assert_eq!(x_of(&bench, "floor"), 6.0);
}

#[test]
fn bug_a_body_let_go_by_the_request_that_hung_it_on_an_unknown_one_stayed_known() {
    let scene = || {
        let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
        bench.send(MS, "sim", 1, &[row(2, 3.0)]);
        bench
    };
    let edits = || [attach("b", "a", Some(3.0)), detach("b")];
    let mut one = scene();
    request(&mut one, &edits());
    let mut two = scene();
    for edit in edits() {
        two.edit(edit);
    }
    assert_eq!(two.status("b"), BodyStatus::NotReceived);
    assert_eq!(one.status("b"), BodyStatus::NotReceived);
    assert_eq!((x_of(&one, "b"), x_of(&two, "b")), (3.0, 3.0));
    assert!(one.removed("b").is_some());
    // As old as its former parent.
    let stale = || {
        let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
        bench.send(MS, "sim", 1, &[row(1, 1.0)]);
        bench.send(600 * MS, "sim", 2, &[row(2, 3.0)]);
        bench
    };
    let edits = || [attach("b", "a", Some(2.0)), detach("b")];
    let mut one = stale();
    assert_eq!(one.status("b"), BodyStatus::Known);
    request(&mut one, &edits());
    let mut two = stale();
    for edit in edits() {
        two.edit(edit);
    }
    assert_eq!(two.status("b"), BodyStatus::Stale);
    assert_eq!(one.status("b"), BodyStatus::Stale);
}

#[test]
fn bug_a_put_was_held_against_the_body_of_before_the_request() {
    let scene = || Bench::of(vec![moving("b", 1), fixed("c", 2, 4.0)]);
    let again = || [put(moving("b", 1)), attach("c", "b", None)];
    let filter = |group| Edit::Filter {
        name: "b".to_owned(),
        group: Some(group),
        mask: None,
    };
    let enable = |enabled| Edit::Enable {
        name: "b".to_owned(),
        enabled,
    };
    let margin = |name: Option<&str>, report_within_m| Edit::Margin {
        name: name.map(str::to_owned),
        report_within_m,
    };
    let was = moving("b", 1).group;
    // A body that differs by now is replaced, and its start pose applies.
    for before in [
        vec![filter(2)],
        vec![enable(false)],
        vec![margin(Some("b"), Some(0.7))],
        vec![margin(None, Some(0.7))],
        vec![margin(None, Some(0.7)), margin(Some("b"), Some(0.8))],
    ] {
        let mut bench = scene();
        let edits: Vec<Edit> = before.into_iter().chain(again()).collect();
        request(&mut bench, &edits);
        assert_eq!(bench.body("b").generation, 2);
        assert_eq!(x_of(&bench, "c"), 4.0);
    }
    // A body that is the same by now is not replaced, and it was never received.
    for before in [
        vec![],
        vec![filter(2), filter(was)],
        vec![enable(true)],
        vec![margin(Some("b"), Some(0.7)), margin(None, None)],
        vec![margin(None, Some(0.7)), margin(Some("b"), None)],
        vec![detach("b")],
        vec![
            attach("b", "c", Some(1.0)),
            enable(true),
            detach("b"),
            Edit::Reset { source: None },
        ],
    ] {
        let mut bench = scene();
        let edits: Vec<Edit> = before.into_iter().chain(again()).collect();
        let text = bench.refused(&edits);
        assert!(
            text.contains("it is not known where `c` is seen from `b`"),
            "{text}"
        );
    }
}
