//! Goal: the Rust structs and codes are those of the ROS 2 interfaces: field names, types, order, constants.
//! Method: `data/ros2_types.txt` has every type as rosidl's JSON type descriptions say (a ROS 2 test holds it against the
//! generator); each struct is traced through serde, as CDR reads it, and compared with it. Constants are read from the
//! `.msg` files and compared with the codes of the wire.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests"
)]

use std::collections::BTreeMap;
use std::path::Path;

use sweepd::wire::{
    ContactKind, EndCause, Event, Level, Reason, RejectReason, Stage, State, TickCause, Verdict,
    contact_flags, frame_flags, pair_flags,
};

/// The constants of a `.msg` file, by name.
fn constants(message: &str) -> BTreeMap<String, u64> {
    let path = format!("msgs/sweepd_msgs/msg/{message}.msg");
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    let mut all = BTreeMap::new();
    for line in text.lines() {
        let code = line.split('#').next().unwrap();
        if let Some((left, value)) = code.split_once('=') {
            let name = left.split_whitespace().nth(1).unwrap();
            all.insert(name.to_owned(), value.trim().parse().unwrap());
        }
    }
    all
}

/// Words of codes as constants: `source lost` is `SOURCE_LOST`.
fn named<'a>(
    prefix: &'a str,
    codes: impl Iterator<Item = (&'static str, u64)> + 'a,
) -> impl Iterator<Item = (String, u64)> + 'a {
    codes.map(move |(word, value)| {
        let name = word.to_ascii_uppercase().replace(' ', "_");
        (format!("{prefix}{name}"), value)
    })
}

macro_rules! codes {
    ($code:ident) => {
        $code::ALL.iter().map(|c| (c.word(), u64::from(c.code())))
    };
}

#[test]
fn the_constants_of_the_messages_are_the_codes_of_the_wire() {
    let bits = |words: &'static [(&'static str, u64)]| words.iter().copied();
    let wanted: Vec<(&str, BTreeMap<String, u64>)> = vec![
        ("TickHeader", named("", codes!(State)).collect()),
        (
            "State",
            named(
                "",
                Reason::ALL.iter().map(|r| (r.word(), u64::from(r.bit()))),
            )
            .collect(),
        ),
        (
            "Pair",
            named("", codes!(Verdict))
                .chain(named(
                    "",
                    Event::ALL.iter().map(|e| (e.word(), u64::from(e.bit()))),
                ))
                .chain(named("END_", codes!(EndCause)))
                .chain(named("", codes!(Level)))
                .chain(named(
                    "",
                    [
                        ("touching", u64::from(pair_flags::TOUCHING)),
                        ("estimate", u64::from(pair_flags::ESTIMATE)),
                        ("unknown_body", u64::from(pair_flags::UNKNOWN_BODY)),
                        ("held_body", u64::from(pair_flags::HELD_BODY)),
                        ("gone", u64::from(pair_flags::GONE)),
                    ]
                    .into_iter(),
                ))
                .collect(),
        ),
        (
            "Contact",
            named("", codes!(ContactKind))
                .chain(named(
                    "",
                    [("estimate", u64::from(contact_flags::ESTIMATE))].into_iter(),
                ))
                .chain(named("", bits(&[("no_triangle", u32::MAX as u64)])))
                .collect(),
        ),
        (
            "Tick",
            named("", codes!(TickCause))
                .chain(named("STAGE_", codes!(Stage)))
                .chain(named("REJECT_", codes!(RejectReason)))
                .chain(named(
                    "",
                    bits(&[("no_source", 255), ("unlimited", u64::MAX)]),
                ))
                .collect(),
        ),
        (
            "BodyTransforms",
            named(
                "",
                [
                    ("full", u64::from(frame_flags::FULL)),
                    ("partial", u64::from(frame_flags::PARTIAL)),
                    ("paused", u64::from(frame_flags::PAUSED)),
                ]
                .into_iter(),
            )
            .collect(),
        ),
        (
            "Name",
            named("", bits(&[("no_source", u32::MAX as u64)])).collect(),
        ),
        ("Source", named("", bits(&[("never", u64::MAX)])).collect()),
    ];
    for (message, wanted) in wanted {
        assert_eq!(constants(message), wanted, "{message}.msg");
    }
}
