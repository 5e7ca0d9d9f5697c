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
    /// Whether it is to be taken away again: it was not there before, and is not written.
    in_vain: bool,
}

impl<'a> Page<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        // A page that is there stays until the new one is whole.
        let mut how = std::fs::OpenOptions::new();
        how.write(true).truncate(false);
        let made = how.clone().create_new(true).open(path);
        let in_vain = made.is_ok();
        let file = made.or_else(|_| how.create(true).open(path));
        let file = file.map_err(|e| {
            Error::Usage(format!(
                "--html {}: {e}; give a file in a folder that exists and that you may write to",
                path.display()
            ))
        })?;
        Ok(Self {
            path,
            file,
            in_vain,
        })
    }

    fn write(mut self, text: &str) -> Result<()> {
        let emptied = self.file.set_len(0);
        emptied
            .and_then(|()| std::io::Write::write_all(&mut self.file, text.as_bytes()))
            .map_err(|e| Error::io(format!("cannot write {}", self.path.display()), e))?;
        self.in_vain = false;
        tracing::info!("wrote {}", self.path.display());
        Ok(())
    }
}

impl Drop for Page<'_> {
    fn drop(&mut self) {
        if self.in_vain {
            // That it was not written is told by whoever ends for it.
            let _ = std::fs::remove_file(self.path);
        }
    }
}

/// What a report that was stopped by a signal ends with.
fn stopped() -> Error {
    Error::Refused("stopped by a signal before the report was done; nothing was told".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk, or a signal, left a page of 0 bytes.
    #[test]
    fn bug_a_page_that_is_not_written_is_taken_away_and_one_that_was_there_stays() {
        let path = std::env::temp_dir().join(format!("sweepd_page_{}", std::process::id()));
        let page = Page::open(&path).unwrap();
        assert!(path.exists());
        drop(page);
        assert!(!path.exists());
        let mut page = Page::open(&path).unwrap();
        // As on a full disk: what is open for reading takes no bytes.
        page.file = std::fs::File::open(&path).unwrap();
        assert!(page.write("text").is_err() && !path.exists());
        Page::open(&path).unwrap().write("text").unwrap();
        drop(Page::open(&path).unwrap());
        let kept = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(kept, "text");
    }
}
