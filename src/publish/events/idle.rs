//! Memory of histories whose pairs are no more.

use super::Events;
use crate::pairs::Spare;

impl Events {
    /// Gives the memory of slots back that pairs have left, when they have been many for long. To be asked once the
    /// pairs that ended were taken.
    ///
    /// * `slots` - those that the pair set has.
    pub(in crate::publish) fn give_back_slots(&mut self, slots: usize) {
        if self.spare.is_over(self.histories.len(), slots) {
            Spare::cut(&mut self.histories, slots);
        }
    }
}
