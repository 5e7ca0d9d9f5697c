//! Spending the budget: verdicts first, oldest first, in slices; and one turn of work on a pair, for any goal.

use crate::ids::PairSlot;
use crate::math::{Interval, relative};
use crate::time::Meter;
use crate::wire::Verdict;
use crate::world::{Body, World};

use super::contacts::{ContactSet, TREMBLE_TICKS};
use super::cursor::Turn;
use super::memo::Witness;
use super::mesh::{Goal, has_front};
use super::order::Order;
use super::pass::Pass;
use super::query::{
    add_manifold, is_simple, retest, shape_gap_along, shape_pose, sound, witness_of,
};
use super::{NONE, Narrow, Wanted};

/// The longest that a query is expected to take, nanoseconds: anything longer was held up by something else.
const QUERY_NS_MAX: u64 = 100_000;

/// How far a pair may move between two queries for its shell to save time, as a share of the smaller body's radius.
const FOLLOWED: f64 = 0.1;

/// The result of a query, and the tick and poses that it holds for.
pub(super) struct Answer {
    pub(super) gap: Interval,
    pub(super) finished: bool,
    pub(super) witness: Option<Witness>,
}

impl Narrow {
    /// Gives undecided pairs their verdicts, in slices. Returns whether none is left.
    ///
    /// Nothing starves: `order` states how long a pair waits for a turn at most.
    pub(super) fn spend_on_verdicts(
        &mut self,
        world: &World,
        wanted: Wanted,
        meter: &mut Meter<'_>,
    ) -> bool {
        let work = std::mem::take(&mut self.undecided);
        // With no limit the contacts are computed along with the verdict; otherwise every verdict comes first.
        let at_once = wanted.order == Order::AsFound && wanted.contacts;
        let goal = if at_once {
            Goal::Contacts
        } else {
            Goal::Verdict
        };
        let pass = Pass {
            world,
            order: wanted.order,
            idle: |narrow: &Self, slot: PairSlot| {
                narrow.hot[slot.index()].verdict != Verdict::Possible
            },
        };
        self.undecided = self.spend_on(work, &pass, meter, |narrow, slot, meter| {
            let done = (pass.idle)(narrow, slot) || narrow.work(slot, goal, world, meter);
            narrow.memos[slot.index()].queued = !done;
            if done && narrow.is_lost(slot) {
                narrow.lost.push(slot);
            }
            done
        });
        self.undecided.is_empty()
    }

    /// One turn of work on a pair. Returns whether nothing is left to do for `goal`. If a query would take longer than
    /// the time left, closes the meter.
    pub(super) fn work(
        &mut self,
        slot: PairSlot,
        goal: Goal,
        world: &World,
        meter: &mut Meter<'_>,
    ) -> bool {
        let hot = self.hot[slot.index()];
        let (Some(a), Some(b)) = (world.body(hot.a), world.body(hot.b)) else {
            return true;
        };
        let simple = match (&*a.shapes, &*b.shapes) {
            ([one], [other]) => is_simple(&one.shape, &other.shape),
            _ => false,
        };
        let query_ns = &mut self.memos[slot.index()].query_ns;
        if simple && !meter.begins(u64::from(*query_ns)) {
            // A query that was slow once, for whatever reason, must not be put off for ever.
            *query_ns -= *query_ns / 8;
            return false;
        }
        self.urgencies[slot.index()].note_turn(self.tick);
        let turns = &mut self.memos[slot.index()].turns;
        *turns = turns.wrapping_add(1);
        let mut open = false;
        if simple {
            self.query_once(slot, (a, b), goal);
            let took_ns = meter.charge_dear(1).min(QUERY_NS_MAX);
            self.memos[slot.index()].query_ns = u32::try_from(took_ns).unwrap_or(u32::MAX);
        } else if let ([one], [other]) = (&*a.shapes, &*b.shapes)
            && has_front(&one.shape, &other.shape)
        {
            open = self.turn_front(slot, (a, b), goal, meter);
        } else if goal == Goal::Verdict
            && self.witness_due(slot)
            && self.retest_witness(slot, (a, b), meter)
        {
            open = true;
        } else if let ([one], [other]) = (&*a.shapes, &*b.shapes) {
            let turn = self.turn_cursor(slot, (a, b), (one, other), goal, meter);
            open = turn == Turn::Open;
        } else {
            open = self.turn_compound(slot, (a, b), goal, meter);
        }
        self.widen_pair(slot, world);
        let memo = &self.memos[slot.index()];
        let verdict = memo.verdict();
        // Motion may have overtaken a resumed query: then another one starts at this tick's poses.
        let current = !open && memo.tested == self.tick;
        self.settle(slot, verdict);
        self.owe_report(slot, goal != Goal::Verdict && current);
        match goal {
            Goal::Verdict => verdict != Verdict::Possible || current,
            Goal::Gap | Goal::Contacts => current,
        }
    }

    /// A verdict from a query that was run for the verdict alone, or is not finished, still owes bounds and contacts to
    /// listeners.
    fn owe_report(&mut self, slot: PairSlot, whole: bool) {
        let reported = matches!(
            self.hot[slot.index()].verdict,
            Verdict::Near | Verdict::Colliding
        );
        let memo = &mut self.memos[slot.index()];
        if !whole && reported && !memo.refreshing {
            memo.refreshing = true;
            self.refresh.push(slot);
        }
    }

