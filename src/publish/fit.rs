//! Which rows of the list are sent where not all fit, and where they stood in the message of the tick before.
//!
//! Refused: to sort all rows for it, and to make all of them anew. Of some hundred thousand that took longer than all
//! else in the tick.

use super::Publisher;
use super::listing::Mark;

/// By what a row is chosen, the least first; at last its place, which is by ids.
pub(super) type Rank = (u64, u8, i64, u32);

/// Places of the rows of the list in a message.
#[derive(Debug, Default)]
pub(super) enum Stood {
    /// There was no message.
    #[default]
    Nowhere,
    /// All were sent, so they stood as in the list.
    Listed,
    /// By place in the list: the place in the message, or [`LEFT_OUT`].
    Chosen(Vec<u32>),
}

/// The row was not sent.
const LEFT_OUT: u32 = u32::MAX;

impl Stood {
    /// Where the row of a mark stood, if it is to be sent as it was.
    pub(super) fn place(&self, mark: &Mark) -> Option<u32> {
        if mark.fresh {
            return None;
        }
        match self {
            Self::Nowhere => None,
            Self::Listed => Some(mark.was),
            Self::Chosen(places) => {
                let place = places.get(mark.was as usize).copied();
                place.filter(|place| *place != LEFT_OUT)
            }
        }
    }
}

impl Publisher {
    /// Chooses what is sent where not all fit, events that waited and then the best rank first; returns how many are
    /// left out.
    pub(super) fn choose_rows(&mut self) -> u64 {
        let (most, listing, ranked) = (self.limits.pair_rows, &self.listing, &mut self.ranked);
        let left_out = listing.len().saturating_sub(most);
        if left_out > 0 {
            ranked.clear();
            let rows = (0..).zip(listing.iter());
            ranked.extend(rows.map(|(at, row)| {
                let (class, gap) = row.rank();
                (self.events.turn(row.event), class, gap, at)
            }));
            ranked.select_nth_unstable(most);
            self.chosen.clear();
            self.chosen.resize(listing.len(), false);
            for (.., at) in &ranked[..most] {
                self.chosen[*at as usize] = true;
            }
        }
        left_out as u64
    }

    /// Notes where the rows of the list stand that were just sent, in order.
    ///
    /// * `cut` - whether they are the chosen ones, and not all.
    pub(super) fn note_places(&mut self, cut: bool) {
        if !cut {
            // The memory is kept for as long as rows do not fit; a list that fits has no use for it.
            self.stood = Stood::Listed;
            return;
        }
        let mut places = match std::mem::take(&mut self.stood) {
            Stood::Chosen(places) => places,
            Stood::Nowhere | Stood::Listed => Vec::new(),
        };
        places.clear();
        let mut next = 0;
        places.extend(self.chosen.iter().map(|chosen| {
            let place = if *chosen { next } else { LEFT_OUT };
            next += u32::from(*chosen);
            place
        }));
        self.stood = Stood::Chosen(places);
    }
}
