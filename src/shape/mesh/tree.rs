//! A static tree of boxes over triangles: one triangle a leaf, boxes in f32 rounded outward, relative to an f64 origin.
//!
//! In: triangles. Out: nodes in depth-first order, for walks that can stop after any node.

use crate::math::{Point, Vec3, f32_down, f32_up};

/// Marks a leaf in [`Node::link`]; a mesh has fewer triangles than this.
const LEAF: u32 = 1 << 31;
/// Nodes that [`Tree::reach`] visits before it returns its current bound; a bumpy sphere of 10,000 triangles takes some
/// 100 for the exact result.
const REACH_NODES_MAX: usize = 512;

/// Most nodes that wait in a depth-first walk: one a level of a tree split at the median, and a mesh has under 2^31
/// triangles; for a mesh that deforms, seven a level of its tree of eight children a node, and the last eight.
pub(crate) const NODES_WAITING_MAX: usize = 64;

const _: () = {
    assert!(crate::limits::TRIANGLES_MAX < LEAF as usize);
    // Seven levels of eights.
    assert!(crate::limits::DEFORMING_TRIANGLES_MAX <= 1 << 21);
};

/// A box and its contents. The left child of an inner node is the next node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Lower corner, relative to the tree's origin, metres.
    pub min: [f32; 3],
    /// Upper corner, relative to the tree's origin, metres.
    pub max: [f32; 3],
    link: u32,
}

/// What is below a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Below {
    /// One triangle, by its index in the mesh.
    Triangle(u32),
    /// Two nodes, by their indices.
    Nodes(u32, u32),
    /// Up to eight boxes of a mesh that deforms: the index of the first, and a bit for each that exists.
    Row(u32, u8),
}

impl Node {
    /// A leaf with this box around `low` and `high`.
    pub(crate) fn leaf(low: &Vec3, high: &Vec3, triangle: u32) -> Self {
        Self {
            min: [f32_down(low.x), f32_down(low.y), f32_down(low.z)],
            max: [f32_up(high.x), f32_up(high.y), f32_up(high.z)],
            link: triangle | LEAF,
        }
    }

    /// What is below the node at index `place`.
    pub(crate) fn below(&self, place: u32) -> Below {
        if self.link & LEAF == 0 {
            Below::Nodes(place + 1, self.link)
        } else {
            Below::Triangle(self.link & !LEAF)
        }
    }

    /// Centre of the box, relative to the tree's origin, metres.
    pub(crate) fn centre(&self) -> Vec3 {
        self.corner(|low, high| (low + high) * 0.5)
    }

    /// Half of each side, metres.
    pub(crate) fn half(&self) -> Vec3 {
        self.corner(|low, high| (high - low) * 0.5)
    }

    /// The greatest `direction . x` in the box.
    pub(crate) fn reach(&self, direction: &Vec3) -> f64 {
        (0..3)
            .map(|k| {
                let (low, high) = (f64::from(self.min[k]), f64::from(self.max[k]));
                (direction[k] * low).max(direction[k] * high)
            })
            .sum()
    }

    fn corner(&self, of: impl Fn(f64, f64) -> f64) -> Vec3 {
        Vec3::from_fn(|k, _| of(f64::from(self.min[k]), f64::from(self.max[k])))
    }
}

/// The tree.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    origin: Point,
}

impl Tree {
    /// A tree over at least one triangle, split at the median of the longest axis.
    pub(crate) fn new(vertices: &[Point], faces: &[[u32; 3]], origin: Point) -> Self {
        let corners = |face: usize| faces[face].map(|v| vertices[v as usize] - origin);
        let mut order: Vec<(u32, [f32; 3])> = (0u32..)
            .zip(faces)
            .map(|(i, _)| {
                let [a, b, c] = corners(i as usize);
                let middle = (a.inf(&b).inf(&c) + a.sup(&b).sup(&c)) * 0.5;
                (i, [middle.x, middle.y, middle.z].map(f32_down))
            })
            .collect();
        let mut nodes = Vec::with_capacity(2 * faces.len());
        build(&mut nodes, &mut order, &|face| {
            let [a, b, c] = corners(face as usize);
            Node::leaf(&a.inf(&b).inf(&c), &a.sup(&b).sup(&c), face)
        });
        Self { nodes, origin }
    }

    /// No tree, for a mesh that has another kind.
    pub(crate) fn none(origin: Point) -> Self {
        Self {
            nodes: Vec::new(),
            origin,
        }
    }

    /// The nodes, root first.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The origin of the boxes, in the mesh's frame.
    pub(crate) fn origin(&self) -> Point {
        self.origin
    }

    /// An upper bound on `direction . (v - origin)` over all vertices; usually the exact maximum.
    ///
    /// Cost: at most `REACH_NODES_MAX` nodes, regardless of the size of the mesh.
    pub(crate) fn reach(&self, vertices: &[Point], faces: &[[u32; 3]], direction: &Vec3) -> f64 {
        // Depth-first, the better child first: a stack of a balanced tree of 2^31 leaves fits.
        let mut stack = [(0u32, 0.0f64); 64];
        stack[0] = (0, self.nodes[0].reach(direction));
        let (mut depth, mut visited, mut best) = (1, 0, f64::NEG_INFINITY);
        while depth > 0 {
            depth -= 1;
            let (place, bound) = stack[depth];
            if bound <= best {
                continue;
            }
            if visited == REACH_NODES_MAX {
                best = bound;
                continue;
            }
            visited += 1;
            match self.nodes[place as usize].below(place) {
                Below::Triangle(face) => {
                    for v in faces[face as usize] {
                        best = best.max(direction.dot(&(vertices[v as usize] - self.origin)));
                    }
                }
                // Not a tree of this kind.
                Below::Row(..) => {}
                Below::Nodes(left, right) => {
                    let with = |i: u32| (i, self.nodes[i as usize].reach(direction));
                    let (mut far, mut near) = (with(left), with(right));
                    if far.1 > near.1 {
                        std::mem::swap(&mut far, &mut near);
                    }
                    stack[depth] = far;
                    stack[depth + 1] = near;
                    depth += 2;
                }
            }
        }
        best
    }
}

/// Appends the subtree over `order`: its root is the node appended first.
fn build(nodes: &mut Vec<Node>, order: &mut [(u32, [f32; 3])], leaf: &dyn Fn(u32) -> Node) {
    if let [(face, _)] = order {
        nodes.push(leaf(*face));
        return;
    }
    // Longest axis of the triangles' middles; if all coincide, they are still split into two halves.
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for (_, middle) in order.iter() {
        for k in 0..3 {
            low[k] = low[k].min(middle[k]);
            high[k] = high[k].max(middle[k]);
        }
    }
    let side = |k: usize| high[k] - low[k];
    let axis = (0..3)
        .max_by(|&a, &b| side(a).total_cmp(&side(b)))
        .unwrap_or(0);
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |a, b| {
        a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0))
    });

    let place = nodes.len();
    nodes.push(leaf(order[0].0));
    let (left, right) = order.split_at_mut(half);
    build(nodes, left, leaf);
    let right_place = nodes.len();
    build(nodes, right, leaf);
    let (a, b) = (nodes[place + 1], nodes[right_place]);
    nodes[place] = Node {
        min: std::array::from_fn(|k| a.min[k].min(b.min[k])),
        max: std::array::from_fn(|k| a.max[k].max(b.max[k])),
        link: u32::try_from(right_place).unwrap_or(LEAF - 1),
    };
}
