//! Accepted values of parameters, when they may be set, and their effects.

use super::*;
use crate::transport::ros2::RosSourceSpec;

pub(super) fn table() -> Table {
    let source = |name: &str| RosSourceSpec {
        name: name.to_owned(),
        timeout_ns: 500_000_000,
        ros2: None,
    };
    let scene = RosScene {
        sources: vec![source("sim"), source("arm")],
        ..RosScene::default()
    };
    Table::of(&scene)
}

fn said(name: &str, value: Value) -> Said {
    Said {
        node: "/**".to_owned(),
        name: name.to_owned(),
        value,
        said: format!("-p {name}"),
    }
}

#[test]
fn what_is_said_at_the_start_is_taken_in_order_and_whole_numbers_stand_for_numbers() {
    let mut table = table();
    let all = [
        said("budget_ms", Value::Real(3.0)),
        said("budget_ms", Value::Whole(1)),
        said("ros.allow_edits", Value::Flag(true)),
        said("out_reliability", Value::Text("best_effort".to_owned())),
        said("colour", Value::Whole(1)),
    ];
    let unknown = table.start(&all, "/sweepd").unwrap();
    assert!(unknown.len() == 1 && unknown[0].contains("no parameter `colour`"));
    assert_eq!(table.specs[0].value, Value::Real(1.0));
    assert!(table.flag("ros.allow_edits"));
    let wrong = table.start(&[said("budget_ms", Value::Real(-2.0))], "/sweepd");
    assert!(wrong.unwrap_err().contains("or -1 for no limit"));
}

#[test]
fn each_value_out_of_range_has_its_reason() {
    let table = table();
    for (name, value, word) in [
        ("budget_ms", Value::Real(-2.0), "from 0 to"),
        ("budget_ms", Value::Real(f64::NAN), "from 0 to"),
        ("budget_ms", Value::Text("x".to_owned()), "a number"),
        ("ros_max_contacts", Value::Whole(-1), "from 0 to 100000"),
        ("ros_max_contacts", Value::Real(1.0), "a whole number"),
        ("markers_rate_hz", Value::Real(0.0), "from 0.1 to 100"),
        ("timeout_ms.arm", Value::Real(0.0), "from 1 to"),
        (
            "mode",
            Value::Text("on_frame=leg".to_owned()),
            "no source `leg`",
        ),
        ("mode", Value::Text("fast".to_owned()), "rate=HZ"),
        ("publish_markers", Value::Whole(1), "true or false"),
        ("budget_ms", Value::List(vec![Value::Real(1.0)]), "a number"),
        // A peer's text is written on one line.
        ("mode", Value::Text("on_frame=a\nb".to_owned()), "a\\nb"),
        ("a\nb", Value::Real(1.0), "no parameter `a\\nb`"),
    ] {
        let why = table.check(name, &value).unwrap_err();
        assert!(why.contains(word), "{name}: {why}");
    }
}

#[test]
fn what_touches_safety_needs_leave_while_running() {
    let mut locked = table();
    let value = Value::Real(2.0);
    assert!(locked.check("budget_ms", &value).is_ok());
    locked.run();
    assert!(
        locked
            .check("budget_ms", &value)
            .unwrap_err()
            .contains("ros.allow_edits")
    );
    assert!(locked.check("ros_max_pairs", &Value::Whole(7)).is_ok());
    assert!(
        locked
            .check("ros.allow_edits", &Value::Flag(true))
            .unwrap_err()
            .contains("at the start only")
    );
    locked
        .start(&[said("ros.allow_edits", Value::Flag(true))], "/sweepd")
        .unwrap();
    assert!(locked.check("budget_ms", &value).is_ok());
}

#[test]
fn a_value_does_what_its_name_says() {
    let table = table();
    let real = Value::Real;
    assert_eq!(
        table.effect("budget_ms", &real(2.5)),
        Effect::Tick(Setting::BudgetTime(Some(2_500_000)))
    );
    assert_eq!(
        table.effect("budget_ms", &real(-1.0)),
        Effect::Tick(Setting::BudgetTime(None))
    );
    let told = table.check("report_within_m", &real(-0.5)).unwrap_err();
    assert!(
        told.contains("-1 for what each body was put with"),
        "{told}"
    );
    assert_eq!(
        table.effect("timeout_ms.arm", &real(20.0)),
        Effect::Timeout(1, 20_000_000)
    );
    assert_eq!(
        table.effect("markers_rate_hz", &real(10.0)),
        Effect::Own(Own::MarkersPeriod(100_000_000))
    );
    let best = Value::Text("best_effort".to_owned());
    assert_eq!(
        table.effect("out_reliability", &best),
        Effect::Own(Own::Reliable(false))
    );
    let mode = Value::Text("rate=50".to_owned());
    assert_eq!(
        table.effect("mode", &mode),
        Effect::Tick(Setting::Mode(Mode::Rate(50.0)))
    );
}

#[test]
fn bug_a_node_opened_anew_does_not_undo_margins_that_were_edited_since() {
    let scene = RosScene::default();
    let margin = |table: &Table, metres| {
        let value = Value::Real(metres);
        let effect = table.effect("report_within_m", &value);
        if table.is_running() {
            table.keep("report_within_m", value);
        }
        effect
    };
    let sets = |metres| Effect::Tick(Setting::Margin(metres));
    let first = Table::of(&scene);
    assert_eq!(margin(&first, -1.0), Effect::None, "as the bodies are");
    assert_eq!(margin(&first, 0.3), sets(Some(0.3)), "said at the start");
    // The node is reopened with the same arguments, and after another value was set.
    assert_eq!(margin(&Table::of(&scene), 0.3), Effect::None);
    first.run();
    assert_eq!(margin(&first, 0.2), sets(Some(0.2)));
    assert_eq!(margin(&first, -1.0), sets(None));
    assert_eq!(margin(&Table::of(&scene), -1.0), Effect::None);
}

#[test]
fn what_was_set_while_it_ran_is_what_the_next_node_begins_with() {
    let scene = RosScene::default();
    let mut first = Table::of(&scene);
    let start = [
        said("budget_ms", Value::Real(3.0)),
        said("ros_max_pairs", Value::Whole(5)),
    ];
    first.start(&start, "/sweepd").unwrap();
    first.run();
    first.keep("budget_ms", Value::Real(4.0));
    let mut second = Table::of(&scene);
    second.start(&start, "/sweepd").unwrap();
    let value = |name: &str| {
        let mut specs = second.specs.iter();
        specs.find(|spec| spec.name == name).unwrap().value.clone()
    };
    assert_eq!(value("budget_ms"), Value::Real(4.0));
    assert_eq!(value("ros_max_pairs"), Value::Whole(5));
}
