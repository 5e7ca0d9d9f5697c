//! The facts that a plan depends on: the bodies of a world, counted by kind.
//!
//! In: a world, and the slots that edits have touched. Out: [`Facts`]. An edit costs what it touches and a look at each
//! kind, not at each body.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ids::BodySlot;
use crate::shape::Geometry;
use crate::world::{Body, World};

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Facts {
    pub(super) bodies: u64,
    pub(super) moving: u64,
    pub(super) boxes: usize,
    pub(super) shapes: [u64; 3],
    pub(super) triangles: u64,
    pub(super) several_shapes: u64,
    pub(super) stale_by_speed: u64,
    pub(super) continuous: u64,
    pub(super) deforming: u64,
    /// Triangles and vertices of those.
    pub(super) bending: [u64; 2],
    pub(super) size_m: Option<[f64; 2]>,
    /// Rules of pairs.
    pub(super) rules: usize,
    /// Pairs that rules, neighbours and groups ignore.
    pub(super) ignored: u64,
}

impl Facts {
    pub(super) fn of(world: &World, kinds: &Kinds) -> Self {
        let mut facts = Self {
            rules: world.filters().rules_count(),
            ignored: world.ignored_pairs_count(),
            ..Self::default()
        };
        let mut sizes = None;
        for (kind, &count) in &kinds.counts {
            let of = |holds: bool| if holds { count } else { 0 };
            facts.bodies += count;
            facts.moving += of(kind.moves);
            if let Some(size) = kind.size {
                facts.boxes += usize::try_from(count).unwrap_or(usize::MAX);
                let (least, largest) = sizes.unwrap_or((size, size));
                sizes = Some((size.min(least), size.max(largest)));
            }
            facts.several_shapes += of(kind.shapes.iter().sum::<u64>() > 1);
            facts.continuous += of(kind.continuous);
            facts.deforming += of(kind.deforms);
            facts.stale_by_speed += of(kind.has_speed);
            for (sum, own) in facts.shapes.iter_mut().zip(kind.shapes) {
                *sum += count * own;
            }
            facts.triangles += count * kind.triangles;
            for (sum, own) in facts.bending.iter_mut().zip(kind.bending) {
                *sum += count * own;
            }
        }
        facts.size_m = sizes.map(|(least, largest)| [least.in_m(), largest.in_m()]);
        facts
    }
}

/// How many bodies of each kind there are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kinds {
    of_slot: Vec<Option<Arc<Kind>>>,
    counts: BTreeMap<Arc<Kind>, u64>,
}

impl Kinds {
    /// The facts of a world. Cost: O(bodies).
    #[must_use]
    pub fn of(world: &World) -> Self {
        let mut kinds = Self::default();
        for (slot, body) in world.bodies() {
            kinds.set(slot, Some(Kind::of(body)));
        }
        kinds
    }

    /// Recounts the bodies that the edits of this tick touched.
    pub fn follow(&mut self, world: &World) {
        for &slot in world.edited_slots() {
            self.set(slot, world.body(slot).map(Kind::of));
        }
    }

    /// Checks that each body is counted once and with its current properties.
    ///
    /// # Errors
    /// The inconsistency found.
    pub fn validate(&self, world: &World) -> Result<(), String> {
        let own = self.of_slot.iter().flatten();
        let counted = own.fold(BTreeMap::new(), |mut counts, kind| {
            *counts.entry(Arc::clone(kind)).or_default() += 1;
            counts
        });
        let there = world.bodies().count();
        if counted != self.counts || self.of_slot.iter().flatten().count() != there {
            return Err("the plan has lost count of the bodies".to_owned());
        }
        for (slot, body) in world.bodies() {
            let mut kind = Kind::of(body);
            let counted = self.of_slot.get(slot.index()).and_then(Option::as_deref);
            if kind.deforms {
                // As large as it was when it was put.
                kind.size = counted.and_then(|counted| counted.size);
            }
            if counted != Some(&kind) {
                return Err(format!(
                    "the plan counts body `{}` as another one",
                    body.name
                ));
            }
        }
        Ok(())
    }

