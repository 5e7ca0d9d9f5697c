//! The outbox of a tick, and the demand that says which parts of it anybody reads.

use super::changes::ChangesHeader;
use super::region::RegionRow;
use super::rows::{BodyRow, ContactRow, MessageHeader, NameRow, PairRow};
use super::tick::TickRow;

/// What is listened to; what nobody listens to is not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "one independent switch a message"
)]
pub struct Demand {
    /// Somebody reads `pairs`.
    pub pairs: bool,
    /// Somebody reads `contacts`: manifolds are computed.
    pub contacts: bool,
    /// Somebody reads `regions`: work goes on for the contacts of pairs that touch, as if these were read.
    pub regions: bool,
    /// Somebody reads `bodies`.
    pub bodies: bool,
    /// Somebody reads `body_verdicts`.
    pub body_verdicts: bool,
    /// Somebody reads `changes`.
    pub changes: bool,
    /// Somebody reads `contact_changes`: manifolds are computed.
    pub contact_changes: bool,
    /// Somebody came to one of these two since its last message, or missed that: the next of both are whole.
    pub changes_anew: bool,
}

impl Demand {
    /// Everything.
    pub const ALL: Self = Self {
        pairs: true,
        contacts: true,
        regions: true,
        bodies: true,
        body_verdicts: true,
        changes: true,
        contact_changes: true,
        changes_anew: false,
    };

    /// Whether contacts are told, all of them or what is new.
    #[must_use]
    pub fn tells_contacts(self) -> bool {
        self.contacts || self.contact_changes
    }
}

/// What of a tick could not be handed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Undelivered {
    /// How many messages.
    pub messages: u64,
    /// `pairs` is one of them and has reached none of its readers: its events are owed to them.
    pub pairs: bool,
    /// The same of `changes`.
    pub changes: bool,
}

impl Undelivered {
    /// What two doors together could not hand over.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            messages: self.messages + other.messages,
            pairs: self.pairs || other.pairs,
            changes: self.changes || other.changes,
        }
    }
}

/// What one tick publishes. Kept and refilled from tick to tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outbox {
    /// The tick, to be sent last.
    pub tick: TickRow,
    /// Header of `pairs`.
    pub pairs_header: MessageHeader,
    /// Pairs that are not plainly apart and last events, by `(body_a, body_b)`.
    pub pairs: Vec<PairRow>,
    /// For the readers of a door whose `pairs` reached none of them ([`Undelivered`]): rows with the events that they
    /// lack, to stand in the place of the same pairs' rows or among them. One that has left ([`PairRow::has_left`])
    /// stands for none. Empty but then.
    pub owed: Vec<PairRow>,
    /// Begins and their ends that were never sent to these readers, in this boot; to be added to those of the tick.
    pub owed_cancelled: u64,
    /// Header of `changes`.
    pub changes_header: ChangesHeader,
    /// What is new of `pairs` since the tick before, in the same order; or all of it, by the header.
    pub changes: Vec<PairRow>,
    /// Header of `contacts`.
    pub contacts_header: MessageHeader,
    /// Contacts, by `(body_a, body_b)`, then by shapes, triangles and id.
    pub contacts: Vec<ContactRow>,
    /// Header of `contact_changes`.
    pub contact_changes_header: ChangesHeader,
    /// What is new of `contacts` since the tick before, in the same order; or all of it, by the header.
    pub contact_changes: Vec<ContactRow>,
    /// Header of `regions`.
    pub regions_header: MessageHeader,
    /// Regions, by `(body_a, body_b)`, then by index.
    pub regions: Vec<RegionRow>,
    /// Header of `bodies`.
    pub bodies_header: MessageHeader,
    /// Bodies, by id.
    pub bodies: Vec<BodyRow>,
    /// Worst `Verdict` of each body, in the order of `names`; never truncated.
    pub body_verdicts: Vec<u8>,
    /// Names, by body id; filled when the scene changed.
    pub names: Vec<NameRow>,
    /// The plan as JSON; filled when it changed.
    pub plan: String,
    /// Whether `names` is new in this tick.
    pub names_changed: bool,
    /// Whether `plan` is new in this tick.
    pub plan_changed: bool,
}
