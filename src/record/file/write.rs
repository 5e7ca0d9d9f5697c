//! Writes a recording: exact to the bit for a replay, and as ROS 2 messages for viewers.

use std::collections::BTreeMap;

use super::medium::Medium;
use super::shown::{self, Show, Shown};
use super::tape::Tape;
use super::{INPUT, NOT_SHOWN, OUTPUT, START, TICKS, WHY};
use crate::error::Result;
use crate::record::code::{put_input, put_output, start_bytes};
use crate::record::{Sink, Start, TickRecord};

/// Our own topics and their types.
const TOPICS: [(&str, &str); 3] = [
    (START, "sweepd_record/msg/Start"),
    (INPUT, "sweepd_record/msg/Input"),
    (OUTPUT, "sweepd_record/msg/Output"),
];

/// Writes a recording as MCAP.
#[derive(Debug)]
pub struct McapSink<W: Medium> {
    tape: Tape<W>,
    show: Show,
    since_1970_ns: u64,
    /// Number of ticks without messages for viewers, because the disk was too slow.
    not_shown: u64,
}

impl<W: Medium> McapSink<W> {
    /// Begins a recording with `start`.
    ///
    /// * `name` - name of the file in messages.
    /// * `frame_id` - the scene's frame.
    ///
    /// # Errors
    /// `Error::Io` if it cannot be written.
    pub fn new(to: W, name: &str, frame_id: &str, start: &Start) -> Result<Self> {
        let facts = &start.facts;
        let topics = TOPICS.into_iter().chain(shown::TOPICS);
        let mut sink = Self {
            tape: Tape::new(to, name, topics)?,
            show: Show::new(frame_id),
            since_1970_ns: facts.since_1970_ns,
            not_shown: 0,
        };
        let time_ns = facts.started_ns.saturating_add(facts.since_1970_ns);
        sink.tape.write_bytes(START, time_ns, |to| {
            to.extend_from_slice(&start_bytes(start))
        })?;
        sink.tape.flush()?;
        Ok(sink)
    }

    /// Number of ticks in the file.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.tape.ticks()
    }
}

impl<W: Medium + Send> Sink for McapSink<W> {
    fn tick(&mut self, record: &TickRecord, hurried: bool) -> Result<()> {
        let (out, demand) = (&record.out, record.ask.demand);
        let time_ns = out.tick.sent_ns.saturating_add(self.since_1970_ns);
        self.tape
            .write_bytes(INPUT, time_ns, |to| put_input(record, to))?;
        self.tape.count();
        self.tape
            .write_bytes(OUTPUT, time_ns, |to| put_output(out, demand, to))?;
        // Later messages need the names: a tick with new names is never left out.
        if hurried && !out.names_changed {
            self.not_shown += 1;
            return Ok(());
        }
        let shown = Shown {
            tick: &out.tick,
            names: out.names_changed.then_some(out.names.as_slice()),
            bodies: demand.bodies.then_some(out.bodies.as_slice()),
            contacts: demand
                .contacts
                .then_some((&out.contacts_header, out.contacts.as_slice())),
            pairs: demand
                .pairs
                .then_some((&out.pairs_header, out.pairs.as_slice())),
        };
        self.show.rows(&mut self.tape, time_ns, &shown)?;
        self.show.tick(&mut self.tape, time_ns, &out.tick)
    }

    fn flush(&mut self) -> Result<()> {
        self.tape.flush()
    }

    fn end(&mut self, why: &str) -> Result<()> {
        self.tape.end(BTreeMap::from([
            (WHY.to_owned(), why.to_owned()),
            (TICKS.to_owned(), self.tape.ticks().to_string()),
            (NOT_SHOWN.to_owned(), self.not_shown.to_string()),
        ]))
    }
}
