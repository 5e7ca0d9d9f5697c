//! The table of parameters: initial values from a scene, accepted values, and when each may be set.

use super::super::RosScene;
use super::Value;
use super::rules::{Rule, milliseconds};
use crate::config::Config;
use crate::limits;

/// Meaning of -1 where a parameter has no limit.
const NO_LIMIT: &str = "no limit";
/// Default row limit of a tick on a large topic; 500 rows of `~/pairs` take 88 KB. Default receive buffers hold 208 KB,
/// half of it usable by datagrams: with 750 rows (132 KB) reliable messages came seconds late, and ticks were lost.
const ROWS_DEFAULT: i64 = 500;
/// Largest time of a parameter, milliseconds: one day.
const TIME_MS_MAX: f64 = 86_400_000.0;
/// Largest row limit of a tick on a topic: 20 MB of contacts.
const ROWS_MAX: i64 = 100_000;

/// When a parameter may be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum When {
    /// At any time.
    Always,
    /// At the start; while running only with `ros.allow_edits`.
    IfAllowed,
    /// Only at the start.
    AtStart,
}

/// A parameter.
#[derive(Clone, Debug)]
pub(super) struct Spec {
    pub(super) name: String,
    /// Value at the start.
    pub(super) value: Value,
    /// Description for `describe_parameters`.
    pub(super) about: &'static str,
    pub(super) rule: Rule,
    pub(super) when: When,
}

impl Spec {
    fn new((name, about): (&str, &'static str), value: Value, rule: Rule, when: When) -> Self {
        Self {
            name: name.to_owned(),
            value,
            about,
            rule,
            when,
        }
    }
}

/// Parameters that affect the guarantees of the daemon.
fn of_daemon(config: &Config) -> Vec<Spec> {
    let time_ms = |none| Rule::Real {
        min: 0.0,
        max: TIME_MS_MAX,
        none: Some(none),
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
    let spec = |name, about, value, rule| Spec::new((name, about), value, rule, When::IfAllowed);
    let as_said = || Value::Real(-1.0);
    vec![
        spec(
            "budget_ms",
            "time of a whole tick, from wake-up to the last message, milliseconds",
            budget_ms,
            time_ms(NO_LIMIT),
        ),
        spec(
            "budget_units",
            "counted work of a tick (exact queries, triangle pairs, node tests)",
            given,
            units,
        ),
        spec("mode", "what makes a tick", mode, Rule::Mode),
        spec(
            "max_skew_ms",
            "widest skew of stamps along a chain of /tf, milliseconds; beyond it the body is unknown",
            as_said(),
            time_ms("what the scene says of each source"),
        ),
        spec(
            "report_within_m",
            "gap below which pairs are told as near, metres",
            as_said(),
            metres,
        ),
    ]
}

/// Parameters of the node itself.
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
    let flag = |named, on, when| Spec::new(named, Value::Flag(on), Rule::Flag, when);
    let pairs = ("ros_max_pairs", "most rows of a tick on ~/pairs");
    let contacts = ("ros_max_contacts", "most rows of a tick on ~/contacts");
    let rate_hz = ("markers_rate_hz", "how often ~/markers goes out, hertz");
    let again = (
        "out_reliability",
        "whether lost messages of ~/pairs, ~/contacts and ~/collisions are sent again",
    );
    let allow = (
        "ros.allow_edits",
        "whether scene edits and parameters that touch safety are taken over ROS 2",
    );
    let markers = (
        "publish_markers",
        "whether ~/markers goes out where it is read",
    );
    let collisions = (
        "publish_collisions",
        "whether ~/collisions goes out where it is read",
    );
    let sim_time = ("use_sim_time", "whether the node's time is that of /clock");
    vec![
        Spec::new(pairs, Value::Whole(ROWS_DEFAULT), rows(), always),
        Spec::new(contacts, Value::Whole(ROWS_DEFAULT), rows(), always),
        Spec::new(rate_hz, Value::Real(10.0), rate, always),
        Spec::new(again, reliable, Rule::Word(words), always),
        flag(markers, true, always),
        flag(collisions, false, always),
        flag(allow, false, at_start),
        // With simulated time, a `/clock` that goes back ends every pair.
        flag(sim_time, false, When::IfAllowed),
    ]
}

/// All parameters of a node.
pub(super) fn all(scene: &RosScene) -> Vec<Spec> {
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
        let about = "age at which a body of this source is stale, milliseconds";
        specs.push(Spec::new((&name, about), value, rule, When::IfAllowed));
    }
    specs
}
