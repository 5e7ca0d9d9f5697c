//! Checks the files of iceoryx2 and the locks: owners, access rights, and leftovers of dead processes.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::{Access, AtFlags, CWD, accessat};

use crate::error::counted;
use crate::transport::iceoryx::{
    Cleaned, Leftovers, NodeOwner, Place, clean_leftovers, leftovers, unreaped_by,
};

use super::{Finding, bytes};

/// Directories of iceoryx2 under its root.
const FOLDERS: [&str; 2] = ["nodes", "services"];
/// Most owners of nodes, and most locks, named in one line.
const NAMED: usize = 3;

/// * `instance` - the instance whose leftovers are cleaned and whose lock is reported; `None`: all.
pub(super) fn look(place: &Place, instance: Option<&str>, clean: bool) -> Vec<Finding> {
    let mut found = rights(&place.root());
    if found.iter().any(|f| f.level == super::Level::Wrong) {
        return found;
    }
    let check = "leftovers";
    if clean {
        match clean_leftovers(place, instance) {
            Ok(done) => found.extend(cleaned(&done)),
            Err(e) => found.push(Finding::wrong(check, e.to_string(), "")),
        }
    }
    match leftovers(place) {
        Ok(left) => found.extend(judge(&left, instance, mend(clean, instance))),
        Err(e) => found.push(Finding::wrong(check, e.to_string(), "")),
    }
    found
}

/// Checks the access rights on the root and on the directories under it.
fn rights(root: &Path) -> Vec<Finding> {
    let check = "rights";
    let meta = match std::fs::symlink_metadata(root) {
        Ok(meta) => meta,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return vec![not_there(root)],
        Err(e) => {
            let what = format!("{}: {e}", root.display());
            return vec![Finding::wrong(
                check,
                what,
                "give this user the right to read it",
            )];
        }
    };
    let us = rustix::process::geteuid().as_raw();
    let mut found = vec![judge_root(root, &meta, us)];
    let may = Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK;
    let folders = FOLDERS.iter().map(|name| root.join(name));
    for folder in std::iter::once(root.to_owned()).chain(folders) {
        let Ok(meta) = std::fs::metadata(&folder) else {
            continue;
        };
        let (owner, shown) = (meta.uid(), folder.display());
        if owner != us {
            continue;
        }
        if let Err(e) = accessat(CWD, &folder, may, AtFlags::EACCESS) {
            found.push(Finding::wrong(
                check,
                format!("this user may not make files in {shown} ({e})"),
                format!("let it: `chmod u+rwx {shown}`"),
            ));
        }
        if meta.mode() & 0o022 != 0 {
            found.push(Finding::warning(
                check,
                format!(
                    "others may make and remove files in {shown} (mode {:o})",
                    meta.mode() & 0o7777
                ),
                format!("forbid it: `chmod go-w {shown}`"),
            ));
        }
    }
    found
}

fn not_there(root: &Path) -> Finding {
    let check = "rights";
    let above = root.parent().unwrap_or(Path::new("/"));
    match accessat(
        CWD,
        above,
        Access::WRITE_OK | Access::EXEC_OK,
        AtFlags::EACCESS,
    ) {
        Ok(()) => Finding::ok(
            check,
            format!(
                "{} is not there yet: the first daemon makes it",
                root.display()
            ),
        ),
        Err(e) => Finding::wrong(
            check,
            format!("{} is not there and cannot be made ({e})", root.display()),
            format!("let this user write to {}", above.display()),
        ),
    }
}

fn judge_root(root: &Path, meta: &Metadata, us: u32) -> Finding {
    let (check, shown) = ("rights", root.display());
    if !meta.is_dir() {
        return Finding::wrong(
            check,
            format!("{shown} is not a directory, and iceoryx2 keeps its files there"),
            "remove it",
        );
    }
    if meta.uid() != us {
        return Finding::wrong(
            check,
            format!(
                "{shown} belongs to user id {}, this process runs as {us}",
                meta.uid()
            ),
            "run all as one user, or this one in a container; or, when no iceoryx2 program runs any more, remove it",
        );
    }
    Finding::ok(check, format!("{shown} belongs to this user"))
}

