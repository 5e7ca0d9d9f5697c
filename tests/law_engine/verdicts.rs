//! Laws 3.4, verdicts, and 3.11, conventions.

use sweepd::math::{Point, Vec3, pose_from};
use sweepd::scene::PairAction;
use sweepd::wire::{
    ContactKind, Demand, State, Verdict, VertexFrame, VertexHeader, WIRE_VERSION, name_bytes,
    vertex_flags,
};
use sweepd::world::Edit;

use crate::rig::{ALL, Rig, ball, body, row, rule, scene};

#[test]
fn law_3_4_near_is_apart_below_the_larger_of_the_two_report_distances() {
    let near = "report_within_m = 0.5";
    let bodies = [ball(1, 0.0, near), ball(2, 2.3, ""), ball(3, -2.6, "")];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Near);
    assert_eq!(rig.verdict(1, 3), Verdict::Apart);
    assert_eq!(rig.state(), State::Near);
    let row = *rig.pair(1, 2).unwrap();
    assert!(row.gap_min_m <= 0.3 && 0.3 <= row.gap_max_m && row.gap_max_m - row.gap_min_m < 1e-9);
    let [contact] = rig.out.contacts.as_slice() else {
        panic!("closest points of the one near pair")
    };
    assert_eq!(contact.kind, ContactKind::Closest.code());
    assert!((contact.gap_m - 0.3).abs() < 1e-9);
}

#[test]
fn bug_a_pair_that_was_near_and_is_no_more_stayed_near_while_nobody_asked_for_bounds() {
    let near = "report_within_m = 0.5";
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, near), ball(2, 3.0, "")]));
    rig.demand = Demand {
        pairs: true,
        ..Demand::default()
    };
    for (x, verdict) in [
        (3.0, Verdict::Apart),
        (2.4, Verdict::Near),
        (2.7, Verdict::Apart),
    ] {
        rig.move_x(2, x);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), verdict, "{x}");
    }
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn law_3_4_a_report_distance_never_makes_a_pair_colliding() {
    for within in [0.0, 1.0, 100.0] {
        let more = format!("report_within_m = {within}");
        let mut rig = Rig::new(&scene("", &[ball(1, 0.0, &more), ball(2, 2.001, &more)]));
        rig.send(ALL);
        assert_ne!(rig.verdict(1, 2), Verdict::Colliding);
        assert_eq!(rig.out.tick.colliding, 0);
        rig.move_x(2, 1.999);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    }
}

#[test]
fn law_3_4_a_pair_rule_overrides_the_bodies_and_holds_at_once_for_a_pair_at_rest() {
    let near = "report_within_m = 0.5";
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, near), ball(2, 2.3, near)]));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Near);
    rig.edit(vec![rule(PairAction::Check, "b1", "b2", Some(0.1))], ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    assert_eq!(rig.state(), State::Clear);
    rig.edit(vec![rule(PairAction::Check, "b1", "b2", Some(0.4))], ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Near);
    let (a, b) = ("b1".to_owned(), "b2".to_owned());
    rig.edit(
        vec![
            Edit::DropRules { a, b },
            rule(PairAction::Check, "b?", "b*", Some(0.0)),
        ],
        ALL,
    );
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    rig.edit(vec![rule(PairAction::Check, "b*", "b*", Some(7.0))], ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Near);
}

/// A rule of one body with very many others: these are found within the distance of the rule, which enlarges no other
/// box.
#[test]
fn bug_a_rule_of_one_body_with_many_widened_the_boxes_of_all() {
    const MANY: u64 = 4200;
    const WITHIN_M: f64 = 50.0;
    let mut balls: Vec<String> = (1..=MANY).map(|id| ball(id, 3.0 * id as f64, "")).collect();
    balls.push(ball(MANY + 1, 300.0, ""));
    let mut rig = Rig::new(&scene("", &balls));
    rig.checked = false;
    for sides in [["b*", "b4201"], ["b4201", "*"]] {
        rig.edit(
            vec![rule(PairAction::Check, sides[0], sides[1], Some(WITHIN_M))],
            ALL,
        );
        for x in [300.0, 6000.5] {
            rig.move_x(MANY + 1, x);
            rig.send(ALL);
            // Bodies in contact are within that distance, too.
            let apart_m = |id: u64| (3.0 * id as f64 - x).abs() - 2.0;
            let near = (1..=MANY).filter(|id| apart_m(*id) < WITHIN_M).count() as u64;
            let tick = rig.out.tick;
            assert_eq!(tick.near + tick.colliding, near);
            assert!(tick.candidates < 3 * near, "{} candidates", tick.candidates);
        }
    }
    rig.engine.validate().unwrap();
}

