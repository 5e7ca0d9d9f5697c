//! The watchdog: ends the process when the tick thread makes no progress. In: a counter that the tick thread raises.
//! Out: exit code 5, so that a supervisor restarts the daemon; readers notice by the missing heartbeat.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::error::{Error, Result};

/// Number of checks without progress after which the thread counts as stuck. Checks are counted, not time: after a
/// suspended machine or a stopped process wakes up, there was one check, not ten.
const LOOKS: u32 = 10;

/// Watches a thread until it is dropped.
#[derive(Debug)]
pub struct Watchdog {
    progress: Arc<AtomicU64>,
    ended: Arc<AtomicU64>,
    watcher: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Starts to watch: `stuck` is called once when [`Watchdog::progress`] was not raised for `limit`.
    ///
    /// # Errors
    /// `Error::Io` when the thread cannot be started.
    pub fn start(limit: Duration, stuck: impl FnOnce() + Send + 'static) -> Result<Self> {
        let (progress, ended) = (Arc::<AtomicU64>::default(), Arc::<AtomicU64>::default());
        let (seen_by, told) = (Arc::clone(&progress), Arc::clone(&ended));
        let watch = move || {
            let mut looks = Looks::default();
            while told.load(Ordering::Relaxed) == 0 {
                std::thread::park_timeout(limit / LOOKS);
                if looks.is_stuck(seen_by.load(Ordering::Relaxed)) {
                    return stuck();
                }
            }
        };
        let watcher = std::thread::Builder::new()
            .name("sweepd-watchdog".to_owned())
            .spawn(watch)
            .map_err(|e| Error::io("cannot start the watchdog's thread", e))?;
        Ok(Self {
            progress,
            ended,
            watcher: Some(watcher),
        })
    }

    /// The counter that the watched thread raises.
    #[must_use]
    pub fn progress(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.progress)
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.ended.store(1, Ordering::Relaxed);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            let _ended_anyway = watcher.join();
        }
    }
}

/// Checks of a counter.
#[derive(Default)]
struct Looks {
    last: Option<u64>,
    without_progress: u32,
}

impl Looks {
    fn is_stuck(&mut self, progress: u64) -> bool {
        if self.last == Some(progress) {
            self.without_progress += 1;
        } else {
            self.without_progress = 0;
        }
        self.last = Some(progress);
        self.without_progress >= LOOKS
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn ten_looks_in_a_row_without_progress_are_too_many() {
        let mut looks = Looks::default();
        let mut stuck = |progress| looks.is_stuck(progress);
        assert!((0..50).all(|progress| !stuck(progress)));
        // The first check sees a new value, nine more do not.
        assert!((0..10).all(|_| !stuck(50)));
        assert!(stuck(50));
    }

    #[test]
    fn a_thread_that_stands_still_is_reported_and_one_that_goes_on_is_not() {
        let (told, heard) = channel();
        let dog =
            Watchdog::start(Duration::from_millis(50), move || told.send(()).unwrap()).unwrap();
        heard.recv_timeout(Duration::from_secs(30)).unwrap();
        drop(dog);
        let (told, heard) = channel();
        let dog =
            Watchdog::start(Duration::from_secs(3600), move || told.send(()).unwrap()).unwrap();
        dog.progress().fetch_add(1, Ordering::Relaxed);
        // Ends at once, without a report.
        drop(dog);
        assert!(heard.recv_timeout(Duration::from_secs(30)).is_err());
    }
}
