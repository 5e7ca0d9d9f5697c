//! The next Verlet list, made over some ticks while the current one is in use.
//!
//! In: swept boxes that are valid to the end of the next list, in their blocks. Out: that list.
//!
//! From the tick in which all boxes are swept again, one run of blocks is searched per tick, so that no tick has a
//! whole search. A body that leaves its new box before the list is complete is late: the new entries found for it are
//! dropped. It left its box of the current list too, and was queried against the new boxes: its entries in the current
//! list carry over.

use super::afresh::Afresh;
use super::idle::shed;
use super::links::{room, spare};
use super::sweep::Search;
use super::{Order, Proxies, Tick, Work, is_thrifty};
use crate::ids::small;
use crate::simd::boxes::WIDTH;

impl Order {
    /// Begins the list, to be made in `ticks` ticks. The first of several, in which all boxes are swept, does no
    /// search.
    pub(super) fn open_next(&mut self, ticks: u32, work: &mut Work) {
        let blocks = self.live.len();
        let Afresh { verlet, finds, .. } = &mut self.afresh;
        let runs = (ticks as usize).saturating_sub(1).max(1);
        verlet.next.deal(0..blocks, runs);
        verlet.late.fill(0);
        finds.near.clear();
        let entries = verlet.entries.len();
        room(&mut finds.near, entries + entries / 4);
        if ticks == 1 {
            self.search_next(work);
        }
    }

    /// Searches the next run of blocks.
    pub(super) fn search_next(&mut self, work: &mut Work) {
        let Afresh {
            verlet,
            finds,
            team,
            ..
        } = &mut self.afresh;
        let runs = &mut verlet.next;
        let blocks = runs.run(runs.over());
        let lanes = (&mut self.live, &mut self.fat, &mut self.tree);
        team.search(self.level, lanes, blocks, finds, Search::Near);
        runs.note(finds.tests);
        work.tests += finds.tests;
    }

    /// Puts the new list into use.
    pub(super) fn take_over<P: Proxies>(&mut self, proxies: &P) {
        let Afresh { verlet, finds, .. } = &mut self.afresh;
        let (list, late) = (&mut finds.near, &verlet.late[..]);
        list.retain(|entry| !entry.any_among(late));
        let found = list.len();
        let kept = verlet.entries.iter().filter(|entry| entry.any_among(late));
        list.extend(kept);
        std::mem::swap(&mut verlet.entries, list);
        list.clear();
        let kept = verlet.entries[found..].iter();
        self.hits = kept.filter(|entry| entry.is_hit()).count();
        verlet.pace.note_list(verlet.next.sum());
        self.spare_listed();
        // The old list has already reported these overlaps.
        self.settle_listed(found, proxies);
    }

    /// Reserves memory for additions until the next list.
    fn spare_listed(&mut self) {
        let blocks = self.live.len();
        let Afresh {
            verlet,
            finds,
            team,
            ..
        } = &mut self.afresh;
        let entries = verlet.entries.len();
        if is_thrifty(self.len) {
            // A sort before the next list may need as much.
            shed(&mut finds.near);
        } else {
            spare(&mut verlet.entries, entries, self.len);
            spare(&mut finds.near, entries, self.len);
            room(&mut verlet.aside, self.len);
        }
        room(&mut verlet.found, self.len);
        room(&mut verlet.strays, self.len);
        room(&mut verlet.blocks, blocks + WIDTH);
        room(&mut verlet.near, blocks + 1);
        verlet.course.reserve(blocks);
        finds.spare();
        team.reserve(blocks, self.len);
    }

    /// Deals the bodies to blocks in the presorted order, and remaps the list; returns whether there was a lane for
    /// each. If not, the list is dropped, and its overlaps are saved.
    pub(super) fn lay_listed<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> bool {
        let mut entries = std::mem::take(&mut self.afresh.verlet.entries);
        for entry in &mut entries {
            *entry = entry.by(&self.slot_of);
        }
        let laid = self.lay_presorted(tick);
        if laid {
            for entry in &mut entries {
                *entry = entry.by(&self.rank_of);
            }
        } else {
            for entry in entries.drain(..).filter(|entry| entry.is_hit()) {
                let [one, other] = entry.ranks().map(small);
                self.carried.push((one, other));
            }
        }
        self.afresh.verlet.entries = entries;
        if laid {
            self.afresh.verlet.pace.note_laid();
            self.clear_lanes();
            self.take_laid(tick.proxies);
        }
        laid
    }
}
