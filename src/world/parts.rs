//! The shapes of a body, and the tree over them where there are several.

use std::ops::Deref;
use std::sync::Arc;

use crate::math::Pose;
use crate::shape::{Geometry, ObbTree, Shape};

/// A shape with its pose in a body.
#[derive(Clone, Debug)]
pub struct PlacedShape {
    /// Shared geometry.
    pub shape: Arc<Shape>,
    /// Its pose in the body's frame.
    pub pose: Pose,
}

impl PlacedShape {
    /// Greatest distance of any of its defining coordinates from its body's origin, metres: of its points, or of a
    /// half-space's plane.
    pub(crate) fn reach_m(&self) -> f64 {
        let own = match &self.shape.geometry {
            Geometry::HalfSpace { offset, .. } => offset.abs(),
            Geometry::Convex(_) | Geometry::Mesh(_) => {
                self.shape.centre.coords.norm() + self.shape.radius
            }
        };
        self.pose.translation.vector.norm() + own
    }
}

/// The shapes of a body in the scene's order, as a slice. A clone shares them.
#[derive(Clone, Debug)]
pub struct Parts {
    shapes: Arc<[PlacedShape]>,
    /// For a body of several shapes.
    tree: Option<Arc<PartTree>>,
}

/// The tree over the shapes of a body.
#[derive(Debug)]
pub(crate) struct PartTree {
    /// Boxes around the shapes, body frame; a leaf holds the index of a shape in the body. `None`: every shape is a
    /// half-space.
    pub(crate) boxes: Option<ObbTree>,
    /// Indices of the half-spaces, which fit into no box.
    pub(crate) planes: Vec<u32>,
    /// Greatest [`PlacedShape::reach_m`].
    pub(crate) reach_m: f64,
}

impl Parts {
    /// Builds the tree if there are several.
    ///
    /// Cost: O(n log n), some 1 us per shape.
    #[must_use]
    pub fn new(shapes: Arc<[PlacedShape]>) -> Self {
        let tree = (shapes.len() > 1).then(|| Arc::new(PartTree::over(&shapes)));
        Self { shapes, tree }
    }

    /// The tree over them; `None`: there is only one shape.
    pub(crate) fn tree(&self) -> Option<&PartTree> {
        self.tree.as_deref()
    }

    /// The single shape of a body that deforms, mutable; other owners keep the old state.
    pub(super) fn only_mut(&mut self) -> Option<&mut PlacedShape> {
        match Arc::make_mut(&mut self.shapes) {
            [only] => Some(only),
            _ => None,
        }
    }
}

impl PartTree {
    fn over(shapes: &[PlacedShape]) -> Self {
        let (mut boxes, mut planes) = (Vec::with_capacity(shapes.len()), Vec::new());
        for (place, placed) in (0..).zip(shapes) {
            if placed.shape.radius.is_finite() {
                boxes.push((place, placed.pose, placed.shape.aabb));
            } else {
                planes.push(place);
            }
        }
        Self {
            boxes: (!boxes.is_empty()).then(|| ObbTree::over(&boxes)),
            planes,
            reach_m: shapes.iter().map(PlacedShape::reach_m).fold(0.0, f64::max),
        }
    }
}

impl Deref for Parts {
    type Target = [PlacedShape];

    fn deref(&self) -> &[PlacedShape] {
        &self.shapes
    }
}

impl From<Vec<PlacedShape>> for Parts {
    fn from(shapes: Vec<PlacedShape>) -> Self {
        Self::new(shapes.into())
    }
}

impl<const N: usize> From<[PlacedShape; N]> for Parts {
    fn from(shapes: [PlacedShape; N]) -> Self {
        Self::new(Arc::new(shapes))
    }
}

impl FromIterator<PlacedShape> for Parts {
    fn from_iter<I: IntoIterator<Item = PlacedShape>>(shapes: I) -> Self {
        Self::new(shapes.into_iter().collect())
    }
}
