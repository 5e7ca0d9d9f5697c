//! Requests: JSON in the words of scene files, then vertex and index blobs, little-endian.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::{GapFound, ImpactFound, RayFound, TouchingFound};

/// User header of a request; the payload is `json_len` bytes of JSON, then the blobs it names by offset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.RequestHeader")]
pub struct RequestHeader {
    /// Bytes of JSON at the front of the payload.
    pub json_len: u64,
    /// The client's number for this request, echoed.
    pub request: u64,
    /// `WIRE_VERSION` of the sender.
    pub schema: u32,
    /// Zero.
    pub reserved: u32,
}

/// User header of an answer; the payload is JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.AnswerHeader")]
pub struct AnswerHeader {
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// The client's number of the request.
    pub request: u64,
    /// `WIRE_VERSION`.
    pub schema: u32,
    /// 1: done, 0: refused.
    pub ok: u32,
}

/// The JSON of an answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Whether everything in the request was done; if not, nothing was.
    pub ok: bool,
    /// Scene revision from which on it holds.
    pub scene_rev: u64,
    /// What was wrong, where, and what to change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Things to know that did not stop it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// What was asked for, where a gap was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<GapFound>,
    /// What was asked for, where it was what a body or a shape touches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touching: Option<TouchingFound>,
    /// What was asked for, where it was what a ray hits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ray: Option<RayFound>,
    /// What was asked for, where it was when two bodies touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impact: Option<ImpactFound>,
}
