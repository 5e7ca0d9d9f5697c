//! A source as the pacer knows it: who speaks for it, when it was heard, what of it never came.

use crate::scene::SourceSpec;
use crate::wire::{Frame, FrameHeader, SOURCE_NAME_LEN, WIRE_VERSION, name_bytes};

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
    /// Who speaks for it, as the world has it.
    pub(super) in_force: Option<Speaker>,
    /// The same once the world has the frames that wait, too; `None`: nobody, or its session ended.
    pub(super) speaker: Option<Speaker>,
    /// Session, epoch and number of its newest frame.
    newest: (u64, u64, u64),
    /// In this round it has sent.
    pub(super) sent: bool,
    /// It was late for a round and is not waited for until its next frame.
    pub(super) late: bool,
    /// Each of its frames counts: none is passed over for a newer one.
    pub(super) followed: bool,
    /// Frames that no tick has used and will use, until somebody was told.
    pub(super) passed: u64,
}

impl Source {
    pub(super) fn new(spec: &SourceSpec) -> Self {
        Self {
            name: name_bytes(&spec.name),
            timeout_ns: spec.timeout_ns,
            in_force: None,
            speaker: None,
            newest: (0, 0, 0),
            sent: false,
            late: false,
            followed: false,
            passed: 0,
        }
    }

    /// Hears a frame under its name; whether it is one that the world will take for it, as far as can be told here: not
    /// that of a stranger while somebody else speaks for the source, which may neither end a round nor stand for its
    /// frame.
    ///
    /// * `ended` - sessions that are over with the last of their frames.
    pub(super) fn hear(&mut self, frame: &Frame, received_ns: u64, ended: &[u64]) -> bool {
        let session = frame.header.session;
        let good = frame.header.schema == WIRE_VERSION && session != 0 && frame.refused.is_none();
        let before = self.speaker.filter(|before| before.session == session);
        let is_taken = before.is_none() && self.is_alive(received_ns) && {
            let other = self.speaker.map_or(0, |other| other.session);
            !ended.contains(&other)
        };
        let speaks = good && !is_taken;
        if speaks {
            let heard_ns = before.map_or(received_ns, |before| before.heard_ns.max(received_ns));
            self.speaker = Some(Speaker { session, heard_ns });
            (self.sent, self.late) = (true, false);
        }
        speaks
    }

    /// Whether who speaks for it was heard within its time-out.
    fn is_alive(&self, now_ns: u64) -> bool {
        self.speaker
            .is_some_and(|speaker| now_ns.saturating_sub(speaker.heard_ns) < self.timeout_ns)
    }

    /// Whether a round waits for it: alive, and not late in the round before.
    pub(super) fn is_waited_for(&self, now_ns: u64) -> bool {
        !self.late && self.is_alive(now_ns)
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
