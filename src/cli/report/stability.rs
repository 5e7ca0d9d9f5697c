//! `sweepd report stability`: stiff and extreme cases, one line per family.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::args_report::StabilityArgs;
use crate::cli::figures::time;
use crate::cli::out::Out;
use crate::error::{Error, Result, counted};
use crate::report::stability::families::{FAMILIES, Family, named};
use crate::report::stability::{Found, Report, page, run};

use super::{Page, stopped};
use crate::cli::progress::Progress;

/// Runs the requested families, or lists them; `false` if something is wrong.
pub(super) fn stability(args: &StabilityArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    if args.list {
        return list(args.json, out);
    }
    let families = chosen(&args.family)?;
    let page = args.html.as_deref().map(Page::open).transpose()?;
    let mut progress = Progress::new();
    let report = run(&families, |done, all, family| {
        progress.tell(done, all, family);
        !stop.load(Ordering::Relaxed)
    })?
    .ok_or_else(stopped)?;
    drop(progress);
    // Written before the table: the reader of standard output may be gone.
    if let Some(page) = page {
        page.write(&page::html(&report))?;
    }
    let told = tell(args.json, &report, out);
    out.or_closed(told)?;
    Ok(!report.is_wrong())
}

fn tell(json: bool, report: &Report, out: &mut Out) -> Result<()> {
    if json {
        let text = serde_json::to_string(report)
            .map_err(|e| Error::io("cannot write the report as JSON", e))?;
        out.line(&text)?;
    } else {
        table(report, out)?;
    }
    out.flush()
}

fn list(json: bool, out: &mut Out) -> Result<bool> {
    for family in FAMILIES {
        if json {
            let line = serde_json::json!({
                "family": family.name, "about": family.about, "parameter": family.parameter,
            });
            out.line(&line.to_string())?;
        } else {
            out.line(&format!("{:<14} {}", family.name, family.about))?;
            out.line(&format!("{:<14}   along: {}", "", family.parameter))?;
        }
    }
    out.flush()?;
    Ok(true)
}

/// The families with these names, each once, in the report's order; all families if no name is given.
fn chosen(names: &[String]) -> Result<Vec<&'static Family>> {
    if let Some(unknown) = names.iter().find(|name| named(name).is_none()) {
        let all: Vec<_> = FAMILIES.iter().map(|family| family.name).collect();
        return Err(Error::Usage(format!(
            "--family {unknown}: there is no such family; there are: {} (`sweepd report stability --list` says what \
             they are)",
            all.join(", ")
        )));
    }
    let asked = |family: &&Family| names.is_empty() || names.iter().any(|n| n == family.name);
    Ok(FAMILIES.iter().filter(asked).collect())
}

fn table(report: &Report, out: &mut Out) -> Result<()> {
    out.line(
        "family          cases  answers  worst error  tolerance  beyond  excluded  wrong  slowest     parry's  its wrong",
    )?;
    for found in &report.families {
        out.line(&line(found))?;
    }
    out.line("")?;
    for found in &report.families {
        if let Some(where_at) = worst(found) {
            out.line(&where_at)?;
        }
    }
    let cases: u64 = report.families.iter().map(|f| f.summary.cases).sum();
    let answers: u64 = report.families.iter().map(|f| f.summary.answers).sum();
    out.line("")?;
    out.line(
        "Errors are those of the best estimate, or of the interval's farther end where there is none, in parts of the pair's \
         size. Truth: twice the precision, no code of the engine.",
    )?;
    out.line(&format!(
        "{}, {}: {} the truth, {} wrong",
        counted(cases, "case", "cases"),
        counted(answers, "answer", "answers"),
        counted(report.excluded, "interval excludes", "intervals exclude"),
        counted(report.wrong, "verdict is", "verdicts are")
    ))
}

fn line(found: &Found) -> String {
    let sum = &found.summary;
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"));
    format!(
        "{:<14} {:>6} {:>8} {:>12} {:>10} {:>7} {:>9} {:>6} {:>8} {:>11} {:>10}",
        found.family,
        sum.cases,
        sum.answers,
        number(sum.worst_error),
        number(sum.tolerance),
        sum.beyond,
        sum.excluded,
        sum.wrong,
        time(sum.slowest_ns),
        number(sum.raw_worst_error),
        if sum.raw_cases == 0 {
            "-".to_owned()
        } else {
            format!("{}/{}", sum.raw_wrong, sum.raw_cases)
        }
    )
}

/// Where the worst error of a family is, and notes on its answers.
fn worst(found: &Found) -> Option<String> {
    let sum = &found.summary;
    let mut text = format!("{:<14} ", found.family);
    let (kind, value) = sum.worst_kind.zip(sum.worst_value)?;
    text += &format!("worst: {kind} at {value:.3e} ({})", found.parameter);
    if sum.touching > 0 {
        text += &format!("; {} told as touching within rounding", sum.touching);
    }
    if sum.open > 0 {
        text += &format!("; {} left open within rounding", sum.open);
    }
    if sum.beyond_bounded > 0 {
        text += &format!(
            "; {} beyond the tolerance have a proved interval and no estimate, as what lies within a mesh has: its farther end \
             counts, and no answer is wrong",
            sum.beyond_bounded
        );
    }
    if sum.changes_true > 0 {
        text += &format!(
            "; {} verdict changes where the truth changes {} times",
            sum.changes, sum.changes_true
        );
    }
    Some(text)
}
