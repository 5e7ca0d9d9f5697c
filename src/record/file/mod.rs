//! Recordings as MCAP files (mcap.dev), profile `ros2`: every topic is CDR with a `ros2msg` schema, ours too, for
//! `ros2 bag` opens no file whose topics are of several encodings; a reader that does not know ours passes over them.
//!
//! Chunks are not compressed. Of a pool of 1,000 bodies lz4 saves two fifths and zstd three; each is a library in C,
//! the first of this program, and can be had afterwards for keeping (`mcap compress`).

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

/// Topics of our own: the start, then what went in and what came out, bit by bit.
const START: &str = "/sweepd/record/start";
const INPUT: &str = "/sweepd/record/input";
const OUTPUT: &str = "/sweepd/record/output";
/// The last record: why nothing follows.
const END: &str = "sweepd.end";
/// Its keys: that; how many ticks came before it; of how many nothing is there for people; how many were overtaken
/// before they were heard.
const WHY: &str = "why";
const TICKS: &str = "ticks";
const NOT_SHOWN: &str = "ticks_without_messages";
const MISSED: &str = "ticks_missed";
/// What CDR begins with: little-endian, no options.
const CDR_HEAD: [u8; 4] = [0, 1, 0, 0];

#[cfg(test)]
mod tests;
