//! Approximate contacts: where a pair may touch, when there was no time to find out or to find all of it.
//!
//! In: what a pair holds when work stops. Out: at most [`limits::REGIONS_PER_PAIR_MAX`] spheres, each with a cone of
//! normals and a best guess of point, normal and depth, good enough to drive a response. What is claimed:
//! - their union holds every point that the two share at this tick's poses. Of a mesh its surface counts, of a convex
//!   shape or half-space its inside too; of a surface that lies within the other as a whole all of it;
//! - of a pair whose contacts are complete the union also holds both points of each contact; of two convex shapes that
//!   is then all it holds;
//! - the cone holds the outward normals of every face of A and the inward ones of every face of B that may meet in the
//!   sphere, with the arcs between neighbours; of a complete pair also its contacts' normals. What a manifold finds
//!   later is mostly in it, not surely: it may be the normal of two edges, or of faces beside the sphere, for its
//!   points lie deeper than what is shared. Measured (`benches/time_critical`, meshes of 19,880 triangles): 99.4 to
//!   100 % of them, 98.6 % at the worst share of the work of pairs that overlap by a fifth;
//! - of a pair with a body of unknown place: the boxes, no more. Of one that is not known to collide, but may have
//!   touched on the way to these poses, too.
//!
//! How: every pair of boxes of a front that is not proved apart at these poses, or the roots where there is no front,
//! is cut down to what the two boxes share; the largest are split by a few tests of their own, down to triangles cut by
//! triangles; then a few spheres are put round all (`gather`). Boxes are of the bodies, so that an old front serves at
//! new poses: only its proofs are shorter by the motion since. So work narrows the regions, motion widens them, and a
//! pair that was never worked on has them too.
//!
//! Splitting is the last work of the budget, counted like any other (`refine`). Publishing does no test: it copies what
//! splitting has made at these poses, or looks at a few boxes of the front, or at the roots alone. Nothing of it runs
//! while nobody listens.
//!
//! Source: Dingliana and O'Sullivan 2000, Graceful degradation of collision handling in physically based animation
//! (RTR3 section 17.6.1): when time runs out, respond from the level reached. There the level is of spheres, and their
//! union is not sure to hold the contact.

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

/// Contacts found by now that guesses are made of; more of a pair are passed over.
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
    /// There was more than was looked at: one region stands for the rest.
    pub clipped: bool,
    /// How far work came; `Boxes`: no more than the bodies' boxes is behind them.
    pub level: Level,
}

/// Memory kept from pair to pair.
#[derive(Debug, Default)]
pub(super) struct Approx {
    /// Of the shape pair at hand, in the order of its front, then by size.
    raw: Vec<Spot>,
    heap: BinaryHeap<Spot>,
    waiting: Waiting,
    /// Places of the shape pairs that may touch.
    near: Vec<(u32, u32)>,
    /// Of the body pair, A's body frame.
    all: Vec<Spot>,
    /// Contacts found by now of a pair that is not finished: for the guesses, not for the spheres.
    found: Vec<Spot>,
    balls: Vec<Ball>,
    regions: Vec<Region>,
    clipped: bool,
}

/// How a pair stands when its regions are asked for.
struct Standing<'a> {
    a: &'a Body,
    b: &'a Body,
    finding: Finding<'a>,
    /// Both are where their poses say: what they share now is told.
    placed: bool,
    /// Its contacts are exact at these poses.
    complete: bool,
}

/// Where regions were made, and of what.
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
    /// With room for all that it will hold: a later peak allocates nothing.
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
    /// Where a pair may touch; `None` for one that is proved apart at this tick's poses and on the way to them. No test
    /// is done for it.
    ///
    /// * `looks` - pairs of boxes of one shape pair that may be looked at, where splitting has made nothing that holds;
    ///   where there are more, only the roots are.
    ///
    /// Cost: some 0.5 us a look and 5 us for the rest; next to nothing of a pair that was split at these poses, or is
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
        // On the way it may have touched anywhere: of one that collides now, what it shares now is told.
        let placed = open && at_pose(a) && at_pose(b) && (collides || !swept);
        Some(Standing {
            a,
            b,
            placed,
            complete: placed && collides && current && !contacts.is_empty(),
            finding,
        })
    }

    /// Makes the regions of a pair that is where its poses say; what was made before the pace was cut is not all.
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

    /// Puts a few spheres round all spots, with a guess in each.
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

/// What the boxes of two bodies share, reach and way included, A's body frame.
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

/// What is guessed of a pair as a whole, A's body frame.
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
            // Between nothing and all that is possible.
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
    /// The same with other normals.
    fn of_normals(self, cone: Cone) -> Self {
        Self { cone, ..self }
    }

    /// The same, of which no normal is known.
    fn of_any_normal(self) -> Self {
        self.of_normals(Cone::every(Vec3::zeros()))
    }

    /// An aligned box as an oriented one at a pose.
    fn placed(obb: &Obb, pose: &Pose) -> Obb {
        Obb {
            centre: pose * obb.centre,
            axes: pose.rotation.to_rotation_matrix().matrix() * obb.axes,
            half: obb.half,
        }
    }
}
