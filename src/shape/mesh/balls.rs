//! Inner balls of a solid: where two of them overlap, so do the solids, and at least as deep.
//!
//! In: a closed mesh. Out: up to [`BALLS_MAX`] balls, each wholly within it, the largest first.
//!
//! Candidates are balls of the medial axis, found as in Ma, Bae, Choi 2012 ("3D medial axis point approximation using
//! nearest neighbors and the normal field"): one that touches the surface from within shrinks until no surface is in
//! it; the largest of them are also moved to where they can grow. Each next one chosen reaches farthest out of the ones
//! before, so that a rod has a row of them. Source of the use: inner sphere trees (Weller, Zachmann 2009), of which
//! this is one level: its purpose is an early yes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Matrix3, Vector3};

use super::tree::{Below, NODES_WAITING_MAX, Node};
use super::{Inside, Mesh};
use crate::math::{Point, ROUND, Vec3, f32_near};

/// Most balls of one solid.
pub(crate) const BALLS_MAX: usize = 16;
/// Places on the surface under which a ball is searched.
const PLACES_MAX: usize = 64;
/// Most steps in which a ball shrinks; most have shrunk enough after four.
const STEPS_MAX: usize = 12;
/// Balls that are grown before the last choice.
const GROWN_MAX: usize = BALLS_MAX;
/// Steps in which a ball is grown, at most: with fewer it may stay smaller, with more a mesh takes longer to build.
const GROW_STEPS_MAX: usize = 24;
/// A ball is grown no further once its next step is not above this share of its radius.
const GROW_MIN: f64 = 0.01;
/// A ball is kept if it reaches this far out of the earlier ones, as a share of the mesh's radius.
const NEW_MIN: f64 = 0.02;
/// How much smaller a ball is made than it was found, as a share of the mesh's radius: a hundred times the error of the
/// distance of a face that is no sliver. The rounding of coordinates far from the origin is added.
const SPARE: f64 = 1e-9;
/// A face is a sliver below this height, as a share of its longest side: its plane is then not used.
const SLIVER: f64 = 1e-4;

/// During the search for a ball, a point of the surface is near enough if none is nearer than this share of its
/// distance: at 0.9 a quarter fewer overlaps are found.
pub(super) const NEARLY: f64 = 0.97;
/// Most boxes visited for a near point of the surface: around the middle of a ball all of it is equally near.
const NEAR_BOXES_MAX: usize = 2_048;
/// Most boxes visited for the radius of a ball that is kept.
const CLEAR_BOXES_MAX: usize = 32_768;

/// Radius of an absent ball: its square is finite.
const NO_BALL: f32 = -1e15;

/// A ball, own frame of the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub(crate) centre: Point,
    /// Metres.
    pub(crate) radius_m: f64,
}

/// The balls of a solid, the largest first.
#[derive(Clone, Debug)]
pub(crate) struct Balls {
    all: Vec<Ball>,
    /// The same in columns, to the nearest f32: centres relative to the mesh's, and radii; far below zero for absent
    /// ones.
    columns: [[f32; BALLS_MAX]; 4],
}

impl Balls {
    fn new(all: Vec<Ball>, origin: &Point) -> Self {
        let mut columns = [
            [0.0; BALLS_MAX],
            [0.0; BALLS_MAX],
            [0.0; BALLS_MAX],
            [NO_BALL; BALLS_MAX],
        ];
        for (lane, ball) in all.iter().enumerate() {
            let from = ball.centre - origin;
            let row = [from.x, from.y, from.z, ball.radius_m].map(f32_near);
            for (column, x) in columns.iter_mut().zip(row) {
                column[lane] = x;
            }
        }
        Self { all, columns }
    }

    /// The balls.
    #[cfg(test)]
    pub(crate) fn all(&self) -> &[Ball] {
        &self.all
    }

    /// The ball that contains a point, own frame, most deeply, or is nearest to it.
    pub(crate) fn closest_to(&self, point: &Point) -> Ball {
        let over = |ball: &Ball| ball.radius_m - (ball.centre - point).norm();
        let deeper = |best: Ball, ball: &Ball| {
            if over(ball) > over(&best) {
                *ball
            } else {
                best
            }
        };
        self.all.iter().fold(self.all[0], deeper)
    }

