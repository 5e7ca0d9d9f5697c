//! What every door checks of a request before anybody reads it: that its frame holds together.

use crate::limits;
use crate::wire::{Answer, RequestHeader, WIRE_VERSION};

/// Why a request's frame does not hold together.
pub(super) fn unreadable(header: &RequestHeader, len: usize) -> Option<String> {
    if header.schema != WIRE_VERSION {
        return Some(format!(
            "the request speaks wire version {}, the daemon {WIRE_VERSION}",
            header.schema
        ));
    }
    if len > limits::REQUEST_BYTES_MAX {
        return Some(format!(
            "the request has {len} bytes, at most {} are read",
            limits::REQUEST_BYTES_MAX
        ));
    }
    let json_len = usize::try_from(header.json_len).unwrap_or(usize::MAX);
    (json_len > len)
        .then(|| format!("the request says {json_len} bytes of JSON and has {len} in all"))
}

/// What a request comes to that no daemon has any more.
pub(super) const UNANSWERED: &str = "no daemon has this request any more: the one that it went to has ended, or none was \
    there. Whether it was done is not known (`sweepd list` says which daemons run)";

/// The JSON of a refusal.
pub(super) fn refusal(error: String) -> String {
    let answer = Answer {
        error: Some(error),
        ..Answer::default()
    };
    serde_json::to_string(&answer).unwrap_or_default()
}
