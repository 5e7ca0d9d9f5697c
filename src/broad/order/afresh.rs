//! Without candidates: for motion that no fat box can follow, and for very many pairs.
//!
//! In: every box. Out: pairs that began and pairs that parted.
//!
//! Bodies keep their lanes and nothing else. In each tick every box is written to its lane, and each block queries the
//! tree for later blocks that it meets (`met`): the overlaps are a bit matrix per such block pair. As long as the lanes
//! stay, begins and ends are differences of these bits, so no list of pairs is sorted or kept. The cost is the same
//! whatever the bodies do: more than candidates that last, less than candidates that never do. Counted work decides
//! which of the two a tick uses (`gear`, `probe`). Where bodies keep their course, one search serves several ticks
//! (`verlet`).
//!
//! Bodies are laid out again once the blocks have grown so much that the extra comparisons have cost as much as that.
//! The sort for it is spread over the ticks before (`presort`), or done at once where the order degrades at once.
//!
//! Exact like the rest: boxes are rounded outward, and where rounding could change the answer the f64 boxes are tested.

use super::cost::{list_cost, list_worth, search_cost};
use super::gear::Gear;
use super::lay::{LAY_TESTS, TakeLanes};
use super::look::overlap;
use super::met::{Met, TellDifference, tell_all, tell_asked};
use super::presort::{Presort, SPLIT_TICKS_MAX, split_ticks};
use super::probe::Probe;
use super::sweep::{Finds, Search};
use super::team::Team;
use super::verlet::Verlet;
use super::{BodySlot, MANY_CAME, Order, Proxies, Tick, Work, give_back, parts};
use crate::broad::members::{ASKED, CAME, Members};
use crate::ids::PairKey;
use crate::simd::boxes::prefetch;
use crate::wire::BroadMode;

/// Ticks between updates of the curve's frame to the places and sizes of the bodies; an outdated frame only costs time.
pub(super) const FRAME_TICKS: u32 = 256;
/// When a layout is spoilt within one tick, no layout is tried for this many ticks.
const SPOILT_TICKS: u32 = 64;

/// A presorted order is not waited for when the blocks have grown by this factor more than allowed.
const OVERDUE: f64 = 2.0;

/// How many pairs ahead ranks are prefetched.
const AHEAD: usize = 16;

/// What happens to the lanes in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lay {
    /// Bodies keep their lanes.
    Stays,
    /// Bodies are laid out in the order that was sorted over the last ticks.
    Presorted,
    /// Bodies are sorted and laid out at once.
    Anew,
}

/// State kept from tick to tick, and memory kept across calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Afresh {
    /// In use: the order has no candidates then.
    pub(super) on: bool,
    pub(super) gear: Gear,
    pub(super) probe: Probe,
    /// Ticks since the frame of the curve was computed, and since the bodies were laid out.
    pub(super) framed: u32,
    pub(super) laid: u32,
    /// The order of the next layout.
    pub(super) presort: Presort,
    /// During a layout: lanes of the last block that have been passed.
    pub(super) dealt: usize,
    /// Remaining ticks in which bodies are laid out without trying to keep lanes.
    pub(super) spoilt: u32,
    /// Overlaps of the last tick, and what was found in this one.
    pub(super) held: Met,
    pub(super) verlet: Verlet,
    pub(super) finds: Finds,
    /// Other threads that search in parallel with this one.
    pub(super) team: Team,
    /// By block: lanes whose body has left since the last tick, and lanes whose body has jumped away.
    pub(super) gone: Vec<u16>,
    pub(super) jumped: Vec<u16>,
    /// Bodies that jumped in the last tick.
    pub(super) jumps: usize,
    /// By block: the volume from which it is met, as of its layout; and the mean side of a block then.
    pub(super) reach: Vec<f32>,
    pub(super) side: f32,
    /// Boxes compared with a block in the tick of the layout; and the excess over that since.
    pub(super) usual: u64,
    pub(super) excess: f64,
    /// Excess over `usual` of the last tick, estimated from how the blocks have grown.
    pub(super) last: f64,
}

impl Order {
    /// Drops the candidates; their overlaps stay.
    fn begin_afresh(&mut self) {
        self.carry_all();
        self.give_back_candidates();
        self.links.reset(self.live.len());
        self.entries.clear();
        self.listed = false;
        self.worklist.clear();
        // Lanes change without them: a record would belong to another body.
        self.gaits.clear();
        self.lags = false;
        self.held.clear();
        self.afresh.on = true;
        self.afresh.presort.stop();
        self.afresh.held.clear();
        self.afresh.framed = FRAME_TICKS;
    }

    /// Returns to candidates: the overlaps wait for a sort of all, which must follow.
    pub(super) fn end_afresh(&mut self) {
        if self.afresh.verlet.on {
            self.end_list();
        }
        self.carry_held();
        self.give_back_afresh();
        self.links.reset(self.live.len());
        self.afresh.on = false;
    }

