//! Requests in, answers out. A request is checked for its frame (version, lengths) here, for its meaning elsewhere.

use iceoryx2::prelude::PayloadHeader;

use super::{AnswerHeader, Asked, RequestHeader, RequestToken, Server, failed};
use crate::error::Result;
use crate::transport::request::{refusal, unreadable};
use crate::wire::WIRE_VERSION;

impl Server {
    pub(super) fn take_requests(
        &mut self,
        take: &mut dyn FnMut(RequestToken, RequestHeader, &[u8]),
    ) {
        loop {
            let request = match self.answers.receive() {
                Ok(Some(request)) => request,
                Ok(None) => return,
                Err(_) => {
                    self.errors.add(1);
                    return;
                }
            };
            let header = *request.user_header();
            // the count is the sender's word: checked before it makes a slice
            let len = usize::try_from(request.header().number_of_elements()).unwrap_or(usize::MAX);
            let token = RequestToken(self.next_token);
            self.next_token += 1;
            if let Some(error) = unreadable(&header, len) {
                let _client_left = reply(&request, self.options.boot_id, false, &refusal(error));
                continue;
            }
            take(token, header, request.payload());
            self.asked.insert(token, request);
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
