//! Takes the new boxes of moved bodies and finds bodies that left their fat box.

use super::fatten::HORIZON;
use super::{BodySlot, NONE, Order, Proxies, Tick, ones, parts, small};
use crate::simd::boxes::{Down, Held, Kernel, Lanes, WIDTH, prefetch};

/// Lanes that moved and whose fat box is at least this old are renewed at their block's turn, or together with a lane
/// of their block that must be: they share the walk down the tree, and would be next anyway.
const ALONG_AGE: u32 = HORIZON / 2;

/// Lanes of bodies at rest for long are renewed only at one in this many turns of their block.
const PATIENT_TURNS: u32 = 16;
/// Bodies at rest for long are renewed only where there is more than one uncertain candidate per `OPEN` bodies:
/// otherwise little can be gained.
const OPEN: usize = 4;

/// Least number of stretches of blocks that the turns cycle through; a stretch is a quarter at most.
const STRETCHES: usize = 3 * HORIZON as usize;

/// If no more than one in this many bodies did not move, all boxes are taken.
const NEARLY_ALL: usize = 16;

/// How many blocks ahead boxes are prefetched: taking a box costs some 5 ns, a memory access ten to thirty times as
/// much. One prefetch per box taken, as a processor handles only so many at a time.
const AHEAD: usize = 2;
/// A block without bodies.
const NOBODY: [u32; WIDTH] = [NONE; WIDTH];
/// When few moved: how many bodies ahead their data are prefetched.
const AHEAD_BODIES: usize = 8;

impl Order {
    /// Takes boxes; lists lanes to renew in `renewing` and `worklist`.
    pub(super) fn load<P: Proxies>(&mut self, tick: &Tick<'_, P>, many: bool) {
        self.worklist.clear();
        if self.stands(many) {
            self.load_standing(tick);
            return;
        }
        self.stir(tick.proxies);
        if many {
            if tick.moved.len() + tick.moved.len() / NEARLY_ALL >= self.len {
                // Nearly all: taking an unchanged box again costs less than finding out which did not change.
                self.dirty.copy_from_slice(&self.live);
            } else {
                for slot in tick.moved {
                    let rank = self.rank_of.get(slot.index()).copied().unwrap_or(NONE);
                    if rank != NONE {
                        let (block, lane) = parts(rank);
                        self.dirty[block] |= 1 << lane;
                    }
                }
            }
            let level = self.level;
            level.run(LoadBlocks { order: self, tick });
        } else {
            let level = self.level;
            level.run(LoadBodies { order: self, tick });
        }
    }

    /// Marks lanes to renew.
    #[inline(always)]
    pub(super) fn mark(&mut self, block: usize, lanes: u16) {
        if self.renewing[block] == 0 && lanes != 0 {
            self.worklist.push(small(block));
        }
        self.renewing[block] |= lanes;
    }

    /// Ticks until a block's turn. While many move, each tick renews a few stretches of the order, so that all ticks
    /// cost the same, wherever large or crowded bodies are, and most neighbours are renewed together: then one query
    /// serves both.
    #[inline(always)]
    fn until_turn(&self, block: usize) -> u32 {
        let turn = small(block / self.stretch()) % HORIZON;
        (turn + HORIZON - self.tick % HORIZON) % HORIZON
    }

    /// Blocks of a stretch.
    #[inline(always)]
    fn stretch(&self) -> usize {
        (self.live.len() / STRETCHES).clamp(1, WIDTH)
    }

    /// Returns whether it is a quarter's turn. Where a stretch is a quarter it is also its blocks' turn; with fewer
    /// blocks each quarter still has its own turn, and no tick has all of them.
    pub(super) fn is_quarter_due(&self, quarter: usize) -> bool {
        small(quarter) % HORIZON == self.tick % HORIZON
    }

    /// The blocks whose turn it is.
    pub(super) fn due_blocks(&self) -> impl Iterator<Item = usize> + use<> {
        let (blocks, stretch) = (self.live.len(), self.stretch());
        let first = (self.tick % HORIZON) as usize * stretch;
        let starts = (first..blocks).step_by(HORIZON as usize * stretch);
        starts.flat_map(move |start| start..(start + stretch).min(blocks))
    }

