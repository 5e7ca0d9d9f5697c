//! Without candidates: for motion that no fat box holds, and for crowds of pairs.
//!
//! In: every box. Out: pairs that began and pairs that parted.
//!
//! Bodies keep their lanes and nothing else. In each tick every box is written to its lane, and each block asks the
//! tree for those behind it that it meets (`met`): what overlaps is a matrix of bits for each two such blocks. As long
//! as the lanes stay, what began and what parted are differences of these bits, so no list of pairs is sorted or kept.
//! It costs the same whatever the bodies do: dearer than candidates that last, and cheaper than candidates that never
//! do. Which of the two a tick takes is chosen by counted work (`gear`, `probe`). Where bodies go on as they came, one
//! search serves several ticks (`verlet`).
//!
//! Bodies are laid anew when the blocks have grown so much that what is asked too much has cost as much as that. They
//! are sorted for it over the ticks before (`presort`), or at once where the order is spoilt at once.
//!
//! Exact as the rest: boxes are rounded outward, and where rounding could tell otherwise the f64 boxes are asked.

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
use super::{BodySlot, MANY_CAME, Order, Proxies, Tick, Work as Done, give_back, parts};
use crate::broad::members::{ASKED, CAME, Members};
use crate::ids::PairKey;
use crate::simd::boxes::prefetch;
use crate::wire::BroadMode;

/// Ticks between two looks at where the bodies are and how large, for the frame of the curve: a frame that is out of
/// date costs time, nothing else.
pub(super) const FRAME_TICKS: u32 = 256;
/// Where what was laid is spoilt in a tick, it is not even looked at in so many ticks.
const SPOILT_TICKS: u32 = 64;

/// An order that is not ready when the blocks have grown so much more than they may is not waited for.
const OVERDUE: f64 = 2.0;

/// How many pairs ahead ranks are asked for.
const AHEAD: usize = 16;

/// What becomes of the lanes in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lay {
    /// Bodies stay where they are.
    Stays,
    /// They are laid in the order that was sorted over the last ticks.
    Presorted,
    /// They are sorted and laid at once.
    Anew,
}

/// What lasts from tick to tick, and memory kept over calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Afresh {
    /// In use: the order keeps no candidates then.
    pub(super) on: bool,
    pub(super) gear: Gear,
    pub(super) probe: Probe,
    /// Ticks since the frame of the curve was laid, and since the bodies were.
    pub(super) framed: u32,
    pub(super) laid: u32,
    /// The order that the bodies are to be laid in next.
    pub(super) presort: Presort,
    /// While they are laid: lanes of the last block that have been passed.
    pub(super) dealt: usize,
    /// Ticks left in which bodies are laid without a look.
    pub(super) spoilt: u32,
    /// Overlaps of the last tick, and what was found in this one.
    pub(super) held: Met,
    pub(super) verlet: Verlet,
    pub(super) finds: Finds,
    /// Threads that search beside this one.
    pub(super) team: Team,
    /// By block: lanes whose body has left since the last tick, and lanes whose body has jumped away.
    pub(super) gone: Vec<u16>,
    pub(super) jumped: Vec<u16>,
    /// Bodies that jumped in the last tick.
    pub(super) jumps: usize,
    /// By block: the space from which it is met, when it was laid; and the mean side of a block then.
    pub(super) reach: Vec<f32>,
    pub(super) side: f32,
    /// Boxes compared with a block in the tick that they were laid in; and those beyond since.
    pub(super) usual: u64,
    pub(super) excess: f64,
    /// Boxes beyond `usual` that the last tick compared, reckoned by how the blocks have grown.
    pub(super) last: f64,
}

impl Order {
    /// Lets go of candidates; their overlaps stay.
    fn begin_afresh(&mut self) {
        self.carry_all();
        self.give_back_candidates();
        self.links.reset(self.live.len());
        self.entries.clear();
        self.listed = false;
        self.worklist.clear();
        // Lanes change without them: what was learned would be another body's.
        self.gaits.clear();
        self.lags = false;
        self.held.clear();
        self.afresh.on = true;
        self.afresh.presort.stop();
        self.afresh.held.clear();
        self.afresh.framed = FRAME_TICKS;
    }

    /// Goes back to candidates: the overlaps wait for a sort of all, which must follow.
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
    pub(super) fn work_afresh<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
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
            // Where bodies were laid anew the boxes may have been searched twice.
            gear.note_scratch(bodies, search_cost(bodies, finds.tests));
        } else if let Some(mean) = verlet.pace.mean() {
            gear.note_scratch(bodies, list_cost(bodies, mean));
        }
        self.probe(tick);
    }

    /// Finds every overlap and reports what differs from the last tick.
    fn update_afresh<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, work: &mut Done) {
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
        // Overlaps that are carried to other lanes take as long as another search, each as a box compared with a block.
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

    /// Gives the bodies lanes in another order: in the one that was sorted ahead, if there is one and it has a lane for
    /// each.
    fn lay<P: Proxies>(&mut self, presorted: bool, tick: &Tick<'_, P>) {
        if !(presorted && self.lay_presorted(tick)) {
            self.lay_anew(tick);
        }
    }

    /// Finds every overlap; returns the boxes compared with a block.
    fn find_overlaps<P: Proxies>(&mut self, tick: &Tick<'_, P>, work: &mut Done) -> u64 {
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

    /// Gives who came a lane, takes every box, sorts some more where a sort is under way or due, and tells what becomes
    /// of the lanes.
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
        // Blocks do not shrink: what the last tick asked too much this one will at least, and need not be tried.
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

    /// Asks the f64 boxes of what rounding leaves open.
    fn ask_open<P: Proxies>(&mut self, proxies: &P) {
        let Finds { open, met, .. } = &mut self.afresh.finds;
        for ranks in open.drain(..) {
            if !overlap(&self.slot_of, ranks, proxies) {
                met.take_out(ranks);
            }
        }
    }

    /// Remembers every overlap of the last tick, but for those of bodies that left since.
    fn carry_held(&mut self) {
        let Afresh { held, gone, .. } = &mut self.afresh;
        held.carry(None, (gone, &self.slot_of), self.level, &mut self.carried);
    }

    /// After the bodies were laid anew: of the overlaps found those that are new, of those remembered the others.
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

    /// Reports every overlap of bodies whose pairs must be looked for, whatever moved.
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

    /// The lists name who is in, and the overlaps held are those of the boxes; few bodies only, for that looks at every
    /// pair.
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
