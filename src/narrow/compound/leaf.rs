//! A pair of shapes of two bodies: one exact query; if one is a mesh, a front of its own, or with a half-space a query
//! at one pose.

use crate::math::{Interval, Pose};
use crate::narrow::Counters;
use crate::narrow::arena::Arena;
use crate::narrow::bent::Bent;
use crate::narrow::carry::{found_on, glance, seen_at};
use crate::narrow::change::changed_since;
use crate::narrow::contacts::Contact;
use crate::narrow::cover::{Group, Open};
use crate::narrow::cursor::{Room, Turn};
use crate::narrow::exact::Warm;
use crate::narrow::memo::Witness;
use crate::narrow::mesh::{Goal, LeafContact, Search, has_front};
use crate::narrow::pool::NONE;
use crate::narrow::query::{
    add_manifold, is_simple, leaf_contact, lost_m, shape_gap, shape_pose, sound, sphere_bound,
    witness_of,
};
use crate::narrow::shelves::Shelves;
use crate::shape::BoxId;
use crate::time::Meter;
use crate::world::{Body, PlacedShape};

use super::side::Side;
use super::{Asked, CompoundFront};

/// Memory of two shapes that are farther apart than this times the smaller one's radius is released: they will not be
/// queried for long.
const FAR: f64 = 1.0;

/// The tools of fronts of bodies.
pub(in crate::narrow) struct Tools<'a> {
    pub(in crate::narrow) shelves: &'a mut Shelves,
    /// Contacts of the current query.
    pub(in crate::narrow) found: &'a mut Vec<Contact>,
    pub(in crate::narrow) counters: &'a mut Counters,
    /// How surfaces are searched.
    pub(in crate::narrow) search: Search,
    pub(in crate::narrow) tick: u64,
}

/// Memory of a pair of shapes of which one is a mesh.
#[derive(Debug)]
pub(super) struct Inner {
    /// Of the shapes in their bodies.
    pub(super) places: (u32, u32),
    /// Of two surfaces, or a surface and a convex shape.
    pub(super) front: u32,
    /// Of a mesh and a half-space: its query, while in progress.
    cursor: u32,
    /// It touched when last queried.
    touched: bool,
    /// It was queried since the last fresh start.
    pub(super) asked: bool,
}

impl Inner {
    fn new(places: (u32, u32)) -> Self {
        Self {
            places,
            front: NONE,
            cursor: NONE,
            touched: false,
            asked: true,
        }
    }

    /// Places of its front and its query, or `NONE`.
    pub(super) fn held(&self) -> (u32, u32) {
        (self.front, self.cursor)
    }

    /// Releases its memory.
    pub(super) fn release(&mut self, shelves: &mut Shelves) {
        shelves.give_front(&mut self.front);
        shelves.give_cursor(&mut self.cursor);
    }
}

/// Two shapes at the current pose.
struct Pair<'a> {
    bodies: (&'a Body, &'a Body),
    one: &'a PlacedShape,
    other: &'a PlacedShape,
    places: (u32, u32),
    rel: Pose,
    /// Of the second shape seen from the first.
    pos12: Pose,
}

/// The result of a query of two shapes at the current pose.
struct Answer {
    gap: Interval,
    /// 0 inside the interval means touching.
    certain: bool,
    witness: Option<Witness>,
}

