//! Where an instance is: its name, the root directory and prefix of iceoryx2's files, and their owner.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{
    Config, FileName, LogLevel, Path as IoxPath, SemanticString, set_log_level_from_env_or,
};

use crate::error::{Error, Result};

/// Longest instance name, bytes.
const INSTANCE_LEN_MAX: usize = 32;

/// An instance's name and the location of its files.
///
/// iceoryx2's configuration is made from this only: a configuration file in the current directory could give the daemon
/// and its clients different files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    instance: String,
    root: Option<PathBuf>,
    prefix: Option<String>,
    looks_only: bool,
}

impl Place {
    /// The place of `instance` in iceoryx2's default root.
    ///
    /// # Errors
    /// `Error::Usage` when the name is not 1 to 32 of `a-z`, `0-9` and `_`.
    pub fn new(instance: &str) -> Result<Self> {
        let fits = (1..=INSTANCE_LEN_MAX).contains(&instance.len())
            && instance
                .bytes()
                .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        if !fits {
            return Err(Error::Usage(format!(
                "instance name `{instance}`: use 1 to 32 of a-z, 0-9 and _"
            )));
        }
        Ok(Self {
            instance: instance.to_owned(),
            root: None,
            prefix: None,
            looks_only: false,
        })
    }

    /// The same instance under another root directory and file prefix; daemon and clients must agree.
    #[must_use]
    pub fn under(mut self, root: impl Into<PathBuf>, prefix: impl Into<String>) -> Self {
        self.root = Some(root.into());
        self.prefix = Some(prefix.into());
        self
    }

    /// The same files for a process that only reads: its nodes leave dead ones alone, while others clean them up when
    /// they are created, when they open a service and when they are dropped.
    #[must_use]
    pub fn looking_only(mut self) -> Self {
        self.looks_only = true;
        self
    }

    /// The instance's name.
    #[must_use]
    pub fn instance(&self) -> &str {
        &self.instance
    }

    /// The same files, another instance.
    ///
    /// # Errors
    /// As [`Place::new`].
    pub fn with_instance(&self, instance: &str) -> Result<Self> {
        let mut other = Self::new(instance)?;
        other.root.clone_from(&self.root);
        other.prefix.clone_from(&self.prefix);
        other.looks_only = self.looks_only;
        Ok(other)
    }

    /// Name of one of the instance's services of this wire version.
    pub(super) fn service(&self, topic: &str) -> String {
        format!("{}/v{}/{topic}", self.instance, crate::wire::WIRE_VERSION)
    }

    /// Name of the service that shows the wire version of the others.
    pub(super) fn hello(&self) -> String {
        format!("{}/hello", self.instance)
    }

    /// The root directory of iceoryx2's files.
    #[must_use]
    pub fn root(&self) -> PathBuf {
        self.root
            .clone()
            .unwrap_or_else(|| PathBuf::from(Config::default().global.root_path().to_string()))
    }

    /// The prefix of iceoryx2's files.
    pub(super) fn prefix(&self) -> String {
        self.prefix
            .clone()
            .unwrap_or_else(|| Config::default().global.prefix.to_string())
    }

    /// iceoryx2's configuration, made only from this place.
    pub(super) fn config(&self) -> Result<Config> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let mut config = Config::default();
        let bad = |what: &str| Error::Usage(format!("{what} cannot be used as a path of iceoryx2"));
        if let Some(root) = &self.root {
            let text = root
                .to_str()
                .ok_or_else(|| bad(&root.display().to_string()))?;
            let path = IoxPath::new(text.as_bytes()).map_err(|_| bad(text))?;
            config.global.set_root_path(&path);
        }
        if let Some(prefix) = &self.prefix {
            config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| bad(prefix))?;
        }
        if self.looks_only {
            config.global.node.cleanup_dead_nodes_on_creation = false;
            config.global.node.cleanup_dead_nodes_on_destruction = false;
            config.global.service.cleanup_dead_nodes_on_open = false;
        }
        Ok(config)
    }

    /// Returns whether the root exists; refused when it is another user's: if root and another user share it, iceoryx2
    /// drops samples silently.
    pub(super) fn check_owner(&self) -> Result<bool> {
        check_owner(&self.root())
    }
}

fn check_owner(root: &Path) -> Result<bool> {
    let meta = match std::fs::metadata(root) {
        Ok(meta) => meta,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        Err(e) => {
            return Err(Error::Refused(format!(
                "{}: {e}; shared memory belongs to one user, run as that user",
                root.display()
            )));
        }
    };
    let us = rustix::process::geteuid().as_raw();
    if meta.uid() != us {
        return Err(Error::Refused(format!(
            "{} belongs to user id {}, this process runs as {us}; run all as one user, or this one in a container: two \
             users of a machine do not share it",
            root.display(),
            meta.uid()
        )));
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instance_names_outside_the_alphabet_are_refused() {
        for bad in ["", "A", "a-b", "a/b", "ü", &"x".repeat(33)] {
            assert!(Place::new(bad).is_err(), "{bad}");
        }
        assert!(Place::new("cell_7").is_ok());
    }

    #[test]
    fn a_root_of_another_user_is_refused_with_both_ids() {
        // /proc/1 belongs to root; if run as root, /tmp gets a directory of another user.
        let theirs = if rustix::process::geteuid().is_root() {
            let dir = std::env::temp_dir().join(format!("sweepd_owner_{}", std::process::id()));
            std::fs::create_dir_all(&dir).unwrap();
            std::os::unix::fs::chown(&dir, Some(12345), None).unwrap();
            dir
        } else {
            PathBuf::from("/etc")
        };
        let place = Place::new("x").unwrap().under(&theirs, "p_");
        let text = place.check_owner().unwrap_err().to_string();
        assert!(text.contains("belongs to user id"), "{text}");
        // The command line has no option for another root.
        assert!(!text.contains("another root"), "{text}");
        if rustix::process::geteuid().is_root() {
            std::fs::remove_dir(&theirs).unwrap();
        }
    }
}
