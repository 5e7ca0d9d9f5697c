//! A static tree of oriented boxes over triangles, eight children a node: one triangle a leaf.
//!
//! In: triangles. Out: packs of eight boxes for `simd::obb`, each pack in f32 relative to an f64 origin of its own, so
//! that rounding is relative to the neighbourhood and not to the whole mesh. Boxes contain their triangles exactly:
//! half sides are measured in f64 against the rounded axes and centre, and rounded up.
//!
//! Source: Gottschalk, Lin, Manocha 1996, OBBTree; axes are those of the area's covariance, or of the mesh's frame
//! where these fit tighter.

use nalgebra::Matrix3;

mod boxes;
mod fit;

use fit::{Fitted, fit};

use crate::math::{Aabb, Point, ROUND, Vec3, f32_down, f32_up};
use crate::simd::obb::{LANES, Pack};

/// Marks a leaf in [`ObbPack::link`].
const LEAF: u32 = 1 << 31;

/// A box of the tree, by its pack and lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BoxId(pub(crate) u32);

impl BoxId {
    /// The box around everything.
    pub(crate) const ROOT: Self = Self(0);

    /// A lane of a pack.
    pub(crate) fn new(pack: u32, lane: u32) -> Self {
        Self(pack * LANES_U32 + lane)
    }

    /// The pack it is in.
    pub(crate) fn pack(self) -> u32 {
        self.0 / LANES_U32
    }

    /// Its place in the pack.
    pub(crate) fn lane(self) -> usize {
        (self.0 % LANES_U32) as usize
    }
}

#[allow(clippy::cast_possible_truncation, reason = "8")]
const LANES_U32: u32 = LANES as u32;

/// Up to eight boxes that share a parent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObbPack {
    /// The boxes.
    pub(crate) boxes: Pack,
    /// The origin of their centres, mesh's frame.
    pub(crate) origin: Point,
    /// Greatest sum of a centre's coordinates and half sides, metres: the scale of rounding.
    pub(crate) reach: f32,
    /// A bit for each lane that holds a box.
    pub(crate) mask: u8,
    link: [u32; LANES],
}

/// What a box holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Held {
    /// One triangle, by its index in the mesh; in a tree over the shapes of a body, one shape.
    Triangle(u32),
    /// The boxes of a pack.
    Pack(u32),
}

/// A single box, mesh's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Obb {
    /// Centre, metres.
    pub(crate) centre: Point,
    /// Unit axes up to rounding to f32, one a column.
    pub(crate) axes: Matrix3<f64>,
    /// Half sides, metres.
    pub(crate) half: [f32; 3],
}

impl Obb {
    /// Stands for an unknown box.
    pub(crate) const EVERYWHERE: Self = Self {
        centre: Point::new(0.0, 0.0, 0.0),
        axes: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        half: [1e18; 3],
    };

    /// An aligned box as an oriented one.
    pub(crate) fn around(aabb: &Aabb) -> Self {
        let centre = aabb.centre();
        let half = |k: usize| f32_up((aabb.max[k] - centre[k]).max(centre[k] - aabb.min[k]));
        Self {
            centre,
            axes: Matrix3::identity(),
            half: [half(0), half(1), half(2)],
        }
    }
}

/// The tree. Pack 0 holds only the root; a pack comes before those below it.
#[derive(Clone, Debug)]
pub(crate) struct ObbTree {
    packs: Vec<ObbPack>,
}

impl ObbTree {
    /// A tree over at least one triangle.
    ///
    /// Cost: O(n log n), some 3 us a triangle.
    pub(crate) fn new(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        let corners = |face: u32| faces[face as usize].map(|v| vertices[v as usize]);
        let mut order = middles(vertices, faces);
        let mut tree = Self {
            packs: Vec::with_capacity(faces.len() / 6 + 2),
        };
        tree.packs.push(ObbPack::empty());
        let link = if order.len() == 1 {
            order[0].0 | LEAF
        } else {
            tree.build(&mut order, &corners)
        };
        let root = fit(&order, &corners);
        tree.packs[0] = ObbPack::of(&[(root, link)]);
        tree
    }

    /// A tree over at least one triangle, with boxes along the axes of the mesh's frame that are measured later;
    /// centres are relative to the origin of that frame.
    pub(super) fn aligned(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        let mut tree = Self {
            packs: Vec::with_capacity(faces.len() / 6 + 2),
        };
        let mut order = middles(vertices, faces);
        tree.packs.push(ObbPack::aligned(1));
        tree.packs[0].link[0] = if order.len() == 1 {
            order[0].0 | LEAF
        } else {
            tree.lay_out(&mut order)
        };
        tree
    }

