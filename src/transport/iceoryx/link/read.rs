//! Reading messages of a daemon: a message is copied out of shared memory after its length was checked.

use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{PayloadHeader, ZeroCopySend};

use crate::error::Result;
use crate::transport::client::Message;
use crate::transport::iceoryx::qos::{Ipc, failed};
use crate::wire::MessageHeader;

/// A port for one kind of message, if it is subscribed.
pub(super) type Reader<T, H = MessageHeader> = Option<Subscriber<Ipc, [T], H>>;

/// The next message; those of more than `rows_max` rows are skipped.
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
        // The count comes from the sender: it is checked before it makes a slice.
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
