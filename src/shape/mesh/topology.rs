//! The topology of a mesh: which edges are open, which faces are connected, which way they face.
//!
//! In: vertices and faces as read. Out: shells, counts of defects, and faces turned where necessary. Vertices in
//! exactly one place are merged here (STL repeats them); the mesh itself keeps its own.

use crate::math::{Point, Vec3};

/// A set of faces connected by their vertices.
#[derive(Clone, Debug)]
pub(super) struct Shell {
    /// One of its vertices, by place in the mesh.
    pub(super) vertex: u32,
    /// Enclosed volume, cubic metres; negative when it faces inwards.
    pub(super) volume: f64,
    /// Corners of its box.
    pub(super) low: Point,
    /// Corners of its box.
    pub(super) high: Point,
}

/// Edges and faces, counted.
#[derive(Clone, Debug, Default)]
pub(super) struct Defects {
    /// Edges with one face.
    pub(super) open: usize,
    /// Edges whose faces do not cancel, with two faces or more.
    pub(super) inconsistent: usize,
    /// Faces without an area.
    pub(super) flat: usize,
    /// Faces more than a million times as long as high.
    pub(super) needles: usize,
    /// Faces on the same three corners as an earlier one.
    pub(super) duplicates: usize,
    /// Vertices that no face names.
    pub(super) unreferenced: usize,
}

impl Defects {
    /// Whether the surface has no border and one side: every edge is used as often forward as backward.
    pub(super) fn closed(&self) -> bool {
        self.open == 0 && self.inconsistent == 0
    }
}

/// One use of an edge: lesser and greater welded vertex, face, whether it runs from lesser to greater.
pub(super) type EdgeUse = (u32, u32, u32, bool);

/// Topology of the faces of a mesh.
#[derive(Debug)]
pub(super) struct Topology {
    /// For each vertex the first vertex in the same place.
    welded: Vec<u32>,
    /// Every edge use, in order.
    edges: Vec<EdgeUse>,
    pub(super) defects: Defects,
    /// For each face its shell.
    pub(super) shell_of: Vec<u32>,
    pub(super) shells: Vec<Shell>,
}

impl Topology {
    pub(super) fn new(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        let welded = weld(vertices);
        let mut edges = edge_uses(&welded, faces);
        edges.sort_unstable();
        let mut all = Self {
            defects: Defects::default(),
            shell_of: Vec::new(),
            shells: Vec::new(),
            welded,
            edges,
        };
        all.count_edges();
        all.count_faces(vertices, faces);
        all.find_shells(vertices, faces);
        all
    }

    /// One side of a mesh that is written double-sided, every face a second time the other way round, and its topology;
    /// `None`: it is not, or one side alone is not closed. Such are a plate of no thickness, and boxes side by side
    /// that share a wall.
    ///
    /// The file says both of each two faces, so either may be the one that is turned where they do not agree.
    pub(super) fn one_side(
        &self,
        vertices: &[Point],
        faces: &[[u32; 3]],
    ) -> Option<(Vec<[u32; 3]>, Self)> {
        let mut left = without_backs(faces);
        // If only some are, a part may fill a hole of another, and both its sides count.
        if 2 * left.len() != faces.len() {
            return None;
        }
        let mut topology = Self::new(vertices, &left);
        if !topology.defects.closed() {
            topology.orient(vertices, &mut left)?;
            topology = Self::new(vertices, &left);
        }
        topology.defects.closed().then_some((left, topology))
    }

    /// The uses of each edge: lesser and greater vertex, face, direction as read.
    pub(super) fn edge_uses(&self) -> impl Iterator<Item = &[EdgeUse]> {
        self.edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
    }

    /// The side of its face that a use is now, and whether it runs from the lesser to the greater vertex.
    pub(super) fn side_of(&self, of: &EdgeUse, faces: &[[u32; 3]]) -> Option<(u32, bool)> {
        let corners = faces[of.2 as usize].map(|v| self.welded[v as usize]);
        (0u32..3).zip(0..3).find_map(|(k, i)| {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            ((from.min(to), from.max(to)) == (of.0, of.1)).then_some((k, from < to))
        })
    }

