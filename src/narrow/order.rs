//! The order of work: who has a turn first when the budget does not reach for all.

use crate::ids::PairSlot;
use crate::time::Meter;
use crate::world::World;

use super::Narrow;
use super::memo::Memo;

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

/// Pairs put in order at first; each further batch is four times as large. Work is put in order as it is reached: where
/// time ends after a few queries, most of the list never needs an order.
const BATCH_FIRST: usize = 64;

/// What the order of work asks of a pair, side by side for all pairs: the records it comes from are far apart.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Urgency {
    /// First tick without a verdict; 0: decided.
    since: u64,
    /// Upper half of how far the pair has moved since its test (positive floats order like their bits).
    motion_bits: u32,
    /// The witness of the last test touched.
    touched: bool,
}

impl Urgency {
    pub(super) fn of(memo: &Memo) -> Self {
        Self {
            since: memo.undecided_since,
            motion_bits: (memo.widened_m.max(0.0).to_bits() >> 32) as u32,
            touched: memo.witness.is_some_and(|w| w.best_m <= 0.0),
        }
    }

    /// Place in the order of work, the least first: 1 bit whether it is no contact of last tick, 31 bits for how long it
    /// has been undecided, the longest first, 32 bits how far it has moved, the farthest first.
    fn rank(self, tick: u64) -> u64 {
        let age = match self.since {
            0 => 0,
            since => tick.saturating_sub(since),
        };
        let fresh_contact = self.touched && age == 0;
        u64::from(!fresh_contact) << 63
            | (AGE_MAX - age.min(AGE_MAX)) << 32
            | u64::from(!self.motion_bits)
    }
}

/// Largest age in ticks that the order tells apart.
const AGE_MAX: u64 = (1 << 31) - 1;

/// How far a list of work has been put in order.
#[derive(Debug)]
pub(super) struct Line {
    order: Order,
    pub(super) ready: usize,
    batch: usize,
}

impl Narrow {
    /// Begins a list of work: gathers the ranks, orders nothing yet.
    pub(super) fn line_up(&mut self, work: &[PairSlot], order: Order) -> Line {
        let ready = if order == Order::AsFound {
            work.len()
        } else {
            0
        };
        self.keyed.clear();
        if ready == 0 {
            let (urgencies, tick) = (&self.urgencies, self.tick);
            let ranked = |&slot: &PairSlot| (urgencies[slot.index()].rank(tick), slot);
            self.keyed.extend(work.iter().map(ranked));
        }
        Line {
            order,
            ready,
            batch: BATCH_FIRST,
        }
    }

    /// Puts the next batch in order when the work has come as far as the last.
    pub(super) fn order_next(
        &mut self,
        line: &mut Line,
        work: &mut [PairSlot],
        at: usize,
        world: &World,
        meter: &mut Meter<'_>,
    ) {
        if at < line.ready {
            return;
        }
        let Self { keyed, hot, .. } = self;
        let rest = &mut keyed[at..];
        let batch = line.batch.min(rest.len());
        match line.order {
            Order::AsFound => {}
            Order::Aged => least_first(rest, batch, |&key| key),
            Order::Counted => least_first(rest, batch, |&(rank, slot)| {
                let hot = &hot[slot.index()];
                let id = |body| world.body(body).map(|body| body.id);
                (rank, id(hot.a), id(hot.b))
            }),
        }
        for (to, (_, slot)) in work[at..].iter_mut().zip(&keyed[at..]) {
            *to = *slot;
        }
        line.ready = at + batch;
        line.batch = 4 * batch;
        meter.refresh();
    }
}

/// Brings the `batch` least to the front, in order; the rest stays behind in any.
fn least_first<T, K: Ord>(items: &mut [T], batch: usize, key: impl Fn(&T) -> K) {
    if batch < items.len() {
        items.select_nth_unstable_by_key(batch, &key);
    }
    items[..batch].sort_unstable_by_key(&key);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_give_the_order_of_one_sort() {
        let mut random = 7_u32;
        let mut items: Vec<u32> = (0..1_000)
            .map(|_| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                random >> 24
            })
            .collect();
        let mut sorted = items.clone();
        sorted.sort_unstable();
        let mut at = 0;
        for batch in [64, 256, 680] {
            least_first(&mut items[at..], batch, |&item| item);
            at += batch;
        }
        assert_eq!(items, sorted);
    }

    #[test]
    fn last_ticks_contacts_come_first_then_the_oldest_then_the_fastest() {
        let urgency = |since, motion_m: f64, touched| Urgency {
            since,
            motion_bits: (motion_m.to_bits() >> 32) as u32,
            touched,
        };
        let order = [
            urgency(0, 0.1, true),
            urgency(100, 0.0, true),
            urgency(90, 0.0, true),
            urgency(95, 2.0, false),
            urgency(95, 1.0, false),
            urgency(0, 3.0, false),
        ];
        assert!(order.is_sorted_by_key(|urgency| urgency.rank(100)));
    }
}
