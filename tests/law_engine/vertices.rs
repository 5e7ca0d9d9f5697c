//! Laws 3.7 and 4.2 for vertices: the accepted messages, and the effect of refused ones.

use sweepd::wire::{
    BodyStatus, RejectReason, State, Verdict, VertexFrame, VertexHeader, WIRE_VERSION, frame_flags,
    name_bytes, vertex_flags,
};

use crate::rig::{ALL, FRAME_NS, NONE, Rig, body, scene};
use sweepd::wire::Reason;
use sweepd::world::{Edit, Put};

/// A square of side 2 m in the x-y plane, as two triangles.
const SHEET: &str = "{ type = \"trimesh\", solid = false, \
    vertices = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], \
    faces = [[0, 1, 2], [0, 2, 3]] }";
const CUBE: &str = "{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }";

fn rig() -> Rig {
    Rig::new(&scene(
        "",
        &[
            body(1, [0.0, 0.0, 3.0], SHEET, "deforms = true\n"),
            body(2, [0.0, 0.0, 0.0], CUBE, ""),
        ],
    ))
}

/// The vertices of the sheet at a height in its own frame.
fn at(z: f32) -> Vec<[f32; 3]> {
    vec![
        [-1.0, -1.0, z],
        [1.0, -1.0, z],
        [1.0, 1.0, z],
        [-1.0, 1.0, z],
    ]
}

fn full(version: u64, rows: Vec<[f32; 3]>) -> VertexFrame {
    let count = u32::try_from(rows.len()).unwrap();
    VertexFrame {
        header: VertexHeader {
            session: 11,
            epoch: 1,
            body: 1,
            version,
            source: name_bytes("feed"),
            count,
            total: count,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        rows,
        ..VertexFrame::default()
    }
}

fn range(version: u64, base_version: u64, first: u32, rows: Vec<[f32; 3]>) -> VertexFrame {
    let mut frame = full(version, rows);
    frame.header.base_version = base_version;
    frame.header.first = first;
    frame.header.total = 4;
    frame.header.flags = vertex_flags::RANGE;
    frame
}

fn status(rig: &Rig, id: u64) -> BodyStatus {
    let row = rig.out.bodies.iter().find(|row| row.body == id).unwrap();
    BodyStatus::from_code(row.status).unwrap()
}

/// Runs a tick with poses and these vertices.
fn send(rig: &mut Rig, vertices: Vec<VertexFrame>) {
    rig.vertices = vertices;
    rig.send(ALL);
}

fn known(rig: &mut Rig) {
    send(rig, vec![full(1, at(0.0))]);
    assert_eq!(status(rig, 1), BodyStatus::Known);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn law_3_7_a_body_that_deforms_is_not_received_until_its_pose_and_all_vertices_have_come() {
    let mut rig = rig();
    send(&mut rig, vec![]);
    assert_eq!(status(&rig, 1), BodyStatus::NotReceived);
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::NotReceived));
    // A range of vertices of which no full set has come is useless, and is reported.
    send(&mut rig, vec![range(2, 1, 0, at(0.0))]);
    assert_eq!(status(&rig, 1), BodyStatus::Rejected);
    assert_eq!(rig.rejects(RejectReason::VertexVersion), 1);
    known(&mut rig);
}

