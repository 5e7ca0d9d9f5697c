//! Memory that lies idle: of many bodies it is given back.
//!
//! In: a change of the way, a tick that is over. Out: less memory; nothing else is told by it. Candidates and the
//! search without them take half of it each, and a world of many bodies seldom changes from the one to the other, in a
//! tick that lays all of them anyway. Lists that a tick fills once, as the first one does with every pair, are not kept
//! at that length. Of fewer bodies all of it is kept, so that no tick makes any, until a crowd has been over for long.

use super::afresh::Afresh;
use super::cost::FAR;
use super::mend::Mender;
use super::{Order, moved, renew};

/// A list of what changes in a tick keeps room for one entry for so many bodies, and up to twice as many: enough for
/// all scenes of the bench but the fastest and those of tens of pairs a body, where a tick has other things to do for
/// long.
const KEPT: usize = 4;

/// Whether there are so many bodies that what lies idle is given back.
pub(in crate::broad) fn is_thrifty(bodies: usize) -> bool {
    bodies > FAR
}

/// Empties a list of a tick, and gives back what is more than most ticks need.
pub(in crate::broad) fn give_back<T>(list: &mut Vec<T>, bodies: usize) {
    list.clear();
    let kept = bodies / KEPT;
    if is_thrifty(bodies) && list.capacity() > 2 * kept {
        list.shrink_to(kept);
    }
}

/// Empties a list and gives its memory back, but for one entry. Freed whole it would be a sign to glibc that lists of
/// this size come and go: the next ones then share one heap, and what is freed amid it stays with the process. A list
/// that shrinks and grows has pages of its own.
pub(super) fn shed<T>(list: &mut Vec<T>) {
    list.clear();
    list.shrink_to(1);
}

impl Order {
    /// Candidates were let go.
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

    /// A crowd is over, for long.
    pub(in crate::broad) fn give_back_crowd(&mut self) {
        let (entries, hits, bodies) = (self.entries.len(), self.hits, self.len);
        // As much as a sort makes room for where there is less.
        self.entries.shrink_to(2 * entries + 4 * bodies);
        self.carried.shrink_to(2 * hits + 2 * bodies);
        self.found.shrink_to(bodies);
    }

    /// Few moved: the list of candidates is let go.
    pub(super) fn give_back_list(&mut self) {
        self.listed = false;
        self.entries.clear();
        if is_thrifty(self.len) {
            shed(&mut self.entries);
            shed(&mut self.found);
            shed(&mut self.sure);
        }
    }

    /// Candidates are taken up again: what is learned of the ways stays.
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

    /// Bodies were sorted: that is seldom done, and not while lists are longest.
    pub(super) fn give_back_sort(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        shed(&mut self.boxes);
        shed(&mut self.former);
        self.sorter.give_back();
    }
}
