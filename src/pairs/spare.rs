//! When to give back memory that a crowd of pairs took.
//!
//! In: how much room there is, and how much is in use. Out: whether the rest is freed. Pairs come and go in waves, and
//! freeing and allocating in each wave costs more than keeping the memory: so it is freed only when it was far too much
//! for very many ticks, and never when little could be saved. Counted in ticks, so that a replay does the same.

/// Room for fewer entries is kept: at most some MiB.
const LEAST: usize = 1 << 14;
/// Room of more than this many times what is in use is too much.
const TIMES: usize = 4;
/// Number of consecutive ticks with too much room: some ten seconds.
const TICKS: u32 = 1 << 10;

/// For how long there has been too much room.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spare {
    ticks: u32,
}

impl Spare {
    /// Returns whether to free unused room; must be called once in each tick.
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

    /// Truncates a list that is parallel to what is in use, and frees memory beyond half as much again.
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
