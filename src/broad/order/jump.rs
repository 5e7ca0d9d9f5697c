//! Bodies that jump clear of their block, while bodies stay in their lanes: they get others, the rest stays as it is.
//!
//! Without candidates alone. A few bodies far from where they stood would stretch their blocks over the scene; to lay
//! everything anew for them costs several times as much as to seat them.

use super::afresh::Afresh;
use super::lay::Bound;
use super::{BodySlot, MANY_CAME, NONE, Order, PairKey, Proxies, Tick, ones, parts, small};
use crate::simd::boxes::{Lanes, WIDTH, Work, prefetch};

/// Bodies ahead whose boxes are asked for.
const AHEAD: usize = 8;

impl Order {
    /// Gives who came and who jumped a lane; whether there was one for each.
    ///
    /// * `jumped` - how many the boxes just taken say have jumped.
    pub(super) fn seat_anew<P: Proxies>(&mut self, jumped: usize, tick: &Tick<'_, P>) -> bool {
        let came = self.homeless.len();
        if came + jumped == 0 {
            return true;
        }
        if (came + jumped) * MANY_CAME > tick.members.bounded().len() {
            return false;
        }
        if jumped > 0 {
            let Afresh {
                held, gone, jumped, ..
            } = &mut self.afresh;
            held.carry(
                Some(jumped),
                (gone, &self.slot_of),
                self.level,
                &mut self.carried,
            );
            self.unseat();
        }
        let homeless = std::mem::take(&mut self.homeless);
        let all = self.seat_all(&homeless, tick.proxies);
        self.homeless = homeless;
        all
    }

    /// Gives bodies without one a lane each, and brings the bounds of all blocks that changed up to date; whether there
    /// was a lane for each. Who has one keeps it.
    pub(super) fn seat_all<P: Proxies>(&mut self, bodies: &[BodySlot], proxies: &P) -> bool {
        let mut blocks = std::mem::take(&mut self.worklist);
        let level = self.level;
        let all = level.run(Seat {
            order: self,
            bodies,
            proxies,
            blocks: &mut blocks,
        });
        blocks.sort_unstable();
        blocks.dedup();
        level.run(Bound {
            order: self,
            blocks: blocks.iter().map(|block| *block as usize),
        });
        blocks.clear();
        self.worklist = blocks;
        all
    }

    /// Takes the lanes of those that jumped away; notes them as homeless, and their blocks as changed.
    fn unseat(&mut self) {
        for block in 0..self.live.len() {
            let jumped = self.afresh.jumped[block];
            if jumped == 0 {
                continue;
            }
            for lane in ones(jumped) {
                let slot = std::mem::replace(&mut self.slot_of[block * WIDTH + lane], NONE);
                self.rank_of[slot as usize] = NONE;
                self.fat[block].set(lane, &[f32::NAN; 6]);
                self.homeless.push(BodySlot(slot));
                self.len -= 1;
            }
            self.live[block] &= !jumped;
            self.worklist.push(small(block));
        }
    }

    /// Tells which pairs of bodies that jumped have parted. Those that have not are told as begun, which of a pair that
    /// is stored means nothing.
    pub(super) fn tell_jumped<P>(&mut self, tick: &mut Tick<'_, P>) {
        for (one, other) in self.carried.drain(..) {
            let ranks = [one, other].map(|slot| self.rank_of[slot as usize]);
            if !self.afresh.finds.met.has(ranks) {
                let key = PairKey::new(BodySlot(one), BodySlot(other));
                tick.parted.push(key);
            }
        }
    }
}

/// Gives bodies without one a lane each, and notes their blocks; whether there was a lane for each.
struct Seat<'a, P> {
    order: &'a mut Order,
    bodies: &'a [BodySlot],
    proxies: &'a P,
    blocks: &'a mut Vec<u32>,
}

impl<P: Proxies> Work for Seat<'_, P> {
    type Out = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let (order, bodies) = (self.order, self.bodies);
        for (at, slot) in bodies.iter().enumerate() {
            if let Some(ahead) = bodies.get(at + AHEAD) {
                prefetch(self.proxies.aabb(*ahead));
            }
            if order.rank(*slot).is_some() {
                continue;
            }
            let Some((rank, one)) = order.lane_for(lanes, *slot, self.proxies) else {
                return false;
            };
            order.sit(*slot, rank, one);
            let (block, lane) = parts(rank);
            order.fat[block].set(lane, &one.corners());
            self.blocks.push(small(block));
        }
        true
    }
}
