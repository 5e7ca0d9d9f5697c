//! The page of the report: a table of all budgets, and plots over them.
//!
//! In: a [`Report`]. Out: HTML.

use super::Report;
use super::columns::{Column, columns};
use super::tally::Row;
use crate::report::plot::{Axis, Plot, Series};
use crate::report::sheet::{escaped, figure, must_be_0, page, table};

/// The report as a page.
///
/// * `scene` - name of the scene on the page.
#[must_use]
pub fn html(report: &Report, scene: &str) -> String {
    let class = if report.is_wrong() { "bad" } else { "good" };
    let mut body = format!(
        "<p class=\"note\">sweepd {}: {}; {} bodies of a median diameter of {:.3} m, {} moving, {:.0} pairs of overlapping \
         boxes; {} ticks at {} Hz after {} to warm up, seed {}</p>\n\
         <p><span class=\"{class}\">{} verdicts are wrong, {} intervals exclude the truth.</span> {}</p>\n",
        escaped(report.version),
        escaped(scene),
        report.bodies,
        report.size_m,
        report.moving,
        report.pairs,
        report.ticks,
        report.rate_hz,
        report.warm_up_ticks,
        report.seed,
        report.wrong,
        report.excluded,
        escaped(&summary(report))
    );
    let heads: Vec<String> = columns(report)
        .map(|column| format!("{} {}", column.name, column.unit))
        .collect();
    let cell = |column: &Column, row: &Row| {
        let text = (column.cell)(row);
        if column.must_be_0 {
            must_be_0(&text)
        } else {
            escaped(&text)
        }
    };
    let rows: Vec<Vec<String>> = report
        .rows
        .iter()
        .map(|row| columns(report).map(|column| cell(column, row)).collect())
        .collect();
    let heads: Vec<&str> = heads.iter().map(|head| head.trim_end()).collect();
    body += &table(&heads, &rows);
    body += "<p class=\"note\">Undecided: pair-ticks told as possible. Guessed wrong: of all pair-ticks, those that are \
             undecided and whose last verdict is not the truth. Width: of the proved interval of each pair that is told; \
             endless ones are in no mean, but counted. Onset: ticks from the begin of a collision until it is told as certain. Over: time beyond the budget, or beyond \
             the floor where that is more (below its floor a tick takes the floor, and says so). Wrong, excluded: against a \
             twin without a budget at the same poses. Each pair has a row here, also where the scene's `pair_rows` are fewer: with so many pairs \
             times hold what those rows take.</p>\n<div class=\"figures\">";
    body += &figures(report);
    page("sweepd: error against run time", &(body + "</div>\n"))
}

/// The result of the sweep in a sentence or two.
#[must_use]
pub fn summary(report: &Report) -> String {
    if report.pairs <= 0.0 {
        return "No two boxes overlapped in any tick: there was nothing to decide.".to_owned();
    }
    let Some(first) = report.rows.first() else {
        return String::new();
    };
    if report.decided_everywhere {
        return format!(
            "Every pair had its verdict in every tick at every budget: {} is enough for this scene, and no smaller one was \
             asked for.",
            name(first)
        );
    }
    // A larger budget with an undecided pair, even if another process delayed it, counts against all smaller ones.
    let open = report.rows.iter().rposition(|row| row.undecided > 0);
    let enough = open.and_then(|at| report.rows.get(at + 1));
    enough.map_or_else(
        || "Some pairs were left undecided at the largest of these budgets, too.".to_owned(),
        |row| {
            format!(
                "From {} on every pair had its verdict in every tick.",
                name(row)
            )
        },
    )
}

/// A budget as text.
#[must_use]
pub fn name(row: &Row) -> String {
    match (row.budget_ns, row.budget_units) {
        (Some(ns), _) => time(Some(ns)),
        (_, Some(units)) => format!("{units} units"),
        _ => "no limit".to_owned(),
    }
}

fn time(ns: Option<u64>) -> String {
    #[allow(clippy::cast_precision_loss, reason = "shown with few digits")]
    let us = ns.map(|ns| ns as f64 / 1e3);
    match us {
        None => "-".to_owned(),
        Some(us) if us < 1e3 => format!("{us:.1} us"),
        Some(us) => format!("{:.2} ms", us / 1e3),
    }
}

/// The value that a series takes from a row.
type Of = fn(&Row) -> Option<f64>;

