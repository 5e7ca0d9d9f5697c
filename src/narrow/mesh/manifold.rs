//! The contact points of two leaves, with the normal of their surface rather than that of a single triangle.
//!
//! In: a triangle of a mesh and a convex shape, or two triangles, that touch or cross, and the result of their query.
//! Out: points with a normal, each named by the corners and edges that meet there.
//!
//! A single triangle has edges, most of which are not edges of the surface. Pushed in by a millimetre at such an edge,
//! the least translation of the two leaves leads sideways, along the surface. So a normal is rated by how far the two
//! would have to move along it if each were followed over its neighbours to where it reaches farthest (`Mesh::climb`):
//! along a flat floor that is far, at a convex ridge nothing is added. The least of these wins:
//! - the normals of the faces, by how far the other shape reaches behind the face's plane;
//! - the leaves' own normal: edges, corners, and round shapes.
//!
//! Refused: a table of Voronoi regions for each edge (a corner that pokes through a face is in none of its regions);
//! using the face's normal everywhere (a box on a ridge would tilt to one of its sides).

mod leaf;
mod nearest;

use leaf::{Leaf, corner_name, mix};
use nearest::nearest;

use super::Closest;
use super::contacts::LeafContact;
use super::patches::Patches;
use super::placed::Placed;
use super::side::Side;
use crate::math::{Interval, Point, Vec3};
use crate::narrow::arena::Arena;
use crate::narrow::exact::{ManifoldPoint, PREDICTION, shared_by_triangles, shared_points};
use crate::shape::{Climb, Mesh, Trails};

/// An own normal this close to a face's (cosine of 0.1 degrees) counts as the face's.
const FACE: f64 = 0.999_998;
/// A solid's surface does not push inwards (cosine; a little more than a right angle is rounding).
const INWARD: f64 = -0.1;
/// If no surface is found beneath a vertex, there is none along a normal this close either (cosine of 4 degrees).
const SAME_FOOT: f64 = 0.9976;
/// A later normal must be better by this share of the smaller one's radius.
const BETTER: f64 = 1e-9;

/// The walks of one search for contact points, as far as they have come.
#[derive(Debug, Default)]
pub(super) struct Walks {
    /// Over A and over B to where they reach farthest.
    tops: [Trails<Climb>; 2],
    /// From vertices of A and of B to the face of the other beneath them, if any.
    feet: [Trails<Option<u32>>; 2],
    /// Number of the search that they belong to.
    search: u64,
}

impl Walks {
    /// Continues a search, or begins one: it must not use the walks of another. Returns its number.
    ///
    /// * `search` - the number last returned for the two at this pose, if any.
    pub(super) fn resume(&mut self, search: Option<u64>) -> u64 {
        if search != Some(self.search) {
            self.tops.iter_mut().for_each(Trails::clear);
            self.feet.iter_mut().for_each(Trails::clear);
            self.search += 1;
        }
        self.search
    }

    fn tops(&mut self, is_b: bool) -> &mut Trails<Climb> {
        &mut self.tops[usize::from(is_b)]
    }

    fn feet(&mut self, is_b: bool) -> &mut Trails<Option<u32>> {
        &mut self.feet[usize::from(is_b)]
    }
}

/// The leaf whose face normal is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Base {
    A,
    B,
    /// Neither: the leaves' own normal.
    Own,
}

