//! Without candidates: what a few bodies would do with fat boxes.
//!
//! In: the boxes of some bodies, in each tick of a while. Out: how often they escape from fat boxes that nobody else
//! sees, and what the search meets meanwhile. Where they escape no more seldom than when candidates were given up, and
//! as much is met, candidates are not tried again: a trial takes several times what the ticks about it take, a probe
//! next to nothing. And where most of them are at rest, all bodies are seen (`seen`), and begin with boxes as wide as
//! theirs when candidates are tried again.

use super::fatten::{Gait, HORIZON};
use super::gear::Footing;
use super::links::room;
use super::{BodySlot, Order, Proxies, Tick};
use crate::simd::boxes::{Down, Held, Lanes, Portable};

/// Ticks of a probe, and those of them until bodies have learned their margins, which do not count.
pub(super) const PROBE_TICKS: u32 = 64;
const LEARN_TICKS: u32 = 16;
/// Bodies that are watched, at most twice as many.
const SAMPLE: usize = 64;
/// What an overlap adds to a body's crowd: as much is near it as overlaps it, and more.
const CROWD: u64 = 4;

/// A body and the fat box that it would have.
#[derive(Clone, Copy, Debug)]
struct Watched {
    slot: BodySlot,
    gait: Gait,
    held: Held,
}

/// What a probe has seen.
#[derive(Clone, Debug, Default)]
pub(super) struct Probe {
    ticks: u32,
    /// Where the boxes are measured from, metres.
    pub(super) origin: [f64; 3],
    bodies: Vec<Watched>,
    /// Bodies that escaped from their fat boxes, and those that could have.
    escapes: u64,
    watched: u64,
    /// Overlaps, and bodies.
    hits: u64,
    all: u64,
    /// Ticks in which all bodies were seen (`seen`).
    pub(super) seen: u32,
}

impl Probe {
    /// Begins anew, with some of these bodies.
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

    /// Looks at the bodies once.
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

    /// What bodies at rest span, in their mean sides, where most of those that are watched are at rest.
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

    /// What it comes to.
    fn footing(&self) -> Footing {
        Footing {
            escapes: self.escapes * 1024 / self.watched.max(1),
            crowd: 1024 + self.hits * CROWD * 1024 / self.all.max(1),
        }
    }
}

impl Order {
    /// Goes on with the probe of this tick, if there is one.
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
