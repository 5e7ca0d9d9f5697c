//! Two bodies measured for a query: what gap answers have in common. In: bodies at their present poses, a [`Meter`].
//! Out: a sound interval with its verdict and witness, scene frame; and whether a body's place is known at all.

use crate::ids::{BodyId, BodySlot};
use crate::math::{Interval, Point, Vec3};
use crate::narrow::gap_between;
use crate::time::{Clock, Meter};
use crate::wire::{BodyStatus, GapKnown, Verdict};
use crate::world::{Body, Parts, World};

/// Longest work on one answer, nanoseconds; then the answer is what is proved so far, a sound interval.
pub(super) const WORK_NS: u64 = 1_000_000_000;
/// Longest time for fitting its boxes before that, nanoseconds.
const FIT_NS: u64 = WORK_NS / 4;

/// What is known of the gap of A and B. Metres, scene frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) gap: Interval,
    pub(super) verdict: Verdict,
    pub(super) touching: bool,
    /// Nothing was cut off.
    pub(super) finished: bool,
    best_m: Option<f64>,
    point_a: Option<[f64; 3]>,
    point_b: Option<[f64; 3]>,
    /// Unit, from A to B.
    pub(super) normal: Option<[f64; 3]>,
    /// Index of B's shape there, and its triangle or `NO_INDEX`.
    pub(super) place_b: Option<(u32, u32)>,
}

impl Measured {
    /// Measures them.
    ///
    /// * `report_m` - pairs nearer than this are `near`, metres.
    pub(super) fn of(a: &Body, b: &Body, report_m: f64, meter: &mut Meter<'_>) -> Self {
        let asked = gap_between(a, b, report_m, meter);
        let place = |body: &Body, point: &Point| (body.pose * point).coords.into();
        let witness = asked.witness;
        Self {
            gap: asked.gap,
            verdict: asked.verdict,
            touching: asked.touching,
            finished: asked.finished,
            best_m: witness.map(|w| w.best_m),
            point_a: witness.map(|w| place(a, &w.point_a)),
            point_b: witness.map(|w| place(b, &w.point_b)),
            normal: witness.map(|w| {
                let normal: Vec3 = a.pose.rotation * w.normal;
                normal.into()
            }),
            place_b: witness.map(|w| (w.shape_b, w.triangle_b)),
        }
    }

    /// In the form of an answer.
    pub(super) fn told(&self) -> GapKnown {
        let finite = |end: f64| end.is_finite().then_some(end);
        let Interval { min, max } = self.gap;
        // An estimate is never outside what is proved, and the points are as far apart as it says.
        let best_m = self.best_m.and_then(|best| finite(best.max(min).min(max)));
        let point_b = match (best_m, self.point_a, self.normal) {
            (Some(best_m), Some(at), Some(normal)) if self.best_m != Some(best_m) => {
                Some([0, 1, 2].map(|k| at[k] + normal[k] * best_m))
            }
            _ => self.point_b,
        };
        GapKnown {
            verdict: self.verdict.code(),
            touching: self.touching,
            gap_min_m: finite(min),
            gap_max_m: finite(max),
            gap_best_m: best_m,
            point_a: self.point_a,
            point_b,
            normal: self.normal,
        }
    }
}

/// The age of a body's pose; `None`: it cannot move, or none was received.
pub(super) fn age_ns(body: &Body, now_ns: u64) -> Option<u64> {
    let since_ns = body.since_ns.filter(|_| body.moves)?;
    Some(now_ns.saturating_sub(since_ns))
}

/// Fits the boxes of bodies that deform to their vertices, in private copies: the engine fits only those for which a
/// pair waits, and outdated boxes prove nothing apart. A body that occurs several times is fitted once.
///
/// For at most [`FIT_NS`]; the remaining bodies are measured as they are, which takes longer.
pub(super) fn fit_boxes<'b>(bodies: impl Iterator<Item = &'b mut Body>, clock: &dyn Clock) {
    let end_ns = clock.monotonic_ns().saturating_add(FIT_NS);
    let mut fitted: Vec<(BodyId, Parts)> = Vec::new();
    for body in bodies.filter(|body| body.lags()) {
        if clock.monotonic_ns() >= end_ns {
            return;
        }
        if let Some((_, shapes)) = fitted.iter().find(|(id, _)| *id == body.id) {
            body.shapes = shapes.clone();
        } else {
            body.fit_boxes();
            fitted.push((body.id, body.shapes.clone()));
        }
    }
}

