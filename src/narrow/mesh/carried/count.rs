//! What a front covers, leaf by leaf: a check of its invariant.

use super::{CarriedFront, FrontStore, Side};
use crate::narrow::cover::lanes;
use crate::shape::{BoxId, Held, Shape};

impl CarriedFront {
    /// Every pair of leaves (triangles; 0 for a convex shape) that an entry covers, sorted: each pair of the two
    /// exactly once, at any time. `None` if some were lumped together because there was no room.
    #[must_use]
    pub fn covered(&self, store: &FrontStore, a: &Shape, b: &Shape) -> Option<Vec<(u32, u32)>> {
        let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
        let mut all = Vec::new();
        let whole = self.cover.visit_all(&store.entries, |of_a, of_b| {
            let (leaves_a, leaves_b) = (leaves(side_a, of_a), leaves(side_b, of_b));
            for &i in &leaves_a {
                all.extend(leaves_b.iter().map(|&j| (i, j)));
            }
        });
        all.sort_unstable();
        whole.then_some(all)
    }
}

/// The leaves under a box.
fn leaves(side: Side<'_>, id: BoxId) -> Vec<u32> {
    let (mut stack, mut all) = (vec![id], Vec::new());
    while let Some(id) = stack.pop() {
        match side.held(id) {
            Held::Triangle(face) => all.push(face),
            Held::Pack(pack) => {
                let mask = side.pack(pack).map_or(0, |p| p.mask);
                stack.extend(lanes(mask).map(|lane| BoxId::new(pack, lane)));
            }
        }
    }
    all
}