    /// Returns whether it is a block's turn.
    pub(super) fn is_due(&self, block: usize) -> bool {
        self.until_turn(block) == 0
    }

    /// Ticks that a fat box made now shall last: until its block's turn, or the one after.
    #[inline(always)]
    pub(super) fn horizon(&self, block: usize) -> u32 {
        let left = self.until_turn(block);
        // One more: the box of this tick may be left only after the turn.
        left + 1 + if left < ALONG_AGE { HORIZON } else { 0 }
    }

    /// The moved lanes of a block that are to be renewed along: old enough and about to leave within a round, or
    /// calmed.
    #[inline(always)]
    pub(super) fn along<L: Lanes>(&self, lanes: L, block: usize, moved: u16) -> u16 {
        let mut chosen = 0;
        let patient = self.is_patient(block);
        for lane in ones(moved) {
            let rank = block * WIDTH + lane;
            let (gait, now) = (&self.gaits[rank], &self.exact[rank]);
            let held = &self.held[self.slot_of[rank] as usize].hold();
            let leaves = gait.age(self.beat) >= ALONG_AGE
                && gait.leaves(lanes, now, held, self.beat, HORIZON);
            let calmed = gait.has_calmed(now, self.beat) && (patient || !gait.is_at_rest());
            chosen |= u16::from(leaves | calmed) << lane;
        }
        chosen
    }

    /// Returns whether bodies of a block at rest for long may be renewed at this turn: where that may make candidates
    /// certain, and spread over turns, for a pile comes to rest at once.
    #[inline(always)]
    fn is_patient(&self, block: usize) -> bool {
        let many_open = self.entries.len() * OPEN > self.len;
        let turn = (self.tick / HORIZON).wrapping_add(small(block));
        many_open && turn.is_multiple_of(PATIENT_TURNS)
    }

    /// The lanes of a block that may be renewed along: old enough with bodies not at rest, and at some turns all.
    #[inline(always)]
    pub(super) fn moving(&self, block: usize) -> u16 {
        let mut chosen = 0;
        let patient = self.is_patient(block);
        for lane in ones(self.live[block]) {
            let gait = &self.gaits[block * WIDTH + lane];
            let moves = gait.age(self.beat) >= ALONG_AGE && (patient || !gait.is_at_rest());
            chosen |= u16::from(moves) << lane;
        }
        chosen
    }

    /// Writes the box of a lane; returns whether its fat box still contains it.
    #[inline(always)]
    pub(super) fn take<L: Lanes, P: Proxies>(
        &mut self,
        lanes: L,
        proxies: &P,
        slot: BodySlot,
        rank: usize,
    ) -> bool {
        let (held, exact) = (&self.held[slot.index()], &mut self.exact[rank]);
        take(lanes, (proxies, &self.origin), slot, held, exact)
    }
}

/// Writes the box of a body; returns whether its fat box still contains it.
#[inline(always)]
fn take<L: Lanes, P: Proxies>(
    lanes: L,
    (proxies, origin): (&P, &[f64; 3]),
    slot: BodySlot,
    held: &Held,
    exact: &mut Down,
) -> bool {
    let aabb = proxies.aabb(slot);
    let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
    lanes.take(corners, origin, held, exact)
}

/// The bodies of a block, and of one some blocks ahead: while a box is taken another is prefetched, since boxes of the
/// world are stored in another order.
#[derive(Clone, Copy)]
pub(super) struct Taking<'a> {
    slots: &'a [u32; WIDTH],
    ahead: &'a [u32; WIDTH],
}

impl<'a> Taking<'a> {
    /// * `slot_of` - the body slots, by rank.
    #[inline(always)]
    pub(super) fn of(slot_of: &'a [u32], block: usize) -> Self {
        let blocks = slot_of.as_chunks().0;
        Self {
            slots: blocks.get(block).unwrap_or(&NOBODY),
            ahead: blocks.get(block + AHEAD).unwrap_or(&NOBODY),
        }
    }

