//! Two file locks. One in the shared memory directory allows one daemon per instance; one on iceoryx2's root keeps
//! cleaners of temporary files out of it. The kernel releases both when the process dies, however it dies.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};

use super::place::Place;
use crate::error::{Error, Result};

/// Directory of shared memory; a lock in it survives the removal of iceoryx2's root, after which a second daemon could
/// otherwise create a second set of services unnoticed.
pub(super) const LOCK_DIR: &str = "/dev/shm";
/// Number of retries when the file was removed between opening and locking, or another process is checking whether it
/// is held.
const TRIES_MAX: usize = 16;
/// How long to wait for such a check, which takes some microseconds.
const LOOK: Duration = Duration::from_millis(10);

/// Data that the holder of an instance writes into its lock, for people and for clients of another iceoryx2 version.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Its process id, in its own pid namespace.
    pub pid: u32,
    /// Random number of this start.
    pub boot_id: u64,
    /// The wire version it speaks.
    pub wire_version: u32,
    /// Its version.
    pub sweepd_version: String,
    /// The iceoryx2 it was built with.
    pub iceoryx2_version: String,
}

/// The lock file of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lock {
    /// The instance's name.
    pub instance: String,
    /// The file.
    pub path: PathBuf,
    /// Its holder; `None`: none, a killed daemon left the file.
    pub holder: Option<Holder>,
}

/// The only holder of an instance. The file is removed when it is dropped.
#[derive(Debug)]
pub(super) struct InstanceLock {
    file: File,
    path: PathBuf,
}

/// Fowler, Noll, Vo (FNV-1a), 64 bit: distinguishes roots and prefixes in the lock's name.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &b| {
        (hash ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The parts of a lock's name before and after the instance.
fn around(place: &Place) -> (String, String) {
    let uid = rustix::process::geteuid().as_raw();
    let files = format!("{}|{}", place.root().display(), place.prefix());
    let end = format!("_{:016x}.lock", fnv(files.as_bytes()));
    (format!("sweepd_{uid}_"), end)
}

fn lock_path(place: &Place) -> PathBuf {
    let (start, end) = around(place);
    Path::new(LOCK_DIR).join(format!("{start}{}{end}", place.instance()))
}

/// The locks of all instances under a place's files, by name; the place's own instance name does not matter.
///
/// # Errors
/// `Error::Io` when their directory cannot be read.
pub fn locks(place: &Place) -> Result<Vec<Lock>> {
    let (start, end) = around(place);
    let entries = std::fs::read_dir(LOCK_DIR)
        .map_err(|e| Error::io(format!("{LOCK_DIR} cannot be read"), e))?;
    let mut all = Vec::new();
    for entry in entries.flatten() {
        let file = entry.file_name().to_string_lossy().into_owned();
        let name = file.strip_prefix(&start).and_then(|s| s.strip_suffix(&end));
        if let Some(instance) = name.filter(|name| place.with_instance(name).is_ok()) {
            all.push(Lock {
                instance: instance.to_owned(),
                holder: holder_of(&entry.path()),
                path: entry.path(),
            });
        }
    }
    all.sort_by(|a, b| a.instance.cmp(&b.instance));
    Ok(all)
}

/// Removes a lock file without a holder; returns whether it did.
///
/// It is locked as for a check: a daemon that starts meanwhile waits for that, finds the file gone and makes its own.
pub(super) fn remove_free(lock: &Path) -> std::io::Result<bool> {
    let file = File::open(lock)?;
    let free = flock(&file, FlockOperation::NonBlockingLockShared).is_ok();
    if free && same_file(&file, lock) {
        std::fs::remove_file(lock)?;
        return Ok(true);
    }
    Ok(false)
}

/// The present holder of the instance; `None`: none. Unreadable text counts as a holder without data.
pub(super) fn holder(place: &Place) -> Option<Holder> {
    holder_of(&lock_path(place))
}

fn holder_of(lock: &Path) -> Option<Holder> {
    let mut file = File::open(lock).ok()?;
    // Free to take: left behind by a killed daemon.
    if flock(&file, FlockOperation::NonBlockingLockShared).is_ok() {
        return None;
    }
    let mut text = String::new();
    let _unreadable = file.read_to_string(&mut text);
    Some(serde_json::from_str(&text).unwrap_or_default())
}

impl InstanceLock {
    /// Takes the instance.
    ///
    /// # Errors
    /// `Error::Refused` when another process has it, or the file is another user's.
    pub(super) fn take(place: &Place, us: &Holder) -> Result<Self> {
        let path = lock_path(place);
        let refuse =
            |why: String| Error::Refused(format!("instance `{}`: {why}", place.instance()));
        for _ in 0..TRIES_MAX {
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .mode(0o600)
                .open(&path)
                .map_err(|e| refuse(format!("{}: {e}", path.display())))?;
            if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
                // Checking for a holder locks it too, for a moment.
                let Some(other) = holder(place) else {
                    #[allow(
                        clippy::disallowed_methods,
                        reason = "before there is a port to wait on"
                    )]
                    std::thread::sleep(LOOK);
                    continue;
                };
                return Err(refuse(format!(
                    "taken by process {} (sweepd {}); end it, or choose another name with --instance",
                    other.pid, other.sweepd_version
                )));
            }
            // The former holder may have removed the file after we opened it: then the lock is useless.
            if !same_file(&file, &path) {
                continue;
            }
            let text = serde_json::to_string(us).unwrap_or_default();
            file.rewind()
                .and_then(|()| file.set_len(0))
                .and_then(|()| file.write_all(text.as_bytes()))
                .map_err(|e| Error::io(format!("{}: cannot be written", path.display()), e))?;
            return Ok(Self { file, path });
        }
        Err(refuse(format!(
            "{} changes hands again and again",
            path.display()
        )))
    }
}

