//! Sources: who may speak for a group of bodies, in which session, and how far it has come.
//!
//! In: frame headers. Out: whether a frame is of the session in force and newer than its newest; sessions that are
//! over stay over for this boot.

use std::collections::VecDeque;

use super::bends_waiting::BendsWaiting;
use super::body::Body;
use crate::config::OnStale;
use crate::ids::{BodySlot, SourceSlot};
use crate::limits::{FRAME_ROWS_MAX, FRAMES_WAITING_MAX, SESSIONS_OVER_MAX};
use crate::scene::SourceSpec;
use crate::wire::{
    Frame, FrameHeader, RejectReason, SOURCE_NAME_LEN, SourceRow, VertexHeader, frame_flags,
    name_bytes, name_str,
};

/// A source as the world knows it.
#[derive(Clone, Debug)]
pub struct SourceState {
    /// Its name.
    pub name: String,
    /// Without a frame for this long it is no longer alive and its bodies are stale, nanoseconds.
    pub timeout_ns: u64,
    /// The same from the next tick on, where it was set.
    pub(super) next_timeout_ns: Option<u64>,
    /// What happens to its bodies that are too old, where they do not say it themselves.
    pub on_stale: OnStale,
    /// Session in force; 0: none.
    pub session: u64,
    /// Newest `(epoch, seq)` taken note of, waiting frames included.
    pub(super) order: Option<(u64, u64)>,
    /// Number of the newest message of vertices in the session in force; 0: none that says it.
    pub(super) bent: u64,
    /// Header of the newest frame admitted of the session in force, or of the last one.
    pub(super) newest: Option<FrameHeader>,
    /// Header and receipt (`CLOCK_BOOTTIME`, nanoseconds) of the newest frame admitted, until somebody was told.
    pub(super) admitted: Option<(FrameHeader, u64)>,
    /// When the age of that frame starts, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) since_ns: u64,
    /// When the session in force was last heard, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) heard_ns: u64,
    /// Whether its newest frame is young enough, as of the last tick.
    pub(super) alive: bool,
    pub(super) frames: u64,
    pub(super) skipped: u64,
    pub(super) refused: u64,
    /// Number of its last pose frame; bodies carry the number of the last frame that held them.
    pub(super) pose_frame: u64,
    /// Frames with poses that were taken in this tick.
    pub(super) pose_frames: u32,
    /// The slots of its last pose frame, row by row: where its next frame will most likely have them too.
    pub(super) rows: Vec<BodySlot>,
    /// Frames that wait for a later scene revision.
    pub(super) waiting: Waiting,
    /// Vertices that belong with those.
    pub(super) bends: BendsWaiting,
    /// A frame with poses, whose number in the epoch is below this, was lost or refused, and none of a later number has
    /// been taken since; 0: none.
    pub(super) gap: u64,
    /// Whether a continuous body goes where its frames say.
    pub(super) followed: bool,
    /// In this tick, a part of the way of its continuous bodies is not known: frames were dropped here.
    pub(super) cut: bool,
    /// The same of the next frame with poses.
    pub(super) cuts_next: bool,
}

/// Frames that wait for a scene revision, or behind one that does, the oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Waiting {
    frames: VecDeque<Frame>,
    /// How many rows they have.
    rows: usize,
    /// When the wait of the first ends, nanoseconds of `CLOCK_BOOTTIME`.
    until_ns: u64,
}

impl Waiting {
    /// The first one.
    pub(super) fn first(&self) -> Option<&Frame> {
        self.frames.front()
    }

    /// When the wait of the first ends, nanoseconds of `CLOCK_BOOTTIME`; `None`: no frame waits.
    pub(super) fn until_ns(&self) -> Option<u64> {
        (!self.frames.is_empty()).then_some(self.until_ns)
    }

    /// Puts a copy of a frame behind the others; returns how many of the oldest had to go for it.
    ///
    /// * `until_ns` - when its wait ends, should it be the first.
    pub(super) fn push(&mut self, frame: &Frame, received_ns: u64, until_ns: u64) -> u64 {
        let mut gone = 0;
        let rows = frame.transforms.len();
        while self.frames.len() >= FRAMES_WAITING_MAX || self.rows + rows > FRAME_ROWS_MAX {
            if self.take().is_none() {
                break;
            }
            gone += 1;
        }
        if self.frames.is_empty() {
            self.until_ns = until_ns;
        }
        self.rows += rows;
        self.frames.push_back(Frame {
            received_ns,
            ..frame.clone()
        });
        if gone > 0
            && let Some(first) = self.frames.front_mut()
        {
            first.cut = true;
        }
        gone
    }