fn cleaned(done: &Cleaned) -> Vec<Finding> {
    let check = "leftovers";
    let mut found = Vec::new();
    if done.nodes.is_empty() && done.locks.is_empty() && done.failed.is_empty() {
        found.push(Finding::ok(check, "there was nothing to clean"));
    }
    if !done.nodes.is_empty() {
        let what = format!("removed: {}", nodes(&done.nodes));
        found.push(Finding::ok(check, what));
    }
    for lock in &done.locks {
        let what = format!(
            "removed: the lock of `{}`, which nobody held",
            lock.instance
        );
        found.push(Finding::ok(check, what));
    }
    for why in &done.failed {
        found.push(Finding::warning(
            check,
            format!("not removed: {why}"),
            "try again when no daemon runs",
        ));
    }
    found
}

/// The remedy for leftovers.
fn mend(clean: bool, instance: Option<&str>) -> &'static str {
    match (clean, instance) {
        (false, _) => {
            "`sweepd doctor --clean` removes it; a running daemon removes nodes of dead ones by itself"
        }
        (true, Some(_)) => "`sweepd doctor --clean` without --instance removes what is left of any",
        (true, None) => "try again when no daemon runs",
    }
}

/// * `instance` - the instance whose lock is reported; `None`: all.
fn judge(left: &Leftovers, instance: Option<&str>, mend: &str) -> Vec<Finding> {
    let check = "leftovers";
    let mut found = Vec::new();
    let (unknown, dead): (Vec<_>, Vec<_>) =
        left.dead.iter().cloned().partition(NodeOwner::is_unknown);
    if !dead.is_empty() {
        found.push(Finding::warning(check, nodes(&dead), mend));
    }
    // iceoryx2 does not remove these entries, and they do no harm.
    if !unknown.is_empty() {
        let what = format!(
            "{} that processes left which ended while they came or went: nothing is theirs any more",
            match unknown.len() {
                1 => "an entry".to_owned(),
                some => format!("{some} entries"),
            }
        );
        found.push(Finding::ok(check, what));
    }
    let names = left.locks.iter().map(|lock| lock.instance.as_str());
    let names = names.filter(|name| instance.is_none_or(|asked| asked == *name));
    if let Some(what) = locks(&names.collect::<Vec<_>>()) {
        found.push(Finding::warning(check, what, mend));
    }
    if left.unclear > 0 {
        found.push(Finding::warning(
            check,
            counted(
                left.unclear,
                "node that is damaged, or another user's",
                "nodes that are damaged, or another user's",
            ),
            "end all iceoryx2 programs, then remove their root directory",
        ));
    }
    found.extend(left.alive.iter().filter_map(zombie));
    let unmapped = &left.unmapped;
    // Files of dead nodes are reported with their nodes.
    if let (true, Some(example)) = (dead.is_empty(), &unmapped.example) {
        found.push(Finding::warning(
            check,
            format!(
                "shared memory that no process seen from here has mapped: {} (files: {}), such as {}",
                bytes(unmapped.bytes),
                unmapped.files,
                example.display()
            ),
            "where no other container shares them, remove them when no iceoryx2 program runs",
        ));
    }
    if found.is_empty() {
        let what = match left.alive.len() {
            0 => "none of dead processes, and no living one".to_owned(),
            1 => "none of dead processes; 1 node of a living one".to_owned(),
            some => format!("none of dead processes; {some} nodes of living ones"),
        };
        found.push(Finding::ok(check, what));
    }
    found
}

/// A warning if the node's process is a zombie: it counts as alive until its parent waits for it.
fn zombie(node: &NodeOwner) -> Option<Finding> {
    let parent = unreaped_by(node)?;
    Some(Finding::warning(
        "leftovers",
        format!("{node} has ended, and counts as alive until its parent {parent} waits for it"),
        "start daemons and sources under a parent that waits: a shell, systemd, `docker run --init`",
    ))
}

