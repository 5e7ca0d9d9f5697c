//! `sweepd report error`: error against run time, one line per budget.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::args_report::ErrorArgs;
use crate::cli::files::{check_inputs, inputs};
use crate::cli::out::Out;
use crate::cli::values::Limit;
use crate::daemon::build_shapes;
use crate::error::{Error, Result, counted};
use crate::report::error::columns::{Column, columns};
use crate::report::error::page::{html, summary};
use crate::report::error::{Report, Setup, Sweep, run};
use crate::scene::Scene;

use super::{Page, stopped};
use crate::cli::progress::Progress;

/// Most budgets in one sweep: each has its own engine.
const BUDGETS_MAX: usize = 64;

/// Runs the sweep; `false` if a verdict is wrong or an interval excludes the truth.
pub(super) fn error(args: &ErrorArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    args.course.check()?;
    let sweep = sweep(args)?;
    let scene = Scene::load(&args.scene)?;
    if let Some(html) = &args.html {
        check_inputs("--html", html, &inputs(&args.scene, &scene))?;
    }
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
    // Written before the table: the reader of standard output may be gone.
    if let Some(page) = page {
        page.write(&html(&report, &scene))?;
    }
    let told = tell(args, &report, &scene, out);
    out.or_closed(told)?;
    Ok(!report.is_wrong())
}

fn tell(args: &ErrorArgs, report: &Report, scene: &str, out: &mut Out) -> Result<()> {
    if args.json {
        let mut value = serde_json::to_value(report)
            .map_err(|e| Error::io("cannot write the report as JSON", e))?;
        value["scene"] = scene.into();
        value["motion"] = format!("{:?}", args.course.motion).to_lowercase().into();
        value["summary"] = summary(report).into();
        out.line(&value.to_string())?;
    } else {
        table(report, scene, out)?;
    }
    out.flush()
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
        "{scene}: {} (median diameter {:.3} m), {} moving; pairs: {:.0}; {} at {} Hz, seed {}",
        counted(report.bodies, "body", "bodies"),
        report.size_m,
        report.moving,
        report.pairs,
        counted(report.ticks, "tick", "ticks"),
        report.rate_hz,
        report.seed
    ))?;
    let line = |cell: &dyn Fn(&Column) -> String| {
        let cells: Vec<String> = columns(report)
            .map(|column| format!("{:>1$}", cell(column), column.width))
            .collect();
        cells.join(" ")
    };
    out.line(&line(&|column| column.name.to_owned()))?;
    out.line(&line(&|column| column.unit.to_owned()))?;
    for row in &report.rows {
        out.line(&line(&|column| (column.cell)(row)))?;
    }
    out.line(&summary(report))?;
    out.line(&format!(
        "against a twin without a budget: {} wrong, {} the truth",
        counted(report.wrong, "verdict is", "verdicts are"),
        counted(report.excluded, "interval excludes", "intervals exclude")
    ))
}
