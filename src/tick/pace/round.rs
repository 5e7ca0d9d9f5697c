//! A round of `on_all`: when it ends, and who was late for it.
//!
//! In: the frames that wait, what they say of the end of their tick, the floor of the ticks before. Out: a time.

use super::held::Held;
use super::{Beat, Pacer};
use crate::limits::SOURCES_MAX;

impl Pacer {
    /// Learns what a tick takes whatever its budget is, and by how much `CLOCK_BOOTTIME` is ahead of `CLOCK_MONOTONIC`:
    /// a round leaves its tick time for more than that, where a frame says when it is to end.
    pub fn know(&mut self, floor_ns: u64, boot_ahead_ns: u64) {
        (self.floor_ns, self.boot_ahead_ns) = (floor_ns, boot_ahead_ns);
    }

    /// When the round under way ends: now, if every source that is waited for has sent; else when it is late, or a
    /// frame in it can wait no longer.
    pub(super) fn round_ends_ns(&self, now_ns: u64) -> Option<u64> {
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
        let urgent_ns = self.newest().filter_map(|held| self.waits_until_ns(held));
        Some(if missing {
            urgent_ns.fold(late_ns, u64::min)
        } else {
            now_ns
        })
    }

    /// Of each source that is in the round the newest frame: the one that says when its tick is to end.
    fn newest(&self) -> impl Iterator<Item = &Held> {
        let mut seen = [false; SOURCES_MAX];
        let counting = self.queue.frames().iter().rev();
        counting.filter(move |held| {
            let place = held.whose.source.filter(|_| held.whose.speaks);
            let seen = place.and_then(|place| seen.get_mut(place));
            seen.is_some_and(|seen| !std::mem::replace(seen, true))
        })
    }

    /// Until when a frame that says when its tick is to end can wait for others: for half of what that leaves above the
    /// floor. The other half is for the pairs.
    fn waits_until_ns(&self, held: &Held) -> Option<u64> {
        let (header, received_ns) = (&held.frame.header, held.whose.received_ns);
        let own_ns = header.deadline_ns.saturating_add(self.boot_ahead_ns);
        let own_ns = (header.deadline_ns != 0).then(|| own_ns.saturating_sub(received_ns));
        let left_ns = (header.time_left_ns != 0).then_some(header.time_left_ns);
        let left_ns = own_ns.into_iter().chain(left_ns).min()?;
        Some(received_ns.saturating_add(left_ns.saturating_sub(self.floor_ns) / 2))
    }

    pub(super) fn close_round(&mut self, now_ns: u64, late_ns: u64) {
        for source in &mut self.sources {
            source.late |= source.is_waited_for(now_ns) && !source.sent;
            source.sent = false;
        }
        self.beat = Beat::OnAll {
            since_ns: None,
            late_ns,
        };
    }
}
