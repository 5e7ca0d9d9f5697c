//! What a case is made of: bodies, where they are in each tick, and which pairs are asked of.

use crate::shape::ShapeSpec;

use super::dd::Dd;
use super::truth::Truth;

/// A body of a case.
#[derive(Clone, Debug)]
pub struct Actor {
    /// Its shapes, each at a point of the body's frame and not turned there.
    pub parts: Vec<(ShapeSpec, [f64; 3])>,
    /// Whether it is swept between its poses.
    pub continuous: bool,
}

impl Actor {
    /// A body of one shape.
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
    /// x, y, z, w; as long as admission takes it.
    pub q: [f64; 4],
}

impl Pos {
    /// Not turned.
    #[must_use]
    pub fn at(t: [f64; 3]) -> Self {
        Self {
            t,
            q: [0.0, 0.0, 0.0, 1.0],
        }
    }
}

/// What a case asks, where it is not the gap as [`super::truth::gap`] finds it.
#[derive(Clone, Copy, Debug)]
pub enum Asked {
    /// The gap, computed from the poses of each tick.
    Gap,
    /// The gap, known from how the case was made.
    Known(Truth),
    /// When two bodies touch first on their way between the first tick's poses (0) and the second's (1).
    Impact(Dd),
}

/// A case: one point of a family's plot.
#[derive(Clone, Debug)]
pub struct Case {
    /// What kind of pair it is, the same along a family's parameter.
    pub kind: &'static str,
    /// The family's parameter.
    pub value: f64,
    /// The bodies.
    pub actors: Vec<Actor>,
    /// Poses of all bodies, tick by tick.
    pub ticks: Vec<Vec<Pos>>,
    /// Places of the bodies of each pair.
    pub pairs: Vec<(usize, usize)>,
    /// What is asked.
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

    /// How large a pair is: how far both reach from their origins, and how far these are apart; errors are told in
    /// parts of it. Metres.
    #[must_use]
    pub fn size_m(&self, tick: usize, (i, j): (usize, usize)) -> f64 {
        let poses = &self.ticks[tick];
        let apart = (0..3).map(|k| (poses[j].t[k] - poses[i].t[k]).powi(2));
        let reach = |actor: &Actor| actor.parts.iter().map(reach_m).fold(0.0, f64::max);
        reach(&self.actors[i]) + reach(&self.actors[j]) + apart.sum::<f64>().sqrt()
    }
}

/// How far a part reaches from its body's origin at most, metres; a half-space: 0.
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

/// Whether a shape has a part that is round across an axis: then depths end at a part in a million, else at rounding.
#[must_use]
pub fn is_round(actor: &Actor) -> bool {
    let round =
        |shape: &ShapeSpec| matches!(shape, ShapeSpec::Cylinder { .. } | ShapeSpec::Cone { .. });
    actor.parts.iter().any(|(shape, _)| round(shape))
}
