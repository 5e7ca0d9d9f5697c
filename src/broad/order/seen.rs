//! Where bodies at rest were observed before candidates are tried again.
//!
//! In: their boxes, in each tick of a probe whose bodies are at rest. Out: holds around these places, as initial holds;
//! otherwise each body would have to learn its own, most in the very next tick. The observations are stored in `held`,
//! which is unused while there are no candidates: the least of each face as the fat box, the greatest as the core.

use super::fatten::{hold_of_seen, outward};
use super::idle::{is_thrifty, shed};
use super::links::room;
use super::{BodySlot, Order, Proxies, Tick};
use crate::simd::boxes::{Down, Held, Hold, Kernel, Lanes};

/// Least number of ticks observed for the result to be used.
const LEAST: u32 = 8;

impl Order {
    /// Observes each body in this tick: most bodies of the probe are at rest.
    pub(super) fn see_all<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
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

    /// Clears the observations of a slot: another body will use it.
    pub(super) fn forget_seen(&mut self, slot: BodySlot) {
        if let Some(held) = self.held.get_mut(slot.index()) {
            *held = UNSEEN;
        }
    }

    /// Drops outdated observations.
    pub(super) fn forget_all_seen(&mut self) {
        if std::mem::take(&mut self.afresh.probe.seen) > 0 {
            self.held.clear();
            if is_thrifty(self.len) {
                shed(&mut self.held);
            }
        }
    }

    /// Initial holds: the observed places, if observed for long enough; otherwise none.
    pub(super) fn hold_seen(&mut self) {
        let probe = &mut self.afresh.probe;
        let ticks = std::mem::take(&mut probe.seen);
        match probe.span().filter(|_| ticks >= LEAST) {
            Some(span) => {
                #[allow(clippy::cast_possible_truncation, reason = "a guess")]
                let by = std::array::from_fn(|k| (probe.origin[k] - self.origin[k]) as f32);
                for held in &mut self.held {
                    *held = Held::of(&hold_of_seen(&held.hold(), by, span));
                }
            }
            None => self.held.clear(),
        }
        room(&mut self.held, self.rank_of.len());
        self.held.resize(self.rank_of.len(), Held::EMPTY);
    }
}

/// Nothing observed.
const UNSEEN: Held = Held::of(&Hold {
    fat: Down {
        faces: [f32::INFINITY; 8],
    },
    core: Down {
        faces: [f32::NEG_INFINITY; 8],
    },
});

/// Takes the least and the greatest position of each face, in the form of a hold.
struct See<'a, P> {
    held: &'a mut [Held],
    origin: [f64; 3],
    bodies: &'a [BodySlot],
    proxies: &'a P,
}

impl<P: Proxies> Kernel for See<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for slot in self.bodies {
            let Some(held) = self.held.get_mut(slot.index()) else {
                continue;
            };
            let Hold { mut fat, mut core } = held.hold();
            let now = outward(lanes, self.proxies.aabb(*slot), &self.origin);
            for k in 0..8 {
                let face = now.faces[k];
                let (least, most) = (fat.faces[k], core.faces[k]);
                fat.faces[k] = if face < least { face } else { least };
                core.faces[k] = if face > most { face } else { most };
            }
            *held = Held::of(&Hold { fat, core });
        }
    }
}
