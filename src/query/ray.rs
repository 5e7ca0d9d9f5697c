//! What a ray hits first. In: the question, and the world between two ticks. Out: a self-contained question; then the
//! body that is hit, with a proved interval of the distance, or a proof that none is.
//!
//! How: the ray is cut where it passes the boxes of bodies, nearest first. A piece of it is a body without thickness:
//! proved apart by the query of two bodies it is free, certified to collide it is hit. So halving the first piece that
//! is not free closes in on the hit from both sides, for every kind of shape, surfaces too. From a free piece the ray
//! is free for another stretch as long as the gap. Refused: a formula per shape, each with its proof of rounding.

use std::sync::Arc;

use nalgebra::Quaternion;

use super::measure::{Measured, WORK_NS, age_ns, fit};
use super::unknown::{Unknown, Whereabouts};
use crate::ids::{BodyId, BodySlot};
use crate::limits::RAY_BODIES_MAX;
use crate::math::{Aabb, Point, Pose, Quat, ROUND, Vec3};
use crate::scene::Ray;
use crate::shape::{Convex, Shape};
use crate::time::{Clock, Meter};
use crate::wire::{BodyStatus, MessageHeader, NO_INDEX, RayFound, Verdict};
use crate::world::{Body, Parts, PlacedShape, World};

/// Most pieces of one ray that are tested against one body: a hit takes some 50, a grazing ray more.
const LOOKS_MAX: u32 = 400;
/// The normal is computed this far in front of the hit, as a share of the body's size: nearer, rounding would turn it.
const STAND_OFF: f64 = 1e-6;
/// The same distance for a body without a finite size, metres.
const STAND_OFF_M: f64 = 1e-3;

/// A ray, and the bodies whose boxes it passes.
#[derive(Clone, Debug)]
pub struct RayQuestion {
    from: Point,
    /// Unit, scene frame.
    direction: Vec3,
    /// Turns z into it.
    turn: Quat,
    max_m: f64,
    /// Sorted by where their boxes begin.
    near: Vec<Near>,
    /// Where the box of the first body that found no room begins, metres.
    left_out_from_m: f64,
    /// The part of the answer that needs no work.
    found: RayFound,
    /// Warnings: what is odd, but allowed.
    pub warnings: Vec<String>,
}

/// A body whose box the ray passes.
#[derive(Clone, Debug)]
struct Near {
    body: Body,
    /// The ray is in the box from here to `leave_m`, metres along the ray; before, it is free.
    enter_m: f64,
    leave_m: f64,
}

/// What is known of a ray and one body.
#[derive(Clone, Copy, Debug)]
struct Cast {
    /// Free up to here, metres.
    free_m: f64,
    /// Known to be hit by here, metres; infinite: no hit is known.
    hit_m: f64,
    /// The end of the first piece that rounding cannot distinguish from a touch, metres; infinite: none is known.
    touch_m: f64,
    /// The end of the first piece that is not known to be free, metres: the first hit lies in it.
    until_m: f64,
    inside: bool,
    /// Not hit at all.
    misses: bool,
}

impl RayQuestion {
    /// Copies the bodies at their present poses.
    ///
    /// * `tick_header` - of the tick that left the world in this state.
    ///
    /// Cost: O(bodies), and a copy of each whose box the ray passes.
    #[must_use]
    pub fn new(world: &World, tick_header: MessageHeader, ray: &Ray) -> Self {
        let direction = Vec3::from(ray.direction);
        // Scaled by its largest component first, so that neither 1e-200 nor 1e200 loses it.
        let direction = (direction / direction.amax()).normalize();
        let mut question = Self {
            from: Point::from(ray.from),
            direction,
            turn: turn_of_axis(&direction),
            max_m: ray.max_m,
            near: Vec::new(),
            left_out_from_m: f64::INFINITY,
            found: RayFound {
                tick_header,
                complete: true,
                ..RayFound::default()
            },
            warnings: Vec::new(),
        };
        question.look_along(world, ray.mask);
        question
    }

