//! `/diagnostics`: how the daemon fares, once a second, in words. In: the newest tick, counters, faults. Out: one
//! status for the state, the budget, the sources and the node. Pure.

use crate::wire::ros::diagnostic_level::{ERROR, OK, WARN};
use crate::wire::ros::{Counts, DiagnosticArray, DiagnosticStatus, Header, KeyValue, Time};
use crate::wire::{Reason, RejectReason, SourceRow, State, TickRow, name_str};

/// Seconds of ticks beyond their budget after which a warning becomes an error: a moment of load is none.
const OVERRUN_ERROR_S: u32 = 3;
/// Of so many ticks one that ends after its budget is a warning for ever: a loaded machine wakes a few of them late,
/// and another budget would not mend that. Of 1,350 ticks 7 were, in each of three seconds some.
const OVERRUN_RARE: u64 = 20;

/// What was told a second ago, to tell what is new.
#[derive(Clone, Debug, Default)]
pub(super) struct Diagnoser {
    missed: u64,
    tick: u64,
    overrun_s: u32,
    rejects: Vec<u64>,
    /// Frames refused, by source.
    refused: Vec<u64>,
    /// Frames taken, by source.
    frames: Vec<u64>,
    counts: Counts,
}

impl Diagnoser {
    /// Tells what is new from now on.
    pub(super) fn since(row: &TickRow, counts: Counts) -> Self {
        Self {
            missed: row.missed,
            tick: row.header.tick,
            overrun_s: 0,
            rejects: row.rejects.to_vec(),
            refused: row.sources.iter().map(|s| s.refused).collect(),
            frames: row.sources.iter().map(|s| s.frames).collect(),
            counts,
        }
    }

    /// The statuses of the last second.
    pub(super) fn diagnose(
        &mut self,
        now: Time,
        node: &str,
        row: &TickRow,
        counts: Counts,
        faults: &[String],
    ) -> DiagnosticArray {
        let parts = [
            ("state", state(row)),
            ("budget", self.budget(row)),
            ("sources", self.sources(row)),
            ("ros2", self.node(counts, faults)),
        ];
        let status = parts.map(|(part, (level, message, values))| DiagnosticStatus {
            level,
            name: format!("{node}: {part}"),
            message,
            hardware_id: "sweepd".to_owned(),
            values,
        });
        DiagnosticArray {
            header: Header {
                stamp: now,
                frame_id: String::new(),
            },
            status: status.into(),
        }
    }

    fn budget(&mut self, row: &TickRow) -> Finding {
        let missed = row.missed.saturating_sub(self.missed);
        let ticks = row.header.tick.saturating_sub(self.tick).max(missed);
        (self.missed, self.tick) = (row.missed, row.header.tick);
        let often = missed.saturating_mul(OVERRUN_RARE) > ticks;
        self.overrun_s = if often { self.overrun_s + 1 } else { 0 };
        let (level, message) = match (missed, self.overrun_s) {
            (0, _) => (OK, "within the budget".to_owned()),
            (_, s) if s < OVERRUN_ERROR_S => (
                WARN,
                format!("{missed} of the last second's {ticks} ticks ended after their budget"),
            ),
            (_, s) => (
                ERROR,
                format!(
                    "ticks have ended after their budget for {s} s: raise budget_ms, or lower what is asked"
                ),
            ),
        };
        let values = vec![
            value("elapsed_us", row.elapsed_ns / 1000),
            value("floor_us", row.floor_ns / 1000),
            value("units", row.units),
            value("missed", row.missed),
        ];
        (level, message, values)
    }