    /// Prefetches the holds of the block ahead.
    #[inline(always)]
    fn prefetch(self, held: &[Held]) {
        for ahead in self.ahead {
            if let Some(hold) = held.get(*ahead as usize) {
                prefetch(hold);
            }
        }
    }

    /// The body of a lane in use, whose box is taken next.
    #[inline(always)]
    pub(super) fn slot<P: Proxies>(self, lane: usize, proxies: &P) -> BodySlot {
        let ahead = self.ahead[lane];
        if ahead != NONE {
            prefetch(proxies.aabb(BodySlot(ahead)));
        }
        BodySlot(self.slots[lane])
    }
}

/// Block by block, the changed lanes of each.
struct LoadBlocks<'a, 'b, P> {
    order: &'a mut Order,
    tick: &'a Tick<'b, P>,
}

impl<P: Proxies> Kernel for LoadBlocks<'_, '_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (order, tick) = (self.order, self.tick);
        let origin = order.origin;
        for block in 0..order.live.len() {
            let moved = std::mem::take(&mut order.dirty[block]);
            if moved == 0 {
                continue;
            }
            let taking = Taking::of(&order.slot_of, block);
            taking.prefetch(&order.held);
            let exact = &mut order.exact.as_chunks_mut::<WIDTH>().0[block];
            let mut out = 0;
            for lane in ones(moved) {
                let slot = taking.slot(lane, tick.proxies);
                let boxes = (tick.proxies, &origin);
                let held = &order.held[slot.index()];
                let holds = take(lanes, boxes, slot, held, &mut exact[lane]);
                out |= u16::from(!holds) << lane;
            }
            if order.is_due(block) || out != 0 {
                let along = order.along(lanes, block, moved);
                order.mark(block, out | along);
            }
        }
    }
}

/// Body by body.
struct LoadBodies<'a, 'b, P> {
    order: &'a mut Order,
    tick: &'a Tick<'b, P>,
}

impl<P: Proxies> Kernel for LoadBodies<'_, '_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (order, tick) = (self.order, self.tick);
        for (at, slot) in tick.moved.iter().enumerate() {
            if let Some(ahead) = tick.moved.get(at + AHEAD_BODIES)
                && let Some(rank) = order.rank(*ahead)
            {
                let rank = rank as usize;
                prefetch(tick.proxies.aabb(*ahead));
                prefetch(&order.held[ahead.index()]);
                prefetch(&order.exact[rank]);
                prefetch(&order.gaits[rank]);
            }
            let Some(rank) = order.rank(*slot) else {
                continue;
            };
            let (block, lane) = parts(rank);
            order.gaits[rank as usize].note_move();
            if !order.take(lanes, tick.proxies, *slot, rank as usize) {
                order.mark(block, 1 << lane);
            }
        }
        // Blocks in ascending order: the tree is refitted in this order.
        order.worklist.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn within_a_round_every_block_and_quarter_has_one_turn_and_no_tick_has_all() {
        for blocks in [20, 160, 700, 9000] {
            let mut order = Order::default();
            order.live.resize(blocks, 0);
            let quarters = blocks.div_ceil(WIDTH);
            let (mut turns, mut looked_after) = (vec![0; blocks], vec![0; quarters]);
            for tick in 0..HORIZON {
                order.tick = 1000 + tick;
                let due = |block: &usize| order.is_due(*block);
                (0..blocks).filter(due).for_each(|block| turns[block] += 1);
                assert!((0..blocks).filter(due).eq(order.due_blocks()));
                let mine = (0..quarters).filter(|quarter| order.is_quarter_due(*quarter));
                let mine: Vec<usize> = mine.collect();
                assert!(mine.len() <= quarters.div_ceil(HORIZON as usize));
                mine.into_iter()
                    .for_each(|quarter| looked_after[quarter] += 1);
            }
            assert!(turns.iter().all(|turns| *turns == 1), "{blocks} blocks");
            assert!(
                looked_after.iter().all(|turns| *turns == 1),
                "{blocks} blocks"
            );
        }
    }
}
