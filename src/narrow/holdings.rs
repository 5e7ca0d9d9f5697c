//! The owners of the arenas' blocks: the structure check compares them with the arenas' own records.

use super::arena::Run;
use super::cover::Cover;

/// Blocks held, by arena.
#[derive(Debug, Default)]
pub(super) struct Holdings<'a> {
    /// Groups and open pairs.
    pub(super) covers: Vec<&'a Cover>,
    /// Contacts of leaves.
    pub(super) leaves: Vec<&'a Run>,
    /// Contacts of bodies.
    pub(super) contacts: Vec<&'a Run>,
}
