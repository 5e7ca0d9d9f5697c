//! The parts of a case: bodies, their poses in each tick, and the pairs to judge.

use crate::shape::ShapeSpec;

use super::dd::Dd;
use super::truth::Truth;

/// A body of a case.
#[derive(Clone, Debug)]
pub struct Actor {
    /// Its shapes, each at a point of the body's frame and not rotated.
    pub parts: Vec<(ShapeSpec, [f64; 3])>,
    /// Whether it is swept between its poses.
    pub continuous: bool,
}

impl Actor {
    /// A body with one shape.
    #[must_use]
    pub fn of(shape: ShapeSpec) -> Self {
        Self {
            parts: vec![(shape, [0.0; 3])],
            continuous: false,
        }
    }
}

/// A pose as a sender writes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pos {
    /// Metres.
    pub t: [f64; 3],
    /// x, y, z, w; of any length that admission accepts.
    pub q: [f64; 4],
}

impl Pos {
    /// A pose without rotation.
    #[must_use]
    pub fn at(t: [f64; 3]) -> Self {
        Self {
            t,
            q: [0.0, 0.0, 0.0, 1.0],
        }
    }
}

/// The question of a case.
#[derive(Clone, Copy, Debug)]
pub enum Asked {
    /// The gap, computed from the poses of each tick by [`super::truth::gap`].
    Gap,
    /// The gap, known from the construction of the case.
    Known(Truth),
    /// The share of the way from the first tick's poses (0) to the second's (1) at which two bodies first touch.
    Impact(Dd),
}

/// A case: one point of a family's plot.
#[derive(Clone, Debug)]
pub struct Case {
    /// Kind of the pair, the same along a family's parameter.
    pub kind: &'static str,
    /// The family's parameter.
    pub value: f64,
    /// The bodies.
    pub actors: Vec<Actor>,
    /// Poses of all bodies, tick by tick.
    pub ticks: Vec<Vec<Pos>>,
    /// Indices of the bodies of each pair.
    pub pairs: Vec<(usize, usize)>,
    /// The question.
    pub asked: Asked,
}

impl Case {
    /// Two bodies in one tick.
    #[must_use]
    pub fn pair(kind: &'static str, value: f64, a: (Actor, Pos), b: (Actor, Pos)) -> Self {
        Self {
            kind,
            value,
            ticks: vec![vec![a.1, b.1]],
            actors: vec![a.0, b.0],
            pairs: vec![(0, 1)],
            asked: Asked::Gap,
        }
    }

    /// Size of a pair, metres: the reach of both bodies from their origins, plus the distance of the origins. Errors
    /// are given in parts of it.
    #[must_use]
    pub fn size_m(&self, tick: usize, (i, j): (usize, usize)) -> f64 {
        let poses = &self.ticks[tick];
        let apart = (0..3).map(|k| (poses[j].t[k] - poses[i].t[k]).powi(2));
        let reach = |actor: &Actor| actor.parts.iter().map(reach_m).fold(0.0, f64::max);
        reach(&self.actors[i]) + reach(&self.actors[j]) + apart.sum::<f64>().sqrt()
    }
}

/// Upper bound of a part's reach from its body's origin, metres; 0 for a half-space or a height field.
fn reach_m((shape, at): &(ShapeSpec, [f64; 3])) -> f64 {
    let norm = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let farthest = |points: &[[f64; 3]]| points.iter().map(norm).fold(0.0, f64::max);
    let own = match shape {
        ShapeSpec::Sphere { radius } => *radius,
        ShapeSpec::Box { half_extents } => norm(half_extents),
        ShapeSpec::Capsule {
            radius,
            half_height,
        } => radius + half_height,
        ShapeSpec::Cylinder {
            radius,
            half_height,
        }
        | ShapeSpec::Cone {
            radius,
            half_height,
        } => radius.hypot(*half_height),
        ShapeSpec::Convex { vertices, .. } | ShapeSpec::Trimesh { vertices, .. } => {
            farthest(vertices)
        }
        ShapeSpec::Triangle { vertices } => farthest(vertices),
        ShapeSpec::HalfSpace { .. } | ShapeSpec::HeightField { .. } => 0.0,
    };
    own + norm(at)
}

/// Whether a body has a cylinder or a cone: depths are then found to a part in a million, else to rounding.
#[must_use]
pub fn is_round(actor: &Actor) -> bool {
    let round =
        |shape: &ShapeSpec| matches!(shape, ShapeSpec::Cylinder { .. } | ShapeSpec::Cone { .. });
    actor.parts.iter().any(|(shape, _)| round(shape))
}
