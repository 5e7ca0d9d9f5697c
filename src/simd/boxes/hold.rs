//! The range in which a box may move without any work, in computing and in storage form.

use super::lanes::Down;

/// The range in which a box may move without any work: it stays inside `fat` and still contains `core`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hold {
    /// Contains the box; its spare lanes are minus infinity.
    pub(crate) fat: Down,
    /// Lies in the box; infinite, also in its spare lanes: no box fails it.
    pub(crate) core: Down,
}

impl Hold {
    /// The hold of no box: nothing keeps to it.
    pub(crate) const EMPTY: Self = Self {
        fat: Down::EMPTY,
        core: Down::EMPTY,
    };

    /// Whether it belongs to no box.
    #[inline(always)]
    pub(crate) fn is_lost(&self) -> bool {
        self.fat.faces[0].is_nan()
    }
}

/// A stored hold: without the spare lanes, which carry no information and would be a quarter of what is read per body.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Held {
    /// Of the fat box, then of the core: lower x, y, z, minus upper x, y, z.
    pub(super) faces: [f32; 12],
}

const _: () = assert!(size_of::<Held>() == 48);

impl Held {
    /// The hold of no box: nothing keeps to it.
    pub(crate) const EMPTY: Self = Self::of(&Hold::EMPTY);

    #[inline(always)]
    pub(crate) const fn of(hold: &Hold) -> Self {
        let [x, y, z, u, v, w] = hold.fat.six();
        let [r, s, t, l, m, n] = hold.core.six();
        Self {
            faces: [x, y, z, u, v, w, r, s, t, l, m, n],
        }
    }

    /// Converts to the computing form.
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
