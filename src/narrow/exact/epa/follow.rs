//! Polytopes of pairs that are queried from tick to tick: begun where the last query ended.
//!
//! In: what an earlier query of the pair found and left, usually at nearby poses. Out: the gap, and what is left for
//! the next query; nothing if the start from what was left fails.

use super::super::newton::Refined;
use super::super::pair::{CoreGap, Held, Pair};
use super::super::polytope::{Polytope, Shell};
use super::{SCRATCH, State};
use crate::math::Vec3;

/// The gap of two cores by a polytope that begins around the closest point of an earlier answer; `None` if the cores
/// are apart, or the ends do not meet.
pub(in super::super) fn depth_around(
    pair: &Pair<'_>,
    found: &Refined,
    shell: Option<&mut Shell>,
) -> Option<CoreGap> {
    if found.value >= -pair.tiny() {
        return None;
    }
    SCRATCH.with(|scratch| {
        let mut polytope = scratch.try_borrow_mut().ok()?;
        if let Some(gap) = polytope.depth_under(pair, found, shell) {
            return Some(gap);
        }
        if !polytope.start_below(pair, found.corner(), &-found.normal) {
            return None;
        }
        let gap = polytope.settle(pair, Some(found));
        let within = gap.upper < -pair.tiny();
        (within && gap.is_tight(pair)).then(|| polytope.straight(pair, gap))
    })
}

/// The gap of two cores by a polytope that begins at the face which an earlier one ended at; `None` if there was none,
/// the cores are apart by now, or the ends do not meet.
pub(in super::super) fn depth_at(
    pair: &Pair<'_>,
    held: &Held,
    normal: &Vec3,
    shell: Option<&mut Shell>,
) -> Option<CoreGap> {
    if !held.deep {
        return None;
    }
    let end = |polytope: &mut Polytope| {
        let gap = polytope.settle(pair, None);
        let meets = gap.upper < -pair.tiny() && gap.upper - gap.lower <= 4.0 * pair.tiny();
        meets.then(|| polytope.straight(pair, gap))
    };
    let start = |polytope: &mut Polytope| {
        let mut recalled = pair.recall(held, normal);
        let face = [recalled.next()?, recalled.next()?, recalled.next()?];
        (polytope.start_at(pair, face, &-normal)).then_some(())
    };
    SCRATCH.with(|scratch| {
        let mut polytope = scratch.try_borrow_mut().ok()?;
        polytope.along(pair, shell, |_| None, end, start)
    })
}

impl Polytope {
    /// Begins with the shell of an earlier query, or, if that fails, with `start`; leaves the shell of this one.
    ///
    /// * `aside` - see [`Polytope::start_with`].
    /// * `end` - grows and returns the gap, if that is good enough.
    fn along(
        &mut self,
        pair: &Pair<'_>,
        shell: Option<&mut Shell>,
        aside: impl Fn(&Vec3) -> Option<Vec3>,
        end: impl Fn(&mut Self) -> Option<CoreGap>,
        start: impl FnOnce(&mut Self) -> Option<()>,
    ) -> Option<CoreGap> {
        let Some(shell) = shell else {
            start(self)?;
            return end(self);
        };
        if self.start_with(pair, shell, aside) {
            let faces = self.faces.len();
            if let Some(gap) = end(self) {
                shell.used = true;
                if self.faces.len() > faces {
                    self.leave(pair, shell);
                }
                return Some(gap);
            }
        }
        start(self)?;
        let gap = end(self)?;
        self.leave(pair, shell);
        Some(gap)
    }

    /// The gap, if the features prove enough about the directions around the best one for the polytope to begin with a
    /// cap that represents them; `None` if they do not, or another direction is better.
    pub(in super::super) fn depth_under(
        &mut self,
        pair: &Pair<'_>,
        found: &Refined,
        shell: Option<&mut Shell>,
    ) -> Option<CoreGap> {
        let cap = found
            .cap
            .filter(|cap| cap.loss_m <= pair.tolerance() / 2.0)?;
        // What the features prove within the cap; no more is reported.
        let depth_m = -found.value - cap.loss_m;
        if depth_m <= 0.0 {
            return None;
        }
        let out = -found.normal;
        let end = |polytope: &mut Self| {
            let mut state = State {
                refined: Some(*found),
                ..State::new()
            };
            state.best.offer(found.value, &found.normal, 0);
            polytope.expand(pair, &mut state);
            let gap = CoreGap {
                upper: (-state.fits.min(depth_m)).max(found.value),
                ..found.apart()
            };
            let holds = -gap.upper > depth_m * cap.lift() && gap.is_tight(pair);
            holds.then_some(gap)
        };
        let aside = |was: &Vec3| Self::beside(&out, depth_m, &cap, was);
        let start = |polytope: &mut Self| {
            polytope.start_under(pair, &out, depth_m, &cap);
            Some(())
        };
        self.along(pair, shell, aside, end, start)
    }
}
