//! Which rows of the list are sent if not all fit, and where they were in the message of the last tick.
//!
//! Refused: sorting all rows for it, and making all of them again. With some hundred thousand rows that took longer
//! than everything else in the tick.

use super::Publisher;
use super::listing::Mark;

/// Sort key by which rows are chosen, the least first; the last part is its index, which is by ids.
pub(super) type Rank = (u64, u8, i64, u32);

/// Positions of the rows of the list in a message.
#[derive(Debug, Default)]
pub(super) enum Stood {
    /// There was no message.
    #[default]
    Nowhere,
    /// All were sent, so they were placed as in the list.
    Listed,
    /// By index in the list: the position in the message, or [`LEFT_OUT`].
    Chosen(Vec<u32>),
}

/// The row was not sent.
const LEFT_OUT: u32 = u32::MAX;

impl Stood {
    /// Old position of the row of a mark, if it is sent unchanged.
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
    /// Chooses what is sent if not all fit: events that waited first, then by rank; returns how many are left out.
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

    /// Records the positions of the rows just sent, in order.
    ///
    /// * `cut` - whether only the chosen ones were sent.
    pub(super) fn note_places(&mut self, cut: bool) {
        if !cut {
            // The memory is kept only as long as rows do not fit; a list that fits does not use it.
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
