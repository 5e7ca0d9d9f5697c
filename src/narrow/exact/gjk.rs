//! GJK: the distance of two cores that are apart, or the verdict that they overlap.
//!
//! In: a pair and a first direction. Out: the gap with witnesses, or the simplex around the origin.
//!
//! Source: Gilbert, Johnson, Keerthi 1988; directions orthogonal to the features as in Montanari, Petrinic, Barbieri
//! 2017, Improving the GJK algorithm.

use super::newton::{self, Refined};
use super::pair::{CoreGap, Held, Pair, Vertex, unit};
use super::simplex::Simplex;
use crate::math::Vec3;

/// Most steps of one run; polytopes of a few hundred vertices take under 20, curved cores that touch up to 60.
const STEPS_MAX: usize = 64;

/// The outcome of a run.
#[allow(
    clippy::large_enum_variant,
    reason = "lives on the stack for one query"
)]
pub(super) enum Outcome {
    /// The cores are apart.
    Apart(CoreGap),
    /// They overlap, or touch to the last bit; with what the simplex proves, which is not a depth.
    Overlap(Simplex, CoreGap),
}

/// State between steps, so that a run can be resumed with a tighter tolerance.
struct Gjk<'a> {
    pair: &'a Pair<'a>,
    simplex: Simplex,
    /// Next direction to query.
    dir: Vec3,
    point: Vec3,
    upper: f64,
    lower: f64,
    normal: Vec3,
}

enum Run {
    Overlap,
    /// Within the tolerance, or no further step helps.
    Ended,
}

/// The distance of two cores, or the verdict that they overlap.
///
/// * `held` - the features of an earlier answer with the normal `start`.
/// * `warm` - Newton's result from them, if any.
pub(super) fn distance(
    pair: &Pair<'_>,
    start: &Vec3,
    held: &Held,
    warm: Option<&Refined>,
) -> Outcome {
    let tiny = pair.tiny();
    if let Some(found) = warm.map(Refined::apart)
        && found.lower > 0.0
        && found.upper - found.lower <= 4.0 * tiny
    {
        return Outcome::Apart(found);
    }
    let mut gjk = Gjk {
        pair,
        simplex: Simplex::default(),
        dir: *start,
        point: Vec3::zeros(),
        upper: f64::INFINITY,
        lower: f64::NEG_INFINITY,
        normal: *start,
    };
    gjk.recall(held);
    if pair.polytopes {
        return match gjk.run(tiny / 2.0, None) {
            Run::Overlap => Outcome::Overlap(gjk.simplex, gjk.touch()),
            Run::Ended => gjk.decide(gjk.gap()),
        };
    }
    // Curved: roughly first, then Newton on the features found; if still loose, another round.
    let mut best: Option<CoreGap> = None;
    let mut hint = None;
    let size = pair.a.reach().min(pair.b.reach());
    for tolerance in [1e-2, 1e-4, 1e-7, 0.0] {
        if matches!(gjk.run((tolerance * size).max(tiny), hint), Run::Overlap) {
            return Outcome::Overlap(gjk.simplex, gjk.touch());
        }
        let found = gjk.gap();
        let found = match newton::refine(pair, &gjk.simplex, &gjk.normal) {
            Some(refined) => better(&found, &refined),
            None => found,
        };
        let gap = best.map_or(found, |old| better(&old, &found));
        best = Some(gap);
        if gap.upper - gap.lower <= 4.0 * tiny {
            break;
        }
        hint = (gap.lower > gjk.lower).then_some(gap.normal);
    }
    gjk.decide(best.unwrap_or_else(|| gjk.gap()))
}

/// The tighter of both for each end; witnesses follow the upper end, the normal the lower.
pub(super) fn better(one: &CoreGap, other: &CoreGap) -> CoreGap {
    let (low, high) = (
        if other.lower >= one.lower { other } else { one },
        if other.upper <= one.upper { other } else { one },
    );
    CoreGap {
        lower: low.lower,
        normal: low.normal,
        ..*high
    }
}

