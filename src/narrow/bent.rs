//! The deformation of two bodies or shapes: a running sum for each of them.
//!
//! In: the sums at one moment and at another. Out: by how much the two may have come nearer since. Refused: one sum for
//! both. Each sum grows with every step, by an ulp at least; a common sum may not if one is far larger than the other's
//! step, and then a pair that has come to touch would count as apart.

use crate::math::ROUND;
use crate::shape::Shape;
use crate::world::Body;

/// What each of the two has deformed since it was inserted, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bent([f64; 2]);

impl Bent {
    pub(super) fn of_bodies(a: &Body, b: &Body) -> Self {
        Self([a.motion.bent_m, b.motion.bent_m])
    }

    pub(super) fn of_shapes(a: &Shape, b: &Shape) -> Self {
        Self([a.bent_m(), b.bent_m()])
    }

    /// For tests of two whole shapes: what their boxes shrank by counts as well, if that is more.
    ///
    /// * `shed_m` - [`Shape::shed_m`] of both.
    pub(super) fn of_wholes(shed_m: [f64; 2]) -> Self {
        Self(shed_m)
    }

    /// What the two have deformed since `then`, summed, metres, rounded up; 0: neither has.
    pub(super) fn since_m(&self, then: &Self) -> f64 {
        let [a, b] = [0, 1].map(|k| (self.0[k] - then.0[k]).max(0.0));
        (a + b) * (1.0 + 4.0 * ROUND)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::daemon::build_shapes;
    use crate::math::{Point, Pose};
    use crate::narrow::change::changed_since;
    use crate::narrow::mesh::{CarriedFront, FrontStore, Goal, Search};
    use crate::scene::Scene;
    use crate::shape::{Geometry, Mesh};
    use crate::time::{ManualClock, Meter};
    use crate::world::World;

    /// One body's deformation is so much larger than the other's step that their sum would not grow.
    #[test]
    fn bug_what_a_body_deforms_is_not_lost_beside_what_another_has() {
        let text = "[[body]]\nname = \"a\"\nmoves = false\nshape = { type = \"sphere\", radius = 1.0 }\n\
                    [[body]]\nname = \"b\"\nmoves = false\nshape = { type = \"sphere\", radius = 1.0 }\n";
        let scene = Scene::parse(text, "test", Path::new(".")).unwrap();
        let world = World::new(&scene, build_shapes(&scene).unwrap().bodies, 0).unwrap();
        let mut bodies = world.bodies().map(|(_, body)| body.clone());
        let (mut a, mut b) = (bodies.next().unwrap(), bodies.next().unwrap());
        let rel = Pose::translation(2.5, 0.0, 0.0);
        a.motion.bent_m = 2e12;
        for k in 0..10 {
            let then = Bent::of_bodies(&a, &b);
            assert!(changed_since(&a, &b, (&rel, then), &rel) <= 0.0);
            b.motion.bend(1e-4, &b.pose, &b.centre, 1.0);
            let change_m = changed_since(&a, &b, (&rel, then), &rel);
            assert!((1e-4..1.01e-4).contains(&change_m), "{k}: {change_m}");
        }
    }

    fn sheet(z: f64) -> Shape {
        let corners = [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]].map(Point::from);
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]], Some(false)).unwrap();
        let shape = Shape {
            aabb: mesh.aabb(),
            centre: mesh.centre(),
            radius: mesh.radius(),
            geometry: Geometry::Mesh(mesh),
        };
        shape.to_deforming().unwrap()
    }

    /// The same for the front of two meshes.
    #[test]
    fn bug_a_front_hears_of_a_small_step_beside_a_long_way() {
        let (mut a, mut b) = (sheet(0.0), sheet(0.0));
        let at = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]];
        for _ in 0..1000 {
            for z in [1e9, 0.0] {
                a.bend(0, &at(z));
                a.refit(usize::MAX);
            }
        }
        assert!(a.lag_m() <= 0.0);
        let (mut store, mut front) = (FrontStore::default(), CarriedFront::default());
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        let pos12 = Pose::translation(0.0, 0.0, 5e-5);
        front.start(&mut store, &a, &b, &pos12, Search::Carried);
        assert!(front.advance(&mut store, &a, &b, Goal::Gap, u64::MAX, &mut meter));
        assert!(front.interval().min > 4e-5, "{:?}", front.interval());
        b.bend(0, &at(-1e-4));
        front.move_to(&mut store, &a, &b, &pos12);
        assert!(front.interval().min <= 0.0, "{:?}", front.interval());
        // Move one corner through the other sheet.
        b.bend(0, &[[-1.0, -1.0, -1e-4], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
        front.move_to(&mut store, &a, &b, &pos12);
        assert!(front.advance(&mut store, &a, &b, Goal::Verdict, u64::MAX, &mut meter));
        assert!(front.interval().min <= 0.0, "{:?}", front.interval());
        front.release(&mut store);
    }
}
