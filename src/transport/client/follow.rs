//! Following the ticks: each message is matched with its tick; messages older than the newest tick are dropped.

use super::link::Link;
use super::list::{ContactList, PairList};
use super::{BOOTS_OVER_MAX, Heard, Restarted, ends_of};
use crate::error::Result;
use crate::wire::{
    BodyRow, ContactRow, MessageHeader, NameRow, PairRow, Reason, RegionRow, State, TickRow,
};

/// Ticks of the current boot that may still come while a message of the next one is there: twice the length of a queue.
/// A message that waits longer for its tick is from a boot that came and went unseen.
const TICKS_LEFT_MAX: u32 = 16;

/// A message as it was received.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message<T, H = MessageHeader> {
    /// Its header; boot id 0: none yet.
    pub header: H,
    /// `[n]` rows.
    pub rows: Vec<T>,
}

impl<T> Message<T> {
    fn is_of(&self, tick: &MessageHeader) -> bool {
        self.header.boot_id == tick.boot_id && self.header.tick == tick.tick
    }
}

/// The newest tick and its messages.
#[derive(Clone, Debug, Default)]
pub struct View {
    tick: TickRow,
    pairs: Stream<PairRow>,
    list: PairList,
    contacts: Stream<ContactRow>,
    contact_list: ContactList,
    regions: Stream<RegionRow>,
    bodies: Stream<BodyRow>,
    body_verdicts: Stream<u8>,
    names: Stream<NameRow>,
    plan: Stream<u8>,
}

impl View {
    /// The newest tick; tick 0: none yet.
    #[must_use]
    pub fn tick(&self) -> &TickRow {
        &self.tick
    }

    /// Returns whether the tick is still in progress, for longer than a heartbeat: it has no messages yet, and is the
    /// result of no frame. Messages sent with its end are read with its end, however late the client reads.
    #[must_use]
    pub fn is_under_way(&self) -> bool {
        // No finished tick looks like this: undecided pairs alone are no reason for `unknown`.
        self.tick.header.state == State::Unknown.code()
            && self.tick.reasons == Reason::Undecided.bit()
    }

    /// The pairs of this very tick; `None`: not subscribed when it began, or overwritten in the queue.
    #[must_use]
    pub fn pairs(&self) -> Option<&Message<PairRow>> {
        self.pairs.of(&self.tick.header)
    }

    /// The list of pairs at this very tick, built from `changes`; `None`: not subscribed when it began, or incomplete
    /// (yet, or again: the whole list was requested from the daemon).
    #[must_use]
    pub fn list(&self) -> Option<&PairList> {
        self.list.of(&self.tick.header)
    }

    /// The contacts of this very tick; `None` as for [`View::pairs`].
    #[must_use]
    pub fn contacts(&self) -> Option<&Message<ContactRow>> {
        self.contacts.of(&self.tick.header)
    }

    /// The contacts at this very tick, built from `contact_changes`; `None` as for [`View::list`].
    #[must_use]
    pub fn contact_list(&self) -> Option<&ContactList> {
        self.contact_list.of(&self.tick.header)
    }

    /// The regions of this very tick; `None` as for [`View::pairs`].
    #[must_use]
    pub fn regions(&self) -> Option<&Message<RegionRow>> {
        self.regions.of(&self.tick.header)
    }

    /// The bodies of this very tick; `None` as for [`View::pairs`].
    #[must_use]
    pub fn bodies(&self) -> Option<&Message<BodyRow>> {
        self.bodies.of(&self.tick.header)
    }

    /// One `Verdict` per body of this very tick, in the order of the names; `None` as for [`View::pairs`].
    #[must_use]
    pub fn body_verdicts(&self) -> Option<&Message<u8>> {
        self.body_verdicts.of(&self.tick.header)
    }

    /// The newest names of this boot, by body id.
    #[must_use]
    pub fn names(&self) -> Option<&Message<NameRow>> {
        self.names.newest(&self.tick.header)
    }

    /// The newest plan of this boot, JSON.
    #[must_use]
    pub fn plan(&self) -> Option<&Message<u8>> {
        self.plan.newest(&self.tick.header)
    }
}

/// The current message, and one that came early.
#[derive(Clone, Debug, Default)]
struct Stream<T> {
    now: Message<T>,
    ahead: Message<T>,
    has_ahead: bool,
    wait: Wait,
}

/// How long the message that came early has waited.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wait(u32);

impl Wait {
    /// The message has another boot id than the tick that came; returns whether it waits in vain.
    pub(super) fn is_in_vain(&mut self, boot_id: u64, boots_over: &mut Vec<u64>) -> bool {
        self.0 += 1;
        let in_vain = self.0 > TICKS_LEFT_MAX;
        if in_vain {
            self.0 = 0;
            note_over(boots_over, boot_id);
        }
        in_vain
    }

    /// Another message came.
    pub(super) fn begin(&mut self) {
        self.0 = 0;
    }
}

