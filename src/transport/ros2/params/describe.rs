//! What parameters are, as ROS 2 asks for it: names under prefixes, and a descriptor with type and ranges. Pure.

use ros2_client::parameters::raw::{
    FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType,
};
use ros2_client::rcl_interfaces::ListParametersResult;

use super::rules::Rule;
use super::{Spec, Value, When};

/// What -1 is written for, where a parameter takes it beside its range.
const NONE: i8 = -1;

/// The code that ROS 2 has for the type of a value.
pub(super) fn kind(value: &Value) -> u8 {
    match value {
        Value::Flag(_) => ParameterType::BOOL,
        Value::Whole(_) => ParameterType::INTEGER,
        Value::Real(_) => ParameterType::DOUBLE,
        Value::Text(_) => ParameterType::STRING,
        Value::List(_) => ParameterType::NOT_SET,
    }
}

/// The descriptor of a name that no parameter has.
pub(super) fn unknown(name: &str) -> ParameterDescriptor {
    ParameterDescriptor {
        name: name.to_owned(),
        r#type: ParameterType::NOT_SET,
        description: String::new(),
        additional_constraints: String::new(),
        read_only: false,
        dynamic_typing: false,
        floating_point_range: Vec::new(),
        integer_range: Vec::new(),
    }
}

/// The descriptor of a parameter: what cannot be said by a range is said in words.
pub(super) fn descriptor(spec: &Spec) -> ParameterDescriptor {
    let (mut reals, mut wholes) = (Vec::new(), Vec::new());
    let mut words = match &spec.rule {
        Rule::Real { min, max, none } => {
            reals.push(FloatingPointRange {
                from_value: none.map_or(*min, |_| f64::from(NONE)),
                to_value: *max,
                step: 0.0,
            });
            none.map(|what| format!("from {min} to {max}, or -1 for {what}"))
        }
        Rule::Whole { max, none } => {
            wholes.push(IntegerRange {
                from_value: none.map_or(0, |_| i64::from(NONE)),
                to_value: *max,
                step: 1,
            });
            none.map(|what| format!("from 0 to {max}, or -1 for {what}"))
        }
        Rule::Flag => None,
        Rule::Word(words) => Some(words.join(" or ")),
        Rule::Mode => {
            Some("on_all, on_frame=SOURCE (one that sends whole frames) or rate=HZ".to_owned())
        }
    };
    if spec.when == When::IfAllowed {
        let leave = "set while running only where the node was started with --ros-args -p ros.allow_edits:=true";
        words = Some(words.map_or(leave.to_owned(), |words| format!("{words}; {leave}")));
    }
    ParameterDescriptor {
        r#type: kind(&spec.value),
        description: spec.about.to_owned(),
        additional_constraints: words.unwrap_or_default(),
        read_only: spec.when == When::AtStart,
        floating_point_range: reals,
        integer_range: wholes,
        ..unknown(&spec.name)
    }
}

/// The names that lie under any of the prefixes (all, if there is none) by fewer than `depth` dots, 0 for any number;
/// and what stands before their last dots, each once.
///
/// Source: `ListParameters.srv` of `rcl_interfaces`, and what rclcpp makes of it.
pub(super) fn list<'a>(
    names: impl Iterator<Item = &'a str>,
    prefixes: &[String],
    depth: u64,
) -> ListParametersResult {
    let is_near = |rest: &str| depth == 0 || (rest.matches('.').count() as u64) < depth;
    let is_under = |name: &str, prefix: &str| {
        let rest = name.strip_prefix(prefix);
        rest.is_some_and(|rest| rest.is_empty() || (rest.starts_with('.') && is_near(&rest[1..])))
    };
    let names = names.filter(|name| {
        (prefixes.is_empty() && is_near(name)) || prefixes.iter().any(|p| is_under(name, p))
    });
    let mut listed = ListParametersResult {
        names: names.map(str::to_owned).collect(),
        prefixes: Vec::new(),
    };
    listed.names.sort_unstable();
    let before_dots = listed.names.iter().filter_map(|name| name.rsplit_once('.'));
    listed.prefixes = before_dots.map(|(prefix, _)| prefix.to_owned()).collect();
    listed.prefixes.dedup();
    listed
}

#[cfg(test)]
mod tests {
    use super::super::{Table, tests::table};
    use super::*;

    fn spec<'a>(table: &'a Table, name: &str) -> &'a Spec {
        table.specs.iter().find(|spec| spec.name == name).unwrap()
    }

    #[test]
    fn a_descriptor_tells_type_range_and_when_it_may_be_set() {
        let table = table();
        let rate = descriptor(spec(&table, "markers_rate_hz"));
        assert_eq!(rate.r#type, ParameterType::DOUBLE);
        let range = &rate.floating_point_range[0];
        assert_eq!((range.from_value, range.to_value), (0.1, 100.0));
        assert!(rate.additional_constraints.is_empty() && !rate.read_only);
        let rows = descriptor(spec(&table, "ros_max_contacts"));
        let range = &rows.integer_range[0];
        assert_eq!((range.from_value, range.to_value), (0, 100_000));
        let budget = descriptor(spec(&table, "budget_ms"));
        assert!(budget.floating_point_range[0].from_value < 0.0);
        let said = &budget.additional_constraints;
        assert!(
            said.contains("-1 for no limit") && said.contains("ros.allow_edits"),
            "{said}"
        );
        assert!(descriptor(spec(&table, "ros.allow_edits")).read_only);
        for spec in &table.specs {
            let told = descriptor(spec);
            assert!(!told.description.is_empty(), "{}", spec.name);
            assert_ne!(told.r#type, ParameterType::NOT_SET, "{}", spec.name);
        }
    }

    #[test]
    fn names_are_listed_by_prefix_and_depth() {
        let all = ["a", "b.c", "b.d", "b.e.f", "bc"];
        let list = |prefixes: &[&str], depth| {
            let prefixes: Vec<String> = prefixes.iter().map(|p| (*p).to_owned()).collect();
            let listed = list(all.into_iter(), &prefixes, depth);
            (listed.names.join(" "), listed.prefixes.join(" "))
        };
        let told = |names: &str, prefixes: &str| (names.to_owned(), prefixes.to_owned());
        assert_eq!(list(&[], 0), told("a b.c b.d b.e.f bc", "b b.e"));
        assert_eq!(list(&[], 1), told("a bc", ""));
        assert_eq!(list(&["b"], 0), told("b.c b.d b.e.f", "b b.e"));
        assert_eq!(list(&["b"], 1), told("b.c b.d", "b"));
        assert_eq!(list(&["a", "b.e"], 0), told("a b.e.f", "b.e"));
        assert_eq!(list(&["none"], 0), told("", ""));
    }
}
