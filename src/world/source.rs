//! Sources: who may speak for a group of bodies, in which session, and how far it has come.
//!
//! In: frame headers. Out: whether a frame is of the session in force and newer than its newest; sessions that are
//! over stay over for this boot.

use super::body::Body;
use crate::config::OnStale;
use crate::ids::{BodySlot, SourceSlot};
use crate::limits::{FRAMES_WAITING_MAX, SESSIONS_OVER_MAX};
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
    /// The slots of its last pose frame, row by row: where its next frame will most likely have them too.
    pub(super) rows: Vec<BodySlot>,
    /// Frames that wait for a later scene revision.
    pub(super) waiting: Waiting,
    /// A pose frame newer than the one that `rows` are of has not been taken: it was lost, refused or passed over.
    pub(super) gap: bool,
    /// Whether a continuous body goes where its frames say.
    pub(super) followed: bool,
}

/// Frames that wait for a scene revision, or behind one that does; their memory is kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Waiting {
    /// The oldest first, then spare ones.
    frames: Vec<Frame>,
    len: usize,
    /// When the wait of the first ends, nanoseconds of `CLOCK_BOOTTIME`.
    until_ns: u64,
}

impl Waiting {
    /// The first one.
    pub(super) fn first(&self) -> Option<&Frame> {
        self.frames.get(..self.len)?.first()
    }

    /// When the wait of the first ends, nanoseconds of `CLOCK_BOOTTIME`; `None`: no frame waits.
    pub(super) fn until_ns(&self) -> Option<u64> {
        (self.len > 0).then_some(self.until_ns)
    }

    /// Puts a copy of a frame behind the others; whether the first had to go for it.
    ///
    /// * `until_ns` - when its wait ends, should it be the first.
    pub(super) fn push(&mut self, frame: &Frame, received_ns: u64, until_ns: u64) -> bool {
        let crowded_out = if self.len == FRAMES_WAITING_MAX {
            self.take()
        } else {
            None
        };
        let is_full = crowded_out.is_some();
        self.frames.extend(crowded_out);
        if self.len == self.frames.len() {
            self.frames.push(Frame::default());
        }
        if let Some(place) = self.frames.get_mut(self.len) {
            place.clone_from(frame);
            place.received_ns = received_ns;
        }
        if self.len == 0 {
            self.until_ns = until_ns;
        }
        self.len += 1;
        is_full
    }

    /// The wait of the one that is the first now is its own.
    pub(super) fn begin_next(&mut self, timeout_ns: u64) {
        if let Some(received_ns) = self.first().map(|frame| frame.received_ns) {
            self.until_ns = received_ns.saturating_add(timeout_ns);
        }
    }

    /// Takes the first out; its memory is to be given back.
    pub(super) fn take(&mut self) -> Option<Frame> {
        self.len = self.len.checked_sub(1)?;
        Some(self.frames.remove(0))
    }

    /// Gives back the memory of a frame.
    pub(super) fn give_back(&mut self, frame: Frame) {
        self.frames.push(frame);
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
            rows: Vec::with_capacity(bodies),
            waiting: Waiting::default(),
            gap: false,
            followed: false,
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
        self.waiting.len > 0
    }

    /// What waits has nothing to say any more: it is passed over.
    ///
    /// * returns - when the wait of the first would have ended.
    pub(super) fn pass_over_waiting(&mut self) -> Option<u64> {
        let until_ns = self.waiting.until_ns();
        self.skipped += self.waiting.len as u64;
        self.waiting.len = 0;
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
pub(super) fn stand(
    source: &mut SourceState,
    slot: SourceSlot,
    over: &mut SessionsOver,
    header: &FrameHeader,
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
        source.gap = false;
        return Standing::Afresh;
    }
    source.heard_ns = source.heard_ns.max(received_ns);
    match source.order {
        Some(newest) if order <= newest => Standing::Refused(RejectReason::OldFrame),
        Some((epoch, seq)) if header.epoch == epoch => {
            source.gap |= header.seq > seq.saturating_add(1);
            source.order = Some(order);
            Standing::Next
        }
        _ => {
            source.order = Some(order);
            source.gap = false;
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
    stand(source, slot, over, &first, received_ns)
}

/// Whether a source may move a body.
pub(super) fn owns(source: SourceSlot, body: &Body) -> bool {
    body.moves && body.source == Some(source)
}
