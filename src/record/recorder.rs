//! The recorder: the tick's thread copies a tick into memory that goes round, another thread writes it.
//!
//! In: what the engine was given and what it said, after each tick. Out: records for a [`Sink`], in order. The tick's
//! thread copies rows and no more: it makes no system call, waits for no disk, and allocates only while records grow.
//! What it takes counts as sending, so it is kept back from the budget. Where the sink cannot follow, what is only for
//! people is left out; where that is not enough, the recording ends, is told once, and the daemon goes on.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::given::{Ask, Between, EditRecord, Origin, TickRecord};
use crate::error::{Error, Result};
use crate::limits::RECORD_QUEUE_BYTES_MAX;
use crate::tick::Engine;
use crate::time::{Clock as _, SystemClock};
use crate::wire::{Demand, Inbox};

/// How often the writer looks for records: nobody wakes it, for a wake-up would cost the tick a system call.
const LOOK: Duration = Duration::from_millis(20);
/// Time between two flushes at most, nanoseconds: what a killed process loses.
const FLUSH_NS: u64 = 500_000_000;
/// Records kept for their memory: more than come between two looks at 1 kHz.
const SPARE_MAX: usize = 32;
/// Time between two ticks whose bodies are asked for only to be recorded, nanoseconds: for those who look at the file,
/// for a replay has them all.
const BODIES_NS: u64 = 100_000_000;

/// Where records go.
pub trait Sink: Send {
    /// Writes one tick.
    ///
    /// * `hurried` - much waits: what a replay does not need is to be left out.
    ///
    /// # Errors
    /// What failed, and what to change; the recording is over then.
    fn tick(&mut self, record: &TickRecord, hurried: bool) -> Result<()>;

    /// Hands over what was written: it survives the end of this process.
    ///
    /// # Errors
    /// As [`Sink::tick`].
    fn flush(&mut self) -> Result<()>;

    /// The last that is written: why nothing follows; empty: all was recorded.
    ///
    /// # Errors
    /// As [`Sink::tick`].
    fn end(&mut self, why: &str) -> Result<()>;
}

/// What both threads share.
struct Desk {
    state: Mutex<State>,
    wake: Condvar,
}

#[derive(Default)]
struct State {
    /// Records to be written, and what they take.
    waiting: VecDeque<Box<TickRecord>>,
    bytes: usize,
    #[allow(
        clippy::vec_box,
        reason = "they go from list to list, and each is kilobytes by itself"
    )]
    spare: Vec<Box<TickRecord>>,
    /// Nothing follows, and why; empty: the daemon ended.
    ending: Option<String>,
    /// The sink failed: nothing more is taken.
    failed: Option<Error>,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The tick thread's side of a recording.
