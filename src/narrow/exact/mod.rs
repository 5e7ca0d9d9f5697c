//! Exact queries of convex pairs, each with a certified interval.
//!
//! In: two [`Convex`], the pose of B seen from A (f64, from `math::relative`), a warm start. Out: [`Closest`] and
//! [`Manifold`] in A's frame.
//!
//! How: shapes are cores with a ball rolled around them, and the gap of the shapes is that of the cores minus both
//! radii, so all work is on cores. Every core is the hull of vertices and circles.
//! * Point and segment pairs, and a point against anything, have closed forms (`closed`).
//! * Two boxes try their separating axes (`sat`) first.
//! * Otherwise GJK (`gjk`) finds the closest features, or that the cores overlap. For the least translation an
//!   expanding polytope (`epa`) follows, or planes through an axis if two axes nearly agree (`revolved`) or one core is
//!   too close to the axis of a round one for the rim to matter (`sectors`).
//! * Slivers apart by less than the rounding of those methods are separated by planes along their edges (`part`), and
//!   curved pairs apart by less than these end at by cutting planes (`cuts`).
//! * With circles, both stop early and a Newton method on the features (`newton`) finishes: it finds the normal that
//!   maximises `f`, outside and inside alike. It starts from the features of the last answer. If these overlap, the
//!   polytope begins around its closest point, without GJK, or under a cap of directions that the features prove to be
//!   no better, which replaces its finest faces.
//! * For a pair that is queried in every tick the polytope's whole surface is kept ([`Shell`]); at the next poses it
//!   usually proves the depth as it is.
//!
//! The certificate: for every unit `n`, `f(n) = -(s_A(n) + s_B(-n))` is a lower bound on the gap, so the lower end is
//! `f` at the best normal, however it was found. The upper end is the distance of two points that are convex
//! combinations of points of the shapes, or minus the radius of a ball that fits into a polytope inscribed in the
//! Minkowski difference, or into the difference as its features prove within a cap. Both are widened by `Pair::pad`,
//! which covers every rounding from the quaternion on.
//!
//! Refused: parry's own queries on this path. Their tolerances are absolute (the answer depends on the unit of
//! length), coincident shapes come back with depth 0, and curved pairs stop at 1e-7; here every tolerance is a
//! multiple of the pair's size, so nothing is scaled or cached and no copy of a hull is kept.

mod closed;
mod cuts;
mod epa;
mod feature;
mod gjk;
mod manifold;
mod newton;
mod pair;
mod part;
mod polytope;
pub mod raw;
mod revolved;
mod sat;
mod sectors;
mod simplex;

use crate::math::{Interval, Point, Pose, Vec3};
use crate::shape::Convex;

pub use manifold::{Manifold, ManifoldPoint, manifold};
pub(in crate::narrow) use manifold::{
    PREDICTION, points_on_plane, shared_by_triangles, shared_points, touching_points,
};

use newton::Refined;
use pair::{CoreGap, Held, Pair};
pub use polytope::Shell;

/// Warm start of one shape pair: the last normal and its features. The default knows nothing.
#[derive(Clone, Copy, Default, Debug)]
pub struct Warm {
    /// Unit, A's frame; zero when nothing is known.
    normal: Vec3,
    /// Ids only: one that the shape does not have is skipped, so a warm start of another shape only costs time.
    held: Held,
}

const _: () = assert!(size_of::<Warm>() <= 64, "one is kept for every pair");

/// The result of an exact query, in A's frame.
#[derive(Clone, Copy, Debug)]
pub struct Closest {
    /// Certified interval of the gap, metres: distance, or minus the least translation that separates.
    pub gap: Interval,
    /// Best estimate of the gap, metres; within `gap`.
    pub best_m: f64,
    /// Unit, from A to B: moving B along it by `-best_m` makes an overlapping pair touch.
    pub normal: Vec3,
    /// On the surface of A; the closest point when apart, the deepest one when overlapping.
    pub point_a: Point,
    /// On the surface of B; `point_b - point_a = best_m * normal`.
    pub point_b: Point,
    /// Whether the interval is as narrow as the method can make it. It is sound in any case.
    pub finished: bool,
}

impl Closest {
    /// Nothing is known: for a pose that is not finite.
    #[must_use]
    pub fn unknown() -> Self {
        Self {
            gap: Interval::UNKNOWN,
            best_m: 0.0,
            normal: Vec3::z(),
            point_a: Point::origin(),
            point_b: Point::origin(),
            finished: false,
        }
    }

    /// Whether the pair collides: proved, or finished with 0 within the rounding (touching collides).
    #[must_use]
    pub fn collides(&self) -> bool {
        self.gap.max <= 0.0 || (self.finished && self.gap.min <= 0.0)
    }

