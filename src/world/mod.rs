//! The world: which bodies there are, where they are, how old that is, and who may say so.
//!
//! In: frames (`wire::Inbox`), edits, the time. Out: a [`ChangeSet`] for the broad phase. Bad input is never an
//! error here: it is a counted `RejectReason`, and what it leaves unknown is said so.

mod body;

pub use body::{Body, ChangeSet, Motion, PlacedShape, Removed};
