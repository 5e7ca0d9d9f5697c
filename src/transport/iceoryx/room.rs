//! Checks whether shared memory has room for a scene's messages: a process that writes beyond its end is killed
//! (SIGBUS), with no error to handle. In: the scene's sizes. Out: bytes, and the text of a warning. Also checks whether
//! this process may open enough files, and large enough ones: shared memory is files.

use rustix::fs::statvfs;
use rustix::process::{Resource, getrlimit};

use super::lock::LOCK_DIR;
use super::qos;
use crate::config::Limits;
use crate::error::{Error, Result};
use crate::limits::{
    ADDRESS_BYTES_LEAST, FILE_BYTES_LEAST, FILES_A_CLIENT, OPEN_FILES_LEAST, REGIONS_PER_PAIR_MAX,
    SHARED_BYTES_A_CLIENT, SHARED_BYTES_LEAST,
};
use crate::wire::{BodyRow, ContactRow, NameRow, PairRow, RegionRow, TransformVelRow};

/// Messages of a topic that exist at once: one being written, one kept for late joiners, one being read. With slow
/// readers there are more.
const MESSAGES: u64 = 3;
/// Memory of a daemon and some clients before any message, bytes.
const BASE: u64 = 4 << 20;
/// Largest headers of a message, bytes: those of iceoryx2 and ours.
const HEADERS: u64 = 256;

/// Bytes of shared memory that the messages of a scene may take at its limits, while its readers keep up.
#[must_use]
pub fn bytes_needed(limits: &Limits, bodies: usize, sources: usize) -> u64 {
    let sources = u64::try_from(sources).unwrap_or(u64::MAX);
    let Rows {
        bodies,
        pairs,
        contacts,
        regions,
    } = most_rows(limits, bodies);
    [
        message::<PairRow>(pairs),
        message::<ContactRow>(contacts),
        // `changes` and `contact_changes`, which begin with the whole list.
        message::<PairRow>(pairs),
        message::<ContactRow>(contacts),
        message::<RegionRow>(regions),
        message::<BodyRow>(bodies),
        message::<NameRow>(bodies),
        // Verdicts, a byte each.
        message::<u8>(bodies),
        // A body belongs to one source only: all sources together send each body once.
        message::<TransformVelRow>(bodies).saturating_add(sources << 12),
    ]
    .iter()
    .fold(BASE, |all, bytes| {
        all.saturating_add(bytes.saturating_mul(MESSAGES))
    })
}

/// Rows of each message at a scene's limits.
struct Rows {
    bodies: u64,
    pairs: u64,
    contacts: u64,
    regions: u64,
}

fn most_rows(limits: &Limits, bodies: usize) -> Rows {
    let bodies = u64::try_from(bodies).unwrap_or(u64::MAX);
    let most = |limit: usize| u64::try_from(limit).unwrap_or(u64::MAX);
    let pairs = bodies.saturating_mul(bodies.saturating_sub(1)) / 2;
    let pairs = pairs.min(most(limits.pair_rows));
    let contacts = pairs.saturating_mul(most(limits.contacts_per_pair));
    let regions = pairs.saturating_mul(most(REGIONS_PER_PAIR_MAX));
    Rows {
        bodies,
        pairs,
        // Whatever the limit, the deepest pair is sent with all its rows.
        contacts: contacts.min(most(limits.contact_rows.max(limits.contacts_per_pair))),
        regions: regions.min(most(limits.region_rows.max(REGIONS_PER_PAIR_MAX))),
    }
}

/// Messages grow by powers of two, but only written pages take memory.
fn message<T>(rows: u64) -> u64 {
    rows.saturating_mul(u64::try_from(size_of::<T>()).unwrap_or(u64::MAX))
}

/// The warning if shared memory has less room than a scene's messages may need; `None`: it has enough, or cannot be
/// inspected.
#[must_use]
pub fn scarce(needed: u64) -> Option<String> {
    told(free()?, needed)
}

/// Free bytes of shared memory; `None`: it cannot be inspected, or has no limit (its total size is then 0).
fn free() -> Option<u64> {
    let stat = statvfs(LOCK_DIR).ok()?;
    (stat.f_blocks > 0).then(|| stat.f_bavail.saturating_mul(stat.f_frsize))
}

fn told(free: u64, needed: u64) -> Option<String> {
    let size = needed.div_ceil(1 << 20).next_power_of_two();
    (free < needed).then(|| {
        format!(
            "{LOCK_DIR} has {} MiB free, messages of this scene may take {}, and who writes beyond the end is killed \
             (SIGBUS): make it larger (in a container `--shm-size={size}m`, else `mount -o remount,size={size}m \
             {LOCK_DIR}`) or lower the scene's `[limits]`",
            free >> 20,
            mib(needed)
        )
    })
}

/// Refuses to start if it would fail halfway, with an error that names no cause.
///
/// # Errors
/// `Error::Refused` when this process may open fewer files than a daemon needs, or may not create large enough ones, or
/// has too little address space; or when shared memory has no room for its ports.
pub(super) fn check_limits() -> Result<()> {
    let limit = |resource| getrlimit(resource).current;
    enough_files(limit(Resource::Nofile))?;
    large_enough(limit(Resource::Fsize))?;
    wide_enough(limit(Resource::As))?;
    has_room("a daemon", free(), SHARED_BYTES_LEAST)
}

