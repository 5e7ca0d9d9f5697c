//! What an operator set while the daemon runs, applied between two ticks.

use crate::tick::EditBatch;
use crate::transport::Setting;
use crate::world::Edit;

use super::Daemon;

/// Token of edits that nobody waits for; doors forget answers to tokens they do not know.
const NOBODY: u64 = u64::MAX;

impl Daemon<'_> {
    /// Takes what was set since the last round.
    pub(super) fn apply_settings(&mut self) {
        let mut all = Vec::new();
        self.door.settings(&mut |setting| all.push(setting));
        for setting in all {
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
            Setting::Reset => self.ready.push(EditBatch {
                token: NOBODY,
                validate: false,
                edits: vec![Edit::Reset { source: None }],
                warnings: Vec::new(),
            }),
        }
    }
}