    fn count_edges(&mut self) {
        for uses in self.edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let forward = uses.iter().filter(|u| u.3).count();
            if uses.len() == 1 {
                self.defects.open += 1;
            } else if 2 * forward != uses.len() {
                self.defects.inconsistent += 1;
            }
        }
    }

    fn count_faces(&mut self, vertices: &[Point], faces: &[[u32; 3]]) {
        let mut corners: Vec<[u32; 3]> = Vec::with_capacity(faces.len());
        let mut named = vec![false; vertices.len()];
        for face in faces {
            let mut sorted = face.map(|v| self.welded[v as usize]);
            sorted.sort_unstable();
            corners.push(sorted);
            for &v in face {
                named[v as usize] = true;
            }
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
            let height = (b - a).cross(&(c - a)).norm() / longest;
            if longest == 0.0 || height <= f64::EPSILON * longest {
                self.defects.flat += 1;
            } else if height < 1e-6 * longest {
                self.defects.needles += 1;
            }
        }
        corners.sort_unstable();
        self.defects.duplicates = corners.windows(2).filter(|pair| pair[0] == pair[1]).count();
        self.defects.unreferenced = named.iter().filter(|seen| !**seen).count();
    }

    fn find_shells(&mut self, vertices: &[Point], faces: &[[u32; 3]]) {
        let mut sets = Sets::new(vertices.len());
        for face in faces {
            let [a, b, c] = face.map(|v| self.welded[v as usize]);
            sets.join(a, b, false);
            sets.join(b, c, false);
        }
        let mut place = vec![u32::MAX; vertices.len()];
        for face in faces {
            let root = sets.root(self.welded[face[0] as usize]).0 as usize;
            if place[root] == u32::MAX {
                place[root] = u32::try_from(self.shells.len()).unwrap_or(u32::MAX);
                self.shells.push(Shell {
                    vertex: face[0],
                    volume: 0.0,
                    low: vertices[face[0] as usize],
                    high: vertices[face[0] as usize],
                });
            }
            self.shell_of.push(place[root]);
            let shell = &mut self.shells[place[root] as usize];
            for &v in face {
                shell.low = shell.low.inf(&vertices[v as usize]);
                shell.high = shell.high.sup(&vertices[v as usize]);
            }
        }
        self.measure(vertices, faces);
    }

    /// Volumes, each about a vertex of its own shell, so that far shells keep their digits.
    pub(super) fn measure(&mut self, vertices: &[Point], faces: &[[u32; 3]]) {
        for shell in &mut self.shells {
            shell.volume = 0.0;
        }
        for (face, &shell) in faces.iter().zip(&self.shell_of) {
            let shell = &mut self.shells[shell as usize];
            let from = vertices[shell.vertex as usize];
            shell.volume += volume(&from, face.map(|v| vertices[v as usize]));
        }
    }

    /// Turns faces so that neighbours agree and each part encloses a positive volume; `None` if an edge does not have
    /// exactly two faces, or the surface has one side only (a Klein bottle). Else the number of turned faces.
    pub(super) fn orient(&self, vertices: &[Point], faces: &mut [[u32; 3]]) -> Option<usize> {
        let mut sets = Sets::new(faces.len());
        for uses in self.edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let [a, b] = uses else { return None };
            if !sets.join(a.2, b.2, a.3 == b.3) {
                return None;
            }
        }
        let mut volumes = vec![0.0; faces.len()];
        let mut turned: Vec<(u32, bool)> = Vec::with_capacity(faces.len());
        for (i, face) in (0u32..).zip(faces.iter()) {
            let (root, odd) = sets.root(i);
            let from = vertices[faces[root as usize][0] as usize];
            let part = volume(&from, face.map(|v| vertices[v as usize]));
            volumes[root as usize] += if odd { -part } else { part };
            turned.push((root, odd));
        }
        let mut count = 0;
        for (face, (root, odd)) in faces.iter_mut().zip(turned) {
            if odd != (volumes[root as usize] < 0.0) {
                face.swap(1, 2);
                count += 1;
            }
        }
        Some(count)
    }
}

/// Volume of the tetrahedron from `from` to a triangle.
fn volume(from: &Point, [a, b, c]: [Point; 3]) -> f64 {
    let (u, v, w): (Vec3, Vec3, Vec3) = (a - from, b - from, c - from);
    u.cross(&v).dot(&w) / 6.0
}

