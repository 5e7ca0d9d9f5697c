//! Cores that overlap deep within a cylinder or cone, near its axis: a chip in a drum, a pin in a wide hole.
//!
//! In: a pair of which one core is a cylinder or a cone. Out: the gap of the cores, or `None` if no core is round or
//! nothing is proved.
//!
//! Seen from the axis nearly all directions around it are alike, and an expanding polytope would have to resolve the
//! rim: its error falls with the square of its faces, and ends at a thousandth. But in any plane through the axis the
//! round core shows the same outline, so that only the other core's outline changes with the angle. A sector of planes
//! is proved by a chain of points of the difference, each the sum of a point of the other core and a corner of the
//! outline, from the top down:
//! * A point's place along the plane is a constant plus a sine of the angle, so within the sector it is below the
//!   straight line between its ends by at most what its bend allows: by nothing on the plane's side of the axis.
//! * With places along the plane linear and heights constant, a direction along which two successive points reach `d`
//!   at both ends of the sector does so in between. So does the normal of the line through them if it is `d` away at
//!   both ends: `p x q - d |q - p|` is linear less convex.
//! * Then each point of the chain reaches `d` along the directions shared with either neighbour, so along all between
//!   them; with the first one `d` high and the last one `d` low, these are all directions of the sector's half planes.
//!
//! Sectors are split, at the angle where the other core's farthest corner changes if it does, until all are as deep as
//! the best direction found.

mod answer;
mod chain;

use std::f64::consts::PI;

use super::newton::Refined;
use super::pair::{CoreGap, Pair};
use crate::math::Vec3;
use crate::shape::{Convex, Core};
use chain::{Chain, Flat, Least, Link, along, dot, out};

/// Most sectors visited; what is proved by then is sound, but wider.
const SECTORS_MAX: usize = 512;
/// Most points of a hull visited, some half a millisecond; larger hulls are not processed to the end.
const POINTS_MAX: usize = 500_000;
/// How often a sector queries the farthest point, roughly.
const ASKED: usize = 10;
/// With fewer sectors nothing is proved that a polytope would not prove.
const SECTORS_LEAST: usize = 64;
/// Most sectors that wait.
const WAITING_MAX: usize = 40;
/// Displacement from the axis, and from its orthogonal plane, at which a chain's first points are queried: of equal
/// ones it selects those farther out.
const ASIDE: f64 = 1e-12;
/// Rounding between supports and a chain's bound, in multiples of [`Pair::tiny`].
const ROUNDED: f64 = 4.0;
/// A sector is not split nearer to its ends, as a share of it.
const EDGE: f64 = 1e-3;
/// How far the other core reaches from the axis, as a share of the radius, up to which a polytope takes more time.
const NARROW: f64 = 0.02;

/// The best direction known.
struct Best {
    /// `f(normal)`.
    value: f64,
    normal: Vec3,
    /// Newton's result, if that is the best one.
    refined: Option<Refined>,
    /// The plane that showed it, and the direction in it.
    along: Vec3,
    n: Flat,
}

/// The pair as seen from the round core.
struct Around<'a> {
    pair: &'a Pair<'a>,
    a_is_round: bool,
    /// Corners of its outline, rotated by half a turn about its origin; the upper one is not nearer to the axis.
    corners: [Flat; 2],
}

/// The gap of two overlapping cores of which one is round, if the other stays so close to its axis that a polytope
/// takes more time; its ends may stay apart.
///
/// * `warm` - Newton's result from the features of an earlier answer, if any.
///
/// Cost: mostly 5 to 50 us; with hulls of hundreds of points up to half a millisecond.
pub(super) fn narrow_gap(pair: &Pair<'_>, warm: Option<&Refined>) -> Option<CoreGap> {
    let around = Around::of(pair)?;
    around.is_narrow().then(|| around.gap(warm)).flatten()
}

/// The same for all other such pairs.
pub(super) fn wide_gap(pair: &Pair<'_>, warm: Option<&Refined>) -> Option<CoreGap> {
    let around = Around::of(pair)?;
    (!around.is_narrow()).then(|| around.gap(warm)).flatten()
}

