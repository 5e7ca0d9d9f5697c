//! The greeting both doors give.

use crate::wire::{Hello, WIRE_VERSION};

/// The iceoryx2 this was built with; clients of another one cannot talk to it.
pub const ICEORYX2_VERSION: &str = "0.10.0";

/// The hello of this process.
pub(super) fn hello(boot_id: u64) -> Hello {
    Hello {
        magic: *b"sweepd\0\0",
        boot_id,
        pid: std::process::id(),
        uid: rustix::process::geteuid().as_raw(),
        wire_version: WIRE_VERSION,
        reserved: 0,
        sweepd_version: padded(env!("CARGO_PKG_VERSION")),
        iceoryx2_version: padded(ICEORYX2_VERSION),
    }
}

fn padded(text: &str) -> [u8; 16] {
    let mut bytes = [0; 16];
    for (to, from) in bytes.iter_mut().zip(text.bytes()) {
        *to = from;
    }
    bytes
}