    /// Takes the first out.
    pub(super) fn take(&mut self) -> Option<Frame> {
        let frame = self.frames.pop_front()?;
        self.rows -= frame.transforms.len();
        Some(frame)
    }

    /// The wait of the one that is the first now is its own.
    pub(super) fn begin_next(&mut self, timeout_ns: u64) {
        if let Some(first) = self.first() {
            self.until_ns = first.received_ns.saturating_add(timeout_ns);
        }
    }
}

impl SourceState {
    pub(super) fn new(spec: &SourceSpec, bodies: usize) -> Self {
        Self {
            name: spec.name.clone(),
            timeout_ns: spec.timeout_ns,
            on_stale: spec.on_stale,
            next_timeout_ns: None,
            session: 0,
            order: None,
            bent: 0,
            newest: None,
            admitted: None,
            since_ns: 0,
            heard_ns: 0,
            alive: false,
            frames: 0,
            skipped: 0,
            refused: 0,
            pose_frame: 0,
            pose_frames: 0,
            rows: Vec::with_capacity(bodies),
            waiting: Waiting::default(),
            bends: BendsWaiting::default(),
            gap: 0,
            followed: false,
            cut: false,
            cuts_next: false,
        }
    }

    /// Whether its newest frame was younger than its time-out when the tick judged ages.
    #[must_use]
    pub fn alive(&self) -> bool {
        self.alive
    }

    /// Frames admitted in this boot.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// When its newest frame is too old, nanoseconds of `CLOCK_BOOTTIME`; `None` when it is already.
    pub(super) fn deadline_ns(&self) -> Option<u64> {
        self.alive
            .then(|| self.since_ns.saturating_add(self.timeout_ns))
    }

    /// As a row of the tick.
    #[must_use]
    pub fn to_row(&self, now_boot_ns: u64) -> SourceRow {
        let newest = self.newest.unwrap_or_default();
        let age_ns = now_boot_ns.saturating_sub(self.since_ns);
        SourceRow {
            name: name_bytes(&self.name),
            session: self.session,
            epoch: newest.epoch,
            seq: newest.seq,
            stamp_ns: newest.stamp_ns,
            age_ns: self.newest.map_or(u64::MAX, |_| age_ns),
            frames: self.frames,
            skipped: self.skipped,
            refused: self.refused,
            clock_id: newest.clock_id,
            alive: u8::from(self.alive),
            paused: u8::from(newest.flags == frame_flags::PAUSED),
            reserved: [0; 2],
        }
    }
}

impl super::World {
    /// Whether this session is in force for the source of this name.
    #[must_use]
    pub fn speaks_for(&self, session: u64, source: &[u8; SOURCE_NAME_LEN]) -> bool {
        let of_name = name_str(source).and_then(|name| self.source_named(name));
        of_name.is_some_and(|slot| self.sources[slot.index()].session == session)
    }

    /// The session in force of a source, by its place, and when it was last heard, nanoseconds of `CLOCK_BOOTTIME`.
    #[must_use]
    pub fn in_force(&self, source: usize) -> Option<(u64, u64)> {
        let state = self.sources.get(source)?;
        (state.session != 0).then_some((state.session, state.heard_ns))
    }

    /// Whether a continuous body goes where the frames of a source say: each of them is then a part of its way, and
    /// none may be passed over for a newer one.
    #[must_use]
    pub fn is_followed(&self, source: usize) -> bool {
        self.sources.get(source).is_some_and(|state| state.followed)
    }
}

impl SourceState {
    /// Whether a frame of it waits for a later revision of the scene.
    #[must_use]
    pub fn waits(&self) -> bool {
        !self.waiting.frames.is_empty()
    }

    /// The frame of this number has poses that are never taken: what is known is not what its sender has said last.
    pub(super) fn note_gap(&mut self, header: &FrameHeader) {
        if header.flags != frame_flags::PAUSED {
            self.gap = self.gap.max(header.seq.saturating_add(1));
        }
    }

    /// Whether a frame is taken at this time (nanoseconds of `CLOCK_BOOTTIME`) that waits for the one before it alone,
    /// whose wait ends.
    #[must_use]
    pub fn lets_go(&self, now_boot_ns: u64) -> bool {
        let Waiting {
            frames, until_ns, ..
        } = &self.waiting;
        frames.len() > 1 && *until_ns <= now_boot_ns
    }

