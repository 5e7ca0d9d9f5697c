//! A source as the pacer knows it: who speaks for it, when it was heard, what of it never came.

use crate::scene::SourceSpec;
use crate::wire::{FrameHeader, SOURCE_NAME_LEN, VertexHeader, name_bytes};

/// Who speaks for a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Speaker {
    pub(super) session: u64,
    /// When it was last heard, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) heard_ns: u64,
}

/// What the pacer knows of a source.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) name: [u8; SOURCE_NAME_LEN],
    pub(super) timeout_ns: u64,
    /// Who speaks for it once the world has the frames that wait, too; `None`: nobody, or its session ended.
    pub(super) speaker: Option<Speaker>,
    /// Session, epoch and number of its newest frame.
    newest: (u64, u64, u64),
    /// In this round it has sent.
    pub(super) sent: bool,
    /// It was late for a round and is not waited for until its next frame.
    pub(super) late: bool,
    /// Frames that no tick has used and will use, until somebody was told.
    pub(super) passed: u64,
}

impl Source {
    pub(super) fn new(spec: &SourceSpec) -> Self {
        Self {
            name: name_bytes(&spec.name),
            timeout_ns: spec.timeout_ns,
            speaker: None,
            newest: (0, 0, 0),
            sent: false,
            late: false,
            passed: 0,
        }
    }

    /// Hears a frame of this session under its name that nothing else is wrong with; whether the world will take it:
    /// not that of a stranger while somebody else speaks for the source, which may neither end a round nor stand for
    /// its frame.
    ///
    /// * `ended` - sessions that are over with the last of their frames.
    pub(super) fn hear(&mut self, session: u64, received_ns: u64, ended: &[u64]) -> bool {
        let before = self.speaker.filter(|before| before.session == session);
        let other = self.alive(received_ns).filter(|by| !ended.contains(by));
        let speaks = before.is_some() || other.is_none();
        if speaks {
            let heard_ns = before.map_or(received_ns, |before| before.heard_ns.max(received_ns));
            self.speaker = Some(Speaker { session, heard_ns });
            (self.sent, self.late) = (true, false);
        }
        speaks
    }

    /// The session that speaks for it and was heard within its time-out.
    pub(super) fn alive(&self, now_ns: u64) -> Option<u64> {
        let in_time = |by: &Speaker| now_ns.saturating_sub(by.heard_ns) < self.timeout_ns;
        self.speaker.filter(in_time).map(|by| by.session)
    }

    /// Whether a frame that vertices belong with has come, or one after it.
    pub(super) fn has_heard(&self, vertices: &VertexHeader) -> bool {
        let (session, epoch, seq) = self.newest;
        session == vertices.session && (epoch, seq) >= (vertices.epoch, vertices.seq)
    }

    /// Whether a round waits for it: alive, and not late in the round before.
    pub(super) fn is_waited_for(&self, now_ns: u64) -> bool {
        !self.late && self.alive(now_ns).is_some()
    }

    /// Frames of the session that never came, as the number of the next one tells: its queue in shared memory holds
    /// four, and DDS drops what it must. No more than 2^32, whatever a sender counts by: sums of them do not overflow.
    pub(super) fn lost_before(&mut self, next: &FrameHeader) -> u64 {
        let (before, now) = (self.newest, (next.session, next.epoch, next.seq));
        if before.0 != now.0 {
            self.newest = now;
            return 0;
        }
        self.newest = before.max(now);
        if before.1 == now.1 {
            let lost = now.2.saturating_sub(before.2).saturating_sub(1);
            lost.min(u64::from(u32::MAX))
        } else {
            0
        }
    }
}