impl CompoundFront {
    /// Queries a pair of shapes, up to the strongest goal set at this pose; what is not finished stays open.
    ///
    /// * `known_m` - a bound on their gap that holds at this pose.
    pub(super) fn leaf(
        &mut self,
        tools: &mut Tools<'_>,
        (a, b): (&Side<'_>, &Side<'_>),
        (id_a, id_b): (BoxId, BoxId),
        known_m: f64,
        asked: &Asked,
        meter: &mut Meter<'_>,
    ) {
        let (low, leaf) = (f64::NEG_INFINITY, Group::of_leaves(id_a, id_b));
        let (Some((i, one)), Some((j, other))) = (a.shape(id_a), b.shape(id_b)) else {
            // Not reached: nothing is known of shapes that do not exist.
            (self.known.low, self.known.certain) = (low, false);
            let (a, b) = (id_a, id_b);
            return (self.cover).touch(&mut tools.shelves.store.entries, Open { low, a, b });
        };
        let rel = self.at.pos12;
        let bound_m = sphere_bound(one, other, &rel).max(known_m);
        if bound_m > self.margin_m(self.known.goal, asked) {
            meter.charge(1);
            return self
                .cover
                .keep(&mut tools.shelves.store.entries, leaf, bound_m);
        }
        let pair = Pair {
            bodies: (a.body, b.body),
            one,
            other,
            places: (i, j),
            rel,
            pos12: shape_pose(one, other, &rel),
        };
        let answer = if is_simple(&one.shape, &other.shape) {
            let answer = self.query_once(tools, &pair);
            meter.charge_dear(1);
            Some(answer)
        } else if has_front(&one.shape, &other.shape) {
            self.turn_inner(tools, &pair, asked, meter)
        } else {
            self.turn_cursor(tools, &pair, asked, meter)
        };
        let entries = &mut tools.shelves.store.entries;
        let (a, b) = (id_a, id_b);
        let Some(answer) = answer else {
            return self.cover.look_into(entries, Open { low, a, b });
        };
        let gap = answer.gap;
        self.known.low = self.known.low.min(gap.min.max(known_m));
        self.known.certain &= answer.certain || !gap.contains(0.0);
        self.known.high = self.known.high.min(gap.max);
        self.known.take_witness(answer.witness);
        if gap.min > 0.0 {
            self.cover.keep(entries, leaf, gap.min.max(known_m));
            if gap.min > FAR * one.shape.radius.min(other.shape.radius) {
                self.forget_inner(tools.shelves, pair.places);
            }
        } else {
            self.cover.touch(entries, Open { low, a, b });
        }
    }

    /// Runs the single query that decides two shapes without meshes.
    fn query_once(&mut self, tools: &mut Tools<'_>, pair: &Pair<'_>) -> Answer {
        tools.counters.queries += 1;
        let shapes = (&pair.one.shape, &pair.other.shape);
        let closest = shape_gap(shapes.0, shapes.1, &pair.pos12, &mut Warm::default());
        let Some(closest) = closest else {
            // Not reached: two half-spaces are no pair, and nothing is known of them.
            let (gap, certain, witness) = (Interval::UNKNOWN, false, None);
            return Answer {
                gap,
                certain,
                witness,
            };
        };
        let (one, other) = (pair.one, pair.other);
        let gap = sound(closest.gap, one, other, &pair.rel);
        if self.known.goal == Goal::Contacts && closest.gap.min <= 0.0 {
            tools.counters.manifolds += 1;
            tools.found.clear();
            let answer = (&closest, gap);
            add_manifold(pair.bodies, pair.places, &pair.pos12, answer, tools.found);
            for &contact in &*tools.found {
                tools.shelves.contacts.push(&mut self.found, contact);
            }
        }
        Answer {
            gap,
            certain: closest.finished,
            witness: Some(witness_of(one, other, &pair.pos12, &closest, pair.places)),
        }
    }

    /// A turn of the front of two shapes; `None`: there is more to do.
    fn turn_inner(
        &mut self,
        tools: &mut Tools<'_>,
        pair: &Pair<'_>,
        asked: &Asked,
        meter: &mut Meter<'_>,
    ) -> Option<Answer> {
        let (margin_m, goal) = (self.margin_m(self.known.goal, asked), self.known.goal);
        let inner = self.inner_at(pair.places);
        let Shelves {
            fronts,
            store,
            contacts,
            ..
        } = &mut *tools.shelves;
        let front = fronts.get_or_take(&mut inner.front)?;
        let (one, other) = (pair.one, pair.other);
        let shapes = (&*one.shape, &*other.shape);
        let off_m = lost_m(one, other, &pair.rel);
        let bodies = |gap| sound(gap, one, other, &pair.rel);
        let seen = |leaf: LeafContact| seen_at((one, other), pair.places, &pair.pos12, &leaf);
        if goal == Goal::Verdict && tools.search == Search::Carried {
            let told = glance(front, shapes, (&pair.pos12, off_m), inner.touched, meter);
            let gap = told.gap(Interval::UNKNOWN, bodies);
            if gap.max <= 0.0 || gap.min > margin_m {
                inner.touched = gap.max <= 0.0;
                return Some(Answer {
                    gap,
                    certain: true,
                    witness: told.leaf().map(seen),
                });
            }
        }
        if !front.is_started() {
            front.start(store, shapes.0, shapes.1, &pair.pos12, tools.search);
        }
        front.move_to(store, shapes.0, shapes.1, &pair.pos12);
        tools.counters.slices += 1;
        let left = asked.end.saturating_sub(meter.spent()).max(1);
        let done = front.advance_despite(store, shapes, (goal, off_m), left, meter);
        let gap = bodies(front.interval());
        let far = gap.min > margin_m;
        if !done && !far {
            // Its upper end holds for the whole.
            self.known.high = self.known.high.min(gap.max);
            return None;
        }
        inner.touched = gap.max <= 0.0;
        let certain = far || front.is_certain();
        let witness = front.witness().map(seen);
        if goal == Goal::Contacts && gap.min <= 0.0 {
            for (leaf, patch) in found_on(front, store, shapes, &pair.pos12) {
                let leaf = (&leaf, patch);
                let contact = leaf_contact((one, other), pair.places, &pair.pos12, leaf, gap);
                contacts.push(&mut self.found, contact);
            }
        }
        Some(Answer {
            gap,
            certain,
            witness,
        })
    }

