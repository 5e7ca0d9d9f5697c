//! Reading what a daemon sends: a message is copied out of shared memory, its count checked before.

use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{PayloadHeader, ZeroCopySend};

use crate::error::Result;
use crate::transport::client::Message;
use crate::transport::iceoryx::qos::{Ipc, failed};
use crate::wire::MessageHeader;

/// A port for one kind of message, where it is listened to.
pub(super) type Reader<T, H = MessageHeader> = Option<Subscriber<Ipc, [T], H>>;

/// The next message; those of more than `rows_max` rows are passed over.
pub(super) fn read<T, H>(
    reader: &Reader<T, H>,
    rows_max: usize,
    into: &mut Message<T, H>,
) -> Result<bool>
where
    T: std::fmt::Debug + ZeroCopySend + Copy,
    H: std::fmt::Debug + ZeroCopySend + Copy,
{
    let Some(reader) = reader else {
        return Ok(false);
    };
    while let Some(sample) = reader.receive().map_err(|e| failed("result", e))? {
        // the count is the sender's word: checked before it makes a slice
        let rows = usize::try_from(sample.header().number_of_elements());
        if rows.is_ok_and(|rows| rows <= rows_max) {
            into.header = *sample.user_header();
            into.rows.clear();
            into.rows.extend_from_slice(sample.payload());
            return Ok(true);
        }
    }
    Ok(false)
}