/// The faces, without the later one of each two on the same corners that face opposite ways.
///
/// Corners are vertices as given, not places: vertices in one place may part where a mesh deforms.
fn without_backs(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut keyed: Vec<([u32; 3], usize, bool)> = Vec::with_capacity(faces.len());
    for (place, &face) in faces.iter().enumerate() {
        let mut corners = face;
        corners.sort_unstable();
        let [low, middle, high] = corners;
        let is_turned = ![
            [low, middle, high],
            [middle, high, low],
            [high, low, middle],
        ]
        .contains(&face);
        keyed.push((corners, place, is_turned));
    }
    keyed.sort_unstable();
    let mut is_gone = vec![false; faces.len()];
    for same in keyed.chunk_by(|one, other| one.0 == other.0) {
        // How many so far have no other side yet, by the way they face.
        let mut alone = [0usize; 2];
        for &(_, place, is_turned) in same {
            let other = &mut alone[usize::from(!is_turned)];
            if *other > 0 {
                *other -= 1;
                is_gone[place] = true;
            } else {
                alone[usize::from(is_turned)] += 1;
            }
        }
    }
    let kept = faces.iter().zip(&is_gone).filter(|(_, gone)| !**gone);
    kept.map(|(face, _)| *face).collect()
}

/// For each vertex the first one in exactly the same place.
fn weld(vertices: &[Point]) -> Vec<u32> {
    // Adding zero makes -0 and 0 one number.
    let key = |i: u32| vertices[i as usize].coords.map(|x| x + 0.0);
    let compare = |a: u32, b: u32| {
        let (p, q) = (key(a), key(b));
        (0..3)
            .map(|k| p[k].total_cmp(&q[k]))
            .find(|order| order.is_ne())
            .unwrap_or(std::cmp::Ordering::Equal)
    };
    let mut order: Vec<u32> = (0u32..).zip(vertices).map(|(i, _)| i).collect();
    order.sort_unstable_by(|&a, &b| compare(a, b).then(a.cmp(&b)));
    let mut welded = vec![0; vertices.len()];
    for same in order.chunk_by(|&a, &b| compare(a, b).is_eq()) {
        for &i in same {
            welded[i as usize] = same[0];
        }
    }
    welded
}

fn edge_uses(welded: &[u32], faces: &[[u32; 3]]) -> Vec<EdgeUse> {
    let mut edges = Vec::with_capacity(3 * faces.len());
    for (i, face) in (0u32..).zip(faces) {
        let corners = face.map(|v| welded[v as usize]);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            // A face with two corners in one place is a line there and back: its two edges cancel each other.
            if a != b {
                edges.push((a.min(b), a.max(b), i, a < b));
            }
        }
    }
    edges
}

/// Disjoint sets whose members may be opposite to their root.
pub(super) struct Sets {
    parent: Vec<(u32, bool)>,
}

impl Sets {
    pub(super) fn new(len: usize) -> Self {
        Self {
            parent: (0u32..).take(len).map(|i| (i, false)).collect(),
        }
    }

    /// The root, and whether `i` is opposite to it.
    pub(super) fn root(&mut self, i: u32) -> (u32, bool) {
        let (mut at, mut odd) = (i, false);
        while self.parent[at as usize].0 != at {
            // Halving the path keeps later walks short.
            let (up, up_odd) = self.parent[at as usize];
            let (top, top_odd) = self.parent[up as usize];
            self.parent[at as usize] = (top, up_odd ^ top_odd);
            odd ^= self.parent[at as usize].1;
            at = top;
        }
        (at, odd)
    }

    /// Joins two sets; false if they are already one and disagree.
    pub(super) fn join(&mut self, a: u32, b: u32, opposite: bool) -> bool {
        let ((a, odd_a), (b, odd_b)) = (self.root(a), self.root(b));
        if a == b {
            return odd_a ^ odd_b == opposite;
        }
        // The lesser index stays the root, so that results do not depend on the order of joining.
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high as usize] = (low, odd_a ^ odd_b ^ opposite);
        true
    }
}
