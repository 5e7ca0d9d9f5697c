//! The pair set: overlapping pairs only.
