//! Built-in scenes and motions, shared by the demo, `feed`, tests and benches.

mod motion;
mod scenes;

pub use motion::{Motion, Pattern};
pub use scenes::{Random, pile, pool};
