//! Checks the histories of all pairs, and the waiting events.

use super::{Events, History};
use crate::ids::{PairKey, PairSlot};
use crate::narrow::Narrow;
use crate::pairs::PairSet;
use crate::wire::Verdict;
use crate::world::World;

impl Events {
    /// Structure check: one waiting entry per pair, by ids, of events up to `tick`; histories of existing pairs only,
    /// which agree with the findings.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub(in crate::publish) fn validate(
        &self,
        tick: u64,
        world: &World,
        pairs: &PairSet,
        narrow: &Narrow,
    ) -> Result<(), String> {
        self.validate_waiting(tick)?;
        for (at, history) in (0..).zip(&self.histories) {
            if history.born == 0 {
                // A pair that was never reported.
                if history.colliding || history.verdict != Verdict::None {
                    return Err(format!("{:?} has no history and a verdict", history.ids));
                }
                continue;
            }
            let slot = PairSlot(at);
            let bodies = world
                .slot_of(history.ids.0)
                .zip(world.slot_of(history.ids.1));
            let (a, b) = (history.ids.0.0, history.ids.1.0);
            let key = bodies.map(|(a, b)| PairKey::new(a, b));
            if pairs.get(slot) != key || key.is_none() {
                return Err(format!(
                    "the history of {a} and {b} is that of another pair"
                ));
            }
            if history.active.max(history.tick).max(history.born) > tick {
                return Err(format!("the history of {a} and {b} is of ticks to come"));
            }
            history.validate(slot, narrow)?;
        }
        if self.adrift.iter().any(|lost| lost.history().born == 0) {
            return Err("a history without a pair is of nothing".into());
        }
        Ok(())
    }

    /// Checks the events that did not fit.
    fn validate_waiting(&self, tick: u64) -> Result<(), String> {
        let waiting = &self.waiting;
        if !waiting.is_sorted_by(|one, next| one.ids < next.ids) {
            return Err("events that wait are not by ids, one a pair".into());
        }
        for event in waiting {
            let (a, b) = (event.ids.0.0, event.ids.1.0);
            let end = event.end.map(|(ticks, _)| ticks);
            let mut ranges = [end, event.begin, event.pass].into_iter().flatten();
            if a >= b || event.seq > self.seq || ranges.clone().next().is_none() {
                return Err(format!("the event of {a} and {b} that waits is none"));
            }
            if ranges.any(|ticks| ticks.first > ticks.last || ticks.last > tick) {
                return Err(format!(
                    "the event of {a} and {b} that waits is of no ticks"
                ));
            }
        }
        Ok(())
    }
}

impl History {
    /// For a pair without changes since, the certified result must equal the finding.
    fn validate(&self, slot: PairSlot, narrow: &Narrow) -> Result<(), String> {
        let Some(finding) = narrow.finding(slot).filter(|_| !narrow.is_stirred(slot)) else {
            return Ok(());
        };
        let (a, b, verdict) = (self.ids.0.0, self.ids.1.0, finding.verdict);
        let colliding = match verdict {
            Verdict::Colliding => Some(true),
            Verdict::Near | Verdict::Apart => Some(false),
            Verdict::Possible | Verdict::None => None,
        };
        if self.open != colliding.is_none() {
            return Err(format!(
                "{a} and {b} are {verdict}, kept as undecided: {}",
                self.open
            ));
        }
        if colliding.is_some_and(|colliding| self.colliding != colliding) {
            return Err(format!(
                "{a} and {b} are {verdict}, certified to collide: {}",
                self.colliding
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publish::validate::tests::Stage;

    /// A fault, and the expected message; `tick` is 1.
    type Fault = (&'static str, fn(&mut Events));

    /// The first history of a pair that was reported.
    fn first(events: &mut Events) -> &mut History {
        events
            .histories
            .iter_mut()
            .find(|history| history.born != 0)
            .unwrap()
    }

    const FAULTS: [Fault; 10] = [
        ("one a pair", |events| {
            events.waiting.push(events.waiting[0])
        }),
        ("not by ids", |events| events.waiting.swap(0, 1)),
        ("that waits is none", |events| {
            events.waiting[0].begin = None
        }),
        ("that waits is none", |events| events.seq = 0),
        ("is of no ticks", |events| {
            let begin = events.waiting[0].begin.as_mut().unwrap();
            begin.last = 2;
        }),
        ("that of another pair", |events| {
            let other = events.histories.iter().rfind(|history| history.born != 0);
            let ids = other.unwrap().ids;
            first(events).ids = ids;
        }),
        ("no history and a verdict", |events| first(events).born = 0),
        ("of ticks to come", |events| first(events).tick = 2),
        ("certified to collide: false", |events| {
            first(events).colliding = false
        }),
        ("kept as undecided: true", |events| {
            first(events).open = true
        }),
    ];

    #[test]
    fn what_is_broken_in_the_events_is_found() {
        for (told, fault) in FAULTS {
            // Most begins do not fit.
            let mut stage = Stage::new(2);
            let (events, world) = (&mut stage.publisher.events, &stage.world);
            assert!(events.waiting.len() > 2);
            events
                .validate(1, world, &stage.pairs, &stage.narrow)
                .unwrap();
            fault(events);
            let why = events
                .validate(1, world, &stage.pairs, &stage.narrow)
                .unwrap_err();
            assert!(why.contains(told), "{why}, not {told}");
        }
    }
}
