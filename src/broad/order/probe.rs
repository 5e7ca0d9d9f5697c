//! Without candidates: what a few bodies would do with fat boxes.
//!
//! In: the boxes of some bodies, in each tick of a while. Out: how often they escape from fat boxes that nobody else
//! sees, and what the search meets meanwhile. Where they escape no more seldom than when candidates were given up, and
//! as much is met, candidates are not tried again: a trial takes several times what the ticks about it take, a probe
//! next to nothing. And where most of them are at rest, all bodies begin with boxes as wide as theirs when candidates
//! are tried again: else each would have to learn it, most in the very next tick.

use super::fatten::{Gait, HORIZON, hold_of_seen, outward};
use super::gear::Footing;
use super::idle::{is_thrifty, shed};
use super::links::room;
use super::{BodySlot, Order, Proxies, Tick};
use crate::simd::boxes::{Down, Hold, Lanes, Portable, Work};

/// Ticks of a probe, and those of them until bodies have learned their margins, which do not count.
pub(super) const PROBE_TICKS: u32 = 64;
const LEARN_TICKS: u32 = 16;
/// Bodies that are watched, at most twice as many.
const SAMPLE: usize = 64;
/// What an overlap adds to a body's crowd: as much is near it as overlaps it, and more.
const CROWD: u64 = 4;

/// So often must bodies have been seen for it to tell where they are about.
const SEEN_LEAST: u32 = 8;

/// A body and the fat box that it would have.
#[derive(Clone, Copy, Debug)]
struct Watched {
    slot: BodySlot,
    gait: Gait,
    hold: Hold,
}

/// What a probe has seen.
#[derive(Clone, Debug, Default)]
pub(super) struct Probe {
    ticks: u32,
    /// Where the boxes are measured from, metres.
    origin: [f64; 3],
    bodies: Vec<Watched>,
    /// Bodies that escaped from their fat boxes, and those that could have.
    escapes: u64,
    watched: u64,
    /// Overlaps, and bodies.
    hits: u64,
    all: u64,
    /// Ticks in which all bodies were seen.
    seen: u32,
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
            hold: Hold::EMPTY,
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
        for Watched { slot, gait, hold } in &mut self.bodies {
            if !tick.members.is_bounded(*slot) {
                continue;
            }
            let aabb = tick.proxies.aabb(*slot);
            let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
            let mut now = Down::EMPTY;
            let stays = Portable.take(corners, &self.origin, hold, &mut now);
            if !stays {
                *hold = gait.renew(&now, self.ticks, HORIZON, hold);
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
            .filter_map(|one| one.gait.span(&one.hold));
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

    /// Notes where each body is: most of those that are watched are at rest.
    fn see_all<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        if self.held.is_empty() {
            room(&mut self.held, self.rank_of.len());
            self.held.resize(self.rank_of.len(), UNSEEN);
        }
        let level = self.level;
        level.run(See {
            held: &mut self.held,
            origin: self.afresh.probe.origin,
            bodies: tick.members.bounded(),
            proxies: tick.proxies,
        });
    }

    /// Where a body was seen says nothing of who takes its slot.
    pub(super) fn forget_seen(&mut self, slot: BodySlot) {
        if let Some(held) = self.held.get_mut(slot.index()) {
            *held = UNSEEN;
        }
    }

    /// What was seen is out of date.
    fn forget_all_seen(&mut self) {
        if std::mem::take(&mut self.afresh.probe.seen) > 0 {
            self.held.clear();
            if is_thrifty(self.len) {
                shed(&mut self.held);
            }
        }
    }

    /// Holds to begin with: where bodies were seen for long enough, these places; else none.
    pub(super) fn hold_seen(&mut self) {
        let probe = &mut self.afresh.probe;
        let ticks = std::mem::take(&mut probe.seen);
        match probe.span().filter(|_| ticks >= SEEN_LEAST) {
            Some(span) => {
                #[allow(clippy::cast_possible_truncation, reason = "a guess")]
                let by = std::array::from_fn(|k| (probe.origin[k] - self.origin[k]) as f32);
                for hold in &mut self.held {
                    *hold = hold_of_seen(hold, by, span);
                }
            }
            None => self.held.clear(),
        }
        room(&mut self.held, self.rank_of.len());
        self.held.resize(self.rank_of.len(), Hold::EMPTY);
    }
}

/// Nothing was seen.
const UNSEEN: Hold = Hold {
    fat: Down {
        faces: [f32::INFINITY; 8],
    },
    core: Down {
        faces: [f32::NEG_INFINITY; 8],
    },
};

/// Takes the least and the greatest face of each body, as a hold has them.
struct See<'a, P> {
    held: &'a mut [Hold],
    origin: [f64; 3],
    bodies: &'a [BodySlot],
    proxies: &'a P,
}

impl<P: Proxies> Work for See<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for slot in self.bodies {
            let Some(Hold { fat, core }) = self.held.get_mut(slot.index()) else {
                continue;
            };
            let now = outward(lanes, self.proxies.aabb(*slot), &self.origin);
            for k in 0..8 {
                let face = now.faces[k];
                let (least, most) = (fat.faces[k], core.faces[k]);
                fat.faces[k] = if face < least { face } else { least };
                core.faces[k] = if face > most { face } else { most };
            }
        }
    }
}
