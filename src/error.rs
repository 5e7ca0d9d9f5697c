//! The one public error: what went wrong, where, and what to change.
//!
//! Rooms keep small errors of their own and turn them into this one at their door; it names no room.

mod counted;
mod nearest;

use std::error::Error as StdError;

pub(crate) use counted::counted;
pub(crate) use nearest::{NAMES_COMPARED_MAX, nearest};

/// The cause beneath an [`Error`], as another library or an inner room reported it.
pub type Source = Box<dyn StdError + Send + Sync + 'static>;

/// What a user of sweepd can be told; each variant has its own exit code (see [`Error::exit_code`]).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A check that was asked for did not hold.
    #[error("{0}")]
    Failed(String),
    /// The command line or a parameter is off.
    #[error("{0}")]
    Usage(String),
    /// A scene file, shape or mesh cannot be used; the text names file, line, body and the mend.
    #[error("{0}")]
    Scene(String),
    /// Nothing came within the time allowed.
    #[error("{0}")]
    TimedOut(String),
    /// The instance is taken, belongs to another user, or rights are missing.
    #[error("{0}")]
    Refused(String),
    /// The operating system or a transport failed.
    #[error("{message}")]
    Io {
        /// What was tried, on what, and what to change.
        message: String,
        /// What the layer beneath said.
        #[source]
        source: Source,
    },
}

impl Error {
    /// An [`Error::Io`] with the layer's own error as its source.
    pub fn io(message: impl Into<String>, source: impl Into<Source>) -> Self {
        Self::Io {
            message: message.into(),
            source: source.into(),
        }
    }

    /// What it says, with what each layer beneath said, from the top down.
    #[must_use]
    pub fn with_causes(&self) -> String {
        let mut text = self.to_string();
        let mut cause = self.source();
        while let Some(beneath) = cause {
            // What passes an error on often says it, too.
            let beneath_text = beneath.to_string();
            if !text.ends_with(&beneath_text) {
                text += &format!(": {beneath_text}");
            }
            cause = beneath.source();
        }
        text
    }

    /// The exit code of the process: 1 a check failed, 2 usage, 3 timed out, 4 refused or could not run.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Usage(_) | Self::Scene(_) => 2,
            Self::TimedOut(_) => 3,
            Self::Refused(_) | Self::Io { .. } => 4,
        }
    }
}

/// Shorthand for results with the public [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
