//! The motion pass: which certificates still hold. Its cost is proportional to what moved.

use crate::ids::PairSlot;
use crate::math::{Interval, ROUND, relative};
use crate::pairs::PairSet;
use crate::wire::{BodyStatus, Verdict};
use crate::world::World;

use super::change::changed_since;
use super::memo::{Memo, closing};
use super::mesh::Goal;
use super::{NONE, Narrow};

/// With this many slots per pair, the straight walk skips empty slots by the pair set's list.
const SPARSE: usize = 4;

impl Narrow {
    /// Checks the pairs of every body that moved or whose status changed against their certificates.
    ///
    /// Undecided pairs of earlier ticks are on the work list already; this adds newly undecided ones.
    pub fn widen(&mut self, world: &World, pairs: &mut PairSet) {
        let changes = world.changes();
        let changed = changes.moved.len() + changes.restated.len();
        // Above this share a straight walk over the 24-byte records beats chasing each body's list.
        let many = changed * 4 > world.slots_len();
        let few = if many { 0 } else { changed };
        pairs.list(few + changes.requery.len() + world.travelled().len());
        self.enlist_sweeps(world, pairs);
        for &body in &changes.requery {
            for slot in pairs.pairs_of(body) {
                self.follow_rules(slot, world);
            }
        }
        // After a crowd has dispersed there are far more slots than pairs.
        let sparse = pairs.slots_len() / SPARSE > pairs.len();
        if many && !sparse {
            let slots = self.hot.len().min(pairs.slots_len());
            self.counters.walked += slots as u64;
            for slot in 0..slots {
                self.ask_ahead_of_walk(slot, world);
                if self.hot[slot].live {
                    #[allow(
                        clippy::cast_possible_truncation,
                        reason = "slots are u32 by limits::PAIRS"
                    )]
                    self.visit(PairSlot(slot as u32), world);
                }
            }
            return;
        }
        let mut slots = std::mem::take(&mut self.level);
        slots.clear();
        if many {
            let is_live = |slot: &PairSlot| self.hot.get(slot.index()).is_some_and(|hot| hot.live);
            slots.extend(pairs.used_slots().filter(is_live));
        } else {
            let bodies = changes.moved.iter().chain(&changes.restated);
            for &body in bodies.chain(&changes.requery) {
                slots.extend(pairs.pairs_of(body));
            }
        }
        self.counters.walked += slots.len() as u64;
        for (at, &slot) in slots.iter().enumerate() {
            self.ask_ahead_of_visits(&slots, at, world);
            self.visit(slot, world);
        }
        self.level = slots;
    }

    /// Applies the present rules to a pair whose bodies' rules changed: its certificate was made for the old ones.
    fn follow_rules(&mut self, slot: PairSlot, world: &World) {
        let hot = &mut self.hot[slot.index()];
        hot.expiry_m = f64::NEG_INFINITY;
        self.memos[slot.index()].report_m = world.report_within(hot.a, hot.b);
        self.visit(slot, world);
    }

    /// Advances this tick's stamp. After 2^32 ticks stamps start over, with no pair marked as visited.
    pub(super) fn next_stamp(&mut self) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.hot.iter_mut().for_each(|hot| hot.visited = 0);
            self.stamp = 1;
        }
    }

    /// Sets the stamp as after very many ticks.
    #[cfg(test)]
    pub(crate) fn set_stamp(&mut self, stamp: u32) {
        self.stamp = stamp;
    }

    /// Visits a pair once per tick: one comparison while its certificate holds.
    fn visit(&mut self, slot: PairSlot, world: &World) {
        let hot = &mut self.hot[slot.index()];
        if hot.visited == self.stamp {
            return;
        }
        hot.visited = self.stamp;
        self.counters.visited += 1;
        let spent_m = self.spent_m[hot.a.index()] + self.spent_m[hot.b.index()];
        if spent_m.next_up() < hot.expiry_m {
            return;
        }
        self.look(slot, world);
    }

    /// Widens a pair's interval to this tick's poses, and puts it on the work list its verdict calls for.
    pub(super) fn look(&mut self, slot: PairSlot, world: &World) {
        self.widen_pair(slot, world);
        let memo = &mut self.memos[slot.index()];
        let verdict = memo.verdict();
        // An unbounded reach cannot be reduced by work, and a finished test at exactly these poses cannot say more. But
        // if it was for a verdict alone, and bodies may be elsewhere, their gap is still to be computed.
        let reachable = memo.widened_m() < f64::INFINITY;
        let has_said_it = memo.goal(Goal::Verdict) == Goal::Verdict || memo.tight;
        let is_told = memo.finished && memo.rest && has_said_it;
        if verdict == Verdict::Possible && reachable && !is_told && !memo.queued {
            memo.queued = true;
            self.undecided.push(slot);
            self.urgencies[slot.index()].note_turn(self.tick);
        }
        let reported = matches!(verdict, Verdict::Near | Verdict::Colliding);
        if reported && reachable && !(memo.tight && memo.rest) && !memo.refreshing {
            memo.refreshing = true;
            self.refresh.push(slot);
            self.urgencies[slot.index()].note_turn(self.tick);
        }
        self.settle(slot, verdict);
    }

    /// Widens the interval of a pair that the motion pass skipped to this tick's poses; its verdict stays.
    pub fn bring_up(&mut self, slot: PairSlot, world: &World) {
        if self.finding(slot).is_some() {
            self.widen_pair(slot, world);
        }
    }

    /// Recomputes `now` from the certificate, the motion since, and the bodies' reach.
    pub(super) fn widen_pair(&mut self, slot: PairSlot, world: &World) {
        let hot = &mut self.hot[slot.index()];
        let memo = &mut self.memos[slot.index()];
        self.stirred.set(slot);
        let (Some(a), Some(b)) = (world.body(hot.a), world.body(hot.b)) else {
            return;
        };
        let reach_m = a.reach_m + b.reach_m;
        let rel = relative(&a.pose, &b.pose);
        let by_path = if (a.unbounded && a.moves) || (b.unbounded && b.moves) {
            f64::INFINITY
        } else {
            let spent = self.spent_m[hot.a.index()] + self.spent_m[hot.b.index()];
            // Rounded up by what the sums of long paths may have lost, not by an ulp of their small difference.
            (spent - memo.credit_m) + 4.0 * ROUND * (spent.abs() + memo.credit_m.abs())
        };
        let by_pose = changed_since(a, b, (&memo.rel, memo.bent), &rel);
        let motion_m = by_path.min(by_pose).max(0.0);
        memo.rest = motion_m == 0.0;
        (memo.motion_m, memo.reach_m) = (motion_m, reach_m);
        memo.now = widened(memo.gap, memo.widened_m());
        // The pair may need work: update what its place in the order of work depends on.
        if memo.now.min <= memo.report_m {
            let priority = a.priority.max(b.priority);
            let closing_m = closing(a, b, memo, &rel);
            self.urgencies[slot.index()].weigh(priority, closing_m, a.radius.min(b.radius));
        }
        let known = |status| matches!(status, BodyStatus::Known | BodyStatus::Held);
        let still = reach_m == 0.0 && known(a.status) && known(b.status) && by_path.is_finite();
        // The comparison that saves the next visits: gap_min - (spent - credit) > report. Only for a pair that is apart
        // by it: without a visit, nothing would report that another is apart again.
        let is_apart = memo.now.min > memo.report_m.max(0.0);
        hot.expiry_m = if still && is_apart && memo.cursor == NONE {
            let sum = memo.gap.min + memo.credit_m - memo.report_m.max(0.0);
            sum - 4.0 * ROUND * (memo.gap.min.abs() + memo.credit_m.abs() + memo.report_m.abs())
        } else {
            f64::NEG_INFINITY
        };
    }
}

