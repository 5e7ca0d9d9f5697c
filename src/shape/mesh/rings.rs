//! The neighbours of each vertex in contiguous lists, for walks that go from vertex to vertex.
//!
//! In: a mesh with its twins. Out: for every vertex whose faces close to one ring its neighbours; for others a side
//! that starts there, from which `Mesh::go_round` visits face by face.
//!
//! Going round by twins is a chain of dependent loads; the loads of a list are all in flight at once.

use super::Mesh;
use super::adjacency::NONE;

/// Lists by vertex: 16 bytes a triangle.
#[derive(Clone, Debug, Default)]
pub(super) struct Rings {
    /// For each vertex the start of its list, and the end of all.
    from: Vec<u32>,
    vertices: Vec<u32>,
    /// A side that starts at each vertex.
    sides: Vec<u32>,
}

impl Rings {
    /// * `mesh` - its final faces, and their neighbours.
    ///
    /// Cost: O(n).
    pub(super) fn new(mesh: &Mesh) -> Self {
        let mut first = vec![(NONE, 0_u32); mesh.vertices.len()];
        for (side, &vertex) in (0u32..).zip(mesh.faces.as_flattened()) {
            let (first, count) = &mut first[vertex as usize];
            *first = side.min(*first);
            *count += 1;
        }
        let mut rings = Self {
            from: Vec::with_capacity(first.len() + 1),
            vertices: Vec::with_capacity(mesh.faces.len() * 3),
            sides: first.iter().map(|(side, _)| *side).collect(),
        };
        rings.from.push(0);
        let Self { from, vertices, .. } = &mut rings;
        for (side, faces) in first {
            let begin = vertices.len();
            if side != NONE {
                let closed = mesh.go_round(side, |side| vertices.push(mesh.start_of(side)));
                // If this vertex has more faces than were visited, another ring touches it. The last one visited equals
                // the first.
                let all = closed.filter(|met| *met == faces).unwrap_or_default();
                vertices.truncate(begin + all as usize);
            }
            from.push(u32::try_from(vertices.len()).unwrap_or(NONE));
        }
        rings.vertices.shrink_to_fit();
        rings
    }

    /// The neighbours of a vertex; empty: they are not kept.
    #[inline]
    pub(super) fn of(&self, vertex: u32) -> &[u32] {
        let range = self.from.get(vertex as usize..vertex as usize + 2);
        let range = range.map_or(0..0, |at| at[0] as usize..at[1] as usize);
        self.vertices.get(range).unwrap_or_default()
    }

    /// A side that starts at a vertex, of the first face that has it; `None`: no face has it.
    pub(super) fn side_at(&self, vertex: u32) -> Option<u32> {
        let side = self.sides.get(vertex as usize).copied();
        side.filter(|side| *side != NONE)
    }
}
