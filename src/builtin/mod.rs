//! Built-in scenes and motions.
