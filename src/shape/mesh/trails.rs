//! A cache of where walks over a surface have led: a walk that meets an earlier one continues from the end of that.
//!
//! Leaves that cross are next to each other along a curve, and from each of them a walk leads over much the same faces
//! to much the same place. The result of a walk is still decided by its own last steps.

use crate::math::Vec3;

/// Number of entries, as a power of two: about the vertices near the curve along which two bodies of 20,000 triangles
/// cross. Twice as many save some more steps, and cost as much to load from memory.
const TRAILS_LOG: u32 = 9;
/// Directions this close (cosine of 37 degrees) lead the same way for most of it: correcting the end costs less than
/// the whole way.
const SAME_WAY: f64 = 0.8;

/// The ends of walks, by the vertices that they passed or began from; of those that share a slot, the last one.
///
/// Takes no memory before the first walk: most pairs have no meshes.
#[derive(Debug, Default)]
pub(crate) struct Trails<End> {
    entries: Vec<Entry<End>>,
    search: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Entry<End> {
    vertex: u32,
    /// The search it belongs to.
    search: u32,
    /// Zero in an unused entry: no direction is near it.
    direction: [f32; 3],
    end: End,
}

impl<End: Copy + Default> Trails<End> {
    /// Forgets all: another search begins, maybe over another surface.
    pub(crate) fn clear(&mut self) {
        self.search = self.search.checked_add(1).unwrap_or_else(|| {
            self.entries.fill(Entry::default());
            0
        });
    }

    /// Where the last walk that passed a vertex led, if its direction was much the same, and the cosine between the
    /// two.
    #[inline]
    pub(crate) fn find(&self, vertex: u32, direction: &Vec3) -> Option<(End, f64)> {
        let entry = self.entries.get(place(vertex))?;
        if entry.vertex != vertex || entry.search != self.search {
            return None;
        }
        let [x, y, z] = entry.direction.map(f64::from);
        let cos = direction.dot(&Vec3::new(x, y, z));
        (cos >= SAME_WAY).then_some((entry.end, cos))
    }

    #[inline]
    pub(crate) fn note(&mut self, vertex: u32, direction: &Vec3, end: End) {
        if self.entries.is_empty() {
            self.entries.resize(1 << TRAILS_LOG, Entry::default());
        }
        self.entries[place(vertex)] = Entry {
            vertex,
            search: self.search,
            direction: rounded(direction),
            end,
        };
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "directions are compared, and no closer than by degrees"
)]
fn rounded(direction: &Vec3) -> [f32; 3] {
    [direction.x, direction.y, direction.z].map(|x| x as f32)
}

/// Slot of the entry of a vertex: neighbours often have successive numbers.
fn place(vertex: u32) -> usize {
    (vertex & ((1 << TRAILS_LOG) - 1)) as usize
}
