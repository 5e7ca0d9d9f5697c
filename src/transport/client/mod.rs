//! The client's side of a door: frames and requests out, results in. Used by `feed`, `monitor`, `list` and live
//! queries, and by any Rust program that streams poses.
//!
//! A client never reconnects by hand: its services outlive the daemon, and the boot id reveals a restart.

mod connect;
mod follow;
mod link;
mod list;
mod step;
mod vertices;

pub use connect::ClientOptions;
pub(crate) use connect::{check_hello, random_u64};
pub use follow::{Message, View};
pub use link::{Link, Rows, Topics};
pub use list::{ContactList, PairList};
pub use step::StepError;
pub use vertices::Part;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::time::{Clock, SystemClock};
use crate::transport::patience::Patience;
use crate::wire::{
    Answer, EndCause, Event, FrameHeader, Hello, PairRow, RequestHeader, Verdict, WIRE_VERSION,
    frame_flags, name_bytes, pair_flags,
};

/// Longest sleep before the ports are checked again: if an event was lost, nothing waits longer than this.
const LOOK_AGAIN_NS: u64 = 50_000_000;
/// Most ticks read by one check: more than its queues hold, so that the newest one at its start is among them. If
/// reading a tick's messages takes longer than the next tick takes to come, there is always another one.
const LATEST_MAX: usize = 32;
/// Number of finished boots remembered, so that their messages left in a queue are recognized as old.
const BOOTS_OVER_MAX: usize = 16;

/// What a client states about a frame in addition to its rows; zero means not given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameInfo {
    /// The sender's own stamp of the poses, nanoseconds of the clock `clock_id`.
    pub stamp_ns: u64,
    /// The sender's number for that clock.
    pub clock_id: u32,
    /// Least scene revision that the poses need; 0: any.
    pub scene_rev: u64,
    /// Deadline of the tick, nanoseconds of `CLOCK_MONOTONIC`; 0: none.
    pub deadline_ns: u64,
    /// Time left for the tick from receipt, nanoseconds; 0: not given.
    pub time_left_ns: u64,
    /// Whether the rows are only some bodies of the source.
    pub partial: bool,
}

/// Identity of a frame: order within a session is `(epoch, seq)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameId {
    /// The client's session.
    pub session: u64,
    /// Its epoch.
    pub epoch: u64,
    /// Its number.
    pub seq: u64,
}

/// The daemon restarted: everything it reported before has ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Restarted {
    /// Boot id before.
    pub old_boot: u64,
    /// Boot id now.
    pub new_boot: u64,
    /// An end (`EndCause::Restart`) for each pair whose last certified verdict was colliding.
    pub ends: Vec<PairRow>,
}

/// Result of a wait.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// A newer tick: see [`Client::view`].
    Tick,
    /// The daemon restarted; the first tick of the new boot comes with the next wait.
    Restarted(Restarted),
    /// Nothing within the time.
    Silence,
}

/// A client of one instance; as a source it sends frames, as a reader it follows ticks.
pub struct Client {
    link: Box<dyn Link>,
    clock: Arc<dyn Clock>,
    source: Option<String>,
    hello: Hello,
    frame: FrameId,
    /// Version of the last vertices sent, by body.
    versions: BTreeMap<u64, u64>,
    /// Number of vertex messages sent in this session.
    bent: u64,
    requests: u64,
    follow: follow::Follow,
    patience: Patience,
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client")
            .field("link", &self.link)
            .field("source", &self.source)
            .field("frame", &self.frame)
            .finish_non_exhaustive()
    }
}

impl Client {
    /// Connects through a link; see [`ClientOptions::connect`] for shared memory.
    ///
    /// # Errors
    /// `Error::Usage` when the source's name is empty or longer than 31 bytes, `Error::TimedOut` when no daemon says
    /// hello in time, `Error::Refused` when it speaks another wire version.
    pub fn over(
        link: Box<dyn Link>,
        clock: Arc<dyn Clock>,
        source: Option<&str>,
        timeout_ns: u64,
    ) -> Result<Self> {
        connect::check_source(source)?;
        let mut client = Self {
            link,
            clock,
            source: source.map(ToOwned::to_owned),
            hello: Hello::default(),
            frame: FrameId {
                session: random_u64()?,
                epoch: 0,
                seq: 0,
            },
            versions: BTreeMap::new(),
            bent: 0,
            requests: 0,
            follow: follow::Follow::default(),
            patience: Patience::new(0),
        };
        client.greet(timeout_ns)?;
        Ok(client)
    }