    fn look_along(&mut self, world: &World, mask: u32) {
        let mut unknown = Unknown::default();
        type Hit = (f64, f64, BodyId, BodySlot);
        let mut hits: Vec<Hit> = Vec::new();
        for (slot, body) in world.bodies_ahead() {
            let place = Whereabouts::of(body);
            let passed = match place {
                Whereabouts::Anywhere => None,
                _ => self.passage(&body.proxy),
            };
            if passed.is_none() && place == Whereabouts::InItsBox {
                continue;
            }
            if body.status == BodyStatus::Disabled || !world.filters().is_of(mask, slot) {
                self.found.ignored += 1;
                continue;
            }
            unknown.note(body);
            if let (Some((enter_m, leave_m)), Ok(_)) = (passed, fit(world, slot, body)) {
                hits.push((enter_m, leave_m, body.id, slot));
            }
        }
        let order = |one: &Hit, other: &Hit| one.0.total_cmp(&other.0).then(one.2.cmp(&other.2));
        if hits.len() > RAY_BODIES_MAX {
            let (_, first, _) = hits.select_nth_unstable_by(RAY_BODIES_MAX, order);
            self.left_out_from_m = first.0;
            self.found.left_out = (hits.len() - RAY_BODIES_MAX) as u64;
            hits.truncate(RAY_BODIES_MAX);
        }
        hits.sort_unstable_by(order);
        let near = hits.into_iter().filter_map(|(enter_m, leave_m, _, slot)| {
            Some(Near {
                body: world.body(slot)?.still(),
                enter_m,
                leave_m,
            })
        });
        self.near = near.collect();
        self.found.complete = unknown.is_none();
        (self.found.unknown, self.found.unknown_left_out) = unknown.take();
    }

    /// The range of the ray that surely contains its part within a box; `None`: it passes by.
    fn passage(&self, of: &Aabb) -> Option<(f64, f64)> {
        let (mut enter_m, mut leave_m) = (0.0_f64, self.max_m);
        for k in 0..3 {
            let (low, high) = (of.min[k] - self.from[k], of.max[k] - self.from[k]);
            let along = self.direction[k];
            // The direction and both differences are rounded; the error grows with the distance.
            let slack = |way: f64| 8.0 * ROUND * (way.abs() + self.from[k].abs());
            if along.abs() <= 1e-9 {
                let astray = 1e-9 * leave_m.min(1e18) * f64::from(u8::from(along != 0.0));
                if low - slack(low) - astray > 0.0 || high + slack(high) + astray < 0.0 {
                    return None;
                }
                continue;
            }
            let (first, last) = if along > 0.0 {
                (low, high)
            } else {
                (high, low)
            };
            let at = |way: f64, out: f64| {
                let t = way / along;
                t + out * (slack(way) / along.abs() + 16.0 * ROUND * t.abs())
            };
            if first.is_finite() {
                enter_m = enter_m.max(at(first, -1.0));
            }
            if last.is_finite() {
                leave_m = leave_m.min(at(last, 1.0));
            }
        }
        (enter_m <= leave_m).then_some((enter_m, leave_m))
    }

    /// As for a gap query.
    pub(super) fn bodies_mut(&mut self) -> impl Iterator<Item = &mut Body> {
        self.near.iter_mut().map(|near| &mut near.body)
    }

    /// Works on the answer, for a second at most.
    #[must_use]
    pub fn answer(&self, clock: &dyn Clock) -> RayFound {
        self.answer_within(clock, None)
    }