#[test]
fn vertices_move_the_surface_in_the_tick_they_come_with_at_any_budget() {
    let mut rig = rig();
    known(&mut rig);
    // One corner moves down so far that the sheet between it and the opposite corner cuts an edge of the cube.
    send(&mut rig, vec![range(2, 1, 2, vec![[1.0, 1.0, -3.5]])]);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    rig.vertices = vec![full(3, at(-2.4)), full(4, at(0.0))];
    rig.send(NONE);
    assert_ne!(rig.verdict(1, 2), Verdict::Colliding);
    rig.vertices = vec![full(5, at(-2.55))];
    rig.send(NONE);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible, "nothing was spent");
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    rig.vertices = vec![full(6, at(0.0))];
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn law_3_7_wrong_vertices_leave_the_last_good_ones_and_the_body_unknown_until_all_come_again() {
    let mut nan = at(0.0);
    nan[2][1] = f32::NAN;
    let mut far = at(0.0);
    far[0][0] = 3e9;
    let mut short = full(2, at(0.0)[..3].to_vec());
    short.header.total = 4;
    let other_total = full(2, at(0.0)[..3].to_vec());
    let mut cut = full(2, at(0.0));
    cut.rows.pop();
    let mut flags = full(2, at(0.0));
    flags.header.flags = 7;
    let mut late = full(2, at(0.0));
    late.waited = true;
    let mut large = full(2, Vec::new());
    large.refused = Some(RejectReason::OverLimit);
    let bent = vec![[0.0_f32, 0.0, 0.1]];
    for (wrong, reason) in [
        (full(2, nan.clone()), RejectReason::NotFinite),
        (range(2, 1, 0, nan), RejectReason::NotFinite),
        (full(2, far), RejectReason::OverLimit),
        (large, RejectReason::OverLimit),
        (short, RejectReason::BadLayout),
        (other_total, RejectReason::BadLayout),
        (cut, RejectReason::BadLayout),
        (flags, RejectReason::BadLayout),
        (full(2, Vec::new()), RejectReason::BadLayout),
        (range(2, 1, 1, Vec::new()), RejectReason::BadLayout),
        (range(2, 1, 4, bent.clone()), RejectReason::BadLayout),
        (range(2, 1, u32::MAX, bent.clone()), RejectReason::BadLayout),
        (range(3, 2, 0, bent.clone()), RejectReason::VertexVersion),
        (range(3, 0, 0, bent.clone()), RejectReason::VertexVersion),
        (late, RejectReason::TooOld),
    ] {
        let mut rig = rig();
        known(&mut rig);
        send(&mut rig, vec![wrong.clone()]);
        assert_eq!(status(&rig, 1), BodyStatus::Rejected, "{reason} {wrong:?}");
        assert_eq!(rig.rejects(reason), 1, "{reason}");
        assert_eq!(rig.state(), State::Unknown);
        assert!(rig.because(Reason::Rejected));
        let row = rig.out.bodies.iter().find(|row| row.body == 1).unwrap();
        assert_eq!(RejectReason::from_code(row.reject), Some(reason));
        let slot = rig.engine.world().slot_of(sweepd::ids::BodyId(1)).unwrap();
        let body = rig.engine.world().body(slot).unwrap();
        let tight = body.shapes[0].shape.aabb_at(&body.pose);
        assert!((tight.min.z - 3.0).abs() < 1e-9 && (tight.max.z - 3.0).abs() < 1e-9);
        // Neither a valid pose nor a range on top of the rejected vertices makes the vertices known.
        send(&mut rig, vec![]);
        assert_eq!(status(&rig, 1), BodyStatus::Rejected);
        send(&mut rig, vec![range(9, 1, 0, bent.clone())]);
        assert_eq!(status(&rig, 1), BodyStatus::Rejected);
        assert!(rig.rejects(RejectReason::VertexVersion) >= 1);
        send(&mut rig, vec![full(10, at(0.0))]);
        assert_eq!(status(&rig, 1), BodyStatus::Known);
        assert_eq!(rig.state(), State::Clear);
    }
}

#[test]
fn vertices_that_come_again_or_late_change_nothing() {
    let mut rig = rig();
    known(&mut rig);
    send(&mut rig, vec![full(7, at(0.5))]);
    for old in [
        full(7, at(-2.5)),
        full(3, at(-2.5)),
        range(7, 1, 0, at(-2.5)),
    ] {
        send(&mut rig, vec![old]);
        assert_eq!(status(&rig, 1), BodyStatus::Known);
        assert_eq!(rig.state(), State::Clear);
    }
    assert_eq!(rig.rejects(RejectReason::OldFrame), 3);
    // Later ranges continue from the newest version.
    send(&mut rig, vec![range(8, 7, 0, at(-2.6))]);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
}

#[test]
fn law_4_2_only_the_session_that_moves_a_body_may_bend_it() {
    let mut rig = rig();
    known(&mut rig);
    let mut stranger = full(2, at(-2.6));
    stranger.header.session = 12;
    let mut nobody = full(2, at(-2.6));
    nobody.header.source = name_bytes("nobody");
    let mut rigid = full(2, at(-2.6));
    rigid.header.body = 2;
    let mut unknown = full(2, at(-2.6));
    unknown.header.body = 77;
    let mut anonymous = full(2, at(-2.6));
    anonymous.header.session = 0;
    for (wrong, reason) in [
        (stranger, RejectReason::SourceTaken),
        (nobody, RejectReason::UnknownSource),
        (rigid, RejectReason::NotSteerable),
        (unknown, RejectReason::UnknownBody),
        (anonymous, RejectReason::BadLayout),
    ] {
        send(&mut rig, vec![wrong]);
        assert_eq!(rig.rejects(reason), 1);
        assert_eq!(status(&rig, 1), BodyStatus::Known);
        assert_eq!(rig.state(), State::Clear, "{reason}");
    }
}