    fn sources(&mut self, row: &TickRow) -> Finding {
        let sources = || row.sources.iter().take(usize::from(row.sources_len));
        // One whose frames come is not silent, however old they are.
        let (mut silent, mut old) = (Vec::new(), Vec::new());
        for (at, source) in sources().enumerate().filter(|(_, s)| s.alive == 0) {
            let before = self.frames.get(at).copied().unwrap_or_default();
            let list = if source.frames > before && source.age_ns != u64::MAX {
                &mut old
            } else {
                &mut silent
            };
            list.push(name(source));
        }
        self.frames = row.sources.iter().map(|s| s.frames).collect();
        let new = RejectReason::ALL.iter().filter_map(|reason| {
            let place = usize::from(reason.code());
            let all = row.rejects.get(place).copied().unwrap_or_default();
            let before = self.rejects.get(place).copied().unwrap_or_default();
            (all > before).then(|| format!("{} {reason}", all - before))
        });
        let new: Vec<String> = new.collect();
        self.rejects = row.rejects.to_vec();
        let of = sources().enumerate().filter_map(|(at, source)| {
            let before = self.refused.get(at).copied().unwrap_or_default();
            (source.refused > before).then(|| name(source))
        });
        let of: Vec<&str> = of.collect();
        self.refused = row.sources.iter().map(|s| s.refused).collect();
        let mut said = Vec::new();
        if !silent.is_empty() {
            said.push(format!("silent: {}", silent.join(", ")));
        }
        if !old.is_empty() {
            said.push(format!("frames come and are too old: {}", old.join(", ")));
        }
        // Also of a silent source: it may be silent because all that it sends is refused.
        if !new.is_empty() {
            let mut text = format!("refused in the last second: {}", new.join(", "));
            if !of.is_empty() {
                text.push_str(&format!(" (frames of {})", of.join(", ")));
            }
            said.push(text);
        }
        let (level, message) = match said.as_slice() {
            [] => (OK, "all sources send".to_owned()),
            _ if silent.is_empty() && old.is_empty() => (WARN, said.join("; ")),
            _ => (ERROR, said.join("; ")),
        };
        let age = |source: &SourceRow| match source.age_ns {
            u64::MAX => value(name(source), "never"),
            age_ns => value(name(source), format!("{} ms old", age_ns / 1_000_000)),
        };
        (level, message, sources().map(age).collect())
    }

    fn node(&mut self, counts: Counts, faults: &[String]) -> Finding {
        let undecodable = counts.undecodable.saturating_sub(self.counts.undecodable);
        let dropped = counts
            .datagrams_dropped
            .saturating_sub(self.counts.datagrams_dropped);
        let unread = counts
            .datagrams_unread
            .saturating_sub(self.counts.datagrams_unread);
        self.counts = counts;
        let mut said: Vec<String> = faults.to_vec();
        if undecodable > 0 {
            said.push(format!(
                "{undecodable} samples could not be decoded: a wrong type on a topic?"
            ));
        }
        if dropped > 0 {
            said.push(format!(
                "{dropped} datagrams were no RTPS, or did not fit into the receive buffers: who else sends to the ports of this domain? is net.core.rmem_max large enough?"
            ));
        }
        if unread > 0 {
            said.push(format!(
                "{unread} datagrams began as RTPS and could not be read: who else sends to the ports of this domain?"
            ));
        }
        let level = if said.is_empty() { OK } else { WARN };
        let message = match said.as_slice() {
            [] => "in order".to_owned(),
            _ => said.join("; "),
        };
        let mut values = vec![
            value("sends_dropped", counts.sends_dropped),
            value("receipts_undecodable", counts.undecodable),
            value("receipts_refused", counts.refused),
            value("datagrams_dropped", counts.datagrams_dropped),
            value("datagrams_unread", counts.datagrams_unread),
        ];
        let skew = counts.skew_ns.map(super::poses::seconds);
        values.extend(skew.map(|skew_s| value("tf_skew_s", format_args!("{skew_s:.4}"))));
        (level, message, values)
    }
}

/// Level, message, figures.
type Finding = (u8, String, Vec<KeyValue>);

fn state(row: &TickRow) -> Finding {
    let state = State::from_code(row.header.state).unwrap_or(State::Unknown);
    let reasons: Vec<String> = Reason::ALL
        .iter()
        .filter(|reason| row.reasons & reason.bit() != 0)
        .map(ToString::to_string)
        .collect();
    // A certified collision is an answer; that something is not known is the trouble.
    let level = match state {
        State::Unknown => ERROR,
        State::Possible => WARN,
        _ if reasons.is_empty() => OK,
        _ => WARN,
    };
    let message = match reasons.as_slice() {
        [] => state.to_string(),
        _ => format!("{state}: {}", reasons.join(", ")),
    };
    let values = vec![
        value("bodies", row.bodies),
        value("unknown", row.unknown),
        value("colliding", row.colliding),
        value("possible", row.possible),
        value("near", row.near),
        value("ignored", row.ignored),
    ];
    (level, message, values)
}

fn name(source: &SourceRow) -> &str {
    name_str(&source.name).unwrap_or("?")
}

