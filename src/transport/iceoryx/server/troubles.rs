//! Clients that cannot send or receive: logged when it begins, then rarely, with the cause if it lies in this process.

use crate::time::Seldom;
use crate::transport::iceoryx::unmet::Unmet;
use crate::transport::open_files::short;

/// Time between two checks of how many files are open, nanoseconds: a check lists them, some 50 us.
const LOOK_NS: u64 = 100_000_000;

/// What went wrong with clients since the last check, and what was logged about it.
#[derive(Debug, Default)]
pub(super) struct Troubles {
    /// Connections that could not be made.
    pub(super) unmet: Unmet,
    /// Receives that failed.
    failed: u64,
    looked_ns: Option<u64>,
    errors: Seldom,
    crowded: Seldom,
    /// Text about the files from the last check that found too few.
    short: String,
}

impl Troubles {
    /// Counts messages that could not be received: their content is lost.
    pub(super) fn failed(&mut self, times: u64) {
        self.failed += times;
    }

    /// Logs what is due now.
    ///
    /// * `now_ns` - nanoseconds, always of the same clock.
    pub(super) fn tell(&mut self, now_ns: u64) {
        let is_due = |looked_ns| now_ns.saturating_sub(looked_ns) >= LOOK_NS;
        if self.looked_ns.is_none_or(is_due) {
            self.look(now_ns, short);
        }
        if let Some(times) = self.crowded.note(0, now_ns) {
            tracing::error!("{}", self.crowded_words(times));
        }
        if let Some(times) = self.errors.note(0, now_ns) {
            tracing::warn!(
                "{times} times messages of clients could not be received: a client died in the middle of one, or its files in \
                 shared memory are damaged; see `sweepd doctor`"
            );
        }
    }

    /// Finds the cause of what went wrong since the last check.
    ///
    /// * `short` - text if too few files are left.
    fn look(&mut self, now_ns: u64, short: impl Fn() -> Option<String>) {
        let (failed, unmet) = (std::mem::take(&mut self.failed), self.unmet.take());
        if failed + unmet == 0 {
            return;
        }
        self.looked_ns = Some(now_ns);
        if let Some(short) = short() {
            self.short = short;
            self.crowded.add(failed + unmet);
        } else {
            // A client that dies while connecting cannot be reached, and needs nothing any more.
            self.errors.add(failed);
        }
    }

    fn crowded_words(&self, times: u64) -> String {
        format!(
            "{times} times a port of a client could not be opened or read: {}. Clients that came last hear, or are heard, \
             in part or not at all; the others go on. End those that are not needed, or start the daemon anew with \
             more, and then the clients that were left out",
            self.short
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_clients_without_open_files_were_not_told_of() {
        let mut troubles = Troubles::default();
        let none = || None;
        let few = || Some("this process has 110 of the 110 files open".to_owned());
        troubles.look(5, none);
        assert_eq!(
            (troubles.looked_ns, troubles.crowded.note(0, 5)),
            (None, None)
        );
        troubles.failed(2);
        troubles.look(5, few);
        let times = troubles.crowded.note(0, 5);
        assert_eq!((times, troubles.errors.note(0, 5)), (Some(2), None));
        let words = troubles.crowded_words(2);
        assert!(
            words.contains("110 of the 110") && words.contains("in part"),
            "{words}"
        );
        // While there are enough files, failures are the client's.
        troubles.failed(3);
        troubles.look(6, none);
        assert_eq!(troubles.errors.note(0, 6), Some(3));
    }
}
