//! How far a pair has moved since its certificates were made: a path over anchors, and what has been gone since the
//! last.

use crate::math::{Pose, ROUND};

/// Motion of the second of a pair seen from the first.
#[derive(Clone, Debug)]
pub(in crate::narrow) struct Drift {
    anchor: Pose,
    /// The anchor before, and how far the two are apart, metres.
    before: Pose,
    stride_m: f64,
    /// `S`: length of the path over all anchors, metres, rounded up.
    pub(in crate::narrow) path_m: f64,
    /// `d`: displacement from the anchor, metres, rounded up.
    offset_m: f64,
    /// Displacement at the last move, from the anchor of then, metres.
    pub(in crate::narrow) last_m: f64,
}

impl Default for Drift {
    fn default() -> Self {
        Self::at(&Pose::identity())
    }
}

impl Drift {
    pub(in crate::narrow) fn at(pose: &Pose) -> Self {
        Self {
            anchor: *pose,
            before: *pose,
            stride_m: 0.0,
            path_m: 0.0,
            offset_m: 0.0,
            last_m: 0.0,
        }
    }

    /// Moves to a pose of the second seen from the first; takes an anchor where the way leads on from the last two.
    ///
    /// * `moved` - how far any point of the smaller one moves from one pose to another, metres, rounded up.
    pub(in crate::narrow) fn follow(&mut self, pos12: &Pose, moved: impl Fn(&Pose, &Pose) -> f64) {
        self.offset_m = moved(&self.anchor, pos12);
        self.last_m = self.offset_m;
        // Back and forth between two places is farther from neither than they are from each other.
        if moved(&self.before, pos12) >= self.stride_m + 0.5 * self.offset_m {
            self.anchor_here(pos12);
        }
    }

    /// Adds what the two deformed by, metres, rounded up.
    pub(in crate::narrow) fn add(&mut self, bent_m: f64) {
        let path_m = self.path_m + bent_m;
        self.path_m = path_m + 2.0 * ROUND * path_m;
        self.last_m += bent_m;
    }

    /// Takes an anchor at the pose last moved to; whether it was none before.
    pub(in crate::narrow) fn anchor_here(&mut self, pos12: &Pose) -> bool {
        if self.offset_m == 0.0 {
            return false;
        }
        let path_m = self.path_m + self.offset_m;
        self.path_m = path_m + 2.0 * ROUND * path_m;
        self.before = std::mem::replace(&mut self.anchor, *pos12);
        self.stride_m = std::mem::take(&mut self.offset_m);
        true
    }

    /// The path at which a gap found at this pose is used up, rounded down; `None` where it does not outlast this pose.
    pub(in crate::narrow) fn expiry(&self, gap: f64) -> Option<f64> {
        self.outlasts(gap).then(|| self.used_up_at(gap))
    }

    /// A gap found at this pose that is greater than this outlasts it, metres; one not as great may.
    pub(in crate::narrow) fn lasting_m(&self) -> f64 {
        // What is used up at once, and what is rounded on the way there and back.
        2.0 * self.offset_m + 16.0 * ROUND * (self.path_m + self.offset_m)
    }

    /// Whether a gap found at this pose outlasts it.
    fn outlasts(&self, gap: f64) -> bool {
        (gap > 0.0) & (self.left_m(self.used_up_at(gap)) > 0.0)
    }

    #[inline]
    fn used_up_at(&self, gap: f64) -> f64 {
        let expiry_m = (self.path_m - self.offset_m) + gap;
        expiry_m - 4.0 * ROUND * (self.path_m + self.offset_m + gap)
    }

    /// The gap that an expiry proves at this pose, rounded down; zero or less: none.
    pub(in crate::narrow) fn left_m(&self, expiry_m: f64) -> f64 {
        let spent_m = self.path_m + self.offset_m;
        (expiry_m - spent_m) - 4.0 * ROUND * spent_m
    }
}
