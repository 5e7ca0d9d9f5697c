//! The viewpoint: how much more a place in view counts in the order of work.
//!
//! In: the scene's viewpoint and the pose of the body that carries it. Out: a weight for a place, by visibility, angle
//! from the centre of the view, and distance.
//!
//! Source: RTR3 section 17.6.1, after O'Sullivan and Dingliana: priority by visibility, eccentricity and distance.

use super::World;
use crate::config::Viewpoint;
use crate::math::{Point, Vec3};
use crate::wire::BodyStatus;

/// Weight at the edge of the view, as a share of that at its centre.
const EDGE: f64 = 0.5;

/// An eye in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaze {
    eye: Point,
    /// Unit vector.
    direction: Vec3,
    half_angle_rad: f64,
    weight: f64,
    half_m: Option<f64>,
}

impl Gaze {
    /// Weight of a ball: 1 if no part of it is in view, the viewpoint's weight if it is straight ahead and near.
    ///
    /// * `centre`, `radius_m` - scene frame; a half-space (infinite) always surrounds the eye.
    #[must_use]
    pub fn weight(&self, centre: &Point, radius_m: f64) -> f64 {
        let to = centre - self.eye;
        let distance_m = to.norm();
        if distance_m <= radius_m {
            return self.weight;
        }
        let along = self.direction.dot(&to);
        let middle_rad = self.direction.cross(&to).norm().atan2(along);
        let nearest_rad = (middle_rad - (radius_m / distance_m).asin()).max(0.0);
        if nearest_rad > self.half_angle_rad {
            return 1.0;
        }
        let eccentric = 1.0 - (1.0 - EDGE) * nearest_rad / self.half_angle_rad;
        let far = self
            .half_m
            .map_or(1.0, |half_m| half_m / (half_m + (distance_m - radius_m)));
        1.0 + (self.weight - 1.0) * eccentric * far
    }
}

impl World {
    /// The viewpoint of this tick; `None`: the scene has none, or the place of its body is unknown.
    #[must_use]
    pub fn gaze(&self) -> Option<Gaze> {
        let Viewpoint {
            body,
            position,
            direction,
            half_angle_rad,
            weight,
            half_m,
        } = self.viewpoint.as_ref()?;
        let (position, direction) = (Point::from(*position), Vec3::from(*direction));
        let (eye, direction) = match body {
            None => (position, direction),
            Some(name) => {
                let carrier = self.slot_named(name).and_then(|slot| self.body(slot))?;
                if !matches!(carrier.status, BodyStatus::Known | BodyStatus::Held) {
                    return None;
                }
                (carrier.pose * position, carrier.pose.rotation * direction)
            }
        };
        Some(Gaze {
            eye,
            direction,
            half_angle_rad: *half_angle_rad,
            weight: *weight,
            half_m: *half_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaze(half_m: Option<f64>) -> Gaze {
        Gaze {
            eye: Point::new(1.0, 0.0, 0.0),
            direction: Vec3::x(),
            half_angle_rad: 0.5,
            weight: 9.0,
            half_m,
        }
    }

    #[test]
    fn a_place_counts_by_whether_it_is_seen_how_far_aside_and_how_far_away() {
        let at = |x: f64, y: f64| gaze(None).weight(&Point::new(x, y, 0.0), 0.1);
        assert!((at(11.0, 0.0) - 9.0).abs() < 1e-12, "right ahead");
        let aside = [0.0, 1.0, 2.0, 4.0, 5.0].map(|y| at(11.0, y));
        assert!(aside.is_sorted_by(|near, far| near > far), "{aside:?}");
        assert!(aside[4] >= 5.0, "the edge counts half: {aside:?}");
        assert!((at(11.0, 6.0) - 1.0).abs() < 1e-12, "out of view");
        assert!((at(-9.0, 0.0) - 1.0).abs() < 1e-12, "behind");
        assert!((at(1.05, 0.0) - 9.0).abs() < 1e-12, "around the eye");
        // Half of the excess over 1 is left at the given distance.
        let far = |x: f64| gaze(Some(5.0)).weight(&Point::new(x, 0.0, 0.0), 0.0);
        assert!((far(6.0) - 5.0).abs() < 1e-12);
        assert!(far(100.0) > 1.0 && far(100.0) < far(50.0));
    }

    #[test]
    fn a_large_body_is_seen_by_its_rim_and_a_half_space_always() {
        let at = |radius_m: f64| gaze(None).weight(&Point::new(6.0, 6.0, 0.0), radius_m);
        assert!((at(0.1) - 1.0).abs() < 1e-12);
        assert!(at(3.0) > 5.0);
        assert!((at(f64::INFINITY) - 9.0).abs() < 1e-12);
    }
}
