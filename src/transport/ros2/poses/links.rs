//! Takes links of `/tf` into a source. In: messages. Out: the tree; faults of links and their senders, as text.

use super::super::tf::Taken;
use super::stamps::{both, crowded, dispute, forgotten, off, older, refused, rivalry};
use super::{Receipt, Source};
use crate::wire::ros::TfMessage;

impl Source {
    /// Takes the links of a message.
    ///
    /// * returns - whether the senders' time went back.
    pub(in super::super) fn take_links(
        &mut self,
        message: &TfMessage,
        fixed: bool,
        receipt: Receipt,
    ) -> bool {
        let mut back = false;
        for link in &message.transforms {
            let what = ("frame", link.child_frame_id.as_str());
            let stamp_ns = link.header.stamp.to_ns();
            let mixed = self.tree.is_otherwise(what.1, fixed).then(|| both(what));
            let disputed = fixed && self.tree.is_disputed(link, receipt.from);
            let taken = self.tree.take(link, fixed, receipt.now_ns, self.timeout_ns);
            let odd = match taken {
                Taken::Newer if !fixed => off(what, stamp_ns, receipt, self.timeout_ns),
                Taken::Older(by_ns) => Some(older(what, by_ns)),
                Taken::Full => Some(crowded(what)),
                Taken::Refused(why) => Some(refused(what, why)),
                Taken::Newer | Taken::WentBack => None,
            };
            let is_in = !matches!(taken, Taken::Refused(_) | Taken::Full);
            if fixed && is_in {
                self.tree.note_fixed(what.1, receipt.from);
            }
            // Publishers of fixed links are not compared: one that restarts sends its links again.
            let rivals = !fixed && is_in && self.tree.hear(what.1, receipt.from, receipt.now_ns);
            let odd = mixed.filter(|_| is_in).or(odd);
            let odd = if rivals {
                Some(rivalry(what))
            } else if disputed && is_in {
                Some(dispute(what))
            } else {
                odd
            };
            back |= taken == Taken::WentBack;
            self.refused += u64::from(!matches!(taken, Taken::Newer | Taken::WentBack));
            self.tell(odd, receipt);
        }
        let let_go = self.tree.take_let_go();
        self.tell((let_go > 0).then(|| forgotten(let_go)), receipt);
        if back {
            self.members
                .iter_mut()
                .for_each(|member| member.last = None);
        }
        back
    }
}
