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

mod beat;
mod bent;
mod fold;
mod held;
mod round;
mod source;

use beat::Beat;
use bent::{Ahead, Vertices};
use held::{Held, Queue, Turn, Whose};
use source::{Source, Speaker};

use crate::config::Config;
use crate::error::Result;
use crate::ids::SourceSlot;
use crate::scene::SourceSpec;
use crate::wire::{Frame, Inbox, TickCause, name_bytes, name_str};
use crate::world::World;

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
    /// See [`Pacer::know`].
    floor_ns: u64,
    boot_ahead_ns: u64,
}

impl Pacer {
    /// A pacer for a scene's mode and sources. Its first tick is due at once.
    ///
    /// # Errors
    /// `Error::Usage` when the mode names no source of the scene, or its rate is no positive number.
    pub fn new(config: &Config, sources: &[SourceSpec]) -> Result<Self> {
        let names: Vec<&str> = sources.iter().map(|s| &*s.name).collect();
        let beat = Beat::of(config, &names)?;
        Ok(Self {
            beat,
            heartbeat_ns: config.heartbeat_ns.max(1),
            sources: sources.iter().map(Source::new).collect(),
            queue: Queue::default(),
            vertices: Vertices::default(),
            ended: Vec::new(),
            passed_of_none: 0,
            last_tick_ns: None,
            floor_ns: 0,
            boot_ahead_ns: 0,
        })
    }

    /// Changes the mode; frames that wait are kept for the next tick.
    ///
    /// # Errors
    /// As [`Pacer::new`]; the mode then stays as it is.
    pub fn set_mode(&mut self, config: &Config) -> Result<()> {
        let names = self.sources.iter();
        let names: Vec<&str> = names.map(|s| name_str(&s.name).unwrap_or("")).collect();
        self.beat = Beat::of(config, &names)?;
        let counting = self.queue.frames().iter().filter(|held| held.whose.speaks);
        let first_ns = counting.map(|held| held.whose.received_ns).min();
        if let Beat::OnAll { since_ns, .. } = &mut self.beat {
            *since_ns = first_ns;
        }
        Ok(())
    }

    /// Sets the time-out of a source, by its place.
    pub fn set_timeout(&mut self, source: usize, timeout_ns: u64) {
        if let Some(source) = self.sources.get_mut(source) {
            source.timeout_ns = timeout_ns;
        }
    }

    /// Learns from the world what has become of the frames that it was given: who speaks for each source. The frames
    /// that wait are heard anew on top of that: what seemed a stranger's may count now, and what seemed to count may
    /// not. To be called after each tick.
    pub fn learn(&mut self, world: &World) {
        for (place, source) in self.sources.iter_mut().enumerate() {
            let in_force = world.in_force(place);
            source.speaker = in_force.map(|(session, heard_ns)| Speaker { session, heard_ns });
            source.sent = false;
        }
        let mut first_ns = None;
        for held in self.queue.frames_mut() {
            let whose = &mut held.whose;
            hear(&mut self.sources, &held.frame, whose, &self.ended, world);
            first_ns = first_ns.or(whose.speaks.then_some(whose.received_ns));
        }
        let ended = &self.ended;
        for source in &mut self.sources {
            source.speaker = source.speaker.filter(|by| !ended.contains(&by.session));
        }
        if let Beat::OnAll { since_ns, .. } = &mut self.beat {
            *since_ns = first_ns.map(|first_ns| since_ns.unwrap_or(first_ns));
        }
    }

    /// Takes everything out of an inbox and leaves it empty.
    ///
    /// * `world` - that which will be given the frames.
    pub fn take(&mut self, inbox: &mut Inbox, world: &World, now_ns: u64) {
        // Who leaves has sent its last frame, and the next one may speak for its source.
        self.ended.extend(inbox.ended());
        for frame in inbox.frames_mut() {
            let name = name_str(&frame.header.source).map(name_bytes);
            let place = self.sources.iter().position(|s| Some(s.name) == name);
            let received_ns = received(frame.received_ns, now_ns);
            let mut whose = Whose {
                source: place,
                received_ns,
                speaks: false,
            };
            hear(&mut self.sources, frame, &mut whose, &self.ended, world);
            if let Beat::OnAll { since_ns, .. } = &mut self.beat
                && whose.speaks
            {
                since_ns.get_or_insert(received_ns);
            }
            let leads = |at| matches!(self.beat, Beat::OnFrame(lead) if at == lead);
            let turn = match place {
                Some(at) if leads(at) => Turn::Each,
                Some(at) if world.is_followed(at) => Turn::Way,
                _ => Turn::Newest,
            };
            let passed = self.queue.put(frame, whose, turn);
            let source = place.and_then(|p| self.sources.get_mut(p));
            *source.map_or(&mut self.passed_of_none, |source| &mut source.passed) += passed;
        }
        for frame in inbox.vertices_mut() {
            let name = name_str(&frame.header.source).map(name_bytes);
            let place = self.sources.iter().position(|s| Some(s.name) == name);
            let received_ns = received(frame.received_ns, now_ns);
            self.vertices.put(frame, place, received_ns);
        }
        if !inbox.ended().is_empty() {
            self.learn(world);
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
                _ => self.queue.take_strangers(into),
            }
            Some(Due {
                cause,
                source: None,
                ages_only: on_frame,
            })
        })?;
        let lead = match self.beat {
            Beat::OnFrame(source) => Some(source),
            Beat::OnAll { .. } | Beat::Rate { .. } => None,
        };
        let ahead = Ahead {
            now_ns,
            lead,
            sources: &self.sources,
            frames: self.queue.frames(),
        };
        self.vertices.take(into, ahead);
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
                each(
                    Some(SourceSlot::at(place)),
                    std::mem::take(&mut source.passed),
                );
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
                    let whose = &held.whose;
                    // A stranger's before it goes along, to be refused.
                    whose.source != Some(lead)
                        || first && (!whose.speaks || std::mem::take(&mut first))
                });
                Some(by_frame(Some(SourceSlot::at(lead))))
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

    /// Whether a frame of who speaks for a source waits.
    fn has_frame_of(&self, source: usize) -> bool {
        let mut frames = self.queue.frames().iter();
        frames.any(|held| held.whose.source == Some(source) && held.whose.speaks)
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

/// When something came, as far as that is said; never later than now.
fn received(said_ns: u64, now_ns: u64) -> u64 {
    match said_ns {
        0 => now_ns,
        said_ns => said_ns.min(now_ns),
    }
}

/// Hears whether a frame counts for its source: the world will take it, as far as can be told here.
///
/// * `ended` - sessions that are over with the last of their frames.
fn hear(sources: &mut [Source], frame: &Frame, whose: &mut Whose, ended: &[u64], world: &World) {
    let before = std::mem::take(&mut whose.speaks);
    let good = whose.source.filter(|_| !world.would_refuse(frame));
    let Some(source) = good.and_then(|place| sources.get_mut(place)) else {
        return;
    };
    whose.speaks = source.hear(frame.header.session, whose.received_ns, ended);
    if whose.speaks && !before {
        source.passed += source.lost_before(&frame.header);
    }
}
