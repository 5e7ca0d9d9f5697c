//! A resumable query of two shapes of two bodies at one pose: one exact query, or a walk over a mesh.
//!
//! A cursor keeps the relative pose it was started at; whatever it finds holds at that pose, and its certificate has
//! the motion accumulators of that moment, so that interrupted work stays valid after the bodies have moved. Pairs with
//! a front are carried from pose to pose instead (`carry`, `compound`): cursors are for half-spaces, and for queries on
//! demand.

use crate::math::{Interval, Pose};
use crate::time::Meter;
use crate::world::PlacedShape;

use super::Counters;
use super::arena::{Arena, Run};
use super::bent::Bent;
use super::carry::seen_at;
use super::contacts::Contact;
use super::exact::Warm;
use super::holdings::Holdings;
use super::memo::Witness;
use super::mesh::{FrontStore, Goal, MeshQuery, Search, overlap, parted};
use super::query::{
    is_simple, leaf_contact, lost_m, shape_gap, shape_pose, sound, sphere_bound, witness_of,
};

/// Units of one plain turn of a walk over meshes before the next pair has its turn: at 32 the clock costs 2.5 %.
pub(super) const SLICE_UNITS: u64 = 32;

/// A resumable query.
#[derive(Debug)]
pub(super) struct Cursor {
    /// Pose of B's body seen from A's, at the start.
    pub(super) rel: Pose,
    /// The deformation of both bodies at the start. Later results refer to the vertices at the start: they hold for
    /// those of any later moment when widened by the deformation since.
    pub(super) bent: Bent,
    /// Sum of both bodies' `S - d` at the start.
    pub(super) credit_m: f64,
    /// Tick of the start.
    pub(super) tick: u64,
    /// Verdict only, or bounds and contacts.
    pub(super) goal: Goal,
    /// The gap, once it is finished.
    pub(super) gap: Interval,
    /// Whether 0 inside the interval of a finished query means touching.
    pub(super) certain: bool,
    /// Its nearest or deepest place.
    pub(super) witness: Option<Witness>,
    /// Contacts found so far.
    found: Run,
    /// Places of the two shapes in their bodies.
    places: (u32, u32),
    /// The walk over meshes.
    meshes: MeshQuery,
    /// Whether the walk over meshes has begun.
    under_way: bool,
    finished: bool,
}

/// Where cursors store what they find.
#[derive(Debug)]
pub(super) struct Room<'a> {
    pub(super) fronts: &'a mut FrontStore,
    pub(super) contacts: &'a mut Arena<Contact>,
    /// How surfaces are searched.
    pub(super) search: Search,
}

impl Default for Cursor {
    fn default() -> Self {
        Self {
            rel: Pose::identity(),
            bent: Bent::default(),
            credit_m: 0.0,
            tick: 0,
            goal: Goal::Verdict,
            gap: Interval::UNKNOWN,
            certain: true,
            witness: None,
            found: Run::default(),
            places: (0, 0),
            meshes: MeshQuery::default(),
            under_way: false,
            finished: false,
        }
    }
}

/// The outcome of a turn of a cursor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// The goal is reached.
    Finished,
    /// There is more to do.
    Open,
}

impl Cursor {
    /// Starts over: two shapes by their places, at a relative pose and deformation of their bodies.
    pub(super) fn start(
        &mut self,
        places: (u32, u32),
        (rel, bent): (Pose, Bent),
        credit_m: f64,
        tick: u64,
        goal: Goal,
    ) {
        self.places = places;
        (self.rel, self.bent) = (rel, bent);
        self.credit_m = credit_m;
        self.tick = tick;
        self.goal = goal;
        self.gap = Interval::UNKNOWN;
        self.certain = true;
        self.witness = None;
        self.found.clear();
        (self.under_way, self.finished) = (false, false);
    }

    /// Releases its memory.
    pub(super) fn release(&mut self, fronts: &mut FrontStore, contacts: &mut Arena<Contact>) {
        self.meshes.release(fronts);
        contacts.release(&mut self.found);
    }

