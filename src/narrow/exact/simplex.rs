//! The point of a simplex that is closest to the origin.
//!
//! In: up to four vertices, the newest last. Out: the sub-simplex that holds the closest point, its weights, and the
//! direction from the origin by the most accurate formula for it.
//!
//! All sub-simplices with the newest vertex are tried and the least distance of an admissible one wins (Johnson's
//! back-up procedure): no decision depends on the sign of a rounded number alone.

use super::pair::{Vertex, unit};
use crate::math::Vec3;

/// Up to four vertices with the weights of the closest point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Simplex {
    pub(super) vertices: [Vertex; 4],
    pub(super) weights: [f64; 4],
    pub(super) count: usize,
}

/// A sub-simplex, and its point that is closest to the origin.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    /// The newest vertex first, the others in their order.
    places: [usize; 3],
    weights: [f64; 3],
    count: usize,
    /// Sum of weight times vertex.
    pub(super) point: Vec3,
    pub(super) square: f64,
}

impl Simplex {
    pub(super) fn push(&mut self, vertex: Vertex) {
        if self.count < 4 {
            self.vertices[self.count] = vertex;
            self.count += 1;
        }
    }

    pub(super) fn used(&self) -> &[Vertex] {
        &self.vertices[..self.count]
    }

    /// Convex combinations of the points of A and of B.
    pub(super) fn witnesses(&self) -> (Vec3, Vec3) {
        let (mut a, mut b) = (Vec3::zeros(), Vec3::zeros());
        for (vertex, weight) in self.used().iter().zip(&self.weights) {
            a += vertex.a * *weight;
            b += vertex.b * *weight;
        }
        (a, b)
    }

    /// The point closest to the origin; `None`: the origin is inside, or there is no vertex.
    ///
    /// Only sub-simplices with the newest vertex are tried.
    pub(super) fn nearest(&self) -> Option<Nearest> {
        let new = self.count.checked_sub(1)?;
        if self.weights_inside().is_some() {
            return None;
        }
        let w = |k: usize| self.vertices[k].w;
        let mut best = Nearest {
            places: [new, 0, 0],
            weights: [1.0, 0.0, 0.0],
            count: 1,
            point: w(new),
            square: w(new).norm_squared(),
        };
        for i in 0..new {
            let along = w(i) - w(new);
            let t = -w(new).dot(&along) / along.norm_squared();
            if t > 0.0 && t < 1.0 {
                consider(
                    &mut best,
                    [new, i, 0],
                    [1.0 - t, t, 0.0],
                    2,
                    w(new) + along * t,
                );
            }
        }
        for i in 0..new {
            for j in i + 1..new {
                if let Some(weights) = on_triangle(&w(new), &w(i), &w(j)) {
                    let point =
                        w(new) + (w(i) - w(new)) * weights[1] + (w(j) - w(new)) * weights[2];
                    consider(&mut best, [new, i, j], weights, 3, point);
                }
            }
        }
        Some(best)
    }

    /// Keeps all four vertices, which enclose the origin.
    pub(super) fn keep_all(&mut self) {
        if let Some(weights) = self.weights_inside() {
            self.weights = weights;
        }
    }

    /// Reduces the simplex to what [`Simplex::nearest`] found. Vertices that stay keep their order.
    pub(super) fn keep(&mut self, nearest: &Nearest) {
        let (mut places, mut weights) = (nearest.places, nearest.weights);
        let count = nearest.count;
        places[..count].rotate_left(1);
        weights[..count].rotate_left(1);
        for (to, from) in places[..count].iter().enumerate() {
            if to != *from {
                self.vertices[to] = self.vertices[*from];
            }
            self.weights[to] = weights[to];
        }
        self.count = count;
    }

    /// Removes the newest vertex.
    pub(super) fn pop(&mut self) {
        self.count = self.count.saturating_sub(1);
    }

    /// Unit direction from the origin to the affine hull: for nearly touching pairs the closest point itself is mostly
    /// rounding, but a direction orthogonal to the features is not.
    pub(super) fn direction(&self, nearest: &Nearest) -> Option<Vec3> {
        let w = |k: usize| self.vertices[nearest.places[k]].w;
        let point = &nearest.point;
        match nearest.count {
            2 => {
                let along = unit(&(w(1) - w(0)))?;
                let rest = point - along * point.dot(&along);
                unit(&(rest - along * rest.dot(&along)))
            }
            3 => {
                let normal = unit(&normal_of(&w(0), &w(1), &w(2)))?;
                let side = normal.dot(&w(0));
                if side == 0.0 {
                    unit(point)
                } else {
                    Some(normal * side.signum())
                }
            }
            _ => unit(point),
        }
    }

    /// Weights of the origin, if it lies in the tetrahedron; none of them is below 0.
    fn weights_inside(&self) -> Option<[f64; 4]> {
        if self.count < 4 {
            return None;
        }
        let [a, b, c, d] = self.vertices.map(|v| v.w);
        let det = |p: &Vec3, q: &Vec3, r: &Vec3| p.dot(&q.cross(r));
        let volume = det(&(b - a), &(c - a), &(d - a));
        // Weights of the four corners, times the volume, from differences with d, where magnitudes are least.
        let from = -d;
        let (ad, bd, cd) = (a - d, b - d, c - d);
        let va = det(&from, &bd, &cd);
        let vb = det(&ad, &from, &cd);
        let vc = det(&ad, &bd, &from);
        let whole = det(&ad, &bd, &cd);
        let vd = whole - va - vb - vc;
        let weights = [va, vb, vc, vd].map(|v| v / whole);
        let holds = volume != 0.0 && whole != 0.0 && weights.iter().all(|weight| *weight >= 0.0);
        holds.then_some(weights)
    }
}

fn consider(best: &mut Nearest, places: [usize; 3], weights: [f64; 3], count: usize, point: Vec3) {
    let square = point.norm_squared();
    if square < best.square {
        *best = Nearest {
            places,
            weights,
            count,
            point,
            square,
        };
    }
}

/// Normal of a triangle, from its two shorter edges.
pub(super) fn normal_of(a: &Vec3, b: &Vec3, c: &Vec3) -> Vec3 {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let (x, y, z) = (ab.norm_squared(), bc.norm_squared(), ca.norm_squared());
    // Selected first and multiplied once: no processor can predict which side is longest.
    let (one, other) = if x >= y && x >= z {
        (bc, ca)
    } else if y >= z {
        (ca, ab)
    } else {
        (ab, bc)
    };
    one.cross(&other)
}

/// Weights of the projection of the origin onto the plane of a triangle, if it falls inside.
fn on_triangle(a: &Vec3, b: &Vec3, c: &Vec3) -> Option<[f64; 3]> {
    let (ab, ac) = (b - a, c - a);
    let normal = normal_of(a, b, c);
    let square = normal.norm_squared();
    let to = -a;
    let wb = normal.dot(&to.cross(&ac)) / square;
    let wc = normal.dot(&ab.cross(&to)) / square;
    let wa = 1.0 - wb - wc;
    (wa > 0.0 && wb > 0.0 && wc > 0.0 && wa.is_finite()).then_some([wa, wb, wc])
}
