//! A source as the pacer knows it: who speaks for it, when it was heard, what of it never came.

use crate::scene::SourceSpec;
use crate::wire::{Frame, FrameHeader, SOURCE_NAME_LEN, WIRE_VERSION, name_bytes};

/// What the pacer knows of a source.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) name: [u8; SOURCE_NAME_LEN],
    pub(super) timeout_ns: u64,
    /// Receipt of its newest frame; `None`: none yet, or its session ended.
    pub(super) heard_ns: Option<u64>,
    pub(super) session: u64,
    /// Epoch and number of its newest frame.
    newest: (u64, u64),
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
            heard_ns: None,
            session: 0,
            newest: (0, 0),
            sent: false,
            late: false,
            followed: false,
            passed: 0,
        }
    }

    /// Whether a frame under its name is one that the world will take for it, as far as can be told here: not that of a
    /// stranger while somebody else speaks for the source, which may neither end a round nor stand for its frame.
    ///
    /// * `gone` - sessions that have just ended.
    pub(super) fn is_spoken_for(&self, frame: &Frame, received_ns: u64, gone: &[u64]) -> bool {
        let header = &frame.header;
        let heard = |heard_ns| received_ns.saturating_sub(heard_ns) < self.timeout_ns;
        let taken = self.session != header.session
            && self.heard_ns.is_some_and(heard)
            && !gone.contains(&self.session);
        header.schema == WIRE_VERSION && header.session != 0 && frame.refused.is_none() && !taken
    }

    /// Frames of the session that never came, as the number of the next one tells: its queue in shared memory holds
    /// four, and DDS drops what it must. No more than 2^32, whatever a sender counts by: sums of them do not overflow.
    pub(super) fn lost_before(&mut self, next: &FrameHeader) -> u64 {
        let (before, now) = (self.newest, (next.epoch, next.seq));
        if self.session != next.session {
            self.newest = now;
            return 0;
        }
        self.newest = before.max(now);
        if before.0 == now.0 {
            let lost = now.1.saturating_sub(before.1).saturating_sub(1);
            lost.min(u64::from(u32::MAX))
        } else {
            0
        }
    }
}
