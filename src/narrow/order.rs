//! The order of work: who has a turn first when the budget does not reach for all.

use crate::ids::PairSlot;
use crate::time::Meter;
use crate::world::World;

use super::Narrow;

/// How work is ordered. What is finished in the end does not depend on it; what is finished when time runs out does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// As found: for a budget without limit, where order means nothing.
    AsFound,
    /// Last tick's contacts, then the longest undecided, then the fastest: for a budget in time.
    Aged,
    /// As `Aged`, with ties broken by body ids: for a budget in units, so that a run replays bit for bit whatever the
    /// slots are.
    Counted,
}

impl Narrow {
    /// Orders work: last tick's contacts first, then the longest undecided, then the fastest.
    ///
    /// The keys are gathered once: a sort that looked them up would miss the cache at every comparison.
    pub(super) fn arrange(
        &mut self,
        work: &mut [PairSlot],
        order: Order,
        world: &World,
        meter: &mut Meter<'_>,
    ) {
        if order == Order::AsFound || !meter.open() {
            return;
        }
        let mut keyed = std::mem::take(&mut self.keyed);
        keyed.clear();
        keyed.extend(work.iter().map(|&slot| (self.rank(slot), slot)));
        if order == Order::Counted {
            let ids = |slot: PairSlot| {
                let hot = &self.hot[slot.index()];
                (
                    world.body(hot.a).map(|body| body.id),
                    world.body(hot.b).map(|body| body.id),
                )
            };
            keyed.sort_unstable_by_key(|&(rank, slot)| (rank, ids(slot)));
        } else {
            keyed.sort_unstable();
        }
        for (to, (_, slot)) in work.iter_mut().zip(&keyed) {
            *to = *slot;
        }
        self.keyed = keyed;
        meter.refresh();
    }

    /// A pair's place in the order of work, the least first: 1 bit whether it is no contact of last tick, 63 bits the tick
    /// since when it is undecided, 64 bits how far it has moved (positive floats order like their bits), the farthest first.
    fn rank(&self, slot: PairSlot) -> u128 {
        let memo = &self.memos[slot.index()];
        let touched = memo.witness.is_some_and(|w| w.best_m <= 0.0);
        let since = if memo.undecided_since == 0 {
            self.tick
        } else {
            memo.undecided_since
        };
        let fresh_contact = touched && since == self.tick;
        let speed = memo.widened_m.max(0.0).to_bits();
        u128::from(!fresh_contact) << 127
            | u128::from(since & (u64::MAX >> 1)) << 64
            | u128::from(!speed)
    }
}
