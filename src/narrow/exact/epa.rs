//! The expanding polytope: the depth of two overlapping cores.
//!
//! In: a pair and the simplex that GJK ended with. Out: the gap (minus the least translation that separates) with both
//! certified ends.
//!
//! A polytope with its corners in the Minkowski difference grows at its face nearest to the origin. `f` at that face's
//! normal is the lower end. The upper end is minus the least plane distance over all faces: the polytope is closed and
//! contains the origin, so a ball of that radius fits into it, and every point of the ball is a difference of two
//! points of the cores. Faces that look away from the origin by rounding only make that end looser, never wrong.
//!
//! Where the features alone prove a cap of directions, three corners may represent it that need not lie in the
//! difference, see [`Cap::rise`](newton::Cap::rise); the upper end is then no more than the cap and those faces prove.
//!
//! Source: van den Bergen 2001, Proximity queries and penetration depth computation on 3D game objects.

mod follow;

use std::cell::RefCell;

use super::gjk;
use super::newton::{self, Refined};
use super::pair::{CoreGap, Held, Pair, Vertex, frame, unit};
use super::polytope::Polytope;
use super::sectors;
use super::simplex::{Simplex, normal_of};
use crate::math::Vec3;

pub(super) use follow::{depth_around, depth_at};

/// Most growth steps: polytopes finish long before, overlapping curved cores take 40 to 120.
const STEPS_MAX: usize = 300;
/// Most faces made: some half a millisecond, because a run is not interrupted.
const FACES_MAX: usize = 2048;
/// Most further runs.
const ATTEMPTS_MAX: usize = 2;
/// Height of the difference over a face, as a share of the smaller core, up to which Newton is run on its features.
const NEAR: f64 = 2e-2;
/// Cosine between face normals beyond which a face belongs to another local optimum.
const ANOTHER: f64 = 0.98;
/// Greatest lean of the ring around a closest point; shallow pairs would need more.
const RING_MAX: f64 = 0.2;

thread_local! {
    static SCRATCH: RefCell<Polytope> = RefCell::new(Polytope::default());
}

/// The gap of two cores that overlap or touch.
///
/// * `warm` - Newton's result from the features of an earlier answer, if any.
pub(super) fn depth(pair: &Pair<'_>, simplex: &Simplex, warm: Option<Refined>) -> CoreGap {
    let run = |polytope: &mut Polytope| {
        let upright = [Vec3::x(), Vec3::y(), Vec3::z()];
        let gap = polytope.run(pair, simplex, &upright, warm);
        let mut gap = polytope.straight(pair, gap);
        if !pair.polytopes
            && !gap.is_tight(pair)
            && let Some(other) = sectors::wide_gap(pair, warm.as_ref())
        {
            gap = gap.meet(&other, pair);
        }
        // A surface that breaks on slivers leaves the ends apart: other first corners give other slivers.
        for attempt in 0..ATTEMPTS_MAX {
            if gap.is_tight(pair) || polytope.faces.len() > FACES_MAX {
                break;
            }
            let (one, other) = frame(&gap.normal);
            let turned = [gap.normal, one, other];
            let axes = if attempt == 0 { &upright } else { &turned };
            let again = polytope.run(pair, &Simplex::default(), axes, None);
            gap = gjk::better(&gap, &polytope.straight(pair, again));
        }
        // Last, because what is tight by this alone may still gain from another attempt at the other end.
        gap.upper = gap.upper.min((gap.point_b - gap.point_a).norm());
        gap.upper = gap.upper.max(gap.lower);
        gap
    };
    SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
        Ok(mut polytope) => run(&mut polytope),
        Err(_) => run(&mut Polytope::default()),
    })
}

/// The upper end of the gap.
///
/// * `fits` - radius of a ball around the origin that fits in; below 0, rounding reported an overlap that does not
///   exist, and the distance of a plane does not bound that of its face.
/// * `apart_m` - between points of the two cores.
fn upper(fits: f64, apart_m: f64) -> f64 {
    if fits < 0.0 {
        apart_m.max(-fits)
    } else {
        -fits
    }
}

