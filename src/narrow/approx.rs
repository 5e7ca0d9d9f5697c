//! Approximate contacts: where a pair may touch, when time ran out before that was decided or all contacts were found.
//!
//! In: what a pair holds when work stops. Out: at most [`limits::REGIONS_PER_PAIR_MAX`] spheres, each with a cone of
//! normals and a best guess of point, normal and depth, good enough to drive a response. The claims:
//! - the union of the spheres holds every point that the two share at this tick's poses. A mesh counts as its surface,
//!   a convex shape or half-space as a solid; of a surface that lies entirely within the other body, all points count;
//! - if the pair's contacts are complete, the union also holds both points of each contact; for two convex shapes it
//!   then holds nothing else;
//! - the cone holds the outward normals of every face of A and the inward normals of every face of B that may meet in
//!   the sphere, with the arcs between neighbours; for a complete pair also its contacts' normals. Normals that a
//!   manifold finds later are mostly, but not surely, in it: they may be the normal of two edges, or of faces outside
//!   the sphere, for its points lie deeper than the shared ones. Measured: 95.4 to 100 % of them (`benches/README.md`,
//!   Approximate contacts);
//! - for a pair with a body of unknown place, the spheres cover only what the boxes share. The same for a pair that is
//!   not known to collide but may have touched on the way to these poses.
//!
//! How: every pair of boxes of a front that is not proved apart at these poses (without a front: the roots) is cut down
//! to what the two boxes share. The largest are split by a few tests of their own, down to triangles cut by triangles;
//! then a few spheres enclose them all (`gather`). Boxes are in body frames, so an old front serves at new poses: its
//! proofs are only shorter by the motion since. So work narrows the regions, motion widens them, and a pair that was
//! never worked on has regions too.
//!
//! Splitting is the last item of the budget and counted like any other (`refine`). Publishing does no test: it copies
//! what splitting made at these poses, or reads a few boxes of the front, or the roots alone. Without listeners none of
//! this runs.
//!
//! Source: Dingliana and O'Sullivan 2000, Graceful degradation of collision handling in physically based animation
//! (RTR3 section 17.6.1): when time runs out, respond from the level reached. Their levels are spheres, whose union is
//! not sure to hold the contact.

mod collect;
mod gather;
mod pace;
mod refine;
mod spot;

use std::collections::BinaryHeap;

use crate::ids::PairSlot;
use crate::limits;
use crate::math::{Point, Pose, ROUND, Vec3, relative};
use crate::shape::{Cone, Obb};
use crate::wire::{BodyStatus, Level, Verdict};
use crate::world::{Body, World};

use super::Narrow;
use super::bent::Bent;
use super::compound::Waiting;
use super::finding::Finding;
use super::sweep::Passage;

use gather::{Ball, SPOTS_MAX, cut, gather};
use pace::Pace;
pub(super) use refine::Kept;
pub(in crate::narrow) use spot::{Slab, Spot};

/// At most this many contacts of an unfinished pair are used for guesses; the rest is ignored.
const FOUND_MAX: usize = 32;

/// A place where two bodies may touch, A's body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Centre of the sphere.
    pub centre: Point,
    /// Its radius, metres; infinite where nothing is known.
    pub radius_m: f64,
    /// Unit: axis of the cone of normals, A to B.
    pub axis: Vec3,
    /// Half angle of that cone, radians; pi: any direction.
    pub half_angle_rad: f64,
    /// Best guess of a point of contact.
    pub point: Point,
    /// Best guess of the normal there, unit, A to B.
    pub normal: Vec3,
    /// Best guess of the depth there, metres, not below 0.
    pub depth_m: f64,
}

/// The regions of a pair.
#[derive(Clone, Copy, Debug)]
pub struct Regions<'a> {
    /// At most [`limits::REGIONS_PER_PAIR_MAX`].
    pub all: &'a [Region],
    /// The pair's contacts are exact at these poses, and all of them lie in these.
    pub complete: bool,
    /// There were more candidates than were looked at: one region stands for the rest.
    pub clipped: bool,
    /// How far work got; `Boxes`: the regions rest on the bodies' boxes alone.
    pub level: Level,
}

/// Memory reused from pair to pair.
#[derive(Debug, Default)]
pub(super) struct Approx {
    /// Spots of the current shape pair, in the order of its front, then by size.
    raw: Vec<Spot>,
    heap: BinaryHeap<Spot>,
    waiting: Waiting,
    /// Indices of the shape pairs that may touch.
    near: Vec<(u32, u32)>,
    /// Spots of the body pair, A's body frame.
    all: Vec<Spot>,
    /// Contacts found so far of a pair that is not finished: for the guesses, not for the spheres.
    found: Vec<Spot>,
    balls: Vec<Ball>,
    regions: Vec<Region>,
    clipped: bool,
}