/// The same for a client.
///
/// # Errors
/// `Error::Refused` when shared memory has no room for its ports.
pub(super) fn check_client_room() -> Result<()> {
    has_room("a client", free(), SHARED_BYTES_A_CLIENT)
}

/// * `free` - bytes of shared memory; `None`: unknown.
fn has_room(who: &str, free: Option<u64>, least: u64) -> Result<()> {
    match free {
        Some(free) if free < least => Err(Error::Refused(format!(
            "{LOCK_DIR} has {} KiB free, and {who} takes up to {} KiB when it starts; who writes beyond the end is killed \
             (SIGBUS): make it larger (in a container `--shm-size=64m`, else `mount -o remount,size=64m {LOCK_DIR}`), or \
             remove what fills it",
            free >> 10,
            least >> 10
        ))),
        _ => Ok(()),
    }
}

/// * `bytes` - address space that this process may use; `None`: unlimited.
fn wide_enough(bytes: Option<u64>) -> Result<()> {
    match bytes {
        Some(bytes) if bytes < ADDRESS_BYTES_LEAST => Err(Error::Refused(format!(
            "this process may have {} of address space, and a daemon needs {}, most of it mapped and never used: `ulimit \
             -v unlimited` in the shell that starts it, or in its service's unit",
            mib(bytes),
            mib(ADDRESS_BYTES_LEAST)
        ))),
        _ => Ok(()),
    }
}

/// * `files` - number of files that may be open; `None`: unlimited.
fn enough_files(files: Option<u64>) -> Result<()> {
    match files {
        Some(files) if files < OPEN_FILES_LEAST => Err(Error::Refused(format!(
            "this process may open {files} files, and a daemon needs {OPEN_FILES_LEAST} and some {FILES_A_CLIENT} more \
             with each client: `ulimit -n 1024` in the shell that starts it, or in its service's unit"
        ))),
        _ => Ok(()),
    }
}

/// * `bytes` - largest allowed file size; `None`: unlimited.
fn large_enough(bytes: Option<u64>) -> Result<()> {
    match bytes {
        Some(bytes) if bytes < FILE_BYTES_LEAST => Err(Error::Refused(format!(
            "this process may make files of {} at most, and a daemon needs {}, for shared memory is files: `ulimit -f \
             unlimited` in the shell that starts it, or in its service's unit",
            mib(bytes),
            mib(FILE_BYTES_LEAST)
        ))),
        _ => Ok(()),
    }
}

/// The warning if this process may not create files as large as a scene's messages may need; `None`: it may.
#[must_use]
pub fn cramped(limits: &Limits, bodies: usize) -> Option<String> {
    cramped_by(
        getrlimit(Resource::Fsize).current?,
        largest_file(limits, bodies),
    )
}

fn cramped_by(bytes: u64, needed: u64) -> Option<String> {
    (bytes < needed).then(|| {
        format!(
            "this process may make files of {} at most, and shared memory for messages of this scene may need {}: what \
             does not fit is not handed over. `ulimit -f unlimited` in the shell that starts it, or in its service's \
             unit, or lower the scene's `[limits]`",
            mib(bytes),
            mib(needed)
        )
    })
}

/// Bytes of the largest file that the messages of a scene may need at its limits: a file has slots for all messages of
/// one kind that readers may hold, but only used ones take memory.
fn largest_file(limits: &Limits, bodies: usize) -> u64 {
    let rows = most_rows(limits, bodies);
    [
        file::<PairRow>(rows.pairs),
        file::<ContactRow>(rows.contacts),
        file::<RegionRow>(rows.regions),
        file::<BodyRow>(rows.bodies),
        file::<NameRow>(rows.bodies),
    ]
    .into_iter()
    .fold(FILE_BYTES_LEAST, u64::max)
}

/// A message is rounded up to the next power of two.
fn file<T>(rows: u64) -> u64 {
    let message = message::<T>(rows).saturating_add(HEADERS);
    let whole = message.checked_next_power_of_two().unwrap_or(u64::MAX);
    whole.saturating_mul(qos::RESULT_PLACES)
}

