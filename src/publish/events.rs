//! Begin, persist, end: what is certified about each pair's collisions, and events that wait to be sent.
//!
//! Events are about certified collisions only. With less budget a begin comes later; it is never wrong. An event that
//! does not fit into a message waits here with its range, even after its pair is gone. If a continuous body touched
//! during its motion but no longer does at this tick's poses, that is a begin and an end in one tick: a pass.

mod adrift;
mod idle;
mod late;
mod validate;

use crate::ids::{BodyId, PairSlot};
use crate::narrow::{Finding, Narrow, Passage};
use crate::pairs::{PairDelta, Spare};
use crate::wire::{EndCause, Verdict};
use crate::world::World;

use adrift::Adrift;

/// A pair by its bodies' ids, the smaller first.
pub(super) type Ids = (BodyId, BodyId);

/// The ticks in which something may have happened, both bounds included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ticks {
    pub(super) first: u64,
    pub(super) last: u64,
}

/// The waiting events of one pair: an end, then a begin or a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PairEvent {
    pub(super) ids: Ids,
    /// Order of occurrence, for events of one pair.
    seq: u64,
    pub(super) end: Option<(Ticks, EndCause)>,
    pub(super) begin: Option<Ticks>,
    /// A begin and an end between the poses of two ticks.
    pub(super) pass: Option<Ticks>,
}

impl PairEvent {
    /// Adds what happened next to the same pair; returns how many begins, with their ends, cancel because they were
    /// never sent.
    pub(super) fn follow(&mut self, next: &Self) -> u64 {
        // A pass that was never sent is dropped by any later event: its begin and its end cancel.
        let mut cancelled = u64::from(self.pass.take().is_some());
        self.pass = next.pass;
        if next.end.is_some() {
            if self.begin.take().is_some() {
                cancelled += 1;
            } else {
                self.end = next.end;
            }
        }
        if next.begin.is_some() {
            self.begin = next.begin;
        }
        // A row has one cause; its flag shows that the pair also touched during its motion.
        let by_cause = (self.end).is_some_and(|(_, cause)| cause != EndCause::Separated);
        if by_cause && self.pass.take().is_some() {
            cancelled += 1;
        }
        cancelled
    }

    /// Returns whether nothing is left to report.
    pub(super) fn is_over(&self) -> bool {
        self.end.is_none() && self.begin.is_none() && self.pass.is_none()
    }

    /// Returns whether it is a pass and nothing else.
    pub(super) fn is_pass_alone(&self) -> bool {
        self.pass.is_some() && self.end.is_none() && self.begin.is_none()
    }
}

/// What is certified about a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct History {
    ids: Ids,
    /// Last certified verdict.
    pub(super) verdict: Verdict,
    /// Its tick; 0: never.
    pub(super) tick: u64,
    /// Certified colliding, and not certified ended since.
    pub(super) colliding: bool,
    /// Certified colliding at the poses of the last tick.
    was_colliding: bool,
    /// Undecided since the last tick in which it was reviewed: nothing has been certified since.
    open: bool,
    /// The last certified result is a touch during the motion to poses that were not decided.
    on_way: bool,
    /// The last certified result is for poses of an earlier tick, not reported in that tick.
    late: bool,
    /// The first tick of such a late begin; 0: none.
    late_begin: u64,
    /// Last tick in which the pair was found to be more than plainly apart.
    active: u64,
    /// First tick in which it may have collided; 0: not seen yet.
    born: u64,
}

impl History {
    const NONE: Self = Self {
        ids: (BodyId(0), BodyId(0)),
        verdict: Verdict::None,
        tick: 0,
        colliding: false,
        was_colliding: false,
        open: false,
        on_way: false,
        late: false,
        late_begin: 0,
        active: 0,
        born: 0,
    };

