//! State shared by the node's threads: counters, demand, names, faults, and the writer of `/rosout`. All values are
//! atomics or behind locks that are held briefly; no thread waits for another one here.

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use ros2_client::log::Log;
use ros2_client::{Publisher, builtin_interfaces};

use super::lines::Arrival;
use super::open;
use super::order::{Order, Step};
use super::params::{Effect, Own};
use super::parcel::Caps;
pub(super) use super::say::Say;
use super::services::Desk;
use super::told::Told;
use crate::time::SystemClock;
use crate::transport::{BodyChange, Setting};
use crate::wire::Demand;
use crate::wire::ros::{Book, Counts, Time};

/// Stands for `None` in an atomic.
const NONE: u64 = u64::MAX;
/// A `/clock` message that is late by less is no sign of a restarted clock, nanoseconds.
const CLOCK_LATE_NS: u64 = 500_000_000;

/// State shared by the threads of the node.
pub(super) struct Shared {
    pub(super) stop: AtomicBool,
    /// Whether the node must be reopened, because a participant that DDS took as lost is back.
    pub(super) again: AtomicBool,
    undecodable: AtomicU64,
    refused: AtomicU64,
    unsent: AtomicU64,
    skew_ns: AtomicU64,
    demand: AtomicU8,
    max_pairs: AtomicUsize,
    max_contacts: AtomicUsize,
    max_skew_ns: AtomicU64,
    /// Time-out of each source of the scene, nanoseconds.
    timeouts_ns: Vec<AtomicU64>,
    markers: AtomicBool,
    markers_period_ns: AtomicU64,
    collisions: AtomicBool,
    reliable: AtomicBool,
    sim_time: AtomicBool,
    /// Newest time of `/clock`, nanoseconds; 0: none yet.
    pub(super) sim_now_ns: AtomicU64,
    /// Settings for the tick thread.
    settings: Mutex<Vec<Setting>>,
    pub(super) desk: Desk,
    /// Changes of bodies by edits, for the sending thread, which owns the node.
    pub(super) changes: Mutex<Vec<BodyChange>>,
    /// The same changes, with the new subscriptions, for the receiving thread.
    pub(super) arrivals: Mutex<Vec<Arrival>>,
    book: Mutex<Arc<Book>>,
    names_rev: AtomicU64,
    faults: Mutex<Vec<String>>,
    told: Mutex<Told>,
    /// Messages of the daemon for `/rosout`; the sending thread publishes them.
    pub(super) words: Mutex<Vec<String>>,
    rosout: Mutex<Option<Arc<Option<Publisher<Log>>>>>,
    /// Name of the logger.
    node: String,
    /// Lowest level that is published on `/rosout`.
    least: Say,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared")
            .field("counts", &self.counts())
            .field("demand", &self.demand())
            .finish_non_exhaustive()
    }
}

impl Shared {
    /// Creates the state of the node with this logger name.
    ///
    /// * `timeouts_ns` - time-out of each source of the scene, nanoseconds.
    pub(super) fn new(node: &str, book: Book, timeouts_ns: &[u64], least: Say) -> Self {
        Self {
            stop: AtomicBool::new(false),
            again: AtomicBool::new(false),
            undecodable: AtomicU64::new(0),
            refused: AtomicU64::new(0),
            unsent: AtomicU64::new(0),
            skew_ns: AtomicU64::new(NONE),
            demand: AtomicU8::new(0),
            max_pairs: AtomicUsize::new(0),
            max_contacts: AtomicUsize::new(0),
            max_skew_ns: AtomicU64::new(NONE),
            timeouts_ns: timeouts_ns.iter().map(|ns| AtomicU64::new(*ns)).collect(),
            markers: AtomicBool::new(false),
            markers_period_ns: AtomicU64::new(0),
            collisions: AtomicBool::new(false),
            reliable: AtomicBool::new(true),
            sim_time: AtomicBool::new(false),
            sim_now_ns: AtomicU64::new(0),
            settings: Mutex::new(Vec::new()),
            desk: Desk::default(),
            changes: Mutex::default(),
            arrivals: Mutex::default(),
            book: Mutex::new(Arc::new(book)),
            names_rev: AtomicU64::new(0),
            faults: Mutex::new(Vec::new()),
            told: Mutex::default(),
            words: Mutex::default(),
            rosout: Mutex::new(None),
            node: node.to_owned(),
            least,
        }
    }

    /// Applies the effects of parameters; the tick thread gets all its settings together.
    pub(super) fn take(&self, effects: impl Iterator<Item = Effect>) {
        // The effects are collected before the lock is taken, because the tick thread takes it, too.
        let effects: Vec<Effect> = effects.collect();
        let mut settings = open(&self.settings);
        effects
            .into_iter()
            .for_each(|effect| self.take_one(effect, &mut settings));
    }