    /// As [`RayQuestion::answer`], with at most `units` units of work.
    #[must_use]
    pub fn answer_within(&self, clock: &dyn Clock, units: Option<u64>) -> RayFound {
        let now_ns = clock.boottime_ns();
        let end_ns = clock.monotonic_ns().saturating_add(WORK_NS);
        let mut meter = Meter::new(clock, Some(end_ns), units);
        let mut best: Option<(&Near, Cast)> = None;
        let mut open: Vec<(&Near, Cast)> = Vec::new();
        // A body hit within rounding of the first cannot be distinguished from it.
        let mut tied_m = f64::INFINITY;
        for near in &self.near {
            let hit_m = best.map_or(f64::INFINITY, |(_, cast)| cast.hit_m);
            if near.enter_m > hit_m {
                break;
            }
            let cast = self.cast(near, hit_m, &mut meter);
            if cast.hit_m.is_finite() {
                tied_m = tied_m.min(cast.free_m);
            } else if !cast.misses {
                open.push((near, cast));
            }
            if cast.hit_m < hit_m {
                best = Some((near, cast));
            }
        }
        let mut found = self.found.clone();
        let hit_m = best.map_or(f64::INFINITY, |(_, cast)| cast.hit_m);
        let open_m = open.iter().map(|(_, cast)| cast.free_m);
        let open_m = open_m.fold(tied_m, f64::min);
        open.retain(|(_, cast)| cast.free_m < hit_m - 8.0 * self.slop_m(hit_m.min(self.max_m)));
        if hit_m < self.left_out_from_m {
            found.left_out = 0;
        }
        found.possible = open
            .iter()
            .map(|(near, _)| near.body.name.clone())
            .collect();
        found.complete &= found.left_out == 0 && open.is_empty();
        found.t_min_m = self.max_m.min(open_m).min(self.left_out_from_m);
        let none_left = open.is_empty() && found.left_out == 0 && found.unknown.is_empty();
        found.verdict = match (&best, none_left) {
            (Some(_), _) => Verdict::Colliding,
            (None, true) => Verdict::Apart,
            (None, false) => Verdict::Possible,
        }
        .code();
        if let Some((near, cast)) = best {
            self.tell_hit(near, &cast, now_ns, clock, &mut found);
        }
        found
    }

    fn tell_hit(
        &self,
        near: &Near,
        cast: &Cast,
        now_ns: u64,
        clock: &dyn Clock,
        found: &mut RayFound,
    ) {
        // The depth of a piece in a round shape is known to some 1e-8 of its size, its point of touch to some 1e-12.
        let end_m = cast.hit_m.min(cast.until_m).max(cast.free_m);
        let at_m = cast.free_m + (end_m - cast.free_m) / 2.0;
        found.body = Some(near.body.name.clone());
        found.t_max_m = Some(cast.hit_m);
        found.t_best_m = Some(at_m);
        found.inside = cast.inside;
        found.point = Some((self.from + self.direction * at_m).coords.into());
        found.age_ns = age_ns(&near.body, now_ns);
        if cast.inside {
            return;
        }
        let size_m = near.body.radius;
        let off_m = if size_m.is_finite() {
            STAND_OFF * size_m
        } else {
            STAND_OFF_M
        };
        let before_m = (cast.free_m - off_m.max(1e4 * self.slop_m(at_m))).max(0.0);
        let probe = self.piece(before_m, before_m);
        // A little more work, regardless of how much the rest took.
        let mut meter = Meter::new(clock, None, Some(100_000));
        let seen = Measured::of(&probe, &near.body, 0.0, &mut meter);
        // For a surface that the ray begins on, the query may report either side.
        found.normal = seen.normal.map(|normal| {
            let towards = Vec3::from(normal);
            let is_ahead = towards.dot(&self.direction) >= 0.0 || before_m > 0.0;
            (if is_ahead { -towards } else { towards }).into()
        });
        found.shape = seen.place_b.map(|(shape, _)| shape);
        let triangle = seen.place_b.map(|(_, triangle)| triangle);
        found.triangle = triangle.filter(|place| *place != NO_INDEX);
    }