    /// A pair that was certified colliding or near, or was undecided, has stayed so in every tick up to `last`, unless
    /// something else was known since: pairs without changes are not reviewed.
    fn go_on_to(&mut self, last: u64) {
        if self.active >= last {
            return;
        }
        if self.open {
            self.active = last;
        } else if matches!(self.verdict, Verdict::Colliding | Verdict::Near) {
            (self.active, self.tick) = (last, last);
        }
    }

    /// First tick in which it may have ended: after a touch during the motion to undecided poses, that very tick.
    fn next_first(&self) -> u64 {
        self.tick + u64::from(!self.on_way)
    }
}

/// The history of every pair and the waiting events.
#[derive(Debug, Default)]
pub(super) struct Events {
    /// By `PairSlot`.
    histories: Vec<History>,
    spare: Spare,
    /// Histories whose slots were lost, until they are found again.
    adrift: Vec<Adrift>,
    /// By ids; one entry per pair after [`Events::merge`].
    waiting: Vec<PairEvent>,
    /// Events sent in the messages of the last tick, by ids.
    told: Vec<PairEvent>,
    seq: u64,
    /// `seq` before this tick.
    before: u64,
    /// Begins, with their ends, that were both never sent.
    pub(super) cancelled: u64,
}

impl Events {
    /// Returns whether a touch during the motion is news; it is not if a reported collision just continues from the
    /// last tick's poses.
    pub(super) fn is_news(&self, slot: PairSlot, passage: Passage) -> bool {
        match passage {
            Passage::Touched(toi) => toi.max > 0.0 || !self.history(slot).was_colliding,
            Passage::Open(_) => true,
            Passage::Free => false,
        }
    }

    /// Takes the pairs that ended, and those that were active and are now proven apart.
    ///
    /// Must be followed by [`Events::certify`] for each active pair that may have news, and [`Events::merge`].
    pub(super) fn begin(&mut self, tick: u64, world: &World, narrow: &Narrow, delta: &PairDelta) {
        self.before = self.seq;
        for ended in &delta.ended {
            if let Some(history) = self.histories.get_mut(ended.slot.index()) {
                let mut gone = std::mem::replace(history, History::NONE);
                gone.go_on_to(tick - 1);
                if gone.colliding {
                    let ticks = Ticks {
                        first: gone.next_first(),
                        last: tick,
                    };
                    self.push(gone.ids, Some((ticks, ended.cause)), None);
                }
            }
        }
        for &slot in narrow.left() {
            // Handled by an earlier tick, or never reviewed.
            if self
                .histories
                .get(slot.index())
                .is_some_and(|history| history.tick != 0 || history.open)
                && let Some(finding) = narrow.finding(slot)
                && let (Some(a), Some(b)) = (world.tag(finding.a), world.tag(finding.b))
            {
                self.certify(tick, slot, &finding, (a.id, b.id), narrow);
            }
        }
    }

    /// The history of a pair.
    pub(super) fn history(&self, slot: PairSlot) -> History {
        self.histories
            .get(slot.index())
            .copied()
            .unwrap_or(History::NONE)
    }

    /// Waiting events, by ids.
    pub(super) fn waiting(&self) -> &[PairEvent] {
        &self.waiting
    }

    /// Send order if not all fit: events that did not fit in earlier ticks, the oldest first; then new ones.
    pub(super) fn turn(&self, event: u32) -> u64 {
        let seq = self.waiting.get(event as usize).map(|event| event.seq);
        seq.filter(|seq| *seq <= self.before).unwrap_or(u64::MAX)
    }

    /// Events sent in the messages of the last tick, by ids.
    pub(super) fn told(&self) -> &[PairEvent] {
        &self.told
    }

    /// Removes the events that were sent: all except those that `kept` keeps.
    pub(super) fn sent(&mut self, mut kept: impl FnMut(Ids) -> bool) {
        let told = &mut self.told;
        told.clear();
        self.waiting.retain(|event| {
            let kept = kept(event.ids);
            if !kept {
                told.push(*event);
            }
            kept
        });
    }