/// Best end found so far.
struct Best {
    /// `f(normal)`.
    lower: f64,
    normal: Vec3,
    /// The face it was found at; faces are never overwritten, so it stays readable.
    face: usize,
}

impl Best {
    fn offer(&mut self, lower: f64, normal: &Vec3, face: usize) {
        if lower > self.lower {
            self.face = face;
            self.lower = lower;
            self.normal = *normal;
        }
    }
}

/// State of one run: what is known so far of both ends.
struct State {
    best: Best,
    /// Newton's last result, if it is the best.
    refined: Option<Refined>,
    /// Nearest face of the last step.
    nearest: usize,
    /// Radius of a ball that fits in.
    fits: f64,
    /// `f` at the normal of the nearest face.
    last: f64,
}

impl State {
    /// Nothing is known.
    fn new() -> Self {
        Self {
            best: Best {
                lower: f64::NEG_INFINITY,
                normal: Vec3::z(),
                face: 0,
            },
            refined: None,
            nearest: 0,
            fits: f64::NEG_INFINITY,
            last: f64::NEG_INFINITY,
        }
    }

    /// Whether a face belongs to a different local optimum than Newton's result.
    fn is_new(&self, normal: &Vec3) -> bool {
        self.refined.is_none_or(|r| r.normal.dot(normal) < ANOTHER)
    }
}

impl Polytope {
    fn run(
        &mut self,
        pair: &Pair<'_>,
        simplex: &Simplex,
        axes: &[Vec3; 3],
        warm: Option<Refined>,
    ) -> CoreGap {
        if let Err(flat) = self.start(pair, simplex, axes) {
            return flat;
        }
        self.settle(pair, warm.as_ref())
    }

    /// Grows as far as it helps, starting around Newton's result; returns the gap known then.
    fn settle(&mut self, pair: &Pair<'_>, warm: Option<&Refined>) -> CoreGap {
        let mut state = State::new();
        let sound = match warm {
            Some(found) => self.plant(pair, found, &mut state),
            None => true,
        };
        if sound {
            self.expand(pair, &mut state);
        }
        let best = &mut state.best;
        if let Some(found) = state.refined.filter(|r| r.value >= best.lower) {
            let apart_m = (found.point_b - found.point_a).norm();
            return CoreGap {
                lower: best.lower,
                upper: upper(state.fits, apart_m).max(best.lower),
                normal: found.normal,
                point_a: found.point_a,
                point_b: found.point_b,
                held: found.held,
            };
        }
        // Among equally good directions the last one has the witnesses.
        let mut nearest = state.nearest;
        match self.faces.get(nearest) {
            Some(face) if state.last >= best.lower - pair.tiny() => best.normal = -face.normal,
            _ => nearest = best.face,
        }
        self.finish(pair, best, nearest, state.fits)
    }

    /// Grows at the nearest face until both ends meet.
    fn expand(&mut self, pair: &Pair<'_>, state: &mut State) {
        let near = NEAR * pair.a.reach().min(pair.b.reach());
        let tolerance = pair.tolerance();
        for _ in 0..STEPS_MAX {
            let Some(place) = self.nearest() else {
                break;
            };
            if self.faces.len() > FACES_MAX {
                break;
            }
            let face = self.faces[place];
            state.fits = state.fits.max(face.distance);
            // The known bounds may be tight already.
            if -state.best.lower - face.distance <= tolerance {
                break;
            }
            let new = pair.support(&-face.normal);
            let reach = face.normal.dot(&new.w);
            state.best.offer(-reach, &-face.normal, place);
            // Apart, by more than rounding; cores that touch are grown around.
            if reach < -pair.tiny() {
                break;
            }
            (state.nearest, state.last) = (place, -reach);
            if reach - face.distance <= tolerance || -state.best.lower - face.distance <= tolerance
            {
                break;
            }
            // A first test of the features: the closest point itself becomes a corner, which saves most of the steps.
            if !pair.polytopes
                && reach - face.distance <= near
                && state.is_new(&-face.normal)
                && let corners = self.corners(&face)
                && corners.iter().all(Vertex::lies_on_elements)
            {
                let found = newton::solve(pair, &corners, &self.project(place).2, &-face.normal);
                if let Some(found) = found.filter(|r| r.value > state.best.lower) {
                    if !self.plant(pair, &found, state) {
                        break;
                    }
                    if !self.faces[place].alive {
                        continue;
                    }
                }
            }
            let known = (face.corners.iter()).any(|&k| self.vertices[usize::from(k)].w == new.w);
            if known || !self.grow(place, new, pair.tiny()) {
                break;
            }
        }
    }