#[test]
fn law_4_2_a_new_session_or_epoch_has_to_send_all_vertices() {
    let mut rig = rig();
    known(&mut rig);
    // A new epoch: its vertices may come before its first frame.
    let mut first = full(1, at(0.2));
    first.header.epoch = 2;
    rig.vertices = vec![first];
    rig.idle_with_vertices(FRAME_NS, ALL);
    assert_eq!(status(&rig, 1), BodyStatus::NotReceived, "no pose yet");
    rig.epoch = 2;
    send(&mut rig, vec![]);
    assert_eq!(status(&rig, 1), BodyStatus::Known);
    // Late messages of the old epoch are skipped.
    send(&mut rig, vec![full(9, at(-2.6))]);
    assert_eq!(rig.rejects(RejectReason::OldFrame), 1);
    assert_eq!(rig.state(), State::Clear);
    // Another epoch, of which only poses come: the earlier vertices are void.
    rig.epoch = 3;
    send(&mut rig, vec![]);
    assert_eq!(status(&rig, 1), BodyStatus::NotReceived);
    let mut part = range(2, 1, 0, at(0.0));
    part.header.epoch = 3;
    send(&mut rig, vec![part]);
    assert_eq!(status(&rig, 1), BodyStatus::Rejected);
}

#[test]
fn law_3_7_bug_after_lost_vertices_all_that_the_source_bent_is_unknown_until_all_of_it_comes_again()
{
    let bends = "deforms = true\n";
    let mut rig = Rig::new(&scene(
        "",
        &[
            body(1, [0.0, 0.0, 3.0], SHEET, bends),
            body(2, [0.0, 0.0, 0.0], CUBE, ""),
            body(3, [9.0, 0.0, 0.0], SHEET, bends),
        ],
    ));
    let of = |body: u64, number: u64, version: u64| {
        let mut frame = full(version, at(0.0));
        (frame.header.body, frame.header.number) = (body, number);
        frame
    };
    let both = |rig: &Rig| [status(rig, 1), status(rig, 3)];
    let (known, rejected) = (BodyStatus::Known, BodyStatus::Rejected);
    send(&mut rig, vec![of(1, 5, 1), of(3, 6, 1)]);
    assert_eq!(both(&rig), [known, known], "what came before is not needed");
    // A message refused for another reason is not lost, and neither is one without a number or with a repeated number.
    send(
        &mut rig,
        vec![of(77, 7, 1), of(3, 8, 2), of(3, 0, 3), of(3, 8, 3)],
    );
    assert_eq!(both(&rig), [known, known]);
    // Number 9 is lost; it may have been for either body.
    send(&mut rig, vec![of(3, 10, 4)]);
    assert_eq!(both(&rig), [rejected, known]);
    assert_eq!(rig.state(), State::Unknown);
    send(&mut rig, vec![of(1, 11, 2)]);
    assert_eq!(both(&rig), [known, known]);
    let mut part = range(5, 4, 0, at(0.0));
    (part.header.body, part.header.number) = (3, 13);
    send(&mut rig, vec![part]);
    assert_eq!(both(&rig), [rejected, rejected]);
    // A new session has its own numbering.
    (rig.session, rig.ended) = (12, vec![11]);
    let of_next = [of(1, 2, 1), of(3, 3, 1)].map(|mut frame| {
        frame.header.session = 12;
        frame
    });
    send(&mut rig, of_next.to_vec());
    assert_eq!(both(&rig), [known, known]);
}

