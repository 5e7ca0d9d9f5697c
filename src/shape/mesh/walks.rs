//! Walks over the faces of a mesh: to where it reaches farthest, around a corner, to the place beneath a point.
//!
//! In: a mesh with its neighbours, and a face to begin from. Out: vertices and places of the connected surface; nothing
//! is said of other parts.

use super::Mesh;
use super::adjacency::NONE;
use super::trails::Trails;
use crate::math::{Point, Vec3};

/// Most corners of a climb. A climb that needs more leads along a surface and not to a point of it.
const HOPS_MAX: u32 = 48;
/// Most faces visited around one corner.
const RING_MAX: u32 = 64;
/// Most faces visited by a walk over a surface.
const WALK_MAX: u32 = 48;
/// After this many faces a walk estimates, once, how far it may still get at its rate so far.
const GLANCE: u32 = 8;
/// A walk is given up if even this multiple of its rate so far would not bring it there in the faces left: two in three
/// end nowhere. With less, walks are given up that would arrive; with more, time goes into those that will not.
const TOO_FAR: f64 = 1.5;
/// Steps of a walk between two calls of `go_on`: from cold memory each takes half a microsecond.
const STEPS_PER_ASK: u32 = 4;
/// A walk does not enter a face whose normal leans further from its direction (cosine).
const LEAN: f64 = 0.3;
/// The ends of an edge that lies across a direction differ in height by less than this share of the face's.
const LEVEL: f64 = 1e-5;
/// Resolution, as a share of the mesh's radius: far above rounding, far below any real edge.
const SAME: f64 = 1e-10;

/// Where a climb over a mesh led from one of the vertices on its way.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Climb {
    /// The vertex it reached.
    vertex: u32,
    /// Corners on the way there, at least one.
    hops: u32,
}

