//! Files that commands write. In: a path from the user. Out: an open file, or the reason why there is none. No command
//! overwrites a file that it reads.

mod draft;

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::scene::Scene;

pub(super) use draft::Draft;

/// A file that a command reads: its role in words, and its path.
pub(super) type Input = (&'static str, PathBuf);

/// The files that a scene is read from.
pub(super) fn inputs(path: &Path, scene: &Scene) -> Vec<Input> {
    let meshes = scene.mesh_files().into_iter();
    std::iter::once(("the scene file", path.to_owned()))
        .chain(meshes.map(|mesh| ("a mesh file of the scene", mesh)))
        .collect()
}

/// Refuses to overwrite a file that is read, also by another spelling, a symbolic link or a hard link.
///
/// * `flag` - the flag that names the file `to`.
///
/// # Errors
/// `Error::Usage` with both paths.
pub(super) fn check_inputs(flag: &str, to: &Path, inputs: &[Input]) -> Result<()> {
    let there = place(to);
    let is_same = |(_, path): &&Input| there.is_some() && place(path) == there;
    match inputs.iter().find(is_same) {
        None => Ok(()),
        Some((what, path)) => Err(Error::Usage(format!(
            "{flag} {}: this is {what} {}, which would be written over; name another file",
            to.display(),
            path.display()
        ))),
    }
}

/// Device and inode of a file; `None`: there is no file, or it keeps no content (a device, a pipe).
fn place(path: &Path) -> Option<(u64, u64)> {
    let meta = std::fs::metadata(path).ok()?;
    meta.is_file().then(|| (meta.dev(), meta.ino()))
}

/// Opens a new file for a recording; an existing one may be somebody's work. The file is locked until it is closed, so
/// that no other of these commands writes to it.
///
/// * `over` - whether an existing file is overwritten.
/// * `what` - purpose of the file, in words.
///
/// # Errors
/// `Error::Refused` if the file exists without `over`, is being written, or is not a regular file (a folder, a pipe, a
/// device); `Error::Io` if it cannot be opened.
#[cfg_attr(
    not(feature = "mcap"),
    allow(dead_code, reason = "this build does not record")
)]
pub(super) fn open_new(path: &Path, over: bool, what: &str) -> Result<File> {
    // Checked before the open, which would block until a pipe has a reader.
    if let Ok(there) = std::fs::metadata(path)
        && !there.is_file()
    {
        let kind = if there.is_dir() {
            "a folder"
        } else {
            "no file but a pipe or a device"
        };
        return Err(Error::Refused(format!(
            "{} is {kind}, and {what} needs a file of its own: name one, such as run.mcap",
            path.display()
        )));
    }
    let failed = |e| unopened(path, what, e);
    let mut how = File::options();
    // Truncated only after the lock shows that no other process writes it.
    how.write(true)
        .create(over)
        .create_new(!over)
        .truncate(false);
    let file = how.open(path).map_err(|e| match e.kind() {
        ErrorKind::AlreadyExists => is_there(path),
        _ => failed(e),
    })?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Error::Refused(format!(
            "{} is being written by another process: name another file, or end that one first",
            path.display()
        ))),
        // Some file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => {
            file.set_len(0).map_err(failed)?;
            Ok(file)
        }
    }
}

/// The refusal to overwrite an existing file.
fn is_there(path: &Path) -> Error {
    Error::Refused(format!(
        "{} exists: name another file, or overwrite it with --force",
        path.display()
    ))
}

fn unopened(path: &Path, what: &str, e: std::io::Error) -> Error {
    let mend = "give a file in a folder that exists and that you may write to";
    Error::io(
        format!("cannot open {} for {what}; {mend}", path.display()),
        e,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_what_is_read_was_written_over_under_any_of_its_names() {
        let folder = std::env::temp_dir().join(format!("sweepd_inputs_{}", std::process::id()));
        std::fs::create_dir_all(folder.join("in")).unwrap();
        let at = |name: &str| folder.join(name);
        for name in ["scene.toml", "mesh.stl", "other"] {
            std::fs::write(at(name), name).unwrap();
        }
        std::os::unix::fs::symlink("../scene.toml", at("in/symbolic")).unwrap();
        std::fs::hard_link(at("scene.toml"), at("hard")).unwrap();
        let read = [
            ("the scene file", at("scene.toml")),
            ("a mesh file of the scene", at("mesh.stl")),
            ("a file that is gone", at("gone")),
        ];
        for (name, what) in [
            ("scene.toml", "the scene file"),
            ("in/../scene.toml", "the scene file"),
            ("in/symbolic", "the scene file"),
            ("hard", "the scene file"),
            ("mesh.stl", "a mesh file"),
        ] {
            let error = check_inputs("--record", &at(name), &read).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            let text = error.to_string();
            let begin = format!("--record {}: this is {what}", at(name).display());
            assert!(text.starts_with(&begin), "{text}");
        }
        for name in ["other", "new", "gone"] {
            check_inputs("--record", &at(name), &read).unwrap();
        }
        // A device keeps no content, so nothing is lost.
        let null = [("the scene file", PathBuf::from("/dev/null"))];
        check_inputs("--record", Path::new("/dev/null"), &null).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_that_is_there_is_not_written_over_unless_asked_for() {
        let path = std::env::temp_dir().join(format!("sweepd_new_{}", std::process::id()));
        std::fs::write(&path, b"mine").unwrap();
        let error = open_new(&path, false, "a test").unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("--force"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"mine");
        let held = open_new(&path, true, "a test").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
        std::fs::write(&path, b"theirs").unwrap();
        let error = open_new(&path, true, "a test").unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("another process"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"theirs");
        drop(held);
        open_new(&path, true, "a test").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn bug_a_recording_into_a_folder_or_a_pipe_was_refused_for_another_reason() {
        for (path, word) in [("/tmp", "is a folder"), ("/dev/null", "a device")] {
            for over in [false, true] {
                let error = open_new(Path::new(path), over, "a recording").unwrap_err();
                assert_eq!(error.exit_code(), 4);
                let text = error.to_string();
                assert!(text.contains(word) && !text.contains("--force"), "{text}");
            }
        }
    }
}
