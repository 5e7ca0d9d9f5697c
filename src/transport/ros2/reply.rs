//! Sends responses of services, none larger than what reaches the client. In: a response. Out: the same, or the part of
//! it that fits, with a note that the rest is missing.
//!
//! Why: DDS sends a response with the id of its request as inline `QoS`. `RustDDS` 0.15.1 writes one byte too many
//! there when it fragments the response (the tag of its `Option` in front of the inline `QoS` of a `DATA_FRAG`). No
//! reader can decode such a response, and all later ones wait for it: one oversized response silences the service for
//! all clients. Messages of topics have no inline `QoS`, and arrive whole at any size.
//!
//! Refused: our own copy of `RustDDS` without that byte, as long as no client needs larger responses.

use ros2_client::parameters::raw::SetParametersResult;
use ros2_client::rcl_interfaces::{
    DescribeParametersResponse, GetParameterTypesResponse, GetParametersResponse,
    ListParametersResponse, SetParametersAtomicallyResponse, SetParametersResponse,
};
use ros2_client::{Message, RmwRequestId, Server};
use rustdds::CDRSerializerAdapter;
use rustdds::no_key::SerializerAdapter as _;

use super::shared::{Say, Shared};
use crate::limits::{ROS_REPLY_BYTES_MAX, ROS_REPLY_TEXT_BYTES_MAX};
use crate::time::{Clock, SystemClock};
use crate::wire::ros::{Edited, GapTold, Ticked};

/// Size of the CDR header before the first field of a message, which names the encoding, bytes.
const HEAD_BYTES: usize = 4;

/// Longest text about the parts that a response lost, bytes: readers of `/rosout` have small buffers.
const SAID_BYTES_MAX: usize = 1 << 16;

/// A response that can be shortened.
pub(super) trait Reply: Message + Clone + 'static {
    /// Makes it fit; returns the part left out, as text.
    fn shorten(&mut self) -> String;
}

/// Sends a response. If it is too large, sends the part that fits and reports the rest on `/rosout`.
///
/// * `name` - name of the service, for messages.
pub(super) fn send<Q: Message + Clone + 'static, R: Reply>(
    (server, name): (&Server<Q, R>, &str),
    id: RmwRequestId,
    mut reply: R,
    shared: &Shared,
) {
    if !fits(&reply) {
        let lost = reply.shorten();
        let mut text = format!(
            "an answer of {name} is cut short, as more than {ROS_REPLY_BYTES_MAX} bytes would not arrive: {lost}"
        );
        text.truncate(text.floor_char_boundary(SAID_BYTES_MAX));
        shared.say_seldom(Say::Error, &text, SystemClock.boottime_ns());
    }
    let sent = server.send_response(id, reply);
    shared.note_unsent(u64::from(sent.is_err()));
}

fn fits<R: Message>(reply: &R) -> bool {
    let bytes = CDRSerializerAdapter::<R>::to_bytes(reply);
    bytes.is_ok_and(|bytes| bytes.len() + HEAD_BYTES <= ROS_REPLY_BYTES_MAX)
}

/// The largest number of rows, up to `len`, with which the response fits; 0 if it does not fit with any.
fn most(len: usize, fits_with: impl Fn(usize) -> bool) -> usize {
    let (mut fit, mut over) = (0, len + 1);
    while over - fit > 1 {
        let rows = fit.midpoint(over);
        if fits_with(rows) {
            fit = rows;
        } else {
            over = rows;
        }
    }
    fit
}

/// Cuts a list of a response from its end until the response fits; returns how many of how many are left, as text.
fn cut<R: Reply, T: Clone>(reply: &mut R, what: &str, list: fn(&mut R) -> &mut Vec<T>) -> String {
    let all = std::mem::take(list(reply));
    let with = |rows: usize| {
        let mut shorter = reply.clone();
        list(&mut shorter).extend(all.iter().take(rows).cloned());
        shorter
    };
    let rows = most(all.len(), |rows| fits(&with(rows)));
    *reply = with(rows);
    format!(
        "the first {rows} of {} {what}: ask for fewer at once",
        all.len()
    )
}

/// Cuts a long text to its head; returns the whole text if it was cut.
fn head(text: &mut String) -> Option<String> {
    if text.len() <= ROS_REPLY_TEXT_BYTES_MAX {
        return None;
    }
    let short = text.get(..text.floor_char_boundary(ROS_REPLY_TEXT_BYTES_MAX));
    let short = format!("{}.. (/rosout has it all)", short.unwrap_or_default());
    Some(std::mem::replace(text, short))
}

impl Reply for Edited {
    fn shorten(&mut self) -> String {
        let whole = head(&mut self.message);
        let all = std::mem::take(&mut self.warnings);
        let with = |rows: usize| {
            let mut warnings: Vec<String> = all.iter().take(rows).cloned().collect();
            if rows < all.len() {
                warnings.push(format!("{} more: /rosout has them", all.len() - rows));
            }
            Self {
                warnings,
                ..self.clone()
            }
        };
        let rows = most(all.len(), |rows| fits(&with(rows)));
        *self = with(rows);
        let lost = whole.into_iter().chain(all.into_iter().skip(rows));
        lost.collect::<Vec<_>>().join("; ")
    }
}

impl Reply for GapTold {
    fn shorten(&mut self) -> String {
        head(&mut self.message).unwrap_or_default()
    }
}

impl Reply for Ticked {
    fn shorten(&mut self) -> String {
        head(&mut self.message).unwrap_or_default()
    }
}

impl Reply for ListParametersResponse {
    fn shorten(&mut self) -> String {
        // A scene has few sources, so all names fit; the prefixes of a request may not.
        self.result.prefixes.clear();
        cut(self, "names", |reply| &mut reply.result.names)
    }
}

impl Reply for GetParametersResponse {
    fn shorten(&mut self) -> String {
        cut(self, "values", |reply| &mut reply.values)
    }
}

impl Reply for GetParameterTypesResponse {
    fn shorten(&mut self) -> String {
        cut(self, "types", |reply| &mut reply.values)
    }
}

impl Reply for DescribeParametersResponse {
    fn shorten(&mut self) -> String {
        // Programs need the types and ranges, which stay; people ask for one parameter at a time.
        for one in &mut self.values {
            one.additional_constraints.clear();
        }
        if fits(self) {
            return "no additional_constraints: ask for fewer at once".to_owned();
        }
        for one in &mut self.values {
            one.description.clear();
        }
        if fits(self) {
            return "no texts: ask for fewer at once".to_owned();
        }
        cut(self, "descriptors, without texts", |reply| {
            &mut reply.values
        })
    }
}

impl Reply for SetParametersResponse {
    fn shorten(&mut self) -> String {
        let reasons: Vec<String> = (self.results.iter_mut())
            .map(|result| std::mem::take(&mut result.reason))
            .filter(|reason| !reason.is_empty())
            .collect();
        let cut = if fits(self) {
            "no reasons".to_owned()
        } else {
            cut(self, "results, without reasons", |reply| &mut reply.results)
        };
        format!("{cut}; the reasons: {}", reasons.join("; "))
    }
}

impl Reply for SetParametersAtomicallyResponse {
    fn shorten(&mut self) -> String {
        let SetParametersResult { reason, .. } = &mut self.result;
        head(reason).unwrap_or_default()
    }
}
