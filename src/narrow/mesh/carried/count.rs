//! What a front covers, leaf by leaf: the check of its invariant.

use super::cover::lanes;
use super::{CarriedFront, FrontStore, Side};
use crate::shape::{BoxId, Held, Shape};

impl CarriedFront {
    /// Every pair of leaves (triangles; 0 for a convex shape) that an entry covers, sorted: each pair of the two once
    /// and only once, whatever was done before. `None` where some were lumped together for want of room.
    #[must_use]
    pub fn covered(&self, store: &FrontStore, a: &Shape, b: &Shape) -> Option<Vec<(u32, u32)>> {
        let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
        if self.lumped_expiry_m < f64::INFINITY {
            return None;
        }
        let mut all = Vec::new();
        let mut add = |(of_a, of_b): (BoxId, BoxId)| {
            let (leaves_a, leaves_b) = (leaves(side_a, of_a), leaves(side_b, of_b));
            for &i in &leaves_a {
                all.extend(leaves_b.iter().map(|&j| (i, j)));
            }
        };
        let groups = [&self.proved.heap, &self.passing].map(|run| store.groups.all(run));
        for group in groups.into_iter().flatten() {
            lanes(group.mask).for_each(|lane| add(group.pair(lane)));
        }
        let pairs = [self.open.all(&store.open), store.open.all(&self.touching)];
        for open in pairs.into_iter().flatten() {
            add((open.a, open.b));
        }
        all.sort_unstable();
        Some(all)
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
