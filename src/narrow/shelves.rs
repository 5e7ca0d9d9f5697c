//! Storage for the results of queries that take several turns, for all pairs.

use super::Narrow;
use super::arena::Arena;
use super::compound::CompoundFront;
use super::contacts::Contact;
use super::cursor::Cursor;
use super::exact::Shell;
use super::holdings::Holdings;
use super::memo::Memo;
use super::mesh::{CarriedFront, FrontStore};
use super::pool::Pool;
use crate::ids::PairSlot;

/// The queries, and their entries.
#[derive(Debug, Default)]
pub(super) struct Shelves {
    /// Queries of meshes and half-spaces.
    pub(super) cursors: Pool<Cursor>,
    /// Shells of pairs of single convex shapes that overlap.
    shells: Pool<Shell>,
    /// Used for a pair that has none yet.
    spare: Shell,
    /// Carried fronts of pairs of shapes of which one is a mesh.
    pub(super) fronts: Pool<CarriedFront>,
    /// The entries of fronts.
    pub(super) store: FrontStore,
    /// Contacts found by cursors and by pairs of several shapes.
    pub(super) contacts: Arena<Contact>,
}

impl Shelves {
    /// Prefetches the shell at an index, if there is one.
    #[inline]
    pub(super) fn ask_ahead_for_shell(&self, at: u32) {
        if let Some(shell) = self.shells.get(at) {
            shell.ask_ahead();
        }
    }

    /// The shell of a pair, or an empty one.
    pub(super) fn shell(&mut self, at: u32) -> &mut Shell {
        self.shells.get_mut(at).unwrap_or(&mut self.spare)
    }

    /// Stores what a query made of [`Shelves::shell`], if anything.
    pub(super) fn keep_shell(&mut self, at: &mut u32) {
        if self.shell(*at).is_empty() {
            self.shells.give(at);
        } else if let Some(own) = self.shells.get_or_take(at)
            && own.is_empty()
        {
            std::mem::swap(own, &mut self.spare);
        }
    }

    /// Releases a shell, if `at` is one.
    pub(super) fn give_shell(&mut self, at: &mut u32) {
        if let Some(shell) = self.shells.get_mut(*at) {
            shell.clear();
        }
        self.shells.give(at);
    }

    /// Releases a front, if `at` is one.
    pub(super) fn give_front(&mut self, at: &mut u32) {
        if let Some(front) = self.fronts.get_mut(*at) {
            front.release(&mut self.store);
        }
        self.fronts.give(at);
    }

    /// Releases a cursor, if `at` is one.
    pub(super) fn give_cursor(&mut self, at: &mut u32) {
        if let Some(cursor) = self.cursors.get_mut(*at) {
            cursor.release(&mut self.store, &mut self.contacts);
        }
        self.cursors.give(at);
    }
}

impl Shelves {
    /// Structure check of the pools, the arenas, and of what each front and query holds in them.
    ///
    /// # Errors
    /// The first violation, in words.
    pub(super) fn validate(
        &self,
        memos: &[Memo],
        compounds: &Pool<CompoundFront>,
    ) -> Result<(), String> {
        let inner = || compounds.all().iter().flat_map(CompoundFront::places);
        let shells = memos.iter().map(|memo| memo.shell);
        self.shells.validate("shells", shells)?;
        let cursors = (memos.iter()).flat_map(|memo| [memo.cursor, memo.report_cursor]);
        (self.cursors).validate("queries", cursors.chain(inner().map(|inner| inner.1)))?;
        let fronts = memos.iter().map(|memo| memo.front);
        (self.fronts).validate("fronts", fronts.chain(inner().map(|inner| inner.0)))?;
        let mut held = Holdings::default();
        self.fronts
            .all()
            .iter()
            .for_each(|front| front.tell(&mut held));
        self.cursors
            .all()
            .iter()
            .for_each(|cursor| cursor.tell(&mut held));
        compounds
            .all()
            .iter()
            .for_each(|front| front.tell(&mut held));
        self.contacts.validate(&held.contacts)?;
        self.store.validate(&held)
    }
}

impl Narrow {
    /// Whether work on a pair ended without a result because there was no room.
    pub(super) fn is_lost(&self, slot: PairSlot) -> bool {
        let memo = &self.memos[slot.index()];
        let (front, fronts) = (
            self.shelves.fronts.get(memo.front),
            self.compounds.get(memo.compound),
        );
        front.is_some_and(CarriedFront::is_lost)
            || fronts.is_some_and(|fronts| fronts.is_lost(&self.shelves))
    }

    /// Releases what work on a pair keeps from turn to turn.
    pub(super) fn give_back(&mut self, slot: PairSlot) {
        let memo = &mut self.memos[slot.index()];
        self.shelves.give_shell(&mut memo.shell);
        self.shelves.give_cursor(&mut memo.cursor);
        self.shelves.give_cursor(&mut memo.report_cursor);
        self.shelves.give_front(&mut memo.front);
        if let Some(front) = self.compounds.get_mut(memo.compound) {
            front.release(&mut self.shelves);
        }
        self.compounds.give(&mut memo.compound);
    }
}