/// Remembers a boot as over.
fn note_over(boots_over: &mut Vec<u64>, boot_id: u64) {
    if boots_over.len() == BOOTS_OVER_MAX {
        boots_over.remove(0);
    }
    boots_over.push(boot_id);
}

impl<T> Stream<T> {
    fn of(&self, tick: &MessageHeader) -> Option<&Message<T>> {
        self.now.is_of(tick).then_some(&self.now)
    }

    fn newest(&self, tick: &MessageHeader) -> Option<&Message<T>> {
        (tick.boot_id != 0 && self.now.header.boot_id == tick.boot_id).then_some(&self.now)
    }

    /// Takes messages up to the tick; one of a later tick or boot is kept for later.
    fn advance(
        &mut self,
        tick: &MessageHeader,
        boots_over: &mut Vec<u64>,
        mut read: impl FnMut(&mut Message<T>) -> Result<bool>,
    ) -> Result<()> {
        loop {
            if !self.has_ahead {
                if !read(&mut self.ahead)? {
                    return Ok(());
                }
                self.has_ahead = true;
                self.wait.begin();
            }
            let header = &self.ahead.header;
            let same_boot = header.boot_id == tick.boot_id;
            if boots_over.contains(&header.boot_id) {
                self.has_ahead = false;
            } else if same_boot && header.tick <= tick.tick {
                let newer =
                    self.now.header.boot_id != header.boot_id || self.now.header.tick < header.tick;
                if newer {
                    std::mem::swap(&mut self.now, &mut self.ahead);
                }
                self.has_ahead = false;
            } else if same_boot || !self.wait.is_in_vain(header.boot_id, boots_over) {
                return Ok(());
            }
        }
    }
}

/// The state of following.
#[derive(Debug, Default)]
pub(super) struct Follow {
    pub(super) view: View,
    boots_over: Vec<u64>,
    /// First tick of a new boot, held back until the restart was reported.
    held: Option<TickRow>,
}

impl Follow {
    /// The next newer tick with all its messages, or the report of a restart.
    pub(super) fn next(&mut self, link: &mut dyn Link) -> Result<Heard> {
        loop {
            let tick = match self.held.take() {
                Some(tick) => tick,
                None => match link.tick()? {
                    Some(tick) => tick,
                    None => return Ok(Heard::Silence),
                },
            };
            let (old, new) = (self.view.tick.header, tick.header);
            // The queues of an old and a new daemon are read in no fixed order.
            if self.boots_over.contains(&new.boot_id) {
                continue;
            }
            if old.boot_id != 0 && old.boot_id != new.boot_id {
                // There is one daemon at a time: leftovers of one that came and went unseen are older.
                if tick.sent_ns < self.view.tick.sent_ns {
                    note_over(&mut self.boots_over, new.boot_id);
                    continue;
                }
                return Ok(Heard::Restarted(self.restart(tick)));
            }
            // A tick that takes longer than a heartbeat is announced under its own number before it is finished.
            let (seen, next) = (&self.view.tick, &tick);
            if (next.header.tick, next.sent_ns) <= (seen.header.tick, seen.sent_ns) {
                continue;
            }
            self.view.tick = tick;
            self.gather(link, &new)?;
            return Ok(Heard::Tick);
        }
    }

    fn restart(&mut self, tick: TickRow) -> Restarted {
        let old_boot = self.view.tick.header.boot_id;
        note_over(&mut self.boots_over, old_boot);
        let (pairs, list) = (&self.view.pairs.now, &self.view.list);
        let ends = if pairs.header.boot_id == old_boot {
            ends_of(pairs.header.tick, pairs.rows.iter().copied())
        } else if list.boot_id() == old_boot {
            ends_of(list.tick(), list.iter())
        } else {
            Vec::new()
        };
        self.view.tick = TickRow::default();
        self.held = Some(tick);
        Restarted {
            old_boot,
            new_boot: tick.header.boot_id,
            ends,
        }
    }

    /// The messages of a tick were sent before it, so they are already there.
    fn gather(&mut self, link: &mut dyn Link, tick: &MessageHeader) -> Result<()> {
        let (view, over) = (&mut self.view, &mut self.boots_over);
        view.names.advance(tick, over, |m| link.names(m))?;
        view.plan.advance(tick, over, |m| link.plan(m))?;
        // A late reader finds the rows of the tick's end together with its earlier announcement; they are returned
        // once.
        if view.is_under_way() {
            return Ok(());
        }
        view.contacts.advance(tick, over, |m| link.contacts(m))?;
        view.contact_list.advance(tick, over, link)?;
        view.regions.advance(tick, over, |m| link.regions(m))?;
        view.pairs.advance(tick, over, |m| link.pairs(m))?;
        view.list.advance(tick, over, link)?;
        view.bodies.advance(tick, over, |m| link.bodies(m))?;
        view.body_verdicts
            .advance(tick, over, |m| link.body_verdicts(m))
    }
}

#[cfg(test)]
mod tests;
