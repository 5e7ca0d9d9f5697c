//! The tick behind `/diagnostics`. In: parcels. Out: a tick row with the counts of a completed tick.

use super::super::parcel::Parcel;
use crate::wire::TickRow;

/// The newest completed tick, and the state published during the next one.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Latest {
    /// Tick 0: none yet.
    ended: TickRow,
    /// State and reasons of the tick in progress.
    under_way: Option<(u8, u32)>,
    /// Whether it was completed since the last call.
    is_new: bool,
}

impl Latest {
    /// Records a tick that is published.
    pub(super) fn take(&mut self, parcel: &Parcel) {
        let tick = &parcel.tick;
        if parcel.done {
            (self.ended, self.under_way, self.is_new) = (*tick, None, true);
        } else {
            self.under_way = Some((tick.header.state, tick.reasons));
        }
    }

    /// Whether any tick has been completed.
    pub(super) fn is_there(&self) -> bool {
        self.ended.header.tick > 0
    }

    /// The newest completed tick; with the state of the tick in progress if none was completed since the last call.
    ///
    /// A tick in progress has no counts and no sources. Compared with these, all counts of the next tick would seem
    /// new, and every source active.
    pub(super) fn row(&mut self) -> TickRow {
        let mut row = self.ended;
        if !std::mem::take(&mut self.is_new)
            && let Some((state, reasons)) = self.under_way
        {
            (row.header.state, row.reasons) = (state, reasons);
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::memory::trial::under_way;
    use crate::transport::ros2::diagnose::Diagnoser;
    use crate::wire::ros::diagnostic_level::{ERROR, OK};
    use crate::wire::ros::{Counts, Time};

    #[test]
    fn bug_a_tick_that_was_under_way_made_what_was_missed_and_refused_hours_ago_news() {
        let mut parcel = Parcel::default();
        parcel.tick.header.tick = 3;
        (parcel.tick.missed, parcel.tick.rejects[0]) = (7, 9);
        parcel.tick.sources_len = 1;
        parcel.done = true;
        let beat = Parcel {
            tick: under_way(4),
            ..Parcel::default()
        };
        let (mut latest, counts) = (Latest::default(), Counts::default());
        assert!(!latest.is_there());
        latest.take(&parcel);
        let mut diagnoser = Diagnoser::since(&latest.row(), counts);
        let mut levels = |latest: &mut Latest| {
            let row = latest.row();
            let all = diagnoser.diagnose(Time::default(), "sweepd", &row, counts, &[]);
            let levels: Vec<u8> = all.status.iter().map(|status| status.level).collect();
            levels
        };
        // The source has not sent yet.
        latest.take(&parcel);
        latest.take(&beat);
        assert_eq!(levels(&mut latest), [OK, OK, ERROR, OK]);
        // No tick was completed for a second: the state is that of the tick in progress.
        assert_eq!(levels(&mut latest), [ERROR, OK, ERROR, OK]);
        latest.take(&parcel);
        assert_eq!(levels(&mut latest), [OK, OK, ERROR, OK]);
    }
}
