//! A mesh whose vertices its sender moves: its own data, and how its boxes follow.
//!
//! In: rows of vertices. Out: how far the farthest of them moved, at once; boxes that fit them tightly, step by step.
//!
//! Triangles always have the newest vertices, so leaf queries are exact. The boxes belong to older ones until they are
//! refitted: until then they contain their triangles when widened by [`Mesh::lag_m`], a sum of the updates' largest
//! displacements (not the displacement between two moments: a vertex that moved there and back has been there).
//!
//! The tree consists of the packs that rigid meshes have, with boxes along the axes of the mesh's frame: these are
//! merged from below without reading vertices, and the same kernels test them. Refused: oriented boxes (their axes
//! would have to be computed again, and a pack can be merged from boxes along its own axes only through all vertices
//! below); a tree of its own kind (the walks of two kinds of pairs would be duplicated).
//!
//! Vertices are f32, as on the wire: boxes then contain them without rounding.

use super::obb::ObbPack;
use super::topology::Sets;
use super::{Mesh, ObbTree, Tree};
use crate::limits::{DEFORMING_TRIANGLES_MAX, DEFORMING_VERTICES_MAX, EXTENT_MAX_M};
use crate::math::{Aabb, Point, ROUND, greater, lesser};
use crate::shape::ShapeError;
use crate::simd::aligned;
use crate::simd::obb::LANES;

mod bounds;
mod tree;

pub(crate) use tree::{NewTree, TreeJob};

/// Two corners of a box; the last number is padding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corners {
    low: [f32; 4],
    high: [f32; 4],
}

impl Corners {
    const NOTHING: Self = Self {
        low: [f32::INFINITY; 4],
        high: [f32::NEG_INFINITY; 4],
    };

    fn merge(&mut self, other: &Self) {
        for k in 0..4 {
            self.low[k] = lesser(self.low[k], other.low[k]);
            self.high[k] = greater(self.high[k], other.high[k]);
        }
    }
}

/// The data of a mesh that deforms.
#[derive(Clone, Debug)]
pub(super) struct Deform {
    /// The vertices as received, metres; the last number is padding.
    rows: Vec<[f32; 4]>,
    /// Around all boxes of each pack.
    around: Vec<Corners>,
    /// Running sum of each update's largest displacement, metres, rounded up.
    bent_m: f64,
    /// The same, but where the bounds of the whole mesh shrank by more, that counts.
    shed_m: f64,
    /// How far a vertex may be outside its boxes, metres.
    stale_m: f64,
    /// The same for the boxes that the refit in progress has done.
    fresh_m: f64,
    /// Packs left in the refit in progress; 0: there is none.
    left: usize,
    /// Surface of all boxes: of the round of refits in progress, of the last, and when the tree was built.
    surface: f32,
    last_surface: f32,
    built_surface: f32,
    /// Incremented when the tree is replaced.
    revision: u32,
}

impl Mesh {
    /// The same mesh as one that deforms.
    ///
    /// Its vertices are rounded to f32, as those on the wire are. From now on connectivity is defined by the corners'
    /// indices in the list of vertices, no longer by their coordinates.
    ///
    /// # Errors
    /// Too many triangles or vertices, a vertex too far out, or two vertices of faces in one place.
    pub(crate) fn into_deforming(mut self) -> Result<Self, ShapeError> {
        self.check_deforming()?;
        let rows = self.rows()?;
        for (vertex, row) in self.vertices.iter_mut().zip(&rows) {
            *vertex = point(row);
        }
        self.obb = ObbTree::aligned(&self.vertices, &self.faces);
        self.tree = Tree::none(self.centre);
        self.outline = None;
        self.balls = None;
        self.normals = Box::default();
        self.adjacency.forget_places(self.faces.len());
        let packs = self.obb.packs().len();
        self.deform = Some(Box::new(Deform {
            rows,
            around: vec![Corners::NOTHING; packs],
            bent_m: 0.0,
            shed_m: 0.0,
            stale_m: f64::INFINITY,
            fresh_m: 0.0,
            left: 0,
            surface: 0.0,
            last_surface: 0.0,
            built_surface: 0.0,
            revision: 0,
        }));
        self.refit(usize::MAX);
        self.measure();
        if let Some(deform) = &mut self.deform {
            deform.built_surface = deform.last_surface;
        }
        Ok(self)
    }

