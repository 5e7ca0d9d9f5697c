//! The gap of two bodies of a running daemon. In: names, and the world between two ticks. Out: a self-contained
//! question that a worker answers while ticks go on; or why there is no answer.

use super::measure::{Measured, WORK_NS, age_ns, fit};
use crate::ids::BodySlot;
use crate::time::{Clock, Meter};
use crate::wire::{GapFound, MessageHeader};
use crate::world::{Body, World};

/// Two bodies as of one tick.
#[derive(Clone, Debug)]
pub struct GapQuestion {
    a: Body,
    b: Body,
    report_m: f64,
    tick_header: MessageHeader,
    /// Warnings: what is odd, but allowed.
    pub warnings: Vec<String>,
}

impl GapQuestion {
    /// Copies the bodies at their present poses.
    ///
    /// * `tick_header` - of the tick that left the world in this state.
    ///
    /// # Errors
    /// Why there is no gap, which body, and what to change: no such body, one of unknown place, the same one twice, two
    /// that are half-spaces and nothing else.
    pub fn new(
        world: &World,
        tick_header: MessageHeader,
        a: &str,
        b: &str,
    ) -> Result<Self, String> {
        let ((slot_a, one), (slot_b, other), warnings) = both(world, a, b)?;
        Ok(Self {
            a: one.still(),
            b: other.still(),
            report_m: world.report_within(slot_a, slot_b),
            tick_header,
            warnings,
        })
    }

    /// The bodies that the answer is computed from.
    pub(super) fn bodies_mut(&mut self) -> impl Iterator<Item = &mut Body> {
        [&mut self.a, &mut self.b].into_iter()
    }

    /// Works on the answer, for a second at most.
    #[must_use]
    pub fn answer(&self, clock: &dyn Clock) -> GapFound {
        let (a, b) = (&self.a, &self.b);
        let now_ns = clock.boottime_ns();
        let end_ns = clock.monotonic_ns().saturating_add(WORK_NS);
        let mut meter = Meter::new(clock, Some(end_ns), None);
        let found = Measured::of(a, b, self.report_m, &mut meter);
        GapFound {
            tick_header: self.tick_header,
            age_ns: age_ns(a, now_ns).max(age_ns(b, now_ns)),
            known: found.told(),
        }
    }
}

/// The slot of a body's name.
pub(super) fn find(world: &World, name: &str) -> Result<BodySlot, String> {
    world.slot_named(name).ok_or_else(|| {
        let mend = match world.name_meant(name) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => "the names are those of `names`".to_owned(),
        };
        format!("there is no body \"{name}\" in the scene: {mend}")
    })
}

/// A body and its slot.
type Found<'w> = (BodySlot, &'w Body);

/// Two bodies with a defined gap, and warnings.
///
/// # Errors
/// Why there is none, which body, and what to change.
pub(super) fn both<'w>(
    world: &'w World,
    a: &str,
    b: &str,
) -> Result<(Found<'w>, Found<'w>, Vec<String>), String> {
    let (slot_a, slot_b) = (find(world, a)?, find(world, b)?);
    if slot_a == slot_b {
        return Err(format!(
            "both are body \"{a}\", which has no gap to itself: name another one"
        ));
    }
    let (Some(one), Some(other)) = (world.body(slot_a), world.body(slot_b)) else {
        return Err("a body has just been taken out: ask again".to_owned());
    };
    let mut warnings = Vec::new();
    for (slot, body) in [(slot_a, one), (slot_b, other)] {
        warnings.extend(fit(world, slot, body)?);
    }
    if one.only_half_spaces && other.only_half_spaces {
        return Err(format!(
            "\"{a}\" and \"{b}\" are both half-spaces, and two half-spaces have no gap: ask of bodies of which one has another shape"
        ));
    }
    Ok(((slot_a, one), (slot_b, other), warnings))
}
