//! A source as the pacer knows it: who speaks for it, when it was heard, what of it never came.

use crate::scene::SourceSpec;
use crate::wire::{FrameHeader, SOURCE_NAME_LEN, name_bytes};

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