    /// The ball of this and the ball of `other` that overlap most, to f32 accuracy and with some preference for large
    /// ones.
    ///
    /// * `turn`, `way` - rotation of the other's frame seen from this one's, and its mesh's centre from this one's,
    ///   metres.
    pub(crate) fn closest(
        &self,
        other: &Self,
        turn: &Matrix3<f32>,
        way: &Vector3<f32>,
    ) -> (Ball, Ball) {
        let [x, y, z, radius] = &self.columns;
        let [u, v, w, reach] = &other.columns;
        let seen = |k: usize, lane: usize| {
            turn[(k, 0)] * u[lane] + turn[(k, 1)] * v[lane] + turn[(k, 2)] * w[lane] + way[k]
        };
        let (mut best, mut which) = ([f32::NEG_INFINITY; BALLS_MAX], [0_u32; BALLS_MAX]);
        for (row, reach) in (0_u32..).zip(&reach[..other.all.len()]) {
            let [p, q, r] = [0, 1, 2].map(|k| seen(k, row as usize));
            for lane in 0..BALLS_MAX {
                let (dx, dy, dz) = (x[lane] - p, y[lane] - q, z[lane] - r);
                let sum = radius[lane] + reach;
                // Has the sign of the overlap, without a root.
                let over = sum * sum.abs() - (dx * dx + dy * dy + dz * dz);
                let more = over > best[lane];
                best[lane] = if more { over } else { best[lane] };
                which[lane] = if more { row } else { which[lane] };
            }
        }
        let mut lane = 0;
        for k in 1..self.all.len() {
            lane = if best[k] > best[lane] { k } else { lane };
        }
        (self.all[lane], other.all[which[lane] as usize])
    }
}

impl Mesh {
    /// Balls wholly within it; `None` for a surface, a mesh that deforms, or a solid too thin for any.
    pub(crate) fn balls(&self) -> Option<&Balls> {
        self.balls.as_deref()
    }

    /// The balls of a solid, during its construction.
    pub(super) fn find_balls(&self) -> Option<Box<Balls>> {
        if !self.solid {
            return None;
        }
        let step = self.faces.len().div_ceil(PLACES_MAX);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "a mesh has under 2^31 faces"
        )]
        let faces = (0..self.faces.len() as u32).step_by(step);
        let mut inside = Inside::default();
        let mut found: Vec<Ball> = faces
            .filter_map(|face| self.ball_under(face))
            .filter(|ball| inside.run(self, ball.centre, |_| true) != 0)
            .collect();
        // Those that touch the surface at a given place reach into corners; most can grow if they may move.
        let grown = self.choose(&found, GROWN_MAX);
        let grown = grown.iter().map(|ball| self.grow(ball));
        found.extend(grown.filter(|ball| inside.run(self, ball.centre, |_| true) != 0));
        let mut chosen = self.choose(&found, BALLS_MAX);
        let spare_m = self.spare_m();
        for ball in &mut chosen {
            ball.radius_m = self.clear(&ball.centre) - spare_m;
        }
        chosen.retain(|ball| ball.radius_m > 0.0);
        chosen.sort_by(|one, other| other.radius_m.total_cmp(&one.radius_m));
        (!chosen.is_empty()).then(|| Box::new(Balls::new(chosen, &self.centre)))
    }

    /// How much a distance from its surface is reduced, metres.
    pub(super) fn spare_m(&self) -> f64 {
        SPARE * self.radius + 64.0 * ROUND * self.centre.coords.amax()
    }

    /// The largest ball, then each that reaches farthest out of the earlier ones, at most `most`.
    fn choose(&self, balls: &[Ball], most: usize) -> Vec<Ball> {
        let mut chosen: Vec<Ball> = Vec::with_capacity(most);
        while chosen.len() < most {
            let news = balls.iter().map(|ball| (ball.news_beside(&chosen), *ball));
            let best = news.max_by(|one, other| one.0.total_cmp(&other.0));
            let Some((_, ball)) = best.filter(|(news, _)| *news > NEW_MIN * self.radius) else {
                break;
            };
            chosen.push(ball);
        }
        chosen
    }

    /// A ball moved away from the nearest part of the surface, as long as it grows.
    fn grow(&self, ball: &Ball) -> Ball {
        let mut centre = ball.centre;
        let (mut clear_m, mut nearest) = self.near(&centre);
        let mut step_m = 0.5 * clear_m;
        for _ in 0..GROW_STEPS_MAX {
            let away = (centre - nearest).try_normalize(0.0);
            let Some(away) = away.filter(|_| step_m > GROW_MIN * clear_m) else {
                break;
            };
            let tried = centre + away * step_m;
            let there = self.near(&tried);
            if there.0 > clear_m {
                (centre, (clear_m, nearest)) = (tried, there);
            } else {
                step_m *= 0.5;
            }
        }
        Ball {
            centre,
            radius_m: clear_m,
        }
    }

    /// Approximately the largest ball that touches a face's middle from within and contains no surface.
    fn ball_under(&self, face: u32) -> Option<Ball> {
        let normal = self.face_normal(face)?;
        let [a, b, c] = self.triangle(face);
        let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
        let mut radius_m = self.radius;
        for step in 1.. {
            let centre = middle - normal * radius_m;
            let (clear_m, nearest) = self.near(&centre);
            let way = nearest - middle;
            let under = -2.0 * normal.dot(&way);
            let fits_m = way.norm_squared() / under;
            let shrinks = fits_m > 0.0 && fits_m < radius_m * (1.0 - 1e-3);
            if !shrinks || step == STEPS_MAX {
                let radius_m = clear_m;
                return Some(Ball { centre, radius_m });
            }
            radius_m = fits_m;
        }
        None
    }

    /// A point of the surface that is nearly the nearest to a point, and its distance, metres.
    fn near(&self, point: &Point) -> (f64, Point) {
        self.near_within(point, NEAR_BOXES_MAX).0
    }

    /// The same, visiting at most `boxes` boxes, and whether none that could contain a nearer one was left.
    pub(super) fn near_within(&self, point: &Point, boxes: usize) -> ((f64, Point), bool) {
        let nodes = self.tree.nodes();
        let from = point - self.tree.origin();
        let mut waiting = [(0_u32, 0.0_f64); NODES_WAITING_MAX];
        let (mut len, mut left) = (1, boxes);
        let mut best = (f64::INFINITY, *point);
        while len > 0 && left > 0 {
            len -= 1;
            let (place, away_m) = waiting[len];
            if away_m >= NEARLY * best.0 {
                continue;
            }
            left -= 1;
            match nodes[place as usize].below(place) {
                Below::Nodes(one, other) => {
                    let with = |place: u32| (place, distance(&nodes[place as usize], &from));
                    let (one, other) = (with(one), with(other));
                    let (far, near) = if one.1 > other.1 {
                        (one, other)
                    } else {
                        (other, one)
                    };
                    (waiting[len], waiting[len + 1]) = (far, near);
                    len += 2;
                }
                // Not in a rigid mesh.
                Below::Row(..) => {}
                Below::Triangle(face) => {
                    let there = near_triangle(&self.triangle(face), point);
                    best = if there.0 < best.0 { there } else { best };
                }
            }
        }
        (best, len == 0)
    }

    /// A lower bound on the distance of a point from the surface, metres, up to rounding: the nearest boxes are opened
    /// first, and at the limit the next box stands for its contents.
    fn clear(&self, point: &Point) -> f64 {
        let nodes = self.tree.nodes();
        let from = point - self.tree.origin();
        // Distances are non-negative, so their bits are in the same order.
        let mut waiting = BinaryHeap::from([Reverse((0, Held::Box(0)))]);
        let mut left = CLEAR_BOXES_MAX;
        while let Some(Reverse((bits, held))) = waiting.pop() {
            let place = match held {
                Held::Box(place) if left > 0 => place,
                _ => return f64::from_bits(bits),
            };
            left -= 1;
            let mut wait = |low_m: f64, held| {
                waiting.push(Reverse((low_m.max(0.0).to_bits(), held)));
            };
            match nodes[place as usize].below(place) {
                Below::Nodes(one, other) => [one, other].into_iter().for_each(|place| {
                    wait(distance(&nodes[place as usize], &from), Held::Box(place));
                }),
                // Not in a rigid mesh.
                Below::Row(..) => {}
                Below::Triangle(face) => {
                    wait(
                        near_triangle(&self.triangle(face), point).0,
                        Held::Face(face),
                    );
                }
            }
        }
        // Not reached: a mesh has a face.
        0.0
    }
}

