//! A resumable query of a whole body pair: shape pair by shape pair, meshes leaf by leaf.
//!
//! A cursor keeps the relative pose it was started at; whatever it has found holds at that pose, and its certificate
//! carries the motion accumulators of that moment, so that interrupted work stays valid after the bodies have moved.

use crate::math::{Interval, Pose};
use crate::time::Meter;
use crate::world::Body;

use super::Counters;
use super::arena::{Arena, Run};
use super::contacts::Contact;
use super::exact::Warm;
use super::memo::Witness;
use super::mesh::{CarriedFront, FrontStore, Goal, MeshQuery, Search, overlap, parted};
use super::query::{
    add_manifold, is_simple, leaf_contact, shape_gap, shape_pose, sound, sphere_bound, witness_of,
};

/// Units of one turn of a walk over meshes before the next pair has its turn: at 32 the clock costs 2.5 %.
pub(super) const SLICE_UNITS: u64 = 32;

/// A resumable query.
#[derive(Debug)]
pub(super) struct Cursor {
    /// Pose of B's body seen from A's, at the start.
    pub(super) rel: Pose,
    /// What both bodies had deformed by at the start, metres. What is found later is of the vertices of then: it holds
    /// for those of any other moment since the start when it is widened by what was deformed since the start.
    pub(super) bent_m: f64,
    /// Sum of both bodies' `S - d` at the start.
    pub(super) credit_m: f64,
    /// Tick of the start.
    pub(super) tick: u64,
    /// Verdict only, or bounds and contacts.
    pub(super) goal: Goal,
    /// Least gap of the shape pairs finished so far.
    pub(super) gap: Interval,
    /// Whether 0 inside the interval of a finished query means touching: every shape pair so far said so.
    pub(super) certain: bool,
    /// Where it is.
    pub(super) witness: Option<Witness>,
    /// Contacts found so far.
    found: Run,
    next: usize,
    /// The mesh pair under way.
    meshes: MeshQuery,
    under_way: bool,
}

/// Where cursors keep what they find.
#[derive(Debug)]
pub(super) struct Room<'a> {
    pub(super) fronts: &'a mut FrontStore,
    pub(super) contacts: &'a mut Arena<Contact>,
    /// Contacts of the query at hand.
    pub(super) found: &'a mut Vec<Contact>,
    /// How surfaces are searched.
    pub(super) search: Search,
}

impl Default for Cursor {
    fn default() -> Self {
        Self {
            rel: Pose::identity(),
            bent_m: 0.0,
            credit_m: 0.0,
            tick: 0,
            goal: Goal::Verdict,
            gap: Interval::UNKNOWN,
            certain: true,
            witness: None,
            found: Run::default(),
            next: 0,
            meshes: MeshQuery::default(),
            under_way: false,
        }
    }
}

/// How far a turn of a cursor came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Every shape pair is accounted for, or the goal is reached.
    Finished,
    /// There is more to do.
    Open,
}

impl Cursor {
    /// Starts over at a relative pose, with bodies that have deformed so much.
    pub(super) fn start(
        &mut self,
        (rel, bent_m): (Pose, f64),
        credit_m: f64,
        tick: u64,
        goal: Goal,
    ) {
        (self.rel, self.bent_m) = (rel, bent_m);
        self.credit_m = credit_m;
        self.tick = tick;
        self.goal = goal;
        self.gap = Interval {
            min: f64::INFINITY,
            max: f64::INFINITY,
        };
        self.certain = true;
        self.witness = None;
        self.found.clear();
        self.next = 0;
        self.under_way = false;
    }

    /// Gives its memory back.
    pub(super) fn release(&mut self, fronts: &mut FrontStore, contacts: &mut Arena<Contact>) {
        self.meshes.release(fronts);
        contacts.release(&mut self.found);
    }