#[test]
fn law_4_2_bug_vertices_that_are_refused_do_not_end_a_session() {
    let mut rig = rig();
    known(&mut rig);
    // The source is silent for longer than its timeout; another session sends vertices for a rigid body.
    let mut rigid = full(1, at(0.0));
    (rigid.header.session, rigid.header.body) = (12, 2);
    rig.vertices = vec![rigid];
    rig.idle_with_vertices(700_000_000, ALL);
    assert_eq!(rig.rejects(RejectReason::NotSteerable), 1);
    rig.send(ALL);
    assert_eq!(rig.rejects(RejectReason::SessionOver), 0);
    assert_eq!(status(&rig, 2), BodyStatus::Known);
}

#[test]
fn law_4_6_a_sheet_that_goes_there_and_back_has_gone_both_ways() {
    let mut rig = rig();
    rig.demand.bodies = true;
    known(&mut rig);
    let slot = rig.engine.world().slot_of(sweepd::ids::BodyId(1)).unwrap();
    let path = |rig: &Rig| rig.engine.world().body(slot).unwrap().motion.path_m;
    let before = path(&rig);
    // A number that f32 represents exactly.
    let step = 1.0 / 64.0;
    send(&mut rig, vec![full(2, at(step)), full(3, at(0.0))]);
    let gone = path(&rig) - before;
    assert!((0.03125..0.031_251).contains(&gone), "{gone}");
}

