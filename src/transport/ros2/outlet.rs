//! The sending thread (`ros-tx`): turns parcels into messages and publishes them, the tick last.
//!
//! In: parcels of the tick thread. Out: topics, and the demand of their readers. A message that DDS does not accept at
//! once is kept for a short time, and counted if it is lost; this thread does not wait for it.

mod heard;
mod latest;
mod owed;
mod publishers;
mod roster;
mod unsent;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

pub(super) use heard::Topics;
pub(super) use latest::Latest;
pub(super) use publishers::Publishers;
use ros2_client::{Context, Node, Publisher};
pub(super) use roster::Unheard;
use rustdds::mio1::Waker;
use serde::Serialize;
pub(super) use unsent::Unsent;

use super::diagnose::Diagnoser;
use super::markers::{Boxes, CONTACTS_MAX, collisions, kept_ns, markers};
use super::names::Names;
use super::namesakes::Namesakes;
use super::noise::{Noise, unknown_participants};
use super::parcel::{Next, Parcel, Parcels};
use super::readers::Readers;
use super::shared::{Say, Shared};
use super::stamp::stamp_of;
use super::strangers::Strangers;
use super::wheel::{Means, Sent, Wheel};
use super::{RosSourceSpec, open};
use crate::time::{Clock as _, SystemClock};
use crate::transport::open_files;
use crate::wire::ros::{Counts, Speaker};
use crate::wire::{Demand, NameRow};

/// Longest sleep: the delay until a new reader is noticed.
const SLEEP: Duration = Duration::from_millis(100);
/// As [`SLEEP`], while a writer has not accepted all: the longest extra delay of a kept message.
const SLEEP_HOLDING: Duration = Duration::from_millis(5);
/// Time between two messages of `/diagnostics`, nanoseconds.
const DIAGNOSTICS_NS: u64 = 1_000_000_000;
/// State of the sending thread.
pub(super) struct Outlet {
    pub(super) node: Node,
    pub(super) context: Context,
    pub(super) publishers: Publishers,
    pub(super) parcels: Arc<Parcels>,
    pub(super) shared: Arc<Shared>,
    /// Waker of the receiving thread.
    pub(super) waker: Arc<Waker>,
    pub(super) speaker: Speaker,
    pub(super) boot_id: u64,
    /// The node's full name.
    pub(super) name: String,
    pub(super) diagnoser: Diagnoser,
    pub(super) latest: Latest,
    /// Time of the last diagnostics, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) told_ns: u64,
    /// Time of the last markers, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) shown_ns: u64,
    /// The daemon's heartbeat, nanoseconds.
    pub(super) heartbeat_ns: u64,
    pub(super) boxes: Boxes,
    /// Contacts that the newest `~/collisions` leaves out.
    pub(super) left_out: u64,
    pub(super) unsent: Unsent,
    pub(super) noise: Noise,
    pub(super) strangers: Strangers,
    pub(super) readers: Readers,
    pub(super) read: Read,
    pub(super) namesakes: Namesakes,
    /// Makes full names of topics for bodies added later.
    pub(super) names: Names,
    /// The topics of bodies.
    pub(super) topics: Topics,
    pub(super) unheard: Unheard,
    pub(super) sources: Vec<RosSourceSpec>,
}

/// The topics that have readers, as of the last look.
#[derive(Clone, Copy, Debug, Default)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "one independent switch a topic"
)]
pub(super) struct Read {
    markers: bool,
    collisions: bool,
    pairs: bool,
    contacts: bool,
    /// Any topic of a tick: `~/state` and `~/tick` are sent with each of them, so that readers of rows also get the
    /// tick that the rows belong to.
    ticks: bool,
}