    fn take_one(&self, effect: Effect, settings: &mut Vec<Setting>) {
        match effect {
            Effect::Tick(setting) => settings.push(setting),
            Effect::Timeout(source, timeout_ns) => {
                if let Some(slot) = self.timeouts_ns.get(source) {
                    slot.store(timeout_ns, Ordering::Relaxed);
                }
                settings.push(Setting::Timeout { source, timeout_ns });
            }
            Effect::Own(own) => match own {
                Own::MaxPairs(rows) => self.max_pairs.store(rows, Ordering::Relaxed),
                Own::MaxContacts(rows) => self.max_contacts.store(rows, Ordering::Relaxed),
                Own::MaxSkew(ns) => self
                    .max_skew_ns
                    .store(ns.unwrap_or(NONE), Ordering::Relaxed),
                Own::Markers(on) => self.markers.store(on, Ordering::Relaxed),
                Own::MarkersPeriod(ns) => self.markers_period_ns.store(ns, Ordering::Relaxed),
                Own::Collisions(on) => self.collisions.store(on, Ordering::Relaxed),
                Own::Reliable(on) => self.reliable.store(on, Ordering::Relaxed),
                Own::SimTime(on) => self.sim_time.store(on, Ordering::Relaxed),
            },
            Effect::None => {}
        }
    }

    /// Adds a setting of the node itself for the tick thread.
    pub(super) fn set(&self, setting: Setting) {
        open(&self.settings).push(setting);
    }

    /// Takes the settings since the last call.
    pub(super) fn take_settings(&self) -> Vec<Setting> {
        std::mem::take(&mut *open(&self.settings))
    }

    /// The time-out of a source of the scene, nanoseconds.
    pub(super) fn timeout_ns(&self, source: usize) -> u64 {
        let slot = self.timeouts_ns.get(source);
        slot.map_or(u64::MAX, |slot| slot.load(Ordering::Relaxed))
    }

    /// The largest skew of a chain, nanoseconds; `None`: as set in the scene.
    pub(super) fn max_skew_ns(&self) -> Option<u64> {
        let ns = self.max_skew_ns.load(Ordering::Relaxed);
        (ns != NONE).then_some(ns)
    }

    /// Period of marker messages, nanoseconds; `None`: markers are off.
    pub(super) fn markers_period_ns(&self) -> Option<u64> {
        let on = self.markers.load(Ordering::Relaxed);
        on.then(|| self.markers_period_ns.load(Ordering::Relaxed))
    }

    /// Whether `~/collisions` is published.
    pub(super) fn collisions(&self) -> bool {
        self.collisions.load(Ordering::Relaxed)
    }

    /// Whether lost messages of `~/pairs`, `~/contacts` and `~/collisions` are sent again.
    pub(super) fn reliable(&self) -> bool {
        self.reliable.load(Ordering::Relaxed)
    }

    /// Whether the node uses the time of `/clock`.
    pub(super) fn sim_time(&self) -> bool {
        self.sim_time.load(Ordering::Relaxed)
    }