    /// Takes a pair's verdict of this tick.
    pub(super) fn certify(
        &mut self,
        tick: u64,
        slot: PairSlot,
        finding: &Finding<'_>,
        ids: Ids,
        narrow: &Narrow,
    ) {
        if self.histories.len() <= slot.index() {
            self.histories.resize(slot.index() + 1, History::NONE);
        }
        let mut history = self.histories[slot.index()];
        if history.active == tick {
            return;
        }
        history.go_on_to(tick - 1);
        history.ids = ids;
        // Reported for the last tick's poses: a touch there is news only if the collision was not certified at them.
        let told = !history.on_way && !history.late;
        history.was_colliding = history.colliding && history.tick + 1 == tick && told;
        let late_begin = std::mem::take(&mut history.late_begin);
        history.late = false;
        // Not active in the last tick: proven apart there by its certificate or its boxes, unless the pair is new and
        // one of its bodies was missing, unknown, or not searched there.
        let unseen = (finding.born == tick)
            .then(|| {
                earlier(
                    narrow.unseen_since(finding.a),
                    narrow.unseen_since(finding.b),
                )
            })
            .flatten();
        if history.active + 1 < tick && unseen.is_none() && tick > 1 {
            history.verdict = Verdict::Apart;
            history.tick = tick - 1;
        }
        history.active = tick;
        if history.born == 0 {
            history.born = unseen.unwrap_or(finding.born).min(finding.born);
        }
        let first = if history.tick == 0 {
            history.born
        } else {
            history.next_first()
        };
        let ticks = Ticks { first, last: tick };
        let passage = narrow.passage(slot).map(|swept| swept.passage);
        let touched = matches!(passage, Some(Passage::Touched(_)));
        match finding.verdict {
            Verdict::Colliding => {
                if !history.colliding {
                    self.push(history.ids, None, Some(ticks));
                }
                history.colliding = true;
            }
            Verdict::Near | Verdict::Apart => {
                if history.colliding {
                    self.push(history.ids, Some((ticks, EndCause::Separated)), None);
                    // Its begin, which was not reported yet, cancels with this end: the pass reports both.
                    if touched && late_begin != 0 {
                        let first = late_begin;
                        self.push_pass(history.ids, Ticks { first, last: tick });
                    }
                } else if touched {
                    self.push_pass(history.ids, ticks);
                }
                history.colliding = false;
            }
            Verdict::Possible | Verdict::None => {
                if touched && !history.colliding {
                    self.push(history.ids, None, Some(ticks));
                    history.colliding = true;
                    (history.verdict, history.tick) = (Verdict::Colliding, tick);
                    history.on_way = true;
                }
                history.open = true;
                self.histories[slot.index()] = history;
                return;
            }
        }
        history.verdict = finding.verdict;
        history.tick = tick;
        (history.open, history.on_way) = (false, false);
        self.histories[slot.index()] = history;
    }

    fn push(&mut self, ids: Ids, end: Option<(Ticks, EndCause)>, begin: Option<Ticks>) {
        self.seq += 1;
        self.waiting.push(PairEvent {
            ids,
            seq: self.seq,
            end,
            begin,
            pass: None,
        });
    }

    fn push_pass(&mut self, ids: Ids, ticks: Ticks) {
        self.push(ids, None, None);
        if let Some(event) = self.waiting.last_mut() {
            event.pass = Some(ticks);
        }
    }

    /// One entry per pair, by ids: a begin that was never sent and the following end cancel.
    pub(super) fn merge(&mut self) {
        self.waiting
            .sort_unstable_by_key(|event| (event.ids, event.seq));
        let cancelled = &mut self.cancelled;
        self.waiting.dedup_by(|next, kept| {
            let same = next.ids == kept.ids;
            if same {
                *cancelled += kept.follow(next);
            }
            same
        });
        self.waiting.retain(|event| !event.is_over());
    }
}

fn earlier(one: Option<u64>, other: Option<u64>) -> Option<u64> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}

#[cfg(test)]
mod tests;
