//! What makes a tick, by the mode of the configuration.

use crate::config::{Config, Mode};
use crate::error::{Error, Result};

/// What makes a tick.
#[derive(Clone, Copy, Debug)]
pub(super) enum Beat {
    /// Each frame of this source.
    OnFrame(usize),
    /// A round, which began with a frame received then.
    OnAll { since_ns: Option<u64>, late_ns: u64 },
    /// Every so often.
    Rate {
        period_ns: u64,
        next_ns: Option<u64>,
    },
}

impl Beat {
    /// What a mode makes it, for a scene with these sources.
    pub(super) fn of(config: &Config, sources: &[&str]) -> Result<Self> {
        Ok(match &config.mode {
            Mode::OnFrame(name) => {
                let place = sources.iter().position(|own| own == name);
                Self::OnFrame(place.ok_or_else(|| no_such_source(name, sources))?)
            }
            Mode::OnAll => Self::OnAll {
                since_ns: None,
                late_ns: config.late_ns,
            },
            Mode::Rate(hz) => Self::Rate {
                period_ns: period_ns(*hz)?,
                next_ns: None,
            },
        })
    }
}

fn no_such_source(name: &str, sources: &[&str]) -> Error {
    let names = if sources.is_empty() {
        "none".to_owned()
    } else {
        sources.join(", ")
    };
    Error::Usage(format!(
        "mode `on_frame`: the scene has no source `{name}`; it has {names}"
    ))
}

fn period_ns(hz: f64) -> Result<u64> {
    let period_ns = 1e9 / hz;
    if !(hz.is_finite() && hz > 0.0 && period_ns < 1e18) {
        return Err(Error::Usage(format!(
            "mode `rate`: {hz} ticks a second cannot be: give a positive number of hertz"
        )));
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 1e18, checked above"
    )]
    let period_ns = period_ns as u64;
    Ok(period_ns.max(1))
}