    /// Sets how long a wait spins for the next tick before it sleeps, nanoseconds; `u64::MAX`: it never sleeps. Over
    /// shared memory 50 us if there is more than one core, else 0. Spinning finds a tick in 0.5 us, waking from a sleep
    /// takes 10 to 25 us.
    pub fn set_spin_ns(&mut self, spin_ns: u64) {
        self.patience = Patience::new(spin_ns);
    }

    /// The daemon's hello at the connection.
    #[must_use]
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// This client's session, a random number from its start.
    #[must_use]
    pub fn session(&self) -> u64 {
        self.frame.session
    }

    /// The newest of everything subscribed to.
    #[must_use]
    pub fn view(&self) -> &View {
        &self.follow.view
    }

    /// Subscribes to these messages, in addition to ticks. The daemon computes only what has readers.
    ///
    /// # Errors
    /// `Error::Io` when a port cannot be opened.
    pub fn subscribe(&mut self, topics: Topics) -> Result<()> {
        self.link.subscribe(topics)
    }

    /// Sends a frame of the source's bodies; full unless `info.partial`.
    ///
    /// # Errors
    /// `Error::Usage` when the client was opened without a source, `Error::Io` when it cannot be sent.
    pub fn send(&mut self, info: &FrameInfo, rows: Rows<'_>) -> Result<FrameId> {
        let flags = if info.partial {
            frame_flags::PARTIAL
        } else {
            frame_flags::FULL
        };
        self.send_flagged(info, rows, flags)
    }