    /// The same answer with A and B exchanged; still in the same frame.
    #[must_use]
    pub fn swapped(&self) -> Self {
        Self {
            normal: -self.normal,
            point_a: self.point_b,
            point_b: self.point_a,
            ..*self
        }
    }
}

/// Width up to which an interval counts as finished, as a share of the pair's size (radii of both shapes and the
/// distance of their middles). Curved pairs that overlap end at 1e-7, all others near 1e-14 of their coordinates'
/// magnitude.
const FINISHED: f64 = 1e-6;
/// The same in multiples of the rounding allowance, twice of which is in every interval: a hull with coordinates far
/// from its origin may be smaller than their rounding.
const FINISHED_PADS: f64 = 16.0;

/// The gap of two convex shapes, with its certificate.
///
/// * `pos12` - pose of `b` seen from `a`, a unit quaternion, finite.
/// * `warm` - kept by the caller for this pair; changes only the time taken (and the last bits).
/// * returns - see [`Closest`]; `unknown` when `pos12` is not finite.
///
/// Cost: 20 ns (spheres) to some 5 us (overlapping cylinders), up to 50 us deep near the axis of a round one, bounded
/// by the faces that a polytope may grow and the points that sectors may ask; no allocation after a thread's first
/// calls.
#[must_use]
pub fn convex_gap(a: &Convex, b: &Convex, pos12: &Pose, warm: &mut Warm) -> Closest {
    gap(a, b, pos12, warm, None)
}

/// As [`convex_gap`], for a pair that is queried in every tick: if curved cores or hulls overlap and move by 0.1 % of
/// their size from query to query it takes about half the time, at 1 % three quarters.
///
/// * `shell` - kept by the caller for this pair, as `warm` is: any is sound, an empty one will do. It is filled if the
///   pair overlaps and a polytope finds the depth, and emptied otherwise.
#[must_use]
pub fn convex_gap_along(
    a: &Convex,
    b: &Convex,
    pos12: &Pose,
    warm: &mut Warm,
    shell: &mut Shell,
) -> Closest {
    shell.used = false;
    let closest = gap(a, b, pos12, warm, Some(shell));
    if !shell.used {
        shell.clear();
    }
    closest
}

fn gap(
    a: &Convex,
    b: &Convex,
    pos12: &Pose,
    warm: &mut Warm,
    shell: Option<&mut Shell>,
) -> Closest {
    let pair = Pair::new(a, b, pos12);
    if !pair.scale.is_finite() {
        return Closest::unknown();
    }
    // Closed forms need no warm start, and leave none.
    if let Some(core) = closed::gap(&pair) {
        return finish(&pair, &core, core.along());
    }
    let core = part::part(&pair, iterate(&pair, warm, shell));
    let core = separate(&pair, core);
    *warm = Warm {
        normal: core.normal,
        held: core.held,
    };
    // If a whole arc of directions is as good as the best, a polytope does not converge, and the points of its faces
    // are off by as much as its own end: then the other end is the nearer one.
    let estimate = if core.upper < -pair.tiny() {
        core.lower
    } else {
        core.along()
    };
    finish(&pair, &core, estimate)
}

/// GJK, and what follows from its verdict.
fn iterate(pair: &Pair<'_>, warm: &Warm, mut shell: Option<&mut Shell>) -> CoreGap {
    let start = if warm.normal == Vec3::zeros() {
        pair.guess()
    } else {
        warm.normal
    };
    let start = match sat::boxes(pair) {
        Some(sat::Axes::Overlap(gap)) => return gap,
        Some(sat::Axes::Apart(normal)) => normal,
        None => start,
    };
    // The features of the last answer are usually those of this one.
    let refined = if pair.polytopes {
        if let Some(gap) = epa::depth_at(pair, &warm.held, &start, shell.as_deref_mut()) {
            return gap;
        }
        None
    } else {
        newton::resume(pair, &warm.held, &start)
    };
    let mut known = None;
    if let Some(found) = refined.as_ref().filter(|r| r.value < -pair.tiny()) {
        known = around(pair, Some(found));
        let told = known.filter(|gap| gap.is_tight(pair));
        if let Some(gap) = told.or_else(|| epa::depth_around(pair, found, shell)) {
            return gap;
        }
    }
    match gjk::distance(pair, &start, &warm.held, refined.as_ref()) {
        gjk::Outcome::Apart(gap) => gap,
        gjk::Outcome::Overlap(simplex, touch) => {
            let gap = match known.or_else(|| around(pair, None)) {
                Some(gap) if gap.is_tight(pair) => return gap,
                Some(gap) => gjk::better(&gap, &epa::depth(pair, &simplex, refined)),
                None => epa::depth(pair, &simplex, refined),
            };
            // A polytope that only touches the origin may break before it has any result: they touch all the same.
            if touch.upper < gap.upper {
                CoreGap {
                    held: gap.held,
                    ..gjk::better(&gap, &touch)
                }
            } else {
                gap
            }
        }
    }
}

