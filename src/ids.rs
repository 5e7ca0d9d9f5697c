//! Identities: what a client sees (`BodyId`), what the engine indexes by (`BodySlot`), and a pair's key.

/// A body as clients know it: unique in a scene, stays with its name for a boot, never 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct BodyId(pub u64);

/// A body's dense index inside the engine; reused after removal (see the body's generation).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct BodySlot(pub u32);

/// A pair's dense index inside `pairs::PairSet`; stable while the pair exists, then reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct PairSlot(pub u32);

/// A source's dense index in the scene's list of sources.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct SourceSlot(pub u32);

/// An index, or a length, as the 32 bits it is stored in: see `limits` for how few there are of anything.
#[inline]
pub(crate) fn small(index: usize) -> u32 {
    debug_assert!(u32::try_from(index).is_ok());
    u32::try_from(index).unwrap_or(u32::MAX)
}

impl BodySlot {
    /// Of an index.
    pub(crate) fn at(index: usize) -> Self {
        Self(small(index))
    }

    /// As an index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl PairSlot {
    /// As an index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl SourceSlot {
    /// Of an index.
    pub(crate) fn at(index: usize) -> Self {
        Self(small(index))
    }

    /// As an index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Two body slots, the lower first: one `u64`, so that sorting and comparing is one instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct PairKey(u64);

impl PairKey {
    /// Of no pair: greater than any other.
    pub(crate) const NOBODY: Self = Self(u64::MAX);

    /// The key of two different bodies, in either order.
    #[must_use]
    pub fn new(one: BodySlot, other: BodySlot) -> Self {
        debug_assert_ne!(one, other, "a body is never paired with itself");
        let (low, high) = if one < other {
            (one, other)
        } else {
            (other, one)
        };
        Self(u64::from(low.0) << 32 | u64::from(high.0))
    }

    /// As one number.
    #[must_use]
    pub(crate) fn bits(self) -> u64 {
        self.0
    }

    /// The two slots, the lower first.
    #[must_use]
    pub fn slots(self) -> (BodySlot, BodySlot) {
        #[allow(
            clippy::cast_possible_truncation,
            reason = "the two halves are taken apart"
        )]
        let (low, high) = ((self.0 >> 32) as u32, self.0 as u32);
        (BodySlot(low), BodySlot(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_key_is_the_same_in_either_order() {
        let key = PairKey::new(BodySlot(9), BodySlot(4));
        assert_eq!(key, PairKey::new(BodySlot(4), BodySlot(9)));
        assert_eq!(key.slots(), (BodySlot(4), BodySlot(9)));
    }
}
