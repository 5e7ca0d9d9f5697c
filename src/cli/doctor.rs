//! `sweepd doctor`: diagnoses why sweepd does not work. In: the machine, the files of this user, the running daemons.
//! Out: one line per finding: ok, warning or wrong; what was found; the remedy.

mod files;
mod instance;
mod limits;
mod memory;
#[cfg(feature = "ros2")]
mod ros;
mod sources;

use serde_json::json;

use crate::error::Result;
use crate::transport::iceoryx::{InstanceInfo, Place, list_instances, locks};

use super::args_tools::DoctorArgs;
use super::figures::bytes;
use super::out::Out;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    /// No problem.
    Ok,
    /// A possible future problem, or one of a feature that not everybody uses.
    Warning,
    /// A problem that breaks something.
    Wrong,
}

impl Level {
    fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Wrong => "wrong",
        }
    }
}

/// One finding, printed as one line.
#[derive(Clone, Debug)]
struct Finding {
    level: Level,
    /// Name of the check.
    check: &'static str,
    /// What was found.
    what: String,
    /// The remedy; empty: none.
    mend: String,
}

impl Finding {
    fn ok(check: &'static str, what: impl Into<String>) -> Self {
        Self {
            level: Level::Ok,
            check,
            what: what.into(),
            mend: String::new(),
        }
    }

    fn warning(check: &'static str, what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self {
            level: Level::Warning,
            mend: mend.into(),
            ..Self::ok(check, what)
        }
    }

    fn wrong(check: &'static str, what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self {
            level: Level::Wrong,
            ..Self::warning(check, what, mend)
        }
    }

    fn text(&self) -> String {
        let mend = if self.mend.is_empty() {
            String::new()
        } else {
            format!("; {}", self.mend)
        };
        format!(
            "{:<8} {:<14} {}{mend}",
            self.level.word(),
            self.check,
            self.what
        )
    }

    fn json(&self) -> String {
        let mend = (!self.mend.is_empty()).then_some(&self.mend);
        json!({ "level": self.level.word(), "check": self.check, "what": self.what, "do": mend })
            .to_string()
    }
}

/// Runs all checks; `false` if something is wrong.
pub(super) fn doctor(args: &DoctorArgs, out: &mut Out) -> Result<bool> {
    let name = args.instance.as_deref();
    let place = Place::new(name.unwrap_or("default"))?.looking_only();
    let mut nothing_wrong = true;
    let mut tell = |findings: Vec<Finding>| {
        for finding in findings {
            nothing_wrong &= finding.level != Level::Wrong;
            out.line(&if args.json {
                finding.json()
            } else {
                finding.text()
            })?;
        }
        // Flushed after each check, since the check of an instance that does not answer takes seconds.
        out.flush()
    };
    tell(memory::look())?;
    tell(limits::look())?;
    // Without free file descriptors existing files would seem missing, so the other checks are skipped.
    if let Some(blind) = limits::blind() {
        tell(vec![blind])?;
        return Ok(false);
    }
    tell(files::look(&place, name, args.clean))?;
    for instance in instances(&place, name) {
        tell(instance::look(&place, &instance))?;
    }
    #[cfg(feature = "ros2")]
    tell(ros::look())?;
    Ok(nothing_wrong)
}

/// The instances to check: the given one, or all with a lock holder or with clients; if there are none, that of
/// `place`.
fn instances(place: &Place, name: Option<&str>) -> Vec<InstanceInfo> {
    // Errors are ignored here: the checks of files have reported them.
    let mut all = list_instances(place).unwrap_or_default();
    for lock in locks(place).unwrap_or_default() {
        if let Some(holder) = lock.holder
            && !all.iter().any(|info| info.instance == lock.instance)
        {
            all.push(InstanceInfo {
                instance: lock.instance,
                pid: Some(holder.pid),
                ..InstanceInfo::default()
            });
        }
    }
    all.retain(|info| match name {
        Some(name) => info.instance == name,
        None => info.pid.is_some() || info.sources + info.readers > 0,
    });
    if all.is_empty() {
        all.push(InstanceInfo {
            instance: place.instance().to_owned(),
            ..InstanceInfo::default()
        });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_one_line_that_begins_with_how_bad_it_is() {
        let finding = Finding::wrong("limits", "too few files", "raise them");
        assert_eq!(
            finding.text(),
            "wrong    limits         too few files; raise them"
        );
        let json: serde_json::Value = serde_json::from_str(&finding.json()).unwrap();
        assert_eq!(json["do"], "raise them");
        let fine: serde_json::Value =
            serde_json::from_str(&Finding::ok("limits", "enough").json()).unwrap();
        assert_eq!((&fine["level"], fine["do"].is_null()), (&"ok".into(), true));
    }
}
