//! Goal: the Rust structs and codes equal those of the ROS 2 interfaces: field names, types, order, constants. Method:
//! `data/ros2_types.txt` has every type according to rosidl's JSON type descriptions (a ROS 2 test compares it with the
//! generator); each struct is traced through serde, as CDR reads it, and compared with this file. Constants are read
//! from the interface files and compared with the codes of the wire.
#![cfg(feature = "ros2")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests"
)]

mod trace;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sweepd::wire::ros;
use sweepd::wire::{
    BroadCause, BroadMode, ContactKind, EndCause, Event, Level, Reason, RejectReason, Stage, State,
    TickCause, Verdict, contact_flags, frame_flags, pair_flags,
};
use trace::{Kind, trace};

/// Folder of the interfaces.
fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("msgs/sweepd_msgs")
}

/// The constants of an interface file, by name.
fn constants(file: &str) -> BTreeMap<String, u64> {
    let text = std::fs::read_to_string(package().join(file)).unwrap();
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

/// Words of codes as names of constants: `source lost` becomes `SOURCE_LOST`.
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

fn flags_of_pairs() -> [(&'static str, u64); 8] {
    [
        ("touching", u64::from(pair_flags::TOUCHING)),
        ("estimate", u64::from(pair_flags::ESTIMATE)),
        ("unknown_body", u64::from(pair_flags::UNKNOWN_BODY)),
        ("held_body", u64::from(pair_flags::HELD_BODY)),
        ("gone", u64::from(pair_flags::GONE)),
        ("swept_hit", u64::from(pair_flags::SWEPT_HIT)),
        ("swept_open", u64::from(pair_flags::SWEPT_OPEN)),
        ("teleported", u64::from(pair_flags::TELEPORTED)),
    ]
}

/// Codes of the wire per interface, by the names of the constants.
type Codes = Vec<(&'static str, BTreeMap<String, u64>)>;

fn bits(
    words: &'static [(&'static str, u64)],
) -> impl Iterator<Item = (&'static str, u64)> + 'static {
    words.iter().copied()
}

fn codes_of_messages() -> Codes {
    vec![
        ("msg/TickHeader.msg", named("", codes!(State)).collect()),
        (
            "msg/State.msg",
            named(
                "",
                Reason::ALL.iter().map(|r| (r.word(), u64::from(r.bit()))),
            )
            .collect(),
        ),
        (
            "msg/Pair.msg",
            named("", codes!(Verdict))
                .chain(named(
                    "",
                    Event::ALL.iter().map(|e| (e.word(), u64::from(e.bit()))),
                ))
                .chain(named("END_", codes!(EndCause)))
                .chain(named("", codes!(Level)))
                .chain(named("", flags_of_pairs().into_iter()))
                .collect(),
        ),
        (
            "msg/Contact.msg",
            // `GONE` is for `contact_changes`, which ROS 2 does not have.
            named("", codes!(ContactKind))
                .filter(|(name, _)| name != "GONE")
                .chain(named(
                    "",
                    bits(&[
                        ("estimate", contact_flags::ESTIMATE as u64),
                        ("no_triangle", u32::MAX as u64),
                    ]),
                ))
                .collect(),
        ),
        (
            "msg/Tick.msg",
            named("", codes!(TickCause))
                .chain(named("BROAD_MODE_", codes!(BroadMode)))
                .chain(named("BROAD_CAUSE_", codes!(BroadCause)))
                .chain(named("STAGE_", codes!(Stage)))
                .chain(named("REJECT_", codes!(RejectReason)))
                .chain(named(
                    "",
                    bits(&[("no_source", 255), ("unlimited", u64::MAX)]),
                ))
                .collect(),
        ),
        (
            "msg/BodyTransforms.msg",
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
            "msg/Name.msg",
            named("", bits(&[("no_source", u32::MAX as u64)])).collect(),
        ),
        (
            "msg/Source.msg",
            named("", bits(&[("never", u64::MAX)])).collect(),
        ),
    ]
}

fn codes_of_services() -> Codes {
    vec![
        ("srv/Gap.srv", named("", codes!(Verdict)).collect()),
        (
            "srv/SetFilter.srv",
            named(
                "",
                bits(&[
                    ("masks", ros::SetFilter::MASKS as u64),
                    ("ignore", ros::SetFilter::IGNORE as u64),
                    ("check", ros::SetFilter::CHECK as u64),
                    ("drop", ros::SetFilter::DROP as u64),
                ]),
            )
            .collect(),
        ),
    ]
}

#[test]
fn the_constants_of_the_interfaces_are_the_codes_of_the_wire() {
    let wanted = [codes_of_messages(), codes_of_services()].concat();
    for (file, wanted) in &wanted {
        assert_eq!(constants(file), *wanted, "{file}");
    }
    for folder in ["msg", "srv"] {
        for entry in std::fs::read_dir(package().join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let file = format!("{folder}/{name}");
            assert!(
                wanted.iter().any(|(compared, _)| *compared == file) || constants(&file).is_empty(),
                "{file} has constants that are compared with nothing"
            );
        }
    }
}

/// Types by name: fields with their types, in order.
type Described = BTreeMap<String, Vec<(String, String)>>;

fn described() -> Described {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ros2_types.txt");
    let mut all = Described::new();
    let mut last = String::new();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let (left, right) = line.trim().split_once(' ').unwrap();
        if line.starts_with(' ') {
            let field = (left.to_owned(), right.to_owned());
            all.get_mut(&last).unwrap().push(field);
        } else {
            left.clone_into(&mut last);
            all.insert(last.clone(), Vec::new());
        }
    }
    all
}

/// Differences between a traced kind and the type of this name; empty: there are none.
fn differences(types: &Described, path: &str, wanted: &str, kind: &Kind) -> Vec<String> {
    let differs = || vec![format!("{path}: {wanted} in ROS 2, {kind:?} in Rust")];
    if let Some(element) = wanted.strip_suffix(']') {
        let (element, count) = element.split_once('[').unwrap();
        let path = format!("{path}[]");
        return match (kind, count) {
            (Kind::Array(len, inside), count) if count == len.to_string() => {
                differences(types, &path, element, inside)
            }
            // The sender checks a bound; on the wire it is a sequence.
            (Kind::Sequence(inside), count) if count.is_empty() || count.starts_with("<=") => {
                differences(types, &path, element, inside)
            }
            _ => differs(),
        };
    }
    let Kind::Fields(fields) = kind else {
        // On the wire a struct with one field is that field.
        if let Some([(_, only)]) = types.get(wanted).map(Vec::as_slice) {
            return differences(types, path, only, kind);
        }
        // A byte has eight bits under either name.
        let wanted_word = if wanted == "byte" { "uint8" } else { wanted };
        let same = matches!(kind, Kind::Word(word) if *word == wanted_word);
        return if same { Vec::new() } else { differs() };
    };
    let Some(described) = types.get(wanted) else {
        return differs();
    };
    let names: Vec<&str> = fields.iter().map(|field| field.0).collect();
    let wanted_names: Vec<&str> = described.iter().map(|field| field.0.as_str()).collect();
    if names != wanted_names {
        return vec![format!(
            "{path} ({wanted}): {wanted_names:?} in ROS 2, {names:?} in Rust"
        )];
    }
    let pairs = fields.iter().zip(described);
    pairs
        .flat_map(|((name, kind), (_, wanted))| {
            differences(types, &format!("{path}.{name}"), wanted, kind)
        })
        .collect()
}

macro_rules! compare {
    ($($wanted:literal $rust:ty,)+) => {{
        let types = described();
        let mut found = Vec::new();
        $(found.extend(differences(&types, stringify!($rust), $wanted, &trace::<$rust>()));)+
        found
    }};
}

#[test]
fn the_structs_are_the_types_of_ros_2() {
    let found = compare! {
        "sweepd_msgs/msg/BodyTransforms" ros::BodyTransforms,
        "sweepd_msgs/msg/Contacts" ros::Contacts,
        "sweepd_msgs/msg/Names" ros::Names,
        "sweepd_msgs/msg/Pairs" ros::Pairs,
        "sweepd_msgs/msg/State" ros::State,
        "sweepd_msgs/msg/Tick" ros::Tick,
        "tf2_msgs/msg/TFMessage" ros::TfMessage,
        "geometry_msgs/msg/PoseStamped" ros::PoseStamped,
        "nav_msgs/msg/Odometry" ros::Odometry,
        "rosgraph_msgs/msg/Clock" ros::Clock,
        "visualization_msgs/msg/MarkerArray" ros::MarkerArray,
        "diagnostic_msgs/msg/DiagnosticArray" ros::DiagnosticArray,
        "sweepd_msgs/srv/PutBody_Request" ros::PutBody,
        "sweepd_msgs/srv/PutBody_Response" ros::Edited,
        "sweepd_msgs/srv/RemoveBody_Request" ros::RemoveBody,
        "sweepd_msgs/srv/RemoveBody_Response" ros::Edited,
        "sweepd_msgs/srv/EnableBody_Request" ros::EnableBody,
        "sweepd_msgs/srv/EnableBody_Response" ros::Edited,
        "sweepd_msgs/srv/AttachBody_Request" ros::AttachBody,
        "sweepd_msgs/srv/AttachBody_Response" ros::Edited,
        "sweepd_msgs/srv/SetFilter_Request" ros::SetFilter,
        "sweepd_msgs/srv/SetFilter_Response" ros::Edited,
        "sweepd_msgs/srv/Reset_Request" ros::Reset,
        "sweepd_msgs/srv/Reset_Response" ros::Edited,
        "sweepd_msgs/srv/Gap_Request" ros::Gap,
        "sweepd_msgs/srv/Gap_Response" ros::GapTold,
        "sweepd_msgs/srv/TickNow_Request" ros::TickNow,
        "sweepd_msgs/srv/TickNow_Response" ros::Ticked,
        "ros_gz_interfaces/msg/Contacts" ros::GzContacts,
    };
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_struct_that_differs_is_named_with_the_field() {
    let types = described();
    let kind = trace::<ros::Pairs>();
    let found = differences(&types, "Pairs", "sweepd_msgs/msg/Contacts", &kind);
    assert!(
        found[0].contains("\"contacts\"") && found[0].contains("\"pairs\""),
        "{found:?}"
    );
    let found = differences(
        &types,
        "x",
        "uint8[4]",
        &Kind::Array(3, Box::new(Kind::Word("uint8"))),
    );
    assert_eq!(found.len(), 1);
}
