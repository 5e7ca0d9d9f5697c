//! What a body or a shape touches, or would touch at another place. In: the question, and the world between two ticks.
//! Out: a self-contained question; then a row for each body that is not proved farther than the queried distance.
//!
//! How: one pass over the boxes of all bodies finds those that may be near. They are copied (their shapes are shared),
//! and the worker queries each gap in turn, nearest box first: little work for each, then as much as the second allows.
//! A far box is a proof; a body that has no box because its place is not known is named, so that silence is no proof.
//!
//! Bodies that hang on the queried body move with it and are queried too. Refused: a search in the broad phase's own
//! order, which differs by method and is rearranged while it is read.

use std::cmp::Reverse;

use super::gap::find;
use super::measure::{Measured, WORK_NS, age_ns, fit};
use super::nearest::{Groups, Hit, Nearest};
use super::unknown::{Unknown, Whereabouts};
use crate::ids::BodySlot;
use crate::limits::TOUCHING_ROWS_MAX;
use crate::math::{Pose, ROUND};
use crate::scene::{Subject, Touching};
use crate::shape::Geometry;
use crate::time::{Clock, Meter};
use crate::wire::{BodyStatus, MessageHeader, TouchingFound, TouchingRow, Verdict};
use crate::world::{Body, Parts, World};

/// Units for each pair before any gets more: convex pairs and most meshes are done by then.
const FIRST_UNITS: u64 = 2_000;

/// A body or a shape at the queried place, and the bodies that may be near.
#[derive(Clone, Debug)]
pub struct TouchingQuestion {
    /// The queried bodies at the queried place: the body first, then those that hang on it.
    asked: Vec<Body>,
    /// The question is about a body; otherwise a shape.
    is_body: bool,
    /// Its pose is its present one.
    in_place: bool,
    within_m: f64,
    near: Vec<Near>,
    /// The part of the answer that needs no work.
    found: TouchingFound,
    /// Warnings: what is odd, but allowed.
    pub warnings: Vec<String>,
}

/// Another body that may be near.
#[derive(Clone, Debug)]
struct Near {
    /// Index in `asked`.
    asked: usize,
    body: Body,
    /// Lower bound on its distance, if above 0, metres.
    bound_m: f64,
}

impl TouchingQuestion {
    /// Copies the bodies at their present poses.
    ///
    /// * `tick_header` - of the tick that left the world in this state.
    /// * `shapes` - those of the question, built, if it has any.
    ///
    /// Cost: a look at the box of each body and at each pair of near boxes, and a copy of those that find room.
    ///
    /// # Errors
    /// Why there is no answer, which body, and what to change: no such body, it is disabled, its present place is
    /// queried and not known, its vertices are not known.
    pub fn new(
        world: &World,
        tick_header: MessageHeader,
        asked: &Touching,
        shapes: Option<&Parts>,
    ) -> Result<Self, String> {
        let mut warnings = Vec::new();
        let (slots, bodies) = match (&asked.subject, shapes) {
            (Subject::Body(name), _) => parts_of(world, name, asked.pose.as_ref(), &mut warnings)?,
            (Subject::Shapes { .. }, Some(shapes)) => {
                let pose = asked.pose.unwrap_or_else(Pose::identity);
                (Vec::new(), vec![Body::of_shapes(shapes.clone(), &pose)])
            }
            (Subject::Shapes { .. }, None) => return Err("its shapes are not built".to_owned()),
        };
        let is_body = !slots.is_empty();
        let pose = bodies.first().map(|body| body.pose).unwrap_or_default();
        let turn = pose.rotation.as_vector();
        let mut question = Self {
            is_body,
            in_place: is_body && asked.pose.is_none(),
            within_m: asked.within_m,
            near: Vec::new(),
            found: TouchingFound {
                tick_header,
                complete: true,
                asked: bodies
                    .iter()
                    .filter(|_| is_body)
                    .map(|body| body.name.clone())
                    .collect(),
                position: pose.translation.vector.into(),
                orientation: [turn.x, turn.y, turn.z, turn.w],
                ..TouchingFound::default()
            },
            asked: bodies,
            warnings,
        };
        let hits = question.look_around(world, asked, &slots);
        question.keep(world, hits);
        Ok(question)
    }

