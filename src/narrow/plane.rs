//! Turns of pairs of a mesh and a half-space: walks that can stop, each at the pose it began at.
//!
//! In: a pair and its goal. Out: a certificate at the walk's pose, its contacts. A pair has two walks: one for its
//! verdict, which proves nothing unless its pose is near the present one, and one for listeners, which may take several
//! ticks. Refused: one walk for both: a verdict would wait until the contacts at an old pose are found (or contacts
//! would never be found, if the verdict discards them each time).

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
    /// One turn of a mesh and a half-space: resumes the walk, or starts one at this tick's poses.
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
            // No wait for a larger goal at another pose, nor for a cursor older than the last test.
            cursor.goal < goal || cursor.goal > goal && !here || cursor.tick < memo.tested
        } else {
            // These contacts belong to a collision that has ended since.
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
            // If a bound does not fit into a tick, alternate with contacts: their walk gives a bound, too.
            let credit_m = a.motion.credit_m() + b.motion.credit_m();
            cursor.start((0, 0), now, credit_m, self.tick, Goal::Contacts);
        } else if turn == Turn::Finished {
            self.shelves.give_cursor(if for_verdict {
                &mut memo.cursor
            } else {
                &mut memo.report_cursor
            });
            if !for_verdict && !overtaken {
                // It has found all that the walk for the verdict could.
                self.shelves.give_cursor(&mut memo.cursor);
            }
        }
        if let Some(answer) = &answer {
            self.store(slot, answer);
        }
        if contacts {
            self.keep_contacts(slot, a.radius.min(b.radius), found_at);
        }
        // If motion overtook it, another one starts at this tick's poses.
        if overtaken { Turn::Open } else { turn }
    }
}

impl Memo {
    /// Takes over the certificate of a walk, finished or not, and what it proves of the gap at its pose.
    ///
    /// * `high` - the upper end of the gap that it proves.
    fn take_walk(
        &mut self,
        cursor: &Cursor,
        turn: Turn,
        high: f64,
        (a, b): (&Body, &Body),
    ) -> Answer {
        // The earlier bound holds at this tick's poses; at the cursor's pose it is less by the motion between.
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

    /// Narrows the certificate by what a finished walk at an older pose proves, carried to the certificate's pose: less
    /// the motion between the two.
    fn meet_older(&mut self, cursor: &Cursor, (a, b): (&Body, &Body)) {
        // From the vertices then to the present ones, with these to the other pose, and back to the test's vertices.
        let bent_m = Bent::of_bodies(a, b).since_m(&self.bent);
        let moved_m = changed_since(a, b, (&cursor.rel, cursor.bent), &self.rel);
        let by_m = (moved_m + bent_m).next_up();
        if by_m.is_finite() {
            self.gap = self.gap.meet(cursor.gap.widened(by_m));
        }
    }
}
