//! Fills the outbox.
