//! Files that are there whole or not at all. In: a path, and the bytes once they are known. Out: the file in its place.

use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Result as IoResult, Write as _};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A file to be written when all is done. It is opened before, so that nobody waits minutes for a refusal.
///
/// It is written beside its place and put there whole: one that is there stays until then, also where the disk fills.
pub(in crate::cli) struct Draft {
    /// Its place, where links lead to.
    path: PathBuf,
    file: File,
    /// Where it is written meanwhile; `None`: in its place, which is no file of its own (`/dev/stdout`), or in a folder
    /// in which nothing can be made.
    beside: Option<PathBuf>,
}

impl Draft {
    /// Opens it.
    ///
    /// * `over` - whether one that is there is written over.
    /// * `what` - it is for, in words.
    ///
    /// # Errors
    /// `Error::Refused` when it is there, `Error::Io` when it cannot be written, or another process is writing it.
    pub(in crate::cli) fn open(path: &Path, over: bool, what: &str) -> Result<Self> {
        if !over && path.symlink_metadata().is_ok() {
            return Err(super::is_there(path));
        }
        Self::try_open(path).map_err(|e| super::unopened(path, what, e))
    }

    /// Writes it and puts it into its place.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be written.
    pub(in crate::cli) fn write(mut self, text: &str) -> Result<()> {
        self.try_write(text)
            .map_err(|e| Error::io(format!("cannot write {}", self.path.display()), e))
    }

    /// Writes a file in one go, over one that is there.
    pub(in crate::cli) fn put(path: &Path, text: &str) -> IoResult<()> {
        Self::try_open(path)?.try_write(text)
    }

    /// Where it will be.
    pub(in crate::cli) fn path(&self) -> &Path {
        &self.path
    }

    fn try_open(path: &Path) -> IoResult<Self> {
        let there = match File::options().write(true).open(path) {
            Ok(file) => Some(file),
            Err(e) if e.kind() == ErrorKind::NotFound => None,
            Err(e) => return Err(e),
        };
        let (path, is_file) = match &there {
            Some(file) => (path.canonicalize()?, file.metadata()?.is_file()),
            None => (path.to_owned(), true),
        };
        if let Some(Err(TryLockError::WouldBlock)) =
            there.as_ref().filter(|_| is_file).map(File::try_lock)
        {
            return Err(std::io::Error::other("another process is writing it"));
        }
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

    fn try_write(&mut self, text: &str) -> IoResult<()> {
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

impl Drop for Draft {
    fn drop(&mut self) {
        if let Some(beside) = &self.beside {
            // That it was not written is told by whoever ends for it.
            let _ = std::fs::remove_file(beside);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk, or a signal, left a page of 0 bytes, or a part of one; `feed --write-scene --force` lost the old
    /// scene by it, and without --force the next try was refused.
    #[test]
    fn bug_a_file_that_is_not_written_is_taken_away_and_one_that_was_there_stays() {
        let folder = std::env::temp_dir().join(format!("sweepd_draft_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("page.html");
        let left = || std::fs::read_dir(&folder).unwrap().count();
        let open = |over| Draft::open(&path, over, "a test");
        drop(open(false).unwrap());
        assert_eq!(left(), 0);
        open(false).unwrap().write("old").unwrap();
        let refused = open(false).map(|_| ()).unwrap_err();
        assert_eq!(refused.exit_code(), 4);
        assert!(refused.to_string().contains("--force"), "{refused}");
        let mut draft = open(true).unwrap();
        // As on a full disk: what is open for reading takes no bytes.
        draft.file = File::open(&path).unwrap();
        assert!(draft.write("text").is_err());
        assert_eq!(
            (left(), std::fs::read_to_string(&path).unwrap()),
            (1, "old".into())
        );
        let draft = open(true).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        draft.write("new").unwrap();
        assert_eq!(
            (left(), std::fs::read_to_string(&path).unwrap()),
            (1, "new".into())
        );
        // Another process that writes it, such as a recorder, goes on.
        let held = File::options().write(true).open(&path).unwrap();
        held.try_lock().unwrap();
        let busy = open(true).map(|_| ()).unwrap_err();
        assert!(busy.with_causes().contains("another process"), "{busy}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_is_no_file_is_written_there_and_what_cannot_be_is_refused_with_code_4() {
        let draft = Draft::open(Path::new("/dev/null"), true, "a page").unwrap();
        assert!(draft.beside.is_none());
        draft.write("text").unwrap();
        let nowhere = Draft::open(Path::new("/nowhere/at/all.html"), true, "a page");
        assert_eq!(nowhere.map(|_| ()).unwrap_err().exit_code(), 4);
    }
}
