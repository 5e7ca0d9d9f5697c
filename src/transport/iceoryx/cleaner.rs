//! Frees what dead clients left behind, off the tick thread: one cleaning costs 7 to 30 ms when there is work.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::place::Place;
use super::qos::{self, Ipc};
use crate::error::{Error, Result};
use iceoryx2::prelude::Node;

/// Between two looks. An idle look costs 0.2 ms; a dead source's slot is free within this and one cleaning.
const PERIOD: Duration = Duration::from_millis(250);

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
    while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(PERIOD) {
        let state = node.try_cleanup_dead_nodes();
        if state.cleanups > 0 || state.failed_cleanups > 0 {
            tracing::info!(
                cleaned = state.cleanups,
                failed = state.failed_cleanups,
                "cleaned up after dead clients"
            );
        }
    }
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
