//! Two bodies of which at least one has several shapes: a front over pairs of their shapes, carried from pose to pose
//! as the front of two meshes is carried over triangles.
//!
//! In: two bodies, and successive poses of B seen from A. Out: a sound interval of their gap at the current pose, a
//! witness, contacts. Stops after any unit, and continues at the same pose or at another.
//!
//! Every pair of shapes is covered by exactly one entry at any time (see `cover`). A leaf is a pair of shapes: one
//! exact query if both are convex; if one is a mesh, a front of its own, which is carried too (`leaf`). So a robot of a
//! hundred parts tests only the few pairs of parts that are near one another, and of these those that have moved.
//!
//! The search orders are those of two meshes: depth first, deepest overlap first, for a verdict; best first for bounds;
//! depth first to the end for the contact set. Half-spaces fit into no box: each is a root of its own (`side`). Two
//! half-spaces have no gap (law 3.2): their pairs are left out (`roots`), and bodies of nothing else are no pair
//! (`world/filters`).
//!
//! Refused: one tree of all triangles of all shapes of a body (shapes are shared between bodies, and a solid's inside
//! and a convex shape's depth belong to the shape); testing all pairs of shapes (65,536 of each are allowed).

mod leaf;
mod side;
mod turn;
mod walk;

#[cfg(test)]
mod tests;

pub(super) use leaf::Tools;
pub(super) use walk::{PairWalk, Waiting};

use crate::math::{Interval, Pose};
use crate::shape::{BoxId, Held};
use crate::time::Meter;
use crate::world::Body;

use super::arena::Run;
use super::around::radii_m;
use super::bent::Bent;
use super::change::relative_motion;
use super::cover::{Cover, Group, Open, Wear};
use super::holdings::Holdings;
use super::memo::Witness;
use super::mesh::{CarriedFront, Goal, Placed, Search};
use super::shelves::Shelves;

use leaf::Inner;
use side::{Side, children, gaps, placed, roots};

/// The front of one pair of bodies; used with the same [`Tools`] from its start to its release.
#[derive(Debug, Default)]
pub(super) struct CompoundFront {
    search: Search,
    /// Started, and not released since.
    started: bool,
    at: Placed,
    cover: Cover,
    known: Known,
    /// Contacts found at this pose.
    found: Run,
    /// Memory of the pairs of shapes of which one is a mesh, by their places.
    inner: Vec<Inner>,
    /// Least possible gap of the two, metres.
    floor_m: f64,
    /// The deformation of the two at the last move.
    bent: Bent,
    /// Settled: a goal was reached.
    wear: Wear,
}

/// What is known at the current pose.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// The strongest goal worked on.
    goal: Goal,
    /// Least lower end of the shape pairs queried for that goal, and least upper end of all, metres.
    low: f64,
    high: f64,
    /// 0 inside the interval of any queried pair of shapes means that it touches.
    certain: bool,
    /// The best witness of the shape pairs queried for that goal.
    witness: Option<Witness>,
}

impl Known {
    /// Takes the witness of a pair of shapes if it is better. Not by the upper end of the interval: a search that is
    /// cut off has that before it has a witness.
    fn take_witness(&mut self, told: Option<Witness>) {
        let best = [told, self.witness].into_iter().flatten();
        self.witness = best.min_by(|x, y| x.best_m.total_cmp(&y.best_m));
    }
}

impl Default for Known {
    fn default() -> Self {
        Self {
            goal: Goal::Verdict,
            low: f64::INFINITY,
            high: f64::INFINITY,
            certain: true,
            witness: None,
        }
    }
}

/// What one turn is for.
#[derive(Clone, Copy)]
struct Asked {
    goal: Goal,
    /// Pairs farther apart than this do not matter for a verdict, metres.
    report_m: f64,
    /// Reading of the meter at which the turn ends.
    end: u64,
}

