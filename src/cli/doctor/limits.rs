//! Checks the resource limits of this process. sweepd locks no memory, so that limit is not checked.

use rustix::process::{Resource, getrlimit};

use super::{Finding, bytes};
use crate::limits::{ADDRESS_BYTES_LEAST, FILE_BYTES_LEAST, OPEN_FILES_LEAST};
use crate::transport::open_files::OpenFiles;

/// A resource limit, and the values that sweepd needs.
struct Need {
    resource: Resource,
    what: &'static str,
    /// The flag of `ulimit`.
    flag: &'static str,
    /// Unit of that flag's value, in units of the limit.
    unit: u64,
    /// Below this a daemon does not start.
    least: u64,
    /// Below this a daemon serves fewer clients than it could.
    wished: u64,
    why: &'static str,
    show: fn(u64) -> String,
}

const NEEDS: [Need; 3] = [
    Need {
        resource: Resource::Nofile,
        what: "open files",
        flag: "-n",
        unit: 1,
        least: OPEN_FILES_LEAST,
        wished: 1024,
        why: "a daemon has some 80 open, some 8 more with each client, some 200 with --ros2 and 4 with each body's topic",
        show: |count| count.to_string(),
    },
    Need {
        resource: Resource::Fsize,
        what: "size of a file",
        flag: "-f",
        unit: 1024,
        least: FILE_BYTES_LEAST,
        wished: 1 << 30,
        why: "shared memory is files, and messages of large scenes need larger ones",
        show: bytes,
    },
    Need {
        resource: Resource::As,
        what: "address space",
        flag: "-v",
        unit: 1024,
        least: ADDRESS_BYTES_LEAST,
        wished: 1 << 30,
        why: "a daemon maps some 90 MiB of shared memory at its start, and its threads' stacks and heaps, of which it uses little",
        show: bytes,
    },
];

pub(super) fn look() -> Vec<Finding> {
    let limit = |need: &Need| getrlimit(need.resource).current;
    NEEDS.iter().map(|need| judge(need, limit(need))).collect()
}

/// The finding that replaces all checks that open files; `None`: there are enough file descriptors.
pub(super) fn blind() -> Option<Finding> {
    let files = OpenFiles::own().filter(|files| !files.are_enough_for_a_client())?;
    Some(Finding::wrong(
        "limits",
        format!("this process has {files}: too few to look at leftovers and instances"),
        files.mend(),
    ))
}

/// * `limit` - the soft limit; `None`: unlimited.
fn judge(need: &Need, limit: Option<u64>) -> Finding {
    let check = "limits";
    let Some(limit) = limit else {
        return Finding::ok(check, format!("{}: no limit", need.what));
    };
    let what = format!("{}: {}", need.what, (need.show)(limit));
    if limit >= need.wished {
        return Finding::ok(check, what);
    }
    let (what, mend) = (
        format!("{what}: {}", need.why),
        format!(
            "`ulimit {} {}` in the shell that starts it, or in its service's unit",
            need.flag,
            need.wished / need.unit
        ),
    );
    if limit < need.least {
        Finding::wrong(check, what, mend)
    } else {
        Finding::warning(check, what, mend)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    #[test]
    fn a_limit_is_judged_by_what_a_daemon_takes() {
        for need in &NEEDS {
            assert!(need.least < need.wished);
            for (limit, level) in [
                (None, Level::Ok),
                (Some(need.wished), Level::Ok),
                (Some(need.least), Level::Warning),
                (Some(need.least - 1), Level::Wrong),
            ] {
                let found = judge(need, limit);
                assert_eq!(found.level, level, "{}", found.text());
            }
        }
        let files = judge(&NEEDS[0], Some(256));
        assert!(files.mend.contains("`ulimit -n 1024`"), "{}", files.mend);
        let size = judge(&NEEDS[1], Some(1 << 20));
        assert!(size.mend.contains("`ulimit -f 1048576`"), "{}", size.mend);
    }
}
