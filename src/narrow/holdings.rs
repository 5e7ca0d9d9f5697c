//! Who holds which blocks of the arenas: what the structure check compares with the arenas' own books.

use super::arena::Run;
use super::cover::Cover;

/// What is held, by arena.
#[derive(Debug, Default)]
pub(super) struct Holdings<'a> {
    /// Groups and open pairs.
    pub(super) covers: Vec<&'a Cover>,
    /// Contacts of leaves.
    pub(super) leaves: Vec<&'a Run>,
    /// Contacts of bodies.
    pub(super) contacts: Vec<&'a Run>,
}