impl<'a> Around<'a> {
    /// Around the core from whose axis the other one reaches less far.
    fn of(pair: &'a Pair<'a>) -> Option<Self> {
        let around = |core: &Core, a_is_round: bool| {
            let corners = match *core {
                Core::Cylinder {
                    radius_m: r,
                    half_m: h,
                } => [[r, h], [r, -h]],
                Core::Cone {
                    radius_m: r,
                    half_m: h,
                } => [[r, h], [0.0, -h]],
                _ => return None,
            };
            Some(Self {
                pair,
                a_is_round,
                corners,
            })
        };
        match (around(pair.a.core(), true), around(pair.b.core(), false)) {
            (Some(one), Some(other)) => {
                let part = |x: &Self| x.breadth() / x.corners[0][0];
                Some(if part(&other) < part(&one) {
                    other
                } else {
                    one
                })
            }
            (one, other) => one.or(other),
        }
    }

    fn is_narrow(&self) -> bool {
        self.breadth() <= NARROW * self.corners[0][0]
    }

    /// Most sectors to visit.
    fn sectors_max(&self) -> usize {
        match self.other().core() {
            Core::Hull(hull) => {
                (POINTS_MAX / (ASKED * hull.points().len().max(1))).min(SECTORS_MAX)
            }
            _ => SECTORS_MAX,
        }
    }

    /// The core that is not the round one.
    fn other(&self) -> &Convex {
        if self.a_is_round {
            self.pair.b
        } else {
            self.pair.a
        }
    }

    /// Upper bound on how far the other core reaches from the axis, metres.
    fn breadth(&self) -> f64 {
        let pair = self.pair;
        let (middle, other) = if self.a_is_round {
            (pair.rotation * pair.b.centre().coords + pair.at, pair.b)
        } else {
            (pair.to_b(&(pair.a.centre().coords - pair.at)), pair.a)
        };
        middle.x.hypot(middle.y) + other.radius() - other.margin()
    }

    /// From A to B, where `out` leads out of the round core, its frame.
    fn normal(&self, out: &Vec3) -> Vec3 {
        if self.a_is_round {
            -out
        } else {
            self.pair.rotation * out
        }
    }

    /// The other core's farthest point along a direction, frame of the round one.
    fn farthest(&self, out: &Vec3) -> Vec3 {
        let pair = self.pair;
        if self.a_is_round {
            let (b, _) = pair.b.core().support(&pair.to_b(out));
            pair.rotation * b + pair.at
        } else {
            let (a, _) = pair.a.core().support(&(pair.rotation * out));
            pair.to_b(&(a - pair.at))
        }
    }

    /// The farthest point along a direction of a plane.
    fn link(&self, along: &Vec3, n: Flat) -> Link {
        let of_other = self.farthest(&out(along, n));
        let [upper, lower] = self.corners;
        let corner = if dot(lower, n) > dot(upper, n) {
            lower
        } else {
            upper
        };
        Link { of_other, corner }
    }

    fn offer(&self, best: &mut Best, along: &Vec3, n: Flat) {
        let normal = self.normal(&out(along, n));
        let value = normal.dot(&self.pair.support(&normal).w);
        if value > best.value {
            (best.value, best.normal, best.refined) = (value, normal, None);
            (best.along, best.n) = (*along, n);
        }
    }

    /// A chain of the farthest points in a plane, as fine as the best known direction requires.
    fn chain(&self, along: &Vec3, best: &mut Best) -> Chain {
        let mut chain = Chain::default();
        for n in [[ASIDE, 1.0], [1.0, ASIDE], [1.0, -ASIDE], [ASIDE, -1.0]] {
            chain.push(self.link(along, n), along);
        }
        loop {
            let least = chain.least(along);
            if least.depth >= -best.value {
                break;
            }
            let link = self.link(along, least.n);
            let reach = dot(least.n, link.at(along));
            if reach < -best.value {
                self.offer(best, along, least.n);
            }
            let farther = reach > least.depth + self.pair.tiny();
            if !farther || !chain.insert(least.place + 1, link) {
                break;
            }
        }
        chain
    }

