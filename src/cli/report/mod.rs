//! `sweepd report`: what the library finds out, in tables, as JSON and as pages of HTML.

mod error;
mod stability;

use std::ffi::OsString;
use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
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
///
/// It is written beside its place and put there whole: one that is there stays until then, also where the disk fills.
struct Page {
    /// Its place, where links lead to.
    path: PathBuf,
    file: File,
    /// Where it is written meanwhile; `None`: in its place, which is no file of its own (`/dev/stdout`), or in a folder
    /// in which nothing can be made.
    beside: Option<PathBuf>,
}

impl Page {
    fn open(path: &Path) -> Result<Self> {
        Self::try_open(path).map_err(|e| {
            Error::Usage(format!(
                "--html {}: {e}; give a file in a folder that exists and that you may write to",
                path.display()
            ))
        })
    }

    fn try_open(path: &Path) -> std::io::Result<Self> {
        let there = match File::options().write(true).open(path) {
            Ok(file) => Some(file),
            Err(e) if e.kind() == ErrorKind::NotFound => None,
            Err(e) => return Err(e),
        };
        let (path, is_file) = match &there {
            Some(file) => (path.canonicalize()?, file.metadata()?.is_file()),
            None => (path.to_owned(), true),
        };
        let mut name = OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(format!(".{}.part", std::process::id()));
        let beside = path.with_file_name(name);
        let made = if is_file {
            File::create(&beside)
        } else {
            Err(ErrorKind::Unsupported.into())
        };
        let (file, beside) = match (made, there) {
            (Ok(file), _) => (file, Some(beside)),
            (Err(_), Some(file)) => (file, None),
            (Err(e), None) => return Err(e),
        };
        Ok(Self { path, file, beside })
    }

    fn write(mut self, text: &str) -> Result<()> {
        self.try_write(text)
            .map_err(|e| Error::io(format!("cannot write {}", self.path.display()), e))?;
        tracing::info!("wrote {}", self.path.display());
        Ok(())
    }

    fn try_write(&mut self, text: &str) -> std::io::Result<()> {
        let Some(beside) = &self.beside else {
            if self.file.metadata()?.is_file() {
                self.file.set_len(0)?;
            }
            return self.file.write_all(text.as_bytes());
        };
        self.file.write_all(text.as_bytes())?;
        if let Ok(old) = std::fs::metadata(&self.path) {
            self.file.set_permissions(old.permissions())?;
        }
        std::fs::rename(beside, &self.path)?;
        self.beside = None;
        Ok(())
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        if let Some(beside) = &self.beside {
            // That it was not written is told by whoever ends for it.
            let _ = std::fs::remove_file(beside);
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

    /// A full disk, or a signal, left a page of 0 bytes, or a part of one.
    #[test]
    fn bug_a_page_that_is_not_written_is_taken_away_and_one_that_was_there_stays() {
        let folder = std::env::temp_dir().join(format!("sweepd_page_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("page.html");
        let left = || std::fs::read_dir(&folder).unwrap().count();
        drop(Page::open(&path).unwrap());
        assert_eq!(left(), 0);
        Page::open(&path).unwrap().write("old").unwrap();
        let mut page = Page::open(&path).unwrap();
        // As on a full disk: what is open for reading takes no bytes.
        page.file = File::open(&path).unwrap();
        assert!(page.write("text").is_err());
        assert_eq!(
            (left(), std::fs::read_to_string(&path).unwrap()),
            (1, "old".into())
        );
        let page = Page::open(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        page.write("new").unwrap();
        assert_eq!(
            (left(), std::fs::read_to_string(&path).unwrap()),
            (1, "new".into())
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_page_for_what_is_no_file_is_written_there() {
        let page = Page::open(Path::new("/dev/null")).unwrap();
        assert!(page.beside.is_none());
        page.write("text").unwrap();
        assert!(Page::open(Path::new("/nowhere/at/all.html")).is_err());
    }
}
