//! A new tree for a mesh that has deformed far from the shape its tree was built for: built by a worker from a copy,
//! installed between two ticks.

use super::{Corners, Mesh, fit, point};
use crate::math::{Point, ROUND};
use crate::shape::mesh::ObbTree;

/// A tree whose boxes have grown to this many times their surface at its build is built again: up to here a refitted
/// tree takes some 50 % more tests at most (measured for a displacement of a fifth of the size).
const WORN: f32 = 1.5;

/// The input of a worker.
#[derive(Clone, Debug)]
pub(crate) struct TreeJob {
    rows: Vec<[f32; 4]>,
    faces: Vec<[u32; 3]>,
    bent_m: f64,
    revision: u32,
}

/// Its result: boxes that fit the vertices of the copy.
#[derive(Clone, Debug)]
pub(crate) struct NewTree {
    obb: ObbTree,
    around: Vec<Corners>,
    surface: f32,
    /// As of when the copy was made.
    bent_m: f64,
    revision: u32,
}

impl TreeJob {
    /// Makes it fail.
    #[cfg(test)]
    pub(crate) fn spoil(&mut self) {
        self.faces[0] = [u32::MAX; 3];
    }

    /// Builds the tree.
    ///
    /// Cost: O(n log n), some 0.3 us a triangle.
    pub(crate) fn build(self) -> NewTree {
        let vertices: Vec<Point> = self.rows.iter().map(point).collect();
        let mut obb = ObbTree::aligned(&vertices, &self.faces);
        let packs = obb.packs_mut();
        let mut around = vec![Corners::NOTHING; packs.len()];
        let all = 0..packs.len();
        let surface = fit(packs, &mut around, (&self.rows, &self.faces), all);
        NewTree {
            obb,
            around,
            surface,
            bent_m: self.bent_m,
            revision: self.revision,
        }
    }
}

impl Mesh {
    /// A copy for a worker, if the boxes have grown so much since the tree was built that a new one would be better.
    pub(crate) fn worn_tree(&self) -> Option<TreeJob> {
        let deform = self.deform.as_ref()?;
        (deform.last_surface > WORN * deform.built_surface).then(|| TreeJob {
            rows: deform.rows.clone(),
            faces: self.faces.clone(),
            bent_m: deform.bent_m,
            revision: deform.revision,
        })
    }

    /// Installs a new tree: anything that names boxes of the old one must be forgotten. False, and not installed, if it
    /// was ordered for a different tree.
    pub(crate) fn take_tree(&mut self, new: NewTree) -> bool {
        let Some(deform) = self.deform.as_mut() else {
            return false;
        };
        if deform.revision != new.revision || self.obb.packs().len() != new.obb.packs().len() {
            return false;
        }
        self.obb = new.obb;
        deform.around = new.around;
        deform.revision += 1;
        // The motion since the copy was made.
        let moved_m = deform.bent_m - new.bent_m;
        deform.stale_m = if moved_m > 0.0 {
            moved_m + 4.0 * ROUND * deform.bent_m
        } else {
            0.0
        };
        (deform.left, deform.fresh_m) = (0, 0.0);
        (deform.built_surface, deform.last_surface) = (new.surface, new.surface);
        true
    }
}
