//! Files that commands write. In: a path of a user. Out: an open file, or why there is none.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

use crate::error::{Error, Result};

/// Opens a new file; one that is there is somebody's work.
///
/// * `over` - whether one that is there is written over.
/// * `what` - it is for, in words.
///
/// # Errors
/// `Error::Refused` when it is there, `Error::Io` when it cannot be opened.
pub(super) fn open_new(path: &Path, over: bool, what: &str) -> Result<File> {
    let mut how = File::options();
    how.write(true)
        .create(over)
        .create_new(!over)
        .truncate(true);
    how.open(path).map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => Error::Refused(format!(
            "{} is there already: name another file, or write over it with --force",
            path.display()
        )),
        _ => Error::io(
            format!(
                "cannot open {} for {what}; give a file in a folder that exists and that you may write to",
                path.display()
            ),
            e,
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_there_is_not_written_over_unless_asked_for() {
        let path = std::env::temp_dir().join(format!("sweepd_new_{}", std::process::id()));
        std::fs::write(&path, b"mine").unwrap();
        let error = open_new(&path, false, "a test").unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("--force"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"mine");
        open_new(&path, true, "a test").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
        std::fs::remove_file(&path).unwrap();
    }
}