    /// The contacts found so far.
    pub(super) fn found<'a>(&self, contacts: &'a Arena<Contact>) -> &'a [Contact] {
        contacts.all(&self.found)
    }

    /// The front under way, if it is that of the `place`th pair of shapes.
    pub(super) fn front_of(&self, place: usize) -> Option<&CarriedFront> {
        let here = self.under_way && self.next == place;
        here.then(|| self.meshes.front())?
    }

    /// An upper bound on the gap at the start's pose, from whatever is done by now.
    pub(super) fn upper(&self) -> f64 {
        if self.under_way {
            self.gap.max.min(self.meshes.interval().max)
        } else {
            self.gap.max
        }
    }

    /// Works until the goal is reached, the slice is used up, or the meter closes.
    pub(super) fn turn(
        &mut self,
        room: &mut Room<'_>,
        (a, b): (&Body, &Body),
        report_m: f64,
        meter: &mut Meter<'_>,
        counters: &mut Counters,
    ) -> Turn {
        let stop_at = meter.spent() + SLICE_UNITS;
        let pairs = a.shapes.len() * b.shapes.len();
        while self.next < pairs {
            if !meter.open() || meter.spent() >= stop_at {
                return Turn::Open;
            }
            if self.goal == Goal::Verdict && self.gap.max <= 0.0 {
                return Turn::Finished;
            }
            if self.shape_pair(room, (a, b), report_m, stop_at, meter, counters) {
                self.next += 1;
            }
        }
        Turn::Finished
    }

    /// Works on the current shape pair; whether it is accounted for.
    fn shape_pair(
        &mut self,
        room: &mut Room<'_>,
        (a, b): (&Body, &Body),
        report_m: f64,
        stop_at: u64,
        meter: &mut Meter<'_>,
        counters: &mut Counters,
    ) -> bool {
        let (place_a, place_b) = (self.next / b.shapes.len(), self.next % b.shapes.len());
        let (one, other) = (&a.shapes[place_a], &b.shapes[place_b]);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "limits::SHAPES_PER_BODY_MAX fits"
        )]
        let places = (place_a as u32, place_b as u32);
        // A shape pair that cannot be the least (nor, where contacts are wanted, touch) needs no query.
        let enough = match self.goal {
            Goal::Verdict => report_m.max(0.0),
            Goal::Gap | Goal::Contacts => self.gap.max.max(0.0),
        };
        if !self.under_way {
            let bound = sphere_bound(one, other, &self.rel);
            if bound > enough {
                meter.charge(1);
                self.gap.min = self.gap.min.min(bound);
                return true;
            }
        }
        let pos12 = shape_pose(one, other, &self.rel);
        if !self.under_way && room.search == Search::Carried && enough < f64::INFINITY {
            let low = parted((&one.shape, &other.shape), &pos12, meter);
            let apart = low.map(|low| sound(Interval::new(low, low), one, other, &self.rel));
            if let Some(apart) = apart.filter(|apart| apart.min > enough) {
                self.gap.min = self.gap.min.min(apart.min);
                return true;
            }
            if self.goal == Goal::Verdict
                && let Some(depth_m) = overlap((&one.shape, &other.shape), &pos12, meter)
            {
                let deep = Interval::new(f64::NEG_INFINITY, -depth_m);
                self.gap = self.gap.least(sound(deep, one, other, &self.rel));
                return true;
            }
        }
        if is_simple(&one.shape, &other.shape) {
            counters.queries += 1;
            self.query_once(room, (a, b), places, &pos12, counters);
            meter.charge_dear(1);
            return true;
        }
        if !std::mem::replace(&mut self.under_way, true) {
            self.meshes.set_search(room.search);
            (self.meshes).start(room.fronts, &one.shape, &other.shape, &pos12);
        }
        counters.slices += 1;
        let left = stop_at.saturating_sub(meter.spent()).max(1);
        let shapes = (&*one.shape, &*other.shape);
        if !(self.meshes).advance(room.fronts, shapes, self.goal, left, meter) {
            return false;
        }
        self.under_way = false;
        self.take_meshes(room, (a, b), places, &pos12);
        true
    }

    /// The one query that decides two shapes without meshes.
    fn query_once(
        &mut self,
        room: &mut Room<'_>,
        (a, b): (&Body, &Body),
        places: (u32, u32),
        pos12: &Pose,
        counters: &mut Counters,
    ) {
        let (one, other) = (&a.shapes[places.0 as usize], &b.shapes[places.1 as usize]);
        let mut warm = Warm::default();
        let Some(closest) = shape_gap(&one.shape, &other.shape, pos12, &mut warm) else {
            return;
        };
        let gap = sound(closest.gap, one, other, &self.rel);
        self.certain &= closest.finished || !gap.contains(0.0);
        if gap.max < self.gap.max {
            self.witness = Some(witness_of(one, other, pos12, &closest, places));
        }
        if self.goal == Goal::Contacts && gap.min <= 0.0 {
            counters.manifolds += 1;
            room.found.clear();
            add_manifold((a, b), places, pos12, &closest, room.found);
            for &contact in &*room.found {
                room.contacts.push(&mut self.found, contact);
            }
        }
        self.gap = self.gap.least(gap);
    }

    /// Takes over what a finished query of a mesh pair found.
    fn take_meshes(
        &mut self,
        room: &mut Room<'_>,
        (a, b): (&Body, &Body),
        places: (u32, u32),
        pos12: &Pose,
    ) {
        let (one, other) = (&a.shapes[places.0 as usize], &b.shapes[places.1 as usize]);
        let gap = sound(self.meshes.interval(), one, other, &self.rel);
        self.certain &= self.meshes.is_certain() || !gap.contains(0.0);
        if let Some(leaf) = self.meshes.witness().filter(|_| gap.max < self.gap.max) {
            self.witness = Some(Witness {
                triangle_a: leaf.triangle_a,
                triangle_b: leaf.triangle_b,
                ..witness_of(one, other, pos12, &leaf.closest, places)
            });
        }
        if self.goal == Goal::Contacts && gap.min <= 0.0 {
            for (leaf, patch) in self.meshes.contacts(room.fronts) {
                let contact = leaf_contact((one, other), places, pos12, (&leaf, patch), gap);
                room.contacts.push(&mut self.found, contact);
            }
        }
        self.gap = self.gap.least(gap);
    }
}