/// State of a pair when its regions are requested.
struct Standing<'a> {
    a: &'a Body,
    b: &'a Body,
    finding: Finding<'a>,
    /// Both bodies are where their poses say, so the regions cover what they share now.
    placed: bool,
    /// Its contacts are exact at these poses.
    complete: bool,
}

/// The poses and deformation for which regions were made.
#[derive(Clone, Copy, Debug)]
struct Place {
    rel: Pose,
    bent: Bent,
    complete: bool,
}

impl Standing<'_> {
    fn place(&self) -> Place {
        Place {
            rel: relative(&self.a.pose, &self.b.pose),
            bent: Bent::of_bodies(self.a, self.b),
            complete: self.complete,
        }
    }
}

impl Approx {
    /// Clears it and reserves its full capacity: a later peak allocates nothing.
    fn ready(&mut self) {
        self.raw.clear();
        self.raw.reserve(SPOTS_MAX);
        self.heap.clear();
        // A split adds up to eight.
        self.heap.reserve(SPOTS_MAX + 8);
        self.all.clear();
        self.all.reserve(SPOTS_MAX);
        self.found.clear();
        self.found.reserve(FOUND_MAX);
        self.balls.clear();
        self.balls.reserve(limits::REGIONS_PER_PAIR_MAX);
        self.regions.clear();
        self.regions.reserve(limits::REGIONS_PER_PAIR_MAX);
        self.clipped = false;
    }
}

impl Narrow {
    /// Where a pair may touch; `None` for one that is proved apart at this tick's poses and on the way to them. Runs no
    /// test.
    ///
    /// * `looks` - how many pairs of boxes of one shape pair may be read where splitting has left no valid result; if
    ///   there are more, only the roots are read.
    ///
    /// Cost: some 0.5 us a look and 5 us for the rest; next to nothing for a pair that was split at these poses, or is
    /// complete and has not moved since. No allocation after the first.
    pub fn regions(&mut self, slot: PairSlot, world: &World, looks: usize) -> Option<Regions<'_>> {
        let mut approx = std::mem::take(&mut self.approx);
        approx.ready();
        let found = self.copy_or_find(slot, world, looks, &mut approx);
        self.approx = approx;
        let (complete, level) = found?;
        Some(Regions {
            all: &self.approx.regions,
            complete,
            clipped: self.approx.clipped,
            level,
        })
    }

    fn copy_or_find(
        &mut self,
        slot: PairSlot,
        world: &World,
        looks: usize,
        approx: &mut Approx,
    ) -> Option<(bool, Level)> {
        let of = self.standing(slot, world)?;
        let level = of.finding.level;
        if !of.placed {
            approx.all.push(boxes(of.a, of.b));
            Self::round_up(&of, approx);
            return Some((false, Level::Boxes));
        }
        if let Some(kept) = self.kept_regions(slot, &of.place()) {
            approx.regions.extend_from_slice(&kept.all);
            approx.clipped = kept.clipped;
            return Some((kept.complete, level));
        }
        self.find_regions(slot, &of, &mut Pace::coarse(looks), approx);
        let place = of.place();
        if place.complete {
            self.keep_regions(slot, &place, approx, None);
        }
        Some((place.complete, level))
    }

    /// `None` for a pair that is proved apart at this tick's poses and on the way to them.
    fn standing<'a>(&'a self, slot: PairSlot, world: &'a World) -> Option<Standing<'a>> {
        let finding = self.finding(slot)?;
        let (a, b) = (world.body(finding.a)?, world.body(finding.b)?);
        let open = matches!(finding.verdict, Verdict::Possible | Verdict::Colliding);
        let way = self.passage(slot).map(|swept| swept.passage);
        let swept = !matches!(way, None | Some(Passage::Free));
        if !open && !swept {
            return None;
        }
        let (contacts, tick) = self.contacts(slot);
        let current = finding.level == Level::Exact && tick >= finding.tested;
        let collides = finding.verdict == Verdict::Colliding;
        // On the way it may have touched anywhere; if it collides now, report what it shares now.
        let placed = open && at_pose(a) && at_pose(b) && (collides || !swept);
        Some(Standing {
            a,
            b,
            placed,
            complete: placed && collides && current && !contacts.is_empty(),
            finding,
        })
    }

    /// Makes the regions of a pair that is where its poses say; incomplete if the pace was cut.
    fn find_regions(
        &self,
        slot: PairSlot,
        of: &Standing<'_>,
        pace: &mut Pace<'_, '_>,
        approx: &mut Approx,
    ) {
        self.collect(slot, of, pace, approx);
        if !pace.cut {
            Self::round_up(of, approx);
        }
    }

    /// Encloses all spots in a few spheres, each with a guess.
    fn round_up(of: &Standing<'_>, approx: &mut Approx) {
        cut(&mut approx.all);
        gather(&mut approx.all, &mut approx.balls);
        let guess = Guess::of(&of.finding, of.a, of.b);
        for ball in &approx.balls {
            let spots = &approx.all[ball.from..ball.to];
            approx
                .regions
                .push(guess.region(ball, spots, &approx.found));
        }
    }
}

