//! Memory that lies idle: of many bodies it is given back.
//!
//! In: a change of the way, a tick that is over. Out: less memory; nothing else is told by it. Candidates and the search
//! without them take half of it each, and a world of many bodies seldom changes from the one to the other, in a tick
//! that lays all of them anyway. Lists that a tick fills once, as the first one does with every pair, are not kept at
//! that length. Of fewer bodies all of it is kept, so that no tick makes any.

use super::afresh::Afresh;
use super::gear::FAR;
use super::links::Links;
use super::mend::Mender;
use super::sort::Sorter;
use super::verlet::Verlet;
use super::{Order, renew};

/// Entries a body from which on a list of what changes in a tick is of a tick unlike the others.
const BURST: usize = 2;

/// Whether there are so many bodies that what lies idle is given back.
pub(in crate::broad) fn is_thrifty(bodies: usize) -> bool {
    bodies > FAR
}

/// Empties a list of a tick, and gives back what is more than most ticks need: as much as one entry a body.
pub(in crate::broad) fn give_back<T>(list: &mut Vec<T>, bodies: usize) {
    list.clear();
    if is_thrifty(bodies) && list.capacity() > BURST * bodies {
        list.shrink_to(bodies);
    }
}

impl Order {
    /// Candidates were let go.
    pub(super) fn give_back_candidates(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        self.links = Links::default();
        self.mender = Mender::default();
        self.scratch = renew::Scratch::default();
        (self.held, self.sure) = (Vec::new(), Vec::new());
        (self.ages, self.gaits, self.former) = (Vec::new(), Vec::new(), Vec::new());
        (self.entries, self.found, self.rows) = (Vec::new(), Vec::new(), Vec::new());
        (self.touched_records, self.emptied) = (Vec::new(), Vec::new());
    }

    /// Few moved: the list of candidates is let go.
    pub(super) fn give_back_list(&mut self) {
        self.listed = false;
        if is_thrifty(self.len) {
            (self.entries, self.found, self.sure) = (Vec::new(), Vec::new(), Vec::new());
        }
    }

    /// Candidates are taken up again: what is learned of the ways stays.
    pub(super) fn give_back_afresh(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        let Afresh {
            gear,
            probe,
            team,
            verlet,
            ..
        } = std::mem::take(&mut self.afresh);
        self.afresh = Afresh {
            gear,
            probe,
            team,
            verlet: Verlet {
                pace: verlet.pace,
                ..Verlet::default()
            },
            ..Afresh::default()
        };
    }

    /// Bodies with candidates were sorted: that is seldom done.
    pub(super) fn give_back_sort(&mut self) {
        if !is_thrifty(self.len) {
            return;
        }
        (self.boxes, self.former) = (Vec::new(), Vec::new());
        let frame = self.sorter.frame;
        self.sorter = Sorter::default();
        self.sorter.frame = frame;
    }
}
