//! The recorder: the tick's thread copies each tick into reused memory, another thread writes it.
//!
//! In: the engine's input and output, after each tick. Out: records for a [`Sink`], in order. The tick's thread only
//! copies rows: it makes no system call, waits for no thread, and allocates only while records grow. Its time counts as
//! sending, so it is kept back from the budget. If the sink is too slow, messages for viewers are left out; if that is
//! not enough, the recording ends, which is logged once, and the daemon goes on.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::given::{Ask, Between, EditRecord, Origin, TickRecord};
use crate::error::{Error, Result};
use crate::limits::{RECORD_EDIT_BYTES_MAX, RECORD_QUEUE_BYTES_MAX};
use crate::tick::Engine;
use crate::time::{Clock as _, SystemClock};
use crate::wire::{Demand, Inbox};

/// How often the writer polls for records. No tick wakes it, since a wake-up would cost the tick a system call.
const LOOK: Duration = Duration::from_millis(20);
/// Longest time between two flushes of a recording, nanoseconds: a killed process loses that much.
pub const FLUSH_NS: u64 = 500_000_000;
/// Records kept for their memory: more than come between two polls at 1 kHz.
const SPARE_MAX: usize = 32;
/// Time between two ticks whose bodies are computed only for the recording, nanoseconds. Only viewers need them, since
/// a replay computes all of them.
const BODIES_NS: u64 = 100_000_000;

/// The destination of records.
pub trait Sink: Send {
    /// Writes one tick.
    ///
    /// * `hurried` - many records wait: what a replay does not need is to be left out.
    ///
    /// # Errors
    /// The failure, and what to change; the recording is over then.
    fn tick(&mut self, record: &TickRecord, hurried: bool) -> Result<()>;

    /// Flushes what was written, which then survives the end of this process.
    ///
    /// # Errors
    /// As [`Sink::tick`].
    fn flush(&mut self) -> Result<()>;

    /// Writes the last record: the reason for the end; empty: all was recorded.
    ///
    /// # Errors
    /// As [`Sink::tick`].
    fn end(&mut self, why: &str) -> Result<()>;
}

/// State shared by both threads.
struct Desk {
    state: Mutex<State>,
    wake: Condvar,
}

#[derive(Default)]
struct State {
    /// Records to be written, their bytes, and the bytes of their edits' requests and files.
    waiting: VecDeque<Box<TickRecord>>,
    bytes: usize,
    edit_bytes: usize,
    #[allow(
        clippy::vec_box,
        reason = "they go from list to list, and each is kilobytes by itself"
    )]
    spare: Vec<Box<TickRecord>>,
    /// Nothing follows, for this reason; empty: the daemon ended.
    ending: Option<String>,
    /// The sink failed: it takes no more records.
    failed: Option<Error>,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// `None`: the other thread holds the lock. That thread may be suspended meanwhile, for which no tick waits.
    fn try_lock(&self) -> Option<MutexGuard<'_, State>> {
        match self.state.try_lock() {
            Ok(state) => Some(state),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

/// The tick thread's side of a recording.
pub struct Recorder {
    desk: Arc<Desk>,
    writer: Option<JoinHandle<()>>,
    /// Memory for the next record.
    spare: Option<Box<TickRecord>>,
    /// Records that could not be handed to the writer yet.
    held: VecDeque<Box<TickRecord>>,
    between: Vec<Between>,
    origins: Vec<Origin>,
    /// Time of the last tick with bodies, nanoseconds of `CLOCK_BOOTTIME`.
    bodies_ns: u64,
    over: bool,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder")
            .field("over", &self.over)
            .finish_non_exhaustive()
    }
}

impl Recorder {
    /// Starts a recording to `sink`, which has written its start already.
    ///
    /// # Errors
    /// `Error::Io` if the writer's thread cannot be started.
    pub fn start(sink: Box<dyn Sink>) -> Result<Self> {
        let desk = Arc::new(Desk {
            state: Mutex::default(),
            wake: Condvar::new(),
        });
        let theirs = Arc::clone(&desk);
        let writer = std::thread::Builder::new()
            .name("sweepd-record".to_owned())
            .spawn(move || write(&theirs, sink))
            .map_err(|e| Error::io("cannot start the thread that records", e))?;
        Ok(Self {
            desk,
            writer: Some(writer),
            spare: None,
            held: VecDeque::new(),
            between: Vec::new(),
            origins: Vec::new(),
            bodies_ns: 0,
            over: false,
        })
    }

    /// The readers including this recording, which reads pairs and contacts, and bodies once per `BODIES_NS`.
    pub fn listen(&mut self, mut demand: Demand, now_ns: u64) -> Demand {
        if self.over {
            return demand;
        }
        demand.pairs = true;
        demand.contacts = true;
        if now_ns.saturating_sub(self.bodies_ns) >= BODIES_NS {
            demand.bodies = true;
        }
        if demand.bodies {
            self.bodies_ns = now_ns;
        }
        demand
    }

    /// Records a change of the engine before the next tick.
    pub fn note(&mut self, between: Between) {
        if !self.over {
            self.between.push(between);
        }
    }