    fn gap(&self, warm: Option<&Refined>) -> Option<CoreGap> {
        if self.sectors_max() < SECTORS_LEAST {
            return None;
        }
        let mut best = Best {
            value: f64::NEG_INFINITY,
            normal: Vec3::z(),
            refined: None,
            along: Vec3::x(),
            n: [0.0, 1.0],
        };
        for n in [[0.0, 1.0], [0.0, -1.0]] {
            self.offer(&mut best, &Vec3::x(), n);
        }
        if let Some(found) = warm {
            best.take(found, self.pair.tiny());
        }
        let depth = self.prove(&mut best);
        self.refine(&mut best);
        let depth = depth - ROUNDED * self.pair.tiny();
        (depth > 0.0).then(|| self.answer(&best, -depth))
    }

    /// The proved depth, all around.
    fn prove(&self, best: &mut Best) -> f64 {
        let close_m = self.pair.tolerance();
        let most = self.sectors_max();
        let mut waiting = [PI; WAITING_MAX];
        waiting[1..4].copy_from_slice(&[PI / 2.0, 0.0, -PI / 2.0]);
        let (mut count, mut looked_at, mut from) = (4, 4, -PI);
        let mut depth = f64::INFINITY;
        while count > 0 && depth > 0.0 {
            let to = waiting[count - 1];
            let width = to - from;
            let (middle, ends) = (along(from + width / 2.0), [from, to].map(along));
            let before = best.value;
            let chain = self.chain(&middle, best);
            let (least, end) = chain.bound(&middle, &ends, width);
            let mut parting = None;
            if least.depth < -best.value - close_m {
                self.offer(best, &ends[end], least.n);
                parting = Some(&ends[end]);
            }
            if best.value > before + close_m {
                self.refine(best);
            }
            let close = least.depth >= -best.value - close_m;
            match parting {
                // For a hull of many points, a polytope would find all this sooner.
                Some(_) if !close && looked_at == most && most < SECTORS_MAX => return 0.0,
                Some(at) if !close && looked_at < most && count < WAITING_MAX => {
                    waiting[count] = self.change(&chain, &least, at, (from, to));
                    count += 1;
                    looked_at += 1;
                }
                _ => {
                    depth = depth.min(least.depth);
                    from = to;
                    count -= 1;
                }
            }
        }
        depth
    }

    /// The angle at which to split a sector: where the farthest corner at its end becomes the farthest, or the middle.
    fn change(&self, chain: &Chain, least: &Least, end: &Vec3, (from, to): (f64, f64)) -> f64 {
        let middle = from + (to - from) / 2.0;
        if !self.other().core().is_polytope() {
            return middle;
        }
        let farther = self.link(end, least.n).of_other;
        let value = |p: &Vec3| out(end, least.n).dot(p);
        let mut links = chain.links[least.place..chain.count].iter().take(2);
        let nearer = links.find(|link| value(&farther) > value(&link.of_other) + self.pair.tiny());
        let Some(nearer) = nearer else {
            return middle;
        };
        let way = farther - nearer.of_other;
        let share = -least.n[1] * way.z / (least.n[0] * way.x.hypot(way.y));
        if !(-1.0..=1.0).contains(&share) {
            return middle;
        }
        let (towards, aside) = (way.y.atan2(way.x), share.acos());
        // One at the very end is known already.
        let spare = EDGE * (to - from);
        let inside = |angle: &f64| *angle > from + spare && *angle < to - spare;
        let places = [-1.0, 0.0, 1.0].map(|turns| turns * 2.0 * PI + towards);
        let mut all = places.into_iter().flat_map(|at| [at - aside, at + aside]);
        all.find(inside).unwrap_or(middle)
    }
}

impl Best {
    fn take(&mut self, found: &Refined, tiny: f64) {
        // Also if equally good: its closest points are known.
        if found.value >= self.value - tiny {
            (self.value, self.normal) = (found.value, found.normal);
            self.refined = Some(*found);
        }
    }
}

#[cfg(test)]
mod tests;
