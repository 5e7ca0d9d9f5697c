//! Which faces of a mesh are neighbours, and walks from one to the next.
//!
//! In: the topology of the faces as they finally are. Out: for every side of a face the side of the neighbour that runs
//! along it, and the smooth region that each face is part of. A side is named `3 * face + k`: from the face's corner
//! `k` to the next one.
//!
//! Sides on a border, and those that three faces or more share, have no neighbour; where the surface goes on beyond
//! them nevertheless, they have a seam (`seams`).

use super::Mesh;
use super::seams::{self, SIDES_MAX, Seam};
use super::topology::{Sets, Topology};
use crate::math::{Point, Vec3};

/// No neighbour.
pub(super) const NONE: u32 = u32::MAX;
/// Faces whose normals differ by less than 20 degrees (cosine) are of one smooth region. Larger, and the sides of a
/// coarse cylinder are one surface with its caps; smaller, and a coarse ball is many.
const SMOOTH: f64 = 0.94;
/// Corners a climb goes over. A climb that needs more leads along a surface and not to a point of it.
const HOPS_MAX: u32 = 48;
/// Faces about one corner that are looked at.
const RING_MAX: u32 = 64;
/// Faces that a walk over a surface passes.
const WALK_MAX: u32 = 48;
/// After so many of them it is told how far the walk has come, ...
const GLANCE: u32 = 8;
/// ... and where it would need so many times what is left at that rate, it is given up: two in three end nowhere.
const TOO_FAR: f64 = 1.5;
/// A face that leans further from the direction of a walk (cosine) is not walked onto.
const LEAN: f64 = 0.3;
/// The ends of an edge that lies across a direction differ in height by less than this share of the face's.
const LEVEL: f64 = 1e-5;
/// What is not told apart, as a share of the mesh's radius: far above rounding, far below any real edge.
const SAME: f64 = 1e-10;

/// Neighbours and regions of the faces of a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Adjacency {
    /// For each side that of the neighbour.
    twins: Vec<u32>,
    /// What lies beyond sides without a neighbour, by side.
    seams: Vec<Seam>,
    /// For each face the least face of its region.
    regions: Vec<u32>,
    /// Sides without a neighbour.
    open: usize,
}

impl Adjacency {
    /// * `mesh` - its faces as they finally are; `topology` is of the same faces, whichever way they were turned then.
    ///
    /// Cost: O(n), and O(log n) for each side without a neighbour.
    pub(super) fn new(topology: &Topology, mesh: &Mesh) -> Self {
        let (vertices, faces) = (&mesh.vertices, &mesh.faces);
        let mut twins = vec![NONE; 3 * faces.len()];
        let mut sets = Sets::new(faces.len());
        for uses in topology.edge_uses() {
            let [one, other] = uses else { continue };
            if one.2 == other.2 {
                continue;
            }
            let sides = [one, other].map(|side| topology.side_of(side, faces));
            let [Some((k, forward)), Some((j, back))] = sides else {
                continue;
            };
            twins[(3 * one.2 + k) as usize] = 3 * other.2 + j;
            twins[(3 * other.2 + j) as usize] = 3 * one.2 + k;
            let normals = [one.2, other.2].map(|face| normal(vertices, &faces[face as usize]));
            // Faces without an area hang together with whatever is beside them.
            let smooth = match normals {
                [Some(x), Some(y)] if forward == back => -x.dot(&y) >= SMOOTH,
                [Some(x), Some(y)] => x.dot(&y) >= SMOOTH,
                _ => true,
            };
            if smooth {
                sets.join(one.2, other.2, false);
            }
        }
        let open = twins.iter().filter(|twin| **twin == NONE).count();
        let mut seams = Vec::new();
        if open <= SIDES_MAX {
            seams = seams::find(mesh, &twins);
        }
        for seam in &seams {
            let face = seam.side / 3;
            let Some(here) = mesh.face_normal(face) else {
                continue;
            };
            for &other in seam.faces.iter().filter(|other| **other != NONE) {
                // Beyond a seam faces may be turned either way.
                let along = mesh.face_normal(other).map_or(1.0, |n| n.dot(&here).abs());
                if along >= SMOOTH {
                    sets.join(face, other, false);
                }
            }
        }
        let regions = (0u32..).zip(faces).map(|(i, _)| sets.root(i).0).collect();
        Self {
            twins,
            seams,
            regions,
            open,
        }
    }

