//! Open files: how many a process has, and how many it may have. Who has none left fails in ways that name other
//! causes.
//!
//! In: a process. Out: two figures, and what to say.

use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

use crate::error::{Error, Result};
use crate::limits::{CLIENT_FILES_LEAST, FILES_A_CLIENT};

/// Files that a process has open, and that it may.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenFiles {
    /// Open now.
    pub open: u64,
    /// The limit.
    pub most: u64,
}

impl OpenFiles {
    /// Of this process; `None`: it has no limit, or may not be looked at.
    #[must_use]
    pub fn own() -> Option<Self> {
        let most = getrlimit(Resource::Nofile).current?;
        match count("self") {
            // What lists them is one itself.
            Ok(count) => Some(Self {
                open: count.saturating_sub(1).min(most),
                most,
            }),
            Err(e) if e.raw_os_error() == Some(Errno::MFILE.raw_os_error()) => {
                Some(Self { open: most, most })
            }
            Err(_) => None,
        }
    }

    /// Of a process of this pid namespace; `None` as of this one, or it is another user's.
    #[must_use]
    pub fn of(pid: u32) -> Option<Self> {
        let limits = std::fs::read_to_string(format!("/proc/{pid}/limits")).ok()?;
        let (open, most) = (count(&pid.to_string()).ok()?, most(&limits)?);
        // What was inherited may be beyond the limit.
        let open = open.min(most);
        Some(Self { open, most })
    }

    /// How many more it may open.
    #[must_use]
    pub fn left(self) -> u64 {
        self.most.saturating_sub(self.open)
    }

    /// Whether a daemon has too few left for one client more.
    #[must_use]
    pub fn is_short(self) -> bool {
        self.left() < FILES_A_CLIENT
    }

    /// Whether a client has enough left for all that it opens.
    #[must_use]
    pub fn are_enough_for_a_client(self) -> bool {
        self.left() >= CLIENT_FILES_LEAST
    }

    /// How to let it have more.
    #[must_use]
    pub fn mend(self) -> String {
        format!(
            "`ulimit -n {}` in the shell that starts it, or in its service's unit",
            self.most.saturating_mul(2).max(1024)
        )
    }
}

impl std::fmt::Display for OpenFiles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of the {} files open that it may",
            self.open, self.most
        )
    }
}

/// What to say of a daemon that has no files left for its clients; `None`: it has.
pub(crate) fn short() -> Option<String> {
    let files = OpenFiles::own().filter(|files| files.is_short())?;
    Some(format!(
        "this process has {files}, too few for another client: {}",
        files.mend()
    ))
}

/// Refuses what a client cannot do with the files that this process has left.
///
/// # Errors
/// `Error::Refused` where they are too few.
pub(crate) fn check_client() -> Result<()> {
    OpenFiles::own().map_or(Ok(()), enough)
}

fn enough(files: OpenFiles) -> Result<()> {
    if files.are_enough_for_a_client() {
        return Ok(());
    }
    Err(Error::Refused(format!(
        "this process has {files}, and a client of a daemon takes up to {CLIENT_FILES_LEAST} more: {}",
        files.mend()
    )))
}

/// The soft limit in `/proc/PID/limits`; `None`: there is none.
fn most(limits: &str) -> Option<u64> {
    let mut lines = limits.lines();
    let figures = lines.find_map(|line| line.strip_prefix("Max open files"))?;
    figures.split_whitespace().next()?.parse().ok()
}

fn count(pid: &str) -> std::io::Result<u64> {
    let entries = std::fs::read_dir(format!("/proc/{pid}/fd"))?;
    Ok(entries.fold(0, |count, _| count + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_counts_its_files_alike_from_within_and_from_without() {
        let files = OpenFiles::own().unwrap();
        assert!((3..files.most).contains(&files.open), "{files}");
        let held: Vec<_> = (0..50).map(|_| std::fs::File::open("/dev/null")).collect();
        // Other tests open and close theirs meanwhile.
        let more = OpenFiles::own().unwrap();
        assert!(more.open + 25 > files.open + 50, "{files}, then {more}");
        let other = OpenFiles::of(std::process::id()).unwrap();
        assert_eq!(other.most, files.most);
        assert!(other.open.abs_diff(more.open) < 25, "{more}, then {other}");
        drop(held);
        assert_eq!(OpenFiles::of(u32::MAX), None);
    }

    #[test]
    fn bug_too_few_files_for_a_client_were_told_as_no_daemon_or_another_version() {
        let files = |open| OpenFiles { open, most: 110 };
        assert!(enough(files(110 - CLIENT_FILES_LEAST)).is_ok());
        let error = enough(files(100)).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        let text = error.to_string();
        assert!(
            text.contains("100 of the 110 files") && text.contains("`ulimit -n 1024`"),
            "{text}"
        );
        assert!(files(110).is_short() && !files(50).is_short());
        let many = OpenFiles {
            open: 4000,
            most: 4096,
        };
        assert!(many.mend().contains("`ulimit -n 8192`"), "{}", many.mend());
    }

    #[test]
    fn a_limit_is_read_and_none_is_none() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
                    Max file size             unlimited            unlimited            bytes     \n\
                    Max open files            1024                 524288               files     \n";
        assert_eq!(most(text), Some(1024));
        assert_eq!(most(&text.replace("1024      ", "unlimited ")), None);
        assert_eq!(most(""), None);
    }
}