    /// Text: the node uses the time of `/clock`, and none has come yet; `None`: it has, or it is not used.
    pub(super) fn lacks_clock(&self) -> Option<&'static str> {
        (self.sim_time() && self.sim_now_ns.load(Ordering::Relaxed) == 0).then_some(
            "/clock: use_sim_time is set, and no time has come: stamps are 0 until a simulator publishes it",
        )
    }

    /// Takes a time of `/clock`; returns whether the clock restarted while the node uses its time.
    ///
    /// * `order` - order of the times of this clock.
    /// * `boot_ns` - now, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn tick_clock(&self, clock: Time, order: &mut Order, boot_ns: u64) -> bool {
        let now_ns = clock.to_ns();
        let step = order.take(now_ns, boot_ns, CLOCK_LATE_NS);
        if matches!(step, Step::Late(_)) {
            self.note_refused(1);
            return false;
        }
        self.sim_now_ns.store(now_ns, Ordering::Relaxed);
        let back = step == Step::Anew && self.sim_time();
        if back {
            let text = "/clock went back: every pair ends, and bodies are not received until their next poses";
            self.say_seldom(Say::Warn, text, boot_ns);
        }
        back
    }

    /// The node's time, for stamps of messages without poses.
    pub(super) fn now(&self) -> Time {
        Time::from_ns(if self.sim_time() {
            self.sim_now_ns.load(Ordering::Relaxed)
        } else {
            SystemClock.realtime_ns()
        })
    }

    /// Whether the node is closing.
    pub(super) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Counts a sample that could not be decoded.
    pub(super) fn note_undecodable(&self) {
        self.undecodable.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts samples that were decoded, and refused or skipped for newer ones.
    pub(super) fn note_refused(&self, count: u64) {
        self.refused.fetch_add(count, Ordering::Relaxed);
    }

    /// Counts messages that were not sent.
    pub(super) fn note_unsent(&self, count: u64) {
        self.unsent.fetch_add(count, Ordering::Relaxed);
    }

    /// Sets the current largest skew of a chain, nanoseconds; `None`: no chain with a skew.
    pub(super) fn set_skew(&self, skew_ns: Option<u64>) {
        self.skew_ns
            .store(skew_ns.unwrap_or(NONE), Ordering::Relaxed);
    }

    /// The current counters.
    pub(super) fn counts(&self) -> Counts {
        let skew_ns = self.skew_ns.load(Ordering::Relaxed);
        Counts {
            sends_dropped: self.unsent.load(Ordering::Relaxed),
            undecodable: self.undecodable.load(Ordering::Relaxed),
            datagrams_dropped: 0,
            datagrams_unread: 0,
            refused: self.refused.load(Ordering::Relaxed),
            skew_ns: (skew_ns != NONE).then_some(skew_ns),
        }
    }

    /// The topics that have readers, as of the last look of the sending thread.
    pub(super) fn demand(&self) -> Demand {
        let bits = self.demand.load(Ordering::Relaxed);
        Demand {
            pairs: bits & 1 != 0,
            contacts: bits & 2 != 0,
            bodies: bits & 4 != 0,
            ..Demand::default()
        }
    }

    /// Sets the topics that have readers.
    pub(super) fn set_demand(&self, demand: Demand) {
        let bits =
            u8::from(demand.pairs) | u8::from(demand.contacts) << 1 | u8::from(demand.bodies) << 2;
        self.demand.store(bits, Ordering::Relaxed);
    }

    /// The row limits of messages.
    pub(super) fn caps(&self) -> Caps {
        Caps {
            pairs: self.max_pairs.load(Ordering::Relaxed),
            contacts: self.max_contacts.load(Ordering::Relaxed),
        }
    }

    /// The current names.
    pub(super) fn book(&self) -> Arc<Book> {
        Arc::clone(&open(&self.book))
    }

    /// Replaces the names.
    pub(super) fn set_book(&self, book: Arc<Book>) {
        *open(&self.book) = book;
    }

    /// A scene revision whose names the book has, or newer ones; 0: no tick has ended yet.
    pub(super) fn names_rev(&self) -> u64 {
        self.names_rev.load(Ordering::Acquire)
    }

    /// Notes that the book has the names of this scene revision; returns whether the revision is newer than before.
    #[must_use]
    pub(super) fn set_names_rev(&self, scene_rev: u64) -> bool {
        self.names_rev.fetch_max(scene_rev, Ordering::Release) < scene_rev
    }

    /// The current faults of inputs, as text.
    pub(super) fn faults(&self) -> Vec<String> {
        open(&self.faults).clone()
    }

    /// Replaces the current faults, and reports those that are new.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn set_faults(&self, faults: Vec<String>, now_ns: u64) {
        let mut new = faults.clone();
        {
            let mut told = open(&self.told);
            new.retain(|fault| told.is_new(fault, now_ns));
        }
        *open(&self.faults) = faults;
        for fault in &new {
            self.say(Say::Warn, fault);
        }
    }

    /// Sets or removes the writer of `/rosout`.
    pub(super) fn set_rosout(&self, writer: Option<Arc<Option<Publisher<Log>>>>) {
        *open(&self.rosout) = writer;
    }

    /// Reports that the stamps of a source went back.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn say_back(&self, source: &str, now_ns: u64) {
        let text = format!("the stamps of source {source} went back: its bodies begin anew");
        self.say_seldom(Say::Warn, &text, now_ns);
    }

    /// Reports an event that may recur with every message; the same text at most once per second.
    pub(super) fn say_seldom(&self, level: Say, text: &str, now_ns: u64) {
        let due = open(&self.told).is_due(text, now_ns);
        if due {
            self.say(level, text);
        }
    }

    /// Writes a text to the log (stderr) and to `/rosout`.
    pub(super) fn say(&self, level: Say, text: &str) {
        match level {
            Say::Info => tracing::info!("{text}"),
            Say::Warn => tracing::warn!("{text}"),
            Say::Error | Say::Fatal => tracing::error!("{text}"),
        }
        self.write(level, text);
    }

    /// Publishes a text on `/rosout`, if its level is high enough.
    pub(super) fn write(&self, level: Say, text: &str) {
        if level < self.least {
            return;
        }
        let Some(writer) = open(&self.rosout).clone() else {
            return;
        };
        if let Some(writer) = writer.as_ref() {
            let now = self.now();
            let said = writer.publish(Log {
                stamp: builtin_interfaces::Time::new(now.sec, now.nanosec),
                level: match level {
                    Say::Info => Log::INFO,
                    Say::Warn => Log::WARN,
                    Say::Error => Log::ERROR,
                    Say::Fatal => Log::FATAL,
                },
                name: self.node.clone(),
                msg: text.to_owned(),
                file: String::new(),
                function: String::new(),
                line: 0,
            });
            self.note_unsent(u64::from(said.is_err()));
        }
    }
}
