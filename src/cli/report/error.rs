//! `sweepd report error`: error against run time, a line a budget.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::args::Limit;
use crate::cli::args_report::ErrorArgs;
use crate::cli::out::Out;
use crate::daemon::build_shapes;
use crate::error::{Error, Result};
use crate::report::error::page::{html, name, summary};
use crate::report::error::tally::Row;
use crate::report::error::{Report, Setup, Sweep, run};
use crate::scene::Scene;

use super::{Page, stopped};
use crate::cli::progress::Progress;

/// Budgets in one sweep at most: each has an engine of its own.
const BUDGETS_MAX: usize = 64;

/// Runs the sweep; `false` when a verdict is wrong or an interval excludes the truth.
pub(super) fn error(args: &ErrorArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    args.course.check()?;
    let sweep = sweep(args)?;
    let scene = Scene::load(&args.scene)?;
    let shapes = build_shapes(&scene)?;
    let page = args.html.as_deref().map(Page::open).transpose()?;
    let setup = Setup {
        scene: &scene,
        shapes: &shapes.bodies,
        motion: args.course.motion,
        rate_hz: args.course.rate,
        seed: args.course.seed,
        count: args.count,
        ticks: args.ticks,
        sweep,
    };
    let mut progress = Progress::new();
    let report = run(&setup, |done, all| {
        progress.tell(done, all, "ticks");
        !stop.load(Ordering::Relaxed)
    })?
    .ok_or_else(stopped)?;
    drop(progress);
    let scene = args.scene.display().to_string();
    if args.json {
        let mut value = serde_json::to_value(&report)
            .map_err(|e| Error::io("cannot write the report as JSON", e))?;
        value["scene"] = scene.as_str().into();
        value["motion"] = format!("{:?}", args.course.motion).to_lowercase().into();
        value["summary"] = summary(&report).into();
        out.line(&value.to_string())?;
    } else {
        table(&report, &scene, out)?;
    }
    if let Some(page) = page {
        page.write(&html(&report, &scene))?;
    }
    out.flush()?;
    Ok(!report.is_wrong())
}

fn sweep(args: &ErrorArgs) -> Result<Sweep> {
    let limits = |limits: &[Limit]| {
        if limits.len() > BUDGETS_MAX {
            return Err(Error::Usage(format!(
                "{} budgets: give {BUDGETS_MAX} at most, each has an engine of its own",
                limits.len()
            )));
        }
        let of = |limit: &Limit| match limit {
            Limit::None => None,
            Limit::Of(value) => Some(*value),
        };
        Ok(limits.iter().map(of).collect())
    };
    match &args.units {
        Some(units) => limits(units).map(Sweep::Units),
        None => limits(&args.budgets).map(Sweep::Time),
    }
}

fn table(report: &Report, scene: &str, out: &mut Out) -> Result<()> {
    out.line(&format!(
        "{scene}: {} bodies (median diameter {:.3} m), {} moving; {:.0} pairs; {} ticks at {} Hz, seed {}",
        report.bodies,
        report.size_m,
        report.moving,
        report.pairs,
        report.ticks,
        report.rate_hz,
        report.seed
    ))?;
    let timed = report.limited == "time";
    let mut head = format!(
        "{:>13} {:>9} {:>7} {:>10} {:>10} {:>7} {:>9} {:>9}",
        "budget", "undecided", "guessed", "width", "p99", "oldest", "onset", "never"
    );
    let mut units = format!(
        "{:>13} {:>9} {:>7} {:>10} {:>10} {:>7} {:>9} {:>9}",
        "", "%", "wrong %", "m", "m", "ticks", "p50/p99", "told"
    );
    if timed {
        head += &format!(
            " {:>15} {:>8} {:>13} {:>6}",
            "time", "floor", "over", "late"
        );
        units += &format!(
            " {:>15} {:>8} {:>13} {:>6}",
            "p50/p99 us", "p50 us", "p50/p99 us", "%"
        );
    }
    out.line(&format!(
        "{head} {:>9} {:>6} {:>8}",
        "units", "wrong", "excluded"
    ))?;
    out.line(&format!("{units} {:>9} {:>6} {:>8}", "a tick", "", ""))?;
    for row in &report.rows {
        out.line(&line(row, timed))?;
    }
    out.line(&summary(report))?;
    out.line(&format!(
        "against a twin without a budget: {} verdicts are wrong, {} intervals exclude the truth",
        report.wrong, report.excluded
    ))
}

fn line(row: &Row, timed: bool) -> String {
    let metres = |m: Option<f64>| m.map_or_else(|| "-".to_owned(), |m| format!("{m:.2e}"));
    let both = |a: Option<u64>, b: Option<u64>| match (a, b) {
        (Some(a), Some(b)) => format!("{a}/{b}"),
        _ => "-".to_owned(),
    };
    let micro = |ns: Option<u64>| ns.map(|ns| (ns + 500) / 1_000);
    let mut line = format!(
        "{:>13} {:>9.2} {:>7.2} {:>10} {:>10} {:>7} {:>9} {:>9}",
        name(row),
        100.0 * row.undecided_share,
        100.0 * row.guess_error_share,
        metres(row.width_mean_m),
        metres(row.width_p99_m),
        row.oldest_ticks,
        both(row.onset_p50_ticks, row.onset_p99_ticks),
        format!("{}/{}", row.onsets_never, row.onsets),
    );
    if timed {
        line += &format!(
            " {:>15} {:>8} {:>13} {:>6}",
            both(micro(row.time_p50_ns), micro(row.time_p99_ns)),
            micro(row.floor_p50_ns).map_or_else(|| "-".to_owned(), |us| us.to_string()),
            both(micro(row.over_p50_ns), micro(row.over_p99_ns)),
            row.late_share
                .map_or_else(|| "-".to_owned(), |share| format!("{:.1}", 100.0 * share)),
        );
    }
    line + &format!(
        " {:>9.0} {:>6} {:>8}",
        row.units_mean, row.wrong, row.excluded
    )
}
