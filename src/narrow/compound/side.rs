//! One body of a pair as boxes: the tree over its shapes, or the box of its only one; half-spaces are kept separately.

use crate::math::{Pose, ROUND, Vec3};
use crate::narrow::cover::Group;
use crate::narrow::mesh::Placed;
use crate::shape::{BoxId, Geometry, Held, Obb, ObbPack, ObbTree};
use crate::simd::obb::{GAP_ROUND, LANES};
use crate::world::{Body, PartTree, PlacedShape};

/// Marks a half-space in a [`BoxId`]: the rest is its place in the body, which is below `limits::SHAPES_PER_BODY_MAX`.
const PLANE: u32 = 1 << 30;

/// One body of a pair.
pub(super) struct Side<'a> {
    pub(super) body: &'a Body,
    /// For a body of several shapes.
    tree: Option<&'a PartTree>,
    /// For a body of one shape that has a box.
    whole: Obb,
}

/// A half-space in some frame: `normal . x <= offset`.
struct Plane {
    normal: Vec3,
    offset: f64,
}

impl<'a> Side<'a> {
    pub(super) fn of(body: &'a Body) -> Self {
        let tree = body.shapes.tree();
        let whole = match &*body.shapes {
            [only] if only.shape.radius.is_finite() => around(only),
            _ => Obb::EVERYWHERE,
        };
        Self { body, tree, whole }
    }

    /// The root boxes: everything is below one of them.
    pub(super) fn roots(&self) -> impl Iterator<Item = BoxId> {
        let boxes = self.tree.is_none_or(|tree| tree.boxes.is_some());
        let planes = self.tree.map_or(&[][..], |tree| &tree.planes);
        let root = boxes.then_some(BoxId::ROOT);
        root.into_iter()
            .chain(planes.iter().map(|place| BoxId(place | PLANE)))
    }

    /// What a box holds; a triangle stands for a shape.
    pub(super) fn held(&self, id: BoxId) -> Held {
        if id.0 & PLANE != 0 {
            return Held::Triangle(id.0 & !PLANE);
        }
        self.boxes()
            .map_or(Held::Triangle(0), |boxes| boxes.held(id))
    }

    /// The shape that a leaf stands for, and its place in the body.
    pub(super) fn shape(&self, id: BoxId) -> Option<(u32, &'a PlacedShape)> {
        match self.held(id) {
            Held::Triangle(place) => Some((place, self.body.shapes.get(place as usize)?)),
            Held::Pack(_) => None,
        }
    }

    /// Size of a box for comparisons: the sum of its half sides' squares, square metres.
    pub(super) fn size(&self, id: BoxId) -> f32 {
        self.obb(id).half.iter().map(|h| h * h).sum()
    }

    /// The pack of boxes that share a parent.
    pub(super) fn pack(&self, pack: u32) -> Option<&'a ObbPack> {
        self.boxes()?.packs().get(pack as usize)
    }

    fn boxes(&self) -> Option<&'a ObbTree> {
        self.tree?.boxes.as_ref()
    }

    fn obb(&self, id: BoxId) -> Obb {
        match self.boxes() {
            Some(boxes) if id.0 & PLANE == 0 => boxes.get(id),
            _ => self.whole,
        }
    }

    /// The half-space that a box stands for, body frame.
    fn plane(&self, id: BoxId) -> Option<Plane> {
        if id.0 & PLANE == 0 && self.tree.is_some() {
            return None;
        }
        let (_, placed) = self.shape(id)?;
        let Geometry::HalfSpace { normal, offset } = &placed.shape.geometry else {
            return None;
        };
        let normal = placed.pose.rotation * normal;
        let offset = offset + normal.dot(&placed.pose.translation.vector);
        Some(Plane { normal, offset })
    }

    /// Greatest distance of any of its coordinates from its body's origin, metres.
    fn reach_m(&self) -> f64 {
        match (self.tree, &*self.body.shapes) {
            (Some(tree), _) => tree.reach_m,
            (None, [only]) => only.reach_m(),
            // Not reached: without a tree there is only one.
            (None, _) => f64::INFINITY,
        }
    }
}

