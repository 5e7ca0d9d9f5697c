//! The node's parameters: what they are, which values they take, what they do. In: a scene, settings of the command
//! line and of files, sets of anybody. Out: values, or why not; changes for the tick thread and the node's own.
//!
//! What touches safety (budget, mode, time-outs, skew, margins) is changed while running only with `ros.allow_edits`,
//! which is said at the start.

mod rules;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use ros2_client::ParameterValue;

use rules::{Rule, count, milliseconds, plain, some_ns};

use super::RosScene;
use super::params_file::{Setting as Said, Value};
use super::services::open;
use crate::config::{Config, Mode};
use crate::limits;
use crate::transport::Setting;

/// What -1 stands for.
const NO_LIMIT: &str = "no limit";
/// Longest time a parameter can name, milliseconds: a day.
const TIME_MS_MAX: f64 = 86_400_000.0;
/// Most rows a tick may have on a topic: 20 MB of contacts.
const ROWS_MAX: i64 = 100_000;

/// When a parameter may be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    /// At any time.
    Always,
    /// While running only with `ros.allow_edits`.
    IfAllowed,
    /// At the start.
    AtStart,
}

/// A parameter.
#[derive(Clone, Debug)]
pub(super) struct Spec {
    pub(super) name: String,
    pub(super) value: Value,
    rule: Rule,
    when: When,
}

impl Spec {
    fn new(name: &str, value: Value, rule: Rule, when: When) -> Self {
        Self {
            name: name.to_owned(),
            value,
            rule,
            when,
        }
    }
}

/// What touches the daemon's promises.
fn of_daemon(config: &Config) -> Vec<Spec> {
    let time_ms = || Rule::Real {
        min: 0.0,
        max: TIME_MS_MAX,
        none: Some(NO_LIMIT),
    };
    let units = Rule::Whole {
        max: i64::MAX,
        none: Some(NO_LIMIT),
    };
    let metres = Rule::Real {
        min: 0.0,
        max: limits::EXTENT_MAX_M,
        none: Some("what each body was put with"),
    };
    let budget = config.budget;
    let given = budget.units.and_then(|units| i64::try_from(units).ok());
    let given = Value::Whole(given.unwrap_or(-1));
    let budget_ms = Value::Real(budget.time_ns.map_or(-1.0, milliseconds));
    let mode = Value::Text(config.mode.to_string());
    let spec = |name, value, rule| Spec::new(name, value, rule, When::IfAllowed);
    vec![
        spec("budget_ms", budget_ms, time_ms()),
        spec("budget_units", given, units),
        spec("mode", mode, Rule::Mode),
        spec("max_skew_ms", Value::Real(-1.0), time_ms()),
        spec("report_within_m", Value::Real(-1.0), metres),
    ]
}

/// What is the node's own.
fn of_node() -> Vec<Spec> {
    let rows = || Rule::Whole {
        max: ROWS_MAX,
        none: None,
    };
    let rate = Rule::Real {
        min: 0.1,
        max: 100.0,
        none: None,
    };
    let words = &["reliable", "best_effort"];
    let reliable = Value::Text(words[0].to_owned());
    let (always, at_start) = (When::Always, When::AtStart);
    let flag = |name, on, when| Spec::new(name, Value::Flag(on), Rule::Flag, when);
    vec![
        Spec::new("ros_max_pairs", Value::Whole(1000), rows(), always),
        Spec::new("ros_max_contacts", Value::Whole(500), rows(), always),
        Spec::new("markers_rate_hz", Value::Real(10.0), rate, always),
        Spec::new("out_reliability", reliable, Rule::Word(words), always),
        flag("publish_markers", true, always),
        flag("publish_collisions", false, always),
        flag("ros.allow_edits", false, at_start),
        flag("use_sim_time", false, always),
    ]
}

/// What the node itself does with a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// Rows of `~/pairs`.
    MaxPairs(usize),
    /// Rows of `~/contacts`.
    MaxContacts(usize),
    /// Widest skew of a chain, nanoseconds; `None`: as the scene says.
    MaxSkew(Option<u64>),
    /// Whether markers are published.
    Markers(bool),
    /// Time between two messages of markers, nanoseconds.
    MarkersPeriod(u64),
    /// Whether `~/collisions` is published.
    Collisions(bool),
    /// Whether lost messages of `~/pairs`, `~/contacts` and `~/collisions` are sent again.
    Reliable(bool),
}

