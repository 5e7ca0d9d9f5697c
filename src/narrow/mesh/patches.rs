//! The contact points of a mesh pair as they are found: of each patch the deepest and the outermost.
//!
//! In: points of leaves, in any order and number. Out: a bounded number of them with the same span. A patch consists of
//! points on one smooth region with normals within 8 degrees of its first; once all are found, `narrow/contacts`
//! decides which of its points make the manifold.
//!
//! Refused: the deepest points alone (on a floor of many small triangles these lie close together, and a body tips over
//! them); clusters by distance (their centres are not where the rim is).

use super::contacts::LeafContact;
use crate::math::Vec3;
use crate::narrow::arena::{Arena, Run};
use crate::narrow::contacts::SAME_NORMAL;

/// Most patches of one shape pair; beyond that, those with the nearest normals are merged.
pub const PATCHES_MAX: usize = 16;
/// Directions in a patch's plane in each of which the outermost point is kept: a polygon with angles above 135 degrees
/// can lose a corner, at most 8 % of its width.
const DIRECTIONS: usize = 8;
/// Points of a patch: its first, its deepest, its outermost. Some may be the same.
pub const PATCH_POINTS: usize = DIRECTIONS + 2;

/// The points of one pair found so far.
#[derive(Debug, Default)]
pub(super) struct Patches {
    kept: Run,
}

impl Patches {
    /// Their block.
    pub(super) fn run(&self) -> &Run {
        &self.kept
    }

    pub(super) fn clear(&mut self) {
        self.kept.clear();
    }

    /// [`PATCH_POINTS`] of each patch, one patch behind the other.
    pub(super) fn all<'a>(&self, arena: &'a Arena<LeafContact>) -> &'a [LeafContact] {
        let all = arena.all(&self.kept);
        &all[..all.len() / PATCH_POINTS * PATCH_POINTS]
    }

    /// Adds a point to its patch.
    pub(super) fn add(&mut self, arena: &mut Arena<LeafContact>, point: &LeafContact) {
        let all = arena.all_mut(&self.kept);
        let spare = all.first().is_some_and(|p| p.patch == LeafContact::SPARE);
        if spare && point.patch != LeafContact::SPARE {
            // The first of its patch; the distances of the others are measured from it.
            all.fill(LeafContact {
                out_m: 0.0,
                ..*point
            });
            return;
        }
        if !all.is_empty() && !spare && point.patch == LeafContact::SPARE {
            return;
        }
        let goes = goes(all, spare, point.patch, &point.closest.normal);
        let full = all.len() / PATCH_POINTS >= PATCHES_MAX;
        if !full && !matches!(goes, Goes::Into(_)) && self.begin(arena, point) {
            return;
        }
        let all = arena.all_mut(&self.kept);
        if let Goes::Into(at) | Goes::Beside(at) = goes
            && let Some(patch) = all.chunks_exact_mut(PATCH_POINTS).nth(at)
        {
            update(patch, point);
        }
    }

    /// Whether a long walk to a point of this surface and normal is worthwhile: its patch has none as deep, and has
    /// room.
    pub(super) fn misses(
        &self,
        arena: &Arena<LeafContact>,
        (surface, normal): (u32, &Vec3),
        depth_m: f64,
    ) -> bool {
        let all = self.all(arena);
        match goes(all, false, surface, normal) {
            Goes::Into(at) => -depth_m < all[at * PATCH_POINTS + 1].closest.best_m,
            Goes::Beside(_) | Goes::First => all.len() / PATCH_POINTS < PATCHES_MAX,
        }
    }

    /// Begins a patch; false if there is no room.
    fn begin(&mut self, arena: &mut Arena<LeafContact>, point: &LeafContact) -> bool {
        let before = self.kept.len();
        for _ in 0..PATCH_POINTS {
            if !arena.push(
                &mut self.kept,
                LeafContact {
                    out_m: 0.0,
                    ..*point
                },
            ) {
                while self.kept.len() > before {
                    arena.pop(&mut self.kept);
                }
                return false;
            }
        }
        true
    }

    /// Releases its memory.
    pub(super) fn release(&mut self, arena: &mut Arena<LeafContact>) {
        arena.release(&mut self.kept);
    }
}

/// The patch a point belongs to.
#[derive(Clone, Copy, Debug)]
enum Goes {
    /// This patch.
    Into(usize),
    /// A new patch; if there is no room for one, this patch, which has the nearest normal.
    Beside(usize),
    /// The first patch.
    First,
}

/// The patch for a point with this surface and normal.
fn goes(all: &[LeafContact], spare: bool, surface: u32, normal: &Vec3) -> Goes {
    let (mut nearest, mut best) = (Goes::First, f64::NEG_INFINITY);
    for (at, patch) in all.chunks_exact(PATCH_POINTS).enumerate() {
        let turn = patch[0].closest.normal.dot(normal);
        if spare || (patch[0].patch == surface && turn >= SAME_NORMAL) {
            return Goes::Into(at);
        }
        if turn > best {
            (nearest, best) = (Goes::Beside(at), turn);
        }
    }
    nearest
}

/// Points with the number of their patch.
pub fn numbered(all: &[LeafContact]) -> impl Iterator<Item = (&LeafContact, u32)> {
    (0u32..)
        .zip(all.chunks(PATCH_POINTS))
        .flat_map(|(number, patch)| patch.iter().map(move |point| (point, number)))
}

/// Stores a point wherever it is deeper or lies farther out than the stored one.
fn update(patch: &mut [LeafContact], point: &LeafContact) {
    let [first, deepest, outermost @ ..] = patch else {
        return;
    };
    if point.closest.best_m < deepest.closest.best_m {
        *deepest = *point;
    }
    let away = point.closest.point_a - first.closest.point_a;
    let [x, y] = across(&first.closest.normal).map(|along| along.dot(&away));
    let (ahead, behind) = outermost.split_at_mut(DIRECTIONS / 2);
    for (k, (cos, sin)) in TURNS.into_iter().enumerate() {
        let out_m = x * cos + y * sin;
        for (kept, out_m) in [(&mut ahead[k], out_m), (&mut behind[k], -out_m)] {
            if out_m > kept.out_m {
                *kept = LeafContact { out_m, ..*point };
            }
        }
    }
}

/// Cosine and sine of half of the directions, evenly spread and along no axis of the frame: two corners of an
/// axis-aligned model are never equally far out. The other half are their opposites.
const TURNS: [(f64, f64); DIRECTIONS / 2] = [
    (0.972, 0.233),
    (0.522, 0.853),
    (-0.233, 0.972),
    (-0.853, 0.522),
];

/// Two directions orthogonal to a unit normal and to each other.
fn across(normal: &Vec3) -> [Vec3; 2] {
    let mut least = Vec3::zeros();
    least[normal.iamin()] = 1.0;
    let x = normal.cross(&least).normalize();
    [x, normal.cross(&x)]
}
