//! Checks shared memory and clocks: free space, write access, and whether ages can be measured.

use rustix::fs::{Access, AtFlags, CWD, accessat, statfs, statvfs};
use rustix::io::Errno;
use rustix::time::{DynamicClockId, clock_gettime_dynamic};

use super::{Finding, bytes};

/// Directory of iceoryx2's shared memory.
const SHARED: &str = "/dev/shm";
/// `statfs` type of a file system in memory (`TMPFS_MAGIC`).
const TMPFS: i64 = 0x0102_1994;
/// Free bytes below which frames of some thousand bodies may not fit. A process that writes to shared memory when none
/// is left is killed (SIGBUS). Frames of 100,000 bodies take 14 MB per source; containers often have 64 MiB in all.
const FREE_SCARCE: u64 = 64 << 20;
/// Free bytes below which a daemon and its clients hardly start: each takes a third of a MiB.
const FREE_NONE: u64 = 4 << 20;
/// Free inodes below which a daemon may not start: it has some 40 files, a client some 6.
const ENTRIES_NONE: u64 = 100;

pub(super) fn look() -> Vec<Finding> {
    let mut found = room();
    found.push(boottime());
    found
}

fn room() -> Vec<Finding> {
    let check = "shared memory";
    let stat = match statvfs(SHARED) {
        Ok(stat) => stat,
        Err(e) => {
            return vec![Finding::wrong(
                check,
                format!("{SHARED}: {e}"),
                "mount a tmpfs there: `mount -t tmpfs -o size=1g tmpfs /dev/shm`",
            )];
        }
    };
    let of = |blocks: u64| blocks.saturating_mul(stat.f_frsize);
    // A file system without an inode limit reports 0 inodes in total and 0 free.
    let entries = (stat.f_files > 0).then_some(stat.f_favail);
    let mut found = vec![judge(of(stat.f_bavail), of(stat.f_blocks), entries)];
    let may = Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK;
    if let Err(e) = accessat(CWD, SHARED, may, AtFlags::EACCESS) {
        found.push(shut(e));
    }
    if statfs(SHARED).is_ok_and(|stat| stat.f_type != TMPFS) {
        found.push(Finding::warning(
            check,
            format!("{SHARED} is not a tmpfs: messages may go to a disk"),
            "mount a tmpfs there",
        ));
    }
    found
}

/// The finding if no file can be created in shared memory.
fn shut(because: Errno) -> Finding {
    let mend = if because == Errno::ROFS {
        "it is mounted read-only: `mount -o remount,rw /dev/shm`, or start the container with a writable one"
    } else {
        "let it: `chmod 1777 /dev/shm`"
    };
    Finding::wrong(
        "shared memory",
        format!("this user may not make files in {SHARED} ({because})"),
        mend,
    )
}

/// * `entries` - free inodes; `None`: no limit.
fn judge(free: u64, size: u64, entries: Option<u64>) -> Finding {
    let check = "shared memory";
    let what = format!("{} of {} are free in {SHARED}", bytes(free), bytes(size));
    let mend = "remove what is not needed there, or make it larger: `mount -o remount,size=1g /dev/shm`, in a \
                container `--shm-size=1g`";
    if entries.is_some_and(|entries| entries < ENTRIES_NONE) {
        let left = entries.unwrap_or(0);
        return Finding::wrong(check, format!("{what}, and {left} files"), mend);
    }
    match free {
        _ if free < FREE_NONE => Finding::wrong(check, what, mend),
        _ if free < FREE_SCARCE => Finding::warning(
            check,
            format!(
                "{what}: frames of 100,000 bodies take 14 MB a source, and who writes beyond the end is killed"
            ),
            mend,
        ),
        _ => Finding::ok(check, what),
    }
}

/// Checks `CLOCK_BOOTTIME`, which ages are measured on.
fn boottime() -> Finding {
    let check = "clocks";
    let read = || clock_gettime_dynamic(DynamicClockId::Boottime).map(|at| (at.tv_sec, at.tv_nsec));
    match (read(), read()) {
        (Ok(first), Ok(second)) if first <= second => {
            Finding::ok(check, "CLOCK_BOOTTIME can be read, ages count on it")
        }
        (Ok(_), Ok(_)) => Finding::wrong(
            check,
            "CLOCK_BOOTTIME goes back",
            "choose another clock source: see /sys/devices/system/clocksource",
        ),
        (Err(e), _) | (_, Err(e)) => Finding::wrong(
            check,
            format!("CLOCK_BOOTTIME cannot be read ({e}): no age can be told"),
            "run a Linux of 2.6.39 or later, and let the sandbox allow clock_gettime",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    #[test]
    fn little_memory_is_a_warning_and_next_to_none_is_wrong() {
        for (free, entries, level) in [
            (1 << 30, None, Level::Ok),
            (1 << 30, Some(1000), Level::Ok),
            (FREE_SCARCE - 1, None, Level::Warning),
            (FREE_NONE - 1, None, Level::Wrong),
            (1 << 30, Some(3), Level::Wrong),
        ] {
            let found = judge(free, 2 << 30, entries);
            assert_eq!(found.level, level, "{}", found.text());
            assert_eq!(found.mend.is_empty(), level == Level::Ok);
        }
    }

    #[test]
    fn bug_rights_of_shared_memory_that_is_mounted_read_only_were_to_be_changed() {
        let text = shut(Errno::ROFS).text();
        assert!(
            text.starts_with("wrong ") && text.contains("`mount -o remount,rw /dev/shm`"),
            "{text}"
        );
        assert!(!text.contains("chmod"), "{text}");
        let text = shut(Errno::ACCESS).text();
        assert!(
            text.contains("`chmod 1777 /dev/shm`") && !text.contains("read-only"),
            "{text}"
        );
    }

    #[test]
    fn this_machine_has_the_clock() {
        assert_eq!(boottime().level, Level::Ok);
    }
}
