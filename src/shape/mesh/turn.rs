//! Shells that face inwards are turned round (law 3.3).
//!
//! In: a solid's mesh and its shells with their volumes. Out: faces oriented as the solid is meant.
//!
//! A shell that touches another from within also counts as within it: a pocket that is flush with an outer face is a
//! pocket, whichever way that face looks.

use std::cell::Cell;

use super::inside::winding_of;
use super::predicates::is_on;
use super::topology::{Shell, Topology};
use super::tree::{Below, NODES_WAITING_MAX, Node, Tree};
use super::{Inside, Mesh};
use crate::math::{Point, Vec3};

/// A shell of no more faces is tested face by face: a ray through the tree visits those of all other shells, too.
const FEW_FACES: usize = 64;

impl Mesh {
    /// Law 3.3: a shell of negative volume that is not wholly within another is turned round with all it contains.
    ///
    /// Cost: nothing if no shell is negative. Else O(log n) for each shell, plus inside tests of the corners of one
    /// whose box lies within that of another.
    pub(super) fn turn_shells(&mut self, topology: &Topology) {
        let shells = &topology.shells;
        if shells.iter().all(|shell| shell.volume >= 0.0) {
            return;
        }
        let mut sign = vec![1.0; shells.len()];
        // The largest first, so that the contents of a turned shell are judged as turned.
        let mut order: Vec<usize> = (0..shells.len()).collect();
        order.sort_by(|&a, &b| {
            let size = |i: usize| shells[i].volume.abs();
            size(b).total_cmp(&size(a)).then(a.cmp(&b))
        });
        let nest = Nest::new(self, topology);
        let mut turned = 0;
        for &i in &order {
            let negative = shells[i].volume * sign[i] < 0.0;
            if !negative || nest.is_held(i) {
                continue;
            }
            turned += 1;
            sign[i] = -sign[i];
            for j in nest.held_by(i) {
                sign[j] = -sign[j];
            }
        }
        for (face, &shell) in self.faces.iter_mut().zip(&topology.shell_of) {
            if sign[shell as usize] < 0.0 {
                face.swap(1, 2);
            }
        }
        if turned > 0 {
            self.warnings.push(format!(
                "{turned} of {} shells faced inwards and stood in no other: turned round with all they hold",
                shells.len()
            ));
        }
    }
}

/// A point's place relative to a shell.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Outside,
    On,
    Inside,
}

/// Shells of a mesh, to find which lies within which.
struct Nest<'a> {
    mesh: &'a Mesh,
    shell_of: &'a [u32],
    shells: &'a [Shell],
    /// Faces by shell, and the start of each shell's faces.
    faces: Vec<u32>,
    from: Vec<usize>,
    /// A tree over the boxes of the shells.
    boxes: Tree,
}

impl<'a> Nest<'a> {
    fn new(mesh: &'a Mesh, topology: &'a Topology) -> Self {
        let shells = &topology.shells;
        let mut faces: Vec<u32> = (0u32..).zip(&mesh.faces).map(|(face, _)| face).collect();
        faces.sort_by_key(|face| topology.shell_of[*face as usize]);
        let mut from = vec![0; shells.len() + 1];
        for shell in &topology.shell_of {
            from[*shell as usize + 1] += 1;
        }
        for shell in 0..shells.len() {
            from[shell + 1] += from[shell];
        }
        // Each box is entered as a triangle between its corners.
        let corners: Vec<Point> = shells.iter().flat_map(|s| [s.low, s.high]).collect();
        let spans: Vec<[u32; 3]> = (0u32..)
            .zip(shells)
            .map(|(i, _)| [2 * i, 2 * i + 1, 2 * i])
            .collect();
        Self {
            mesh,
            shell_of: &topology.shell_of,
            shells,
            faces,
            from,
            boxes: Tree::new(&corners, &spans, mesh.centre),
        }
    }