    /// Finds the bodies that may be near by their boxes, and counts those that must not or cannot be tested.
    fn look_around(&mut self, world: &World, asked: &Touching, slots: &[BodySlot]) -> Nearest {
        let (mut hits, mut unknown) = (Nearest::new(TOUCHING_ROWS_MAX), Unknown::default());
        let groups = Groups::of(&self.asked);
        for (slot, other) in world.bodies_ahead() {
            let reach_m = match Whereabouts::of(other) {
                Whereabouts::InItsBox => self.within_m,
                Whereabouts::HeldThere | Whereabouts::Anywhere => f64::INFINITY,
            };
            // Most bodies are far from all queried ones.
            if groups.whole.distance(&other.proxy) > reach_m || slots.contains(&slot) {
                continue;
            }
            let mut is_asked = false;
            for place in groups.near(&other.proxy, reach_m) {
                let part = &self.asked[place];
                let bound_m = bound_m(part, other);
                if bound_m > reach_m {
                    continue;
                }
                let by_filter = || match &asked.subject {
                    _ if !asked.filters => true,
                    Subject::Body(_) => world.filters().allows(slots[place], slot),
                    Subject::Shapes { group, mask, .. } => {
                        world.filters().allows_stranger(*group, *mask, slot)
                    }
                };
                let is_apart_by_law = part.only_half_spaces && other.only_half_spaces;
                if is_apart_by_law || other.status == BodyStatus::Disabled || !by_filter() {
                    self.found.ignored += 1;
                    continue;
                }
                is_asked = true;
                if bound_m <= self.within_m && fit(world, slot, other).is_ok() {
                    hits.take(Hit {
                        bound_m,
                        asked: place,
                        id: other.id,
                        slot,
                    });
                }
            }
            if is_asked {
                unknown.note(other);
            }
        }
        self.found.complete = unknown.is_none();
        (self.found.unknown, self.found.unknown_left_out) = unknown.take();
        hits
    }

    /// Copies those that find room: the nearest, by their boxes.
    fn keep(&mut self, world: &World, hits: Nearest) {
        self.found.left_out = hits.left_out;
        self.found.complete &= hits.left_out == 0;
        self.near = hits
            .sorted()
            .into_iter()
            .filter_map(|hit| {
                Some(Near {
                    asked: hit.asked,
                    body: world.body(hit.slot)?.still(),
                    bound_m: hit.bound_m,
                })
            })
            .collect();
    }

    /// As for a gap query.
    pub(super) fn bodies_mut(&mut self) -> impl Iterator<Item = &mut Body> {
        let near = self.near.iter_mut().map(|near| &mut near.body);
        self.asked.iter_mut().chain(near)
    }

    /// Works on the answer, for a second at most.
    #[must_use]
    pub fn answer(&self, clock: &dyn Clock) -> TouchingFound {
        self.answer_within(clock, None)
    }

    /// As [`TouchingQuestion::answer`], with at most `units` units of work.
    #[must_use]
    pub fn answer_within(&self, clock: &dyn Clock, units: Option<u64>) -> TouchingFound {
        let now_ns = clock.boottime_ns();
        let end_ns = clock.monotonic_ns().saturating_add(WORK_NS);
        let mut units_left = units.unwrap_or(u64::MAX);
        let mut known: Vec<Option<Measured>> = vec![None; self.near.len()];
        for most in [FIRST_UNITS, u64::MAX] {
            for (near, known) in self.near.iter().zip(&mut known) {
                if known.is_some_and(|known| known.finished) {
                    continue;
                }
                let mut meter = Meter::new(clock, Some(end_ns), Some(most.min(units_left)));
                if known.is_none() || meter.open() {
                    let newer = near.measure(&self.asked[near.asked], self.within_m, &mut meter);
                    *known = Some(known.map_or(newer, |older| better(older, newer)));
                }
                units_left = units_left.saturating_sub(meter.spent());
            }
        }
        let pairs = self.near.iter().zip(known.into_iter().flatten());
        let mut rows: Vec<TouchingRow> = pairs
            .filter(|(_, known)| known.gap.min <= self.within_m)
            .map(|(near, known)| self.row(near, &known, now_ns))
            .collect();
        rows.sort_by(|one, other| {
            let least = |row: &TouchingRow| row.known.gap_min_m.unwrap_or(f64::NEG_INFINITY);
            let rank = |row: &TouchingRow| Reverse(row.known.verdict);
            (rank(one).cmp(&rank(other)))
                .then_with(|| least(one).total_cmp(&least(other)))
                .then_with(|| (&one.a, &one.b).cmp(&(&other.a, &other.b)))
        });
        TouchingFound {
            rows,
            ..self.found.clone()
        }
    }