    /// Lists what it holds.
    pub(super) fn tell<'a>(&'a self, held: &mut Holdings<'a>) {
        self.meshes.tell(held);
        held.contacts.push(&self.found);
    }

    /// The contacts found so far.
    pub(super) fn found<'a>(&self, contacts: &'a Arena<Contact>) -> &'a [Contact] {
        contacts.all(&self.found)
    }

    /// What is known so far of the gap of the bodies at the start's pose.
    ///
    /// `one` and `other` are those of [`Cursor::turn`].
    pub(super) fn known(&self, (one, other): (&PlacedShape, &PlacedShape)) -> Interval {
        if self.under_way && !self.finished {
            sound(self.meshes.interval(), one, other, &self.rel)
        } else {
            self.gap
        }
    }

    /// Works until the goal is reached, `slice_units` are spent, or the meter closes.
    ///
    /// `one` and `other` are the same shapes in every turn.
    pub(super) fn turn(
        &mut self,
        room: &mut Room<'_>,
        (one, other): (&PlacedShape, &PlacedShape),
        (report_m, slice_units): (f64, u64),
        meter: &mut Meter<'_>,
        counters: &mut Counters,
    ) -> Turn {
        if self.finished {
            return Turn::Finished;
        }
        if !meter.open() {
            return Turn::Open;
        }
        let pos12 = shape_pose(one, other, &self.rel);
        let known = if self.under_way {
            None
        } else {
            self.glance(room.search, (one, other), &pos12, report_m, meter)
        };
        if let Some(gap) = known {
            self.gap = gap;
        } else if is_simple(&one.shape, &other.shape) {
            counters.queries += 1;
            self.query_once((one, other), &pos12);
            meter.charge_dear(1);
        } else {
            if !std::mem::replace(&mut self.under_way, true) {
                self.meshes.set_search(room.search);
                (self.meshes).start(room.fronts, &one.shape, &other.shape, &pos12);
            }
            counters.slices += 1;
            let shapes = (&*one.shape, &*other.shape);
            let asked = (self.goal, lost_m(one, other, &self.rel));
            if !(self.meshes).advance_despite(room.fronts, shapes, asked, slice_units, meter) {
                return Turn::Open;
            }
            self.take_meshes(room, (one, other), &pos12);
        }
        self.finished = true;
        Turn::Finished
    }

    /// What is known of the two without a query, if it is enough for a verdict.
    fn glance(
        &self,
        search: Search,
        (one, other): (&PlacedShape, &PlacedShape),
        pos12: &Pose,
        report_m: f64,
        meter: &mut Meter<'_>,
    ) -> Option<Interval> {
        if self.goal != Goal::Verdict {
            return None;
        }
        let enough = report_m.max(0.0);
        let from = |low| Interval::new(low, f64::INFINITY);
        let bound = sphere_bound(one, other, &self.rel);
        if bound > enough {
            meter.charge(1);
            return Some(from(bound));
        }
        if search != Search::Carried {
            return None;
        }
        let shapes = (&*one.shape, &*other.shape);
        let low = parted(shapes, pos12, meter);
        let apart = low.map(|low| sound(from(low), one, other, &self.rel));
        if let Some(apart) = apart.filter(|apart| apart.min > enough) {
            return Some(apart);
        }
        let depth_m = overlap(shapes, pos12, meter)?;
        let deep = Interval::new(f64::NEG_INFINITY, -depth_m);
        Some(sound(deep, one, other, &self.rel))
    }

    /// Runs the single query that decides two shapes without meshes.
    fn query_once(&mut self, (one, other): (&PlacedShape, &PlacedShape), pos12: &Pose) {
        let mut warm = Warm::default();
        let Some(closest) = shape_gap(&one.shape, &other.shape, pos12, &mut warm) else {
            return;
        };
        self.gap = sound(closest.gap, one, other, &self.rel);
        self.certain = closest.finished;
        self.witness = Some(witness_of(one, other, pos12, &closest, self.places));
    }

    /// Takes over the result of a finished query of a mesh pair.
    fn take_meshes(
        &mut self,
        room: &mut Room<'_>,
        (one, other): (&PlacedShape, &PlacedShape),
        pos12: &Pose,
    ) {
        let gap = sound(self.meshes.interval(), one, other, &self.rel);
        (self.gap, self.certain) = (gap, self.meshes.is_certain());
        self.witness =
            (self.meshes.witness()).map(|leaf| seen_at((one, other), self.places, pos12, &leaf));
        if self.goal == Goal::Contacts && gap.min <= 0.0 {
            for (leaf, patch) in self.meshes.contacts(room.fronts) {
                let contact = leaf_contact((one, other), self.places, pos12, (&leaf, patch), gap);
                room.contacts.push(&mut self.found, contact);
            }
        }
    }
}
