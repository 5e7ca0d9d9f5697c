//! What a plan looks at: the bodies of a world, counted.

use crate::shape::Geometry;
use crate::world::World;

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
    pub(super) fn of(world: &World) -> Self {
        let mut facts = Self {
            rules: world.filters().rules_count(),
            ignored: world.ignored_pairs_count(),
            ..Self::default()
        };
        for (_, body) in world.bodies() {
            facts.bodies += 1;
            facts.moving += u64::from(body.moves);
            facts.boxes += usize::from(!body.unbounded);
            if !body.unbounded {
                let size_m = 2.0 * body.radius;
                let [least, largest] = facts.size_m.unwrap_or([size_m; 2]);
                facts.size_m = Some([least.min(size_m), largest.max(size_m)]);
            }
            facts.several_shapes += u64::from(body.shapes.len() > 1);
            facts.continuous += u64::from(
                body.path
                    .as_ref()
                    .is_some_and(|path| path.is_of_continuous()),
            );
            facts.deforming += u64::from(body.vertices.is_some());
            facts.stale_by_speed += u64::from(body.max_speed_mps.is_some());
            for placed in body.shapes.iter() {
                match &placed.shape.geometry {
                    Geometry::Convex(_) => facts.shapes[0] += 1,
                    Geometry::Mesh(mesh) => {
                        facts.shapes[1] += 1;
                        facts.triangles += mesh.faces().len() as u64;
                        if mesh.is_deforming() {
                            facts.bending[0] += mesh.faces().len() as u64;
                            facts.bending[1] += mesh.vertices().len() as u64;
                        }
                    }
                    Geometry::HalfSpace { .. } => facts.shapes[2] += 1,
                }
            }
        }
        facts.size_m = facts.size_m.map(|sizes| sizes.map(three_figures));
        facts
    }
}

/// A length as it is told: the last bits of a ball around a body are nobody's news.
fn three_figures(length_m: f64) -> f64 {
    format!("{length_m:.2e}").parse().unwrap_or(length_m)
}
