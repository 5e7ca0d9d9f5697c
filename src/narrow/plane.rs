//! Turns of pairs of a mesh and a half-space: walks that can stop, each at the pose that it was begun at.
//!
//! In: a pair, what it is asked for. Out: a certificate of the walk's pose, contacts of it. A pair has two walks: one
//! for its verdict, which says nothing unless it is of a pose near this one, and one for whoever listens, which may
//! take several ticks. Refused: one walk for both, where a verdict waits until the contacts of a pose of long ago are
//! found (or contacts are never found, where it throws them away each time).

use crate::ids::PairSlot;
use crate::math::{Interval, relative};
use crate::time::Meter;
use crate::wire::Verdict;
use crate::world::{Body, PlacedShape};

use super::bent::Bent;
use super::carry::slice_units;
use super::change::changed_since;
use super::cursor::{Cursor, Room, Turn};
use super::memo::Memo;
use super::mesh::Goal;
use super::spend::Answer;
use super::{NONE, Narrow};

impl Narrow {
    /// One turn of a mesh and a half-space: resumed where it stopped, or started at this tick's poses.
    pub(super) fn turn_cursor(
        &mut self,
        slot: PairSlot,
        (a, b): (&Body, &Body),
        shapes: (&PlacedShape, &PlacedShape),
        asked: Goal,
        meter: &mut Meter<'_>,
    ) -> Turn {
        let memo = &mut self.memos[slot.index()];
        let goal = memo.goal(asked);
        let for_verdict = asked == Goal::Verdict;
        let place = if for_verdict {
            &mut memo.cursor
        } else {
            &mut memo.report_cursor
        };
        let fresh = *place == NONE;
        let Some(cursor) = self.shelves.cursors.get_or_take(place) else {
            return Turn::Finished;
        };
        let now = (relative(&a.pose, &b.pose), Bent::of_bodies(a, b));
        let outdated = if for_verdict {
            let here = (cursor.rel, cursor.bent) == now;
            // What is asked for less must not wait for more, of another pose; nor for what is known better by now.
            cursor.goal < goal || cursor.goal > goal && !here || cursor.tick < memo.tested
        } else {
            // Contacts of a collision that has ended since are those of none.
            cursor.goal == Goal::Verdict || cursor.tick < memo.parted
        };
        if fresh || outdated {
            let credit_m = a.motion.credit_m() + b.motion.credit_m();
            cursor.start((0, 0), now, credit_m, self.tick, goal);
        }
        let mut room = Room {
            search: self.search,
            fronts: &mut self.shelves.store,
            contacts: &mut self.shelves.contacts,
        };
        let slice_units = slice_units(memo.undecided_since, self.tick);
        let (asked, counters) = ((memo.report_m, slice_units), &mut self.counters);
        let turn = cursor.turn(&mut room, shapes, asked, meter, counters);
        let high = cursor.known(shapes).max;
        let certified = high + memo.reach_m <= 0.0 && memo.now.max > 0.0;
        let overtaken = memo.tested > cursor.tick;
        if turn == Turn::Open && (overtaken || !certified) {
            return Turn::Open;
        }
        let contacts = cursor.goal == Goal::Contacts && turn == Turn::Finished;
        if contacts {
            self.found.clear();
            (self.found).extend_from_slice(cursor.found(&self.shelves.contacts));
        }
        let found_at = cursor.tick;
        let answer = if overtaken {
            memo.meet_older(cursor, (a, b));
            None
        } else {
            Some(memo.take_walk(cursor, turn, high, (a, b)))
        };
        let contacts_owed =
            self.contacts_wanted && self.hot[slot.index()].verdict == Verdict::Colliding;
        if turn == Turn::Finished && overtaken && cursor.goal == Goal::Gap && contacts_owed {
            // Where a tick does not reach for a bound, contacts have their turn after each: they tell a bound, too.
            let credit_m = a.motion.credit_m() + b.motion.credit_m();
            cursor.start((0, 0), now, credit_m, self.tick, Goal::Contacts);
        } else if turn == Turn::Finished {
            self.shelves.give_cursor(if for_verdict {
                &mut memo.cursor
            } else {
                &mut memo.report_cursor
            });
            if !for_verdict && !overtaken {
                // It has told all that one for the verdict could have.
                self.shelves.give_cursor(&mut memo.cursor);
            }
        }
        if let Some(answer) = &answer {
            self.store(slot, answer);
        }
        if contacts {
            self.keep_contacts(slot, a.radius.min(b.radius), found_at);
        }
        // Where it was overtaken, another one starts at this tick's poses.
        if overtaken { Turn::Open } else { turn }
    }
}

impl Memo {
    /// Takes over the certificate of a walk, finished or not, and what it proves of the gap at its pose.
    ///
    /// * `high` - the upper end that it proves.
    fn take_walk(
        &mut self,
        cursor: &Cursor,
        turn: Turn,
        high: f64,
        (a, b): (&Body, &Body),
    ) -> Answer {
        // What was known before holds at this tick's poses; carried back to the cursor's, it loses the motion between.
        let then = (&cursor.rel, cursor.bent);
        let since = changed_since(a, b, then, &relative(&a.pose, &b.pose));
        let known_low = (self.here().min - since).next_down();
        let whole =
            turn == Turn::Finished && !(cursor.goal == Goal::Verdict && cursor.gap.max <= 0.0);
        let low = if whole { cursor.gap.min } else { known_low };
        self.rel = cursor.rel;
        self.credit_m = cursor.credit_m;
        self.bent = cursor.bent;
        self.tested = cursor.tick;
        self.tight = whole && cursor.goal != Goal::Verdict;
        Answer {
            gap: Interval {
                min: low.min(high),
                max: high,
            },
            finished: whole && cursor.certain,
            witness: cursor.witness,
        }
    }

    /// Narrows the certificate by what a finished walk at an older pose proves: at the certificate's own, by the motion
    /// between the two.
    fn meet_older(&mut self, cursor: &Cursor, (a, b): (&Body, &Body)) {
        // From the vertices of then to those of now, to the other pose with these, and back to those of the test.
        let bent_m = Bent::of_bodies(a, b).since_m(&self.bent);
        let moved_m = changed_since(a, b, (&cursor.rel, cursor.bent), &self.rel);
        let by_m = (moved_m + bent_m).next_up();
        if by_m.is_finite() {
            self.gap = self.gap.meet(cursor.gap.widened(by_m));
        }
    }
}