impl Mesh {
    /// From the corner of a face that lies farthest along `direction` over the mesh's edges to one that no neighbour
    /// lies beyond: a local maximum of the reach of the connected surface.
    ///
    /// * `beyond_m` - a place that reaches farther, along `direction` from the origin, does not matter.
    /// * `trails` - of climbs over this mesh: if one passed here, this one continues from its end, if that is higher.
    /// * `go_on` - called every few corners. A stopped climb continues by its own trail when it is started again.
    /// * returns - the vertex; `None` if the climb leads beyond, does not end within 48 corners, or is stopped.
    pub(crate) fn climb(
        &self,
        face: u32,
        direction: &Vec3,
        beyond_m: f64,
        trails: &mut Trails<Climb>,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<u32> {
        let height = |vertex: u32| direction.dot(&self.vertices[vertex as usize].coords);
        let corners = self.faces[face as usize].map(|vertex| (height(vertex), vertex));
        let higher = |x: (f64, u32), y: (f64, u32)| if y.0 > x.0 { y } else { x };
        let mut best = corners.into_iter().fold(corners[0], higher);
        // Vertices visited, each with the number of corners up to it.
        let (mut path, mut len) = ([(0, 0); HOPS_MAX as usize], 0);
        let mut hops = 0;
        let top = loop {
            if best.0 > beyond_m || hops >= HOPS_MAX {
                break None;
            }
            if hops % STEPS_PER_ASK == STEPS_PER_ASK - 1 && !go_on() {
                break None;
            }
            let vertex = best.1;
            (path[len], len) = ((vertex, hops), len + 1);
            if let Some((ahead, _)) = trails.find(vertex, direction)
                && height(ahead.vertex) > best.0
            {
                best = (height(ahead.vertex), ahead.vertex);
                hops += ahead.hops;
                continue;
            }
            let mut next = (best.0 + SAME * self.radius, vertex);
            let mut look = |other| next = higher(next, (height(other), other));
            let ring = self.rings.of(vertex);
            ring.iter().for_each(|other| look(*other));
            if ring.is_empty()
                && let Some(side) = self.rings.side_at(vertex)
            {
                self.go_round(side, |side| look(self.start_of(side)));
            }
            if next.1 == vertex {
                break Some(vertex);
            }
            best = next;
            hops += 1;
        };
        for (passed, before) in &path[..len] {
            let (vertex, hops) = (best.1, (hops - before).max(1));
            trails.note(*passed, direction, Climb { vertex, hops });
        }
        top
    }

    /// The height of a face's edge that lies across `direction` at its top, if neither of its two faces reaches higher:
    /// then it is an edge of the surface too, whatever lies further on.
    pub(crate) fn crest(&self, face: u32, direction: &Vec3) -> Option<f64> {
        let on = |v: u32| direction.dot(&self.vertices[v as usize].coords);
        let [a, b, c] = self.faces[face as usize].map(on);
        let (k, low) = if c <= a && c <= b {
            (0, c)
        } else if a <= b {
            (1, a)
        } else {
            (2, b)
        };
        let [from, to] = [k, (k + 1) % 3].map(|k| [a, b, c][k as usize]);
        let top = from.max(to);
        let level = (from - to).abs() <= LEVEL * (top - low);
        if !level {
            return None;
        }
        let entry = self.adjacency.twins()[(3 * face + k) as usize];
        if entry == NONE {
            let highest = (self.adjacency.beyond(3 * face + k))
                .flat_map(|other| self.faces[other as usize])
                .fold(top, |high, v| high.max(on(v)));
            return (highest <= top + SAME * self.radius).then_some(top);
        }
        let opposite = self.faces[(entry / 3) as usize][((entry % 3 + 2) % 3) as usize];
        (on(opposite) <= top + SAME * self.radius).then_some(top)
    }

    /// Visits the faces around the corners of a face, some more than once.
    ///
    /// * returns - whether these are all: around each corner they close to a complete ring.
    pub(super) fn about(&self, face: u32, mut visit: impl FnMut(u32)) -> bool {
        let round = |side| self.go_round(side, |other| visit(other / 3)).is_some();
        (3 * face..3 * face + 3)
            .map(round)
            .fold(true, |all, closed| all & closed)
    }

    /// Visits the corners of all faces around the start of a side, as sides that start there: each at the first face
    /// that has it.
    ///
    /// * returns - number of faces, if they close to a ring of no more than 64.
    pub(super) fn go_round(&self, side: u32, mut visit: impl FnMut(u32)) -> Option<u32> {
        let (face, k) = (side / 3, side % 3);
        let start = self.start_of(side);
        let at = self.vertices[start as usize];
        visit(3 * face + (k + 1) % 3);
        visit(3 * face + (k + 2) % 3);
        // One way round; from a border again the other way.
        for mut leave in [3 * face + (k + 2) % 3, side] {
            for faces in 1..=RING_MAX {
                let entry = self.adjacency.twins()[leave as usize];
                if entry == NONE {
                    // Over a seam the faces beyond may not have the corner: their neighbours are visited, too, or a
                    // walk along a level side would end there.
                    for other in self.adjacency.beyond(leave) {
                        for side in 3 * other..3 * other + 3 {
                            visit(side);
                            let beside = self.adjacency.twins()[side as usize];
                            if beside != NONE {
                                let face = beside / 3;
                                (3 * face..3 * face + 3).for_each(&mut visit);
                            }
                        }
                    }
                    break;
                }
                let next = entry / 3;
                if next == face {
                    return Some(faces);
                }
                let corners = self.faces[next as usize];
                // Branch-free: which corner it is is practically random.
                let same = corners.map(|v| u32::from(v == start));
                let mut j = same[1] | same[2] << 1;
                if same == [0; 3] {
                    // A different vertex at the same place.
                    let there = |&j: &u32| self.vertices[corners[j as usize] as usize] == at;
                    let Some(other) = (0..3).find(there) else {
                        break;
                    };
                    j = other;
                }
                // If a face has it twice, the first.
                j = if same[0] == 1 { 0 } else { j.min(2) };
                // Leave by the other side at this corner, whichever way the face is turned. The side of entry has been
                // seen, and so has its other end.
                let (beside, opposite) = (3 * next + (j + 1) % 3, 3 * next + (j + 2) % 3);
                leave = if entry == 3 * next + j {
                    visit(opposite);
                    opposite
                } else {
                    visit(beside);
                    3 * next + j
                };
            }
        }
        None
    }

    /// The place of the surface beneath a point, along `direction`: from `face` on, over its neighbours.
    ///
    /// * `direction` - unit, outward if the mesh is a solid.
    /// * `go_on` - called every few faces.
    /// * returns - the place, and its face; `None` if the surface ends or turns away on the way there, it is more than
    ///   48 faces off, or the walk is stopped.
    pub(crate) fn beneath(
        &self,
        mut face: u32,
        point: &Point,
        direction: &Vec3,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<(Point, u32)> {
        let same = SAME * self.radius;
        let mut first_m = 0.0;
        for step in 0..WALK_MAX {
            let corners = self.triangle(face);
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let (rise, square) = (normal.dot(direction), normal.norm_squared());
            let leans = rise * rise < LEAN * LEAN * square || square <= f64::MIN_POSITIVE;
            if leans || (self.solid && rise < 0.0) {
                return None;
            }
            let (k, out) = farthest_side(&corners, point, direction, rise.signum());
            if out <= same {
                let lift = normal.dot(&(point - corners[0])) / rise;
                return Some((point - direction * lift, face));
            }
            if step % STEPS_PER_ASK == STEPS_PER_ASK - 1 && !go_on() {
                return None;
            }
            match step {
                0 => first_m = out,
                GLANCE => {
                    let left = f64::from(WALK_MAX - GLANCE) / f64::from(GLANCE);
                    let may_come_m = (first_m - out) * TOO_FAR * left;
                    if may_come_m < out {
                        return None;
                    }
                }
                _ => {}
            }
            let entry = self.adjacency.twins()[(3 * face + k) as usize];
            face = if entry == NONE {
                // Of several faces beyond a seam, the one that is closest to being beneath the point.
                let over = |other: &u32| self.off(*other, point, direction);
                let beyond = self.adjacency.beyond(3 * face + k);
                beyond.min_by(|x, y| over(x).total_cmp(&over(y)))?
            } else {
                entry / 3
            };
        }
        None
    }

    /// How far a point lies outside a face, seen along `direction`, metres.
    fn off(&self, face: u32, point: &Point, direction: &Vec3) -> f64 {
        let sign = self
            .face_normal(face)
            .map_or(1.0, |n| n.dot(direction).signum());
        farthest_side(&self.triangle(face), point, direction, sign).1
    }
}

/// The side of a face beyond which a point lies farthest, seen along `direction`, and how far, metres.
///
/// * `sign` - of the face's normal along `direction`.
fn farthest_side(corners: &[Point; 3], point: &Point, direction: &Vec3, sign: f64) -> (u32, f64) {
    // As a square with a sign: one root for all three.
    let over = |k: usize| {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        let outward = (to - from).cross(direction);
        let (out, square) = (outward.dot(&(point - from)) * sign, outward.norm_squared());
        if square > 0.0 {
            out * out.abs() / square
        } else {
            f64::NEG_INFINITY
        }
    };
    let sides = (0u32..3).zip([over(0), over(1), over(2)]);
    let farther = |x: (u32, f64), y: (u32, f64)| if y.1 > x.1 { y } else { x };
    let (k, square) = sides.fold((0, f64::NEG_INFINITY), farther);
    (k, square.abs().sqrt().copysign(square))
}

#[cfg(test)]
mod tests;
