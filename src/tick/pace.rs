//! The pacer: when a tick happens, why, and which frames it takes.
//!
//! In: drained frames, whether edits wait, the nearest time-out, the time on `CLOCK_BOOTTIME`. Out: the frames of the
//! next tick with its cause, and when to wake. Pure: no transport, no clock of its own; all times are nanoseconds of
//! `CLOCK_BOOTTIME`, so that a suspended machine wakes to a tick. No allocation once the queues have been at their
//! longest.
//!
//! In every mode a tick goes out at least each heartbeat, at the nearest time-out and after an edit. With `on_frame`
//! those ticks take no frame and judge ages only; with `on_all` they leave a round that is under way alone; with a
//! rate every tick takes the newest state. Of a source that moves continuous bodies all frames are taken, in each mode.

mod held;
mod source;

use held::{Held, Queue, Vertices};
use source::Source;

use crate::config::{Config, Mode};
use crate::error::{Error, Result};
use crate::ids::SourceSlot;
use crate::scene::SourceSpec;
use crate::wire::{Inbox, TickCause, name_bytes, name_str};

/// A tick that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// Why.
    pub cause: TickCause,
    /// Whose frame it is, where one frame is the cause.
    pub source: Option<SourceSlot>,
    /// It judges ages (and applies edits) only and spends no work units.
    pub ages_only: bool,
}

/// What makes a tick.
#[derive(Clone, Copy, Debug)]
enum Beat {
    /// Each frame of this source.
    OnFrame(usize),
    /// A round, which began with a frame received then.
    OnAll { since_ns: Option<u64>, late_ns: u64 },
    /// Every so often.
    Rate {
        period_ns: u64,
        next_ns: Option<u64>,
    },
}

/// Decides when ticks happen.
#[derive(Clone, Debug)]
pub struct Pacer {
    beat: Beat,
    heartbeat_ns: u64,
    sources: Vec<Source>,
    queue: Queue,
    vertices: Vertices,
    /// Sessions that ended, until the last of their frames is handed out.
    ended: Vec<u64>,
    passed_of_none: u64,
    last_tick_ns: Option<u64>,
}

impl Pacer {
    /// A pacer for a scene's mode and sources. Its first tick is due at once.
    ///
    /// # Errors
    /// `Error::Usage` when the mode names no source of the scene, or its rate is no positive number.
    pub fn new(config: &Config, sources: &[SourceSpec]) -> Result<Self> {
        let names: Vec<&str> = sources.iter().map(|s| &*s.name).collect();
        let beat = beat_of(config, &names)?;
        Ok(Self {
            beat,
            heartbeat_ns: config.heartbeat_ns.max(1),
            sources: sources.iter().map(Source::new).collect(),
            queue: Queue::default(),
            vertices: Vertices::default(),
            ended: Vec::new(),
            passed_of_none: 0,
            last_tick_ns: None,
        })
    }

    /// Changes the mode; frames that wait are kept for the next tick.
    ///
    /// # Errors
    /// As [`Pacer::new`]; the mode then stays as it is.
    pub fn set_mode(&mut self, config: &Config) -> Result<()> {
        let names = self.sources.iter();
        let names: Vec<&str> = names.map(|s| name_str(&s.name).unwrap_or("")).collect();
        self.beat = beat_of(config, &names)?;
        Ok(())
    }

    /// Sets the time-out of a source, by its place.
    pub fn set_timeout(&mut self, source: usize, timeout_ns: u64) {
        if let Some(source) = self.sources.get_mut(source) {
            source.timeout_ns = timeout_ns;
        }
    }

    /// Sets whether each frame of a source counts: see `World::is_followed`.
    pub fn set_followed(&mut self, source: usize, followed: bool) {
        if let Some(source) = self.sources.get_mut(source) {
            source.followed = followed;
        }
    }

