//! Memory of histories whose pairs are gone.

use super::Events;
use crate::pairs::Spare;

impl Events {
    /// Gives back the memory of slots that pairs have left, when they have been many for long. Must be called after the
    /// ended pairs were taken.
    ///
    /// * `slots` - slots of the pair set.
    pub(in crate::publish) fn give_back_slots(&mut self, slots: usize) {
        if self.spare.is_over(self.histories.len(), slots) {
            Spare::cut(&mut self.histories, slots);
        }
    }
}
