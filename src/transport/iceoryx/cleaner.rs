//! Frees what dead clients left behind, off the tick thread: one cleaning costs 7 to 30 ms when there is work.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::place::Place;
use super::qos::{self, Ipc};
use crate::error::{Error, Result};
use iceoryx2::prelude::Node;

/// Between two looks. An idle look costs 0.5 ms; a dead source's slot is free within this and one cleaning.
const PERIOD: Duration = Duration::from_millis(500);

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
    let node = qos::node(place, "cleaner")?;
    let (stop, stopped) = channel();
    let thread = std::thread::Builder::new()
        .name("sweepd-cleaner".to_owned())
        .spawn(move || clean_until(&node, &stopped))
        .map_err(|e| Error::io("the cleaning thread could not be started", e))?;
    Ok(Cleaner {
        stop: Some(stop),
        thread: Some(thread),
    })
}

fn clean_until(node: &Node<Ipc>, stopped: &Receiver<()>) {
    let mut failed = 0;
    while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(PERIOD) {
        let state = node.try_cleanup_dead_nodes();
        if is_news(state.cleanups, state.failed_cleanups, &mut failed) {
            tracing::info!(
                cleaned = state.cleanups,
                failed = state.failed_cleanups,
                "cleaned up after dead clients"
            );
        }
    }
}

/// Whether a look's outcome is worth a line. A process killed while it made its node leaves something that iceoryx2
/// does not clean, and every look from then on finds it: it is told once.
///
/// * `before` - failures of the last look; takes those of this one.
fn is_news(cleaned: u64, failed: u64, before: &mut u64) -> bool {
    let more = failed > *before;
    *before = failed;
    cleaned > 0 || more
}

impl Drop for Cleaner {
    fn drop(&mut self) {
        // the closed channel ends the thread at once
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
        let mut before = 0;
        let looks = [
            (0, 0, false),
            (0, 2, true),
            (0, 2, false),
            (1, 2, true),
            (0, 2, false),
            (0, 3, true),
            (0, 0, false),
            (0, 1, true),
        ];
        for (cleaned, failed, told) in looks {
            assert_eq!(is_news(cleaned, failed, &mut before), told);
        }
    }
}
