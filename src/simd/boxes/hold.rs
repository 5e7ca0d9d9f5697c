//! What a box may do without any work, to reckon with and as it is kept.

use super::lanes::Down;

/// What a box may do without any work: it stays inside `fat` and goes on holding `core`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hold {
    /// Holds the box; its spare lanes are minus infinity.
    pub(crate) fat: Down,
    /// Is held by the box; infinite, also in its spare lanes: no box fails it.
    pub(crate) core: Down,
}

impl Hold {
    /// Of no box: nothing keeps to it.
    pub(crate) const EMPTY: Self = Self {
        fat: Down::EMPTY,
        core: Down::EMPTY,
    };

    /// Whether it is of no box.
    #[inline(always)]
    pub(crate) fn is_lost(&self) -> bool {
        self.fat.faces[0].is_nan()
    }
}

/// A hold as it is kept: without the spare lanes, which say nothing and would be a quarter of what is read of each
/// body.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Held {
    /// Of the fat box, then of the core: lower x, y, z, minus upper x, y, z.
    pub(super) faces: [f32; 12],
}

const _: () = assert!(size_of::<Held>() == 48);

impl Held {
    /// Of no box: nothing keeps to it.
    pub(crate) const EMPTY: Self = Self::of(&Hold::EMPTY);

    #[inline(always)]
    pub(crate) const fn of(hold: &Hold) -> Self {
        let [x, y, z, u, v, w] = hold.fat.six();
        let [r, s, t, l, m, n] = hold.core.six();
        Self {
            faces: [x, y, z, u, v, w, r, s, t, l, m, n],
        }
    }

    /// To reckon with.
    #[inline(always)]
    pub(crate) fn hold(&self) -> Hold {
        let [x, y, z, u, v, w, r, s, t, l, m, n] = self.faces;
        let (least, most) = (f32::NEG_INFINITY, f32::INFINITY);
        Hold {
            fat: Down {
                faces: [x, y, z, least, u, v, w, least],
            },
            core: Down {
                faces: [r, s, t, most, l, m, n, most],
            },
        }
    }
}
