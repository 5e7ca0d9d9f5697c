//! Answers of services, none larger than what reaches its client. In: an answer. Out: the same, or what of it there is
//! room for and a word that the rest is missing.
//!
//! Why: DDS sends an answer together with whose question it is for. `RustDDS` 0.15.1 writes that with a byte too many
//! where it takes an answer apart (the tag of its `Option` in front of the inline `QoS` of a `DATA_FRAG`), so no reader
//! can read such an answer, and each of those that follow waits for it: one that is too large silences the service for
//! all who ask it. Messages of topics go without those words, and whole, whatever their size.
//!
//! Refused: a copy of `RustDDS` of our own with that byte mended, as long as nobody misses what does not fit.

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

/// What stands before the first field of a message, bytes: which encoding it has.
const HEAD_BYTES: usize = 4;

/// Most that is said of what an answer lost, bytes: `/rosout` has readers with small buffers.
const SAID_BYTES_MAX: usize = 1 << 16;

/// An answer that can be made shorter.
pub(super) trait Reply: Message + Clone + 'static {
    /// Makes it fit; what was left out, in words.
    fn shorten(&mut self) -> String;
}

/// Sends an answer, or what there is room for, which is told.
///
/// * `name` - the service's, for people.
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

/// The most rows of `len` with which it fits; 0 where it does not even without one.
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

/// Cuts a list of an answer to what fits, from its end; how many of how many are left, in words.
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

/// Cuts a text to its head; the whole of it, for people, where it was longer.
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
        // A scene has so few sources that all names fit; what stands before their dots may not.
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
        // Types and ranges are for programs, and whole; people ask for one.
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
