//! Whether shared memory has room for a scene's messages: who writes beyond its end is killed (SIGBUS), with no error
//! to handle. In: the scene's sizes. Out: bytes, and what to say.

use rustix::fs::statvfs;

use super::lock::LOCK_DIR;
use crate::config::Limits;
use crate::wire::{BodyRow, ContactRow, NameRow, PairRow, TransformRow};

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
    let contacts = contacts.min(most(limits.contact_rows));
    [
        message::<PairRow>(pairs),
        message::<ContactRow>(contacts),
        message::<BodyRow>(bodies),
        message::<NameRow>(bodies),
        // Any source may hold all bodies but those of others: together they hold each once.
        message::<TransformRow>(bodies).saturating_add(sources << 12),
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
        assert_eq!(told(few, few), None);
        let text = told(60 << 20, 100 << 20).unwrap();
        assert!(
            text.contains("--shm-size=128m") && text.contains("60 MiB"),
            "{text}"
        );
        assert_eq!(scarce(0), None);
    }
}
