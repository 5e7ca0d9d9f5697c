//! The verdict on a chain of links: pose, refusal or nothing. Pure.

use super::super::tf::{Found, Missing, no_pose};
use super::super::told::brief;
use super::seconds;
use crate::wire::{RejectReason, TransformRow};

/// The result for the body of a chain: a pose, a refusal, or `None` if it has not been received; and the fault as text.
pub(super) fn judge(
    found: &Result<Found, Missing>,
    now_ns: u64,
    max_skew_ns: u64,
    timeout_ns: u64,
    root: &str,
) -> (Option<Result<TransformRow, RejectReason>>, Option<String>) {
    match found {
        Ok(found) => {
            let old = found
                .received_ns
                .is_some_and(|(_, earliest)| now_ns.saturating_sub(earliest) > timeout_ns);
            if found.skew_ns > max_skew_ns || old {
                let why = if old {
                    "a link of its chain is older than the source's time-out".to_owned()
                } else {
                    format!(
                        "the stamps of its chain lie {:.3} s apart, more than max_skew {:.3} s; raise max_skew_ms where a link is stamped ahead on purpose",
                        seconds(found.skew_ns),
                        seconds(max_skew_ns)
                    )
                };
                return (Some(Err(RejectReason::BadChain)), Some(why));
            }
            let row = TransformRow {
                position: found.position,
                orientation: found.orientation,
                ..TransformRow::default()
            };
            (Some(Ok(row)), None)
        }
        // No chain has been received yet, which is not a refusal.
        Err(Missing::Frame(frame)) => (
            None,
            Some(format!(
                "no link from frame \"{}\" towards \"{root}\" has come",
                brief(frame)
            )),
        ),
        Err(Missing::Apart(end, other)) => (
            None,
            Some(format!(
                "no chain of links joins frame \"{}\" and \"{root}\": what \"{root}\" hangs on ends at \"{}\", and no link from the first one has come",
                brief(end),
                brief(other)
            )),
        ),
        Err(Missing::Loop(frame)) => (
            Some(Err(RejectReason::BadChain)),
            Some(format!(
                "the links from frame \"{}\" lead in a loop",
                brief(frame)
            )),
        ),
        Err(Missing::Bad(frame, reason)) => (
            Some(Err(*reason)),
            Some(format!(
                "the link of frame \"{}\" is {}",
                brief(frame),
                no_pose(*reason)
            )),
        ),
    }
}