    /// Closes in on the first hit of one body, no farther than `most_m`.
    fn cast(&self, near: &Near, most_m: f64, meter: &mut Meter<'_>) -> Cast {
        let end_m = near.leave_m.min(most_m);
        let mut cast = Cast {
            free_m: near.enter_m,
            hit_m: f64::INFINITY,
            touch_m: f64::INFINITY,
            until_m: end_m,
            inside: false,
            misses: false,
        };
        if cast.free_m <= 0.0 {
            let start = self.look(near, 0.0, 0.0, meter);
            if start.verdict == Verdict::Colliding {
                (cast.free_m, cast.hit_m, cast.inside) = (0.0, 0.0, !start.touching);
                return cast;
            }
            if end_m <= 0.0 {
                // There is no piece to test.
                cast.misses = start.gap.min > 0.0;
                return cast;
            }
        }
        let mut whole = true;
        for _ in 0..LOOKS_MAX {
            if cast.free_m >= cast.touch_m {
                // Finer tests found no touch there.
                cast.touch_m = f64::INFINITY;
            }
            let last_m = end_m.min(cast.hit_m).min(cast.touch_m);
            if cast.free_m >= cast.until_m {
                if cast.until_m >= last_m {
                    // Each piece is free, so the whole is.
                    cast.misses = cast.hit_m == f64::INFINITY;
                    break;
                }
                cast.until_m = last_m;
                // A piece too short to be halved is tested as it is.
                whole = last_m - cast.free_m <= 4.0 * self.slop_m(last_m);
            }
            let until_m = cast.until_m;
            if until_m - cast.free_m <= 4.0 * self.slop_m(until_m) && !whole || !meter.open() {
                break;
            }
            let middle_m = if whole {
                until_m
            } else {
                cast.free_m + (until_m - cast.free_m) / 2.0
            };
            whole = false;
            let seen = self.look(near, cast.free_m, middle_m, meter);
            let slop_m = self.slop_m(middle_m);
            if seen.gap.min > slop_m {
                cast.free_m = middle_m + (seen.gap.min - slop_m).next_down();
                continue;
            }
            cast.until_m = middle_m;
            // A piece only within rounding of a touch may still be in front of it.
            if seen.gap.max <= 0.0 || self.is_hit(near, cast.free_m, middle_m, meter) {
                cast.hit_m = middle_m;
            } else if seen.touching || seen.gap.max <= 2.0 * slop_m {
                cast.touch_m = middle_m;
            }
        }
        // A grazing ray touches, and touching counts as a hit: but not if that was found only on a stretch of many
        // pieces, each within the rounding of its far end.
        let is_closed = cast.until_m - cast.free_m <= 4.0 * self.slop_m(cast.until_m);
        if cast.hit_m.is_infinite() && !cast.misses && is_closed && cast.touch_m <= cast.until_m {
            cast.hit_m = cast.touch_m;
        }
        cast.free_m = cast.free_m.min(cast.hit_m);
        cast
    }

    /// Whether a ray that is free up to `free_m` certainly hits by `to_m`: it is within the body then, or a piece that
    /// begins well in front crosses the surface. One that begins at the surface may only touch it, within rounding.
    fn is_hit(&self, near: &Near, free_m: f64, to_m: f64, meter: &mut Meter<'_>) -> bool {
        let before_m = (2.0 * free_m - to_m).max(0.0);
        let mut proves = |from_m| self.look(near, from_m, to_m, meter).gap.max <= 0.0;
        proves(to_m) || before_m < free_m && proves(before_m)
    }

    fn look(&self, near: &Near, from_m: f64, to_m: f64, meter: &mut Meter<'_>) -> Measured {
        Measured::of(&self.piece(from_m, to_m), &near.body, 0.0, meter)
    }

    /// How far rounding may displace a piece of the ray that ends there, metres.
    fn slop_m(&self, to_m: f64) -> f64 {
        64.0 * ROUND * (self.from.coords.amax() + to_m)
    }

    /// A piece of the ray as a body: a segment without thickness, or a point.
    fn piece(&self, from_m: f64, to_m: f64) -> Body {
        let half_m = (to_m - from_m) / 2.0;
        let centre = self.from + self.direction * (from_m + half_m);
        let convex = if half_m > 0.0 {
            Convex::capsule(0.0, half_m)
        } else {
            Convex::sphere(0.0)
        };
        let parts = Parts::from([PlacedShape {
            shape: Arc::new(Shape::of_convex(convex)),
            pose: Pose::identity(),
        }]);
        Body::of_shapes(parts, &Pose::from_parts(centre.coords.into(), self.turn))
    }
}

/// A rotation that lays the z axis along a line, in either direction: a piece of a ray has no front.
///
/// By the half angle: an angle computed from a cosine is inaccurate near 0 and near pi.
fn turn_of_axis(line: &Vec3) -> Quat {
    let up = if line.z < 0.0 { -line } else { *line };
    Quat::new_normalize(Quaternion::new(1.0 + up.z, -up.y, up.x, 0.0))
}
