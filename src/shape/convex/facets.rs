//! The surface of a hull as triangles, exactly.
//!
//! In: points, own frame, all different. Out: triangles that no point lies beyond, each with its neighbours, and which
//! points are corners of the hull.
//!
//! Signs are exact, so nothing is thickened or moved: a point in the plane of a triangle does not lie beyond it, and
//! points inside the hull, its faces or its edges are reliably distinguished from corners. Refused: parry's builder,
//! which moves vertices of thin hulls, and tolerances, which lose corners or keep false ones.
//!
//! Signs are exact as long as no product of three differences underflows; see [`is_exact`].
//!
//! Source: Barber, Dobkin, Huhdanpaa 1996, "The quickhull algorithm for convex hulls".

use std::collections::VecDeque;

use crate::math::Point;
use crate::shape::mesh::side;

const NONE: u32 = u32::MAX;

/// Least size of a non-zero coordinate, metres: f64 of this size are multiples of 1e-91, and so are their differences,
/// so that products of three still have all their digits. Below some 1e-90, points far outside would count as coplanar.
const EXACT_MIN_M: f64 = 1e-75;

/// A triangle of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// Indices of its corners, counter-clockwise seen from outside.
    pub(super) corners: [u32; 3],
    /// The facet across the side from each corner to the next.
    pub(super) beside: [u32; 3],
}

/// The facets of the hull of points; `None` if all lie in one plane, or numbers are too small for exact products.
///
/// Cost: usually O(n log n).
pub(super) fn facets_of(points: &[Point]) -> Option<Vec<Facet>> {
    if !is_exact(points) {
        return None;
    }
    let mut hull = Quickhull::begin(points)?;
    while let Some(facet) = hull.pending.pop_front() {
        if let Some(apex) = hull.farthest(facet) {
            hull.add(facet, apex)?;
        }
    }
    hull.finish()
}

/// Whether no product of coordinate differences loses a digit by underflow.
pub(super) fn is_exact(points: &[Point]) -> bool {
    let mut all = points.iter().flat_map(|p| p.iter());
    all.all(|x| *x == 0.0 || x.abs() >= EXACT_MIN_M)
}

/// Which points are corners: at least three true edges meet there, not counting those that only cut a plane face. The
/// facets around other points lie in one plane or in two.
pub(super) fn corners_of(points: &[Point], facets: &[Facet]) -> Vec<bool> {
    let mut edges = vec![0_u32; points.len()];
    for facet in facets {
        for (start, other) in facet.corners.into_iter().zip(facet.beside) {
            let beyond = facets[other as usize].corners;
            let plane = facet.corners.map(|k| &points[k as usize]);
            let in_plane = |k: u32| side(plane[0], plane[1], plane[2], &points[k as usize]).is_eq();
            if !beyond.into_iter().all(in_plane) {
                edges[start as usize] += 1;
            }
        }
    }
    edges.into_iter().map(|count| count >= 3).collect()
}

/// A facet under construction.
#[derive(Clone, Copy)]
struct Live {
    facet: Facet,
    /// First of the points that lie beyond it; each point is kept at one facet.
    first: u32,
    is_gone: bool,
    /// The round in which it was last visited, and whether the new point lay beyond it.
    seen: (u32, bool),
}

struct Quickhull<'a> {
    points: &'a [Point],
    live: Vec<Live>,
    /// Indices of removed facets.
    free: Vec<u32>,
    /// The next point beyond the same facet.
    next: Vec<u32>,
    /// Facets that may have points beyond them. Processed in turn: one region at a time would be refined next to a
    /// coarse one, in fans of which each later point sees all.
    pending: VecDeque<u32>,
    round: u32,
    /// By point: the new facet whose first corner it is.
    begins: Vec<u32>,
}

impl<'a> Quickhull<'a> {
    /// A tetrahedron, and the points beyond its faces.
    fn begin(points: &'a [Point]) -> Option<Self> {
        let mut hull = Self {
            points,
            live: Vec::new(),
            free: Vec::new(),
            next: vec![NONE; points.len()],
            pending: VecDeque::new(),
            round: 0,
            begins: vec![NONE; points.len()],
        };
        let [a, b, c, d] = simplex(points)?;
        let faces = [[a, b, c], [b, a, d], [c, b, d], [a, c, d]];
        let beside = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        for (corners, beside) in faces.into_iter().zip(beside) {
            hull.make(Facet { corners, beside });
        }
        let others = (0u32..).zip(points).map(|(place, _)| place);
        hull.share_out(others, &[0, 1, 2, 3]);
        Some(hull)
    }

    fn make(&mut self, facet: Facet) -> u32 {
        let live = Live {
            facet,
            first: NONE,
            is_gone: false,
            seen: (0, false),
        };
        if let Some(place) = self.free.pop() {
            self.live[place as usize] = live;
            return place;
        }
        self.live.push(live);
        u32::try_from(self.live.len() - 1).unwrap_or(NONE)
    }

    /// Assigns each point to one of the facets that it lies beyond, if there is one.
    fn share_out(&mut self, points: impl Iterator<Item = u32>, facets: &[u32]) {
        for point in points {
            if let Some(&facet) = facets.iter().find(|facet| self.is_beyond(**facet, point)) {
                let first = &mut self.live[facet as usize].first;
                self.next[point as usize] = *first;
                *first = point;
            }
        }
        let has = |facet: &&u32| self.live[**facet as usize].first != NONE;
        self.pending.extend(facets.iter().filter(has));
    }