#[allow(clippy::cast_precision_loss, reason = "plotted")]
fn micro(ns: Option<u64>) -> Option<f64> {
    ns.map(|ns| ns as f64 / 1e3)
}

#[allow(clippy::cast_precision_loss, reason = "plotted")]
fn number(value: Option<u64>) -> Option<f64> {
    value.map(|value| value as f64)
}

/// A line of a plot: its name, its colour, whether it is dashed, its value.
type Line = (&'static str, usize, bool, Of);

/// A plot over the budgets.
struct Shown {
    title: &'static str,
    text: &'static str,
    y: &'static str,
    log: bool,
    lines: &'static [Line],
}

const ANSWERS: [Shown; 3] = [
    Shown {
        title: "Undecided pairs",
        text: "Pairs that are told as possible, and those of them whose last verdict is not the truth.",
        y: "% of all pair-ticks",
        log: false,
        lines: &[
            ("undecided", 0, false, |r| Some(100.0 * r.undecided_share)),
            ("last verdict is not the truth", 1, true, |r| {
                Some(100.0 * r.guess_error_share)
            }),
        ],
    },
    Shown {
        title: "Width of the proved interval",
        text: "The error bound that is published with each pair.",
        y: "width, m",
        log: true,
        lines: &[
            ("mean", 0, false, |r| r.width_mean_m),
            ("99 % are below", 2, true, |r| r.width_p99_m),
        ],
    },
    Shown {
        title: "Delay of a collision",
        text: "From its first tick until it is told as certain (as possible it is told at once); and the oldest pair \
               without a verdict.",
        y: "ticks",
        log: false,
        lines: &[
            ("onset, median", 0, false, |r| number(r.onset_p50_ticks)),
            ("onset, 99 % are below", 2, true, |r| {
                number(r.onset_p99_ticks)
            }),
            ("oldest undecided", 1, true, |r| {
                number(Some(r.oldest_ticks))
            }),
        ],
    },
];

/// Plots of time budgets.
const TIMES: [Shown; 2] = [
    Shown {
        title: "Time of a tick",
        text: "Whole ticks against their budget; the floor cannot be cut.",
        y: "time, us",
        log: true,
        lines: &[
            ("median", 0, false, |r| micro(r.time_p50_ns)),
            ("99 % are below", 2, true, |r| micro(r.time_p99_ns)),
            ("the budget", 7, true, |r| micro(r.budget_ns)),
            ("floor, median", 4, true, |r| micro(r.floor_p50_ns)),
        ],
    },
    Shown {
        title: "Time beyond the budget",
        text: "Or beyond the floor, where that is more.",
        y: "time, us",
        log: true,
        lines: &[
            ("median", 0, false, |r| micro(r.over_p50_ns)),
            ("99 % are below", 2, true, |r| micro(r.over_p99_ns)),
        ],
    },
];

const WORK: [Shown; 1] = [Shown {
    title: "Work",
    text: "Units spent in a tick: exact convex queries, pairs of triangles, node tests.",
    y: "units",
    log: true,
    lines: &[
        ("mean", 0, false, |r| Some(r.units_mean)),
        ("most", 2, true, |r| number(Some(r.units_max))),
    ],
}];

fn figures(report: &Report) -> String {
    let timed = report.limited == "time";
    let times: &[Shown] = if timed { &TIMES } else { &[] };
    let all = ANSWERS.iter().chain(times).chain(&WORK);
    all.map(|shown| drawn(shown, report, timed)).collect()
}

fn drawn(shown: &Shown, report: &Report, timed: bool) -> String {
    let at = |row: &Row| match timed {
        true => micro(row.budget_ns),
        false => number(row.budget_units),
    };
    let x = match timed {
        true => "budget of a tick, us",
        false => "budget of a tick, work units",
    };
    let series = shown.lines.iter().map(|(name, colour, dashed, of)| {
        let points = report.rows.iter();
        Series {
            name: (*name).to_owned(),
            colour: *colour,
            dashed: *dashed,
            points: points
                .filter_map(|row| Some((at(row)?, of(row)?)))
                .collect(),
        }
    });
    let plot = Plot {
        x: Axis {
            label: x.to_owned(),
            log: true,
        },
        y: Axis {
            label: shown.y.to_owned(),
            log: shown.log,
        },
        series: series.filter(|series| !series.points.is_empty()).collect(),
        levels: Vec::new(),
    };
    figure(shown.title, shown.text, &plot.svg())
}
