//! A failed cheap test, and how far the pair must move before it can succeed.

use super::placed::moved;
use crate::math::Pose;
use crate::narrow::bent::Bent;
use crate::shape::Shape;

/// The pose of the test, the deformation and box shrinking by then, and what was lacking, metres; or nothing is known.
#[derive(Clone, Debug, Default)]
pub(super) struct Lack(Option<(Pose, Bent, f64)>);

impl Lack {
    /// * `shed_m` - [`Shape::shed_m`] of both.
    /// * `lack_m` - how much nearer or farther the two had to be; zero or less: nothing was lacking.
    pub(super) fn of(pos12: &Pose, shed_m: [f64; 2], lack_m: f64) -> Self {
        Self((lack_m > 0.0).then(|| (*pos12, Bent::of_wholes(shed_m), lack_m)))
    }

    /// Whether it would fail at this pose too, with the present vertices.
    pub(super) fn holds(&self, a: &Shape, b: &Shape, pos12: &Pose) -> bool {
        let still = |(then, bent, lack_m): &(Pose, Bent, f64)| {
            moved(a, b, then, pos12) + Bent::of_wholes([a.shed_m(), b.shed_m()]).since_m(bent)
                < *lack_m
        };
        self.0.as_ref().is_some_and(still)
    }
}
