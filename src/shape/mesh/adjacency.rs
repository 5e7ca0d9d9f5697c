//! Which faces of a mesh are neighbours, and walks from one to the next.
//!
//! In: the topology of the final faces. Out: for every side of a face the neighbour's side along it, and the smooth
//! region of each face. A side is named `3 * face + k`: from the face's corner `k` to the next one.
//!
//! Sides on a border, and those shared by three faces or more, have no neighbour; if the surface continues beyond them
//! nevertheless, they have a seam (`seams`).

use super::Mesh;
use super::seams::{self, Seam};
use super::topology::{Sets, Topology};
use crate::math::{Point, Vec3};

/// No neighbour.
pub(super) const NONE: u32 = u32::MAX;
/// Faces whose normals differ by less than 20 degrees (cosine) belong to one smooth region. Larger, and the sides of a
/// coarse cylinder are one surface with its caps; smaller, and a coarse ball is many.
const SMOOTH: f64 = 0.94;

/// Neighbours and regions of the faces of a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Adjacency {
    /// For each side the neighbour's.
    twins: Vec<u32>,
    /// The faces beyond sides without a neighbour, by side.
    seams: Vec<Seam>,
    /// For each face the least face of its region.
    regions: Vec<u32>,
    /// Number of sides without a neighbour if they are too many or too much work to look beyond; else 0.
    unlooked: usize,
}

impl Adjacency {
    /// * `mesh` - its final faces; `topology` is of the same faces, whichever way they were turned then.
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
            // Faces without an area join whatever is next to them.
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
        let seams = seams::find(mesh, &twins);
        let unlooked = if seams.is_none() { open } else { 0 };
        let seams = seams.unwrap_or_default();
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
            unlooked,
        }
    }

    /// For each side the neighbour's.
    pub(super) fn twins(&self) -> &[u32] {
        &self.twins
    }

    /// Replaces the regions, and drops the seams.
    pub(super) fn replace_measured(&mut self, regions: Vec<u32>) {
        (self.regions, self.seams) = (regions, Vec::new());
    }

    /// The warning of `check` if seams were not looked for.
    pub(super) fn warning(&self) -> Option<String> {
        (self.unlooked > 0).then(|| {
            format!(
                "{} edges without a neighbour, too many or too long to look beyond: contacts may show edges within its surface; weld it",
                self.unlooked
            )
        })
    }

    /// The faces beyond a side without a neighbour.
    pub(super) fn beyond(&self, side: u32) -> impl Iterator<Item = u32> + use<'_> {
        let at = self.seams.binary_search_by_key(&side, |seam| seam.side);
        let seam = at.ok().and_then(|at| self.seams.get(at));
        let faces = seam.into_iter().flat_map(|seam| seam.faces);
        faces.filter(|face| *face != NONE)
    }
}

impl Mesh {
    /// The face beyond the `k`th side of a face.
    pub(crate) fn beside(&self, face: u32, k: u32) -> Option<u32> {
        let twin = self.adjacency.twins.get((3 * face + k) as usize)?;
        (*twin != NONE).then(|| twin / 3)
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
}