impl CompoundFront {
    /// Moves the pair to a pose of B seen from A and to the present vertices; proofs are carried over as far as they
    /// hold. The first call starts the front there.
    pub(super) fn move_to(&mut self, tools: &mut Tools<'_>, (a, b): (&Body, &Body), rel: &Pose) {
        let sides = (Side::of(a), Side::of(b));
        let bent = Bent::of_bodies(a, b);
        let at = placed(&sides.0, &sides.1, rel);
        if !self.started {
            (self.started, self.at, self.bent) = (true, at, bent);
            self.search = tools.search;
            self.start_over(tools, (&sides.0, &sides.1));
            return;
        }
        let moved = self.at.pos12 != *rel || bent != self.bent;
        self.at = at;
        self.take_floor([a.radius, b.radius]);
        if !moved {
            return;
        }
        let drift = &mut self.cover.drift;
        drift.follow(rel, |from, to| relative_motion(a, b, from, to));
        let bent_m = bent.since_m(&self.bent);
        if bent_m > 0.0 {
            drift.add(bent_m);
            self.bent = bent;
        }
        let entries = &tools.shelves.store.entries;
        let worn = (self.wear).is_worn_out(&self.cover, entries, radii_m(a, b));
        if worn || self.search != Search::Carried {
            self.start_over(tools, (&sides.0, &sides.1));
            return;
        }
        self.known = Known::default();
        self.found.clear();
        self.cover.arrive(&mut tools.shelves.store.entries);
    }

    /// Works at this pose until the goal is reached (true), `slice_units` are spent, or the meter closes.
    ///
    /// * `report_m` - pairs farther apart do not matter for a verdict, metres.
    ///
    /// Units: a box against a pack, a query of two convex shapes, and those of mesh pairs.
    pub(super) fn advance(
        &mut self,
        tools: &mut Tools<'_>,
        (a, b): (&Body, &Body),
        (goal, report_m): (Goal, f64),
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let sides = (&Side::of(a), &Side::of(b));
        if goal > self.known.goal {
            // Shape pairs that touch, and the nearest ones, were queried for less.
            let high = self.known.high;
            self.known = Known {
                goal,
                high,
                ..Known::default()
            };
            self.found.clear();
            let entries = &mut tools.shelves.store.entries;
            self.cover.anchor_here(entries, &self.at.pos12);
            self.cover.ask_touching_again(entries);
        }
        let asked = Asked {
            goal,
            report_m: report_m.max(0.0),
            end: meter.spent().saturating_add(slice_units),
        };
        loop {
            if self.reached(&asked) {
                self.wear.note_settled(&self.cover);
                return true;
            }
            if meter.spent() >= asked.end || !meter.open() {
                return false;
            }
            self.step(tools, sides, &asked, meter);
        }
    }

    /// Interval of the gap at this pose, metres: sound at any interruption.
    pub(super) fn interval(&self) -> Interval {
        let Known { low, high, .. } = self.known;
        let low = if self.cover.open.is_empty() {
            low.min(self.cover.low_m()).max(self.floor_m)
        } else {
            self.floor_m
        };
        Interval::new(low.min(high), high)
    }

    /// Whether 0 in the interval of a reached goal means touching (law 3.4).
    pub(super) fn is_certain(&self) -> bool {
        self.known.certain && self.cover.holds_lumped()
    }

    /// As [`CarriedFront::is_lost`], of any pair of shapes.
    pub(super) fn is_lost(&self, shelves: &Shelves) -> bool {
        let mut fronts = self
            .inner
            .iter()
            .filter_map(|inner| shelves.fronts.get(inner.front));
        self.started && (self.cover.is_lost() || fronts.any(CarriedFront::is_lost))
    }

    /// The witness of the nearest or deepest pair of shapes queried at this pose.
    pub(super) fn witness(&self) -> Option<Witness> {
        self.known.witness
    }

