//! Recording and replay: all inputs and outputs of an engine in an MCAP file, and a second run of the engine on these
//! inputs, compared tick by tick.
//!
//! In: a running daemon's ticks, by [`Recorder`]. Out: an MCAP file whose outputs Foxglove and `ros2 bag` can open, and
//! whose inputs [`Replay`] runs. The engine is a function of its inputs, counted work and the times it read. If
//! any bit of a replay differs, either the file was changed, or something that is not an input influenced the engine.

#[cfg(feature = "mcap")]
mod bytes;
#[cfg(feature = "mcap")]
mod code;
#[cfg(feature = "mcap")]
mod differ;
#[cfg(feature = "mcap")]
pub mod file;
mod given;
#[cfg(feature = "mcap")]
mod law;
mod recorder;
#[cfg(feature = "mcap")]
mod replay;
#[cfg(feature = "mcap")]
mod rows;

#[cfg(feature = "mcap")]
pub use differ::TIMES;
pub use given::{
    Ask, Asked, Between, EditRecord, Facts, LAYOUT, Origin, Start, TickRecord, TreeMark,
};
#[cfg(feature = "mcap")]
pub use law::Judged;
pub use recorder::{FLUSH_NS, Recorder, Sink};
#[cfg(feature = "mcap")]
pub use replay::{Difference, Replay, Tally};
