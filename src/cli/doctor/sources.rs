//! Findings about the sources in a daemon's tick: which of them send, and what was refused.

use crate::cli::figures::time;
use crate::cli::monitor::rejects;
use crate::wire::{SourceRow, TickRow, name_str};

use super::Finding;

/// One finding per source, and a warning with all refusals since the daemon's start.
pub(super) fn sources(instance: &str, tick: &TickRow) -> Vec<Finding> {
    let check = "sources";
    let mut found = Vec::new();
    for row in tick.sources.iter().take(usize::from(tick.sources_len)) {
        found.push(source(instance, row));
    }
    let refused: Vec<String> = rejects(tick)
        .iter()
        .map(|(why, count)| format!("{why} {count}"))
        .collect();
    if !refused.is_empty() {
        found.push(Finding::warning(
            check,
            format!("`{instance}` has refused, since its start: {}", refused.join(", ")),
            "README and msgs/README.md say what each reason means; `sweepd monitor` shows whether they go on",
        ));
    }
    found
}

fn source(instance: &str, row: &SourceRow) -> Finding {
    let check = "sources";
    let name = name_str(&row.name).unwrap_or("?");
    match (row.alive, row.age_ns) {
        (_, u64::MAX) => Finding::warning(
            check,
            format!(
                "`{instance}` has heard nothing of source \"{name}\" yet: its bodies are unknown"
            ),
            "start it; it must send under this name, to this instance",
        ),
        (1, age_ns) => Finding::ok(
            check,
            format!(
                "`{instance}` hears source \"{name}\", last {} ago",
                time(age_ns)
            ),
        ),
        (_, age_ns) => Finding::warning(
            check,
            format!(
                "`{instance}` has nothing of source \"{name}\" that is younger than {}",
                time(age_ns)
            ),
            "see whether it still runs; if it does, its `sent_ns` may be of another machine's clock: it writes 0 there",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    #[test]
    fn a_source_that_never_came_is_told_with_what_it_must_do() {
        let silent = SourceRow {
            age_ns: u64::MAX,
            ..SourceRow::default()
        };
        assert_eq!(source("x", &silent).level, Level::Warning);
        let alive = SourceRow {
            alive: 1,
            age_ns: 5,
            ..SourceRow::default()
        };
        assert_eq!(source("x", &alive).level, Level::Ok);
        assert_eq!(
            source("x", &SourceRow { alive: 0, ..alive }).level,
            Level::Warning
        );
    }
}