    /// For each side that of the neighbour.
    pub(super) fn twins(&self) -> &[u32] {
        &self.twins
    }

    /// Takes other regions, and no seams.
    pub(super) fn replace_measured(&mut self, regions: Vec<u32>) {
        (self.regions, self.seams) = (regions, Vec::new());
    }

    /// What `check` says where seams were not looked for.
    pub(super) fn warning(&self) -> Option<String> {
        (self.open > SIDES_MAX).then(|| {
            format!(
                "{} edges without a neighbour, more than {SIDES_MAX}: contacts may show edges within its surface; weld it",
                self.open
            )
        })
    }

    /// The faces beyond a side without a neighbour.
    fn beyond(&self, side: u32) -> impl Iterator<Item = u32> + use<'_> {
        let at = self.seams.binary_search_by_key(&side, |seam| seam.side);
        let seam = at.ok().and_then(|at| self.seams.get(at));
        let faces = seam.into_iter().flat_map(|seam| seam.faces);
        faces.filter(|face| *face != NONE)
    }
}

fn normal(vertices: &[Point], face: &[u32; 3]) -> Option<Vec3> {
    let [a, b, c] = face.map(|v| vertices[v as usize]);
    (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)
}

impl Mesh {
    /// Unit normal of a face, outward of a solid, own frame; `None` for a face without an area.
    pub(crate) fn face_normal(&self, face: u32) -> Option<Vec3> {
        normal(&self.vertices, &self.faces[face as usize])
    }

    /// The smooth region that a face is part of, named by its least face.
    pub(crate) fn region(&self, face: u32) -> u32 {
        self.adjacency.regions[face as usize]
    }

    /// The vertex that a side starts from.
    pub(crate) fn start_of(&self, side: u32) -> u32 {
        self.faces[(side / 3) as usize][(side % 3) as usize]
    }

    /// From the corner of a face that lies farthest along `direction` over the mesh's edges to one that no neighbour
    /// lies beyond: a place where the surface, as far as it hangs together, reaches farthest.
    ///
    /// * `beyond_m` - a place that reaches farther, along `direction` from the origin, is of no interest.
    /// * returns - the vertex; `None` where the climb leads beyond, or does not end within 48 corners.
    pub(crate) fn climb(&self, face: u32, direction: &Vec3, beyond_m: f64) -> Option<u32> {
        let height = |side: u32| {
            let at = self.vertices[self.start_of(side) as usize];
            direction.dot(&at.coords)
        };
        let corners = [3 * face, 3 * face + 1, 3 * face + 2].map(|side| (height(side), side));
        let higher = |x: (f64, u32), y: (f64, u32)| if y.0 > x.0 { y } else { x };
        let mut best = corners.into_iter().fold(corners[0], higher);
        for _ in 0..HOPS_MAX {
            if best.0 > beyond_m {
                return None;
            }
            let mut next = (best.0 + SAME * self.radius, best.1);
            self.ring(best.1, |side| next = higher(next, (height(side), side)));
            if next.1 == best.1 {
                return Some(self.start_of(best.1));
            }
            best = next;
        }
        None
    }

