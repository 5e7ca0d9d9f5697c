//! Motions that need no simulator: a pose for each body at any time, from a seed.

use nalgebra::UnitQuaternion;

use crate::math::{Pose, Vec3};

use super::Random;

/// How bodies move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Pattern {
    /// Each body follows a closed curve of its own, up to half a metre from its start along each axis, and turns.
    #[default]
    Wander,
    /// Each body trembles about its start, by up to 1 mm along each axis.
    Vibrate,
    /// Each body turns in place.
    Spin,
    /// No body moves; frames are still sent.
    Rest,
}

/// The motion of one body.
#[derive(Clone, Debug)]
pub struct Motion {
    home: Pose,
    amplitude: Vec3,
    frequency: Vec3,
    phase: Vec3,
    spin: Vec3,
}

impl Motion {
    /// A motion about `home`, drawn from `random`.
    #[must_use]
    pub fn new(home: Pose, pattern: Pattern, random: &mut Random) -> Self {
        let mut draw = |low: f64, high: f64| {
            Vec3::new(
                random.range(low, high),
                random.range(low, high),
                random.range(low, high),
            )
        };
        let phase = draw(0.0, std::f64::consts::TAU);
        let slow = draw(0.3, 1.2);
        let turn = draw(-0.8, 0.8);
        let (amplitude, frequency, spin) = match pattern {
            Pattern::Wander => (Vec3::repeat(0.5), slow, turn),
            Pattern::Vibrate => (Vec3::repeat(0.001), slow * 40.0, Vec3::zeros()),
            Pattern::Spin => (Vec3::zeros(), slow, turn * 3.0),
            Pattern::Rest => (Vec3::zeros(), slow, Vec3::zeros()),
        };
        Self {
            home,
            amplitude,
            frequency,
            phase,
            spin,
        }
    }

    /// The pose at a time, seconds.
    #[must_use]
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let angle = self.frequency * time_s + self.phase;
        let offset = self.amplitude.component_mul(&angle.map(f64::sin));
        let turn = UnitQuaternion::from_scaled_axis(self.spin * time_s);
        Pose::from_parts(
            (self.home.translation.vector + offset).into(),
            turn * self.home.rotation,
        )
    }
}