    /// A tick without candidates.
    pub(super) fn work_afresh<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Work) {
        work.way = Some((BroadMode::Scratch, self.afresh.gear.cause));
        self.update_afresh(tick, work);
        let Afresh {
            verlet,
            gear,
            finds,
            ..
        } = &mut self.afresh;
        let bodies = tick.members.bounded().len();
        if !verlet.on {
            // After a new layout the boxes may have been searched twice.
            gear.note_scratch(bodies, search_cost(bodies, finds.tests));
        } else if let Some(mean) = verlet.pace.mean() {
            gear.note_scratch(bodies, list_cost(bodies, mean));
        }
        self.probe(tick);
    }

    /// Finds every overlap and reports what differs from the last tick.
    fn update_afresh<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Work) {
        let was = self.afresh.on;
        if !was {
            self.begin_afresh();
        }
        self.afresh.framed = self.afresh.framed.saturating_add(1);
        self.afresh.laid = self.afresh.laid.saturating_add(1);
        let listed = self.afresh.verlet.on;
        if listed && self.update_list(tick, work) {
            self.afresh.gone.fill(0);
            self.tell_asked_afresh(tick.members, tick.began);
            return;
        }
        let Afresh { verlet, finds, .. } = &mut self.afresh;
        let worth = list_worth(self.len, finds.tests);
        let begins = was && !listed && verlet.pace.begins(self.hits, worth);
        if was && !listed {
            self.prepare_list(begins);
        }
        let lanes = if was && !listed {
            self.keep_lanes(tick)
        } else {
            Lay::Anew
        };
        let (stays, presorted) = (lanes == Lay::Stays, lanes == Lay::Presorted);
        // Carrying overlaps to other lanes costs as much as another search: each as much as a box compared with a
        // block.
        let crowded = presorted && self.hits as u64 > self.afresh.finds.tests;
        if !(stays || crowded) {
            if was {
                self.carry_held();
            }
            self.lay(presorted, tick);
        }
        let tests = self.find_overlaps(tick, work);
        if stays || crowded {
            self.level.run(TellDifference {
                before: &self.afresh.held,
                now: &self.afresh.finds.met,
                gone: &self.afresh.gone,
                slot_of: &self.slot_of,
                parted: tick.parted,
                began: tick.began,
            });
            self.tell_jumped(tick);
        } else {
            self.tell_carried(tick);
        }
        if crowded {
            self.lay(presorted, tick);
            self.afresh.usual = self.find_overlaps(tick, work);
        } else if !stays {
            self.afresh.usual = tests;
        }
        self.afresh.gone.fill(0);
        std::mem::swap(&mut self.afresh.held, &mut self.afresh.finds.met);
        self.tell_asked_afresh(tick.members, tick.began);
        if begins && stays {
            self.try_list(tests, tick, work);
        }
    }

    /// Gives the bodies new lanes: from the presorted order, if there is one with a lane for each, else by a sort now.
    fn lay<P: Proxies>(&mut self, presorted: bool, tick: &Tick<'_, P>) {
        if !(presorted && self.lay_presorted(tick)) {
            self.lay_anew(tick);
        }
    }

    /// Finds every overlap; returns the boxes compared with a block.
    fn find_overlaps<P: Proxies>(&mut self, tick: &Tick<'_, P>, work: &mut Work) -> u64 {
        let Afresh { finds, team, .. } = &mut self.afresh;
        let blocks = self.live.len();
        let lanes = (&mut self.live, &mut self.fat, &mut self.tree);
        team.search(self.level, lanes, 0..blocks, finds, Search::Overlaps);
        let tests = finds.tests;
        work.tests += tests;
        self.ask_open(tick.proxies);
        let Afresh {
            held, finds, team, ..
        } = &mut self.afresh;
        self.hits = finds.met.hits();
        held.spare_for(finds.met.len(), blocks);
        finds.spare();
        team.reserve(blocks, self.len);
        tests
    }

    /// Gives bodies that came a lane, takes every box, continues a sort that is under way or due, and returns what
    /// happens to the lanes.
    fn keep_lanes<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> Lay {
        if self.afresh.spoilt > 0 {
            self.afresh.spoilt -= 1;
            return Lay::Anew;
        }
        let (came, bodies) = (self.homeless.len(), tick.members.bounded().len());
        #[allow(clippy::cast_precision_loss, reason = "a cost")]
        let (usual, most) = (
            self.afresh.usual as f64,
            self.len as f64 * f64::from(LAY_TESTS),
        );
        // Blocks do not shrink: this tick has at least the excess of the last one, so no trial is needed.
        let worn = self.afresh.excess + self.afresh.last > most;
        let changed = came + self.afresh.jumps;
        let steady = changed * MANY_CAME * (SPLIT_TICKS_MAX + 1) <= bodies;
        let at_once = worn && !(self.afresh.presort.is_on() || steady);
        if at_once || came * MANY_CAME > bodies {
            return Lay::Anew;
        }
        let jumped = self.level.run(TakeLanes {
            order: self,
            proxies: tick.proxies,
        });
        self.afresh.jumps = jumped;
        if !self.seat_anew(jumped, tick) {
            return Lay::Anew;
        }
        let last = (self.grown() - 1.0).max(0.0) * usual;
        self.afresh.last = last;
        self.afresh.excess += last;
        let excess = self.afresh.excess;
        self.afresh.presort.note_late(&self.homeless, bodies);
        if self.afresh.presort.is_ready() {
            return Lay::Presorted;
        }
        let spoils = self.afresh.laid == 1;
        let waits = if spoils { most } else { most * OVERDUE };
        if excess > waits || excess > most && !(steady || self.afresh.presort.is_on()) {
            if spoils {
                self.afresh.spoilt = SPOILT_TICKS;
            }
            return Lay::Anew;
        }
        let Afresh { presort, .. } = &mut self.afresh;
        if presort.is_on() {
            presort.go_on(&mut self.sorter, &self.boxes);
        } else if steady {
            let ticks = split_ticks(most, last);
            #[allow(clippy::cast_precision_loss, reason = "a few ticks")]
            if excess + last * (ticks + 1) as f64 > most {
                self.begin_presort(ticks);
            }
        }
        Lay::Stays
    }

    /// Tests the f64 boxes where rounding leaves the answer open.
    fn ask_open<P: Proxies>(&mut self, proxies: &P) {
        let Finds { open, met, .. } = &mut self.afresh.finds;
        for ranks in open.drain(..) {
            if !overlap(&self.slot_of, ranks, proxies) {
                met.take_out(ranks);
            }
        }
    }

    /// Saves every overlap of the last tick, except those of bodies that left since.
    fn carry_held(&mut self) {
        let Afresh { held, gone, .. } = &mut self.afresh;
        held.carry(None, (gone, &self.slot_of), self.level, &mut self.carried);
    }

    /// After a new layout: reports overlaps that are new, and saved overlaps that are gone.
    fn tell_carried<P>(&mut self, tick: &mut Tick<'_, P>) {
        let Afresh { held, finds, .. } = &mut self.afresh;
        held.clone_from(&finds.met);
        for at in 0..self.carried.len() {
            if let Some(ahead) = self.carried.get(at + AHEAD) {
                prefetch(&self.rank_of[ahead.0 as usize]);
                prefetch(&self.rank_of[ahead.1 as usize]);
            }
            let (one, other) = self.carried[at];
            let ranks = [one, other].map(|slot| self.rank_of[slot as usize]);
            if !held.take_out(ranks) {
                tick.parted
                    .push(PairKey::new(BodySlot(one), BodySlot(other)));
            }
        }
        give_back(&mut self.carried, self.len);
        tell_all(held, &self.slot_of, tick.began);
    }

    /// Reports every overlap of bodies whose pairs must be searched, even if nothing moved.
    fn tell_asked_afresh(&mut self, members: &Members, began: &mut Vec<PairKey>) {
        let mut any = false;
        for slot in members.touched() {
            if !members.has(*slot, ASKED) || members.has(*slot, CAME) {
                continue;
            }
            if let Some(rank) = self.rank(*slot) {
                let (block, lane) = parts(rank);
                self.dirty[block] |= 1 << lane;
                any = true;
            }
        }
        if any {
            if self.afresh.verlet.on {
                self.tell_listed(&self.dirty, began);
            } else {
                tell_asked(&self.afresh.held, &self.dirty, &self.slot_of, began);
            }
            self.dirty.fill(0);
        }
    }

    /// Checks that the lists name the bodies that are in and that the stored overlaps match the boxes; for few bodies
    /// only, since it tests every pair.
    pub(super) fn check_afresh<P: Proxies>(
        &self,
        members: &Members,
        proxies: &P,
    ) -> Result<(), String> {
        let bodies = members.bounded();
        let held = if self.afresh.verlet.on {
            self.count_listed()
        } else {
            self.afresh.held.recount()
        };
        if bodies.len() != self.len || held != self.hits {
            return Err(format!(
                "{} bodies have lanes, {} boxes are in; {held} overlaps, {} counted",
                self.len,
                bodies.len(),
                self.hits
            ));
        }
        for slot in bodies {
            let rank = self
                .rank(*slot)
                .ok_or_else(|| format!("{slot:?} has no lane"))?;
            let (block, lane) = parts(rank);
            if self.slot_of[rank as usize] != slot.0 || self.live[block] >> lane & 1 == 0 {
                return Err(format!("the lane of {slot:?} is not its own"));
            }
        }
        self.check_presort(members)?;
        self.check_homes()?;
        self.tree.validate(&self.fat)?;
        if self.afresh.verlet.on {
            return self.check_listed(bodies, proxies);
        }
        if bodies.len() > 300 {
            return Ok(());
        }
        for (at, one) in bodies.iter().enumerate() {
            for other in &bodies[at + 1..] {
                let meet = proxies.aabb(*one).overlaps(proxies.aabb(*other));
                let ranks = [*one, *other].map(|slot| self.rank_of[slot.index()]);
                if meet != self.afresh.held.has(ranks) {
                    let key = PairKey::new(*one, *other);
                    return Err(format!("the overlap of {key:?} is {meet}, and not held so"));
                }
            }
        }
        Ok(())
    }
}