    /// Takes everything out of an inbox and leaves it empty.
    pub fn take(&mut self, inbox: &mut Inbox, now_ns: u64) {
        // No allocation: as a rule nobody is.
        let gone = inbox.ended().to_vec();
        for frame in inbox.frames_mut() {
            let name = name_str(&frame.header.source).map(name_bytes);
            let place = self.sources.iter().position(|s| Some(s.name) == name);
            let received_ns = match frame.received_ns {
                0 => now_ns,
                received_ns => received_ns.min(now_ns),
            };
            let source = place.and_then(|p| self.sources.get_mut(p));
            if let Some(source) = source.filter(|s| s.is_spoken_for(frame, received_ns, &gone)) {
                source.heard_ns = Some(source.heard_ns.unwrap_or(0).max(received_ns));
                source.passed += source.lost_before(&frame.header);
                source.session = frame.header.session;
                source.sent = true;
                source.late = false;
                if let Beat::OnAll { since_ns, .. } = &mut self.beat {
                    since_ns.get_or_insert(received_ns);
                }
            }
            let leads = |at| matches!(self.beat, Beat::OnFrame(lead) if at == lead);
            let alone = place.is_some_and(|at| leads(at) || self.sources[at].followed);
            let passed = self.queue.put(frame, place, alone);
            let source = place.and_then(|p| self.sources.get_mut(p));
            *source.map_or(&mut self.passed_of_none, |source| &mut source.passed) += passed;
        }
        for frame in inbox.vertices_mut() {
            let name = name_str(&frame.header.source).map(name_bytes);
            let place = self.sources.iter().position(|s| Some(s.name) == name);
            self.vertices.put(frame, place);
        }
        for &session in inbox.ended() {
            self.ended.push(session);
            for source in self.sources.iter_mut().filter(|s| s.session == session) {
                source.heard_ns = None;
            }
        }
        inbox.clear();
    }

    /// The tick that is due now, with its frames; `None`: none is. To be asked again until it says so.
    ///
    /// * `edits` - whether scene edits wait; they go with the tick, whatever its cause.
    /// * `next_timeout_ns` - `World::next_timeout`.
    /// * `into` - emptied, then filled.
    pub fn due(
        &mut self,
        now_ns: u64,
        edits: bool,
        next_timeout_ns: Option<u64>,
        into: &mut Inbox,
    ) -> Option<Due> {
        into.clear();
        let due = self.due_by_frame(now_ns, into).or_else(|| {
            let cause = self.cause_without_frame(now_ns, edits, next_timeout_ns)?;
            let on_frame = matches!(self.beat, Beat::OnFrame(_));
            match self.beat {
                Beat::Rate { .. } => self.queue.take(into, |_| true),
                // Frames of no source are in no round: they are refused, and that is told soon.
                _ => self.queue.take(into, |held| held.source.is_none()),
            }
            Some(Due {
                cause,
                source: None,
                ages_only: on_frame,
            })
        })?;
        let lead = match self.beat {
            Beat::OnFrame(lead) => Some(lead),
            _ => None,
        };
        self.vertices.take(into, lead, self.queue.frames());
        self.hand_over_ended(into);
        self.last_tick_ns = Some(now_ns);
        Some(due)
    }

    /// When something is due next, if nothing comes in before.
    #[must_use]
    pub fn wake_ns(&self, now_ns: u64, next_timeout_ns: Option<u64>) -> u64 {
        let heartbeat_ns = self
            .last_tick_ns
            .map_or(now_ns, |t| t.saturating_add(self.heartbeat_ns));
        let beat_ns = match self.beat {
            Beat::OnFrame(lead) => self.has_frame_of(lead).then_some(now_ns),
            Beat::OnAll { .. } => self.round_ends_ns(now_ns),
            Beat::Rate { next_ns, .. } => Some(next_ns.unwrap_or(now_ns)),
        };
        [beat_ns, next_timeout_ns]
            .into_iter()
            .flatten()
            .fold(heartbeat_ns, u64::min)
    }

    /// Hands out how many frames were passed over since the last call: for a newer one, or because too many waited.
    /// `None` stands for frames of no source of the scene.
    pub fn drain_passed(&mut self, mut each: impl FnMut(Option<SourceSlot>, u64)) {
        for (place, source) in self.sources.iter_mut().enumerate() {
            if source.passed > 0 {
                each(Some(slot(place)), std::mem::take(&mut source.passed));
            }
        }
        if self.passed_of_none > 0 {
            each(None, std::mem::take(&mut self.passed_of_none));
        }
    }

