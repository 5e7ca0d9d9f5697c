//! Whether one shape of a pair lies within the other while their surfaces are apart (law 3.3).
//!
//! One point of every connected surface is tested against the other solid, both ways. That is enough: if a point were
//! in both shapes, a path out of it would first meet the surface of one inside the other, and a connected surface that
//! crosses nothing is inside entirely or not at all.

use super::placed::Placed;
use super::side::Side;
use crate::math::{Point, Vec3};
use crate::shape::Inside;

/// What is known of containment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Containment {
    /// One of the two may hold a part of the other.
    #[default]
    Open,
    /// No surface of one lies in the other.
    Outside,
    /// One does.
    Inside,
}

/// The tests, one node at a time. Reuses its memory.
#[derive(Debug, Default)]
pub(super) struct ShellTests {
    state: Containment,
    inside: Inside,
    /// 0: points of A in B; 1: points of B in A; and which point.
    way: usize,
    place: usize,
    /// A test is in progress.
    testing: bool,
    /// By way: a point found far out, and its direction, own frame; only for a shape with one connected surface.
    far: [Option<(Point, Vec3)>; 2],
}

impl ShellTests {
    /// Call for other shapes, or other vertices than those last used.
    pub(super) fn forget(&mut self) {
        self.far = [None; 2];
    }

    /// Starts; `needed`: false if the outcome is known to be outside.
    pub(super) fn start(&mut self, needed: bool) {
        self.state = if needed {
            Containment::Open
        } else {
            Containment::Outside
        };
        (self.way, self.place, self.testing) = (0, 0, false);
    }

    /// A mesh has new vertices: the counts of the test in progress belong to the old ones. Finished tests stay valid.
    pub(super) fn drop_test(&mut self) {
        self.testing = false;
        self.forget();
    }

    pub(super) fn state(&self) -> Containment {
        self.state
    }

    /// Tests one node, or moves on to the next test.
    pub(super) fn step(&mut self, a: Side<'_>, b: Side<'_>, at: &Placed) {
        let (of, within) = match self.way {
            0 => (a, b),
            1 => (b, a),
            _ => {
                self.state = Containment::Outside;
                return;
            }
        };
        let Some(solid) = within.solid() else {
            (self.way, self.place) = (self.way + 1, 0);
            return;
        };
        if !self.testing {
            if self.place == of.shell_count() {
                (self.way, self.place) = (self.way + 1, 0);
                return;
            }
            let a_in_b = self.way == 0;
            // Any point of the surface will do; the one that faces away is usually outside the other's box.
            let ahead = if a_in_b {
                at.pos12.translation.vector
            } else {
                at.turn_to_b(&-at.pos12.translation.vector)
            };
            let point = self.point_of(of, &-ahead);
            self.inside.start(if a_in_b {
                at.to_b(&point)
            } else {
                at.to_a(&point)
            });
            self.testing = true;
        }
        self.inside.step(solid, |_| true);
        if self.inside.finished() {
            self.testing = false;
            self.place += 1;
            if self.inside.winding() != 0 {
                self.state = Containment::Inside;
            }
        }
    }

    /// The next point to be tested, far along a direction if there is a choice. The last such point is usually still
    /// far out, and searching for one is a descent through the whole tree.
    fn point_of(&mut self, of: Side<'_>, direction: &Vec3) -> Point {
        let single = of.shell_count() == 1;
        let near = |found: &Vec3| {
            let along = found.dot(direction);
            // Within 45 degrees.
            along > 0.0 && 2.0 * along * along > found.norm_squared() * direction.norm_squared()
        };
        match self.far[self.way] {
            Some((point, found)) if single && near(&found) => point,
            _ => {
                let point = of.shell_point(self.place, direction);
                self.far[self.way] = single.then_some((point, *direction));
                point
            }
        }
    }
}