    /// Appends aligned packs over `order`, at least two triangles; returns the index of the first.
    fn lay_out(&mut self, order: &mut [(u32, Vec3)]) -> u32 {
        let place = self.packs.len();
        let parts = split(order, parts_of(order.len()));
        self.packs.push(ObbPack::aligned(parts.len()));
        for (lane, part) in parts.into_iter().enumerate() {
            self.packs[place].link[lane] = if let [(face, _)] = part {
                *face | LEAF
            } else {
                self.lay_out(part)
            };
        }
        u32::try_from(place).unwrap_or(0)
    }

    /// The packs, to be measured again.
    pub(super) fn packs_mut(&mut self) -> &mut [ObbPack] {
        &mut self.packs
    }

    /// The packs.
    pub(crate) fn packs(&self) -> &[ObbPack] {
        &self.packs
    }

    /// What a box holds.
    pub(crate) fn held(&self, id: BoxId) -> Held {
        self.packs[id.pack() as usize].below(id.lane())
    }

    /// A single box.
    pub(crate) fn get(&self, id: BoxId) -> Obb {
        let pack = &self.packs[id.pack() as usize];
        let (boxes, lane) = (&pack.boxes, id.lane());
        let at = |k: usize| f64::from(boxes.centre[k][lane]);
        Obb {
            centre: pack.origin + Vec3::new(at(0), at(1), at(2)),
            axes: Matrix3::from_fn(|row, column| f64::from(boxes.axes[column][row][lane])),
            half: boxes.half.map(|row| row[lane]),
        }
    }

    /// Appends the packs over `order`, at least two triangles; returns the index of the first.
    fn build(&mut self, order: &mut [(u32, Vec3)], corners: &impl Fn(u32) -> [Point; 3]) -> u32 {
        let place = self.packs.len();
        self.packs.push(ObbPack::empty());
        let parts = parts_of(order.len());
        let mut boxes = Vec::with_capacity(LANES);
        for part in split(order, parts) {
            let link = if let [(face, _)] = part {
                *face | LEAF
            } else {
                self.build(part, corners)
            };
            boxes.push((fit(part, corners), link));
        }
        self.packs[place] = ObbPack::of(&boxes);
        u32::try_from(place).unwrap_or(0)
    }
}

/// Each triangle and its middle.
fn middles(vertices: &[Point], faces: &[[u32; 3]]) -> Vec<(u32, Vec3)> {
    let middle = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| vertices[v as usize].coords);
        (a + b + c) / 3.0
    };
    (0u32..)
        .zip(faces)
        .map(|(i, face)| (i, middle(face)))
        .collect()
}

/// How many children a pack over this many triangles gets. Full packs below: as few children as suffice, each a power
/// of eight or a little less.
fn parts_of(triangles: usize) -> usize {
    let mut below = 1;
    while below * LANES < triangles {
        below *= LANES;
    }
    triangles.div_ceil(below)
}

/// Splits triangles into `parts` groups of nearly equal size, by halves along the longest axis of their middles.
fn split(order: &mut [(u32, Vec3)], parts: usize) -> Vec<&mut [(u32, Vec3)]> {
    if parts <= 1 {
        return vec![order];
    }
    let (mut low, mut high) = (order[0].1, order[0].1);
    for (_, middle) in order.iter() {
        low = low.inf(middle);
        high = high.sup(middle);
    }
    let axis = (high - low).imax();
    let left = parts / 2;
    let at = order.len() * left / parts;
    order.select_nth_unstable_by(at, |a, b| {
        a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0))
    });
    let (one, other) = order.split_at_mut(at);
    let mut all = split(one, left);
    all.extend(split(other, parts - left));
    all
}

impl ObbPack {
    /// `boxes` boxes along the axes of the frame, of no size yet.
    fn aligned(boxes: usize) -> Self {
        let mut pack = Self::empty();
        for k in 0..3 {
            pack.boxes.axes[k][k] = [1.0; LANES];
        }
        pack.mask = u8::MAX >> (LANES - boxes.clamp(1, LANES));
        pack
    }

    /// What the box of a lane holds.
    #[inline]
    pub(super) fn below(&self, lane: usize) -> Held {
        let link = self.link[lane];
        if link & LEAF == 0 {
            Held::Pack(link)
        } else {
            Held::Triangle(link & !LEAF)
        }
    }

