//! How long a wait looks before it sleeps. In: whether the last looks found something. Out: nanoseconds to look.

/// Waits without a look after looks that found nothing: 1, 2, 4, up to this many. At a frame a millisecond a look that
/// never finds anything then costs a thousandth of a core.
const SKIPS_MAX: u32 = 64;

/// A look before each sleep, and fewer and fewer of them while they find nothing.
///
/// A look is worth its time where the other side answers within it on another core. Where both sides share a core, it
/// only keeps the other from its work: measured on two busy cores, looking each time made one wait in ten 165 us long
/// instead of 13.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    look_ns: u64,
    skips: u32,
    skips_left: u32,
}

impl Patience {
    /// Looks of `look_ns`; `u64::MAX`: the wait never sleeps.
    pub(super) fn new(look_ns: u64) -> Self {
        Self {
            look_ns,
            skips: 0,
            skips_left: 0,
        }
    }

    /// How long the wait that begins may look, nanoseconds.
    pub(super) fn begin(&mut self) -> u64 {
        if self.skips_left > 0 {
            self.skips_left -= 1;
            return 0;
        }
        self.look_ns
    }

    /// The look found something.
    pub(super) fn found(&mut self) {
        self.skips = 0;
    }

    /// The look found nothing, the thread goes to sleep.
    pub(super) fn missed(&mut self) {
        self.skips = (2 * self.skips).clamp(1, SKIPS_MAX);
        self.skips_left = self.skips;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of the next 300 waits look, where none finds anything.
    fn looks(patience: &mut Patience) -> Vec<u32> {
        let look = |_: &u32| {
            let looked = patience.begin() > 0;
            if looked {
                patience.missed();
            }
            looked
        };
        (0..300).filter(look).collect()
    }

    #[test]
    fn looks_that_find_nothing_become_rare_and_one_find_brings_them_back() {
        let mut patience = Patience::new(50_000);
        let rare = [0, 2, 5, 10, 19, 36, 69, 134, 199, 264];
        assert_eq!(looks(&mut patience), rare);
        while patience.begin() == 0 {}
        patience.found();
        assert_eq!(looks(&mut patience), rare);
    }

    #[test]
    fn a_look_of_no_time_is_none() {
        assert!(looks(&mut Patience::new(0)).is_empty());
    }
}
