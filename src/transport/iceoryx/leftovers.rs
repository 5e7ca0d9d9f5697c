//! What dead processes left behind, for `sweepd doctor`. In: a place. Out: a list; or, on request, it is removed.
//!
//! iceoryx2 decides whether a node is dead: each living process holds a kernel lock. What only looks unused is reported
//! and never removed: a process of another pid namespace that shares the memory is not visible from here.

use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::node::{DeadNodeView, NodeCleanupFailure, NodeView};
use iceoryx2::prelude::{CallbackProgression, Node, NodeState};

use super::lock::{self, LOCK_DIR, Lock};
use super::place::Place;
use super::process::process;
use super::qos::{Ipc, failed};
use crate::error::Result;
use crate::transport::open_files::short;

/// How long to wait for another process that is cleaning up the same node.
const OTHERS: Duration = Duration::from_secs(1);
/// A younger file may be one that its creator is about to map, seconds.
const YOUNG_S: i64 = 5;
/// Part of the names of files that iceoryx2 creates once and keeps for ever.
const KEPT: &str = ".global_mgmt";

/// The owner of a node.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeOwner {
    /// The node's name: `sweepd/INSTANCE/ROLE`, or the name given by another program.
    pub name: String,
    /// Id of the process that made it, in its own pid namespace; 0: unknown.
    pub pid: u32,
    /// Its executable; empty: unknown.
    pub executable: String,
}

/// The parent of a process that has ended but was not reaped; `None`: it runs, or is not visible from here.
#[must_use]
pub fn unreaped_by(node: &NodeOwner) -> Option<u32> {
    let process = process(node.pid)?;
    (process.state == 'Z' && process.is_named(&node.executable)).then_some(process.parent)
}

/// What exists under a place's files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Leftovers {
    /// Nodes of living processes.
    pub alive: Vec<NodeOwner>,
    /// Nodes of dead processes: each holds services, ports and shared memory.
    pub dead: Vec<NodeOwner>,
    /// Nodes that this user may not inspect, and nodes whose files are damaged.
    pub unclear: usize,
    /// Locks without a holder.
    pub locks: Vec<Lock>,
    /// Shared memory that no process has mapped.
    pub unmapped: Unmapped,
}

/// Files in shared memory that no visible process has mapped, including those of dead nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unmapped {
    /// Number of files.
    pub files: usize,
    /// Memory used by them, bytes.
    pub bytes: u64,
    /// One of them.
    pub example: Option<PathBuf>,
}

/// Result of [`clean_leftovers`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// Removed nodes of dead processes, with everything that they owned.
    pub nodes: Vec<NodeOwner>,
    /// Removed locks.
    pub locks: Vec<Lock>,
    /// What could not be removed, and why.
    pub failed: Vec<String>,
}

/// Lists what is left under a place's files, without changes; the place's own instance name does not matter.
///
/// # Errors
/// `Error::Refused` when the files are another user's, `Error::Io` when they cannot be read.
pub fn leftovers(place: &Place) -> Result<Leftovers> {
    let mut found = Leftovers {
        locks: lock::locks(place)?,
        ..Leftovers::default()
    };
    found.locks.retain(|lock| lock.holder.is_none());
    if place.check_owner()? {
        each_node(place, |node| match node {
            NodeState::Alive(node) => found.alive.push(owner(&node)),
            NodeState::Dead(node) => found.dead.push(owner(&node)),
            NodeState::Inaccessible(_) | NodeState::Undefined(_) => found.unclear += 1,
        })?;
    }
    found.alive.sort();
    found.dead.sort();
    found.unmapped = unmapped(&place.prefix());
    Ok(found)
}

/// Removes what dead processes of this user left under a place's files: of one instance, or all.
///
/// # Errors
/// As [`leftovers`]; what cannot be removed is no error, it is listed in the result.
pub fn clean_leftovers(place: &Place, instance: Option<&str>) -> Result<Cleaned> {
    let mut done = Cleaned::default();
    let dead = if place.check_owner()? {
        dead_nodes(place)?
    } else {
        Vec::new()
    };
    for node in dead {
        let owner = owner(&node);
        if instance.is_none_or(|name| owner.is_of(name)) {
            match remove(node) {
                Ok(()) => done.nodes.push(owner),
                Err(why) => done.failed.push(format!("node {owner}: {why}")),
            }
        }
    }
    done.nodes.sort();
    let free = lock::locks(place)?
        .into_iter()
        .filter(|lock| lock.holder.is_none());
    for lock in free.filter(|lock| instance.is_none_or(|name| lock.instance == name)) {
        match lock::remove_free(&lock.path) {
            Ok(true) => done.locks.push(lock),
            // Another process took it meanwhile.
            Ok(false) => {}
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
            Err(e) => done.failed.push(format!("{}: {e}", lock.path.display())),
        }
    }
    Ok(done)
}

impl NodeOwner {
    /// Returns whether the node has no owner data: its process ended while it created or dropped the node, and owns
    /// nothing any more.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// Returns whether it is a node of this instance's daemon or of one of its clients.
    #[must_use]
    pub fn is_of(&self, instance: &str) -> bool {
        let rest = self.name.strip_prefix("sweepd/");
        rest.and_then(|rest| rest.strip_prefix(instance))
            .is_some_and(|rest| rest.starts_with('/'))
    }
}

