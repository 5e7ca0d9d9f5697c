//! Settings that an operator changed while the daemon runs, applied between two ticks.

use crate::record::{Between, Origin};
use crate::tick::EditBatch;
use crate::transport::Setting;
use crate::world::Edit;

use super::Daemon;

/// Token of edits without a client; doors ignore answers to unknown tokens.
const NOBODY: u64 = u64::MAX;

impl Daemon<'_> {
    /// Applies settings changed since the last round.
    pub(super) fn apply_settings(&mut self) {
        let mut all = Vec::new();
        self.door.settings(&mut |setting| all.push(setting));
        for setting in all {
            if let Some(between) = Between::of(&setting) {
                self.note(between);
            }
            self.apply(setting);
        }
    }

    fn apply(&mut self, setting: Setting) {
        match setting {
            Setting::BudgetTime(time_ns) => self.config.budget.time_ns = time_ns,
            Setting::BudgetUnits(units) => self.config.budget.units = units,
            Setting::Mode(mode) => {
                let old = std::mem::replace(&mut self.config.mode, mode);
                if let Err(error) = self.pacer.set_mode(&self.config) {
                    tracing::warn!("{error}");
                    self.config.mode = old;
                }
            }
            Setting::Timeout { source, timeout_ns } => {
                self.pacer.set_timeout(source, timeout_ns);
                self.engine.set_timeout(source, timeout_ns);
            }
            Setting::TickNow => self.tick_asked = true,
            Setting::Margin(report_within_m) => {
                let edit = Edit::Margin {
                    name: None,
                    report_within_m,
                };
                self.edit(own(edit), Origin::Margin(report_within_m));
            }
            Setting::Reset => self.edit(own(Edit::Reset { source: None }), Origin::Reset),
        }
    }
}

/// A batch with one edit of the daemon's own.
fn own(edit: Edit) -> EditBatch {
    EditBatch {
        token: NOBODY,
        validate: false,
        edits: vec![edit],
        warnings: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::super::{Daemon, build_shapes};
    use crate::config::Mode;
    use crate::error::Result;
    use crate::scene::Scene;
    use crate::time::{Clock, ManualClock};
    use crate::transport::{Door, RequestToken, Setting, Wake};
    use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickCause, TickRow, Undelivered};

    const SCENE: &str = "[run]\nmode = \"on_all\"\n[[source]]\nname = \"sim\"\ntimeout_ms = 500\n\
        [[body]]\nname = \"a\"\nshape = { type = \"sphere\", radius = 1.0 }\n";

    /// A door through which only settings come; it keeps the ticks.
    #[derive(Default)]
    struct Panel {
        settings: Vec<Setting>,
        ticks: Vec<TickRow>,
        /// Plans that were published.
        plans: Vec<String>,
    }

    impl Door for Panel {
        fn wait(&mut self, _: u64, _: &dyn Clock) -> Result<Wake> {
            Ok(Wake::default())
        }
        fn receive(&mut self, _: &mut Inbox, _: &dyn Clock) {}
        fn demand(&mut self) -> Demand {
            Demand::default()
        }
        fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
            self.ticks.push(outbox.tick);
            if outbox.plan_changed {
                self.plans.push(outbox.plan.clone());
            }
            Ok(Undelivered::default())
        }
        fn publish_tick(&mut self, _: &TickRow) -> Result<()> {
            Ok(())
        }
        fn requests(&mut self, _: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {}
        fn answer(&mut self, _: RequestToken, _: bool, _: &str) -> Result<()> {
            Ok(())
        }
        fn settings(&mut self, take: &mut dyn FnMut(Setting)) {
            self.settings.drain(..).for_each(take);
        }
        fn housekeeping(&mut self) {}
    }

    /// Applies settings, then runs rounds over 100 ms; returns the resulting ticks.
    fn after(settings: Vec<Setting>) -> Vec<TickRow> {
        played(settings, SCENE).ticks
    }

    fn played(settings: Vec<Setting>, scene: &str) -> Panel {
        let scene = Scene::parse(scene, "s.toml", Path::new("")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let clock = Arc::new(ManualClock::new(1_000_000_000));
        let mut panel = Panel {
            settings,
            ..Panel::default()
        };
        let shared: Arc<dyn Clock> = Arc::clone(&clock) as _;
        let mut daemon = Daemon::new(&scene, shapes, 7, shared, &mut panel).unwrap();
        for _ in 0..100 {
            daemon.round(None).unwrap();
            clock.advance(1_000_000);
        }
        drop(daemon);
        panel
    }

    fn causes(ticks: &[TickRow], cause: TickCause) -> usize {
        ticks.iter().filter(|t| t.cause == cause.code()).count()
    }

    #[test]
    fn budgets_are_those_of_the_next_tick() {
        let ticks = after(vec![
            Setting::BudgetTime(Some(3_000_000)),
            Setting::BudgetUnits(Some(9)),
            Setting::TickNow,
        ]);
        assert_eq!((ticks[0].budget_ns, ticks[0].budget_units), (3_000_000, 9));
        let ticks = after(vec![Setting::BudgetTime(None), Setting::TickNow]);
        assert_eq!(
            (ticks[0].budget_ns, ticks[0].budget_units),
            (u64::MAX, u64::MAX)
        );
    }

    #[test]
    fn bug_the_plan_went_on_telling_the_order_of_work_of_the_budget_before() {
        let limited = SCENE.replace("[run]", "[run]\nbudget_ms = 3.0");
        let on_frame = limited.replace("mode = \"on_all\"", "on_frame = \"sim\"");
        let order = |plan: &str| plan.contains("oldest undecided first");
        for (scene, set, told) in [
            (SCENE, Some(3_000_000), true),
            (&limited, None, false),
            (&limited, Some(1_000_000), true),
            // Ticks that only judge ages do not show what the frames' ticks may take.
            (&on_frame, None, true),
        ] {
            let panel = played(vec![Setting::BudgetTime(set), Setting::TickNow], scene);
            let plan = panel.plans.last().unwrap();
            assert_eq!(order(plan), told, "{plan}");
        }
    }

    #[test]
    fn a_tick_at_once_is_one_tick_and_of_its_own_cause() {
        let quiet = after(Vec::new());
        let asked = after(vec![Setting::TickNow]);
        assert_eq!(causes(&quiet, TickCause::Edit), 0);
        assert_eq!(causes(&asked, TickCause::Edit), 1);
    }

    #[test]
    fn a_mode_is_followed_and_one_that_cannot_be_changes_nothing() {
        let fast = after(vec![Setting::Mode(Mode::Rate(100.0))]);
        assert!(fast.len() >= 9, "{} ticks in 100 ms at 100 Hz", fast.len());
        let before = after(Vec::new()).len();
        let nobody = Setting::Mode(Mode::OnFrame("nobody".to_owned()));
        assert_eq!(after(vec![nobody]).len(), before);
    }

    #[test]
    fn a_reset_is_an_edit_that_nobody_waits_for() {
        let ticks = after(vec![Setting::Reset]);
        assert_eq!(causes(&ticks, TickCause::Edit), 1);
        assert!(ticks[0].header.scene_rev >= 1);
    }
}
