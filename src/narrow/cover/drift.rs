//! How far a pair has moved since its certificates were made: the path over anchors, plus the displacement since the
//! last.

use crate::math::{Pose, ROUND};

/// Motion of the second of a pair seen from the first.
#[derive(Clone, Debug)]
pub(in crate::narrow) struct Drift {
    anchor: Pose,
    /// The previous anchor, and its distance from the present one, metres.
    before: Pose,
    stride_m: f64,
    /// `S`: length of the path over all anchors, metres, rounded up.
    pub(in crate::narrow) path_m: f64,
    /// `d`: displacement from the anchor, metres, rounded up.
    offset_m: f64,
    /// Displacement at the last move, from the anchor at that time, metres.
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

    /// Moves to a pose of the second seen from the first; sets an anchor if the motion leads away from the last two.
    ///
    /// * `moved` - how far any point of the smaller shape moves between two poses, metres, rounded up.
    pub(in crate::narrow) fn follow(&mut self, pos12: &Pose, moved: impl Fn(&Pose, &Pose) -> f64) {
        self.offset_m = moved(&self.anchor, pos12);
        self.last_m = self.offset_m;
        // A motion back and forth between two places never gets farther from either than their distance.
        if moved(&self.before, pos12) >= self.stride_m + 0.5 * self.offset_m {
            self.anchor_here(pos12);
        }
    }

    /// Adds the deformation of the two, metres, rounded up.
    pub(in crate::narrow) fn add(&mut self, bent_m: f64) {
        let path_m = self.path_m + bent_m;
        self.path_m = path_m + 2.0 * ROUND * path_m;
        self.last_m += bent_m;
    }

    /// Sets an anchor at the last pose. Returns whether it was not one already.
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

    /// The path at which a gap found at this pose is used up, rounded down; `None` if it does not outlast this pose.
    pub(in crate::narrow) fn expiry(&self, gap: f64) -> Option<f64> {
        self.outlasts(gap).then(|| self.used_up_at(gap))
    }

    /// A gap found at this pose that is greater than this outlasts it, metres; a smaller one may.
    pub(in crate::narrow) fn lasting_m(&self) -> f64 {
        // The part used up at once, and rounding on the way there and back.
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