impl Memo {
    /// How much wider `now` is than `gap`, metres; 0: it is `gap`.
    pub(super) fn widened_m(&self) -> f64 {
        self.motion_m + self.reach_m
    }

    /// The interval at this tick's poses, without the reach: what a test at these poses may start from. `now` would add
    /// the reach again with each test.
    pub(super) fn here(&self) -> Interval {
        widened(self.gap, self.motion_m)
    }

    /// The goal of a pair that needs a verdict: if the bodies may be elsewhere, a verdict at the poses decides nothing,
    /// but their gap may.
    pub(super) fn goal(&self, goal: Goal) -> Goal {
        match goal {
            Goal::Verdict if self.reach_m > 0.0 && !self.is_within_reach() => Goal::Gap,
            goal => goal,
        }
    }

    /// Whether no narrower interval can decide the pair: both ends are nearer to 0 than the bodies' reach.
    fn is_within_reach(&self) -> bool {
        let here = self.here();
        here.min > -self.reach_m && here.max <= self.reach_m
    }
}

/// An interval after bodies may have moved by `by_m`, metres.
pub(super) fn widened(gap: Interval, by_m: f64) -> Interval {
    match by_m {
        0.0 => gap,
        m if m.is_finite() => gap.widened(m),
        _ => Interval::UNKNOWN,
    }
}