/// What setting a parameter does.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Effect {
    /// For the tick thread.
    Tick(Setting),
    /// For the node.
    Own(Own),
    /// For the tick thread and the node: the time-out of a source, by its place.
    Timeout(usize, u64),
    /// Nothing: it is read at the start.
    None,
}

/// What was set while a node ran, by name: a node that is opened in its place begins with it.
#[derive(Clone, Debug, Default)]
pub struct Kept(Arc<Mutex<BTreeMap<String, Value>>>);

impl Kept {
    /// Takes a value.
    pub(super) fn keep(&self, name: &str, value: Value) {
        open(&self.0).insert(name.to_owned(), value);
    }

    fn value(&self, name: &str) -> Option<Value> {
        open(&self.0).get(name).cloned()
    }
}

/// All parameters of a node.
#[derive(Debug)]
pub(super) struct Table {
    specs: Vec<Spec>,
    /// Sources by name, and whether one can lead in lockstep.
    sources: Vec<(String, bool)>,
    running: AtomicBool,
    kept: Kept,
}

impl Table {
    /// The parameters of a scene at the values it has.
    pub(super) fn of(scene: &RosScene) -> Self {
        let mut specs = of_daemon(&scene.config);
        specs.extend(of_node());
        for source in &scene.sources {
            let rule = Rule::Real {
                min: 1.0,
                max: TIME_MS_MAX,
                none: None,
            };
            let value = Value::Real(milliseconds(source.timeout_ns));
            let name = format!("timeout_ms.{}", source.name);
            specs.push(Spec::new(&name, value, rule, When::IfAllowed));
        }
        let sources = scene.sources.iter();
        Self {
            specs,
            sources: sources
                .map(|s| (s.name.clone(), s.ros2.is_none()))
                .collect(),
            running: AtomicBool::new(false),
            kept: scene.kept.clone(),
        }
    }