    /// Whether any other shell contains this one.
    fn is_held(&self, inner: usize) -> bool {
        let (low, high) = self.bounds_of(inner);
        let mut around = Vec::new();
        let holds = |node: &Node| {
            (0..3).all(|k| f64::from(node.min[k]) <= low[k] && high[k] <= f64::from(node.max[k]))
        };
        walk(&self.boxes, holds, usize::MAX, |outer| {
            around.push(outer as usize);
        });
        let corners = self.corners_of(inner);
        around
            .into_iter()
            .any(|outer| self.holds(outer, inner, &corners))
    }

    /// The shells that this one contains.
    fn held_by(&self, outer: usize) -> Vec<usize> {
        let (low, high) = self.bounds_of(outer);
        let mut held = Vec::new();
        walk(&self.boxes, overlaps(low, high), usize::MAX, |inner| {
            held.push(inner as usize);
        });
        held.retain(|&inner| {
            self.may_hold(outer, inner) && self.holds(outer, inner, &self.corners_of(inner))
        });
        held
    }

    /// Whether the box of one shell lies within that of another.
    fn may_hold(&self, outer: usize, inner: usize) -> bool {
        let (a, b) = (&self.shells[outer], &self.shells[inner]);
        outer != inner && (0..3).all(|k| a.low[k] <= b.low[k] && b.high[k] <= a.high[k])
    }

    /// Whether shell `inner` lies wholly within shell `outer`: no vertex outside, and no vertex the other way.
    ///
    /// Shells that cross each other with edges alone count as contained; no interpretation of them is right.
    ///
    /// * `corners` - vertices of `inner`, each once.
    fn holds(&self, outer: usize, inner: usize, corners: &[u32]) -> bool {
        if !self.may_hold(outer, inner) {
            return false;
        }
        let mut inside = false;
        for vertex in corners {
            match self.place(&self.mesh.vertices[*vertex as usize], outer) {
                Place::Outside => return false,
                Place::On => {}
                Place::Inside => inside = true,
            }
        }
        // A shell that touches with every corner fills a gap between two walls, or is a slot from wall to wall.
        let middle = || self.middle(inner);
        if !inside && !middle().is_some_and(|p| self.place(&p, outer) == Place::Inside) {
            return false;
        }
        let mut near = self.corners_near(outer, inner).into_iter();
        !near.any(|v| self.place(&self.mesh.vertices[v as usize], inner) == Place::Inside)
    }

    fn place(&self, point: &Point, shell: usize) -> Place {
        let of = &self.shells[shell];
        if !(0..3).all(|k| of.low[k] <= point[k] && point[k] <= of.high[k]) {
            return Place::Outside;
        }
        let on = Cell::new(false);
        let look = |face: u32| {
            let triangle = self.mesh.triangle(face);
            on.set(on.get() || is_on(&triangle, point));
            triangle
        };
        let faces = self.faces_of(shell);
        let winding = if faces.len() <= FEW_FACES {
            winding_of(*point, faces.iter().map(|face| look(*face)))
        } else {
            Inside::default().run(self.mesh, *point, |face| {
                let counts = self.shell_of[face as usize] as usize == shell;
                if counts {
                    look(face);
                }
                counts
            })
        };
        match (on.get(), winding) {
            (true, _) => Place::On,
            (false, 0) => Place::Outside,
            (false, _) => Place::Inside,
        }
    }

    /// A point well inside a shell: halfway from the middle of its largest face to the next one.
    fn middle(&self, shell: usize) -> Option<Point> {
        let faces = self.faces_of(shell);
        let area = |face: u32| {
            let [a, b, c] = self.mesh.triangle(face);
            (b - a).cross(&(c - a))
        };
        let size = |face: u32| area(face).norm_squared();
        let largest = *faces
            .iter()
            .max_by(|x, y| size(**x).total_cmp(&size(**y)))?;
        let [a, b, c] = self.mesh.triangle(largest);
        let from = a + ((b - a) + (c - a)) / 3.0;
        let inward = -area(largest).try_normalize(0.0)? * self.shells[shell].volume.signum();
        let others = faces.iter().filter(|face| **face != largest);
        let ways = others.filter_map(|face| way_to(&from, &inward, &self.mesh.triangle(*face)));
        let way = ways.min_by(f64::total_cmp)?;
        Some(from + inward * (way / 2.0))
    }