    /// Records the origin of the next tick's next batch of edits; returns it if the recording is over.
    pub fn note_edit(&mut self, origin: Origin) -> Option<Origin> {
        if self.over {
            return Some(origin);
        }
        self.origins.push(origin);
        None
    }

    /// Records a tick: the engine's input and output.
    pub fn tick(&mut self, inbox: &Inbox, ask: Ask, engine: &Engine) {
        if self.over {
            return;
        }
        let mut record = self.spare.take().unwrap_or_default();
        record.clear();
        std::mem::swap(&mut record.between, &mut self.between);
        let outcomes = engine.outcomes().iter();
        let edits = self.origins.drain(..).zip(outcomes);
        record
            .edits
            .extend(edits.map(|(origin, outcome)| EditRecord {
                token: outcome.token,
                origin,
                outcome: outcome.result.clone(),
            }));
        record.take_input(inbox, ask, engine.now_ns());
        record.take_output(engine.outbox());
        self.held.push_back(record);
        let desk = Arc::clone(&self.desk);
        if let Some(mut state) = desk.try_lock() {
            self.hand_over(&mut state);
        }
    }

    /// Hands the held records to the writer, and takes memory for the next record.
    fn hand_over(&mut self, state: &mut State) {
        self.spare = state.spare.pop();
        while let Some(record) = self.held.pop_front() {
            let (bytes, edit_bytes) = (record.bytes(), record.edit_bytes());
            let too_many = state.bytes > 0 && state.bytes + bytes > RECORD_QUEUE_BYTES_MAX;
            let too_large = state.edit_bytes > 0
                && edit_bytes > 0
                && state.edit_bytes + edit_bytes > RECORD_EDIT_BYTES_MAX;
            if state.failed.is_some() {
                self.over = true;
            } else if too_many || too_large {
                self.over = true;
                let why = format!(
                    "the disk did not follow: {} MB waited to be written before tick {}",
                    (state.bytes + state.edit_bytes) / 1_000_000,
                    record.out.tick.header.tick
                );
                tracing::error!(
                    "the recording ends: {why}; the daemon goes on. Record to a faster disk, or fewer ticks"
                );
                state.ending = Some(why);
            }
            if self.over {
                self.held.clear();
                return;
            }
            state.bytes += bytes;
            state.edit_bytes += edit_bytes;
            state.waiting.push_back(record);
        }
    }

    /// Writes all waiting records and ends the recording normally; a recorder that is dropped instead records a
    /// breakdown.
    ///
    /// # Errors
    /// The failure of the sink that ended the recording; it was logged already. A slow disk is no error here.
    pub fn finish(mut self) -> Result<()> {
        self.close("");
        match self.desk.lock().failed.take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn close(&mut self, why: &str) {
        let desk = Arc::clone(&self.desk);
        let mut state = desk.lock();
        self.hand_over(&mut state);
        state.ending.get_or_insert_with(|| why.to_owned());
        drop(state);
        self.desk.wake.notify_one();
        if let Some(writer) = self.writer.take() {
            let _told_already = writer.join();
        }
    }
}

impl Drop for Recorder {
    /// Ends the recording with a breakdown: `finish` was not called.
    fn drop(&mut self) {
        self.close("the daemon broke down: its log says why");
    }
}

/// The writer's thread.
fn write(desk: &Desk, mut sink: Box<dyn Sink>) {
    if let Err(error) = write_all(desk, sink.as_mut()) {
        let text = error.with_causes();
        tracing::error!("the recording ends, the daemon goes on: {text}");
        let mut state = desk.lock();
        state.waiting.clear();
        (state.bytes, state.edit_bytes) = (0, 0);
        state.spare = Vec::new();
        state.failed = Some(error);
    }
}

fn write_all(desk: &Desk, sink: &mut dyn Sink) -> Result<()> {
    let clock = SystemClock;
    let (mut flushed_ns, mut is_dirty) = (clock.monotonic_ns(), false);
    loop {
        let mut state = desk.lock();
        if state.waiting.is_empty() && state.ending.is_none() {
            let waited = desk.wake.wait_timeout(state, LOOK);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let next = state.waiting.pop_front();
        let hurried = state.bytes > RECORD_QUEUE_BYTES_MAX / 2;
        let ending = state.ending.clone();
        drop(state);
        if let Some(mut record) = next {
            sink.tick(&record, hurried)?;
            is_dirty = true;
            let (bytes, edit_bytes) = (record.bytes(), record.edit_bytes());
            // Requests are large and rare: their memory is freed here, without the lock, for which a tick would have to
            // wait.
            record.edits.clear();
            let mut state = desk.lock();
            state.bytes = state.bytes.saturating_sub(bytes);
            state.edit_bytes = state.edit_bytes.saturating_sub(edit_bytes);
            if state.spare.len() < SPARE_MAX {
                state.spare.push(record);
            }
        } else if let Some(why) = ending {
            return sink.end(&why);
        }
        let now_ns = clock.monotonic_ns();
        if is_dirty && now_ns.saturating_sub(flushed_ns) >= FLUSH_NS {
            sink.flush()?;
            (flushed_ns, is_dirty) = (now_ns, false);
        }
    }
}

#[cfg(test)]
mod tests;
