//! Answers to questions on demand, as JSON: what the daemon found, with the tick whose poses it used. Metres, scene
//! frame.

use serde::{Deserialize, Serialize};

use super::MessageHeader;

/// What is known of the gap of A and B. Metres, scene frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapKnown {
    /// `Verdict`.
    pub verdict: u8,
    /// Whether the query was finished, with 0 inside its rounding interval.
    pub touching: bool,
    /// Proved lower end of the gap, signed; `None`: nothing is known.
    pub gap_min_m: Option<f64>,
    /// Proved upper end of the gap, signed; `None`: nothing is known.
    pub gap_max_m: Option<f64>,
    /// Best estimate of the gap, signed; `None`: none.
    pub gap_best_m: Option<f64>,
    /// Closest or deepest point on A; `None`: none.
    pub point_a: Option<[f64; 3]>,
    /// Closest or deepest point on B; `None`: none.
    pub point_b: Option<[f64; 3]>,
    /// Unit, from A to B; `None`: none.
    pub normal: Option<[f64; 3]>,
}

/// The gap of two bodies that a request asked for. Metres, scene frame; A and B as the request names them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapFound {
    /// Header of the tick whose poses were used.
    pub tick_header: MessageHeader,
    /// Age of the older of the two poses when the work on the answer began, nanoseconds of `CLOCK_BOOTTIME`; `None`:
    /// neither body is one that moves.
    #[serde(default)]
    pub age_ns: Option<u64>,
    /// What is known of it.
    #[serde(flatten)]
    pub known: GapKnown,
}

/// Which bodies a body, or a shape that is none, touches or would touch at a pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TouchingFound {
    /// Header of the tick whose poses were used.
    pub tick_header: MessageHeader,
    /// Whether every body that has no row, and that no filter leaves out, was proved farther away than asked for: none
    /// is unknown, none left out.
    pub complete: bool,
    /// The body asked for, then those that hang on it and go with it; empty: a shape was asked for.
    pub asked: Vec<String>,
    /// Where it was put.
    pub position: [f64; 3],
    /// How it was put: x, y, z, w.
    pub orientation: [f64; 4],
    /// One for each pair of an asked one and another body that is not proved farther apart than asked for; worst first.
    pub rows: Vec<TouchingRow>,
    /// Pairs near enough by their boxes for which there was no room: nothing is known of them.
    pub left_out: u64,
    /// Pairs near enough by their boxes that are not looked at: a filter leaves them out, or the other is disabled.
    pub ignored: u64,
    /// Bodies whose place is not known, so that they may be near; one held at an old pose has a row, too, where that is
    /// near.
    pub unknown: Vec<UnknownBody>,
    /// Such bodies for whose names there was no room.
    pub unknown_left_out: u64,
}

/// A body that is near an asked one, or may be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TouchingRow {
    /// Name of the asked body; `None`: a shape was asked for.
    pub a: Option<String>,
    /// Name of the other.
    pub b: String,
    /// What is known of their gap; `near` is what is apart and no farther than asked for.
    #[serde(flatten)]
    pub known: GapKnown,
    /// Age of the oldest received pose that it rests on when the work began, nanoseconds of `CLOCK_BOOTTIME`; `None`:
    /// it rests on none.
    pub age_ns: Option<u64>,
}

/// What a ray hits first. Metres, scene frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RayFound {
    /// Header of the tick whose poses were used.
    pub tick_header: MessageHeader,
    /// `Verdict`: colliding, where a hit is certified; apart, where it is proved that there is none; else possible.
    pub verdict: u8,
    /// Whether no body can be hit sooner than told: none is unknown, left out or `possible`.
    pub complete: bool,
    /// Name of the body that is hit; `None`: none is certified.
    pub body: Option<String>,
    /// The ray was proved free of the bodies whose places are known up to here.
    pub t_min_m: f64,
    /// It has hit the body by here; `None`: no hit is certified.
    pub t_max_m: Option<f64>,
    /// Best estimate of the distance to the hit.
    pub t_best_m: Option<f64>,
    /// The hit.
    pub point: Option<[f64; 3]>,
    /// Of the body's surface there, unit, outward or against the ray; `None`: no hit, or the ray begins within the
    /// body.
    pub normal: Option<[f64; 3]>,
    /// Whether the ray begins within the body.
    pub inside: bool,
    /// Place of the shape that is hit in the body.
    pub shape: Option<u32>,
    /// Its triangle; `None`: it has none.
    pub triangle: Option<u32>,
    /// Age of the body's pose when the work began, nanoseconds of `CLOCK_BOOTTIME`; `None`: it cannot move.
    pub age_ns: Option<u64>,
    /// Names of bodies that may be hit sooner: rounding, or the end of the work, leaves it open.
    pub possible: Vec<String>,
    /// Bodies whose boxes the ray passes that are not looked at: of none of the groups, or disabled.
    pub ignored: u64,
    /// Bodies whose boxes it passes for which there was no room, and which may be hit sooner.
    pub left_out: u64,
    /// Bodies whose place is not known: they may be hit sooner.
    pub unknown: Vec<UnknownBody>,
    /// Such bodies for whose names there was no room.
    pub unknown_left_out: u64,
}

/// When two bodies touch first. Seconds from the tick's poses; velocities in the scene's frame, metres and radians a
/// second, as they were taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImpactFound {
    /// Header of the tick whose poses were used.
    pub tick_header: MessageHeader,
    /// Age of the older of the two poses when the work began, nanoseconds of `CLOCK_BOOTTIME`; `None`: neither moves.
    pub age_ns: Option<u64>,
    /// `Verdict`: colliding, where a touch on the way is certified; apart, where it is proved that there is none; else
    /// possible.
    pub verdict: u8,
    /// They were proved apart until here.
    pub t_min_s: f64,
    /// They have touched by here; `None`: no touch is certified.
    pub t_max_s: Option<f64>,
    /// Of the origin of A's frame.
    pub linear_a: [f64; 3],
    /// Of A.
    pub angular_a: [f64; 3],
    /// Of the origin of B's frame.
    pub linear_b: [f64; 3],
    /// Of B.
    pub angular_b: [f64; 3],
}

/// A body whose place is not known.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnknownBody {
    /// Its name.
    pub body: String,
    /// Word of its `BodyStatus`.
    pub status: String,
}
