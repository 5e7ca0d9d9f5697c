//! Files that are written completely or not at all. In: a path, and later the content. Out: the file at its path.

use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Result as IoResult, Write as _};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A file that a command writes at its end. It is opened at the start, so that a refusal does not come after minutes of
/// work.
///
/// The content goes to a temporary file in the same folder, which is then renamed: an existing file stays until then,
/// even if the disk fills up.
pub(in crate::cli) struct Draft {
    /// Final path of the file, with links to an existing file resolved.
    path: PathBuf,
    file: File,
    /// Path of the temporary file; `None`: the content goes straight to `path`, because that is not a regular file
    /// (`/dev/stdout`), or because no file can be created in its folder.
    beside: Option<PathBuf>,
}

impl Draft {
    /// Opens the file.
    ///
    /// * `over` - whether an existing file is overwritten.
    /// * `what` - purpose of the file, in words.
    ///
    /// # Errors
    /// `Error::Refused` if the file exists without `over`; `Error::Io` if it cannot be written, or if another process
    /// is writing it.
    pub(in crate::cli) fn open(path: &Path, over: bool, what: &str) -> Result<Self> {
        if !over && path.symlink_metadata().is_ok() {
            return Err(super::is_there(path));
        }
        Self::try_open(path).map_err(|e| super::unopened(path, what, e))
    }

    /// Writes the content and moves the file to its final path.
    ///
    /// # Errors
    /// `Error::Io` if it cannot be written.
    pub(in crate::cli) fn write(mut self, text: &str) -> Result<()> {
        self.try_write(text)
            .map_err(|e| Error::io(format!("cannot write {}", self.path.display()), e))
    }

    /// Writes a file in one call; overwrites an existing one.
    pub(in crate::cli) fn put(path: &Path, text: &str) -> IoResult<()> {
        Self::try_open(path)?.try_write(text)
    }

    /// Final path of the file.
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
            // Through a link to a file that does not exist the file is made, and the link stays.
            None if path.is_symlink() => return Self::in_place(path),
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
            create_beside(&beside)
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

    /// Creates the file at its final path.
    fn in_place(path: &Path) -> IoResult<Self> {
        let file = File::create(path)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            beside: None,
        })
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

/// Creates a new file. An existing one of this name was left by a killed process with the same number; it is removed,
/// since it could be a link to another file.
fn create_beside(path: &Path) -> IoResult<File> {
    match File::create_new(path) {
        Err(e) if e.kind() == ErrorKind::AlreadyExists => {
            std::fs::remove_file(path)?;
            File::create_new(path)
        }
        made => made,
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if let Some(beside) = &self.beside {
            // The caller reports why the file was not written.
            let _ = std::fs::remove_file(beside);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk or a signal left an empty or partial page. `feed --write-scene --force` lost the old scene this way,
    /// and without --force the next try was refused.
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
        // As on a full disk: a file opened for reading takes no bytes.
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
        // A link in the place of the temporary file is not followed.
        let elsewhere = folder.join("elsewhere");
        std::fs::write(&elsewhere, "kept").unwrap();
        let beside = folder.join(format!(".page.html.{}.part", std::process::id()));
        std::os::unix::fs::symlink(&elsewhere, &beside).unwrap();
        open(true).unwrap().write("newer").unwrap();
        assert_eq!(std::fs::read_to_string(&elsewhere).unwrap(), "kept");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "newer");
        // A link to a file that does not exist yet stays a link.
        let (link, far) = (folder.join("link"), folder.join("far"));
        std::os::unix::fs::symlink(&far, &link).unwrap();
        Draft::open(&link, true, "a test")
            .unwrap()
            .write("far")
            .unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read_to_string(&far).unwrap(), "far");
        // Another process that is writing the file, such as a recorder, is not disturbed.
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