    /// A tick by the mode's own rule.
    fn due_by_frame(&mut self, now_ns: u64, into: &mut Inbox) -> Option<Due> {
        let by_frame = |source| Due {
            cause: TickCause::Frame,
            source,
            ages_only: false,
        };
        match self.beat {
            Beat::OnFrame(lead) => {
                if !self.has_frame_of(lead) {
                    return None;
                }
                let mut first = true;
                self.queue.take(into, |held: &Held| {
                    held.source != Some(lead) || std::mem::take(&mut first)
                });
                Some(by_frame(Some(slot(lead))))
            }
            Beat::OnAll { late_ns, .. } => {
                if self.round_ends_ns(now_ns)? > now_ns {
                    return None;
                }
                self.close_round(now_ns, late_ns);
                self.queue.take(into, |_| true);
                Some(by_frame(None))
            }
            Beat::Rate { period_ns, next_ns } => {
                let beat_ns = next_ns.unwrap_or(now_ns);
                if now_ns < beat_ns {
                    return None;
                }
                // Beats that were missed are gone: the next one is the first that lies ahead.
                let missed = (now_ns - beat_ns) / period_ns;
                let next_ns = Some(beat_ns.saturating_add((missed + 1).saturating_mul(period_ns)));
                self.beat = Beat::Rate { period_ns, next_ns };
                self.queue.take(into, |_| true);
                Some(by_frame(None))
            }
        }
    }

    /// A tick that none of the mode's frames or beats makes.
    fn cause_without_frame(
        &self,
        now_ns: u64,
        edits: bool,
        next_timeout_ns: Option<u64>,
    ) -> Option<TickCause> {
        let silent = self
            .last_tick_ns
            .is_none_or(|last| now_ns.saturating_sub(last) >= self.heartbeat_ns);
        if edits {
            Some(TickCause::Edit)
        } else if next_timeout_ns.is_some_and(|t| t <= now_ns) {
            Some(TickCause::Timeout)
        } else {
            silent.then_some(TickCause::Heartbeat)
        }
    }

    fn has_frame_of(&self, source: usize) -> bool {
        self.queue.frames().iter().any(|h| h.source == Some(source))
    }

    /// When the round under way ends: now, if every source that is waited for has sent; else when it is late.
    fn round_ends_ns(&self, now_ns: u64) -> Option<u64> {
        let Beat::OnAll {
            since_ns: Some(since_ns),
            late_ns,
        } = self.beat
        else {
            return None;
        };
        let missing = self
            .sources
            .iter()
            .any(|s| s.is_waited_for(now_ns) && !s.sent);
        let late_ns = since_ns.saturating_add(late_ns);
        Some(if missing { late_ns } else { now_ns })
    }

    fn close_round(&mut self, now_ns: u64, late_ns: u64) {
        for source in &mut self.sources {
            source.late |= source.is_waited_for(now_ns) && !source.sent;
            source.sent = false;
        }
        self.beat = Beat::OnAll {
            since_ns: None,
            late_ns,
        };
    }

    /// Sessions that ended go out with, or after, the last of their frames.
    fn hand_over_ended(&mut self, into: &mut Inbox) {
        let waiting = self.queue.frames();
        self.ended.retain(|&session| {
            let waits = waiting.iter().any(|h| h.frame.header.session == session);
            if !waits {
                self.vertices.forget(session);
                into.end_session(session);
            }
            waits
        });
    }
}

impl Source {
    /// Whether a round waits for it: alive, and not late in the round before.
    fn is_waited_for(&self, now_ns: u64) -> bool {
        let alive = |heard_ns| now_ns.saturating_sub(heard_ns) < self.timeout_ns;
        !self.late && self.heard_ns.is_some_and(alive)
    }
}

/// There are at most 16 sources.
fn slot(place: usize) -> SourceSlot {
    SourceSlot(u32::try_from(place).unwrap_or(u32::MAX))
}

fn beat_of(config: &Config, sources: &[&str]) -> Result<Beat> {
    Ok(match &config.mode {
        Mode::OnFrame(name) => {
            let place = sources.iter().position(|own| own == name);
            Beat::OnFrame(place.ok_or_else(|| no_such_source(name, sources))?)
        }
        Mode::OnAll => Beat::OnAll {
            since_ns: None,
            late_ns: config.late_ns,
        },
        Mode::Rate(hz) => Beat::Rate {
            period_ns: period_ns(*hz)?,
            next_ns: None,
        },
    })
}

fn no_such_source(name: &str, sources: &[&str]) -> Error {
    let names = if sources.is_empty() {
        "none".to_owned()
    } else {
        sources.join(", ")
    };
    Error::Usage(format!(
        "mode `on_frame`: the scene has no source `{name}`; it has {names}"
    ))
}

fn period_ns(hz: f64) -> Result<u64> {
    let period_ns = 1e9 / hz;
    if !(hz.is_finite() && hz > 0.0 && period_ns < 1e18) {
        return Err(Error::Usage(format!(
            "mode `rate`: {hz} ticks a second cannot be: give a positive number of hertz"
        )));
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 1e18, checked above"
    )]
    let period_ns = period_ns as u64;
    Ok(period_ns.max(1))
}