    fn set(&mut self, slot: BodySlot, kind: Option<Kind>) {
        if self.of_slot.len() <= slot.index() {
            self.of_slot.resize(slot.index() + 1, None);
        }
        let Some(place) = self.of_slot.get_mut(slot.index()) else {
            return;
        };
        if let Some(old) = place.take()
            && let Some(count) = self.counts.get_mut(&old)
        {
            *count -= 1;
            if *count == 0 {
                self.counts.remove(&old);
            }
        }
        let Some(kind) = kind else { return };
        // Bodies of one kind share it.
        let known = self
            .counts
            .get_key_value(&kind)
            .map(|(known, _)| Arc::clone(known));
        let kind = known.unwrap_or_else(|| Arc::new(kind));
        *self.counts.entry(Arc::clone(&kind)).or_default() += 1;
        *place = Some(kind);
    }
}

/// What of a body counts.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    moves: bool,
    continuous: bool,
    deforms: bool,
    /// Whether its `max_speed_mps` is known.
    has_speed: bool,
    /// `None`: a half-space.
    size: Option<Size>,
    /// Convex shapes, meshes, half-spaces.
    shapes: [u64; 3],
    triangles: u64,
    /// Triangles and vertices that deform.
    bending: [u64; 2],
}

impl Kind {
    fn of(body: &Body) -> Self {
        let path = body.path.as_ref();
        let mut kind = Self {
            moves: body.moves,
            continuous: path.is_some_and(|path| path.is_of_continuous()),
            deforms: body.vertices.is_some(),
            has_speed: body.max_speed_mps.is_some(),
            size: (!body.unbounded).then(|| Size::of(2.0 * body.radius)),
            shapes: [0; 3],
            triangles: 0,
            bending: [0; 2],
        };
        for placed in body.shapes.iter() {
            match &placed.shape.geometry {
                Geometry::Convex(_) => kind.shapes[0] += 1,
                Geometry::Mesh(mesh) => {
                    kind.shapes[1] += 1;
                    kind.triangles += mesh.faces().len() as u64;
                    if mesh.is_deforming() {
                        kind.bending[0] += mesh.faces().len() as u64;
                        kind.bending[1] += mesh.vertices().len() as u64;
                    }
                }
                Geometry::HalfSpace { .. } => kind.shapes[2] += 1,
            }
        }
        kind
    }
}

/// A length to three significant figures, so that rounding errors of bounding spheres do not change the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Size {
    /// Decimal exponent of the first figure.
    exponent: i32,
    /// 100 to 999; 0 of no length.
    figures: i32,
}

impl Size {
    #[allow(clippy::cast_possible_truncation, reason = "both are small")]
    fn of(length_m: f64) -> Self {
        if !(length_m.is_normal() && length_m > 0.0) {
            return Self {
                exponent: i32::MIN,
                figures: 0,
            };
        }
        // The logarithm of a power of ten may be slightly off.
        let exponent = length_m.log10().floor() as i32;
        let figures = (length_m / 10f64.powi(exponent - 2)).round() as i32;
        match figures {
            ..100 => Self {
                exponent: exponent - 1,
                figures: 999,
            },
            1000.. => Self {
                exponent: exponent + 1,
                figures: 100,
            },
            figures => Self { exponent, figures },
        }
    }

    fn in_m(self) -> f64 {
        if self.figures == 0 {
            return 0.0;
        }
        let text = format!("{}e{}", self.figures, self.exponent - 2);
        text.parse().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_the_three_figures_of_their_numbers() {
        for length_m in [
            1e-6, 1.2345e-3, 0.1, 0.3, 0.999_6, 1.0, 9.994, 99.96, 100.0, 123.4, 1e4, 2e7,
        ] {
            let wanted: f64 = format!("{length_m:.2e}").parse().unwrap();
            assert_eq!(Size::of(length_m).in_m().to_bits(), wanted.to_bits());
        }
        assert_eq!(Size::of(0.0).in_m().to_bits(), 0.0_f64.to_bits());
        assert!(Size::of(0.0) < Size::of(1e-6) && Size::of(9.99) < Size::of(10.0));
        assert!(Size::of(1.2) < Size::of(1.3) && Size::of(0.9) < Size::of(1.2));
    }
}
