//! When memory that a crowd of pairs took is given back.
//!
//! In: how much there is room for, and how much is in use. Out: whether the rest goes. Pairs come and go by turns, and
//! what is given back and taken again in each turn costs more than to keep it: so only what was far too much for very
//! many ticks goes, and nothing where little can be spared. Counted, so that a replay does alike.

/// Room for fewer is kept: some MiB where most is known of a pair.
const LEAST: usize = 1 << 14;
/// There is room for so many times what is in use.
const TIMES: usize = 4;
/// In so many ticks, one after the other: some ten seconds.
const TICKS: u32 = 1 << 10;

/// How long there has been far too much room.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spare {
    ticks: u32,
}

impl Spare {
    /// Whether room that is not in use is to be given back; to be asked once in each tick.
    ///
    /// * `room`, `used` - in entries.
    pub(crate) fn is_over(&mut self, room: usize, used: usize) -> bool {
        let is_idle = room > LEAST && room / TIMES > used;
        self.ticks = if is_idle { self.ticks + 1 } else { 0 };
        let is_over = self.ticks >= TICKS;
        if is_over {
            self.ticks = 0;
        }
        is_over
    }

    /// Cuts a list that runs parallel to what is in use, and gives back the memory of more than half as much again.
    pub(crate) fn cut<T>(list: &mut Vec<T>, used: usize) {
        list.truncate(used);
        list.shrink_to(used + used / 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_given_back_once_far_too_much_was_kept_for_long_and_not_while_it_comes_and_goes() {
        let mut spare = Spare::default();
        for tick in 0..5 * TICKS {
            let used = if tick % (TICKS / 2) == 0 { LEAST } else { 10 };
            assert!(!spare.is_over(2 * LEAST, used));
            assert!(!Spare::default().is_over(LEAST, 0));
        }
        let over = (0..3 * TICKS)
            .filter(|_| spare.is_over(2 * LEAST, 10))
            .count();
        assert!((2..4).contains(&over), "{over}");
    }
}
