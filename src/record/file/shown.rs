//! A tick as ROS 2 messages for viewers, with names beside ids.

use super::medium::Medium;
use super::tape::Tape;
use crate::error::Result;
use crate::wire::ros::{Book, Counts, Speaker, Time};
use crate::wire::{BodyRow, ContactRow, MessageHeader, NameRow, PairRow, TickRow};

const NAMES: &str = "/sweepd/names";
const BODIES: &str = "/sweepd/bodies";
const CONTACTS: &str = "/sweepd/contacts";
const PAIRS: &str = "/sweepd/pairs";
const STATE: &str = "/sweepd/state";
const TICK: &str = "/sweepd/tick";

/// Topics and their types. Names come before the messages that need them.
pub(super) const TOPICS: [(&str, &str); 6] = [
    (NAMES, "sweepd_msgs/msg/Names"),
    (BODIES, "sweepd_msgs/msg/BodyTransforms"),
    (CONTACTS, "sweepd_msgs/msg/Contacts"),
    (PAIRS, "sweepd_msgs/msg/Pairs"),
    (STATE, "sweepd_msgs/msg/State"),
    (TICK, "sweepd_msgs/msg/Tick"),
];

/// The parts of a tick; without readers a part is `None`.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// The tick.
    pub tick: &'a TickRow,
    /// All names, if they differ from those of the previous tick.
    pub names: Option<&'a [NameRow]>,
    /// Bodies.
    pub bodies: Option<&'a [BodyRow]>,
    /// Contacts.
    pub contacts: Option<(&'a MessageHeader, &'a [ContactRow])>,
    /// Pairs.
    pub pairs: Option<(&'a MessageHeader, &'a [PairRow])>,
}

/// Writes the messages for viewers.
#[derive(Debug)]
pub(super) struct Show {
    speaker: Speaker,
}

impl Show {
    /// * `frame_id` - the scene's frame.
    pub(super) fn new(frame_id: &str) -> Self {
        Self {
            speaker: Speaker::of(frame_id, Book::default()),
        }
    }

    /// Forgets all names, since another boot assigns ids anew.
    pub(super) fn forget_names(&mut self) {
        self.speaker.book = Book::default();
    }

    /// Writes all parts of a tick except the tick itself.
    pub(super) fn rows<W: Medium>(
        &mut self,
        tape: &mut Tape<W>,
        time_ns: u64,
        shown: &Shown<'_>,
    ) -> Result<()> {
        if let Some(names) = shown.names {
            self.speaker.book = self.speaker.book.next(names);
            let (stamp, header) = (Time::from_ns(time_ns), &shown.tick.header);
            for names in self.speaker.names(stamp, header.boot_id, header.scene_rev) {
                tape.write_message(NAMES, time_ns, &names)?;
            }
        }
        if let Some(rows) = shown.bodies {
            let bodies = self.speaker.bodies(shown.tick, rows);
            tape.write_message(BODIES, time_ns, &bodies)?;
        }
        if let Some((header, rows)) = shown.contacts {
            for contacts in self.speaker.contacts(header, rows) {
                tape.write_message(CONTACTS, time_ns, &contacts)?;
            }
        }
        if let Some((header, rows)) = shown.pairs {
            self.pairs(tape, time_ns, header, rows)?;
        }
        Ok(())
    }

    /// Writes a tick, after all its parts.
    pub(super) fn tick<W: Medium>(
        &mut self,
        tape: &mut Tape<W>,
        time_ns: u64,
        tick: &TickRow,
    ) -> Result<()> {
        let state = self.speaker.state(tick);
        tape.write_message(STATE, time_ns, &state)?;
        let tick = self.speaker.tick(tick, Counts::default());
        tape.write_message(TICK, time_ns, &tick)
    }

    /// Writes pairs.
    pub(super) fn pairs<W: Medium>(
        &self,
        tape: &mut Tape<W>,
        time_ns: u64,
        header: &MessageHeader,
        rows: &[PairRow],
    ) -> Result<()> {
        for pairs in self.speaker.pairs(header, rows) {
            tape.write_message(PAIRS, time_ns, &pairs)?;
        }
        Ok(())
    }
}
