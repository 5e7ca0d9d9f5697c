//! Round trips are exact to the bit, and truncated or changed bytes cause no panic.

use super::*;
use crate::record::given::{Asked, Between, EditRecord, Origin, TreeMark};
use crate::shape::Contents;
use crate::wire::{PairRow, TransformRow, VertexHeader, name_bytes};
use crate::world::Applied;

/// Floats that change unless their bits are copied.
const ODD: [u64; 5] = [
    0x7ff8_0000_0000_1234,
    0xfff0_0000_0000_0001,
    0x8000_0000_0000_0000,
    0x0000_0000_0000_0001,
    0x7ff0_0000_0000_0000,
];

fn odd(at: usize) -> f64 {
    f64::from_bits(ODD[at % ODD.len()])
}

fn full() -> TickRecord {
    let mut record = TickRecord {
        now_ns: u64::MAX,
        ask: Ask {
            demand: Demand::ALL,
            budget: Budget {
                time_ns: Some(u64::MAX),
                units: Some(0),
            },
            cause: TickCause::Edit,
            cause_source: Some(15),
            woke_ns: 3,
        },
        ..TickRecord::default()
    };
    let tree = TreeMark {
        body: 9,
        generation: 2,
        updates: u64::MAX,
    };
    record.between = vec![
        Between::Skipped {
            source: None,
            frames: 4,
        },
        Between::Timeout {
            source: 3,
            timeout_ns: 5,
        },
        Between::TreeAsked(tree),
        Between::TreeBuilt(tree, true),
        Between::TreeRefused(tree),
        Between::Mode("rate=100".to_owned()),
    ];
    let files = Contents::from([("a/ü.stl".to_owned(), vec![1, 2, 3].into())]);
    let asked = Asked {
        json_len: 2,
        payload: b"{}\x00\xff".to_vec(),
        files,
    };
    let done = Ok(Applied {
        scene_rev: 7,
        changed: true,
    });
    record.edits = [
        (Origin::Asked(asked), done),
        (Origin::Margin(Some(-0.0)), Err("no".to_owned())),
        (Origin::Margin(None), Err(String::new())),
        (Origin::Reset, Err("never".to_owned())),
    ]
    .map(|(origin, outcome)| EditRecord {
        token: u64::MAX,
        origin,
        outcome,
    })
    .to_vec();
    fill_inbox(&mut record.inbox);
    record.out.tick.header.tick = 12;
    record.out.tick.widest_m = odd(0);
    record.out.pairs = vec![PairRow {
        gap_best_m: odd(1),
        toi_max: odd(2),
        flags: 255,
        ..PairRow::default()
    }];
    record.out.body_verdicts = vec![0, 4, 255];
    record.out.plan = "{}".to_owned();
    record.out.plan_changed = true;
    record
}

fn fill_inbox(inbox: &mut Inbox) {
    let frame = inbox.push();
    frame.header.source = name_bytes("sim");
    frame.waited = true;
    frame.refused = Some(RejectReason::OverLimit);
    frame.transforms = (0..3)
        .map(|at| TransformRow {
            body: 1,
            position: [odd(at), odd(at + 1), odd(at + 2)],
            orientation: [odd(4), odd(3), odd(2), odd(1)],
            ..TransformRow::default()
        })
        .collect();
    frame.velocities = vec![[odd(0); 6]];
    frame.stamps_ns = vec![u64::MAX];
    frame.since_ns = vec![7];
    (frame.first_seq, frame.cut) = (u64::MAX - 1, true);
    frame.refused_bodies = vec![(8, RejectReason::BadChain)];
    // A frame without rows.
    inbox.push();
    let vertices = inbox.push_vertices();
    vertices.header = VertexHeader {
        version: 5,
        ..VertexHeader::default()
    };
    vertices.rows = vec![[f32::from_bits(0x7fc0_0101), -0.0, f32::MIN_POSITIVE]];
    inbox.end_session(77);
}

fn bytes(record: &TickRecord) -> (Vec<u8>, Vec<u8>) {
    let (mut input, mut output) = (Vec::new(), Vec::new());
    put_input(record, &mut input);
    put_output(&record.out, record.ask.demand, &mut output);
    (input, output)
}

#[test]
fn a_tick_comes_back_bit_by_bit() {
    let mut back = TickRecord::default();
    for record in [full(), TickRecord::default(), full()] {
        let (input, output) = bytes(&record);
        assert_eq!(
            take_input(&input, &mut back),
            Ok(record.out.tick.header.tick)
        );
        take_output(&output, &mut back.out).unwrap();
        assert_eq!(bytes(&back), (input, output));
        assert_eq!(
            (&back.between, &back.edits),
            (&record.between, &record.edits)
        );
        assert_eq!((back.ask, back.now_ns), (record.ask, record.now_ns));
    }
    let [frame, empty] = back.inbox.frames() else {
        panic!("two frames")
    };
    let bits = frame.transforms[0].position.map(f64::to_bits);
    assert_eq!(bits, [ODD[0], ODD[1], ODD[2]]);
    assert_eq!(frame.velocities[0][5].to_bits(), ODD[0]);
    assert!(empty.transforms.is_empty() && empty.refused.is_none() && !empty.waited);
    assert_eq!(back.inbox.vertices()[0].rows[0][0].to_bits(), 0x7fc0_0101);
    assert_eq!(back.inbox.ended(), [77]);
    assert_eq!(back.out.pairs[0].gap_best_m.to_bits(), ODD[1]);
}

#[test]
fn what_is_cut_off_anywhere_is_refused() {
    let (input, output) = bytes(&full());
    let mut into = TickRecord::default();
    for len in 0..input.len() {
        assert_eq!(take_input(&input[..len], &mut into), Err(Damaged), "{len}");
    }
    for len in 0..output.len() {
        let taken = take_output(&output[..len], &mut into.out);
        assert_eq!(taken, Err(Damaged), "{len}");
    }
    let longer = [input, vec![0]].concat();
    assert_eq!(take_input(&longer, &mut into), Err(Damaged));
}

#[test]
fn any_changed_byte_is_read_or_refused_without_a_panic_or_much_memory() {
    let (input, output) = bytes(&full());
    let mut into = TickRecord::default();
    for at in 0..input.len() {
        let mut changed = input.clone();
        changed[at] ^= 0xff;
        let _ = take_input(&changed, &mut into);
    }
    for at in 0..output.len() {
        let mut changed = output.clone();
        changed[at] ^= 0xff;
        let _ = take_output(&changed, &mut into.out);
    }
    assert!(into.bytes() < 1 << 20, "{}", into.bytes());
}

#[test]
fn a_start_comes_back_and_another_layout_is_refused() {
    let start = Start {
        facts: Facts {
            layout: LAYOUT,
            wire_version: WIRE_VERSION,
            sweepd_version: "0.1.0".to_owned(),
            boot_id: u64::MAX,
            started_ns: u64::MAX - 1,
            mode: "on_all".to_owned(),
            budget_units: Some(5),
            ..Facts::default()
        },
        scene: "[[body]]\n".to_owned(),
        files: Contents::from([("a.stl".to_owned(), vec![0; 9].into())]),
    };
    assert_eq!(start_of(&start_bytes(&start)).unwrap(), start);
    let mut other = start.clone();
    other.facts.wire_version += 1;
    let error = start_of(&start_bytes(&other)).unwrap_err().to_string();
    assert!(
        error.contains("wire version 2 and this sweepd 1"),
        "{error}"
    );
    let bytes = start_bytes(&start);
    assert!(start_of(&bytes[..bytes.len() - 1]).is_err());
    assert!(start_of(b"").is_err());
}
