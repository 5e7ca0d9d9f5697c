//! Fault texts for implausible stamps and senders: out of order, far from the node's time, two senders of a frame.
//!
//! Stamps never count for ages (laws 3.8, 4.8). A stamp far from the node's time changes no pose, it is only reported.

use std::collections::VecDeque;

use super::super::told::{brief, gist};
use super::RosKind;
use super::{Member, Receipt, Source, seconds};

/// How long a passing fault is reported, nanoseconds: long enough for a person to see it.
const TOLD_NS: u64 = 3_000_000_000;
/// Tolerated distance of a stamp from the node's time, nanoseconds: more than clocks and latencies of one robot differ.
const OFF_NS: u64 = 1_000_000_000;

/// Most passing faults reported at once; beyond it the oldest is dropped.
const PASSING_MAX: usize = 8;

/// Recent faults: gist, text, and time, nanoseconds of `CLOCK_BOOTTIME`. Each gist occurs once.
#[derive(Clone, Debug, Default)]
pub(super) struct Passing(VecDeque<(String, String, u64)>);

impl Passing {
    /// Adds a fault of now.
    pub(super) fn put(&mut self, text: String, now_ns: u64) {
        let gist = gist(&text);
        self.0.retain(|(other, ..)| *other != gist);
        if self.0.len() == PASSING_MAX {
            self.0.pop_front();
        }
        self.0.push_back((gist, text, now_ns));
    }

    /// The faults that are still reported.
    pub(super) fn now(&self, now_ns: u64) -> impl Iterator<Item = String> {
        let all = self.0.iter();
        let fresh = all.filter(move |(.., at)| now_ns.saturating_sub(*at) < TOLD_NS);
        fresh.map(|(_, text, _)| text.clone())
    }
}

impl Source {
    /// Adds a fault of a stamp or a link, if there is one.
    pub(super) fn tell(&mut self, text: Option<String>, receipt: Receipt) {
        if let Some(text) = text {
            self.passing.put(text, receipt.now_ns);
        }
    }

    /// The fault of a body whose newest pose is older than the time-out, or that has had none for longer than that.
    pub(super) fn silence(&self, member: &Member, now_ns: u64) -> Option<String> {
        let Some(since_ns) = member.since_ns else {
            // Chains say themselves which link they lack.
            let awaited = self.kind != RosKind::Tf && member.fault.is_none();
            let awaited_ns = member.awaited_ns.filter(|_| awaited)?;
            return (now_ns.saturating_sub(awaited_ns) > self.timeout_ns).then(|| {
                format!(
                    "no pose of it has come on {}: see whether its sender runs, and uses this topic and type",
                    brief(&member.topic)
                )
            });
        };
        let silent_ns = now_ns.saturating_sub(since_ns);
        (silent_ns > self.timeout_ns).then(|| {
            format!(
                "nothing has come of it for {:.1} s, longer than the time-out of its source: see who sends it",
                seconds(silent_ns)
            )
        })
    }
}

/// Text: the link of a frame comes both as a fixed one and as one that changes.
pub(super) fn both((kind, name): (&str, &str)) -> String {
    format!(
        "{kind} {}: its link comes on the topic of fixed links and on that of others, and the last one counts: leave one out",
        brief(name)
    )
}

/// Text: a link does not join two valid frames.
pub(super) fn refused((kind, name): (&str, &str), why: &str) -> String {
    let name = brief(name);
    format!("{kind} `{name}`: its link is refused, because {why}")
}

/// Text: the tree has no room for a frame.
pub(super) fn crowded((kind, name): (&str, &str)) -> String {
    format!(
        "{kind} {}: its link is refused, because the links on its topic name too many frames: give this source a topic of its own",
        brief(name)
    )
}

/// Text: fixed links were dropped for lack of room.
pub(super) fn forgotten(count: u64) -> String {
    format!(
        "{count} links that never change are forgotten, because they are too many: give this source a topic of its own"
    )
}

/// Text: two publishers send links of one frame.
pub(super) fn rivalry((kind, name): (&str, &str)) -> String {
    let name = brief(name);
    format!("{kind} {name}: two publishers send links of it: stop one of them")
}

/// Text: another publisher sends a different fixed link. Each is sent only once, so the first sender may still exist.
pub(super) fn dispute((kind, name): (&str, &str)) -> String {
    let name = brief(name);
    format!(
        "{kind} {name}: another publisher says another fixed link of it, and the last one counts: if both are there, stop one of them"
    )
}

/// Text: a stamp is before the newest one of the same body or link, and the message is skipped.
pub(super) fn older((kind, name): (&str, &str), by_ns: u64) -> String {
    format!(
        "{kind} {}: a stamp lies {:.3} s before the one that was there: it is passed over; does the network bring it late, or do two senders write it?",
        brief(name),
        seconds(by_ns)
    )
}

/// Text: a stamp is far from the node's time; `None` if it is near, or if either is 0 (not set).
pub(in super::super) fn off(
    (kind, name): (&str, &str),
    stamp_ns: u64,
    receipt: Receipt,
    timeout_ns: u64,
) -> Option<String> {
    let now_ns = receipt.ros_now_ns;
    let (ahead, behind) = (
        stamp_ns.saturating_sub(now_ns),
        now_ns.saturating_sub(stamp_ns),
    );
    let side = match stamp_ns {
        _ if stamp_ns == 0 || now_ns == 0 => return None,
        _ if ahead > OFF_NS => "in the future",
        _ if behind > OFF_NS.max(timeout_ns) => "in the past",
        _ => return None,
    };
    Some(format!(
        "{kind} {}: its stamp lies {:.3} s {side} of this node's clock: look at the clocks of both hosts, and at use_sim_time on both sides",
        brief(name),
        seconds(ahead.max(behind))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_far_from_the_nodes_time_is_told_on_which_side_and_by_how_much() {
        const S: u64 = 1_000_000_000;
        let receipt = |ros_now_ns| Receipt {
            now_ns: 5,
            waited: false,
            ros_now_ns,
            from: ros2_client::Gid::ZERO,
        };
        let said = |stamp_ns, now_ns| off(("body", "b"), stamp_ns, receipt(now_ns), S / 2);
        assert!(
            said(103 * S, 100 * S)
                .unwrap()
                .contains("3.000 s in the future")
        );
        assert!(
            said(98 * S, 100 * S)
                .unwrap()
                .contains("2.000 s in the past")
        );
        for (stamp_ns, now_ns) in [
            (0, 100 * S),
            (100 * S, 0),
            (101 * S, 100 * S),
            (99 * S, 100 * S),
        ] {
            assert_eq!(said(stamp_ns, now_ns), None);
        }
        // A source with a long time-out may have stamps as late as that.
        assert_eq!(off(("body", "b"), 97 * S, receipt(100 * S), 5 * S), None);
    }
}