#[allow(
    clippy::needless_pass_by_value,
    reason = "a number or a piece of text is said by value"
)]
fn value(key: &str, value: impl std::fmt::Display) -> KeyValue {
    KeyValue {
        key: key.to_owned(),
        value: value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::name_bytes;

    fn levels(diagnoser: &mut Diagnoser, row: &TickRow, faults: &[String]) -> Vec<(u8, String)> {
        let all = diagnoser.diagnose(Time::default(), "sweepd", row, Counts::default(), faults);
        all.status
            .into_iter()
            .map(|s| (s.level, s.message))
            .collect()
    }

    #[test]
    fn a_daemon_in_order_is_ok_in_every_part() {
        let all = levels(&mut Diagnoser::default(), &TickRow::default(), &[]);
        assert_eq!(
            all.iter().map(|(level, _)| *level).collect::<Vec<_>>(),
            [OK; 4]
        );
    }

    #[test]
    fn bug_a_reader_that_comes_late_is_not_told_of_hours_ago_as_of_the_last_second() {
        let mut row = TickRow {
            missed: 7,
            ..TickRow::default()
        };
        row.rejects[0] = 9;
        let counts = Counts {
            sends_dropped: 3,
            undecodable: 2,
            ..Counts::default()
        };
        let levels = |diagnoser: &mut Diagnoser, row: &TickRow| -> Vec<u8> {
            let all = diagnoser.diagnose(Time::default(), "sweepd", row, counts, &[]);
            all.status.iter().map(|status| status.level).collect()
        };
        let mut diagnoser = Diagnoser::since(&row, counts);
        assert_eq!(levels(&mut diagnoser, &row), [OK; 4]);
        row.missed += 1;
        row.rejects[0] += 1;
        assert_eq!(levels(&mut diagnoser, &row), [OK, WARN, WARN, OK]);
    }

    #[test]
    fn overruns_are_a_warning_first_and_then_an_error() {
        let mut diagnoser = Diagnoser::default();
        let seen: Vec<u8> = (1..=4)
            .map(|missed| {
                let row = TickRow {
                    missed,
                    ..TickRow::default()
                };
                levels(&mut diagnoser, &row, &[])[1].0
            })
            .collect();
        assert_eq!(seen, [WARN, WARN, ERROR, ERROR]);
        let row = TickRow {
            missed: 4,
            ..TickRow::default()
        };
        assert_eq!(levels(&mut diagnoser, &row, &[])[1].0, OK);
    }

    #[test]
    fn bug_a_few_late_ticks_of_many_stay_a_warning() {
        let mut diagnoser = Diagnoser::default();
        let mut row = TickRow::default();
        let mut after = |ticks: u64, missed: u64| {
            row.header.tick += ticks;
            row.missed += missed;
            levels(&mut diagnoser, &row, &[])[1].clone()
        };
        for _ in 0..9 {
            let (level, text) = after(450, 3);
            assert_eq!(level, WARN);
            assert_eq!(
                text,
                "3 of the last second's 450 ticks ended after their budget"
            );
        }
        // One in ten of them is an error, once it has been so for three seconds on end.
        let seen = [after(100, 10).0, after(100, 10).0, after(100, 5).0];
        assert_eq!(seen, [WARN, WARN, WARN]);
        let seen = [after(100, 6).0, after(100, 6).0, after(100, 6).0];
        assert_eq!(seen, [WARN, WARN, ERROR]);
    }

    #[test]
    fn silence_rejects_reasons_and_faults_are_told_in_words() {
        let mut diagnoser = Diagnoser::default();
        let mut row = TickRow {
            sources_len: 1,
            ..TickRow::default()
        };
        row.sources[0].name = name_bytes("arm");
        row.header.state = State::Unknown.code();
        row.reasons = Reason::Stale.bit();
        row.rejects[1] = 3;
        let all = levels(&mut diagnoser, &row, &["body a: lost".to_owned()]);
        assert_eq!(all[0], (ERROR, "unknown: stale".to_owned()));
        let refused = "silent: arm; refused in the last second: 3 bad_quaternion";
        assert_eq!(all[2], (ERROR, refused.to_owned()));
        assert_eq!(all[3], (WARN, "body a: lost".to_owned()));
        row.sources[0].alive = 1;
        row.rejects[1] = 5;
        row.sources[0].refused = 2;
        assert_eq!(
            levels(&mut diagnoser, &row, &[])[2],
            (
                WARN,
                "refused in the last second: 2 bad_quaternion (frames of arm)".to_owned()
            )
        );
    }

    #[test]
    fn bug_a_source_whose_frames_come_and_are_old_is_not_told_as_silent() {
        let mut row = TickRow {
            sources_len: 1,
            ..TickRow::default()
        };
        row.sources[0].name = name_bytes("arm");
        row.sources[0].frames = 50;
        row.sources[0].age_ns = 3_600_000_000_000;
        let mut diagnoser = Diagnoser::since(&row, Counts::default());
        row.sources[0].frames = 100;
        let old = (ERROR, "frames come and are too old: arm".to_owned());
        assert_eq!(levels(&mut diagnoser, &row, &[])[2], old);
        let silent = (ERROR, "silent: arm".to_owned());
        assert_eq!(levels(&mut diagnoser, &row, &[])[2], silent);
    }
}
