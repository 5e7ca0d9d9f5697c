//! The page of the report: a table of all families, and a plot of each.
//!
//! In: a [`Report`]. Out: HTML.

use super::{Found, Report};
use crate::report::plot::{Axis, Plot, Series};
use crate::report::sheet::{escaped, figure, must_be_0, page, table};

/// The report as a page.
#[must_use]
pub fn html(report: &Report) -> String {
    let cases: u64 = report.families.iter().map(|f| f.summary.cases).sum();
    let answers: u64 = report.families.iter().map(|f| f.summary.answers).sum();
    let class = if report.is_wrong() { "bad" } else { "good" };
    let mut body = format!(
        "<p class=\"note\">sweepd {}</p>\n<p><span class=\"{class}\">{} intervals exclude the truth, {} verdicts are wrong</span>, \
         of {answers} answers in {cases} cases. Each case goes through a whole engine without a budget, and is held against a \
         truth in twice the precision of f64 that shares no code with it. Errors are those of the best estimate, or of the \
         farther end of the interval where there is none, in parts of the pair's size (how far both reach, and how far they are apart). Beside it, dashed: plain parry3d in f64, called \
         once at the same poses, without what is built around it here; it tells no interval. Its answers count as wrong where \
         their sign is, or where there is none.</p>\n",
        escaped(report.version),
        report.excluded,
        report.wrong
    );
    let rows: Vec<_> = report.families.iter().map(row).collect();
    body += &table(
        &[
            "family",
            "cases",
            "answers",
            "excluded truths",
            "wrong verdicts",
            "worst error",
            "tolerance",
            "where",
            "beyond",
            "left open",
            "touching",
            "slowest, us",
            "parry: worst error",
            "parry: wrong",
        ],
        &rows,
    );
    body += "<p class=\"note\">Beyond: points with a greater error than the tolerance; their intervals hold the truth all the \
             same. Touching: told as touching where the truth is apart, or touches later, by less than rounding. Slowest: \
             the narrow phase of one tick, on the machine and under the load that made this page.</p>\n<div class=\"figures\">";
    for found in &report.families {
        body += &plot(found);
    }
    page("sweepd: stiff and extreme cases", &(body + "</div>\n"))
}

fn row(found: &Found) -> Vec<String> {
    let sum = &found.summary;
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"));
    let worst = sum.worst_kind.zip(sum.worst_value);
    #[allow(clippy::cast_precision_loss, reason = "shown with one digit")]
    let slowest_us = sum.slowest_ns as f64 / 1e3;
    let name = escaped(found.family);
    vec![
        format!("<a href=\"#{name}\">{name}</a>"),
        sum.cases.to_string(),
        sum.answers.to_string(),
        must_be_0(&sum.excluded),
        must_be_0(&sum.wrong),
        number(sum.worst_error),
        number(sum.tolerance),
        worst.map_or_else(
            || "-".to_owned(),
            |(kind, value)| escaped(&format!("{kind}, {value:.1e}")),
        ),
        sum.beyond.to_string(),
        sum.open.to_string(),
        sum.touching.to_string(),
        format!("{slowest_us:.1}"),
        number(sum.raw_worst_error),
        if sum.raw_cases == 0 {
            "-".to_owned()
        } else {
            format!("{} of {}", sum.raw_wrong, sum.raw_cases)
        },
    ]
}

/// Errors below this are drawn as 0, in parts of the size: a hundredth of the rounding error of f64.
const NOTHING: f64 = 1e-18;

fn drawn(error: f64) -> f64 {
    if error < NOTHING { 0.0 } else { error }
}

/// The plot of a family, by parameter: the greatest and the median error of all kinds, the widest interval, and parry's
/// greatest error.
fn plot(found: &Found) -> String {
    let mut values: Vec<f64> = found.points.iter().map(|point| point.value).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let at = |value: f64| {
        let alike = move |x: f64| x.total_cmp(&value).is_eq();
        found.points.iter().filter(move |point| alike(point.value))
    };
    let series = |name: &str, colour, dashed, of: &dyn Fn(f64) -> Option<f64>| Series {
        name: name.to_owned(),
        colour,
        dashed,
        points: values
            .iter()
            .filter_map(|&value| Some((value, drawn(of(value)?))))
            .collect(),
    };
    let greatest = |value| at(value).filter_map(|point| point.error).reduce(f64::max);
    let middle = |value| {
        let mut all: Vec<f64> = at(value).filter_map(|point| point.error).collect();
        all.sort_by(f64::total_cmp);
        crate::report::stats::quantile(&all, 0.5)
    };
    let widest = |value| at(value).filter_map(|point| point.width).reduce(f64::max);
    let parry = |value| {
        at(value)
            .filter_map(|point| point.raw_error)
            .reduce(f64::max)
    };
    let mut all = vec![
        series("greatest error", 0, false, &greatest),
        series("middle error", 5, true, &middle),
        series("widest interval", 2, false, &widest),
        series("plain parry, greatest error", 1, true, &parry),
    ];
    all.retain(|series| !series.points.is_empty());
    let mut tolerances: Vec<f64> = found.points.iter().map(|point| point.tolerance).collect();
    tolerances.sort_by(f64::total_cmp);
    tolerances.dedup();
    let several = tolerances.len() > 1;
    let label = |tolerance: f64| match several && tolerance > 1e-9 {
        true => format!("tolerance {tolerance:.0e} (cylinders, cones)"),
        false => format!("tolerance {tolerance:.0e}"),
    };
    let plot = Plot {
        x: Axis {
            label: found.parameter.to_owned(),
            log: true,
        },
        y: Axis {
            label: "error, in parts of the size".to_owned(),
            log: true,
        },
        series: all,
        levels: tolerances.into_iter().map(|t| (t, label(t))).collect(),
    };
    figure(found.family, found.about, &plot.svg())
}
