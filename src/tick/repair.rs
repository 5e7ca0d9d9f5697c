//! Checking every structure, and building anew what does not hold.

use super::Engine;
use crate::narrow::Narrow;
use crate::pairs::PairSet;
use crate::plan::Kinds;

impl Engine {
    /// Full structure check of every room that keeps state.
    ///
    /// # Errors
    /// The first thing that does not hold, in words.
    pub fn validate(&self) -> Result<(), String> {
        self.check(self.tick)
    }

    /// * `last` - the tick that all of it was left by.
    fn check(&self, last: u64) -> Result<(), String> {
        self.world.validate()?;
        self.kinds.validate(&self.world)?;
        self.broad
            .validate(&self.world, self.world.filters(), &self.pairs)?;
        self.narrow.validate(&self.pairs)?;
        let of = (&self.world, &self.pairs, &self.narrow);
        self.publisher.validate(last, of, &self.out)
    }

    /// Checks what the last tick left; if it does not hold, this tick builds all that is made from the world anew: the
    /// broad phase, the pair set, and the narrow phase's memory. Events go on by body ids; pairs that the broken
    /// structure may have missed carry the ticks since the last check in their ranges.
    ///
    /// Not one room alone: the others were made from what does not hold.
    ///
    /// * returns - what did not hold, for the asker.
    pub(super) fn repair(&mut self) -> Option<String> {
        if let Err(why) = self.world.validate() {
            tracing::error!("the world does not hold: {why}; restart the daemon");
            return Some(format!(
                "the world, from which all else is made, does not hold ({why}): restart the daemon"
            ));
        }
        // This one has begun, and done nothing yet.
        let Err(why) = self.check(self.tick - 1) else {
            self.checked = self.tick - 1;
            return None;
        };
        tracing::error!("a structure does not hold and is built anew: {why}");
        self.rebuilds += 1;
        self.renew = true;
        self.carried = self.pairs.iter().map(|(_, key)| key).collect();
        let limits = self.config.limits;
        // Whose pairs were not all there is not found by boxes, where its place is not known.
        let mut pairs = PairSet::new(limits.pairs);
        pairs.go_on_missing(self.pairs.missing(), self.pairs.truncated());
        self.pairs = pairs;
        self.narrow = Narrow::renewed(
            limits.contacts_per_pair,
            &self.world,
            (self.checked + 1).min(self.tick),
            self.tick,
        );
        self.narrow
            .set_search(self.config.mesh_search.unwrap_or_default());
        self.kinds = Kinds::of(&self.world);
        self.publisher.forget_slots(self.tick - 1, &self.world);
        Some(format!(
            "a structure did not hold and was built anew: {why}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::broad::{BroadPhase, Method};
    use crate::daemon::build_shapes;
    use crate::ids::BodySlot;
    use crate::scene::Scene;
    use crate::tick::{EditBatch, TickInput};
    use crate::time::{Budget, Clock, ManualClock};
    use crate::wire::{
        Demand, EndCause, Event, FrameHeader, Inbox, TickCause, TransformRow, Verdict,
        WIRE_VERSION, frame_flags, name_bytes,
    };

    use crate::world::Edit;

    /// A row of balls of radius 0.5 along x.
    struct Rig {
        engine: Engine,
        clock: Arc<ManualClock>,
        x_m: [f64; 4],
        seq: u64,
        edits: Vec<Edit>,
    }

    impl Rig {
        fn new() -> Self {
            let mut text = String::from("[[source]]\nname = \"feed\"\n");
            for ball in 0..4 {
                text += &format!(
                    "[[body]]\nname = \"b{ball}\"\nid = {}\nshape = {{ type = \"sphere\", radius = 0.5 }}\n",
                    ball + 1
                );
            }
            let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
            let shapes = build_shapes(&scene).unwrap();
            let clock = Arc::new(ManualClock::new(1_000_000_000));
            let engine = Engine::new(
                &scene,
                shapes.bodies,
                7,
                Arc::clone(&clock) as Arc<dyn Clock>,
            );
            Self {
                engine: engine.unwrap(),
                clock,
                x_m: [0.0, 0.9, 5.0, 9.0],
                seq: 0,
                edits: Vec::new(),
            }
        }

        /// One tick with a frame; returns the pairs with events: ids, events, first tick of the begin.
        fn tick(&mut self, validate: bool) -> Vec<(u64, u64, u8, u64)> {
            self.seq += 1;
            self.clock.advance(10_000_000);
            let mut inbox = Inbox::default();
            let frame = inbox.push();
            frame.header = FrameHeader {
                session: 1,
                seq: self.seq,
                source: name_bytes("feed"),
                flags: frame_flags::FULL,
                schema: WIRE_VERSION,
                ..FrameHeader::default()
            };
            frame.received_ns = self.clock.boottime_ns();
            let row = |(at, x): (usize, &f64)| TransformRow {
                body: at as u64 + 1,
                position: [*x, 0.0, 0.0],
                orientation: [0.0, 0.0, 0.0, 1.0],
                ..TransformRow::default()
            };
            let rows: Vec<_> = self.x_m.iter().enumerate().map(row).collect();
            frame.set_transforms(&rows);
            let batch = EditBatch {
                token: 1,
                edits: std::mem::take(&mut self.edits),
                validate,
                warnings: Vec::new(),
            };
            let edits = if validate { vec![batch] } else { Vec::new() };
            let out = self.engine.tick(TickInput {
                inbox: &inbox,
                edits: &edits,
                demand: Demand::ALL,
                budget: Budget::default(),
                cause: TickCause::Frame,
                cause_source: Some(0),
                woke_ns: self.clock.monotonic_ns(),
                pulse: None,
            });
            let told = out
                .pairs
                .iter()
                .filter(|row| row.events & !Event::Persist.bit() != 0);
            told.map(|row| (row.body_a, row.body_b, row.events, row.begin_first_tick))
                .collect()
        }
    }

    #[test]
    fn a_broken_broad_phase_is_built_anew_and_collisions_go_on_without_an_event() {
        let mut rig = Rig::new();
        assert_eq!(rig.tick(false), [(1, 2, Event::Begin.bit(), 1)]);
        assert!(rig.tick(true).is_empty());
        assert!(rig.engine.outcomes()[0].warnings.is_empty());
        assert!(rig.tick(false).is_empty());
        // As if it had lost every body since the last check.
        rig.engine.broad = BroadPhase::new(rig.engine.method);
        assert!(rig.engine.validate().is_err());
        (rig.x_m[2], rig.x_m[3]) = (1.8, 2.7);
        // What it may have missed is told with every tick since the last good check in its range.
        let begun = Event::Begin.bit();
        assert_eq!(rig.tick(true), [(2, 3, begun, 2), (3, 4, begun, 2)]);
        assert_eq!(rig.engine.outbox().tick.rebuilds, 1);
        assert!(rig.engine.outcomes()[0].warnings[0].contains("built anew"));
        rig.engine.validate().unwrap();
        assert!(rig.tick(true).is_empty());
        assert_eq!(rig.engine.outbox().tick.rebuilds, 1);
        assert_eq!(rig.engine.outbox().tick.colliding, 3);
    }

    #[test]
    fn a_message_that_lost_its_rows_is_found_and_made_anew_without_an_event() {
        let mut rig = Rig::new();
        rig.tick(false);
        rig.engine.out.pairs.clear();
        assert!(rig.engine.validate().unwrap_err().contains("rows of pairs"));
        assert!(rig.tick(true).is_empty());
        assert_eq!(rig.engine.outbox().tick.rebuilds, 1);
        assert_eq!(rig.engine.outbox().pairs.len(), 1);
        rig.engine.validate().unwrap();
    }

    #[test]
    fn bug_a_repair_forgot_whose_pairs_had_found_no_room() {
        let mut rig = Rig::new();
        rig.engine.config.limits.pairs = 1;
        rig.engine.pairs = PairSet::new(1);
        // The second of three in a row touches both others.
        rig.x_m[2] = 1.8;
        rig.tick(false);
        let cut = |rig: &Rig| [1, 2].map(|slot| rig.engine.pairs.is_truncated(BodySlot(slot)));
        assert_eq!(cut(&rig), [true; 2]);
        // Its place is not known from here on, and no box says whom it touches.
        rig.x_m[2] = f64::NAN;
        rig.tick(false);
        assert_eq!(cut(&rig), [true; 2]);
        rig.engine.broad = BroadPhase::new(rig.engine.method);
        rig.tick(true);
        assert_eq!(rig.engine.outbox().tick.rebuilds, 1);
        assert_eq!(cut(&rig), [true; 2]);
    }

    #[test]
    fn a_collision_that_ended_unseen_ends_with_the_repair() {
        let mut rig = Rig::new();
        rig.tick(false);
        rig.engine.broad = BroadPhase::new(rig.engine.method);
        rig.x_m[1] = 3.0;
        assert_eq!(rig.tick(true), [(1, 2, Event::End.bit(), 0)]);
        let row = rig.engine.outbox().pairs[0];
        assert_eq!((row.end_first_tick, row.end_last_tick), (2, 2));
        assert_eq!(rig.engine.outbox().tick.colliding, 0);
    }

    #[test]
    fn bug_a_repair_while_a_place_was_not_known_told_its_collision_as_separated() {
        let mut rig = Rig::new();
        // Refused in the tick before the repair, or in its own; then it still collides, or does not.
        for (before, x_m) in [(true, 0.9), (false, 3.0)] {
            rig.tick(false);
            rig.x_m[1] = f64::NAN;
            if before {
                assert!(rig.tick(false).is_empty());
            }
            rig.engine.broad = BroadPhase::new(rig.engine.method);
            for _ in 0..3 {
                assert!(rig.tick(true).is_empty());
                let row = rig.engine.outbox().pairs[0];
                assert_eq!((row.body_a, row.body_b), (1, 2));
                assert_eq!(row.verdict, Verdict::Possible.code());
                assert_eq!(row.certified_verdict, Verdict::Colliding.code());
                rig.engine.validate().unwrap();
            }
            rig.x_m[1] = x_m;
            let told = rig.tick(true);
            if before {
                assert!(told.is_empty());
            } else {
                assert_eq!(told, [(1, 2, Event::End.bit(), 0)]);
            }
        }
        assert_eq!(rig.engine.outbox().tick.rebuilds, 2);
        rig.engine.validate().unwrap();
    }

    #[test]
    fn bug_a_pair_that_left_in_the_tick_of_a_repair_ended_as_separated() {
        let name = String::from("b1");
        let edits = [
            (
                Edit::Enable {
                    name: name.clone(),
                    enabled: false,
                },
                EndCause::Disabled,
            ),
            (Edit::Reset { source: None }, EndCause::Reset),
            (
                Edit::Filter {
                    name,
                    group: None,
                    mask: Some(0),
                },
                EndCause::Filtered,
            ),
        ];
        for (edit, cause) in edits {
            let mut rig = Rig::new();
            rig.tick(false);
            rig.engine.broad = BroadPhase::new(rig.engine.method);
            rig.edits.push(edit);
            let told = rig.tick(true);
            assert!(told[0].2 & Event::End.bit() != 0, "{cause}: {told:?}");
            assert_eq!(rig.engine.outbox().pairs[0].end_cause, cause.code());
            rig.engine.validate().unwrap();
        }
    }

    #[test]
    fn bug_a_repair_in_a_tick_of_another_method_was_done_twice() {
        let mut rig = Rig::new();
        rig.tick(false);
        // As if the plan had chosen another method in the tick of the repair.
        rig.engine.method = Method::SweepAndPrune;
        rig.engine.broad = BroadPhase::new(rig.engine.method);
        assert!(rig.tick(true).is_empty());
        assert_eq!(rig.engine.outbox().tick.rebuilds, 1);
        assert!(!rig.engine.renew && rig.engine.method == rig.engine.plan.method());
        rig.engine.validate().unwrap();
    }
}
