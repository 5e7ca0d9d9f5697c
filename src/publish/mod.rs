//! Fills the outbox: what is known after a tick, for those who listen.
//!
//! In: the world, the pair set's delta, the narrow phase's findings, the demand. Out: `wire::Outbox`, ordered by ids.
//! Rows that do not fit are left out by rank and counted, and the state is then never `clear`.

mod bodies;
mod contacts;
mod events;
mod listing;
mod pairs;
mod state;

use crate::config::Limits;
use crate::narrow::{Narrow, Passage};
use crate::pairs::{PairDelta, PairSet};
use crate::wire::{Demand, MessageHeader, Outbox, Verdict, WIRE_VERSION};
use crate::world::World;

use events::Events;
use listing::Listing;
use pairs::Row;
use state::Survey;

pub use state::Worst;

/// How many pairs ahead of the one at hand what is known of a pair is asked for: a pair takes some 50 ns, memory about
/// twice as long.
const AHEAD: usize = 8;

/// What a tick hands to the publisher.
#[derive(Debug)]
pub struct View<'a> {
    /// Bodies, sources, rejects.
    pub world: &'a World,
    /// Candidate pairs.
    pub pairs: &'a PairSet,
    /// Pairs that began and ended in this tick.
    pub delta: &'a PairDelta,
    /// Findings; contacts get their ids here.
    pub narrow: &'a mut Narrow,
    /// Who listens.
    pub demand: Demand,
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// Tick.
    pub tick: u64,
    /// Its time, nanoseconds of `CLOCK_BOOTTIME`.
    pub now_ns: u64,
}

/// Remembers what was certified and sent, and reuses its memory from tick to tick.
#[derive(Debug)]
pub struct Publisher {
    limits: Limits,
    events: Events,
    /// Pairs that rows are made of, by ids.
    rows: Vec<Row>,
    listing: Listing,
    survey: Survey,
    /// Depth in metres and place in `rows` of the pairs whose contacts are sent, used only when not all fit.
    contact_pairs: Vec<(f64, usize)>,
    verdicts: Vec<u8>,
    next_contact: u64,
}

impl Publisher {
    /// A publisher that keeps to these limits.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            events: Events::default(),
            rows: Vec::new(),
            listing: Listing::default(),
            survey: Survey::default(),
            contact_pairs: Vec::new(),
            verdicts: Vec::new(),
            next_contact: 1,
        }
    }

    /// The pair set was built anew: what is remembered goes on by body ids.
    pub fn forget_slots(&mut self) {
        self.events.forget_slots();
        self.listing.forget_slots();
    }

    /// Fills every message that is listened to, then the tick's own counts, state and reasons.
    pub fn fill(&mut self, view: &mut View<'_>, out: &mut Outbox) {
        let header = Self::header(view);
        self.review(view);
        // Before the pairs, which leave out of the list what does not fit.
        let contacts_left = self.fill_contacts(view, header, out);
        let pairs_left = self.fill_pairs(view, header, out);
        let bodies_left = self.fill_bodies(view, header, out);
        Self::fill_names(view, out);
        let left = pairs_left + contacts_left + bodies_left;
        self.fill_tick(view, header, left, out);
    }

    /// One walk over the active pairs, for the events, the tick's counts and the rows.
    fn review(&mut self, view: &View<'_>) {
        self.rows.clear();
        self.survey = Survey::default();
        let Self {
            events,
            rows,
            survey,
            listing,
            ..
        } = self;
        events.find_slots(view.tick, view.world, view.pairs);
        events.begin(view.tick, view.world, view.narrow, view.delta);
        let listed = view.demand.pairs || view.demand.contacts;
        let active = view.narrow.active();
        let mut place = 0;
        while let Some(slot) = listing.at(active, place) {
            let ahead = listing.at(active, place + AHEAD);
            if let Some(ahead) = ahead.filter(|slot| !listing.was_seen(*slot, view.tick)) {
                view.narrow.ask_ahead(ahead);
            }
            place += 1;
            if listing.was_seen(slot, view.tick) {
                continue;
            }
            listing.see(slot, view.tick);
            let finding = view.narrow.finding(slot);
            let Some(finding) = finding.filter(|finding| finding.verdict != Verdict::Apart) else {
                continue;
            };
            let (Some(a), Some(b)) = (view.world.tag(finding.a), view.world.tag(finding.b)) else {
                continue;
            };
            let ids = (a.id, b.id);
            events.certify(view.tick, slot, &finding, ids, view.narrow);
            let swept = view.narrow.passage(slot).map(|swept| swept.passage);
            let passage = swept.filter(|passage| events.is_news(slot, *passage));
            survey.take(view.tick, ids, &finding, passage);
            if listed {
                listing.push(rows, Row::of_active(view, slot, ids, &finding, passage));
            }
        }
        self.review_ways(view, listed);
        self.events.merge();
        self.listing.finish(&mut self.rows);
    }

    /// As [`Publisher::review`], of pairs that are apart and not active, but may have touched on the way.
    fn review_ways(&mut self, view: &View<'_>, listed: bool) {
        for swept in view.narrow.swept() {
            let finding = view.narrow.finding(swept.slot);
            let apart = finding.filter(|finding| finding.verdict == Verdict::Apart);
            let Some(finding) = apart.filter(|_| swept.passage != Passage::Free) else {
                continue;
            };
            let (Some(a), Some(b)) = (view.world.tag(finding.a), view.world.tag(finding.b)) else {
                continue;
            };
            let (slot, ids) = (swept.slot, (a.id, b.id));
            self.events
                .certify(view.tick, slot, &finding, ids, view.narrow);
            if self.events.is_news(slot, swept.passage) {
                let passage = Some(swept.passage);
                self.survey.take(view.tick, ids, &finding, passage);
                if listed {
                    let row = Row::of_active(view, slot, ids, &finding, passage);
                    self.listing.push(&mut self.rows, row);
                }
            }
        }
    }

    fn header(view: &View<'_>) -> MessageHeader {
        let (oldest, newest) = view.world.stamps();
        MessageHeader {
            boot_id: view.boot_id,
            tick: view.tick,
            scene_rev: view.world.scene_rev(),
            oldest_stamp_ns: oldest,
            newest_stamp_ns: newest,
            schema: WIRE_VERSION,
            ..MessageHeader::default()
        }
    }
}
