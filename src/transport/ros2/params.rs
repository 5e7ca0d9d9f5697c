//! The node's parameters: what they are, which values they take, what they do. In: a scene, settings of the command
//! line and of files, sets of anybody (`answer`). Out: values, or why not; changes for the tick thread and the node.
//!
//! What touches safety (budget, mode, time-outs, skew, margins) is changed while running only with `ros.allow_edits`,
//! which is said at the start.

mod answer;
mod describe;
mod rules;
mod specs;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

pub(super) use answer::Answers;
use rules::{count, some_ns};
use specs::{Spec, When, all};

use super::RosScene;
use super::open;
use super::params_file::{Setting as Said, Value};
use super::told::brief;
use crate::config::Mode;
use crate::transport::Setting;

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
    /// Whether the node's time is that of `/clock`.
    SimTime(bool),
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
    fn of(scene: &RosScene) -> Self {
        let sources = scene.sources.iter();
        Self {
            specs: all(scene),
            sources: sources
                .map(|s| (s.name.clone(), s.ros2.is_none()))
                .collect(),
            running: AtomicBool::new(false),
            kept: scene.kept.clone(),
        }
    }

    /// The parameters of a scene as they are at the start, and what was said of ones that the node does not have.
    ///
    /// # Errors
    /// Those of [`Self::start`].
    pub(super) fn started(
        scene: &RosScene,
        said: &[Said],
        node: &str,
    ) -> Result<(Self, Vec<String>), String> {
        let mut table = Self::of(scene);
        let unknown = table.start(said, node)?;
        Ok((table, unknown))
    }

    /// Takes what was said at the start, in order; the last wins. What was set while another node ran in this daemon
    /// came later still, and wins over that.
    ///
    /// * returns - what was said of parameters that the node does not have.
    ///
    /// # Errors
    /// One text, when a value is none that the parameter takes.
    fn start(&mut self, said: &[Said], node: &str) -> Result<Vec<String>, String> {
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
            let value = self.specs[place].rule.read(&setting.value);
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
    fn keep(&self, name: &str, value: Value) {
        self.kept.keep(name, value);
    }

    /// From now on sets are those of others.
    pub(super) fn run(&self) {
        self.running.store(true, Ordering::Relaxed);
    }

    /// Whether sets are those of others.
    fn is_running(&self) -> bool {
        self.running.load(Ordering::Relaxed)
    }

    /// What the values of the start do.
    pub(super) fn effects(&self) -> impl Iterator<Item = Effect> {
        let specs = self.specs.iter();
        specs.map(|spec| self.effect(&spec.name, &spec.value))
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

    /// The value as the parameter takes it, if it may be set now.
    ///
    /// # Errors
    /// Why not, and what to do.
    fn check(&self, name: &str, value: &Value) -> Result<Value, String> {
        let Some(spec) = self.specs.iter().find(|spec| spec.name == name) else {
            let (name, names) = (brief(name), self.names().join(", "));
            return Err(format!(
                "this node has no parameter `{name}`; it has {names}"
            ));
        };
        let value = spec.rule.read(value);
        spec.rule.fits(name, &value, &self.sources)?;
        if !self.is_running() {
            return Ok(value);
        }
        match spec.when {
            When::Always => Ok(value),
            When::AtStart => Err(format!(
                "{name} is set at the start only: --ros-args -p {name}:=VALUE or a parameter file"
            )),
            When::IfAllowed if self.flag("ros.allow_edits") => Ok(value),
            When::IfAllowed => Err(format!(
                "{name} touches what the monitor promises: start the node with --ros-args -p ros.allow_edits:=true to change it while it runs"
            )),
        }
    }

    /// What a value that was checked does.
    fn effect(&self, name: &str, value: &Value) -> Effect {
        let place = |source: &str| self.sources.iter().position(|(own, _)| own == source);
        match (name, value) {
            ("budget_ms", Value::Real(ms)) => Effect::Tick(Setting::BudgetTime(some_ns(*ms))),
            ("budget_units", Value::Whole(units)) => {
                Effect::Tick(Setting::BudgetUnits(u64::try_from(*units).ok()))
            }
            ("mode", Value::Text(text)) => {
                Mode::parse(text).map_or(Effect::None, |mode| Effect::Tick(Setting::Mode(mode)))
            }
            ("report_within_m", Value::Real(metres)) => self.margin(name, *metres),
            ("max_skew_ms", Value::Real(ms)) => Effect::Own(Own::MaxSkew(some_ns(*ms))),
            ("ros_max_pairs", Value::Whole(rows)) => Effect::Own(Own::MaxPairs(count(*rows))),
            ("ros_max_contacts", Value::Whole(rows)) => Effect::Own(Own::MaxContacts(count(*rows))),
            ("publish_markers", Value::Flag(on)) => Effect::Own(Own::Markers(*on)),
            ("markers_rate_hz", Value::Real(hz)) => {
                Effect::Own(Own::MarkersPeriod(some_ns(1e3 / hz).unwrap_or(0)))
            }
            ("out_reliability", Value::Text(word)) => {
                Effect::Own(Own::Reliable(word == "reliable"))
            }
            ("publish_collisions", Value::Flag(on)) => Effect::Own(Own::Collisions(*on)),
            ("use_sim_time", Value::Flag(on)) => Effect::Own(Own::SimTime(*on)),
            (name, Value::Real(ms)) => {
                let source = name.strip_prefix("timeout_ms.").and_then(place);
                match (source, some_ns(*ms)) {
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

#[cfg(test)]
mod tests;