/// An item of a search: a box of the tree, or a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Held {
    Box(u32),
    Face(u32),
}

impl Ball {
    /// How far it reaches out of others, or its own width if that is less, metres.
    fn news_beside(&self, others: &[Self]) -> f64 {
        let out =
            |other: &Self| (self.centre - other.centre).norm() + self.radius_m - other.radius_m;
        others.iter().map(out).fold(2.0 * self.radius_m, f64::min)
    }
}

/// Distance of a point, relative to the tree's origin, from a box, metres.
fn distance(node: &Node, from: &Vec3) -> f64 {
    let beyond = |k: usize| {
        let (low, high) = (f64::from(node.min[k]), f64::from(node.max[k]));
        (low - from[k]).max(from[k] - high).max(0.0)
    };
    Vec3::new(beyond(0), beyond(1), beyond(2)).norm()
}

/// A lower bound on the distance of a point from a triangle, up to rounding, and the nearest point or one near it.
fn near_triangle(corners: &[Point; 3], point: &Point) -> (f64, Point) {
    let mut best = (f64::INFINITY, corners[0]);
    let mut longest = 0.0_f64;
    for k in 0..3 {
        let (from, side) = (corners[k], corners[(k + 1) % 3] - corners[k]);
        let square = side.norm_squared();
        longest = longest.max(square);
        let along = if square > 0.0 {
            (side.dot(&(point - from)) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let there = from + side * along;
        let away_m = (point - there).norm();
        if away_m < best.0 {
            best = (away_m, there);
        }
    }
    let [a, b, c] = corners;
    let across = (b - a).cross(&(c - a));
    let area = across.norm();
    if area <= SLIVER * longest {
        // No point of it is farther from its longest side than its height.
        let height_m = if longest > 0.0 {
            SLIVER * longest.sqrt()
        } else {
            0.0
        };
        return (best.0 - height_m, best.1);
    }
    let within = (0..3).all(|k| {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        (to - from).cross(&(point - from)).dot(&across) >= 0.0
    });
    if within {
        let height_m = across.dot(&(point - a)) / area;
        best = (height_m.abs(), point - across * (height_m / area));
    }
    best
}
