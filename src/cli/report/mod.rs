//! `sweepd report`: what the library finds out, in tables, as JSON and as pages of HTML.

mod error;
mod stability;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::error::{Error, Result};

use super::args::ReportArgs;
use super::args_report::Report;
use super::out::Out;

/// Runs a report; `false` when it found something wrong.
pub(super) fn report(args: &ReportArgs, out: &mut Out, stop: &AtomicBool) -> Result<bool> {
    match &args.report {
        Report::Error(args) => error::error(args, out, stop),
        Report::Stability(args) => stability::stability(args, out, stop),
    }
}

/// A page to be written when all is done. It is opened before, so that nobody waits minutes for a refusal.
struct Page<'a> {
    path: &'a Path,
    file: std::fs::File,
}

impl<'a> Page<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        // A page that is there stays until the new one is whole.
        let mut how = std::fs::OpenOptions::new();
        let file = how.write(true).create(true).truncate(false).open(path);
        let file = file.map_err(|e| {
            Error::Usage(format!(
                "--html {}: {e}; give a file in a folder that exists and that you may write to",
                path.display()
            ))
        })?;
        Ok(Self { path, file })
    }

    fn write(mut self, text: &str) -> Result<()> {
        let emptied = self.file.set_len(0);
        emptied
            .and_then(|()| std::io::Write::write_all(&mut self.file, text.as_bytes()))
            .map_err(|e| Error::io(format!("cannot write {}", self.path.display()), e))?;
        tracing::info!("wrote {}", self.path.display());
        Ok(())
    }
}

/// What a report that was stopped by a signal ends with.
fn stopped() -> Error {
    Error::Refused("stopped by a signal before the report was done; nothing was told".to_owned())
}