impl Outlet {
    /// Runs until the node closes; then the node leaves the graph.
    pub(super) fn run(mut self) {
        loop {
            self.follow_edits();
            self.look_who_listens();
            self.look_who_is_back();
            let now_ns = SystemClock.boottime_ns();
            self.unsent.look(&mut self.publishers, &self.shared, now_ns);
            for words in std::mem::take(&mut *open(&self.shared.words)) {
                self.shared.write(Say::Warn, &words);
            }
            self.diagnose();
            let strange = self.strangers.watch(SystemClock.boottime_ns());
            let misfits = self.readers.misfits.take_new();
            let own = self.namesakes.look().into_iter();
            for text in own.chain(strange).chain(misfits) {
                self.shared.say(Say::Warn, &text);
            }
            let holds = self.hand_over();
            let sleep = if holds { SLEEP_HOLDING } else { SLEEP };
            match self.parcels.next(sleep) {
                Next::Stop => break,
                Next::Nothing => {}
                Next::Parcel(parcel, names) => {
                    if let Some((scene_rev, rows)) = names {
                        self.take_names(scene_rev, &rows);
                    }
                    // Names come with the first tick that has them, or with an earlier one.
                    if parcel.done && self.shared.set_names_rev(parcel.tick.header.scene_rev) {
                        // Frames and responses may wait for the names.
                        let _gone_already = self.waker.wake();
                    }
                    let now = self.shared.now();
                    self.speaker.stamp = Some(stamp_of(&parcel.tick, now));
                    self.send_rows(&parcel);
                    self.show(&parcel);
                    self.send_tick(&parcel);
                    self.latest.take(&parcel);
                    self.parcels.give_back(*parcel);
                }
            }
        }
    }

    /// Reports lost participants, and asks for a new node when one of them is back.
    fn look_who_is_back(&mut self) {
        let absent = &mut self.readers.absent;
        for text in absent.take_lost() {
            self.shared.say(Say::Info, &text);
        }
        absent.hear(&unknown_participants());
        if absent.is_back() {
            self.shared.again.store(true, Ordering::Relaxed);
        }
    }

    fn look_who_listens(&mut self) {
        let reliable = self.shared.reliable();
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        self.publishers.set_reliable(&mut pen.means, reliable);
        self.readers.hear(SystemClock.boottime_ns());
        let (out, readers) = (&self.publishers, &self.readers);
        let markers = self.shared.markers_period_ns().is_some() && out.markers.is_read(readers);
        let collisions = self.shared.collisions() && out.collisions.is_read(readers);
        let (pairs, contacts) = (out.pairs.is_read(readers), out.contacts.is_read(readers));
        let rows = markers || collisions || pairs || contacts;
        self.read = Read {
            markers,
            collisions,
            pairs,
            contacts,
            ticks: rows || out.state.is_read(readers) || out.tick.is_read(readers),
        };
        self.shared.set_demand(Demand {
            pairs: markers || self.read.pairs,
            contacts: markers || collisions || self.read.contacts,
            bodies: markers,
            ..Demand::default()
        });
    }

    /// Publishes kept messages again; returns whether some are left.
    fn hand_over(&mut self) -> bool {
        let out = &mut self.publishers;
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        (pen.shared).note_unsent(out.names.hand_over(&mut pen.means));
        pen.flush(&mut out.contacts);
        pen.flush(&mut out.pairs);
        pen.flush(&mut out.collisions);
        pen.flush(&mut out.markers);
        pen.flush(&mut out.state);
        pen.flush(&mut out.tick);
        out.hold()
    }

    /// Publishes markers at their own rate and collisions each tick, if they have readers.
    fn show(&mut self, parcel: &Parcel) {
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        self.left_out = 0;
        if self.read.collisions && parcel.holds.contacts {
            let header = self.speaker.header(parcel.tick.header.oldest_stamp_ns);
            let (message, left_out) = collisions(header, &self.speaker.book, parcel);
            self.left_out = left_out;
            pen.write(&mut self.publishers.collisions, message);
        }
        let Some(period_ns) = self.shared.markers_period_ns() else {
            return;
        };
        let now_ns = pen.means.now_ns;
        let since_ns = now_ns.saturating_sub(self.shown_ns);
        if self.read.markers && parcel.holds.bodies && since_ns >= period_ns {
            self.shown_ns = now_ns;
            let kept_ns = kept_ns(period_ns, self.heartbeat_ns, since_ns);
            let message = markers(&self.speaker, parcel, &self.boxes, kept_ns);
            pen.write(&mut self.publishers.markers, message);
        }
    }

