//! The active elements: vertices and circles of both cores, with the value of each at a normal.

use super::super::pair::{Held, Pair, Vertex};
use crate::math::{Vec3, across_z};
use crate::shape::Core;

/// An active pair of elements, with its weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Active {
    pub(super) of_a: u32,
    pub(super) of_b: u32,
    pub(super) weight: f64,
    /// `f_i` at the current normal.
    pub(super) value: f64,
    pub(super) a: Vec3,
    pub(super) b: Vec3,
    /// Gradient along the two tangents.
    pub(super) slope: [f64; 2],
    /// The circle of A and that of B; a vertex has none and does not bend.
    pub(super) rims: [Rim; 2],
}

/// A circle seen along a unit normal.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rim {
    /// Sine of the angle between its axis and the normal.
    pub(super) lean: f64,
    /// How far its farthest point moves when the normal turns along it, metres per radian.
    pub(super) bend_m: f64,
    /// The direction of that motion, along the two tangents.
    pub(super) along: [f64; 2],
}

/// The active elements.
#[derive(Clone, Copy, Debug)]
pub(super) struct Set {
    pub(super) actives: [Active; 3],
    pub(super) count: usize,
}

impl Default for Set {
    // The derived one calls a function for the array, which copies each of its elements.
    #[inline]
    fn default() -> Self {
        Self {
            actives: [Active::NONE; 3],
            count: 0,
        }
    }
}

impl Rim {
    /// For a vertex, which has no circle.
    const NONE: Self = Self {
        lean: 0.0,
        bend_m: 0.0,
        along: [0.0; 2],
    };
}

impl Active {
    const NONE: Self = Self {
        of_a: 0,
        of_b: 0,
        weight: 0.0,
        value: 0.0,
        a: Vec3::new(0.0, 0.0, 0.0),
        b: Vec3::new(0.0, 0.0, 0.0),
        slope: [0.0; 2],
        rims: [Rim::NONE; 2],
    };

    /// Curvature along the two tangents: xx, xy, yy.
    pub(super) fn bend(&self) -> [f64; 3] {
        let mut bend = [0.0; 3];
        for rim in &self.rims {
            let [x, y] = rim.along;
            bend[0] += rim.bend_m * x * x;
            bend[1] += rim.bend_m * x * y;
            bend[2] += rim.bend_m * y * y;
        }
        bend
    }
}

impl Set {
    /// Vertices on the same pair of elements are merged: they cluster where a circle is being approached.
    pub(super) fn of(vertices: &[Vertex], weights: &[f64]) -> Self {
        let mut set = Self::default();
        for (vertex, weight) in vertices.iter().zip(weights) {
            set.add(vertex.of_a, vertex.of_b, *weight);
        }
        set
    }

    pub(super) fn add(&mut self, of_a: u32, of_b: u32, weight: f64) {
        match self.place_of(of_a, of_b) {
            Some(place) => self.actives[place].weight += weight,
            None => _ = self.push(of_a, of_b, weight),
        }
    }

    fn place_of(&self, of_a: u32, of_b: u32) -> Option<usize> {
        (self.actives[..self.count].iter()).position(|x| x.of_a == of_a && x.of_b == of_b)
    }

    /// False if there is no room.
    fn push(&mut self, of_a: u32, of_b: u32, weight: f64) -> bool {
        let room = self.actives.get_mut(self.count);
        let fits = room.is_some();
        if let Some(room) = room {
            *room = Active {
                of_a,
                of_b,
                weight,
                ..Active::NONE
            };
            self.count += 1;
        }
        fits
    }

    pub(super) fn held(&self) -> Held {
        let mut held = Held::default();
        for x in &self.actives[..self.count] {
            held.push(x.of_a, x.of_b, x.weight);
        }
        held
    }

    /// False if the elements are active already, or there is no room.
    pub(super) fn join(&mut self, vertex: &Vertex) -> bool {
        let (of_a, of_b) = (vertex.of_a, vertex.of_b);
        self.place_of(of_a, of_b).is_none() && self.push(of_a, of_b, 0.0)
    }

    pub(super) fn least(&self) -> f64 {
        self.actives[..self.count]
            .iter()
            .map(|x| x.value)
            .fold(f64::INFINITY, f64::min)
    }

    /// Supports, slopes and curvatures at `n`; `None` if a circle is seen along its axis.
    pub(super) fn evaluate(
        &mut self,
        pair: &Pair<'_>,
        n: &Vec3,
        e1: &Vec3,
        e2: &Vec3,
    ) -> Option<()> {
        let in_b = -pair.to_b(n);
        for x in &mut self.actives[..self.count] {
            let (a, ta, ra) = element(pair.a.core(), x.of_a, n)?;
            let (b, tb, rb) = element(pair.b.core(), x.of_b, &in_b)?;
            x.a = a;
            x.b = pair.rotation * b + pair.at;
            let tb = pair.rotation * tb;
            let w = x.b - x.a;
            x.value = n.dot(&w);
            x.slope = [w.dot(e1), w.dot(e2)];
            x.rims = [(ta, ra), (tb, rb)].map(|(along, rim)| Rim {
                along: [along.dot(e1), along.dot(e2)],
                ..rim
            });
        }
        Some(())
    }

    /// Drops the first element with a negative weight, if another is left.
    pub(super) fn drop_negative(&mut self) -> bool {
        let place = self.actives[..self.count]
            .iter()
            .position(|x| x.weight < -1e-9);
        match place {
            Some(place) if self.count > 1 => {
                self.actives[place..self.count].rotate_left(1);
                self.count -= 1;
                true
            }
            _ => false,
        }
    }

    pub(super) fn witnesses(&self) -> (Vec3, Vec3) {
        let actives = &self.actives[..self.count];
        let weights: f64 = actives.iter().map(|x| x.weight.max(0.0)).sum();
        let (mut a, mut b) = (Vec3::zeros(), Vec3::zeros());
        for x in actives {
            let weight = if weights > 0.0 {
                x.weight.max(0.0) / weights
            } else {
                f64::from(u8::from(actives.len() == 1))
            };
            a += x.a * weight;
            b += x.b * weight;
        }
        (a, b)
    }
}

/// Farthest point of an element along `dir`, the tangent it moves along when `dir` turns, and its circle as seen.
// A call would pass all of it through memory: a tenth of a query of cores that are apart.
#[inline(always)]
fn element(core: &Core, element: u32, dir: &Vec3) -> Option<(Vec3, Vec3, Rim)> {
    let Some(circle) = core.circle(element) else {
        return Some((core.vertex(element)?, Vec3::zeros(), Rim::default()));
    };
    let across = across_z(dir);
    if across < 1e-12 {
        return None;
    }
    let part = 1.0 / across;
    let (x, y) = (dir.x * part, dir.y * part);
    Some((
        Vec3::new(x * circle.radius_m, y * circle.radius_m, circle.z_m),
        Vec3::new(-y, x, 0.0),
        Rim {
            lean: across,
            bend_m: circle.radius_m * part,
            along: [0.0; 2],
        },
    ))
}