/// Whether a body is where its pose says.
fn at_pose(body: &Body) -> bool {
    matches!(body.status, BodyStatus::Known | BodyStatus::Held) && body.reach_m == 0.0
}

/// What the boxes of two bodies share, including reach and way, A's body frame.
fn boxes(a: &Body, b: &Body) -> Spot {
    let (low, high) = (a.proxy.min.sup(&b.proxy.min), a.proxy.max.inf(&b.proxy.max));
    let known = (a.reach_m + b.reach_m).is_finite() && (high - low).iter().all(|x| x.is_finite());
    let half = (high - low).map(|x| 0.5 * x.max(0.0));
    let centre = if known {
        nalgebra::center(&low, &high)
    } else {
        nalgebra::center(&(a.pose * a.centre), &(b.pose * b.centre))
    };
    let size = centre.coords.norm() + a.pose.translation.vector.norm() + half.norm();
    let radius_m = if known {
        half.norm() + 16.0 * ROUND * size
    } else {
        f64::INFINITY
    };
    Spot {
        centre: a.pose.inverse_transform_point(&centre),
        radius_m,
        across_m: radius_m,
        ..Spot::found(&centre, &centre, Vec3::zeros(), f64::NAN)
    }
    .of_any_normal()
}

/// Guesses for a pair as a whole, A's body frame.
struct Guess {
    normal: Vec3,
    depth_m: f64,
    /// No contact is deeper, metres.
    deepest_m: f64,
}

impl Guess {
    fn of(finding: &Finding<'_>, a: &Body, b: &Body) -> Self {
        let rel = relative(&a.pose, &b.pose);
        let between = (rel * b.centre - a.centre).try_normalize(0.0);
        let deepest_m = (-finding.gap.min).max(0.0);
        let seen = finding.witness;
        let depth_m = match seen {
            Some(witness) if witness.best_m <= 0.0 => -witness.best_m,
            // Halfway between zero and the deepest possible.
            _ => 0.5 * deepest_m,
        };
        Self {
            normal: (seen.map(|w| w.normal).or(between)).unwrap_or_else(Vec3::z),
            depth_m: depth_m.min(deepest_m),
            deepest_m,
        }
    }

    fn region(&self, ball: &Ball, spots: &[Spot], by_now: &[Spot]) -> Region {
        let cone = Cone::around(spots.iter().map(|spot| spot.cone));
        let axis = cone.axis.try_normalize(0.5).unwrap_or(self.normal);
        let deeper = |x: &&Spot, y: &&Spot| x.depth_m.total_cmp(&y.depth_m);
        let here = |spot: &&Spot| (spot.centre - ball.centre).norm() <= ball.radius_m;
        let found = spots.iter().filter(|spot| !spot.depth_m.is_nan());
        let found = found.chain(by_now.iter().filter(here));
        let (point, normal, depth_m) = match found.max_by(deeper) {
            Some(spot) => (
                spot.centre,
                spot.cone.axis.try_normalize(0.5).unwrap_or(axis),
                spot.depth_m.max(0.0),
            ),
            None => {
                let sum = spots.iter().map(|spot| spot.centre.coords).sum::<Vec3>();
                #[allow(clippy::cast_precision_loss, reason = "a few hundred")]
                let mean = Point::from(sum / spots.len() as f64);
                let from = |spot: &Spot| (spot.centre - mean).norm_squared();
                let nearest = spots.iter().min_by(|x, y| from(x).total_cmp(&from(y)));
                let depth_m = self.depth_m.min(2.0 * ball.radius_m).min(self.deepest_m);
                (nearest.map_or(mean, |spot| spot.centre), axis, depth_m)
            }
        };
        let size = ball.centre.coords.norm() + ball.radius_m;
        Region {
            centre: ball.centre,
            radius_m: ball.radius_m + 16.0 * ROUND * size,
            axis,
            half_angle_rad: cone.half_rad,
            point,
            normal,
            depth_m,
        }
    }
}

impl Spot {
    /// The same spot with other normals.
    fn of_normals(self, cone: Cone) -> Self {
        Self { cone, ..self }
    }

    /// The same spot, with no normal known.
    fn of_any_normal(self) -> Self {
        self.of_normals(Cone::every(Vec3::zeros()))
    }

    /// An aligned box taken to a pose: an oriented one.
    fn placed(obb: &Obb, pose: &Pose) -> Obb {
        Obb {
            centre: pose * obb.centre,
            axes: pose.rotation.to_rotation_matrix().matrix() * obb.axes,
            half: obb.half,
        }
    }
}