    /// Publishes diagnostics once a second, if they have readers.
    fn diagnose(&mut self) {
        let now_ns = SystemClock.boottime_ns();
        let to = &self.publishers.diagnostics;
        let since_ns = now_ns.saturating_sub(self.told_ns);
        let due = since_ns >= DIAGNOSTICS_NS && self.latest.is_there();
        if !due || self.readers.count(to) == 0 {
            return;
        }
        // Counts from a time without readers are not reported as events of the last second.
        let is_first = since_ns > 2 * DIAGNOSTICS_NS;
        self.told_ns = now_ns;
        let row = self.latest.row();
        let now = self.shared.now();
        let counts = Counts {
            datagrams_dropped: self.noise.dropped(),
            datagrams_unread: self.noise.unread(),
            ..self.shared.counts()
        };
        let mut faults = self.shared.faults();
        faults.extend_from_slice(self.strangers.found());
        faults.extend(self.readers.misfits.found());
        faults.extend(open_files::short());
        faults.extend(self.unsent.words.clone());
        if self.left_out > 0 {
            let text = "contacts are left out of ~/collisions, which holds the deepest";
            faults.push(format!(
                "{} {text} {CONTACTS_MAX}: ~/contacts tells how many there are, and ros_max_contacts sets how many it holds",
                self.left_out
            ));
        }
        if is_first {
            self.diagnoser = Diagnoser::since(&row, counts);
        }
        let message = self
            .diagnoser
            .diagnose(now, &self.name, &row, counts, &faults);
        self.publish(&self.publishers.diagnostics, message);
    }

    fn take_names(&mut self, scene_rev: u64, rows: &[NameRow]) {
        let book = self.speaker.book.next(rows);
        self.shared.set_book(Arc::new(book.clone()));
        self.boxes.retain(|id, _| book.holds(*id));
        self.speaker.book = book;
        let now = self.shared.now();
        let messages = self.speaker.names(now, self.boot_id, scene_rev);
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        let lost = self.publishers.names.say(messages, &mut pen.means);
        self.shared.note_unsent(lost);
    }

    /// Publishes contacts and pairs.
    fn send_rows(&mut self, parcel: &Parcel) {
        let out = &mut self.publishers;
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        if parcel.holds.contacts && self.read.contacts {
            for message in self
                .speaker
                .contacts(&parcel.contacts_header, &parcel.contacts)
            {
                pen.write(&mut out.contacts, message);
            }
        }
        if parcel.holds.pairs && self.read.pairs {
            for message in self.speaker.pairs(&parcel.pairs_header, &parcel.pairs) {
                pen.write(&mut out.pairs, message);
            }
        }
    }

    /// Publishes the tick, last: a reader that has it has all messages of the tick, except those kept for slow readers.
    /// The tick does not wait for these, since its silence would mean that the daemon is gone.
    fn send_tick(&mut self, parcel: &Parcel) {
        if !self.read.ticks {
            return;
        }
        let out = &mut self.publishers;
        let readers = &mut self.readers;
        let mut pen = Pen::of(&mut self.node, &self.context, &self.shared, readers);
        pen.write(&mut out.state, self.speaker.state(&parcel.tick));
        let tick = self.speaker.tick(&parcel.tick, self.shared.counts());
        pen.write(&mut out.tick, tick);
    }

    fn publish<M: Serialize>(&self, to: &Publisher<M>, message: M) {
        if to.publish(message).is_err() {
            self.shared.note_unsent(1);
        }
    }
}

/// Publishes on a [`Wheel`], and counts lost messages.
struct Pen<'a> {
    means: Means<'a>,
    shared: &'a Shared,
}

impl<'a> Pen<'a> {
    fn of(
        node: &'a mut Node,
        context: &'a Context,
        shared: &'a Shared,
        readers: &'a mut Readers,
    ) -> Self {
        let means = Means {
            node,
            context,
            readers,
            now_ns: SystemClock.boottime_ns(),
        };
        Self { means, shared }
    }

    fn write<M: Serialize>(&mut self, to: &mut Wheel<M>, message: M) {
        let sent = to.publish(message, &mut self.means);
        self.note(sent);
    }

    fn flush<M: Serialize>(&mut self, to: &mut Wheel<M>) {
        let sent = to.flush(&mut self.means);
        self.note(sent);
    }

    fn note(&self, sent: Sent) {
        if sent.turned {
            tracing::debug!("ROS 2: a reader does not acknowledge; a new writer goes on");
        }
        self.shared.note_unsent(sent.lost + sent.given_up);
    }
}