    fn bounds_of(&self, shell: usize) -> (Vec3, Vec3) {
        let (of, origin) = (&self.shells[shell], self.boxes.origin());
        (of.low - origin, of.high - origin)
    }

    fn faces_of(&self, shell: usize) -> &[u32] {
        &self.faces[self.from[shell]..self.from[shell + 1]]
    }

    /// The vertices of a shell, each once.
    fn corners_of(&self, shell: usize) -> Vec<u32> {
        self.corners(self.faces_of(shell).iter().copied(), |_| true)
    }

    /// The vertices of one shell that lie in the box of another.
    fn corners_near(&self, outer: usize, inner: usize) -> Vec<u32> {
        let of = &self.shells[inner];
        let is_near = |p: &Point| (0..3).all(|k| of.low[k] <= p[k] && p[k] <= of.high[k]);
        let all = self.faces_of(outer);
        // By the tree, unless that box contains more than the shell has.
        let (tree, mut near) = (&self.mesh.tree, Vec::new());
        let (low, high) = (of.low - tree.origin(), of.high - tree.origin());
        let whole = walk(tree, overlaps(low, high), all.len(), |face| {
            if self.shell_of[face as usize] as usize == outer {
                near.push(face);
            }
        });
        if whole {
            self.corners(near.into_iter(), is_near)
        } else {
            self.corners(all.iter().copied(), is_near)
        }
    }

    fn corners(
        &self,
        faces: impl Iterator<Item = u32>,
        takes: impl Fn(&Point) -> bool,
    ) -> Vec<u32> {
        let named = faces.flat_map(|face| self.mesh.faces[face as usize]);
        let mut all: Vec<u32> = named
            .filter(|v| takes(&self.mesh.vertices[*v as usize]))
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// Whether a node's box meets one that is given by its corners, relative to the tree's origin.
fn overlaps(low: Vec3, high: Vec3) -> impl Fn(&Node) -> bool {
    move |node| {
        (0..3).all(|k| f64::from(node.min[k]) <= high[k] && low[k] <= f64::from(node.max[k]))
    }
}

/// Visits the triangles below nodes that pass. Returns whether all were reached within the allowed steps.
fn walk(
    tree: &Tree,
    passes: impl Fn(&Node) -> bool,
    steps_max: usize,
    mut visit: impl FnMut(u32),
) -> bool {
    let nodes = tree.nodes();
    let (mut waiting, mut len) = ([0u32; NODES_WAITING_MAX], 1);
    let mut left = steps_max;
    while len > 0 {
        len -= 1;
        let place = waiting[len];
        if left == 0 {
            return false;
        }
        left -= 1;
        let node = &nodes[place as usize];
        if !passes(node) {
            continue;
        }
        match node.below(place) {
            Below::Nodes(first, second) => {
                waiting[len..len + 2].copy_from_slice(&[second, first]);
                len += 2;
            }
            Below::Triangle(face) => visit(face),
            // Not a tree of this kind.
            Below::Row(..) => {}
        }
    }
    true
}

/// Distance to a triangle along a unit direction, metres; `None`: the ray does not meet it ahead.
///
/// Source: Möller and Trumbore 1997, "Fast, minimum storage ray/triangle intersection".
fn way_to(from: &Point, along: &Vec3, [a, b, c]: &[Point; 3]) -> Option<f64> {
    let (u, v) = (b - a, c - a);
    let across = along.cross(&v);
    let det = u.dot(&across);
    let to = (from - a) / det;
    let (s, turned) = (to.dot(&across), to.cross(&u));
    let (t, way) = (turned.dot(along), turned.dot(&v));
    (s >= 0.0 && t >= 0.0 && s + t <= 1.0 && way > 0.0).then_some(way)
}

#[cfg(test)]
mod tests;