    fn empty() -> Self {
        Self {
            boxes: Pack::EMPTY,
            origin: Point::origin(),
            reach: 0.0,
            mask: 0,
            link: [LEAF; LANES],
        }
    }

    /// Rounds boxes to f32 and measures the half sides that they then need.
    fn of(fitted: &[(Fitted, u32)]) -> Self {
        let mut pack = Self::empty();
        let mean = fitted.iter().map(|(f, _)| f.centre.coords).sum::<Vec3>();
        #[allow(clippy::cast_precision_loss, reason = "at most eight")]
        let count = fitted.len() as f64;
        pack.origin = Point::from(mean / count);
        for (lane, (fitted, link)) in fitted.iter().enumerate() {
            let centre = (fitted.centre - pack.origin).map(|x| f64::from(f32_down(x)));
            let axes = fitted.axes.map(|x| f64::from(f32_down(x)));
            let mut half = Vec3::zeros();
            for p in &fitted.corners {
                half = half.sup(&axes.tr_mul(&((p - pack.origin) - centre)).abs());
            }
            let half = half * (1.0 + 16.0 * ROUND);
            let mut reach = 0.0;
            for k in 0..3 {
                pack.boxes.centre[k][lane] = f32_down(centre[k]);
                pack.boxes.half[k][lane] = f32_up(half[k]);
                reach += centre[k].abs() + f64::from(pack.boxes.half[k][lane]);
                for j in 0..3 {
                    pack.boxes.axes[k][j][lane] = f32_down(axes[(j, k)]);
                }
            }
            pack.reach = pack.reach.max(f32_up(reach));
            pack.mask |= 1 << lane;
            pack.link[lane] = *link;
        }
        pack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bumpy sheet far from the origin of its frame.
    fn sheet(cells: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
        let n = cells + 1;
        let mut vertices = Vec::new();
        let mut faces = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let (x, y) = (
                    f64::from(j) / f64::from(cells),
                    f64::from(i) / f64::from(cells),
                );
                vertices.push(Point::new(
                    x + 1e3,
                    y,
                    0.2 * (7.0 * x).sin() * (5.0 * y).cos(),
                ));
                if i < cells && j < cells {
                    let (a, b, c, d) = (
                        i * n + j,
                        i * n + j + 1,
                        (i + 1) * n + j + 1,
                        (i + 1) * n + j,
                    );
                    faces.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        (vertices, faces)
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_in_every_box_above_it() {
        for cells in [1, 2, 3, 7, 20] {
            let (vertices, faces) = sheet(cells);
            let tree = ObbTree::new(&vertices, &faces);
            let mut seen = vec![0; faces.len()];
            let mut stack = vec![(BoxId::ROOT, Vec::<Obb>::new())];
            while let Some((id, mut above)) = stack.pop() {
                above.push(tree.get(id));
                match tree.held(id) {
                    Held::Pack(pack) => {
                        let lanes =
                            (0..8).filter(|l| tree.packs()[pack as usize].mask >> l & 1 == 1);
                        stack.extend(lanes.map(|l| (BoxId::new(pack, l), above.clone())));
                    }
                    Held::Triangle(face) => {
                        seen[face as usize] += 1;
                        for (of, v) in above
                            .iter()
                            .flat_map(|of| faces[face as usize].map(|v| (of, v)))
                        {
                            let on = of.axes.tr_mul(&(vertices[v as usize] - of.centre)).abs();
                            for k in 0..3 {
                                assert!(on[k] <= f64::from(of.half[k]) + 1e-12, "{on:?} {of:?}");
                            }
                        }
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn triangles_without_area_and_single_ones_have_boxes() {
        let p = Point::new(1.0, 2.0, 3.0);
        for corners in [
            [p, p, p + Vec3::x()],
            [p, p + Vec3::x(), p + Vec3::x() * 2.0],
            [p, p + Vec3::x(), p + Vec3::y()],
        ] {
            let tree = ObbTree::new(&corners, &[[0, 1, 2], [0, 1, 2], [0, 1, 2]]);
            assert_eq!(tree.packs().len(), 2);
            let root = tree.get(BoxId::ROOT);
            assert!(root.half.iter().all(|h| h.is_finite()));
            let one = ObbTree::new(&corners, &[[0, 1, 2]]);
            assert_eq!(one.held(BoxId::ROOT), Held::Triangle(0));
        }
    }
}