/// Passes on the points of two leaves that touch: at least one. They are in A's frame, and `patch` names the surface
/// that the normal belongs to.
///
/// It takes up to ten walks of some microseconds each.
///
/// * `go_on` - called between and within walks; if false, the work stops, to be started again with the trails of the
///   walks so far.
/// * returns - whether it was finished.
pub(super) fn points(
    a: (Side<'_>, u32),
    b: (Side<'_>, u32),
    at: &Placed,
    found: &LeafContact,
    (patches, arena): (&mut Patches, &mut Arena<LeafContact>),
    walks: &mut Walks,
    go_on: &mut impl FnMut() -> bool,
) -> bool {
    let [a, b] = [(a, false), (b, true)].map(|(leaf, is_b)| Leaf::new(leaf, is_b, at));
    let size = a.side.radius().min(b.side.radius());
    // Rounding is relative to the whole, not to the smaller one.
    let rounding_m = 4.0 * at.slop;
    let better_m = rounding_m.max(BETTER * size);
    let Some(chosen) = choose(&a, &b, &found.closest, better_m, (walks, go_on)) else {
        return false;
    };
    let Chosen { normal, base, top } = chosen;
    let patch = match base {
        Base::B => b.patch(),
        _ if a.mesh().is_some() => a.patch(),
        _ => b.patch(),
    };
    // A walk to it is long, and often fails.
    let top = top.filter(|(_, depth_m)| patches.misses(arena, (patch, &normal), *depth_m));
    let mut any = false;
    let mut put = |point_a: Point, point_b: Point, feature: u64| {
        let gap_m = normal.dot(&(point_b - point_a));
        any = true;
        let point = LeafContact {
            closest: Closest {
                gap: Interval::new(gap_m, gap_m),
                best_m: gap_m,
                normal,
                point_a,
                point_b,
                finished: true,
            },
            feature: mix(feature, u64::from(patch)),
            patch,
            ..*found
        };
        patches.add(arena, &point);
    };
    let forced = match base {
        Base::A => Some(false),
        Base::B => Some(true),
        Base::Own => None,
    };
    let prediction_m = rounding_m.max(PREDICTION * size);
    shared(&a, &b, &normal, forced, prediction_m, |p, base_is_b| {
        put(
            p.point_a,
            p.point_b,
            feature_of(&a, &b, p.feature, base_is_b),
        );
    });
    if let Some(base_is_b) = forced {
        let (on, of) = if base_is_b { (&b, &a) } else { (&a, &b) };
        let top = top.map(|(top, _)| top);
        let take = |on, of, feature| {
            let (point_a, point_b) = if base_is_b { (of, on) } else { (on, of) };
            put(point_a, point_b, feature);
        };
        if !corners((on, of), &normal, top, prediction_m, (walks, go_on), take) {
            return false;
        }
    }
    if any {
        return true;
    }
    let patch = if base == Base::Own {
        patch
    } else {
        LeafContact::SPARE
    };
    patches.add(arena, &nearest(&a, &b, patch, found));
    true
}

/// What [`choose`] chose.
struct Chosen {
    /// Unit, A to B.
    normal: Vec3,
    base: Base,
    /// The vertex of the other mesh, if it is one, that lies deepest behind the base's face, and its depth.
    top: Option<(u32, f64)>,
}

/// The normal, A to B, along which the two surfaces overlap least; `None`: stopped, see [`points`].
fn choose(
    a: &Leaf<'_>,
    b: &Leaf<'_>,
    found: &Closest,
    better_m: f64,
    (walks, go_on): (&mut Walks, &mut impl FnMut() -> bool),
) -> Option<Chosen> {
    let (normal_a, normal_b) = (a.normal, b.normal);
    let (mut best_m, mut best) = (
        f64::INFINITY,
        Chosen {
            normal: found.normal,
            base: Base::Own,
            top: None,
        },
    );
    for (leaf, other, face, base) in [(a, b, normal_a, Base::A), (b, a, normal_b, Base::B)] {
        let (Some(outward), Some(mesh)) = (face, leaf.mesh()) else {
            continue;
        };
        let plane = leaf.corners[0];
        // A surface can be touched from both sides.
        let ways = if mesh.is_solid() { 1 } else { 2 };
        for outward in [outward, -outward].into_iter().take(ways) {
            let height = outward.dot(&plane.coords);
            let reach = other.reach(&-outward, best_m - height, (walks, go_on));
            if !go_on() {
                return None;
            }
            let Some((reach, top)) = reach else { continue };
            if height + reach < best_m - better_m {
                let normal = if base == Base::A { outward } else { -outward };
                best_m = height + reach;
                let top = top.map(|top| (top, best_m));
                best = Chosen { normal, base, top };
            }
        }
    }
    let own = found.normal;
    let known = |face: Option<Vec3>, outward: Vec3, leaf: &Leaf<'_>| {
        let along = face.map_or(0.0, |n| n.dot(&outward));
        let solid = leaf.mesh().is_some_and(Mesh::is_solid);
        along.abs() >= FACE || (solid && along < INWARD)
    };
    if !known(normal_a, own, a) && !known(normal_b, -own, b) {
        let reach = a.own_reach(&own, best_m - b.least_reach(&-own), (walks, go_on));
        let whole = reach.and_then(|r| Some(r + b.own_reach(&-own, best_m - r, (walks, go_on))?));
        if !go_on() {
            return None;
        }
        if whole.is_some_and(|depth| depth < best_m - better_m) {
            return Some(Chosen {
                normal: own,
                base: Base::Own,
                top: None,
            });
        }
    }
    Some(best)
}

/// The points that two leaves share.
fn shared(
    a: &Leaf<'_>,
    b: &Leaf<'_>,
    normal: &Vec3,
    forced: Option<bool>,
    prediction_m: f64,
    take: impl FnMut(&ManifoldPoint, bool),
) {
    if a.normal.is_some() && b.normal.is_some() {
        let triangles = [&a.corners, &b.corners];
        shared_by_triangles(triangles, normal, forced, prediction_m, take);
        return;
    }
    let (one, other) = (a.convex(), b.convex());
    shared_points(
        (&one, &other),
        &a.at.pos12,
        normal,
        forced,
        prediction_m,
        take,
    );
}

/// Name of a clipped point: a corner of one leaf, or where two edges cross.
fn feature_of(a: &Leaf<'_>, b: &Leaf<'_>, feature: u32, base_is_b: bool) -> u64 {
    let (base, incident) = if base_is_b { (b, a) } else { (a, b) };
    let (corner, cut) = (feature & 0x7fff, feature >> 15 & 0xffff);
    match cut {
        0 => incident.corner_name(corner),
        cut => mix(incident.edge_name(corner), base.edge_name(cut - 1)),
    }
}

/// Corners of `of` behind the surface around `on`, and `top`, the deepest one: a triangle that pokes through the
/// surface has its corners over other triangles than the one it crosses. Returns whether it was finished, see
/// [`points`].
fn corners(
    (on, of): (&Leaf<'_>, &Leaf<'_>),
    normal: &Vec3,
    top: Option<u32>,
    prediction_m: f64,
    (walks, go_on): (&mut Walks, &mut impl FnMut() -> bool),
    mut take: impl FnMut(Point, Point, u64),
) -> bool {
    let (Some(surface), Some(mesh)) = (on.mesh(), of.mesh()) else {
        return true;
    };
    let outward = if on.is_b { -normal } else { *normal };
    let plane = on.corners[0];
    let own = on.turn(&outward);
    for vertex in mesh.faces()[of.place as usize].into_iter().chain(top) {
        let point = of.in_a(&mesh.vertices()[vertex as usize]);
        if outward.dot(&(point - plane)) > prediction_m {
            continue;
        }
        let there = if on.is_b { on.at.to_b(&point) } else { point };
        let feet = walks.feet(of.is_b);
        let from = match feet.find(vertex, &own) {
            Some((None, cos)) if cos >= SAME_FOOT => continue,
            Some((Some(face), _)) => face,
            _ => on.place,
        };
        let found = surface.beneath(from, &there, &own, &mut *go_on);
        if !go_on() {
            return false;
        }
        feet.note(vertex, &own, found.map(|(_, face)| face));
        let Some((beneath, _)) = found else { continue };
        let beneath = on.in_a(&beneath);
        if outward.dot(&(point - beneath)) <= prediction_m {
            take(beneath, point, corner_name(vertex, of.is_b));
        }
    }
    true
}