/// By planes through an axis, if that takes less time than a polytope.
fn around(pair: &Pair<'_>, warm: Option<&Refined>) -> Option<CoreGap> {
    let gap = revolved::gap(pair, warm);
    if gap.is_some_and(|gap| gap.is_tight(pair)) {
        return gap;
    }
    match (gap, sectors::narrow_gap(pair, warm)) {
        (Some(one), Some(other)) => Some(one.meet(&other, pair)),
        (one, other) => one.or(other),
    }
}

/// Separates a pair whose gap would count as touching, though its interval is wider than rounding, if that is possible.
fn separate(pair: &Pair<'_>, core: CoreGap) -> CoreGap {
    let margins = pair.a.margin() + pair.b.margin();
    let pad = rounding_of(pair, margins);
    let is_touch = core.lower - margins <= pad && core.upper - margins > -pad;
    if is_touch && core.upper - core.lower > FINISHED_PADS * pad {
        cuts::separate(pair, core, margins, pad)
    } else {
        core
    }
}

/// By how much each end of an interval is moved outward, metres.
fn rounding_of(pair: &Pair<'_>, margins: f64) -> f64 {
    pair.pad() + 4.0 * f64::EPSILON * margins
}

/// From the gap of the cores, with its estimate, to that of the shapes.
fn finish(pair: &Pair<'_>, core: &CoreGap, estimate: f64) -> Closest {
    let (ra, rb) = (pair.a.margin(), pair.b.margin());
    let margins = ra + rb;
    let pad = rounding_of(pair, margins);
    let low = (core.lower - margins - pad).next_down();
    let high = (core.upper - margins + pad).next_up().max(low);
    let best_m = (estimate - margins).clamp(low, high);
    // Opposite each other; where a method ends at 1e-7 the points are moved by as much.
    let middle = (core.point_a + core.point_b) / 2.0;
    let half = core.normal * ((best_m + margins) / 2.0);
    let (core_a, core_b) = (middle - half, middle + half);
    Closest {
        gap: Interval::new(low, high),
        best_m,
        normal: core.normal,
        point_a: Point::from(core_a + core.normal * ra),
        point_b: Point::from(core_b - core.normal * rb),
        finished: high - low <= FINISHED_PADS * pad
            || high - low <= FINISHED * (pair.size() + margins),
    }
}

/// The gap of a half-space A (`normal . x <= offset`) and a convex shape.
///
/// * `normal`, `offset_m` - A's own frame; `normal` is a unit vector.
/// * `pos12` - pose of `b` seen from the half-space.
/// * returns - `normal` of the answer is that of the half-space.
#[must_use]
pub fn half_space_gap(normal: &Vec3, offset_m: f64, b: &Convex, pos12: &Pose) -> Closest {
    let inward = pos12.rotation.inverse() * -normal;
    let deepest = pos12.rotation * b.support(&inward).coords + pos12.translation.vector;
    let gap_m = normal.dot(&deepest) - offset_m;
    if !gap_m.is_finite() {
        return Closest::unknown();
    }
    let scale = b.reach() + b.margin() + pos12.translation.vector.norm() + offset_m.abs();
    let pad = 32.0 * f64::EPSILON * scale;
    Closest {
        gap: Interval::new((gap_m - pad).next_down(), (gap_m + pad).next_up()),
        best_m: gap_m,
        normal: *normal,
        point_a: Point::from(deepest - normal * gap_m),
        point_b: Point::from(deepest),
        finished: true,
    }
}

/// The gap of a convex shape A and a half-space B (`normal . x <= offset` in B's frame): [`half_space_gap`] seen from
/// the other side, in A's frame.
#[must_use]
pub fn gap_to_half_space(a: &Convex, normal: &Vec3, offset_m: f64, pos12: &Pose) -> Closest {
    let outward = pos12.rotation * normal;
    let offset_in_a = offset_m + outward.dot(&pos12.translation.vector);
    let deepest = a.support(&-outward).coords;
    let gap_m = outward.dot(&deepest) - offset_in_a;
    if !gap_m.is_finite() {
        return Closest::unknown();
    }
    let scale = a.reach() + a.margin() + pos12.translation.vector.norm() + offset_m.abs();
    let pad = 32.0 * f64::EPSILON * scale;
    Closest {
        gap: Interval::new((gap_m - pad).next_down(), (gap_m + pad).next_up()),
        best_m: gap_m,
        normal: -outward,
        point_a: Point::from(deepest),
        point_b: Point::from(deepest - outward * gap_m),
        finished: true,
    }
}