    /// Runs the single query that decides a pair of single shapes without meshes.
    fn query_once(&mut self, slot: PairSlot, (a, b): (&Body, &Body), goal: Goal) {
        let rel = relative(&a.pose, &b.pose);
        let pos12 = shape_pose(&a.shapes[0], &b.shapes[0], &rel);
        let memo = &mut self.memos[slot.index()];
        let shell = if memo.motion_m <= FOLLOWED * a.radius.min(b.radius) {
            Some(self.shelves.shell(memo.shell))
        } else {
            self.shelves.give_shell(&mut memo.shell);
            None
        };
        let (one, other) = (&a.shapes[0].shape, &b.shapes[0].shape);
        let closest = shape_gap_along(one, other, &pos12, &mut memo.warm, shell);
        self.shelves.keep_shell(&mut memo.shell);
        let Some(closest) = closest else {
            return;
        };
        self.counters.queries += 1;
        let witness = witness_of(&a.shapes[0], &b.shapes[0], &pos12, &closest, (0, 0));
        memo.note_asked((a, b), &rel, self.tick);
        memo.tight = closest.finished;
        let gap = sound(closest.gap, &a.shapes[0], &b.shapes[0], &rel);
        let answer = Answer {
            gap,
            finished: closest.finished,
            witness: Some(witness),
        };
        self.store(slot, &answer);
        if goal == Goal::Contacts && closest.gap.min <= 0.0 {
            self.counters.manifolds += 1;
            self.found.clear();
            let found = &mut self.found;
            add_manifold((a, b), (0, 0), &pos12, (&closest, gap), found);
            self.keep_contacts(slot, a.radius.min(b.radius), self.tick);
        }
    }

    /// Whether last tick's contact is to be tested before anything else.
    pub(super) fn witness_due(&self, slot: PairSlot) -> bool {
        let memo = &self.memos[slot.index()];
        memo.witness.is_some_and(|w| w.best_m <= 0.0) && memo.retested != self.tick && !memo.rest
    }

    /// Tests whether the shapes (and triangles) that touched last still do: one unit, and while contact lasts the
    /// verdict costs no more. Returns whether that was the whole turn. If it fails, a pair that has waited goes on in
    /// the same turn, or pairs that part would spend their units on witnesses alone, tick after tick.
    fn retest_witness(
        &mut self,
        slot: PairSlot,
        (a, b): (&Body, &Body),
        meter: &mut Meter<'_>,
    ) -> bool {
        let memo = &mut self.memos[slot.index()];
        memo.retested = self.tick;
        let has_waited = memo.undecided_since != 0 && memo.undecided_since < self.tick;
        self.counters.queries += 1;
        meter.charge_dear(1);
        self.still_touches(slot, (a, b)) || !has_waited
    }

    /// Whether the witness is certified to touch at this tick's poses; then it becomes the pair's new certificate.
    fn still_touches(&mut self, slot: PairSlot, (a, b): (&Body, &Body)) -> bool {
        let memo = &mut self.memos[slot.index()];
        let Some(last) = memo.witness else {
            return false;
        };
        let places = (last.shape_a, last.shape_b);
        let (Some(one), Some(other)) = (
            a.shapes.get(places.0 as usize),
            b.shapes.get(places.1 as usize),
        ) else {
            return false;
        };
        let rel = relative(&a.pose, &b.pose);
        let pos12 = shape_pose(one, other, &rel);
        let triangles = (last.triangle_a, last.triangle_b);
        let closest = retest(&one.shape, &other.shape, &pos12, triangles);
        let Some(closest) = closest.filter(|closest| closest.gap.max <= 0.0) else {
            return false;
        };
        // A certified touch at these very poses; the lower end is the old one less the motion since.
        let high = sound(closest.gap, one, other, &rel).max;
        if high + memo.reach_m > 0.0 {
            // It no longer touches; what a walk has found so far is worth more.
            return false;
        }
        memo.gap = Interval {
            min: memo.here().min.min(high),
            max: high,
        };
        memo.note_asked((a, b), &rel, self.tick);
        memo.finished = false;
        memo.tight = false;
        memo.witness = Some(Witness {
            triangle_a: last.triangle_a,
            triangle_b: last.triangle_b,
            ..witness_of(one, other, &pos12, &closest, places)
        });
        true
    }

    pub(super) fn store(&mut self, slot: PairSlot, answer: &Answer) {
        let memo = &mut self.memos[slot.index()];
        memo.gap = answer.gap;
        memo.finished = answer.finished;
        if answer.witness.is_some() {
            memo.witness = answer.witness;
        }
    }

    /// Passes `found` to the pair's contact set; a contact that continues keeps its id.
    ///
    /// * `tick` - tick of the poses at which they were found.
    pub(super) fn keep_contacts(&mut self, slot: PairSlot, radius: f64, tick: u64) {
        let most = self.contacts_per_pair;
        let memo = &mut self.memos[slot.index()];
        if memo.contacts == NONE {
            memo.contacts = self.contact_sets.take(|| ContactSet::with_room(most));
            if let Some(set) = self.contact_sets.get_mut(memo.contacts) {
                set.clear();
            }
        }
        let long_over = memo.contacts_are_over() && self.tick - memo.parted >= TREMBLE_TICKS;
        memo.contacts_tick = tick;
        if let Some(set) = self.contact_sets.get_mut(memo.contacts) {
            if long_over {
                set.clear();
            }
            set.replace(&mut self.found, most, radius, &mut self.before);
        }
    }
}