#[test]
fn law_3_4_touching_collides_and_is_flagged() {
    let shape = "{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }";
    let bodies = [
        body(1, [0.0; 3], shape, ""),
        body(2, [1.0, 0.0, 0.0], shape, ""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(row.flags & sweepd::wire::pair_flags::TOUCHING, 1);
    rig.move_x(2, 1.0 + 1e-6);
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
}

#[test]
fn law_3_11_a_has_the_smaller_id_normals_point_from_a_to_b_and_both_frames_agree() {
    let shape = "{ type = \"box\", half_extents = [0.5, 0.4, 0.3] }";
    // The larger id comes first in the file.
    let bodies = [
        body(9, [0.0; 3], shape, ""),
        body(4, [0.7, 0.1, 0.0], shape, ""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    let turned = pose_from([0.7, 0.1, 0.05], [0.1, 0.2, 0.3, 0.9]).unwrap();
    rig.place(4, &turned);
    let other = pose_from([0.0, 0.0, 0.0], [0.3, -0.1, 0.0, 0.9]).unwrap();
    *rig.row(9) = row(9, &other);
    rig.send(ALL);
    assert_eq!(rig.verdict(4, 9), Verdict::Colliding);
    assert!(!rig.out.contacts.is_empty());
    for contact in &rig.out.contacts {
        assert_eq!((contact.body_a, contact.body_b), (4, 9));
        let normal = Vec3::from(contact.normal);
        assert!((normal.norm() - 1.0).abs() < 1e-12);
        // The normal points from A (at x = 0.7) to B (at x = 0).
        assert!(normal.dot(&(other.translation.vector - turned.translation.vector)) > 0.0);
        let world_a = turned * Point::from(contact.point_a_body);
        let world_b = other * Point::from(contact.point_b_body);
        assert!((world_a - Point::from(contact.point_a)).norm() < 1e-12);
        assert!((world_b - Point::from(contact.point_b)).norm() < 1e-12);
        // B's point is at `gap` from A's point along the normal; a negative gap means against it.
        let across = Point::from(contact.point_b) - Point::from(contact.point_a);
        assert!(
            (across.dot(&normal) - contact.gap_m).abs() < 1e-9,
            "{contact:?}"
        );
    }
}

#[test]
fn law_3_11_output_is_ordered_by_ids() {
    let bodies: Vec<String> = [50, 3, 90, 17, 8]
        .iter()
        .map(|&id| ball(id, id as f64 * 1e-3, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    assert_eq!(rig.out.pairs.len(), 10);
    let ids: Vec<_> = rig
        .out
        .pairs
        .iter()
        .map(|row| (row.body_a, row.body_b))
        .collect();
    assert!(ids.is_sorted() && ids.iter().all(|(a, b)| a < b));
    assert!(rig.out.bodies.is_sorted_by_key(|row| row.body));
    assert!(
        rig.out
            .contacts
            .is_sorted_by_key(|row| (row.body_a, row.body_b))
    );
}

/// Positive while the bodies approach; for points of turning bodies, and for a partner that cannot move.
#[test]
fn law_6_how_fast_a_gap_shrinks_is_told_where_velocities_are() {
    let near = "report_within_m = 3.0";
    let wall = "name = \"wall\"\nid = 3\nmoves = false\nposition = [0.0, 3.0, 0.0]\n\
        shape = { type = \"sphere\", radius = 1.0 }\nreport_within_m = 3.0";
    let bodies = [ball(1, 0.0, near), ball(2, 3.0, near), wall.to_owned()];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    let closing = |rig: &Rig, b| rig.pair(1, b).unwrap().closing_mps;
    assert!(closing(&rig, 2).is_nan() && closing(&rig, 3).is_nan());
    let still = [0.0; 6];
    for (velocities, toward_ball, toward_wall) in [
        (
            [
                [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                [-0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
            ],
            1.5,
            0.0,
        ),
        ([[-1.0, 0.5, 0.0, 0.0, 0.0, 0.0], still], -1.0, 0.5),
        // Balls that turn about their own centres do not approach each other.
        (
            [
                [0.0, -2.0, 0.0, 0.0, 0.0, 9.0],
                [0.0, 0.0, 0.0, 0.0, 7.0, 0.0],
            ],
            0.0,
            -2.0,
        ),
    ] {
        rig.velocities = velocities.to_vec();
        rig.send(ALL);
        assert!(
            (closing(&rig, 2) - toward_ball).abs() < 1e-12,
            "{velocities:?}"
        );
        assert!(
            (closing(&rig, 3) - toward_wall).abs() < 1e-12,
            "{velocities:?}"
        );
    }
}

/// Bodies with stale poses, and vertices with their own motion, had the velocity of the last pose.
#[test]
fn bug_how_fast_a_gap_shrinks_is_not_told_of_what_is_silent_or_deforms() {
    let near = "report_within_m = 30.0";
    let sheet = "{ type = \"trimesh\", solid = false, \
        vertices = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], \
        faces = [[0, 1, 2], [0, 2, 3]] }";
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nreport_within_m = 30.0\n\
        shape = { type = \"half_space\", normal = [0, 0, 1], offset = -3.0 }";
    for (on_stale, speed) in [
        ("hold", ""),
        ("unknown", ""),
        ("unknown", "max_speed_mps = 1.0"),
    ] {
        let more = format!("{near}\non_stale = \"{on_stale}\"\n{speed}");
        let mut rig = Rig::new(&scene(
            "",
            &[
                ball(1, 0.0, &more),
                body(
                    2,
                    [9.0, 0.0, 0.0],
                    sheet,
                    &format!("{near}\ndeforms = true"),
                ),
                floor.to_owned(),
            ],
        ));
        rig.velocities = vec![[0.0, 0.0, -2.0, 0.0, 0.0, 0.0]; 2];
        let square = [
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
        ];
        let mut vertices = VertexFrame {
            header: VertexHeader {
                session: 11,
                epoch: 1,
                body: 2,
                version: 1,
                source: name_bytes("feed"),
                count: 4,
                total: 4,
                flags: vertex_flags::FULL,
                schema: WIRE_VERSION,
                ..VertexHeader::default()
            },
            rows: square.to_vec(),
            ..VertexFrame::default()
        };
        rig.vertices = vec![vertices.clone()];
        rig.send(ALL);
        let closing = |rig: &Rig, a| rig.pair(a, 9).unwrap().closing_mps;
        assert!((closing(&rig, 1) - 2.0).abs() < 1e-12, "{on_stale}");
        assert!(closing(&rig, 2).is_nan(), "nobody tells how vertices go");
        vertices.header.version = 2;
        vertices.rows.iter_mut().for_each(|row| row[2] = -0.1);
        rig.vertices = vec![vertices];
        rig.send(ALL);
        assert!(closing(&rig, 2).is_nan());
        rig.idle(499_000_000, ALL);
        assert!((closing(&rig, 1) - 2.0).abs() < 1e-12, "{on_stale}");
        rig.idle(2_000_000, ALL);
        assert!(
            closing(&rig, 1).is_nan(),
            "{on_stale}: {:?}",
            rig.pair(1, 9)
        );
        rig.send(ALL);
        assert!((closing(&rig, 1) - 2.0).abs() < 1e-12, "{on_stale}");
    }
}
