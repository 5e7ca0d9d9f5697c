//! `sweepd report`: prints the reports of the library as tables, as JSON and as HTML pages.

mod error;
mod stability;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::error::{Error, Result};

use super::args::ReportArgs;
use super::args_report::Report;
use super::files::Draft;
use super::out::Out;

/// Runs a report; `false` if it found something wrong.
pub(super) fn report(args: &ReportArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    match &args.report {
        Report::Error(args) => error::error(args, out, stop),
        Report::Stability(args) => stability::stability(args, out, stop),
    }
}

/// A page that is written at the end of a report.
struct Page(Draft);

impl Page {
    fn open(path: &Path) -> Result<Self> {
        Draft::open(path, true, "a page").map(Self)
    }

    fn write(self, text: &str) -> Result<()> {
        let name = self.0.path().display().to_string();
        self.0.write(text)?;
        tracing::info!("wrote {name}");
        Ok(())
    }
}

/// The error of a report that a signal stopped.
fn stopped() -> Error {
    Error::Refused("stopped by a signal before the report was done; there is no result".to_owned())
}