impl Gjk<'_> {
    /// If no direction separates, the polytope must decide: the simplex may have stalled around the origin.
    fn decide(&self, gap: CoreGap) -> Outcome {
        if gap.lower < -self.pair.tiny() {
            Outcome::Overlap(self.simplex, gap)
        } else {
            Outcome::Apart(gap)
        }
    }

    /// Begins with the simplex of an earlier answer, as long as that is closer to the origin than its first vertex.
    fn recall(&mut self, held: &Held) {
        let normal = self.dir;
        for vertex in self.pair.recall(held, &normal) {
            if self.simplex.used().iter().any(|v| v.w == vertex.w) {
                continue;
            }
            // Already around the origin: the run starts from scratch and will reach that verdict again.
            if matches!(self.add(vertex), Some(Run::Overlap)) {
                *self = Self {
                    simplex: Simplex::default(),
                    dir: normal,
                    upper: f64::INFINITY,
                    ..*self
                };
                return;
            }
        }
    }

    fn run(&mut self, tolerance: f64, hint: Option<Vec3>) -> Run {
        // Newton's result is queried first; it may add nothing.
        if let Some(hint) = hint {
            let asked = self.ask(&hint);
            if let Some(new) = asked
                && matches!(self.add(new), Some(Run::Overlap))
            {
                return Run::Overlap;
            }
        }
        for _ in 0..STEPS_MAX {
            let dir = self.dir;
            let asked = self.ask(&dir);
            if self.upper - self.lower <= tolerance {
                return Run::Ended;
            }
            let Some(new) = asked else {
                return Run::Ended;
            };
            if let Some(end) = self.add(new) {
                return end;
            }
        }
        Run::Ended
    }

    /// Queries one direction; `None` if the simplex already has that vertex.
    fn ask(&mut self, dir: &Vec3) -> Option<Vertex> {
        let new = self.pair.support(dir);
        let lower = dir.dot(&new.w);
        if lower > self.lower {
            self.lower = lower;
            self.normal = *dir;
        }
        let known = self.simplex.used().iter().any(|v| v.w == new.w);
        (!known).then_some(new)
    }

    /// Adds a vertex; `Some` if that ends the run.
    fn add(&mut self, new: Vertex) -> Option<Run> {
        let tiny = self.pair.tiny() / 4.0;
        self.simplex.push(new);
        let Some(nearest) = self.simplex.nearest() else {
            self.simplex.keep_all();
            return Some(Run::Overlap);
        };
        let dir = self.simplex.direction(&nearest);
        let (Some(dir), true) = (dir, nearest.square > tiny * tiny) else {
            // Too close to distinguish.
            self.simplex.keep(&nearest);
            return Some(Run::Overlap);
        };
        let upper = nearest.square.sqrt();
        if upper >= self.upper {
            self.simplex.pop();
            return Some(Run::Ended);
        }
        self.simplex.keep(&nearest);
        (self.point, self.upper, self.dir) = (nearest.point, upper, dir);
        None
    }

    /// For cores that overlap: their points at the origin coincide, and the best direction proves how far they overlap
    /// at most.
    fn touch(&self) -> CoreGap {
        self.between(self.lower, self.normal)
    }

    fn gap(&self) -> CoreGap {
        let (mut lower, mut normal) = (self.lower, self.normal);
        // The last direction of the simplex and the one straight to the point may not have been queried yet.
        if self.upper - lower > self.pair.tiny() {
            let asked = [Some(self.dir), unit(&self.point)];
            for dir in asked.into_iter().flatten() {
                let value = dir.dot(&self.pair.support(&dir).w);
                if value > lower {
                    (lower, normal) = (value, dir);
                }
            }
        }
        self.between(lower, normal)
    }

    /// The gap between what a direction proves and the points of the simplex.
    fn between(&self, lower: f64, normal: Vec3) -> CoreGap {
        let (point_a, point_b) = self.simplex.witnesses();
        CoreGap {
            lower,
            upper: (point_b - point_a).norm().max(lower),
            normal,
            point_a,
            point_b,
            held: Held::of(self.simplex.used(), &self.simplex.weights),
        }
    }
}