impl std::fmt::Display for NodeOwner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let or = |text: &str, other: &str| if text.is_empty() { other } else { text }.to_owned();
        write!(
            f,
            "{} of {}, process {}",
            or(&self.name, "without a name"),
            or(&self.executable, "an unknown program"),
            self.pid
        )
    }
}

fn dead_nodes(place: &Place) -> Result<Vec<DeadNodeView<Ipc>>> {
    let mut dead = Vec::new();
    each_node(place, |node| {
        if let NodeState::Dead(node) = node {
            dead.push(node);
        }
    })?;
    Ok(dead)
}

fn each_node(place: &Place, mut take: impl FnMut(NodeState<Ipc>)) -> Result<()> {
    Node::<Ipc>::list(&place.config()?, |node| {
        take(node);
        CallbackProgression::Continue
    })
    .map_err(|e| failed(format!("nodes in {}", place.root().display()), e))
}

fn owner(node: &impl NodeView) -> NodeOwner {
    let details = node.details().as_ref();
    details.map_or_else(NodeOwner::default, |details| NodeOwner {
        name: details.name().as_str().to_owned(),
        pid: u32::try_from(details.process_id().value()).unwrap_or(0),
        executable: details.executable().to_string(),
    })
}

/// Dead nodes that could not be removed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Stuck {
    /// Which nodes, and why.
    pub(super) nodes: Vec<String>,
    /// Number of nodes without owner data: their processes ended while creating or dropping them.
    pub(super) unmade: usize,
}

/// Tries once more to remove what dead processes left under a place's files; returns what could not be removed.
///
/// # Errors
/// `Error::Io` when the nodes cannot be listed.
pub(super) fn stuck(place: &Place) -> Result<Stuck> {
    let mut stuck = Stuck::default();
    for node in dead_nodes(place)? {
        let owner = owner(&node);
        if owner.is_unknown() {
            stuck.unmade += 1;
        } else if let Err(why) = remove(node) {
            stuck.nodes.push(format!("{owner}: {why}"));
        }
    }
    Ok(stuck)
}

fn remove(node: DeadNodeView<Ipc>) -> std::result::Result<(), String> {
    // iceoryx2 would look for its files under its default root.
    if node.details().is_none() {
        return Err(
            "its process ended while it made it, and its files do not say where they are"
                .to_owned(),
        );
    }
    node.blocking_remove_stale_resources(OTHERS).map_err(why)
}

/// Why a dead node could not be removed, as text.
fn why(failure: NodeCleanupFailure) -> String {
    let text = match failure {
        NodeCleanupFailure::InsufficientPermissions => "this user may not remove its files",
        NodeCleanupFailure::VersionMismatch => "it was made by another version of iceoryx2",
        NodeCleanupFailure::AnotherInstanceIsCleaningUpTheNode => {
            "another process is cleaning it up, or was killed while it did"
        }
        NodeCleanupFailure::Interrupt => "a signal cut the cleaning",
        NodeCleanupFailure::ResourcesAlreadyCleanedUp => "it has just gone",
        NodeCleanupFailure::InternalError => {
            return short().unwrap_or_else(|| "its files are damaged".to_owned());
        }
    };
    text.to_owned()
}

/// This user's files in shared memory with this prefix that no process has mapped.
fn unmapped(prefix: &str) -> Unmapped {
    let mut found = Unmapped::default();
    let now_s = crate::time::SystemClock.realtime_ns() / 1_000_000_000;
    let us = rustix::process::geteuid().as_raw();
    let mut files = Vec::new();
    for entry in std::fs::read_dir(LOCK_DIR).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(meta) = entry.metadata() else { continue };
        let young = meta.mtime().saturating_add(YOUNG_S) > i64::try_from(now_s).unwrap_or(i64::MAX);
        if name.starts_with(prefix) && !name.contains(KEPT) && meta.uid() == us && !young {
            files.push((entry.path(), meta.ino(), meta.blocks() * 512));
        }
    }
    if files.is_empty() {
        return found;
    }
    let mapped = mapped_inodes();
    for (path, inode, bytes) in files {
        if !mapped.contains(&inode) {
            found.files += 1;
            found.bytes += bytes;
            found.example.get_or_insert(path);
        }
    }
    found
}

/// Inode numbers of all shared memory mapped by processes, as far as these may be inspected.
fn mapped_inodes() -> BTreeSet<u64> {
    let mut inodes = BTreeSet::new();
    for process in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let numbered = process.file_name().to_string_lossy().parse::<u32>().is_ok();
        let maps = numbered.then(|| std::fs::read_to_string(process.path().join("maps")));
        let Some(Ok(maps)) = maps else { continue };
        // address, rights, offset, device, inode, path
        inodes.extend(maps.lines().filter_map(|line| {
            let mut fields = line.split_whitespace();
            let inode = fields.nth(4)?.parse::<u64>().ok()?;
            Path::new(fields.next()?)
                .starts_with(LOCK_DIR)
                .then_some(inode)
        }));
    }
    inodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_of_the_instance_in_its_name_and_of_no_longer_one() {
        let node = |name: &str| NodeOwner {
            name: name.to_owned(),
            ..NodeOwner::default()
        };
        assert!(node("sweepd/cell/daemon").is_of("cell"));
        for other in ["sweepd/cell_2/daemon", "sweepd/cell", "cell/daemon", ""] {
            assert!(!node(other).is_of("cell"), "{other}");
        }
    }
}