    /// What waits has nothing to say any more: it is passed over.
    ///
    /// * returns - when the wait of the first would have ended.
    pub(super) fn pass_over_waiting(&mut self) -> Option<u64> {
        let until_ns = self.waiting.until_ns();
        self.skipped += self.waiting.frames.len() as u64;
        self.waiting = Waiting::default();
        until_ns
    }
}

/// What a frame's session and number mean for its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// The next frame of the session and epoch in force.
    Next,
    /// The first frame of a new session or epoch: what was known of the source's bodies is void.
    Afresh,
    /// Not to be admitted.
    Refused(RejectReason),
}

/// Sessions that are over, the newest kept.
#[derive(Clone, Debug)]
pub(super) struct SessionsOver {
    list: Vec<(SourceSlot, u64)>,
    /// Where the next one goes once the list is full.
    next: usize,
}

impl SessionsOver {
    pub(super) fn new() -> Self {
        Self {
            list: Vec::with_capacity(SESSIONS_OVER_MAX),
            next: 0,
        }
    }

    pub(super) fn holds(&self, source: SourceSlot, session: u64) -> bool {
        self.list.contains(&(source, session))
    }

    pub(super) fn put(&mut self, source: SourceSlot, session: u64) {
        if self.list.len() < SESSIONS_OVER_MAX {
            self.list.push((source, session));
        } else if let Some(place) = self.list.get_mut(self.next) {
            *place = (source, session);
            self.next = (self.next + 1) % SESSIONS_OVER_MAX;
        }
    }
}

impl SourceState {
    /// Takes note of a message of vertices; whether some of the session before it were lost.
    pub(super) fn note_bent(&mut self, header: &VertexHeader) -> bool {
        if header.session != self.session || header.number == 0 {
            return false;
        }
        let lost = self.bent != 0 && header.number > self.bent.saturating_add(1);
        self.bent = self.bent.max(header.number);
        lost
    }
}

/// Judges a header by session and order, and takes note of it: which session is in force, when it was heard.
///
/// A session ends here when another asks and it has not been heard for the source's time-out.
///
/// * `first_seq` - least number of the frames that this one stands for.
pub(super) fn stand(
    source: &mut SourceState,
    slot: SourceSlot,
    over: &mut SessionsOver,
    (header, first_seq): (&FrameHeader, u64),
    received_ns: u64,
) -> Standing {
    let order = (header.epoch, header.seq);
    if header.session != source.session {
        if over.holds(slot, header.session) {
            return Standing::Refused(RejectReason::SessionOver);
        }
        if source.session != 0 {
            let silent_ns = received_ns.saturating_sub(source.heard_ns);
            if silent_ns < source.timeout_ns {
                return Standing::Refused(RejectReason::SourceTaken);
            }
            over.put(slot, source.session);
        }
        source.session = header.session;
        source.heard_ns = received_ns;
        source.order = Some(order);
        // Nothing of this session has been taken yet.
        (source.newest, source.alive, source.bent) = (None, false, 0);
        (source.gap, source.bends) = (0, BendsWaiting::default());
        return Standing::Afresh;
    }
    source.heard_ns = source.heard_ns.max(received_ns);
    match source.order {
        Some(newest) if order <= newest => Standing::Refused(RejectReason::OldFrame),
        Some((epoch, seq)) if header.epoch == epoch => {
            if first_seq > seq.saturating_add(1) {
                source.gap = header.seq;
            }
            source.order = Some(order);
            Standing::Next
        }
        _ => {
            source.order = Some(order);
            (source.gap, source.bends) = (0, BendsWaiting::default());
            Standing::Afresh
        }
    }
}

/// As [`stand`], for what comes beside frames: of the session in force it is taken in any order.
///
/// A new session or epoch may show itself here first; the frame that follows then finds it in force.
pub(super) fn stand_beside(
    source: &mut SourceState,
    slot: SourceSlot,
    over: &mut SessionsOver,
    header: &VertexHeader,
    received_ns: u64,
) -> Standing {
    let epoch = source.order.map(|(epoch, _)| epoch);
    let in_force = header.session == source.session;
    if in_force && epoch == Some(header.epoch) {
        source.heard_ns = source.heard_ns.max(received_ns);
        return Standing::Next;
    }
    if in_force && epoch.is_some_and(|epoch| header.epoch < epoch) {
        return Standing::Refused(RejectReason::OldFrame);
    }
    let first = FrameHeader {
        session: header.session,
        epoch: header.epoch,
        ..FrameHeader::default()
    };
    stand(source, slot, over, (&first, first.seq), received_ns)
}

/// Whether a source may move a body.
pub(super) fn owns(source: SourceSlot, body: &Body) -> bool {
    body.moves && body.source == Some(source)
}