/// Whether a body's place is known; returns a warning about it, if any.
///
/// # Errors
/// Why it is not known, which body, and what to change.
pub(super) fn fit(world: &World, slot: BodySlot, body: &Body) -> Result<Option<String>, String> {
    let name = &body.name;
    match body.status {
        BodyStatus::Known | BodyStatus::Truncated => Ok(None),
        BodyStatus::Held => Ok(Some(format!(
            "body \"{name}\" is held: its pose is too old, and it may be elsewhere"
        ))),
        BodyStatus::NotReceived => Err(not_received(world, slot, body)),
        BodyStatus::Rejected => Err(rejected(world, slot, body)),
        BodyStatus::Stale => Err(format!(
            "body \"{name}\" is stale: its pose is older than its time-out; ask again when its source sends"
        )),
        BodyStatus::RemovedByAge => Err(format!(
            "body \"{name}\" is removed_by_age: its pose is too old; ask again when its source sends"
        )),
        BodyStatus::Disabled => Err(format!(
            "body \"{name}\" is disabled: enable it, then ask again"
        )),
    }
}

/// The body whose pose and vertices a body waits for: its root, or itself if it hangs on none. A body that hangs on
/// another does not deform.
fn awaited<'w>(world: &'w World, slot: BodySlot, body: &'w Body) -> &'w Body {
    let root = world.root_of(slot).0;
    let root = world.body(root).filter(|_| root != slot);
    root.unwrap_or(body)
}

/// What has not been received for a body.
fn not_received(world: &World, slot: BodySlot, body: &Body) -> String {
    let of = awaited(world, slot, body);
    let vertices = of.vertices.as_deref();
    let lacks_them = of.since_ns.is_some() && vertices.is_some_and(|v| v.version.is_none());
    let (what, have) = if lacks_them {
        ("vertices", "have")
    } else {
        ("pose", "has")
    };
    let whose = if of.id == body.id {
        "it".to_owned()
    } else {
        format!("\"{}\", on which it hangs,", of.name)
    };
    format!(
        "body \"{}\" is not_received: no {what} of {whose} {have} come yet; ask again when its source sends",
        body.name
    )
}

/// What was refused of a body's data.
fn rejected(world: &World, slot: BodySlot, body: &Body) -> String {
    let of = awaited(world, slot, body);
    let bent = of.vertices.as_deref().and_then(|v| v.refused);
    let (what, were, then) = if bent.is_some() {
        ("vertices", "were", "all of them have come")
    } else {
        ("pose", "was", "a good one")
    };
    let newest = if of.id == body.id {
        format!("its newest {what}")
    } else {
        format!("the newest {what} of \"{}\", on which it hangs,", of.name)
    };
    let why = bent.or(body.reject);
    let why = why.map_or_else(String::new, |why| format!(" ({why})"));
    format!(
        "body \"{}\" is rejected: {newest} {were} refused{why}; ask again after {then}",
        body.name
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_is_not_told_outside_of_what_was_proved_since() {
        let measured = |min, max, best| Measured {
            gap: Interval { min, max },
            verdict: Verdict::Near,
            touching: false,
            finished: false,
            best_m: Some(best),
            point_a: None,
            point_b: None,
            normal: None,
            place_b: None,
        };
        for (known, told) in [
            (measured(1.0, 2.0, 0.5), Some(1.0)),
            (measured(1.0, 2.0, 2.5), Some(2.0)),
            (measured(f64::NEG_INFINITY, 2.0, 0.5), Some(0.5)),
            (measured(f64::NEG_INFINITY, 2.0, f64::NEG_INFINITY), None),
        ] {
            assert_eq!(known.told().gap_best_m, told);
        }
        assert_eq!(measured(f64::NEG_INFINITY, 1.0, 0.0).told().gap_min_m, None);
        // bug: the points stayed where the estimate had been.
        for (min, max, told) in [(1.0, 2.0, 7.0), (0.25, 2.0, 6.5), (0.125, 0.25, 6.25)] {
            let known = Measured {
                point_a: Some([1.0, 6.0, 2.0]),
                point_b: Some([1.0, 6.5, 2.0]),
                normal: Some([0.0, 1.0, 0.0]),
                ..measured(min, max, 0.5)
            };
            assert_eq!(known.told().point_b, Some([1.0, told, 2.0]));
        }
    }
}
