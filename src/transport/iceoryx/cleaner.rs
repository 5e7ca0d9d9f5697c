//! Frees what dead clients left behind, on a separate thread: one cleaning costs 7 to 30 ms when there is work.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::leftovers::{Stuck, stuck};
use super::place::Place;
use super::qos::{self, Ipc};
use crate::error::{Error, Result};
use iceoryx2::prelude::Node;

/// Time between two checks. An idle check costs 0.5 ms; a dead source's slot is free within this and one cleaning.
const PERIOD: Duration = Duration::from_millis(500);
/// Number of nodes named in a log line.
const NAMED: usize = 3;

/// The cleaning thread; dropping it ends and joins the thread.
#[derive(Debug)]
pub struct Cleaner {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Starts the cleaning thread of a place. A killed process that its parent has not waited for counts as alive.
///
/// # Errors
/// `Error::Io` when no node or thread can be made.
pub fn spawn_cleaner(place: &Place) -> Result<Cleaner> {
    let (node, place) = (qos::node(place, "cleaner")?, place.clone());
    let (stop, stopped) = channel();
    let thread = std::thread::Builder::new()
        .name("sweepd-cleaner".to_owned())
        .spawn(move || clean_until(&node, &place, &stopped))
        .map_err(|e| Error::io("the cleaning thread could not be started", e))?;
    Ok(Cleaner {
        stop: Some(stop),
        thread: Some(thread),
    })
}

fn clean_until(node: &Node<Ipc>, place: &Place, stopped: &Receiver<()>) {
    let mut failures = Failures::default();
    while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(PERIOD) {
        let state = node.try_cleanup_dead_nodes();
        match state.cleanups {
            0 => {}
            1 => tracing::info!("cleaned up what a dead process left in shared memory"),
            some => tracing::info!(
                "cleaned up what {some} nodes of dead processes left in shared memory"
            ),
        }
        if !failures.are_news(state.failed_cleanups) {
            continue;
        }
        match stuck(place) {
            Ok(stuck) => stuck.tell(place),
            Err(e) => tracing::warn!(
                "what dead processes left cannot be looked at: {}",
                e.with_causes()
            ),
        }
    }
}

/// Nodes that could not be cleaned up.
#[derive(Debug, Default)]
struct Failures {
    /// Number at the last check.
    before: u64,
    told: u64,
}

impl Failures {
    /// Returns whether there are more than were reported. Only failures that the last check had too are counted, for a
    /// node that another process is just cleaning up is gone by the next check. Lasting failures are reported once, not
    /// with every check.
    fn are_news(&mut self, failed: u64) -> bool {
        let lasting = failed.min(self.before);
        self.before = failed;
        let told = std::mem::replace(&mut self.told, lasting);
        lasting > told
    }
}

impl Stuck {
    /// Logs what is left behind, why, and whether that matters.
    fn tell(&self, place: &Place) {
        if !self.nodes.is_empty() {
            tracing::warn!("{}", self.words());
        }
        if self.unmade > 0 {
            tracing::info!("{}", self.unmade_words(&place.root()));
        }
    }

    fn words(&self) -> String {
        let named: Vec<&str> = self.nodes.iter().take(NAMED).map(String::as_str).collect();
        let more = match self.nodes.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; and {more} more"),
        };
        format!(
            "what dead processes left cannot be cleaned up: {}{more}. They keep their places among the clients, and their \
             shared memory; `sweepd doctor --clean` tries again, and tells what is in its way",
            named.join("; ")
        )
    }

    fn unmade_words(&self, root: &Path) -> String {
        let who = match self.unmade {
            1 => "a process that ended while it came or went left an entry".to_owned(),
            some => format!("processes that ended while they came or went left {some} entries"),
        };
        format!(
            "{who} in {} that cannot be cleaned up: nothing is theirs any more, and that does no harm",
            root.join("nodes").display()
        )
    }
}

impl Drop for Cleaner {
    fn drop(&mut self) {
        // Closing the channel ends the thread at once.
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ended_anyway = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_what_cannot_be_cleaned_is_told_once_and_not_with_every_look() {
        let mut failures = Failures::default();
        let looks = [
            (0, false),
            // Another process may be cleaning them up.
            (2, false),
            (2, true),
            (2, false),
            (3, false),
            (3, true),
            (2, false),
            (0, false),
            (1, false),
            (0, false),
            (1, false),
            (1, true),
        ];
        for (at, (failed, told)) in looks.into_iter().enumerate() {
            assert_eq!(failures.are_news(failed), told, "look {at}");
        }
    }

    #[test]
    fn bug_what_was_not_cleaned_up_was_said_to_be_and_without_a_reason() {
        let mut stuck = Stuck {
            nodes: vec![
                "sweepd/x/client of feed, process 7: its files are another user's".to_owned(),
            ],
            unmade: 1,
        };
        let text = stuck.words();
        assert!(
            text.contains("cannot be cleaned up: sweepd/x/client of feed, process 7: "),
            "{text}"
        );
        assert!(
            text.contains("keep their places") && !text.contains("more"),
            "{text}"
        );
        let root = Path::new("/tmp/iceoryx2");
        let text = stuck.unmade_words(root);
        assert!(
            text.contains("left an entry in /tmp/iceoryx2/nodes"),
            "{text}"
        );
        assert!(text.ends_with("does no harm"), "{text}");
        stuck.nodes.resize(5, "another".to_owned());
        stuck.unmade = 3;
        assert!(
            stuck.words().contains("; and 2 more. They"),
            "{}",
            stuck.words()
        );
        assert!(stuck.unmade_words(root).contains("left 3 entries"));
    }
}
