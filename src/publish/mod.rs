//! Fills the outbox: what is known after a tick, for the messages that have readers.
//!
//! In: the world, the pair set's delta, the narrow phase's findings, the demand. Out: `wire::Outbox`, ordered by ids.
//! Rows that do not fit are left out by rank and counted, and the state is then never `clear`.

mod bodies;
mod changes;
mod contact_changes;
mod contacts;
mod events;
mod fit;
mod kept;
mod leaders;
mod listing;
mod owed;
mod pairs;
mod regions;
mod review;
mod state;
mod validate;

use crate::config::Limits;
use crate::narrow::Narrow;
use crate::pairs::{PairDelta, PairSet};
use crate::wire::{ContactRow, Demand, MessageHeader, Outbox, PairRow, WIRE_VERSION};
use crate::world::World;

use changes::Chain;
use events::Events;
use fit::{Rank, Stood};
use kept::Kept;
use listing::Listing;
use owed::Owed;
use state::Survey;

/// How many pairs ahead the data of a pair are prefetched: a pair takes some 50 ns, a memory access about twice as
/// long.
const AHEAD: usize = 8;

/// Which of the messages made of kept rows have readers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Heard {
    pairs: bool,
    contacts: bool,
    contact_changes: bool,
}

/// What a tick passes to the publisher.
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
    /// Which messages have readers.
    pub demand: Demand,
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// Tick.
    pub tick: u64,
    /// Time of the tick, nanoseconds of `CLOCK_BOOTTIME`.
    pub now_ns: u64,
}

/// Keeps what was certified and sent, and reuses its memory from tick to tick.
#[derive(Debug)]
pub struct Publisher {
    limits: Limits,
    events: Events,
    /// Events of messages that could not be delivered.
    owed: Owed,
    listing: Listing,
    survey: Survey,
    /// Pairs whose findings were read for their rows in the last tick.
    pub(crate) reviewed: u64,
    /// Which messages had readers in the last tick.
    heard: Heard,
    kept_pairs: Kept<PairRow>,
    /// The base of the next `changes`.
    chain: Chain,
    kept_contacts: Kept<ContactRow>,
    /// The base of the next `contact_changes`.
    contact_chain: Chain,
    /// Used only when not all contacts fit: for each pair with contacts the depth in metres, the index of its row in
    /// the list, and its number of contacts.
    contact_pairs: Vec<(f64, u32, u32)>,
    /// Used only when not all rows fit: by index whether a row is sent.
    chosen: Vec<bool>,
    /// Index of each row in `pairs` in the last tick.
    stood: Stood,
    /// Whether `contacts` had all its rows in the last tick.
    had_all_contacts: bool,
    /// Used only when not all rows fit, or for regions: the rows to choose from.
    ranked: Vec<Rank>,
    verdicts: Vec<u8>,
    next_contact: u64,
}

impl Publisher {
    /// A publisher with these limits.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            events: Events::default(),
            owed: Owed::default(),
            listing: Listing::default(),
            survey: Survey::default(),
            reviewed: 0,
            heard: Heard::default(),
            kept_pairs: Kept::default(),
            chain: Chain::default(),
            kept_contacts: Kept::default(),
            contact_chain: Chain::default(),
            contact_pairs: Vec::new(),
            chosen: Vec::new(),
            stood: Stood::default(),
            had_all_contacts: false,
            ranked: Vec::new(),
            verdicts: Vec::new(),
            next_contact: 1,
        }
    }

    /// The pair set was rebuilt: remembered data carry over by body ids.
    ///
    /// * `last` - the last tick, which `world` still shows.
    pub fn forget_slots(&mut self, last: u64, world: &World) {
        self.events.forget_slots(last, world);
        self.listing.forget_slots();
        self.break_chains();
        self.survey.forget();
    }

    /// Nothing of the last tick is valid: every row is made again.
    pub(crate) fn forget_rows(&mut self) {
        self.listing.forget();
        self.break_chains();
        self.survey.forget();
    }

    fn break_chains(&mut self) {
        self.chain.break_off();
        self.contact_chain.break_off();
    }

    /// Fills every message that has readers, then the tick's own counts, state and reasons.
    ///
    /// * `out` - as the last call left it: rows that are still valid are not made again.
    pub fn fill(&mut self, view: &mut View<'_>, out: &mut Outbox) {
        let header = Self::header(view);
        self.review(view);
        // Before the pairs: filling these leaves rows that do not fit out of the list.
        let contacts_left = self.fill_contacts(view, header, out);
        let regions_left = self.fill_regions(view, header, out);
        let pairs_left = self.fill_list(view, header, out);
        let bodies_left = self.fill_bodies(view, header, out);
        Self::fill_names(view, out);
        let left = pairs_left + contacts_left + regions_left + bodies_left;
        self.fill_tick(view, header, left, out);
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