    /// Sends a pause: the world stands still, the ages of its bodies are renewed for one time-out.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub fn pause(&mut self) -> Result<FrameId> {
        self.send_flagged(&FrameInfo::default(), Rows::Poses(&[]), frame_flags::PAUSED)
    }

    /// Begins a new epoch: the world was reset, every pair of the source's bodies ends with the next frame.
    pub fn reset_epoch(&mut self) {
        self.frame.epoch += 1;
        // The daemon discards its vertices too.
        self.versions.clear();
    }

    /// Low half of the boot id of the last tick taken, whose ids the caller knows; 0: none.
    #[allow(clippy::cast_possible_truncation, reason = "the low half is meant")]
    fn boot(&self) -> u32 {
        self.follow.view.tick().header.boot_id as u32
    }

    fn send_flagged(&mut self, info: &FrameInfo, rows: Rows<'_>, flags: u32) -> Result<FrameId> {
        let source = self.source.as_deref().ok_or_else(|| {
            Error::Usage("this client was opened as a reader; name a source to send frames".into())
        })?;
        let id = FrameId {
            seq: self.frame.seq + 1,
            ..self.frame
        };
        let header = FrameHeader {
            session: id.session,
            epoch: id.epoch,
            seq: id.seq,
            sent_ns: self.clock.boottime_ns(),
            stamp_ns: info.stamp_ns,
            scene_rev: info.scene_rev,
            deadline_ns: info.deadline_ns,
            time_left_ns: info.time_left_ns,
            source: name_bytes(source),
            flags,
            clock_id: info.clock_id,
            schema: WIRE_VERSION,
            boot: self.boot(),
        };
        // Counted first: if the link fails after the frame was sent, its number must never be reused.
        self.frame = id;
        self.link.send(&header, rows)?;
        Ok(id)
    }

    /// Waits for the next newer tick and all messages of it.
    ///
    /// # Errors
    /// `Error::Io` when a port fails.
    pub fn wait_tick(&mut self, timeout_ns: u64) -> Result<Heard> {
        let start_ns = self.clock.monotonic_ns();
        let until_ns = start_ns.saturating_add(timeout_ns);
        let look_ns = self.patience.begin();
        let looked_ns = start_ns.saturating_add(look_ns);
        let mut looking = look_ns > 0;
        loop {
            let heard = self.next_heard()?;
            if heard != Heard::Silence {
                if looking {
                    self.patience.found();
                }
                return Ok(heard);
            }
            let now_ns = self.clock.monotonic_ns();
            if now_ns >= until_ns {
                return Ok(heard);
            }
            if now_ns < looked_ns {
                std::hint::spin_loop();
                continue;
            }
            if std::mem::take(&mut looking) {
                self.patience.missed();
            }
            self.link.wait((until_ns - now_ns).min(LOOK_AGAIN_NS))?;
        }
    }

    fn next_heard(&mut self) -> Result<Heard> {
        let heard = self.follow.next(self.link.as_mut())?;
        if matches!(heard, Heard::Restarted(_)) {
            // The new daemon has no vertices that a range could change.
            self.versions.clear();
        }
        Ok(heard)
    }

    /// Takes what has arrived without waiting, up to the newest tick.
    ///
    /// # Errors
    /// As [`Client::wait_tick`].
    pub fn latest(&mut self) -> Result<Heard> {
        let mut newest = Heard::Silence;
        for _ in 0..LATEST_MAX {
            match self.next_heard()? {
                Heard::Silence => break,
                restarted @ Heard::Restarted(_) => return Ok(restarted),
                Heard::Tick => newest = Heard::Tick,
            }
        }
        Ok(newest)
    }

    /// Sends a request to the daemon and waits for its answer.
    ///
    /// * `json` - edits or a query, as described in `msgs/README.md`.
    /// * `blobs` - vertex and index bytes that the JSON refers to by offset from the first of them, little-endian.
    /// * returns - the answer; `ok = false` when the daemon refused.
    ///
    /// # Errors
    /// `Error::TimedOut` without an answer in time, `Error::Io` when it cannot be sent or read.
    pub fn request(&mut self, json: &str, blobs: &[&[u8]], timeout_ns: u64) -> Result<Answer> {
        let text = self.request_text(json, blobs, timeout_ns)?;
        serde_json::from_str(&text)
            .map_err(|e| Error::io(format!("the daemon's answer is no answer: {text}"), e))
    }

    /// As [`Client::request`], but returns the answer's JSON unparsed.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn request_text(&mut self, json: &str, blobs: &[&[u8]], timeout_ns: u64) -> Result<String> {
        let request = self.ask(json, blobs)?;
        self.answer_text(request, timeout_ns)?.ok_or_else(|| {
            Error::TimedOut(format!(
                "no answer within {} ms: is the daemon running (`sweepd list`)? A large request may take longer",
                timeout_ns / 1_000_000
            ))
        })
    }

    /// Sends a request as [`Client::request`] does, without waiting; [`Client::answer_text`] waits.
    ///
    /// * returns - its number.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be sent.
    pub fn ask(&mut self, json: &str, blobs: &[&[u8]]) -> Result<u64> {
        self.requests += 1;
        let header = RequestHeader {
            json_len: json.len() as u64,
            request: self.requests,
            schema: WIRE_VERSION,
            reserved: 0,
        };
        self.link.request(&header, json.as_bytes(), blobs)?;
        Ok(header.request)
    }

    /// Waits for the answer to a request; other answers are skipped.
    ///
    /// * returns - its JSON; `None`: not within the time, it may still come.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be read.
    pub fn answer_text(&mut self, request: u64, timeout_ns: u64) -> Result<Option<String>> {
        let until_ns = self.clock.monotonic_ns().saturating_add(timeout_ns);
        let mut text = Vec::new();
        loop {
            if let Some(answer) = self.link.answer(&mut text)?
                && answer.request == request
            {
                return String::from_utf8(text)
                    .map(Some)
                    .map_err(|e| Error::io("the daemon's answer is not UTF-8", e));
            }
            let now_ns = self.clock.monotonic_ns();
            if now_ns >= until_ns {
                return Ok(None);
            }
            self.link.wait((until_ns - now_ns).min(LOOK_AGAIN_NS))?;
        }
    }
}

/// The ends of all pairs certified colliding in the boot that a restart ended.
///
/// * `tick` - the last tick received.
fn ends_of(tick: u64, pairs: impl Iterator<Item = PairRow>) -> Vec<PairRow> {
    let colliding = Verdict::Colliding.code();
    pairs
        .filter(|row| row.flags & pair_flags::GONE == 0)
        .filter(|row| row.certified_verdict == colliding)
        .map(|row| PairRow {
            events: Event::End.bit(),
            end_cause: EndCause::Restart.code(),
            end_first_tick: tick,
            end_last_tick: tick,
            flags: row.flags | pair_flags::GONE,
            ..row
        })
        .collect()
}

/// The machine's clocks, shared.
pub(crate) fn system_clock() -> Arc<dyn Clock> {
    Arc::new(SystemClock)
}