impl Drop for InstanceLock {
    fn drop(&mut self) {
        // Removed while still locked, and only if it is still ours: another's lock must never be removed.
        if same_file(&self.file, &self.path) {
            let _gone_already = std::fs::remove_file(&self.path);
        }
    }
}

fn same_file(file: &File, path: &Path) -> bool {
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(a), Ok(b)) => a.ino() == b.ino() && a.dev() == b.dev(),
        _ => false,
    }
}

/// A shared lock on iceoryx2's root: `systemd-tmpfiles` skips locked directories.
#[derive(Debug)]
pub(super) struct RootLock {
    _dir: File,
}

impl RootLock {
    /// Creates the root if it is missing, and holds it.
    ///
    /// # Errors
    /// `Error::Refused` when it cannot be made or opened.
    pub(super) fn hold(place: &Place) -> Result<Self> {
        let root = place.root();
        let refuse = |e: std::io::Error| {
            Error::Refused(format!(
                "{}: {e}; iceoryx2 keeps its files there",
                root.display()
            ))
        };
        // As iceoryx2 would create it: no other user may write.
        DirBuilder::new()
            .recursive(true)
            .mode(0o750)
            .create(&root)
            .map_err(refuse)?;
        let dir = File::open(&root).map_err(refuse)?;
        // A cleaner may hold it for a moment; then it is just not protected from that one run.
        let _best_effort = flock(&dir, FlockOperation::NonBlockingLockShared);
        Ok(Self { _dir: dir })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instance_has_one_holder_and_the_lock_file_goes_with_it() {
        let name = format!("lock_{}", std::process::id());
        let place = Place::new(&name).unwrap();
        let us = Holder {
            pid: 7,
            ..Holder::default()
        };
        let lock = InstanceLock::take(&place, &us).unwrap();
        let text = InstanceLock::take(&place, &us).unwrap_err().to_string();
        assert!(text.contains("taken by process 7"), "{text}");
        assert_eq!(holder(&place).unwrap().pid, 7);
        drop(lock);
        assert!(!lock_path(&place).exists());
        assert_eq!(holder(&place), None);
        InstanceLock::take(&place, &us).unwrap();
    }

    #[test]
    fn who_looks_for_a_holder_does_not_keep_one_from_starting() {
        let place = Place::new(&format!("looked_at_{}", std::process::id())).unwrap();
        std::fs::write(lock_path(&place), "").unwrap();
        let looker = File::open(lock_path(&place)).unwrap();
        flock(&looker, FlockOperation::NonBlockingLockShared).unwrap();
        let looker = std::thread::spawn(move || {
            #[allow(clippy::disallowed_methods, reason = "as one who looks would")]
            std::thread::sleep(LOOK / 5);
            drop(looker);
        });
        let taken = InstanceLock::take(&place, &Holder::default());
        looker.join().unwrap();
        taken.unwrap();
    }

    #[test]
    fn a_lock_that_is_held_is_listed_and_not_removed_and_a_free_one_goes() {
        let place = Place::new(&format!("swept_{}", std::process::id())).unwrap();
        let ours = || {
            let mut all = locks(&place).unwrap();
            all.retain(|lock| lock.instance == place.instance());
            all.pop()
        };
        assert_eq!(ours(), None);
        let us = Holder {
            pid: 7,
            ..Holder::default()
        };
        let lock = InstanceLock::take(&place, &us).unwrap();
        let listed = ours().unwrap();
        assert_eq!(listed.holder, Some(us));
        assert!(!remove_free(&listed.path).unwrap() && listed.path.exists());
        drop(lock);
        std::fs::write(&listed.path, "rubbish").unwrap();
        assert_eq!(ours().unwrap().holder, None);
        assert!(remove_free(&listed.path).unwrap() && !listed.path.exists());
        // The same name under other files is another instance.
        let other = place.clone().under("/tmp/elsewhere", "p_");
        let _other = InstanceLock::take(&other, &Holder::default()).unwrap();
        assert_eq!(ours(), None);
    }

    #[test]
    fn a_lock_file_left_by_a_killed_daemon_does_not_block() {
        let place = Place::new(&format!("stale_{}", std::process::id())).unwrap();
        std::fs::write(lock_path(&place), "rubbish").unwrap();
        assert_eq!(holder(&place), None);
        InstanceLock::take(&place, &Holder::default()).unwrap();
    }
}
