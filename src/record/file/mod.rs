//! Recordings as MCAP files (mcap.dev), profile `ros2`. Every topic is CDR with a `ros2msg` schema, our own ones too,
//! because `ros2 bag` opens no file with topics of several encodings. A reader that does not know our types skips them.
//!
//! Chunks are not compressed. For a pool of 1,000 bodies lz4 saves two fifths and zstd three, but each is a C library,
//! the first of this program, and a file can be compressed later to keep it (`mcap compress`).

mod heard;
mod medium;
mod read;
mod schemas;
mod shown;
mod tape;
mod write;

pub use heard::McapLog;
pub use medium::{Medium, buffered};
pub use read::{Ending, Read, Reader};
pub use shown::Shown;
pub use write::McapSink;

/// Our own topics: the start, then the input and the output of each tick, exact to the bit.
const START: &str = "/sweepd/record/start";
const INPUT: &str = "/sweepd/record/input";
const OUTPUT: &str = "/sweepd/record/output";
/// Name of the last record, which holds the reason for the end.
const END: &str = "sweepd.end";
/// Its keys: the reason; the number of ticks; the number of ticks without messages for viewers; the number of ticks
/// that newer ones overtook before the client received them.
const WHY: &str = "why";
const TICKS: &str = "ticks";
const NOT_SHOWN: &str = "ticks_without_messages";
const MISSED: &str = "ticks_missed";
/// The header of CDR data: little-endian, no options.
const CDR_HEAD: [u8; 4] = [0, 1, 0, 0];

#[cfg(test)]
mod tests;
