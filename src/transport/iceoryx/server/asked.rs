//! Requests in, answers out. Only a request's form (version, lengths) is checked here; its meaning is checked
//! elsewhere.

use iceoryx2::prelude::PayloadHeader;

use super::{AnswerHeader, Asked, RequestHeader, RequestToken, Server, failed};
use crate::error::Result;
use crate::transport::request::{refusal, unreadable};
use crate::wire::WIRE_VERSION;

/// Most bytes copied by one check for requests: some 0.1 ms. All of the largest request took 150 ms and more, and
/// frames that wait that long count as old.
const COPIED_MAX: usize = 1 << 18;

/// Requests that are being received.
#[derive(Default)]
pub(super) struct Arrivals {
    /// A request that is copied in part.
    part: Option<(Asked, Vec<u8>)>,
    /// The last check ended before all was copied.
    is_more: bool,
}

impl Arrivals {
    /// Returns whether there is more to copy.
    pub(super) fn is_more(&self) -> bool {
        self.is_more
    }
}

impl Server {
    pub(super) fn take_requests(
        &mut self,
        take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>),
    ) {
        let mut left = COPIED_MAX;
        while left > 0 {
            let next = self.arrivals.part.take().or_else(|| self.next_request());
            let Some((request, mut payload)) = next else {
                self.arrivals.is_more = false;
                return;
            };
            let rest = request.payload().get(payload.len()..).unwrap_or_default();
            let (now, later) = rest.split_at(rest.len().min(left));
            payload.extend_from_slice(now);
            left -= now.len();
            if later.is_empty() {
                let token = RequestToken(self.next_token);
                self.next_token += 1;
                take(token, *request.user_header(), payload);
                self.asked.insert(token, request);
            } else {
                self.arrivals.part = Some((request, payload));
            }
        }
        self.arrivals.is_more = true;
    }

    /// The next readable request, with memory for its payload.
    fn next_request(&mut self) -> Option<(Asked, Vec<u8>)> {
        loop {
            let request = match self.answers.receive() {
                Ok(request) => request?,
                Err(_) => {
                    self.troubles.failed(1);
                    return None;
                }
            };
            // The count comes from the sender: it is checked before it makes a slice.
            let len = usize::try_from(request.header().number_of_elements()).unwrap_or(usize::MAX);
            match unreadable(request.user_header(), len) {
                None => return Some((request, Vec::with_capacity(len))),
                Some(why) => {
                    let text = refusal(why);
                    let _client_left = reply(&request, self.options.boot_id, false, &text);
                }
            }
        }
    }

    pub(super) fn send_answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        let Some(request) = self.asked.remove(&token) else {
            return Ok(());
        };
        if !request.is_connected() {
            return Ok(());
        }
        reply(&request, self.options.boot_id, ok, json)?;
        let _unheard = self
            .ready
            .notify_with_custom_event_id(super::EventId::new(super::events::ASKED));
        Ok(())
    }
}

fn reply(request: &Asked, boot_id: u64, ok: bool, json: &str) -> Result<()> {
    let mut response = request
        .loan_slice_uninit(json.len())
        .map_err(|e| failed("answer", e))?;
    *response.user_header_mut() = AnswerHeader {
        boot_id,
        request: request.user_header().request,
        schema: WIRE_VERSION,
        ok: u32::from(ok),
    };
    response
        .write_from_slice(json.as_bytes())
        .send()
        .map_err(|e| failed("answer", e))
}