    /// Its vertices as in a message: with one that no message may contain, its place would stay unknown for ever.
    fn rows(&self) -> Result<Vec<[f32; 4]>, ShapeError> {
        #[allow(
            clippy::cast_possible_truncation,
            reason = "to the nearest: what is kept is what the body is from now on"
        )]
        let row = |v: &Point| [v.x as f32, v.y as f32, v.z as f32, 0.0];
        let rows: Vec<[f32; 4]> = self.vertices.iter().map(row).collect();
        let fits = |[x, y, z, _]: &[f32; 4]| can_be_vertices(&[[*x, *y, *z]]).is_ok();
        match rows.iter().position(|row| !fits(row)) {
            Some(at) => Err(ShapeError::Setting(format!(
                "it deforms, and its vertex {at} is {:e} m from its origin, where none can be sent: stay within {EXTENT_MAX_M:e} m",
                self.vertices[at].coords.amax()
            ))),
            None => Ok(rows),
        }
    }

    fn check_deforming(&self) -> Result<(), ShapeError> {
        let setting = |text: String| Err(ShapeError::Setting(text));
        if self.faces.len() > DEFORMING_TRIANGLES_MAX
            || self.vertices.len() > DEFORMING_VERTICES_MAX
        {
            return setting(format!(
                "it deforms and has {} triangles and {} vertices, more than {DEFORMING_TRIANGLES_MAX} and {DEFORMING_VERTICES_MAX}: simplify it, or split it over several bodies",
                self.faces.len(),
                self.vertices.len()
            ));
        }
        let mut named: Vec<u32> = self.faces.iter().flatten().copied().collect();
        named.sort_unstable();
        named.dedup();
        let place = |v: u32| self.vertices[v as usize].coords.map(|x| x + 0.0);
        let compare = |a: u32, b: u32| {
            let (p, q) = (place(a), place(b));
            let orders = (0..3).map(|k| p[k].total_cmp(&q[k]));
            orders.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        };
        named.sort_unstable_by(|&a, &b| compare(a, b).then(a.cmp(&b)));
        let double = named.windows(2).find(|w| compare(w[0], w[1]).is_eq());
        if let Some(&[a, b]) = double {
            return setting(format!(
                "it deforms, and its vertices {a} and {b} are in one place: what hangs together would part when they do; name one of them in all faces"
            ));
        }
        Ok(())
    }

    /// Whether its vertices may be moved.
    #[must_use]
    pub fn is_deforming(&self) -> bool {
        self.deform.is_some()
    }

    /// How far a vertex may be outside its boxes in the tree, metres; 0 for a rigid mesh.
    #[inline]
    pub(crate) fn lag_m(&self) -> f64 {
        self.deform.as_ref().map_or(0.0, |deform| deform.stale_m)
    }

    /// Running sum of each update's largest displacement, metres, rounded up; 0 for a rigid mesh.
    #[inline]
    pub(crate) fn bent_m(&self) -> f64 {
        self.deform.as_ref().map_or(0.0, |deform| deform.bent_m)
    }

    /// A different number means a different tree.
    #[inline]
    pub(crate) fn tree_revision(&self) -> u32 {
        self.deform.as_ref().map_or(0, |deform| deform.revision)
    }

    /// Moves vertices.
    ///
    /// * `first` - index of the first; all of them exist, every number is finite and below `EXTENT_MAX_M`.
    /// * returns - the largest displacement, metres, rounded up; 0 for a rigid mesh, which stays as it is.
    ///
    /// Cost: some 4 ns a vertex; no allocation.
    pub(crate) fn bend(&mut self, first: usize, moved: &[[f32; 3]]) -> f64 {
        let Some(deform) = self.deform.as_mut() else {
            return 0.0;
        };
        let whole = first == 0 && moved.len() == deform.rows.len();
        let rows = deform.rows.iter_mut().skip(first);
        let vertices = self.vertices.iter_mut().skip(first);
        let (mut step, mut far) = (0.0_f64, 0.0_f64);
        let mut around = Corners::NOTHING;
        for ((row, vertex), &[x, y, z]) in rows.zip(vertices).zip(moved) {
            let now = [x, y, z, 0.0];
            let to = point(&now);
            step = step.max((to - *vertex).norm_squared());
            far = far.max((to - self.centre).norm_squared());
            around.merge(&Corners {
                low: now,
                high: now,
            });
            (*row, *vertex) = (now, to);
        }
        // Differences, squares and a root of f64: a few units of roundoff.
        let up = |square: f64| square.sqrt() * (1.0 + 8.0 * ROUND);
        let (step_m, far_m) = (up(step), up(far) + 8.0 * ROUND * self.centre.coords.amax());
        let then = (self.bounds, self.radius);
        let before = deform.fitted(&self.bounds, &self.centre);
        let add = |sum: f64| (sum + step_m) * (1.0 + 2.0 * ROUND);
        deform.bent_m = add(deform.bent_m);
        deform.stale_m = add(deform.stale_m);
        if deform.left > 0 {
            deform.fresh_m = add(deform.fresh_m);
        }
        let bounds = aabb(&around);
        if whole {
            (self.bounds, self.radius) = (bounds, far_m);
        } else if !moved.is_empty() {
            // Unmoved vertices are within the root's boxes, and these are no wider than what was reached since the last
            // round.
            let (around, radius) = before.unwrap_or(then);
            self.bounds = around.merged(&bounds);
            self.radius = radius.min(self.radius).max(far_m);
        }
        deform.note_shed(step_m, &then, &(self.bounds, self.radius));
        step_m
    }

    /// Fits boxes to the vertices, at most `packs_max` packs of them, continuing where it stopped.
    ///
    /// * returns - number of packs done. After the last of a round, [`Mesh::lag_m`] is the motion since the round
    ///   began: 0 if there was none.
    ///
    /// Source: the bottom-up update of van den Bergen 1997, "Efficient collision detection of complex deformable models
    /// using AABB trees", section 5.
    pub(crate) fn refit(&mut self, packs_max: usize) -> usize {
        let Some(deform) = self.deform.as_mut() else {
            return 0;
        };
        if deform.stale_m == 0.0 {
            return 0;
        }
        let packs = self.obb.packs_mut();
        if deform.left == 0 {
            (deform.left, deform.fresh_m, deform.surface) = (packs.len(), 0.0, 0.0);
        }
        let from = deform.left.saturating_sub(packs_max);
        let done = deform.left - from;
        let range = from..deform.left;
        let Deform { rows, around, .. } = &mut **deform;
        let surface = fit(packs, around, (rows, &self.faces), range);
        deform.surface += surface;
        deform.left = from;
        if from == 0 {
            deform.stale_m = deform.fresh_m;
            deform.last_surface = deform.surface;
        }
        done
    }
}