    /// Takes what was said at the start, in order; the last wins. What was set while another node ran in this daemon
    /// came later still, and wins over that.
    ///
    /// * returns - what was said of parameters that the node does not have.
    ///
    /// # Errors
    /// One text, when a value is none that the parameter takes.
    pub(super) fn start(&mut self, said: &[Said], node: &str) -> Result<Vec<String>, String> {
        let mut unknown = Vec::new();
        for setting in said.iter().filter(|setting| setting.is_for(node)) {
            let Some(place) = self.specs.iter().position(|spec| spec.name == setting.name) else {
                unknown.push(format!(
                    "{}: this node has no parameter `{}`; it has {}",
                    setting.said,
                    setting.name,
                    self.names().join(", ")
                ));
                continue;
            };
            let value = match (&self.specs[place].rule, &setting.value) {
                #[allow(
                    clippy::cast_precision_loss,
                    reason = "a whole number for the nearest number"
                )]
                (Rule::Real { .. }, Value::Whole(whole)) => Value::Real(*whole as f64),
                (_, value) => value.clone(),
            };
            self.specs[place]
                .rule
                .fits(&setting.name, &value, &self.sources)
                .map_err(|why| format!("{}: {why}", setting.said))?;
            self.specs[place].value = value;
        }
        for spec in &mut self.specs {
            if let Some(value) = self.kept.value(&spec.name) {
                spec.value = value;
            }
        }
        Ok(unknown)
    }

    /// Keeps a value that somebody set while the node runs.
    pub(super) fn keep(&self, name: &str, value: &ParameterValue) {
        if let Some(value) = plain(value) {
            self.kept.keep(name, value);
        }
    }

    /// From now on sets are those of others.
    pub(super) fn run(&self) {
        self.running.store(true, Ordering::Relaxed);
    }

    /// Whether sets are those of others.
    pub(super) fn is_running(&self) -> bool {
        self.running.load(Ordering::Relaxed)
    }

    /// The parameters.
    pub(super) fn specs(&self) -> &[Spec] {
        &self.specs
    }

    fn names(&self) -> Vec<&str> {
        self.specs.iter().map(|spec| spec.name.as_str()).collect()
    }

    /// The flag of this name, as of the start.
    pub(super) fn flag(&self, name: &str) -> bool {
        self.specs
            .iter()
            .any(|spec| spec.name == name && spec.value == Value::Flag(true))
    }

    /// Whether a value may be set now.
    ///
    /// # Errors
    /// Why not, and what to do.
    pub(super) fn check(&self, name: &str, value: &ParameterValue) -> Result<(), String> {
        let Some(spec) = self.specs.iter().find(|spec| spec.name == name) else {
            return Ok(()); // the node refuses what is not declared
        };
        let value = plain(value).ok_or_else(|| format!("{name} takes no such value"))?;
        spec.rule.fits(name, &value, &self.sources)?;
        if !self.running.load(Ordering::Relaxed) {
            return Ok(());
        }
        match spec.when {
            When::Always => Ok(()),
            When::AtStart => Err(format!(
                "{name} is set at the start only: -p {name}:=VALUE or a parameter file"
            )),
            When::IfAllowed if self.flag("ros.allow_edits") => Ok(()),
            When::IfAllowed => Err(format!(
                "{name} touches what the monitor promises: start the node with -p ros.allow_edits:=true to change it while it runs"
            )),
        }
    }

    /// What a value that was checked does.
    pub(super) fn effect(&self, name: &str, value: &ParameterValue) -> Effect {
        let place = |source: &str| self.sources.iter().position(|(own, _)| own == source);
        match (name, plain(value)) {
            ("budget_ms", Some(Value::Real(ms))) => Effect::Tick(Setting::BudgetTime(some_ns(ms))),
            ("budget_units", Some(Value::Whole(units))) => {
                Effect::Tick(Setting::BudgetUnits(u64::try_from(units).ok()))
            }
            ("mode", Some(Value::Text(text))) => {
                Mode::parse(&text).map_or(Effect::None, |mode| Effect::Tick(Setting::Mode(mode)))
            }
            ("report_within_m", Some(Value::Real(metres))) => self.margin(name, metres),
            ("max_skew_ms", Some(Value::Real(ms))) => Effect::Own(Own::MaxSkew(some_ns(ms))),
            ("ros_max_pairs", Some(Value::Whole(rows))) => Effect::Own(Own::MaxPairs(count(rows))),
            ("ros_max_contacts", Some(Value::Whole(rows))) => {
                Effect::Own(Own::MaxContacts(count(rows)))
            }
            ("publish_markers", Some(Value::Flag(on))) => Effect::Own(Own::Markers(on)),
            ("markers_rate_hz", Some(Value::Real(hz))) => {
                Effect::Own(Own::MarkersPeriod(some_ns(1e3 / hz).unwrap_or(0)))
            }
            ("out_reliability", Some(Value::Text(word))) => {
                Effect::Own(Own::Reliable(word == "reliable"))
            }
            ("publish_collisions", Some(Value::Flag(on))) => Effect::Own(Own::Collisions(on)),
            (name, Some(Value::Real(ms))) => {
                let source = name.strip_prefix("timeout_ms.").and_then(place);
                match (source, some_ns(ms)) {
                    (Some(source), Some(timeout_ns)) => Effect::Timeout(source, timeout_ns),
                    _ => Effect::None,
                }
            }
            _ => Effect::None,
        }
    }

    /// An edit of the scene: done when it is set, and for a value of the start by the first node of a daemon. One that
    /// is opened in its place would undo what was edited since.
    fn margin(&self, name: &str, metres: f64) -> Effect {
        let report_within_m = (metres >= 0.0).then_some(metres);
        if !self.is_running() {
            if report_within_m.is_none() || self.kept.value(name).is_some() {
                return Effect::None;
            }
            self.kept.keep(name, Value::Real(metres));
        }
        Effect::Tick(Setting::Margin(report_within_m))
    }
}

/// A value as the node declares it.
pub(super) fn declared(value: &Value) -> ParameterValue {
    match value {
        Value::Flag(flag) => ParameterValue::Boolean(*flag),
        Value::Whole(whole) => ParameterValue::Integer(*whole),
        Value::Real(real) => ParameterValue::Double(*real),
        Value::Text(text) => ParameterValue::String(text.clone()),
        Value::List(_) => ParameterValue::NotSet,
    }
}

#[cfg(test)]
mod tests;
