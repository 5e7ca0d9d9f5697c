//! Encloses many spots in few spheres.
//!
//! In: spots, at most [`SPOTS_MAX`]. Out: the spots in at most [`REGIONS_MAX`] groups, each with a sphere. The largest
//! group is split in two until there are enough: each spot joins the nearer of two spots far from each other.
//!
//! Refused: greedy merging by least growth (quadratic in the spots, and no smaller spheres).

use crate::limits::REGIONS_PER_PAIR_MAX as REGIONS_MAX;
use crate::math::{Point, Vec3, morton_bits};

use super::spot::Spot;

/// Most spots of one pair that are kept separate; beyond that, neighbours are merged.
pub(super) const SPOTS_MAX: usize = 512;
/// Steps towards the farthest spot when a sphere is fitted: with none it is some 10 % larger than the smallest
/// possible, with three some 5 %.
const STEPS: u32 = 3;
/// The largest spots are cut until there are this many.
const CUT_UNTIL: usize = 4 * REGIONS_MAX;

/// A group of spots: a range of them, and a sphere around all.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) centre: Point,
    pub(super) radius_m: f64,
}

/// Adds a spot; when there is no room, neighbours are merged first.
pub(super) fn push(all: &mut Vec<Spot>, spot: Spot) {
    if all.len() >= SPOTS_MAX {
        condense(all);
    }
    all.push(spot);
}

/// Merges neighbours along a space-filling curve, those pairs first that stay small.
fn condense(all: &mut Vec<Spot>) {
    let (low, high) = corners(all);
    let size = (high - low).map(|side| side.max(f64::MIN_POSITIVE));
    all.sort_unstable_by_key(|spot| {
        let share = (spot.centre - low).component_div(&size);
        share.iter().fold(0_u32, |key, x| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 1023"
            )]
            let cell = (x * 1023.0).clamp(0.0, 1023.0) as u32;
            key << 1 | morton_bits(cell)
        })
    });
    let together = |x: &Spot, y: &Spot| {
        let apart = (y.centre - x.centre).norm();
        (0.5 * (apart + x.radius_m + y.radius_m)).max(x.radius_m.max(y.radius_m))
    };
    // Those below the mean; if there are hardly any, every second one.
    let sum: f64 = all.windows(2).map(|two| together(&two[0], &two[1])).sum();
    #[allow(clippy::cast_precision_loss, reason = "a few hundred")]
    let mean = sum / all.len() as f64;
    for limit_m in [mean, f64::INFINITY] {
        if all.len() <= SPOTS_MAX * 7 / 8 {
            return;
        }
        let (mut from, mut to) = (0, 0);
        while from < all.len() {
            let next = all.get(from + 1);
            let near = next.filter(|next| together(&all[from], next) <= limit_m);
            (all[to], from) = match near {
                Some(next) => (all[from].with(next), from + 2),
                None => (all[from], from + 1),
            };
            to += 1;
        }
        all.truncate(to);
    }
}

/// Cuts the largest spots while there are few.
pub(super) fn cut(all: &mut Vec<Spot>) {
    while all.len() < CUT_UNTIL {
        let largest = (0..all.len()).max_by(|&i, &j| all[i].radius_m.total_cmp(&all[j].radius_m));
        let Some(at) = largest else { return };
        let Some([one, other]) = all[at].halves() else {
            return;
        };
        all[at] = one;
        all.push(other);
    }
}

/// Splits the spots into groups, which are ranges of `all` afterwards.
pub(super) fn gather(all: &mut [Spot], balls: &mut Vec<Ball>) {
    balls.clear();
    if all.is_empty() {
        return;
    }
    balls.push(ball(all, 0, all.len()));
    while balls.len() < REGIONS_MAX {
        let many = (0..balls.len()).filter(|&i| balls[i].to - balls[i].from > 1);
        let largest = many.max_by(|&i, &j| balls[i].radius_m.total_cmp(&balls[j].radius_m));
        let Some(at) = largest else { return };
        let Ball { from, to, .. } = balls[at];
        let middle = from + part(&mut all[from..to], &balls[at].centre);
        if middle == from || middle == to {
            return;
        }
        balls[at] = ball(all, from, middle);
        balls.push(ball(all, middle, to));
    }
}

/// Moves the spots nearer to A than to B, two spots far apart, to the front; returns how many.
fn part(spots: &mut [Spot], centre: &Point) -> usize {
    let (_, one) = farthest(spots, centre);
    let (_, other) = farthest(spots, &one);
    let way = other - one;
    let middle = nalgebra::center(&one, &other);
    // The side of its centre decides, for large and small spots alike.
    let mut count = 0;
    for k in 0..spots.len() {
        if way.dot(&(spots[k].centre - middle)) < 0.0 {
            spots.swap(k, count);
            count += 1;
        }
    }
    count
}

/// The spot that reaches farthest from a point, and that distance.
fn farthest(spots: &[Spot], from: &Point) -> (f64, Point) {
    let (mut most, mut at) = (f64::NEG_INFINITY, spots[0].centre);
    for spot in spots {
        let reach = (spot.centre - from).norm() + spot.radius_m;
        if reach > most {
            (most, at) = (reach, spot.centre);
        }
    }
    (most, at)
}

/// Corners of the box around all spots.
fn corners(spots: &[Spot]) -> (Point, Point) {
    let (mut low, mut high) = (spots[0].centre, spots[0].centre);
    for spot in spots {
        let side = Vec3::repeat(spot.radius_m);
        low = low.inf(&(spot.centre - side));
        high = high.sup(&(spot.centre + side));
    }
    (low, high)
}

/// A sphere around all spots of a range.
///
/// Source: Badoiu, Clarkson 2003, Smaller core-sets for balls: steps towards the farthest, each shorter than the last.
fn ball(all: &[Spot], from: usize, to: usize) -> Ball {
    let spots = &all[from..to];
    // A single spot, or an infinite one, is its own sphere.
    let whole = spots
        .iter()
        .find(|s| spots.len() == 1 || s.radius_m.is_infinite());
    if let Some(spot) = whole {
        return Ball {
            from,
            to,
            centre: spot.centre,
            radius_m: spot.radius_m,
        };
    }
    // Starts at the centre of the box around all of them.
    let (low, high) = corners(spots);
    let mut centre = nalgebra::center(&low, &high);
    let mut best = (f64::INFINITY, centre);
    for step in 0..=STEPS {
        let (reach_m, at) = farthest(spots, &centre);
        if reach_m < best.0 {
            best = (reach_m, centre);
        }
        let way = at - centre;
        let length = way.norm();
        if length <= f64::MIN_POSITIVE {
            break;
        }
        centre += way * (reach_m / (f64::from(2 * step + 4) * length)).min(1.0);
    }
    Ball {
        from,
        to,
        centre: best.1,
        radius_m: best.0,
    }
}
