//! Goal: the error says why an instance cannot be opened. Method: the texts for each obstacle.

use super::*;

#[test]
fn bug_a_killed_daemon_that_nobody_waited_for_is_told_with_its_parent() {
    let us = std::process::id();
    let text = unreaped("cell", 4_000_000, us).to_string();
    let name = process(us).unwrap().name;
    for part in [
        "`cell`",
        "4000000",
        &format!("parent {us} ({name})"),
        "--init",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let place = Place::new("nobody").unwrap().under("/nowhere/at/all", "p_");
    let text = refused_twice(&place, &"full").to_string();
    assert!(text.contains("another daemon answers"), "{text}");
}