    /// The height of the edge of a face that lies across `direction` on top of it, if neither of the two faces at it
    /// reaches higher: then it is the surface's edge too, whatever lies further on.
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
        let entry = self.adjacency.twins[(3 * face + k) as usize];
        if entry == NONE {
            let highest = (self.adjacency.beyond(3 * face + k))
                .flat_map(|other| self.faces[other as usize])
                .fold(top, |high, v| high.max(on(v)));
            return (highest <= top + SAME * self.radius).then_some(top);
        }
        let opposite = self.faces[(entry / 3) as usize][((entry % 3 + 2) % 3) as usize];
        (on(opposite) <= top + SAME * self.radius).then_some(top)
    }

    /// Visits the faces about the corners of a face, some more than once.
    pub(super) fn about(&self, face: u32, mut visit: impl FnMut(u32)) {
        for side in 3 * face..3 * face + 3 {
            self.ring(side, |other| visit(other / 3));
        }
    }

    /// Visits the corners of all faces about the start of a side, as sides that start there: each at the first face
    /// that has it.
    fn ring(&self, side: u32, mut visit: impl FnMut(u32)) {
        let (face, k) = (side / 3, side % 3);
        let start = self.start_of(side);
        let at = self.vertices[start as usize];
        visit(3 * face + (k + 1) % 3);
        visit(3 * face + (k + 2) % 3);
        // One way round; from a border once more the other way.
        for mut leave in [3 * face + (k + 2) % 3, side] {
            let mut whole = false;
            for _ in 0..RING_MAX {
                let entry = self.adjacency.twins[leave as usize];
                if entry == NONE {
                    // Over a seam the corner may be none of the faces beyond: those beside them are looked at, too,
                    // else a walk along a side that lies level ends there.
                    for other in self.adjacency.beyond(leave) {
                        for side in 3 * other..3 * other + 3 {
                            visit(side);
                            let beside = self.adjacency.twins[side as usize];
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
                    whole = true;
                    break;
                }
                let corners = self.faces[next as usize];
                // Without a branch on which corner it is: that is as good as random.
                let same = corners.map(|v| u32::from(v == start));
                let mut j = same[1] | same[2] << 1;
                if same == [0; 3] {
                    // Another vertex at the same place.
                    let there = |&j: &u32| self.vertices[corners[j as usize] as usize] == at;
                    let Some(other) = (0..3).find(there) else {
                        break;
                    };
                    j = other;
                }
                // Of a face that has it twice the first.
                j = if same[0] == 1 { 0 } else { j.min(2) };
                // Out by the other side at this corner, whichever way the face is turned. The side that was come in by
                // has been seen, and so has its other end.
                let (beside, opposite) = (3 * next + (j + 1) % 3, 3 * next + (j + 2) % 3);
                leave = if entry == 3 * next + j {
                    visit(opposite);
                    opposite
                } else {
                    visit(beside);
                    3 * next + j
                };
            }
            if whole {
                return;
            }
        }
    }

    /// The place of the surface that a point lies over, looking along `direction`: from `face` on, over its neighbours.
    ///
    /// * `direction` - unit, outward where the mesh is a solid.
    /// * returns - `None` where the surface ends or turns away on the way there, or it is more than 48 faces off.
    pub(crate) fn beneath(&self, mut face: u32, point: &Point, direction: &Vec3) -> Option<Point> {
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
                return Some(point - direction * lift);
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
            let entry = self.adjacency.twins[(3 * face + k) as usize];
            face = if entry == NONE {
                // Of several faces beyond a seam the one that is nearest to being over the point.
                let over = |other: &u32| self.off(*other, point, direction);
                let beyond = self.adjacency.beyond(3 * face + k);
                beyond.min_by(|x, y| over(x).total_cmp(&over(y)))?
            } else {
                entry / 3
            };
        }
        None
    }

    /// How far a point lies off a face, looking along `direction`, metres.
    fn off(&self, face: u32, point: &Point, direction: &Vec3) -> f64 {
        let sign = self
            .face_normal(face)
            .map_or(1.0, |n| n.dot(direction).signum());
        farthest_side(&self.triangle(face), point, direction, sign).1
    }
}

/// The side of a face that a point lies farthest beyond, looking along `direction`, and how far, metres.
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
