//! The gap of two bodies of a running daemon. In: names, and the world between two ticks. Out: a question that holds
//! all it needs, so that a worker answers it while ticks go on; or why there is no answer.

use crate::math::{Point, Vec3};
use crate::narrow::gap_between;
use crate::time::{Clock, Meter};
use crate::wire::{BodyStatus, GapFound, MessageHeader};
use crate::world::{Body, World};

/// Longest work on one answer, nanoseconds; then what is proved by then is the answer, an interval that is sound.
const WORK_NS: u64 = 1_000_000_000;

/// Two bodies as they stood in one tick.
#[derive(Clone, Debug)]
pub struct GapQuestion {
    a: Body,
    b: Body,
    report_m: f64,
    tick_header: MessageHeader,
    /// What is odd about them, but legal.
    pub warnings: Vec<String>,
}

impl GapQuestion {
    /// Takes the bodies as they stand.
    ///
    /// * `tick_header` - of the tick that left the world so.
    ///
    /// # Errors
    /// Why there is no gap to tell, which body, and what to change: no such body, one whose place is not known, the
    /// same one twice, two that have half-spaces.
    pub fn new(
        world: &World,
        tick_header: MessageHeader,
        a: &str,
        b: &str,
    ) -> Result<Self, String> {
        let slot = |name: &str| {
            world.slot_named(name).ok_or_else(|| {
                format!("there is no body \"{name}\" in the scene: the names are those of `names`")
            })
        };
        let (slot_a, slot_b) = (slot(a)?, slot(b)?);
        if slot_a == slot_b {
            return Err(format!(
                "both are body \"{a}\", which has no gap to itself: name another one"
            ));
        }
        let (Some(one), Some(other)) = (world.body(slot_a), world.body(slot_b)) else {
            return Err("a body has just been taken out: ask again".to_owned());
        };
        let mut warnings = Vec::new();
        for body in [one, other] {
            warnings.extend(fit(body)?);
        }
        if one.unbounded && other.unbounded {
            return Err(format!(
                "\"{a}\" and \"{b}\" both have a half-space, and two half-spaces have no gap: ask of bodies of which one at least is bounded"
            ));
        }
        Ok(Self {
            a: one.clone(),
            b: other.clone(),
            report_m: world.report_within(slot_a, slot_b),
            tick_header,
            warnings,
        })
    }

    /// Works on the answer, for a second at most.
    #[must_use]
    pub fn answer(&self, clock: &dyn Clock) -> GapFound {
        let (a, b) = (&self.a, &self.b);
        let now_ns = clock.boottime_ns();
        let age_ns = |body: &Body| Some(now_ns.saturating_sub(body.since_ns?));
        let end_ns = clock.monotonic_ns().saturating_add(WORK_NS);
        let mut meter = Meter::new(clock, Some(end_ns), None);
        let asked = gap_between(a, b, self.report_m, &mut meter);
        let finite = |end: f64| end.is_finite().then_some(end);
        let found = GapFound {
            tick_header: self.tick_header,
            // What does not move has no age.
            age_ns: [a, b]
                .into_iter()
                .filter(|body| body.moves)
                .filter_map(age_ns)
                .max(),
            verdict: asked.verdict.code(),
            touching: asked.touching,
            gap_min_m: finite(asked.gap.min),
            gap_max_m: finite(asked.gap.max),
            ..GapFound::default()
        };
        let Some(witness) = asked.witness else {
            return found;
        };
        let place = |body: &Body, point: &Point| Some((body.pose * point).coords.into());
        let normal: Vec3 = a.pose.rotation * witness.normal;
        GapFound {
            // An estimate is never outside what is proved.
            gap_best_m: finite(witness.best_m.max(asked.gap.min).min(asked.gap.max)),
            point_a: place(a, &witness.point_a),
            point_b: place(b, &witness.point_b),
            normal: Some(normal.into()),
            ..found
        }
    }
}

/// Whether a body's place is known; what is odd about it, but legal.
fn fit(body: &Body) -> Result<Option<String>, String> {
    let name = &body.name;
    match body.status {
        BodyStatus::Known | BodyStatus::Truncated => Ok(None),
        BodyStatus::Held => Ok(Some(format!(
            "body \"{name}\" is held: its pose is too old, and it may be elsewhere"
        ))),
        BodyStatus::NotReceived => Err(format!(
            "body \"{name}\" is not_received: no pose of it has come yet; ask again when its source sends"
        )),
        BodyStatus::Rejected => {
            let why = body
                .reject
                .map_or_else(String::new, |why| format!(" ({why})"));
            Err(format!(
                "body \"{name}\" is rejected: its newest pose was refused{why}; ask again after a good one"
            ))
        }
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