    fn row(&self, near: &Near, known: &Measured, now_ns: u64) -> TouchingRow {
        let asked = &self.asked[near.asked];
        let own_age_ns = age_ns(asked, now_ns).filter(|_| self.in_place);
        TouchingRow {
            a: self.is_body.then(|| asked.name.clone()),
            b: near.body.name.clone(),
            known: known.told(),
            age_ns: age_ns(&near.body, now_ns).max(own_age_ns),
        }
    }
}

impl Near {
    fn measure(&self, asked: &Body, within_m: f64, meter: &mut Meter<'_>) -> Measured {
        // A body exactly at the queried distance counts as near.
        let mut known = Measured::of(asked, &self.body, within_m.next_up(), meter);
        if self.bound_m > known.gap.min && self.bound_m > 0.0 {
            known.gap.min = self.bound_m.min(known.gap.max);
            if known.verdict == Verdict::Possible && known.gap.min > 0.0 {
                known.verdict = Verdict::Near;
            }
        }
        known
    }
}

/// The more informative one.
fn better(one: Measured, other: Measured) -> Measured {
    if other.finished || other.gap.width() < one.gap.width() {
        other
    } else {
        one
    }
}

type Asked = (Vec<BodySlot>, Vec<Body>);

/// A body and those that hang on it, at the queried place.
fn parts_of(
    world: &World,
    name: &str,
    pose: Option<&Pose>,
    warnings: &mut Vec<String>,
) -> Result<Asked, String> {
    let slot = find(world, name)?;
    let body = world.body(slot);
    let body = body.ok_or_else(|| "a body has just been taken out: ask again".to_owned())?;
    let has_vertices = |v: &crate::world::Vertices| v.version.is_some() && v.refused.is_none();
    match pose {
        None => warnings.extend(fit(world, slot, body)?),
        Some(_) if body.status == BodyStatus::Disabled => {
            return Err(format!(
                "body \"{name}\" is disabled: enable it, or ask for its `shape`"
            ));
        }
        Some(_) if !body.vertices.as_deref().is_none_or(has_vertices) => {
            return Err(format!(
                "body \"{name}\" deforms, and its vertices are not known: ask again when its source has sent them"
            ));
        }
        Some(_) => {}
    }
    let (mut slots, mut bodies) = (vec![slot], vec![body.at(pose.unwrap_or(&body.pose))]);
    for (slot, local) in world.hanging_on(slot) {
        let Some(other) = world.body(slot) else {
            continue;
        };
        // Bodies that are disabled, or whose own shape is not known, are left out.
        if other.status == BodyStatus::Disabled {
            continue;
        }
        slots.push(slot);
        bodies.push(match pose {
            Some(pose) => other.at(&(pose * local)),
            None => other.at(&other.pose),
        });
    }
    Ok((slots, bodies))
}

/// A lower bound on the distance between any points of the two, metres; 0 or less proves nothing.
fn bound_m(one: &Body, other: &Body) -> f64 {
    match (one.unbounded, other.unbounded) {
        (false, false) => one.proxy.distance(&other.proxy),
        (true, false) => above_m(one, other),
        (false, true) => above_m(other, one),
        (true, true) => 0.0,
    }
}

/// A lower bound on the height of the ball around one above the other's half-spaces, metres; 0 if it has other shapes.
fn above_m(planes: &Body, ball: &Body) -> f64 {
    let centre = ball.pose * ball.centre;
    let mut least_m = f64::INFINITY;
    for placed in planes.shapes.iter() {
        let Geometry::HalfSpace { normal, offset } = &placed.shape.geometry else {
            return 0.0;
        };
        let at = planes.pose * placed.pose;
        let (up, from) = (at.rotation * normal, at.translation.vector);
        let height = (centre.coords - from).dot(&up) - offset;
        let size = centre.coords.amax() + from.amax() + offset.abs() + ball.radius;
        let reach_m = planes.reach_m + ball.reach_m;
        least_m = least_m.min(height - ball.radius - reach_m - 32.0 * ROUND * size);
    }
    least_m
}
