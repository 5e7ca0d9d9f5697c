//! Unused memory: given back when there are many bodies.
//!
//! In: a change of mode, a finished tick. Out: less memory; results do not depend on it. Candidates and the search
//! without them take half of the memory each, and a world of many bodies seldom changes from one to the other, and does
//! so in a tick that lays out all bodies anyway. Lists that one tick fills, as the first one does with every pair, are
//! not kept at that length. With fewer bodies all memory is kept, so that no tick allocates, until a crowd has been
//! over for long.

use super::afresh::Afresh;
use super::cost::FAR;
use super::mend::Mender;
use super::{Order, moved, renew};

/// A list of changes of a tick keeps room for one entry per `KEPT` bodies, and up to twice that: enough for all scenes
/// of the bench except the fastest and those with tens of pairs per body, where a tick is busy with other work.
const KEPT: usize = 4;

/// Returns whether there are so many bodies that unused memory is given back.
pub(in crate::broad) fn is_thrifty(bodies: usize) -> bool {
    bodies > FAR
}

/// Clears a list of a tick, and gives back memory beyond what most ticks need.
pub(in crate::broad) fn give_back<T>(list: &mut Vec<T>, bodies: usize) {
    list.clear();
    let kept = bodies / KEPT;
    if is_thrifty(bodies) && list.capacity() > 2 * kept {
        list.shrink_to(kept);
    }
}

/// Clears a list and gives its memory back, except one entry. If it were freed whole, glibc would take that as a sign
/// that lists of this size come and go: the next ones then share one heap, and memory freed in the middle of it stays
/// with the process. A list that shrinks and grows has its own pages.
pub(super) fn shed<T>(list: &mut Vec<T>) {
    list.clear();
    list.shrink_to(1);
}

impl Order {
    /// Candidates were dropped.
    pub(super) fn give_back_candidates(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        self.links.give_back();
        self.mender = Mender::default();
        self.scratch = renew::Scratch::default();
        shed(&mut self.held);
        shed(&mut self.ages);
        shed(&mut self.gaits);
        shed(&mut self.former);
        self.gather = moved::Gather::default();
        shed(&mut self.touched_records);
        shed(&mut self.emptied);
        self.give_back_list();
    }

    /// A crowd has been over for long.
    pub(in crate::broad) fn give_back_crowd(&mut self) {
        let (entries, hits, bodies) = (self.entries.len(), self.hits, self.len);
        // A sort reserves at least this much anyway.
        self.entries.shrink_to(2 * entries + 4 * bodies);
        self.carried.shrink_to(2 * hits + 2 * bodies);
        self.found.shrink_to(bodies);
    }

    /// Few bodies moved: the list of candidates is dropped.
    pub(super) fn give_back_list(&mut self) {
        self.listed = false;
        self.entries.clear();
        if is_thrifty(self.len) {
            shed(&mut self.entries);
            shed(&mut self.found);
            shed(&mut self.sure);
        }
    }

    /// Candidates are used again: what is known about the modes stays.
    pub(super) fn give_back_afresh(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        let Afresh {
            presort,
            held,
            verlet,
            finds,
            team,
            reach,
            ..
        } = &mut self.afresh;
        presort.give_back();
        held.give_back();
        finds.give_back();
        team.give_back();
        verlet.give_back();
        shed(reach);
    }

    /// Bodies were sorted: that is rare, and does not coincide with the longest lists.
    pub(super) fn give_back_sort(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        shed(&mut self.boxes);
        shed(&mut self.former);
        self.sorter.give_back();
    }
}
