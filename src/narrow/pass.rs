//! Passes over many pairs: turns in order while the meter is open, with pairs prefetched, since the data of a turn lies
//! in several places, all far apart.

use crate::ids::PairSlot;
use crate::simd::boxes::prefetch;
use crate::time::Meter;
use crate::world::{AHEAD, World};

use super::Narrow;
use super::order::Order;

/// One pass over a list of work.
pub(super) struct Pass<'a, Idle> {
    pub(super) world: &'a World,
    pub(super) order: Order,
    /// Whether nothing is left to do for a pair.
    pub(super) idle: Idle,
}

impl Narrow {
    /// Gives each pair a turn, in order, and further turns to those that need more, while the meter is open; returns
    /// the pairs that are not done.
    pub(super) fn spend_on<'m>(
        &mut self,
        mut work: Vec<PairSlot>,
        pass: &Pass<'_, impl Fn(&Self, PairSlot) -> bool>,
        meter: &mut Meter<'m>,
        mut turn: impl FnMut(&mut Self, PairSlot, &mut Meter<'m>) -> bool,
    ) -> Vec<PairSlot> {
        let (world, order) = (pass.world, pass.order);
        if work.is_empty() || !meter.open() {
            return work;
        }
        let gaze = world.gaze();
        // Ranking takes time too. If nothing could be done in what is left then, the pairs keep their present order: by
        // the last ranking, then the new ones.
        let ranked = meter.has_ns(self.rank_cost.of(work.len(), gaze.is_some()));
        let order = if ranked {
            order
        } else {
            self.rank_cost.forget(gaze.is_some());
            Order::AsFound
        };
        let mut line = self.line_up(&work, order, world, gaze, meter);
        while !work.is_empty() && meter.open() {
            let (mut at, mut left) = (0, 0);
            while at < work.len() {
                self.order_next(&mut line, at, world, meter);
                if !meter.open() {
                    break;
                }
                let next = |at: usize| match self.keyed.get(at) {
                    Some(&(_, slot)) => Some(slot),
                    None => work.get(at).copied(),
                };
                let Some(slot) = next(at) else { break };
                self.ask_along(at, next, world, |slot| !(pass.idle)(self, slot));
                if !turn(self, slot, meter) {
                    work[left] = slot;
                    left += 1;
                }
                at += 1;
            }
            // Pairs that had no turn keep their order, behind those that had one.
            let behind = work.len() - at;
            for (to, &(_, slot)) in work[at..].iter_mut().zip(self.keyed.iter().skip(at)) {
                *to = slot;
            }
            work.copy_within(at.., left);
            work.truncate(left + behind);
            if !ranked {
                // Otherwise pairs that no turn decides would take all turns.
                work.rotate_left(left);
            }
            // Further rounds keep the order of the first.
            self.keyed.clear();
            line.finish(work.len());
        }
        work
    }

    /// At step `at` of a pass: prefetches the pairs, bodies and shapes of the coming steps.
    ///
    /// * `next` - the pair of a step.
    /// * `wants` - whether its bodies will be read.
    #[inline]
    fn ask_along(
        &self,
        at: usize,
        next: impl Fn(usize) -> Option<PairSlot>,
        world: &World,
        wants: impl Fn(PairSlot) -> bool,
    ) {
        if let Some(slot) = next(at + 2 * AHEAD) {
            self.ask_ahead(slot);
        }
        if let Some(slot) = next(at + AHEAD).filter(|slot| wants(*slot)) {
            self.ask_ahead_for_contacts(slot);
            self.shelves
                .ask_ahead_for_shell(self.memos[slot.index()].shell);
        }
        world.ask_along(at, |step| {
            let slot = next(step).filter(|slot| wants(*slot))?;
            let hot = &self.hot[slot.index()];
            Some([hot.a, hot.b])
        });
    }

    /// At step `at` of visits to some pairs: prefetches the certificates of the coming ones, and the rest of those
    /// whose certificates are spent.
    #[inline]
    pub(super) fn ask_ahead_of_visits(&self, slots: &[PairSlot], at: usize, world: &World) {
        if let Some(hot) = (slots.get(at + 2 * AHEAD)).and_then(|slot| self.hot.get(slot.index())) {
            prefetch(hot);
        }
        if let Some(slot) = slots.get(at + AHEAD) {
            self.ask_ahead_of_look(slot.index(), world);
        }
    }

    /// At place `at` of the straight walk over all pairs: prefetches the coming ones whose certificates are spent.
    #[inline]
    pub(super) fn ask_ahead_of_walk(&self, at: usize, world: &World) {
        self.ask_ahead_of_look(at + AHEAD, world);
    }

    /// Prefetches what `look` reads of the pair in a slot, if its certificate is spent.
    #[inline]
    fn ask_ahead_of_look(&self, slot: usize, world: &World) {
        let Some(hot) = self.hot.get(slot).filter(|hot| hot.live) else {
            return;
        };
        if self.spent_m[hot.a.index()] + self.spent_m[hot.b.index()] < hot.expiry_m {
            return;
        }
        prefetch(&self.memos[slot]);
        prefetch(&self.urgencies[slot]);
        world.ask_ahead(hot.a);
        world.ask_ahead(hot.b);
    }
}
