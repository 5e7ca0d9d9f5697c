//! Which values parameters take, and what to write instead. Pure.

use super::super::params_file::Value;
use super::super::told::brief;
use crate::config::Mode;

/// Which values a parameter takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Rule {
    /// A number from .. to; -1 stands for what `none` says.
    Real {
        min: f64,
        max: f64,
        none: Option<&'static str>,
    },
    /// A whole number from .. to; -1 stands for what `none` says.
    Whole {
        max: i64,
        none: Option<&'static str>,
    },
    /// true or false.
    Flag,
    /// One of these words.
    Word(&'static [&'static str]),
    /// `on_all`, `on_frame=SOURCE`, `rate=HZ`.
    Mode,
}

impl Rule {
    /// The value as it is meant: a whole number stands for a number.
    #[allow(
        clippy::cast_precision_loss,
        reason = "a whole number for the nearest number"
    )]
    pub(super) fn read(&self, value: &Value) -> Value {
        match (self, value) {
            (Self::Real { .. }, Value::Whole(whole)) => Value::Real(*whole as f64),
            (_, value) => value.clone(),
        }
    }

    /// Whether the parameter of this name takes the value.
    ///
    /// * `sources` - by name, and whether one can lead in lockstep.
    pub(super) fn fits(
        &self,
        name: &str,
        value: &Value,
        sources: &[(String, bool)],
    ) -> Result<(), String> {
        match (self, value) {
            (Self::Real { min, max, none }, Value::Real(real)) => {
                if (*min..=*max).contains(real) || (none.is_some() && same(*real, -1.0)) {
                    return Ok(());
                }
                let or_none = none.map_or(String::new(), |what| format!(", or -1 for {what}"));
                Err(format!(
                    "{name} is {real}: write a number from {min} to {max}{or_none}"
                ))
            }
            (Self::Whole { max, none }, Value::Whole(whole)) => {
                if (0..=*max).contains(whole) || (none.is_some() && *whole == -1) {
                    return Ok(());
                }
                let or_none = none.map_or(String::new(), |what| format!(", or -1 for {what}"));
                Err(format!(
                    "{name} is {whole}: write a whole number from 0 to {max}{or_none}"
                ))
            }
            (Self::Flag, Value::Flag(_)) => Ok(()),
            (Self::Word(words), Value::Text(text)) => {
                if words.contains(&text.as_str()) {
                    return Ok(());
                }
                let text = brief(text);
                Err(format!("{name} is `{text}`: write {}", words.join(" or ")))
            }
            (Self::Mode, Value::Text(text)) => match Mode::parse(text)? {
                Mode::OnFrame(source) => match sources.iter().find(|(own, _)| *own == source) {
                    Some((_, true)) => Ok(()),
                    Some(_) => Err(format!(
                        "source {source} sends poses body by body on ROS 2 topics, and cannot lead: write on_all or rate=HZ"
                    )),
                    None => {
                        let source = brief(&source);
                        Err(format!("{name}: the scene has no source `{source}`"))
                    }
                },
                _ => Ok(()),
            },
            (rule, _) => Err(format!("{name} takes {}", rule.words())),
        }
    }

    fn words(&self) -> &'static str {
        match self {
            Self::Real { .. } => "a number (double)",
            Self::Whole { .. } => "a whole number (integer)",
            Self::Flag => "true or false",
            Self::Word(_) | Self::Mode => "a text",
        }
    }
}

#[allow(clippy::float_cmp, reason = "-1 is written, not computed")]
fn same(a: f64, b: f64) -> bool {
    a == b
}

/// Milliseconds of nanoseconds.
pub(super) fn milliseconds(ns: u64) -> f64 {
    std::time::Duration::from_nanos(ns).as_secs_f64() * 1e3
}

/// Nanoseconds of milliseconds; `None` where they are negative.
pub(super) fn some_ns(ms: f64) -> Option<u64> {
    let time = std::time::Duration::try_from_secs_f64(ms / 1e3).ok()?;
    u64::try_from(time.as_nanos()).ok()
}

/// Rows of a number that was checked.
pub(super) fn count(rows: i64) -> usize {
    usize::try_from(rows).unwrap_or(0)
}