    /// The front of a pair of shapes by their places, if there is one.
    pub(super) fn front_of<'a>(
        &self,
        shelves: &'a Shelves,
        places: (u32, u32),
    ) -> Option<&'a CarriedFront> {
        let at = self.place_of(places).ok()?;
        let front = shelves.fronts.get(self.inner[at].front)?;
        front.is_started().then_some(front)
    }

    /// Forgets everything and releases its memory.
    pub(super) fn release(&mut self, shelves: &mut Shelves) {
        self.cover.release(&mut shelves.store.entries);
        shelves.contacts.release(&mut self.found);
        for mut inner in self.inner.drain(..) {
            inner.release(shelves);
        }
        self.started = false;
    }

    /// Lists what it holds in addition to the fronts and queries of its pairs of shapes.
    pub(super) fn tell<'a>(&'a self, held: &mut Holdings<'a>) {
        held.covers.push(&self.cover);
        held.contacts.push(&self.found);
    }

    /// Places of the front and the query of each of its pairs of shapes, or `NONE`.
    pub(super) fn places(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.inner.iter().map(Inner::held)
    }

    /// Starts over from the roots, at the current pose.
    fn start_over(&mut self, tools: &mut Tools<'_>, (a, b): (&Side<'_>, &Side<'_>)) {
        let entries = &mut tools.shelves.store.entries;
        (self.cover).start(entries, (&self.at.pos12, self.search), roots(a, b));
        self.known = Known::default();
        self.found.clear();
        self.wear = Wear::default();
        self.take_floor([a.body.radius, b.body.radius]);
        // Pairs of shapes that were not queried since the last fresh start are forgotten.
        self.inner.retain_mut(|inner| {
            let asked = std::mem::take(&mut inner.asked);
            if !asked {
                inner.release(tools.shelves);
            }
            asked
        });
    }

    /// Convex pieces separate when moved by the sum of both radii, and a point within a solid is no deeper than the
    /// solid's size. Radii change when a body deforms.
    fn take_floor(&mut self, radii_m: [f64; 2]) {
        let size_m: f64 = radii_m.iter().sum();
        self.floor_m = -size_m * (1.0 + 8.0 * f64::EPSILON) - self.at.slop;
    }

    fn reached(&self, asked: &Asked) -> bool {
        if asked.goal == Goal::Verdict && self.known.high <= 0.0 {
            return true;
        }
        if !self.cover.open.is_empty() || self.cover.has_expired() {
            return false;
        }
        let nearest_m = self.cover.nearest_m();
        nearest_m > self.margin_m(asked.goal, asked)
            || nearest_m + self.cover.fuzz_m() + self.at.slop >= self.known.low
    }

    /// Pairs farther apart than this do not matter for a goal, metres.
    fn margin_m(&self, goal: Goal, asked: &Asked) -> f64 {
        match goal {
            Goal::Verdict => asked.report_m,
            Goal::Gap | Goal::Contacts => self.known.high.max(0.0),
        }
    }

    /// One step: an open pair of boxes, one no longer proved apart, or the nearest of all.
    fn step(
        &mut self,
        tools: &mut Tools<'_>,
        sides: (&Side<'_>, &Side<'_>),
        asked: &Asked,
        meter: &mut Meter<'_>,
    ) {
        self.wear.note_step();
        let entries = &mut tools.shelves.store.entries;
        if let Some(Open { a, b, .. }) = self.cover.open.pop(&mut entries.open) {
            return self.look_below(tools, sides, (a, b), f64::NEG_INFINITY, asked, meter);
        }
        let expired = self.cover.has_expired();
        if !expired {
            // For a `near` verdict too, what is found must hold exactly.
            self.cover.anchor_here(entries, &self.at.pos12);
        }
        let Some(group) = self.cover.proved.pop(&mut entries.groups) else {
            // Not reached: with nothing left to open, the goal is reached.
            return meter.charge(1);
        };
        // The stored bound holds at this pose; a new test may be lower by rounding.
        let known_m = if expired {
            f64::NEG_INFINITY
        } else {
            self.cover.drift.left_m(group.expiry_m)
        };
        if group.leaf {
            let pair = group.pair(group.mask.trailing_zeros());
            return self.leaf(tools, sides, pair, known_m, asked, meter);
        }
        let gaps = gaps(&group, sides, &self.at).map(|gap| gap.max(known_m));
        meter.charge(1);
        if expired {
            return self.cover.take(entries, &group, gaps, known_m);
        }
        let (pair, known_m) = self.cover.part_nearest(entries, &group, &gaps);
        self.look_below(tools, sides, pair, known_m, asked, meter);
    }

    /// Replaces a pair of boxes by smaller ones, or queries two shapes.
    ///
    /// * `known_m` - a bound on their gap that holds at this pose.
    fn look_below(
        &mut self,
        tools: &mut Tools<'_>,
        sides: (&Side<'_>, &Side<'_>),
        (id_a, id_b): (BoxId, BoxId),
        known_m: f64,
        asked: &Asked,
        meter: &mut Meter<'_>,
    ) {
        let held = (sides.0.held(id_a), sides.1.held(id_b));
        if let (Held::Triangle(_), Held::Triangle(_)) = held {
            return self.leaf(tools, sides, (id_a, id_b), known_m, asked, meter);
        }
        let group: Group = children((sides.0, id_a), (sides.1, id_b));
        let gaps = gaps(&group, sides, &self.at);
        (self.cover).take(&mut tools.shelves.store.entries, &group, gaps, known_m);
        meter.charge(1);
    }
}