/// The relative pose of two bodies, prepared for their boxes.
pub(super) fn placed(a: &Side<'_>, b: &Side<'_>, rel: &Pose) -> Placed {
    let lag = |side: &Side<'_>| match &*side.body.shapes {
        [only] => only.shape.lag_m(),
        // Of bodies of several shapes none deforms.
        _ => 0.0,
    };
    Placed {
        lag_m: (lag(a) + lag(b)) * (1.0 + 2.0 * ROUND),
        ..Placed::new(rel, a.reach_m(), b.reach_m())
    }
}

/// The pairs of boxes that all pairs of shapes are below, but for those of two half-spaces: they have no gap (law 3.2).
pub(super) fn roots<'s>(a: &'s Side<'_>, b: &'s Side<'_>) -> impl Iterator<Item = (BoxId, BoxId)> {
    a.roots().flat_map(move |of_a| {
        let is_plane = a.plane(of_a).is_some();
        let others = b
            .roots()
            .filter(move |of_b| !(is_plane && b.plane(*of_b).is_some()));
        others.map(move |of_b| (of_a, of_b))
    })
}

/// The box that is kept and the pack that replaces the other, for two boxes of which at least one is no leaf.
pub(super) fn children((a, id_a): (&Side<'_>, BoxId), (b, id_b): (&Side<'_>, BoxId)) -> Group {
    let (held_a, held_b) = (a.held(id_a), b.held(id_b));
    let group = Group::parting((id_a, held_a), (id_b, held_b), || {
        b.size(id_b) > a.size(id_a)
    });
    let side = if group.pack_is_b { b } else { a };
    let mask = side.pack(group.pack).map_or(0, |pack| pack.mask);
    Group { mask, ..group }
}

/// Sound lower bounds on the gaps of a group's pairs, metres; zero or less if they may touch.
pub(super) fn gaps(group: &Group, (a, b): (&Side<'_>, &Side<'_>), at: &Placed) -> [f64; LANES] {
    let (one, other) = if group.pack_is_b { (a, b) } else { (b, a) };
    let Some(pack) = other.pack(group.pack) else {
        return [f64::NEG_INFINITY; LANES];
    };
    match one.plane(group.one) {
        Some(plane) => plane.seen_from_other(at, group.pack_is_b).gaps(pack, at),
        None => at.gaps(&one.obb(group.one), pack, group.pack_is_b),
    }
}

impl Plane {
    /// In B's frame if it is A's, in A's if it is B's.
    fn seen_from_other(&self, at: &Placed, is_a: bool) -> Self {
        let shift = at.pos12.translation.vector;
        if is_a {
            let normal = at.turn_to_b(&self.normal);
            let offset = self.offset - self.normal.dot(&shift);
            Self { normal, offset }
        } else {
            let normal = at.rotation * self.normal;
            let offset = self.offset + normal.dot(&shift);
            Self { normal, offset }
        }
    }

    /// A lower bound on the height of each box of a pack above it, metres. Lanes without a box yield arbitrary values.
    fn gaps(&self, pack: &ObbPack, at: &Placed) -> [f64; LANES] {
        let boxes = &pack.boxes;
        std::array::from_fn(|lane| {
            let centre =
                pack.origin.coords + Vec3::from_fn(|k, _| f64::from(boxes.centre[k][lane]));
            let reach: f64 = (0..3)
                .map(|k| {
                    let axis = Vec3::from_fn(|j, _| f64::from(boxes.axes[k][j][lane]));
                    f64::from(boxes.half[k][lane]) * self.normal.dot(&axis).abs()
                })
                .sum();
            // Axes in f32 are orthogonal only up to rounding.
            let half: f64 = (0..3).map(|k| f64::from(boxes.half[k][lane])).sum();
            let rounding =
                16.0 * ROUND * (centre.lp_norm(1) + self.offset.abs()) + GAP_ROUND * half;
            self.normal.dot(&centre) - reach - self.offset - at.slop - at.lag_m - rounding
        })
    }
}

/// The box around a placed shape, along the shape's own axes.
fn around(placed: &PlacedShape) -> Obb {
    let own = Obb::around(&placed.shape.aabb);
    Obb {
        centre: placed.pose * own.centre,
        axes: *placed.pose.rotation.to_rotation_matrix().matrix(),
        half: own.half,
    }
}
