//! Levels of what is said to people, on `/rosout` and in the log. Pure.

/// A level of `/rosout` and of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Say {
    /// For the record.
    Info,
    /// To be looked at.
    Warn,
    /// Something does not work.
    Error,
    /// Nothing works.
    Fatal,
}

impl Say {
    /// The least level that is said for the word of `--log-level`.
    pub(super) fn least(word: Option<&str>) -> Self {
        match word {
            Some("warn") => Self::Warn,
            Some("error") => Self::Error,
            Some("fatal") => Self::Fatal,
            _ => Self::Info,
        }
    }
}
