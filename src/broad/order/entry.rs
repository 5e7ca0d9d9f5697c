//! An entry of the list of candidates.

use crate::limits::BODIES_MAX;

/// A candidate in one word: whether the boxes overlapped at the last look, the two ranks, the lower first, and the ages
/// of the two lanes when it was listed, one byte each: if an age differs the entry is dead. Its record is looked up
/// only when something changes: in a long list every byte counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry(u64);

/// Bits of a rank: enough for `limits::BODIES_MAX` bodies and the free lanes among them.
const RANK_BITS: u32 = 23;
const AGES_BITS: u32 = 16;
/// The bit that says whether the boxes overlapped.
const HIT: u64 = 1 << (2 * RANK_BITS + AGES_BITS);
const _: () = assert!(
    2 * BODIES_MAX <= 1 << RANK_BITS,
    "an eighth of the lanes are free after a sort, and a class of sizes begins with a block of its own"
);

impl Entry {
    #[inline(always)]
    pub(super) fn new([first, second]: [u32; 2], ages: u16, hit: bool) -> Self {
        debug_assert!(first.max(second) < 1 << RANK_BITS);
        let ranks = u64::from(first) << RANK_BITS | u64::from(second);
        let hit = if hit { HIT } else { 0 };
        Self(hit | ranks << AGES_BITS | u64::from(ages))
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "masked")]
    pub(super) fn ranks(self) -> [u32; 2] {
        let mask = (1 << RANK_BITS) - 1;
        let both = self.0 >> AGES_BITS;
        [(both >> RANK_BITS & mask) as u32, (both & mask) as u32]
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the lowest bits")]
    pub(super) fn ages(self) -> u16 {
        self.0 as u16
    }

    #[inline(always)]
    pub(super) fn is_hit(self) -> bool {
        self.0 & HIT != 0
    }

    pub(super) fn set_hit(&mut self, hit: bool) {
        self.0 = (self.0 & !HIT) | if hit { HIT } else { 0 };
    }
}

/// Two ages as stored in an [`Entry`].
#[inline(always)]
pub(super) fn ages(first: u8, second: u8) -> u16 {
    u16::from(first) | u16::from(second) << 8
}
