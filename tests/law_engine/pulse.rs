//! Law 4.4: a tick that takes longer than a heartbeat is announced meanwhile by a bare `tick` message. Each clock read
//! takes a millisecond here.

use sweepd::time::{Budget, Clock};
use sweepd::wire::{MessageHeader, Reason, RejectReason, State, WIRE_VERSION};
use sweepd::world::Edit;

use crate::rig::{ALL, NONE, Rig, ball_pairs, put_pairs};

const LOOK_NS: u64 = 1_000_000;
const HEARTBEAT_NS: u64 = 100_000_000;
const PAIRS: u64 = 450;

fn pairs() -> Rig {
    let mut rig = ball_pairs(PAIRS);
    put_pairs(&mut rig, PAIRS, [1.2, 1.2]);
    rig
}

#[test]
fn law_4_4_a_tick_longer_than_a_heartbeat_sends_tick_alone_between_its_slices() {
    let mut rig = pairs();
    // A row of a nonexistent body, so that a counter of the boot is not 0.
    rig.rows[0].body = 9_999;
    rig.send(Budget::time_ns(0));
    rig.rows[0].body = 1;
    let before = rig.out.tick;
    assert!(rig.pulses.is_empty(), "it took no time");
    rig.clock.step_each_read(LOOK_NS);
    let woke_ns = rig.clock.monotonic_ns();
    rig.send(ALL);
    rig.clock.step_each_read(0);
    let row = rig.out.tick;
    assert!(row.elapsed_ns > 4 * HEARTBEAT_NS);
    assert_eq!(row.colliding, PAIRS);
    assert!((3..=6).contains(&rig.pulses.len()), "{}", rig.pulses.len());
    let mut last_ns = woke_ns;
    for pulse in &rig.pulses {
        let wanted = MessageHeader {
            boot_id: row.header.boot_id,
            tick: row.header.tick,
            scene_rev: row.header.scene_rev,
            state: State::Unknown.code(),
            schema: WIRE_VERSION,
            ..MessageHeader::default()
        };
        assert_eq!(pulse.header, wanted);
        assert_eq!(pulse.reasons, Reason::Undecided.bit());
        assert_eq!((pulse.bodies, pulse.candidates), (2 * PAIRS, PAIRS));
        assert_eq!(pulse.cause, row.cause);
        // The announcement is the result of no frame.
        assert_eq!((pulse.sources_len, row.sources_len), (0, 1));
        // Counters of the boot do not decrease.
        assert_eq!(pulse.missed, before.missed);
        assert_eq!(pulse.rejects, row.rejects);
        assert!(pulse.sent_ns > last_ns);
        // Thirty clock reads of tolerance, for the frame and the earlier stages.
        let late_ns = pulse.sent_ns - last_ns;
        assert!(late_ns <= HEARTBEAT_NS + 30 * LOOK_NS, "{late_ns} ns");
        last_ns = pulse.sent_ns;
    }
    assert_eq!(rig.rejects(RejectReason::UnknownBody), 1);
    assert!(row.sent_ns > last_ns, "the tick itself is the newest");
}

/// All edits of a request are applied in one tick, however many they are.
#[test]
fn bug_while_a_large_request_was_applied_nobody_heard_of_it() {
    let mut rig = pairs();
    rig.send(ALL);
    rig.clock.step_each_read(LOOK_NS);
    let woke_ns = rig.clock.monotonic_ns();
    let bodies = 2 * PAIRS;
    let enable = |at: u64| Edit::Enable {
        name: format!("b{}", at % bodies + 1),
        enabled: at / bodies % 2 == 1,
    };
    rig.edit((0..4 * bodies).map(enable).collect(), NONE);
    rig.clock.step_each_read(0);
    let mut last_ns = woke_ns;
    for pulse in &rig.pulses {
        assert!(pulse.sent_ns - last_ns <= HEARTBEAT_NS + 30 * LOOK_NS);
        assert_eq!(pulse.header.tick, rig.out.tick.header.tick);
        last_ns = pulse.sent_ns;
    }
    // One clock read per eight edits, both when they are checked and when they are applied.
    assert!((8..=11).contains(&rig.pulses.len()), "{}", rig.pulses.len());
}

#[test]
fn law_4_4_a_tick_that_ends_within_a_heartbeat_sends_nothing_beside() {
    let mut rig = pairs();
    rig.clock.step_each_read(LOOK_NS / 10);
    rig.send(ALL);
    assert!(rig.out.tick.elapsed_ns > HEARTBEAT_NS / 4);
    assert!(rig.pulses.is_empty());
}
