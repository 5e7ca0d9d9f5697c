//! Sending: rows are copied into shared memory with their header.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::ZeroCopySend;

use crate::error::Result;
use crate::transport::iceoryx::qos::{Ipc, failed};

/// Sends one message.
pub(super) fn send_frame<T, H>(
    publisher: &Publisher<Ipc, [T], H>,
    header: &H,
    rows: &[T],
) -> Result<()>
where
    T: std::fmt::Debug + ZeroCopySend + Copy,
    H: std::fmt::Debug + ZeroCopySend + Copy + Default,
{
    let mut sample = publisher
        .loan_slice_uninit(rows.len())
        .map_err(|e| failed("frame", e))?;
    *sample.user_header_mut() = *header;
    sample
        .write_from_slice(rows)
        .send()
        .map(|_| ())
        .map_err(|e| failed("frame", e))
}
