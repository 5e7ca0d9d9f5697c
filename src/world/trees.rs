//! Trees of bodies that deform, rebuilt outside the tick.
//!
//! In: the wear of a tree. Out: a self-contained job for a worker; its result is put in place between two ticks.

use super::bend::{Unbuilt, Vertices};
use super::{Body, World};
use crate::ids::BodyId;
use crate::shape::{NewTree, TreeJob};

/// How often the wait for a tree that cannot be built is doubled, at most.
const DOUBLINGS_MAX: u32 = 16;

/// A tree to be built.
#[derive(Clone, Debug)]
pub struct WornTree {
    of: TreeOf,
    job: TreeJob,
}

/// The body, and the version of its vertices.
#[derive(Clone, Copy, Debug)]
pub struct TreeOf {
    body: BodyId,
    generation: u32,
    updates: u64,
}

/// A tree that was built.
#[derive(Clone, Debug)]
pub struct BuiltTree {
    of: TreeOf,
    tree: NewTree,
}

impl TreeOf {
    /// The body's id and generation, and the number of updates of its vertices.
    #[must_use]
    pub fn parts(self) -> (BodyId, u32, u64) {
        (self.body, self.generation, self.updates)
    }
}

impl BuiltTree {
    /// What it was built for.
    #[must_use]
    pub fn of(&self) -> TreeOf {
        self.of
    }
}

impl WornTree {
    /// What it is for; for [`World::refuse_tree`] when it cannot be built.
    #[must_use]
    pub fn of(&self) -> TreeOf {
        self.of
    }

    /// Builds it: milliseconds for 20,000 triangles.
    #[must_use]
    pub fn build(self) -> BuiltTree {
        BuiltTree {
            of: self.of,
            tree: self.job.build(),
        }
    }

    /// The same with an invalid face: it cannot be built.
    #[cfg(test)]
    pub(crate) fn spoil(mut self) -> Self {
        self.job.spoil();
        self
    }
}

impl World {
    /// A copy of what a worker needs to rebuild the tree of a body that has deformed far from the shape its tree was
    /// built for; `None`: no tree is worn, except those that could not be built from these vertices.
    ///
    /// Cost: negligible for each body that deforms; for a worn one, a copy of its vertices and faces.
    #[must_use]
    pub fn worn_tree(&self) -> Option<WornTree> {
        let all = self.deforming.iter();
        all.filter_map(|slot| self.body(*slot))
            .find_map(Body::worn_tree)
    }

    /// The same for one body: where boxes are refitted within a time limit, which tree wears first depends on the
    /// machine.
    #[must_use]
    pub fn worn_tree_of(&self, body: BodyId) -> Option<WornTree> {
        self.body(self.slot_of(body)?)?.worn_tree()
    }

    /// Puts a tree in place, between two ticks. Returns whether it was taken: the body may be another by now.
    pub fn take_tree(&mut self, built: BuiltTree) -> bool {
        let shape = self.bent_body(built.of).and_then(Body::bending_shape);
        let taken = shape.is_some_and(|shape| shape.take_tree(built.tree));
        let vertices = self
            .bent_body(built.of)
            .and_then(|body| body.vertices.as_mut());
        if let Some(vertices) = vertices.filter(|_| taken) {
            vertices.unbuilt = None;
        }
        taken
    }

    /// A tree could not be built: its boxes are refitted as before, and the tree is not requested again until the body
    /// has other vertices; after each further failure the wait doubles, in updates.
    ///
    /// * returns - the body's name if this is the first time since it was put or its tree was built: to be reported.
    pub fn refuse_tree(&mut self, of: TreeOf) -> Option<String> {
        let body = self.bent_body(of)?;
        let vertices = body.vertices.as_mut()?;
        let times = vertices.unbuilt.map_or(0, |unbuilt| unbuilt.times);
        vertices.unbuilt = Some(Unbuilt {
            times: (times + 1).min(DOUBLINGS_MAX),
            until: of.updates + (1 << times),
        });
        (times == 0).then(|| body.name.to_string())
    }

    /// The body, if it is still the same.
    fn bent_body(&mut self, of: TreeOf) -> Option<&mut Body> {
        let slot = self.slot_of(of.body)?;
        let body = self.bodies[slot.index()].as_mut();
        body.filter(|body| body.generation == of.generation)
    }
}

impl Body {
    fn worn_tree(&self) -> Option<WornTree> {
        let vertices = self.vertices.as_deref().filter(|of| of.can_be_built())?;
        let job = self.shapes.first()?.shape.mesh()?.worn_tree()?;
        let of = TreeOf {
            body: self.id,
            generation: self.generation,
            updates: vertices.updates,
        };
        Some(WornTree { of, job })
    }
}

impl Vertices {
    /// Returns whether a tree may be requested.
    fn can_be_built(&self) -> bool {
        (self.unbuilt).is_none_or(|unbuilt| self.updates >= unbuilt.until)
    }
}
