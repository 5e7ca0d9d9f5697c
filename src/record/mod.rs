//! Recording and replay: all that an engine was given and all that it said, in an MCAP file; and the same engine on it
//! again, compared tick by tick.
//!
//! In: a running daemon's ticks, by [`Recorder`]. Out: an MCAP file whose outputs Foxglove and `ros2 bag` can open, and
//! whose inputs [`Replay`] runs. The engine is a function of its inputs, counted work and the times it was shown; where
//! a replay differs bit by bit, either the file was changed, or something that is no input had a say in the engine.

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
