//! Trees of bodies that deform, built anew off the tick.
//!
//! In: the wear of a tree. Out: a job that holds all it needs, for a worker; what it made goes in between two ticks.

use super::World;
use crate::ids::BodyId;
use crate::shape::{NewTree, TreeJob};

/// A tree to be built.
#[derive(Clone, Debug)]
pub struct WornTree {
    body: BodyId,
    generation: u32,
    job: TreeJob,
}

/// One that was.
#[derive(Clone, Debug)]
pub struct BuiltTree {
    body: BodyId,
    generation: u32,
    tree: NewTree,
}

impl WornTree {
    /// Builds it: milliseconds for 20,000 triangles.
    #[must_use]
    pub fn build(self) -> BuiltTree {
        BuiltTree {
            body: self.body,
            generation: self.generation,
            tree: self.job.build(),
        }
    }
}

impl World {
    /// A copy of what a worker needs to build the tree anew of a body that has deformed far from the shape its tree was
    /// built for; `None`: no tree is worn.
    ///
    /// Cost: nothing to speak of for each body that deforms; of one that is worn, a copy of its vertices and faces.
    #[must_use]
    pub fn worn_tree(&self) -> Option<WornTree> {
        let worn = |slot: &_| {
            let body = self.body(*slot)?;
            let job = body.shapes.first()?.shape.mesh()?.worn_tree()?;
            Some(WornTree {
                body: body.id,
                generation: body.generation,
                job,
            })
        };
        self.deforming.iter().find_map(worn)
    }

    /// Puts a tree in place, between two ticks. Whether it was taken: its body may be another by now.
    pub fn take_tree(&mut self, built: BuiltTree) -> bool {
        let Some(slot) = self.slot_of(built.body) else {
            return false;
        };
        let body = self.bodies[slot.index()].as_mut();
        let body = body.filter(|body| body.generation == built.generation);
        let shape = body.and_then(super::Body::bending_shape);
        shape.is_some_and(|shape| shape.take_tree(built.tree))
    }
}
