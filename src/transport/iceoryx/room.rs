//! Whether shared memory has room for a scene's messages: who writes beyond its end is killed (SIGBUS), with no error
//! to handle. In: the scene's sizes. Out: bytes, and what to say. And whether so many files may be open as it takes.

use rustix::fs::statvfs;
use rustix::process::{Resource, getrlimit};

use super::lock::LOCK_DIR;
use crate::config::Limits;
use crate::error::{Error, Result};
use crate::limits::{OPEN_FILES_LEAST, REGIONS_PER_PAIR_MAX};
use crate::wire::{BodyRow, ContactRow, NameRow, PairRow, RegionRow, TransformVelRow};

/// Messages of a topic that are there at once: one that is written, one kept for late joiners, one that is read. Where
/// readers are slow there are more.
const MESSAGES: u64 = 3;
/// What a daemon and some clients take before any message, bytes.
const BASE: u64 = 4 << 20;

/// Bytes of shared memory that the messages of a scene may take at its limits, while its readers keep up.
#[must_use]
pub fn bytes_needed(limits: &Limits, bodies: usize, sources: usize) -> u64 {
    let bodies = u64::try_from(bodies).unwrap_or(u64::MAX);
    let sources = u64::try_from(sources).unwrap_or(u64::MAX);
    let most = |limit: usize| u64::try_from(limit).unwrap_or(u64::MAX);
    let pairs = bodies.saturating_mul(bodies.saturating_sub(1)) / 2;
    let pairs = pairs.min(most(limits.pair_rows));
    let contacts = pairs.saturating_mul(most(limits.contacts_per_pair));
    // Whatever the limit is, the deepest pair goes out whole.
    let contacts = contacts.min(most(limits.contact_rows.max(limits.contacts_per_pair)));
    let regions = pairs.saturating_mul(most(REGIONS_PER_PAIR_MAX));
    let regions = regions.min(most(limits.region_rows.max(REGIONS_PER_PAIR_MAX)));
    [
        message::<PairRow>(pairs),
        // `changes`, which begin with the whole list.
        message::<PairRow>(pairs),
        message::<ContactRow>(contacts),
        message::<RegionRow>(regions),
        message::<BodyRow>(bodies),
        message::<NameRow>(bodies),
        // Verdicts, a byte each.
        message::<u8>(bodies),
        // Any source may hold all bodies but those of others: together they hold each once.
        message::<TransformVelRow>(bodies).saturating_add(sources << 12),
    ]
    .iter()
    .fold(BASE, |all, bytes| {
        all.saturating_add(bytes.saturating_mul(MESSAGES))
    })
}

/// Messages grow by powers of two, but only what is written takes memory.
fn message<T>(rows: u64) -> u64 {
    rows.saturating_mul(u64::try_from(size_of::<T>()).unwrap_or(u64::MAX))
}

/// What to say where shared memory has less room than a scene's messages may need; `None`: it has more, or cannot be
/// looked at.
#[must_use]
pub fn scarce(needed: u64) -> Option<String> {
    let stat = statvfs(LOCK_DIR).ok()?;
    told(stat.f_bavail.saturating_mul(stat.f_frsize), needed)
}

fn told(free: u64, needed: u64) -> Option<String> {
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let size = mib(needed).next_power_of_two();
    (free < needed).then(|| {
        format!(
            "{LOCK_DIR} has {} MiB free, messages of this scene may take {} MiB, and who writes beyond the end is killed \
             (SIGBUS): make it larger (in a container `--shm-size={size}m`, else `mount -o remount,size={size}m \
             {LOCK_DIR}`) or lower the scene's `[limits]`",
            free >> 20,
            mib(needed)
        )
    })
}

/// Refuses to begin where it would end halfway, with an error that names no cause.
///
/// # Errors
/// `Error::Refused` when this process may open fewer files than a daemon needs.
pub(super) fn enough_files() -> Result<()> {
    enough(getrlimit(Resource::Nofile).current)
}

/// * `files` - that may be open; `None`: any number.
fn enough(files: Option<u64>) -> Result<()> {
    match files {
        Some(files) if files < OPEN_FILES_LEAST => Err(Error::Refused(format!(
            "this process may open {files} files, and a daemon needs {OPEN_FILES_LEAST} and some 7 more with each \
             client: `ulimit -n 1024` in the shell that starts it, or in its service's unit"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        // The deepest pair goes out whole where it alone has more rows than the limit.
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
        assert_eq!(more, MESSAGES * rows);
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
        let error = enough(Some(60)).unwrap_err().to_string();
        assert!(
            error.contains("ulimit -n") && error.contains("60 files"),
            "{error}"
        );
        assert!(enough(Some(OPEN_FILES_LEAST)).is_ok() && enough(None).is_ok());
    }
}