fn nodes(owners: &[NodeOwner]) -> String {
    let named: Vec<String> = owners.iter().take(NAMED).map(ToString::to_string).collect();
    let more = match owners.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    let count = match owners.len() {
        1 => "a node of a dead process".to_owned(),
        some => format!("{some} nodes of dead processes"),
    };
    format!("{count} ({}{more})", named.join("; "))
}

/// The text about locks that no process holds; `None`: there are none.
fn locks(instances: &[&str]) -> Option<String> {
    let named: Vec<String> = (instances.iter().take(NAMED))
        .map(|name| format!("`{name}`"))
        .collect();
    match (instances, instances.len().saturating_sub(NAMED)) {
        ([], _) => None,
        ([_], _) => Some(format!(
            "a lock of {} that nobody holds: its daemon was killed",
            named[0]
        )),
        (_, more) => Some(format!(
            "{} locks that nobody holds, of {}{}: their daemons were killed",
            instances.len(),
            named.join(", "),
            if more > 0 { ", .." } else { "" }
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    #[test]
    fn bug_many_locks_that_nobody_holds_are_one_line() {
        assert_eq!(locks(&[]), None);
        assert!(locks(&["a"]).unwrap().starts_with("a lock of `a` that"));
        let many = locks(&["a", "b", "c", "d"]).unwrap();
        assert!(
            many.starts_with("4 locks that nobody holds, of `a`, `b`, `c`, ..:"),
            "{many}"
        );
    }

    #[test]
    fn rights_are_judged_by_owner_kind_and_mode() {
        use std::os::unix::fs::PermissionsExt as _;
        let root = std::env::temp_dir().join(format!("sweepd_rights_{}", std::process::id()));
        let worst = || rights(&root).iter().map(|f| f.level as u8).max().unwrap();
        assert_eq!(worst(), Level::Ok as u8, "not there yet");
        std::fs::create_dir_all(root.join("nodes")).unwrap();
        let mode = |bits| {
            std::fs::set_permissions(&root, std::fs::Permissions::from_mode(bits)).unwrap();
        };
        mode(0o750);
        assert_eq!(worst(), Level::Ok as u8);
        mode(0o777);
        assert_eq!(worst(), Level::Warning as u8);
        let meta = std::fs::metadata(&root).unwrap();
        let theirs = judge_root(&root, &meta, meta.uid() + 1);
        assert!(theirs.level == Level::Wrong && theirs.what.contains("belongs to user id"));
        std::fs::remove_dir_all(&root).unwrap();
        std::fs::write(&root, "").unwrap();
        assert_eq!(worst(), Level::Wrong as u8, "a file");
        std::fs::remove_file(&root).unwrap();
    }

    #[test]
    fn what_is_left_is_a_warning_and_nothing_is_fine() {
        let mut left = Leftovers::default();
        assert_eq!(judge(&left, None, mend(false, None))[0].level, Level::Ok);
        let owner = NodeOwner {
            name: "sweepd/cell/client".to_owned(),
            ..NodeOwner::default()
        };
        left.dead = vec![owner; 5];
        let found = judge(&left, None, mend(false, None));
        assert_eq!((found.len(), found[0].level), (1, Level::Warning));
        assert!(found[0].text().contains("5 nodes") && found[0].text().contains("2 more"));
        left.dead = vec![NodeOwner::default()];
        let found = judge(&left, None, mend(false, None));
        assert_eq!((found.len(), found[0].level), (1, Level::Ok));
        assert!(found[0].what.starts_with("an entry"), "{}", found[0].what);
        left.dead.clear();
        left.unmapped.files = 2;
        left.unmapped.example = Some("/dev/shm/x".into());
        assert!(
            judge(&left, None, mend(false, None))[0]
                .text()
                .contains("/dev/shm/x")
        );
    }
}