    /// Adds Newton's result, the closest point and a ring around it: the faces between them lean so little from the
    /// best normal that they are within the tolerance. False if the surface broke.
    fn plant(&mut self, pair: &Pair<'_>, found: &Refined, state: &mut State) -> bool {
        state.best.offer(found.value, &found.normal, state.nearest);
        state.refined = Some(*found);
        let tolerance = pair.tolerance();
        let ((one, other), tiny) = (frame(&found.normal), pair.tiny());
        let lean = (2.0 * (tolerance / found.value.abs().max(tiny)).sqrt()).min(RING_MAX);
        if !self.offer(found.corner(), tiny) {
            return false;
        }
        [one, other, -one, -other].iter().all(|side| {
            unit(&(found.normal + side * lean)).is_none_or(|n| self.offer(pair.support(&n), tiny))
        })
    }

    /// The answer with closest points opposite each other, if the faces have such points: the projection onto the
    /// nearest face alone may fall outside it if several faces share a plane.
    fn straight(&self, pair: &Pair<'_>, gap: CoreGap) -> CoreGap {
        if gap.is_straight(pair) {
            return gap;
        }
        let (least, point_a, point_b) = self.witnesses_near(&(gap.normal * gap.lower));
        if least < gap.off() {
            CoreGap {
                point_a,
                point_b,
                ..gap
            }
        } else {
            gap
        }
    }

    /// Witnesses, and Newton if circles are involved.
    fn finish(&self, pair: &Pair<'_>, best: &mut Best, nearest: usize, fits: f64) -> CoreGap {
        let (mut point_a, mut point_b, weights) = self.project(nearest);
        let corners = self.faces.get(nearest).map(|face| self.corners(face));
        let mut held = corners.map_or_else(Held::default, |c| Held::of(&c, &weights));
        held.deep = true;
        if !pair.polytopes
            && let Some(corners) = corners
            && let Some(found) = newton::solve(pair, &corners, &weights, &best.normal)
            && found.value > best.lower
        {
            best.offer(found.value, &found.normal, nearest);
            (point_a, point_b) = (found.point_a, found.point_b);
            held = found.held;
        }
        CoreGap {
            lower: best.lower,
            upper: upper(fits, (point_b - point_a).norm()).max(best.lower),
            normal: best.normal,
            point_a,
            point_b,
            held,
        }
    }

    /// Witnesses at the projection of the origin onto a face, clipped to it, and the unclipped weights.
    fn project(&self, place: usize) -> (Vec3, Vec3, [f64; 3]) {
        let Some(face) = self.faces.get(place) else {
            return (Vec3::zeros(), Vec3::zeros(), [1.0, 0.0, 0.0]);
        };
        let [p, q, r] = self.corners(face);
        let normal = normal_of(&p.w, &q.w, &r.w);
        let square = normal.norm_squared();
        let to = -p.w;
        let mut weights = [0.0; 3];
        weights[1] = normal.dot(&to.cross(&(r.w - p.w))) / square;
        weights[2] = normal.dot(&(q.w - p.w).cross(&to)) / square;
        weights[0] = 1.0 - weights[1] - weights[2];
        if !weights.iter().all(|w| w.is_finite()) {
            weights = [1.0, 0.0, 0.0];
        }
        let clipped = weights.map(|w| w.max(0.0));
        let whole: f64 = clipped.iter().sum();
        let mix =
            |x: Vec3, y: Vec3, z: Vec3| (x * clipped[0] + y * clipped[1] + z * clipped[2]) / whole;
        (mix(p.a, q.a, r.a), mix(p.b, q.b, r.b), weights)
    }
}

#[cfg(test)]
mod tests;