/// A solid that grows around a body of several shapes: the bound must grow with the depth.
#[test]
fn bug_how_deep_a_compound_can_be_in_a_solid_grows_with_the_solid() {
    let corners = |half: f32| -> Vec<[f32; 3]> {
        (0..8)
            .map(|k| [1, 2, 4].map(|bit| if k & bit == 0 { -half } else { half }))
            .collect()
    };
    let cube = format!(
        "{{ type = \"trimesh\", solid = true, vertices = {:?}, faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], \
         [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]] }}",
        corners(1.2)
    );
    let balls = "[{ type = \"sphere\", radius = 0.5, position = [-0.5, 0, 0] }, \
         { type = \"sphere\", radius = 0.5, position = [0.5, 0, 0] }]";
    let bodies = [
        body(1, [0.0; 3], &cube, "deforms = true"),
        body(2, [0.0; 3], balls, ""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    for step in 0..60_u8 {
        let half = 1.2 + 0.05 * f32::from(step);
        send(&mut rig, vec![full(u64::from(step) + 1, corners(half))]);
        let row = rig.pair(1, 2).unwrap();
        // The centre of the cube lies in a ball.
        let depth = -f64::from(half);
        assert!(
            row.gap_min_m <= depth && depth <= row.gap_max_m + 0.5,
            "{half}: {row:?}"
        );
        assert!(row.gap_max_m <= 0.0, "{half}: {row:?}");
    }
}

/// It became known when detached, as the pose of its former parent was known.
#[test]
fn bug_what_hangs_on_vertices_that_are_not_known_is_not_known_once_it_is_let_go() {
    let hung = body(2, [0.0, 0.0, -3.0], CUBE, "attached_to = \"b1\"");
    let fixed = body(3, [0.0, 0.0, -6.0], CUBE, "attached_to = \"b1\"");
    let bodies = [
        body(1, [0.0, 0.0, 3.0], SHEET, "deforms = true\n"),
        hung,
        fixed.replace("moves = true", "moves = false"),
    ];
    let let_go = |name: &str| Edit::Attach {
        name: name.to_owned(),
        to: None,
        pose: None,
    };
    let no_vertices: [Vec<VertexFrame>; 0] = [];
    let refused = [vec![full(1, at(0.0))], vec![full(2, at(f32::NAN))]];
    for (sent, status) in [
        (no_vertices.to_vec(), BodyStatus::NotReceived),
        (refused.to_vec(), BodyStatus::Rejected),
    ] {
        let mut rig = Rig::new(&scene("", &bodies));
        rig.send(ALL);
        for vertices in sent {
            rig.vertices = vertices;
            rig.send(ALL);
        }
        let told = |rig: &Rig| rig.out.bodies[1].status;
        assert_eq!(told(&rig), status.code());
        rig.edit(vec![let_go("b2")], ALL);
        assert_eq!(told(&rig), status.code());
        let text = rig.engine.world().clone().apply(&[let_go("b3")]);
        assert!(text.unwrap_err().contains("it is not known where `b3` is"));
    }
}

/// The version of the sheet's vertices, and whether the state is clear.
fn version(rig: &Rig) -> (Option<u64>, bool) {
    let world = rig.engine.world();
    let sheet = world.body(world.slot_named("b1").unwrap()).unwrap();
    let version = sheet.vertices.as_ref().unwrap().version;
    (version, rig.state() == State::Clear)
}

/// In its own frame the sheet moves down by as much as its pose moves up: no tick may use only one of the two.
#[test]
fn law_4_3_bug_vertices_bent_the_old_pose_while_their_frame_waited_for_the_scene() {
    for wait_ends in [true, false] {
        let mut rig = rig();
        known(&mut rig);
        assert_eq!(version(&rig), (Some(1), true));
        rig.scene_rev = rig.out.tick.header.scene_rev + 1;
        rig.row(1).position[2] = 6.0;
        let mut bent = full(2, at(-3.0));
        bent.header.seq = rig.seq + 1;
        send(&mut rig, vec![bent]);
        assert_eq!(version(&rig), (Some(1), true));
        rig.idle(FRAME_NS, ALL);
        assert_eq!(version(&rig), (Some(1), true));
        let scene_rev = rig.scene_rev;
        rig.scene_rev = 0;
        if wait_ends {
            let margin = Edit::Margin {
                name: None,
                report_within_m: Some(0.25),
            };
            rig.edit(vec![margin], ALL);
            assert_eq!(rig.out.tick.header.scene_rev, scene_rev);
            assert_eq!(version(&rig), (Some(2), true));
        } else {
            // The revision never comes, and the next frame contains everything.
            rig.idle(600_000_000, ALL);
            assert_eq!(version(&rig).0, Some(1));
            rig.send(ALL);
            assert_eq!(version(&rig), (Some(2), true));
        }
        // A range in order after the waiting one is accepted.
        send(&mut rig, vec![range(3, 2, 0, at(-2.5))]);
        assert_eq!(version(&rig), (Some(3), true));
        assert_eq!(status(&rig, 1), BodyStatus::Known);
    }
}

/// A body that the awaited edit puts does not exist before, so that its vertices must wait.
#[test]
fn law_4_3_bug_vertices_of_a_body_that_is_not_there_yet_were_refused_while_its_frame_waited() {
    let mut rig = rig();
    known(&mut rig);
    rig.edit(vec![Edit::Remove { name: "b1".into() }], ALL);
    let text = scene("", &[body(1, [0.0, 0.0, 3.0], SHEET, "deforms = true\n")]);
    let all = sweepd::scene::Scene::parse(&text, "s.toml", std::path::Path::new(".")).unwrap();
    let put = Edit::Put(Put {
        body: std::sync::Arc::new(all.bodies[0].clone()),
        shapes: sweepd::tick::build::build_shapes(&all).unwrap().bodies[0].clone(),
    });
    rig.scene_rev = rig.out.tick.header.scene_rev + 1;
    let mut bent = full(1, at(0.5));
    bent.header.seq = rig.seq + 1;
    send(&mut rig, vec![bent]);
    rig.edit(vec![put], ALL);
    assert_eq!(version(&rig), (Some(1), true));
    assert_eq!(status(&rig, 1), BodyStatus::Known);
    assert_eq!(rig.rejects(RejectReason::UnknownBody), 0);
}

/// A pause is processed before frames that wait, although its number is higher than theirs.
#[test]
fn bug_vertices_behind_a_frame_that_waited_were_held_for_ever_by_a_pause() {
    let mut rig = rig();
    known(&mut rig);
    rig.scene_rev = rig.out.tick.header.scene_rev + 1;
    let with = |rig: &Rig, version| {
        let mut frame = full(version, at(0.0));
        frame.header.seq = rig.seq + 1;
        frame
    };
    let first = with(&rig, 2);
    send(&mut rig, vec![first]);
    rig.scene_rev = 0;
    rig.flags = frame_flags::PAUSED;
    let rows = std::mem::take(&mut rig.rows);
    let second = with(&rig, 3);
    send(&mut rig, vec![second]);
    assert_eq!(version(&rig).0, Some(1), "both wait for the frame");
    let margin = Edit::Margin {
        name: None,
        report_within_m: Some(0.25),
    };
    rig.edit(vec![margin], ALL);
    assert_eq!(version(&rig).0, Some(3), "the pause was of a later number");
    let third = with(&rig, 4);
    send(&mut rig, vec![third]);
    assert_eq!(version(&rig).0, Some(4));
    rig.rows = rows;
}