/// Whether all numbers of some rows are acceptable: finite, and within the extent limit.
pub(crate) fn can_be_vertices(rows: &[[f32; 3]]) -> Result<(), NoVertex> {
    // A sum of squares is finite if all are, except for overflow: then the slow check finds nothing.
    let all = |fits: fn(f32) -> bool| rows.iter().all(|[x, y, z]| fits(*x) & fits(*y) & fits(*z));
    #[allow(clippy::cast_possible_truncation, reason = "1e9 is near enough in f32")]
    const FAR: f32 = EXTENT_MAX_M as f32;
    if all(|x| x.abs() <= FAR) {
        Ok(())
    } else if all(f32::is_finite) {
        Err(NoVertex::TooFar)
    } else {
        Err(NoVertex::NotFinite)
    }
}

/// Why rows cannot be vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoVertex {
    /// NaN or infinity.
    NotFinite,
    /// Beyond `EXTENT_MAX_M`.
    TooFar,
}

impl super::Adjacency {
    /// Keeps what is defined by the corners' indices, and drops what was measured: seams and smooth regions. Faces
    /// connected over edges form one region from now on: contacts are distinguished by their normals.
    fn forget_places(&mut self, faces: usize) {
        let mut sets = Sets::new(faces);
        for (side, &twin) in (0u32..).zip(self.twins()) {
            if twin != super::adjacency::NONE {
                sets.join(side / 3, twin / 3, false);
            }
        }
        self.replace_measured((0u32..).take(faces).map(|i| sets.root(i).0).collect());
    }
}

fn point(row: &[f32; 4]) -> Point {
    Point::new(f64::from(row[0]), f64::from(row[1]), f64::from(row[2]))
}

fn aabb(corners: &Corners) -> Aabb {
    Aabb {
        min: point(&corners.low),
        max: point(&corners.high),
    }
}

#[inline(always)]
fn around(rows: &[[f32; 4]], face: &[u32; 3]) -> Corners {
    let [a, b, c] = face.map(|v| rows[v as usize]);
    let mut corners = Corners { low: a, high: a };
    corners.merge(&Corners { low: b, high: b });
    corners.merge(&Corners { low: c, high: c });
    corners
}

/// Fits packs to vertices, those below having been fitted first; returns an eighth of the surface of their boxes.
fn fit(
    packs: &mut [ObbPack],
    boxes: &mut [Corners],
    (rows, faces): (&[[f32; 4]], &[[u32; 3]]),
    range: std::ops::Range<usize>,
) -> f32 {
    let mut surface = [0.0; LANES];
    // A pack comes before those below it.
    for at in range.rev() {
        let pack = &mut packs[at];
        let mut all = Corners::NOTHING;
        // Lanes without a box stay points at the origin.
        let (mut low, mut high) = ([[0.0; 4]; LANES], [[0.0; 4]; LANES]);
        let mut mask = pack.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let corners = match pack.below(lane) {
                super::Held::Pack(below) => boxes[below as usize],
                super::Held::Triangle(face) => around(rows, &faces[face as usize]),
            };
            all.merge(&corners);
            (low[lane], high[lane]) = (corners.low, corners.high);
        }
        pack.reach = aligned::set(&mut pack.boxes, &low, &high, &mut surface);
        boxes[at] = all;
    }
    surface.iter().sum()
}

#[cfg(test)]
mod tests;
