//! Answers to a client's requests, including those that no daemon will answer.

use iceoryx2::pending_response::PendingResponse;

use crate::error::Result;
use crate::transport::iceoryx::qos::{Ipc, failed};
use crate::transport::request::{UNANSWERED, refusal};
use crate::wire::{AnswerHeader, RequestHeader, WIRE_VERSION};

/// A request that waits for its answer.
pub(super) type Pending = PendingResponse<Ipc, [u8], RequestHeader, [u8], AnswerHeader>;

/// The next answer to any of these, its JSON in `into`. A request that its daemon dropped without an answer is refused
/// here: the client would otherwise wait until its time-out.
pub(super) fn next_answer(
    pending: &mut Vec<Pending>,
    into: &mut Vec<u8>,
) -> Result<Option<AnswerHeader>> {
    for at in 0..pending.len() {
        let Some(one) = pending.get(at) else { break };
        // Checked before receiving: no answer is sent after a request was dropped.
        let is_open = one.is_connected();
        into.clear();
        let header = if let Some(response) = one.receive().map_err(|e| failed("answer", e))? {
            into.extend_from_slice(response.payload());
            *response.user_header()
        } else if is_open {
            continue;
        } else {
            into.extend_from_slice(refusal(UNANSWERED.into()).as_bytes());
            AnswerHeader {
                request: one.user_header().request,
                schema: WIRE_VERSION,
                ..AnswerHeader::default()
            }
        };
        drop(pending.swap_remove(at));
        return Ok(Some(header));
    }
    Ok(None)
}
