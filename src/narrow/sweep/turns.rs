//! In which order a tick's sweeps have their turns.
//!
//! In: the sweeps of a tick, a [`Meter`]. Out: sweeps that are done, and where the next tick begins.
//!
//! Rounds of short turns, so that quick decisions do not wait for slow ones. Nothing starves if a budget does not
//! suffice for a round: a tick begins behind the last pair that had a turn in the tick before. And in case no turn is
//! long enough to decide anything, the first pair of a tick is worked on to its end before the rounds begin, in the
//! next tick the pair behind it: so each pair that stays gets all looks that a budget allows, at the latest after as
//! many ticks as there are such pairs.

use crate::ids::{BodyId, PairSlot};
use crate::narrow::order::Order;
use crate::narrow::{NONE, Narrow, Wanted};
use crate::time::{Meter, Share};
use crate::world::World;

use super::advance::Work;
use super::{Sweep, Sweeps};

/// A pair that had a turn.
#[derive(Clone, Copy, Debug)]
struct Turn {
    slot: PairSlot,
    ids: Ids,
    /// Its index in the list.
    at: usize,
}

type Ids = (Option<BodyId>, Option<BodyId>);

/// Where rounds continue, kept over ticks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turns {
    /// The pair that was last worked on to its end first.
    first: Option<Turn>,
    /// Whether there was one in this tick.
    has_first: bool,
    /// The pair that had the last turn of a round.
    last: Option<Turn>,
}

impl Turns {
    /// Another tick begins.
    pub(super) fn begin(&mut self) {
        self.has_first = false;
    }
}

impl Narrow {
    /// Works on sweeps while the meter is open, for at most this share of it and this many looks at each. Returns
    /// whether nothing is left to do.
    pub(in crate::narrow) fn spend_on_sweeps(
        &mut self,
        world: &World,
        wanted: Wanted,
        meter: &mut Meter<'_>,
        share: Option<Share>,
        looks_max: u32,
    ) -> bool {
        let waits = |sweep: &Sweep| !sweep.done && sweep.looks < looks_max;
        if self.sweeps.told || !self.sweeps.list.iter().any(waits) {
            return true;
        }
        let by_ids = wanted.order == Order::Counted;
        if by_ids {
            self.sweeps.sort(world);
        }
        let Self {
            sweeps,
            counters,
            memos,
            ..
        } = self;
        // Within a tick the same pair stays first.
        let start = match sweeps.turns.first {
            Some(first) if sweeps.turns.has_first => sweeps.places[first.slot.index()] as usize,
            first => sweeps.behind(first, by_ids, world),
        };
        let round = sweeps.behind(sweeps.turns.last, by_ids, world);
        let Sweeps {
            list, tools, turns, ..
        } = sweeps;
        let mut work = Work {
            tools,
            counters,
            meter,
        };
        // A turn. Returns whether there was time for it.
        let mut give = |sweep: &mut Sweep| {
            let within = share.is_none_or(|share| work.meter.within(share));
            if !within || !work.meter.open() {
                return false;
            }
            if let (Some(a), Some(b)) = (world.body(sweep.a), world.body(sweep.b)) {
                sweep.turn((a, b), &mut work);
                // The next query for their gap starts from here.
                memos[sweep.slot.index()].warm = sweep.warm;
            }
            true
        };
        let len = list.len();
        let from = |start: usize| (0..len).map(move |step| (start + step) % len);
        let first = if turns.has_first {
            Some(start)
        } else {
            from(start).find(|&at| waits(&list[at]))
        };
        if let Some(at) = first {
            while waits(&list[at]) && give(&mut list[at]) {
                turns.has_first = true;
            }
            if turns.has_first {
                turns.first = Some(Turn::of(&list[at], at, world));
            }
        }
        let (mut open, mut last) = (true, None);
        while open && list.iter().any(waits) {
            for at in from(round) {
                if waits(&list[at]) {
                    open = give(&mut list[at]);
                    if !open {
                        break;
                    }
                    last = Some(at);
                }
            }
        }
        if let Some(at) = last {
            turns.last = Some(Turn::of(&list[at], at, world));
        }
        work.release();
        !self.sweeps.list.iter().any(waits)
    }
}

impl Sweeps {
    /// Sorts by body ids, so that a budget of units is spent the same way regardless of the slots.
    fn sort(&mut self, world: &World) {
        let Self { list, places, .. } = self;
        list.sort_unstable_by_key(|sweep| ids_of(sweep, world));
        for (at, sweep) in list.iter().enumerate() {
            places[sweep.slot.index()] = u32::try_from(at).unwrap_or(NONE);
        }
    }

    /// The index behind the pair that had a turn, whether or not that pair still exists; for a list that is not empty.
    ///
    /// * `by_ids` - whether the list is sorted by ids.
    fn behind(&self, turn: Option<Turn>, by_ids: bool, world: &World) -> usize {
        let Some(turn) = turn else {
            return 0;
        };
        let at = if by_ids {
            let list = &self.list;
            list.partition_point(|sweep| ids_of(sweep, world) <= turn.ids)
        } else {
            let place = self.places.get(turn.slot.index());
            let place = place.filter(|place| **place != NONE);
            place.map_or(turn.at, |place| *place as usize) + 1
        };
        at % self.list.len().max(1)
    }
}

impl Turn {
    fn of(sweep: &Sweep, at: usize, world: &World) -> Self {
        Self {
            slot: sweep.slot,
            ids: ids_of(sweep, world),
            at,
        }
    }
}

fn ids_of(sweep: &Sweep, world: &World) -> Ids {
    let id = |slot| world.body(slot).map(|body| body.id);
    (id(sweep.a), id(sweep.b))
}