    /// A turn of the query of a mesh and a half-space, which is finished at the pose it began at; `None`: there is more
    /// to do.
    fn turn_cursor(
        &mut self,
        tools: &mut Tools<'_>,
        pair: &Pair<'_>,
        asked: &Asked,
        meter: &mut Meter<'_>,
    ) -> Option<Answer> {
        let margin_m = self.margin_m(self.known.goal, asked);
        let (a, b) = pair.bodies;
        let (goal, now) = (self.known.goal, (pair.rel, Bent::of_bodies(a, b)));
        let inner = self.inner_at(pair.places);
        let Shelves {
            cursors,
            store,
            contacts,
            ..
        } = &mut *tools.shelves;
        let fresh = inner.cursor == NONE;
        let cursor = cursors.get_or_take(&mut inner.cursor)?;
        // A walk at another pose gives no more than a verdict: do not wait for one with a larger goal.
        let here = (cursor.rel, cursor.bent) == now;
        if fresh || cursor.goal < goal || cursor.goal > Goal::Verdict && !here {
            cursor.start(pair.places, now, 0.0, tools.tick, goal);
        }
        let shapes = (pair.one, pair.other);
        let mut room = Room {
            fronts: store,
            contacts,
            search: tools.search,
        };
        let left = asked.end.saturating_sub(meter.spent()).max(1);
        let asked = (asked.report_m, left);
        let turn = cursor.turn(&mut room, shapes, asked, meter, tools.counters);
        let since_m = changed_since(a, b, (&cursor.rel, cursor.bent), &pair.rel);
        let whole = turn == Turn::Finished;
        let low = if whole {
            cursor.gap.min
        } else {
            f64::NEG_INFINITY
        };
        let high = cursor.known(shapes).max;
        let gap = Interval::new(low.min(high), high).widened(since_m);
        self.known.high = self.known.high.min(gap.max);
        let here = whole && since_m == 0.0;
        let decided = goal == Goal::Verdict && (gap.max <= 0.0 || gap.min > margin_m);
        if whole && !here && !decided {
            // Its result is for another pose: once more, at this one.
            cursor.start(pair.places, now, 0.0, tools.tick, goal);
        }
        if !here && !decided {
            return None;
        }
        let answer = Answer {
            gap,
            certain: !here || cursor.certain,
            witness: cursor.witness,
        };
        if here && goal == Goal::Contacts {
            for at in 0..cursor.found(contacts).len() {
                let contact = cursor.found(contacts)[at];
                contacts.push(&mut self.found, contact);
            }
        }
        if whole {
            self.forget_inner(tools.shelves, pair.places);
        }
        Some(answer)
    }

    /// The index of a pair of shapes in `inner`, or where it would be inserted.
    pub(super) fn place_of(&self, places: (u32, u32)) -> Result<usize, usize> {
        (self.inner).binary_search_by_key(&places, |inner| inner.places)
    }

    /// The memory of a pair of shapes.
    fn inner_at(&mut self, places: (u32, u32)) -> &mut Inner {
        let at = self.place_of(places).unwrap_or_else(|at| {
            self.inner.insert(at, Inner::new(places));
            at
        });
        let inner = &mut self.inner[at];
        inner.asked = true;
        inner
    }

    fn forget_inner(&mut self, shelves: &mut Shelves, places: (u32, u32)) {
        if let Ok(at) = self.place_of(places) {
            self.inner.remove(at).release(shelves);
        }
    }

    /// The contacts found at this pose: all of them once `Goal::Contacts` is reached.
    pub(super) fn contacts<'a>(&self, contacts: &'a Arena<Contact>) -> &'a [Contact] {
        contacts.all(&self.found)
    }
}
