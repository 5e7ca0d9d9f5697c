//! Levels of messages to people, on `/rosout` and in the log. Pure.

/// A level of `/rosout` and of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Say {
    /// For information.
    Info,
    /// Needs attention.
    Warn,
    /// Something does not work.
    Error,
    /// Nothing works any more.
    Fatal,
}

impl Say {
    /// The lowest level that is published with this value of `--log-level`.
    pub(super) fn least(word: Option<&str>) -> Self {
        match word {
            Some("warn") => Self::Warn,
            Some("error") => Self::Error,
            Some("fatal") => Self::Fatal,
            _ => Self::Info,
        }
    }
}
