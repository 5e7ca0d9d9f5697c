//! What the kernel knows about a process id.

use std::path::Path;

/// A process of this pid namespace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Process {
    /// Its name, truncated to 15 bytes by the kernel.
    pub name: String,
    /// `R`, `S`, `D`, `T`, `Z` ..: see proc(5).
    pub state: char,
    /// Its parent.
    pub parent: u32,
}

/// `None`: there is no process with this id.
pub fn process(pid: u32) -> Option<Process> {
    read(&std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
}

/// `pid (name) state parent ..`; a name may contain spaces and parentheses.
fn read(stat: &str) -> Option<Process> {
    let (head, tail) = stat.rsplit_once(')')?;
    let (_, name) = head.split_once('(')?;
    let mut fields = tail.split_whitespace();
    Some(Process {
        name: name.to_owned(),
        state: fields.next()?.chars().next()?,
        parent: fields.next()?.parse().ok()?,
    })
}

impl Process {
    /// Returns whether it may be a process of this executable: in another namespace the id may be another process.
    pub fn is_named(&self, executable: &str) -> bool {
        !self.name.is_empty() && executable.starts_with(&self.name)
    }
}

/// Returns whether a process is in the same namespace of a kind (`mnt`, `time`, ..) as this one; `None`: no permission.
pub fn shares(pid: u32, kind: &str) -> Option<bool> {
    let of =
        |who: &str| std::fs::read_link(Path::new("/proc").join(who).join("ns").join(kind)).ok();
    Some(of("self")? == of(&pid.to_string())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_read_whatever_its_name_holds() {
        let found = read("12 (a (b) c) T 7 12 12 0 -1").unwrap();
        let wanted = Process {
            name: "a (b) c".to_owned(),
            state: 'T',
            parent: 7,
        };
        assert_eq!(found, wanted);
        assert_eq!(read("12 a b"), None);
        let us = process(std::process::id()).unwrap();
        assert_ne!(us.state, 'Z');
        assert_eq!(shares(std::process::id(), "mnt"), Some(true));
        assert_eq!(process(u32::MAX), None);
    }
}
