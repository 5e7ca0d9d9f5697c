//! A glance that told nothing, and how far the pair has to move before it can.

use super::placed::moved;
use crate::math::Pose;
use crate::narrow::bent::Bent;
use crate::shape::Shape;

/// The pose of the glance, what the two had deformed and their boxes drawn back, and what it lacked, metres; or nothing
/// is known.
#[derive(Clone, Debug, Default)]
pub(super) struct Lack(Option<(Pose, Bent, f64)>);

impl Lack {
    /// * `shed_m` - [`Shape::shed_m`] of both.
    /// * `lack_m` - how much nearer or farther the two had to be; zero or less: nothing was lacking.
    pub(super) fn of(pos12: &Pose, shed_m: [f64; 2], lack_m: f64) -> Self {
        Self((lack_m > 0.0).then(|| (*pos12, Bent::of_wholes(shed_m), lack_m)))
    }

    /// Whether it would tell nothing at this pose either, with the vertices of now.
    pub(super) fn holds(&self, a: &Shape, b: &Shape, pos12: &Pose) -> bool {
        let still = |(then, bent, lack_m): &(Pose, Bent, f64)| {
            moved(a, b, then, pos12) + Bent::of_wholes([a.shed_m(), b.shed_m()]).since_m(bent)
                < *lack_m
        };
        self.0.as_ref().is_some_and(still)
    }
}
