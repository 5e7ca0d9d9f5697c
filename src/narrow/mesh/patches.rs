//! The contact points of a mesh pair as they come in: of each patch the deepest and the outermost.
//!
//! In: points of leaves, in any order and of any number. Out: a bounded number of them that spans what all of them
//! span. A patch is made of points on one smooth region with normals within 8 degrees of its first; which of its points
//! make the manifold is decided when all are there (`narrow/contacts`).
//!
//! Refused: the deepest points alone (of a floor of many small triangles these lie side by side, and a body tips over
//! them); clusters by distance (their middles are not where the rim is).

use super::contacts::LeafContact;
use crate::math::Vec3;
use crate::narrow::arena::{Arena, Run};
use crate::narrow::contacts::SAME_NORMAL;

/// Patches of one shape pair; of more, those with normals nearest to one another are taken together.
pub const PATCHES_MAX: usize = 16;
/// Directions in a patch's plane in each of which the outermost point is kept: a polygon with angles of more than 135
/// degrees can lose a corner, at most 8 % of its width.
const DIRECTIONS: usize = 8;
/// Points of a patch: its first, its deepest, its outermost. Some may be the same.
pub const PATCH_POINTS: usize = DIRECTIONS + 2;

/// The points of one pair met so far.
#[derive(Debug, Default)]
pub(super) struct Patches {
    kept: Run,
}

impl Patches {
    /// The block that they are in.
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

    /// Takes a point into its patch.
    pub(super) fn add(&mut self, arena: &mut Arena<LeafContact>, point: &LeafContact) {
        let all = arena.all_mut(&self.kept);
        let spare = all.first().is_some_and(|p| p.patch == LeafContact::SPARE);
        if spare && point.patch != LeafContact::SPARE {
            // The first of its patch, from which the others lie so far out.
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

    /// Whether it is worth a long walk to a point of this surface and normal: its patch has none as deep, and there is
    /// room for that patch.
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

    /// Begins a patch; false where there is no room.
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

    /// Gives its memory back.
    pub(super) fn release(&mut self, arena: &mut Arena<LeafContact>) {
        arena.release(&mut self.kept);
    }
}

/// Where a point belongs.
#[derive(Clone, Copy, Debug)]
enum Goes {
    /// Into this patch.
    Into(usize),
    /// Into one of its own; where there is no room for that, into this one, which has the nearest normal.
    Beside(usize),
    /// Into the first.
    First,
}

/// Where a point of a surface and with a normal belongs among all.
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

/// Puts a point where it is deeper or lies farther out than what is there.
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

/// Cosine and sine of half of the directions, evenly spread and along no axis of the frame: two corners of what is
/// drawn along the axes are never equally far out. The other half is opposite.
const TURNS: [(f64, f64); DIRECTIONS / 2] = [
    (0.972, 0.233),
    (0.522, 0.853),
    (-0.233, 0.972),
    (-0.853, 0.522),
];

/// Two directions at right angles to a unit normal and to one another.
fn across(normal: &Vec3) -> [Vec3; 2] {
    let mut least = Vec3::zeros();
    least[normal.iamin()] = 1.0;
    let x = normal.cross(&least).normalize();
    [x, normal.cross(&x)]
}
