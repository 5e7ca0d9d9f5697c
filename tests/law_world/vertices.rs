//! Vertices that are refused before their body is looked up.

use sweepd::wire::{
    BodyStatus, RejectReason, VertexFrame, VertexHeader, WIRE_VERSION, name_bytes, vertex_flags,
};
use sweepd::world::Admission;

use crate::support::{Bench, MS, cloth, moving, row};

/// Sends all vertices of the sheet, with the header changed by `change`.
fn bend(bench: &mut Bench, version: u64, change: impl FnOnce(&mut VertexHeader)) -> Admission {
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let mut frame = VertexFrame {
        header: VertexHeader {
            session: 1,
            seq: version,
            body: bench.body("cloth").id.0,
            version,
            number: version,
            source: name_bytes("sim"),
            count: 4,
            total: 4,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        rows: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
        received_ns: bench.now_ns,
        ..VertexFrame::default()
    };
    change(&mut frame.header);
    bench.world.admit_vertices(&frame, bench.now_ns)
}

/// A sheet with known pose and vertices, whose source continues to send poses.
fn known_sheet() -> Bench {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.world.set_boot(7);
    bench.edit(cloth());
    step(&mut bench, 1);
    bend(&mut bench, 1, |_| {});
    step(&mut bench, 2);
    assert_eq!(bench.status("cloth"), BodyStatus::Known);
    bench
}

fn step(bench: &mut Bench, seq: u64) {
    let sheet = bench.body("cloth").id.0;
    bench.send(MS, "sim", seq, &[row(1, 0.0), row(sheet, 5.0)]);
}

/// A change that makes a message unreadable, and the reason for its refusal.
type Wrong = (fn(&mut VertexHeader), RejectReason);

#[test]
fn bug_a_sheet_whose_newest_vertices_were_refused_for_their_layout_or_boot_stayed_known() {
    let wrongs: [Wrong; 2] = [
        (|header| header.schema += 1, RejectReason::BadLayout),
        (|header| header.boot = 8, RejectReason::SessionOver),
    ];
    for (wrong, reason) in wrongs {
        let mut bench = known_sheet();
        let admission = bend(&mut bench, 2, wrong);
        assert!(
            matches!(admission, Admission::Refused { source: Some(_), reason: told } if told == reason),
            "{admission:?}"
        );
        // Valid poses do not make the vertices valid.
        step(&mut bench, 3);
        assert_eq!(bench.status("cloth"), BodyStatus::Rejected);
        assert_eq!(bench.body("cloth").reject, Some(reason));
        assert_eq!(bench.status("a"), BodyStatus::Known);
        bend(&mut bench, 3, |_| {});
        step(&mut bench, 4);
        assert_eq!(bench.status("cloth"), BodyStatus::Known);
    }
}

#[test]
fn vertices_of_a_session_that_is_not_in_force_make_no_sheet_unknown() {
    let mut bench = known_sheet();
    for wrong in [
        (|header: &mut VertexHeader| (header.schema, header.session) = (9, 2))
            as fn(&mut VertexHeader),
        |header| (header.boot, header.session) = (8, 2),
        |header| header.session = 0,
    ] {
        bend(&mut bench, 2, wrong);
        step(&mut bench, 3);
        assert_eq!(bench.status("cloth"), BodyStatus::Known);
    }
}
