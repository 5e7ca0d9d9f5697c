//! Distance from a point of a shape's core to its surface, along the contact normal.
//!
//! In: a shape of revolution about its z, and its pose. Out: the way out. By only the ball around that point, a contact
//! of a tilted capsule would lie inside it: farther along the normal there is more of the capsule's side.

use crate::math::Vec3;
use crate::shape::{Convex, Core};

/// A shape's surface in the frame of the contact.
pub(super) enum Surface {
    /// A core that is the whole shape, or a margin around one: at this distance from all of the core, metres.
    Even(f64),
    Round(Lathe),
}

/// A shape of revolution.
pub(super) struct Lathe {
    middle: Vec3,
    /// Unit.
    axis: Vec3,
    half_m: f64,
    /// Radius of its side at the middle.
    radius_m: f64,
    /// Decrease of the radius per metre of height.
    taper: f64,
    /// Whether it ends in hemispheres instead of discs.
    has_balls: bool,
}

impl Surface {
    /// * `middle` - the shape's origin.
    /// * `axis` - its z, unit.
    #[inline]
    pub(super) fn new(shape: &Convex, middle: Vec3, axis: Vec3) -> Self {
        let (half_m, radius_m, taper) = match *shape.core() {
            Core::Segment { half_m } => (half_m, shape.margin(), 0.0),
            Core::Cylinder { radius_m, half_m } => (half_m, radius_m, 0.0),
            Core::Cone { radius_m, half_m } => (half_m, radius_m / 2.0, radius_m / (2.0 * half_m)),
            _ => return Self::Even(shape.margin()),
        };
        Self::Round(Lathe {
            middle,
            axis,
            half_m,
            radius_m,
            taper,
            has_balls: matches!(shape.core(), Core::Segment { .. }),
        })
    }

    /// For a shape in its own frame.
    #[inline]
    pub(super) fn own(shape: &Convex) -> Self {
        Self::new(shape, Vec3::zeros(), Vec3::z())
    }

    /// Distance from a point of the core, or near that of a capsule, along a unit vector to the surface, metres;
    /// `None`: the line misses it.
    #[inline]
    pub(super) fn way_out(&self, from: &Vec3, outward: &Vec3) -> Option<f64> {
        match self {
            Self::Even(margin_m) => Some(*margin_m),
            Self::Round(lathe) if lathe.has_balls => lathe.way_out(from, outward),
            Self::Round(_) => Some(0.0),
        }
    }

    /// Distance from a point near a line on the side of the core, along a unit vector back to the core, metres; `None`:
    /// the line misses it. For a capsule it is [`Surface::way_out`].
    pub(super) fn way_back(&self, from: &Vec3, outward: &Vec3) -> Option<f64> {
        match self {
            Self::Round(lathe) if !lathe.has_balls => lathe.along(from, outward).to_side(),
            _ => Some(0.0),
        }
    }
}

/// A line in the frame of a lathe.
struct Line {
    /// Height of its origin over the middle, and its increase per metre.
    height: f64,
    along: f64,
    /// The square of the distance from the axis less that of the radius, at the origin; it grows by
    /// `square t^2 + 2 grows t` over `t` metres.
    beyond: f64,
    grows: f64,
    square: f64,
}

impl Line {
    fn to_side(&self) -> Option<f64> {
        exit(self.square, self.grows, self.beyond)
    }
}

impl Lathe {
    fn along(&self, from: &Vec3, outward: &Vec3) -> Line {
        let from = from - self.middle;
        let (height, along) = (self.axis.dot(&from), self.axis.dot(outward));
        let (off, across) = (from - self.axis * height, outward - self.axis * along);
        let (radius, leans) = (self.radius_m - self.taper * height, self.taper * along);
        Line {
            height,
            along,
            beyond: off.norm_squared() - radius * radius,
            grows: off.dot(&across) + radius * leans,
            square: across.norm_squared() - leans * leans,
        }
    }

    fn way_out(&self, from: &Vec3, outward: &Vec3) -> Option<f64> {
        let line = self.along(from, outward);
        let by_side = line.to_side();
        let leaves = by_side.map_or(line.along, |t| line.height + t * line.along);
        if by_side.is_some() && leaves.abs() <= self.half_m {
            return by_side;
        }
        let end = self.middle + self.axis * self.half_m.copysign(leaves);
        let from_end = from - end;
        let beyond = from_end.norm_squared() - self.radius_m * self.radius_m;
        exit(1.0, from_end.dot(outward), beyond)
    }
}

/// Where `square t^2 + 2 grows t + beyond` rises through 0 for the last time.
fn exit(square: f64, grows: f64, beyond: f64) -> Option<f64> {
    let root = (grows * grows - square * beyond).sqrt();
    // Each form where it does not cancel.
    let t = if grows > 0.0 {
        -beyond / (grows + root)
    } else {
        (root - grows) / square
    };
    // No root of a negative number counts, nor a place where it falls.
    (t.is_finite() && (grows > 0.0 || square > 0.0)).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From points on the axis of a capsule, and near it, compared with the distance from its segment.
    #[test]
    fn the_way_out_of_a_capsule_ends_on_its_surface() {
        let surface = Surface::own(&Convex::capsule(0.2, 0.5));
        for k in 0..200 {
            let (turn, tilt) = (0.7 * f64::from(k), 0.0314 * f64::from(k % 101));
            let outward = Vec3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), tilt.cos());
            for height in [-0.5, -0.3, 0.0, 0.21, 0.5] {
                for beside in [0.0, 0.1] {
                    let from = Vec3::new(beside, 0.0, height);
                    let out = surface.way_out(&from, &outward).unwrap();
                    let at = from + outward * out;
                    let end = at.z - at.z.clamp(-0.5, 0.5);
                    let off = at.x.hypot(at.y).hypot(end) - 0.2;
                    assert!(
                        off.abs() < 1e-12 && out > 0.0,
                        "{outward:?} {height}: {off}"
                    );
                }
            }
        }
        assert_eq!(surface.way_out(&Vec3::new(0.3, 0.0, 0.0), &Vec3::y()), None);
    }

    /// A point on a side is not moved, whichever way it was rounded; a point off the side is.
    #[test]
    fn the_way_back_to_a_side_ends_on_it() {
        let (cylinder, cone) = (Convex::cylinder(0.2, 0.5), Convex::cone(0.2, 0.5));
        for (shape, radius) in [(cylinder, 0.2), (cone, 0.1)] {
            let surface = Surface::own(&shape);
            for beside in [-0.05, -1e-9, 0.0, 1e-16, 0.03] {
                let from = Vec3::new(radius, beside, 0.0);
                let back = surface.way_back(&from, &Vec3::x()).unwrap();
                let off = (radius + back).hypot(beside) - radius;
                assert!(off.abs() < 1e-15 && back <= 0.0, "{beside} {back} {off}");
                assert_eq!(surface.way_out(&from, &Vec3::x()), Some(0.0));
            }
            let missed = Vec3::new(0.0, 1.1 * radius, 0.0);
            assert_eq!(surface.way_back(&missed, &Vec3::x()), None);
        }
    }
}
