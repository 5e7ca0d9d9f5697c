//! Without candidates: how a few bodies would do with fat boxes.
//!
//! In: the boxes of some bodies, in each tick for a while. Out: how often they escape from fat boxes that only the
//! probe uses, and the density meanwhile. If escapes are no rarer than when candidates were given up, and the density
//! is the same, candidates are not tried again: a trial costs several times as much as the ticks around it, a probe
//! almost nothing. If most probed bodies are at rest, all bodies are observed (`seen`), and start with boxes as wide as
//! the observed motion when candidates are tried again.

use super::fatten::{Gait, HORIZON};
use super::gear::Footing;
use super::links::room;
use super::{BodySlot, Order, Proxies, Tick};
use crate::simd::boxes::{Down, Held, Lanes, Portable};

/// Ticks of a probe, and how many of them are left out because bodies have yet to learn their margins.
pub(super) const PROBE_TICKS: u32 = 64;
const LEARN_TICKS: u32 = 16;
/// Bodies in a probe; at most twice as many.
const SAMPLE: usize = 64;
/// What an overlap adds to the density measure: at least as many boxes are near a body as overlap it.
const CROWD: u64 = 4;

/// A body and the fat box that it would have.
#[derive(Clone, Copy, Debug)]
struct Watched {
    slot: BodySlot,
    gait: Gait,
    held: Held,
}

/// Result of a probe so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Probe {
    ticks: u32,
    /// Origin of the boxes, metres.
    pub(super) origin: [f64; 3],
    bodies: Vec<Watched>,
    /// Number of escapes from fat boxes, and the number possible.
    escapes: u64,
    watched: u64,
    /// Sums over the counted ticks: overlaps, and bodies.
    hits: u64,
    all: u64,
    /// Ticks in which all bodies were observed (`seen`).
    pub(super) seen: u32,
}

impl Probe {
    /// Starts over, with some of these bodies.
    fn begin(&mut self, origin: [f64; 3], bodies: &[BodySlot]) {
        self.bodies.clear();
        room(&mut self.bodies, 2 * SAMPLE);
        let some = bodies.iter().step_by((bodies.len() / SAMPLE).max(1));
        self.bodies.extend(some.map(|slot| Watched {
            slot: *slot,
            gait: Gait::NEW,
            held: Held::EMPTY,
        }));
        *self = Self {
            origin,
            bodies: std::mem::take(&mut self.bodies),
            ..Self::default()
        };
    }

    /// Tests the bodies once.
    fn look<P: Proxies>(&mut self, tick: &Tick<'_, P>, hits: usize) {
        self.ticks += 1;
        let counts = u64::from(self.ticks > LEARN_TICKS);
        self.hits += counts * hits as u64;
        self.all += counts * tick.members.bounded().len() as u64;
        for Watched { slot, gait, held } in &mut self.bodies {
            if !tick.members.is_bounded(*slot) {
                continue;
            }
            let aabb = tick.proxies.aabb(*slot);
            let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
            let mut now = Down::EMPTY;
            let stays = Portable.take(corners, &self.origin, held, &mut now);
            if !stays {
                *held = Held::of(&gait.renew(&now, self.ticks, HORIZON, &held.hold()));
            }
            self.escapes += counts * u64::from(!stays);
            self.watched += counts;
        }
    }

    /// Typical span of the motion of bodies at rest, in mean sides, if most bodies of the probe are at rest.
    pub(super) fn span(&self) -> Option<f32> {
        let mut spans = [0.0; 2 * SAMPLE];
        let mut count = 0;
        let known = self
            .bodies
            .iter()
            .filter_map(|one| one.gait.span(&one.held.hold()));
        for (place, span) in spans.iter_mut().zip(known) {
            *place = span;
            count += 1;
        }
        spans[..count].sort_unstable_by(f32::total_cmp);
        (count * 2 > self.bodies.len()).then(|| spans[count / 2])
    }

    /// The result.
    fn footing(&self) -> Footing {
        Footing {
            escapes: self.escapes * 1024 / self.watched.max(1),
            crowd: 1024 + self.hits * CROWD * 1024 / self.all.max(1),
        }
    }
}

impl Order {
    /// Continues the probe in this tick, if there is one.
    pub(super) fn probe<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        let Some(begins) = self.afresh.gear.probes() else {
            self.forget_all_seen();
            return;
        };
        if begins {
            self.forget_all_seen();
        }
        let probe = &mut self.afresh.probe;
        if begins {
            probe.begin(self.origin, tick.members.bounded());
        }
        probe.look(tick, self.hits);
        if probe.span().is_some() {
            probe.seen += 1;
            self.see_all(tick);
        }
        let probe = &mut self.afresh.probe;
        if self.afresh.gear.asks_probe(probe.ticks) {
            let footing = probe.footing();
            self.afresh.gear.note_probe(footing);
        }
    }
}