pub struct Recorder {
    desk: Arc<Desk>,
    writer: Option<JoinHandle<()>>,
    between: Vec<Between>,
    origins: Vec<Origin>,
    /// When bodies were last asked for, nanoseconds of `CLOCK_BOOTTIME`.
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
    /// A recording that goes to `sink`, whose start is written already.
    ///
    /// # Errors
    /// `Error::Io` when the writer's thread cannot be started.
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
            between: Vec::new(),
            origins: Vec::new(),
            bodies_ns: 0,
            over: false,
        })
    }

    /// Who listens, this recording with them: to pairs and contacts, and now and then to bodies.
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

    /// Something was done to the engine, before the next tick.
    pub fn note(&mut self, between: Between) {
        if !self.over {
            self.between.push(between);
        }
    }

    /// What the next batch of the next tick's edits was made of.
    pub fn note_edit(&mut self, origin: Origin) {
        if !self.over {
            self.origins.push(origin);
        }
    }

    /// Records a tick: what the engine was given for it, and what it said.
    pub fn tick(&mut self, inbox: &Inbox, ask: Ask, engine: &Engine) {
        if self.over {
            return;
        }
        let spare = self.desk.lock().spare.pop();
        let mut record = spare.unwrap_or_default();
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
        let bytes = record.bytes();
        let mut state = self.desk.lock();
        if state.failed.is_some() {
            self.over = true;
        } else if state.bytes > 0 && state.bytes + bytes > RECORD_QUEUE_BYTES_MAX {
            self.over = true;
            let why = format!(
                "the disk did not follow: {} MB waited to be written before tick {}",
                state.bytes / 1_000_000,
                engine.ticks()
            );
            tracing::error!(
                "the recording ends: {why}; the daemon goes on. Record to a faster disk, or fewer ticks"
            );
            state.ending = Some(why);
        } else {
            state.bytes += bytes;
            state.waiting.push_back(record);
        }
    }

    /// Writes what waits and ends the recording.
    ///
    /// # Errors
    /// What failed, where the recording is not whole; it was told in the log already.
    pub fn finish(mut self) -> Result<()> {
        self.close();
        match self.desk.lock().failed.take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn close(&mut self) {
        self.desk.lock().ending.get_or_insert_default();
        self.desk.wake.notify_one();
        if let Some(writer) = self.writer.take() {
            let _told_already = writer.join();
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.close();
    }
}

/// The writer's thread.
fn write(desk: &Desk, mut sink: Box<dyn Sink>) {
    if let Err(error) = write_all(desk, sink.as_mut()) {
        let beneath = std::error::Error::source(&error);
        let beneath = beneath.map_or(String::new(), |e| format!(": {e}"));
        tracing::error!("the recording ends, the daemon goes on: {error}{beneath}");
        let mut state = desk.lock();
        state.waiting.clear();
        state.bytes = 0;
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
        if let Some(record) = next {
            sink.tick(&record, hurried)?;
            is_dirty = true;
            let mut state = desk.lock();
            state.bytes = state.bytes.saturating_sub(record.bytes());
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
mod tests {
    use std::path::Path;
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;
    use crate::scene::Scene;
    use crate::tick::TickInput;
    use crate::tick::build::build_shapes;
    use crate::time::ManualClock;

    /// Tells what it is handed; takes each tick only when it may.
    struct Slow {
        told: Sender<String>,
        may: Receiver<Result<()>>,
    }

    impl Sink for Slow {
        fn tick(&mut self, record: &TickRecord, _: bool) -> Result<()> {
            let tick = record.out.tick.header.tick;
            self.told.send(format!("tick {tick}")).unwrap();
            self.may.recv().unwrap_or(Ok(()))
        }
        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
        fn end(&mut self, why: &str) -> Result<()> {
            self.told.send(format!("end {why}")).unwrap();
            Ok(())
        }
    }

    /// An engine of one ball.
    fn engine() -> Engine {
        let text = "[[source]]\nname = \"s\"\n[[body]]\nname = \"a\"\nshape = { type = \"sphere\", radius = 1.0 }\n";
        let scene = Scene::parse(text, "s.toml", Path::new("")).unwrap();
        let shapes = build_shapes(&scene).unwrap();
        let clock = Arc::new(ManualClock::new(1));
        Engine::new(&scene, shapes.bodies, 7, clock).unwrap()
    }

    fn run(engine: &mut Engine, recorder: &mut Recorder, inbox: &Inbox) {
        let ask = Ask::default();
        engine.tick(TickInput {
            inbox,
            edits: &[],
            demand: ask.demand,
            budget: ask.budget,
            cause: ask.cause,
            cause_source: None,
            woke_ns: 0,
            pulse: None,
        });
        recorder.tick(inbox, ask, engine);
    }

    fn slow() -> (Recorder, Receiver<String>, Sender<Result<()>>) {
        let (told, heard) = channel();
        let (let_go, may) = channel();
        let sink = Box::new(Slow { told, may });
        (Recorder::start(sink).unwrap(), heard, let_go)
    }

    #[test]
    fn records_are_written_in_order_and_the_end_comes_last() {
        let (mut recorder, heard, let_go) = slow();
        let mut engine = engine();
        for _ in 0..50 {
            run(&mut engine, &mut recorder, &Inbox::default());
            let_go.send(Ok(())).unwrap();
        }
        recorder.finish().unwrap();
        let mut wanted: Vec<_> = (1..=50).map(|tick| format!("tick {tick}")).collect();
        wanted.push("end ".to_owned());
        assert_eq!(heard.try_iter().collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn a_disk_that_does_not_follow_ends_the_recording_and_nothing_else() {
        let (mut recorder, heard, let_go) = slow();
        let mut engine = engine();
        // Frames of a source that the scene does not have, as large as a fifth of what may wait.
        let mut inbox = Inbox::default();
        let rows = RECORD_QUEUE_BYTES_MAX / 5 / size_of::<crate::wire::TransformRow>();
        inbox.push().transforms = vec![Default::default(); rows];
        for _ in 0..20 {
            run(&mut engine, &mut recorder, &inbox);
        }
        assert!(recorder.over && engine.ticks() == 20);
        drop(let_go);
        recorder.finish().unwrap();
        let heard: Vec<_> = heard.try_iter().collect();
        assert_eq!(heard.len(), 5, "{heard:?}");
        assert!(
            heard[4].starts_with("end the disk did not follow"),
            "{heard:?}"
        );
    }

    #[test]
    fn a_sink_that_fails_is_told_once_and_takes_no_more() {
        let (mut recorder, heard, let_go) = slow();
        let mut engine = engine();
        let full = Error::io("cannot write x.mcap", std::io::Error::other("no space"));
        let_go.send(Err(full)).unwrap();
        run(&mut engine, &mut recorder, &Inbox::default());
        while recorder.desk.lock().failed.is_none() {
            std::thread::yield_now();
        }
        for _ in 0..5 {
            run(&mut engine, &mut recorder, &Inbox::default());
        }
        assert!(recorder.over);
        let error = recorder.finish().unwrap_err();
        assert!(error.to_string().contains("x.mcap"), "{error}");
        assert_eq!(heard.try_iter().collect::<Vec<_>>(), ["tick 1"]);
    }
}