/// A readable size.
fn mib(bytes: u64) -> String {
    match bytes.div_ceil(1 << 20) {
        0 | 1 if bytes < 1 << 20 => format!("{bytes} bytes"),
        mib => format!("{mib} MiB"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::iceoryx::{Place, Server, ServerOptions};

    #[test]
    fn bug_scarce_shared_memory_is_told_with_what_to_change() {
        let limits = Limits::default();
        let (few, many) = (
            bytes_needed(&limits, 20, 1),
            bytes_needed(&limits, 100_000, 2),
        );
        assert!((BASE..16 << 20).contains(&few), "{few}");
        assert!(many > 64 << 20, "{many}");
        assert!(bytes_needed(&limits, usize::MAX, 1) > many);
        let small = Limits {
            pair_rows: 10,
            contact_rows: 10,
            ..limits
        };
        assert!(bytes_needed(&small, 100_000, 2) < many);
        // The deepest pair is sent with all its rows, even if it alone has more than the limit.
        let one = Limits {
            contact_rows: 1,
            contacts_per_pair: 16,
            ..small
        };
        let none = Limits {
            contact_rows: 1,
            contacts_per_pair: 1,
            ..small
        };
        let more = bytes_needed(&one, 100, 1) - bytes_needed(&none, 100, 1);
        let rows = 15 * size_of::<ContactRow>() as u64;
        // In `contacts` and in `contact_changes`.
        assert_eq!(more, 2 * MESSAGES * rows);
        let regions = Limits {
            region_rows: 1,
            ..limits
        };
        assert!(bytes_needed(&regions, 100_000, 2) < many);
        assert_eq!(told(few, few), None);
        let text = told(60 << 20, 100 << 20).unwrap();
        assert!(
            text.contains("--shm-size=128m") && text.contains("60 MiB"),
            "{text}"
        );
        assert_eq!(scarce(0), None);
    }

    #[test]
    fn bug_too_few_files_were_told_as_clients_of_another_version() {
        let error = enough_files(Some(60)).unwrap_err().to_string();
        assert!(
            error.contains("ulimit -n") && error.contains("60 files"),
            "{error}"
        );
        assert!(enough_files(Some(OPEN_FILES_LEAST)).is_ok() && enough_files(None).is_ok());
    }

    #[test]
    fn bug_a_limit_of_the_size_of_files_was_met_in_the_middle_of_a_run() {
        let error = large_enough(Some(1 << 20)).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        let text = error.to_string();
        assert!(
            text.contains("files of 1 MiB") && text.contains("`ulimit -f unlimited`"),
            "{text}"
        );
        let text = large_enough(Some(4096)).unwrap_err().to_string();
        assert!(text.contains("4096 bytes"), "{text}");
        assert!(large_enough(Some(FILE_BYTES_LEAST)).is_ok() && large_enough(None).is_ok());
        // Beyond that a scene's need is only a warning: few scenes are at their limits.
        let limits = Limits::default();
        let (few, many) = (largest_file(&limits, 5), largest_file(&limits, 100_000));
        assert_eq!(
            (few, cramped_by(FILE_BYTES_LEAST, few)),
            (FILE_BYTES_LEAST, None)
        );
        let text = cramped_by(FILE_BYTES_LEAST, many).unwrap();
        assert!(text.contains("`ulimit -f unlimited`"), "{text}");
        let small = Limits {
            pair_rows: 10,
            contact_rows: 10,
            region_rows: 10,
            ..limits
        };
        assert!(largest_file(&small, 2000) < largest_file(&limits, 2000));
        assert!(largest_file(&limits, usize::MAX) > many);
    }

    #[test]
    fn bug_too_little_address_space_was_told_as_clients_of_another_version() {
        let text = wide_enough(Some(58 << 20)).unwrap_err().to_string();
        assert!(
            text.contains("58 MiB of address space") && text.contains("ulimit -v"),
            "{text}"
        );
        assert!(wide_enough(Some(ADDRESS_BYTES_LEAST)).is_ok() && wide_enough(None).is_ok());
    }

    /// Both were killed without a message.
    #[test]
    fn bug_a_start_without_room_in_shared_memory_is_refused() {
        let text = has_room("a daemon", Some(100 << 10), SHARED_BYTES_LEAST)
            .unwrap_err()
            .to_string();
        assert!(
            text.contains("100 KiB free") && text.contains("--shm-size"),
            "{text}"
        );
        assert!(has_room("a client", Some(1 << 20), SHARED_BYTES_A_CLIENT).is_ok());
        assert!(has_room("a client", None, SHARED_BYTES_A_CLIENT).is_ok());
    }

    #[test]
    fn the_least_size_of_a_file_is_that_of_the_largest_that_a_daemon_makes_at_its_start() {
        let (root, prefix) = (
            std::env::temp_dir(),
            format!("size_{}_", std::process::id()),
        );
        let root = root.join(format!("sweepd_size_{}", std::process::id()));
        let place = Place::new("size").unwrap().under(&root, &prefix);
        let server = Server::open(ServerOptions::new(place, 7)).unwrap();
        let files = std::fs::read_dir(LOCK_DIR).unwrap().flatten();
        let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
        let largest = ours
            .map(|file| file.metadata().unwrap().len())
            .max()
            .unwrap();
        drop(server);
        std::fs::remove_dir_all(&root).unwrap();
        // iceoryx2's files for the next node with this prefix, which never comes.
        for file in std::fs::read_dir(LOCK_DIR).unwrap().flatten() {
            if file.file_name().to_string_lossy().starts_with(&prefix) {
                std::fs::remove_file(file.path()).unwrap();
            }
        }
        assert!(
            (FILE_BYTES_LEAST / 2..=FILE_BYTES_LEAST).contains(&largest),
            "{largest}"
        );
    }
}
