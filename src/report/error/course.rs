//! The poses of a scene's bodies in each tick: the built-in motion of `feed`, for all sources at once.

use crate::builtin::{Motion, Random};
use crate::report::rig::row;
use crate::scene::BodySpec;
use crate::wire::TransformRow;

use super::Setup;

/// The motion of a scene. Bodies that no frame may move (fixed or attached ones) stay where they are.
#[derive(Clone, Debug)]
pub struct Course {
    sources: Vec<Vec<(u64, Motion)>>,
    count: usize,
    rate_hz: f64,
}

impl Course {
    /// Drawn from the seed, source by source, as `feed` does for each source.
    #[must_use]
    pub fn new(setup: &Setup<'_>) -> Self {
        let of = |source: usize| {
            let mut random = Random::new(setup.seed);
            let own = |body: &&BodySpec| {
                body.moves && body.source == Some(source) && body.attached_to.is_none()
            };
            let bodies = setup.scene.bodies.iter().filter(own);
            bodies
                .map(|body| {
                    let motion = Motion::new(body.pose, setup.motion, &mut random);
                    (body.id.0, motion)
                })
                .collect()
        };
        Self {
            sources: (0..setup.scene.sources.len()).map(of).collect(),
            count: setup.count.unwrap_or(usize::MAX),
            rate_hz: setup.rate_hz,
        }
    }

    /// One frame of each source.
    #[must_use]
    pub fn frames(&self, tick: u64) -> Vec<Vec<TransformRow>> {
        #[allow(clippy::cast_precision_loss, reason = "counts far below 2^53")]
        let time_s = tick as f64 / self.rate_hz;
        let frame = |bodies: &Vec<(u64, Motion)>| {
            let all = bodies.iter().enumerate();
            all.map(|(at, (id, motion))| {
                let time_s = if at < self.count { time_s } else { 0.0 };
                row(*id, &motion.pose_at(time_s))
            })
            .collect()
        };
        self.sources.iter().map(frame).collect()
    }

    /// Number of bodies that move.
    #[must_use]
    pub fn moving(&self) -> usize {
        let own = |bodies: &Vec<_>| bodies.len().min(self.count);
        self.sources.iter().map(own).sum()
    }
}