    fn is_beyond(&self, facet: u32, point: u32) -> bool {
        let corners = self.live[facet as usize].facet.corners;
        // Most points in its plane are its own corners.
        if corners.contains(&point) {
            return false;
        }
        let [a, b, c] = corners.map(|k| &self.points[k as usize]);
        side(a, b, c, &self.points[point as usize]).is_gt()
    }

    /// The farthest of the points kept at a facet.
    fn farthest(&self, facet: u32) -> Option<u32> {
        let live = &self.live[facet as usize];
        if live.is_gone || live.first == NONE {
            return None;
        }
        let [a, b, c] = live.facet.corners.map(|k| self.points[k as usize]);
        let normal = (b - a).cross(&(c - a));
        let height = |point: u32| normal.dot(&(self.points[point as usize] - a));
        let (mut best, mut at) = ((live.first, height(live.first)), live.first);
        while at != NONE {
            let there = height(at);
            if there > best.1 {
                best = (at, there);
            }
            at = self.next[at as usize];
        }
        Some(best.0)
    }

    /// Makes a point beyond a facet a vertex of the surface; `None` if signs contradict each other.
    fn add(&mut self, facet: u32, apex: u32) -> Option<()> {
        self.round += 1;
        let (visible, rim) = self.look_from(facet, apex);
        let mut orphans = Vec::new();
        for &facet in &visible {
            let live = &mut self.live[facet as usize];
            live.is_gone = true;
            let mut at = std::mem::replace(&mut live.first, NONE);
            while at != NONE {
                if at != apex {
                    orphans.push(at);
                }
                at = self.next[at as usize];
            }
        }
        self.free.extend(&visible);
        let new = self.cover(apex, &rim);
        for (from, ..) in rim {
            self.begins[from as usize] = NONE;
        }
        self.share_out(orphans.into_iter(), &new?);
        Some(())
    }

    /// The facets that a point lies beyond, beginning with one of them; and the sides around them, each from corner to
    /// corner, with the facet on the other side.
    fn look_from(&mut self, facet: u32, apex: u32) -> (Vec<u32>, Vec<(u32, u32, u32)>) {
        let (mut visible, mut rim) = (vec![facet], Vec::new());
        self.live[facet as usize].seen = (self.round, true);
        let mut done = 0;
        while let Some(&at) = visible.get(done) {
            done += 1;
            let Facet { corners, beside } = self.live[at as usize].facet;
            for (k, other) in beside.into_iter().enumerate() {
                let seen = self.live[other as usize].seen;
                let beyond = if seen.0 == self.round {
                    seen.1
                } else {
                    let beyond = self.is_beyond(other, apex);
                    self.live[other as usize].seen = (self.round, beyond);
                    if beyond {
                        visible.push(other);
                    }
                    beyond
                };
                if !beyond {
                    rim.push((corners[k], corners[(k + 1) % 3], other));
                }
            }
        }
        (visible, rim)
    }

    /// New facets from the sides of a rim to a point.
    fn cover(&mut self, apex: u32, rim: &[(u32, u32, u32)]) -> Option<Vec<u32>> {
        let mut new = Vec::with_capacity(rim.len());
        for &(from, to, outer) in rim {
            let place = self.make(Facet {
                corners: [from, to, apex],
                beside: [outer, NONE, NONE],
            });
            new.push(place);
            let Facet { corners, beside } = &mut self.live[outer as usize].facet;
            let back = (0..3).find(|&k| (corners[k], corners[(k + 1) % 3]) == (to, from))?;
            beside[back] = place;
            let begins = &mut self.begins[from as usize];
            if *begins != NONE {
                return None;
            }
            *begins = place;
        }
        for (&place, (_, to, _)) in new.iter().zip(rim) {
            let after = self.begins[*to as usize];
            self.live.get_mut(after as usize)?.facet.beside[2] = place;
            self.live[place as usize].facet.beside[1] = after;
        }
        Some(new)
    }

    /// The remaining facets, renumbered.
    fn finish(self) -> Option<Vec<Facet>> {
        let mut places = vec![NONE; self.live.len()];
        let left = || self.live.iter().filter(|live| !live.is_gone);
        let kept = (0..self.live.len()).filter(|&place| !self.live[place].is_gone);
        for (new, old) in (0u32..).zip(kept) {
            places[old] = new;
        }
        let mut facets: Vec<Facet> = left().map(|live| live.facet).collect();
        for other in facets.iter_mut().flat_map(|facet| &mut facet.beside) {
            *other = *places
                .get(*other as usize)
                .filter(|place| **place != NONE)?;
        }
        Some(facets)
    }
}

/// Four points that span a volume, the last beneath the triangle of the others.
fn simplex(points: &[Point]) -> Option<[u32; 4]> {
    let first = *points.first()?;
    let farthest = |far: &dyn Fn(&Point) -> f64| {
        let mut best = (0, f64::NEG_INFINITY);
        for (place, point) in (0u32..).zip(points) {
            let there = far(point);
            if there > best.1 {
                best = (place, there);
            }
        }
        best.0
    };
    let at = |place: u32| &points[place as usize];
    let second = farthest(&|p| (p - first).norm_squared());
    let along = at(second) - first;
    let third = farthest(&|p| along.cross(&(p - first)).norm_squared());
    let normal = along.cross(&(at(third) - first));
    let height = |p: &Point| side(&first, at(second), at(third), p);
    let mut fourth = farthest(&|p| normal.dot(&(p - first)).abs());
    if height(at(fourth)).is_eq() {
        let mut places = (0u32..).zip(points);
        fourth = places.find(|(_, p)| height(p).is_ne())?.0;
    }
    Some(if height(at(fourth)).is_lt() {
        [0, second, third, fourth]
    } else {
        [0, third, second, fourth]
    })
}

#[cfg(test)]
mod tests;
