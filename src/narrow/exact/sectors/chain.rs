//! A chain of points of the difference around one side of an axis, and the distance that it proves.
//!
//! In: points, each the sum of a point of the other core and a corner of the round one's outline. Out: the least
//! distance in one plane, or in all planes of a sector.

use std::cmp::Ordering;

use crate::math::Vec3;

/// Most points of a chain.
const LINKS_MAX: usize = 12;

/// Along a plane from the axis, and along the axis, metres.
pub(super) type Flat = [f64; 2];

pub(super) fn dot(p: Flat, q: Flat) -> f64 {
    p[0] * q[0] + p[1] * q[1]
}

/// A point of the difference of the other core and the round one, for any plane.
#[derive(Clone, Copy, Default)]
pub(super) struct Link {
    /// On the other core, frame of the round one.
    pub(super) of_other: Vec3,
    /// Corner of the round core's outline, rotated by half a turn about its origin.
    pub(super) corner: Flat,
}

impl Link {
    /// Its place in the plane along a direction orthogonal to the axis.
    pub(super) fn at(&self, along: &Vec3) -> Flat {
        [
            self.corner[0] + (self.of_other.x * along.x + self.of_other.y * along.y),
            self.height(),
        ]
    }

    pub(super) fn height(&self) -> f64 {
        self.corner[1] + self.of_other.z
    }
}

/// Points in descending order of height.
#[derive(Default)]
pub(super) struct Chain {
    pub(super) links: [Link; LINKS_MAX],
    pub(super) count: usize,
}

/// The least distance that a chain proves.
#[derive(Clone, Copy)]
pub(super) struct Least {
    pub(super) depth: f64,
    /// Unit, outward: the direction of this distance.
    pub(super) n: Flat,
    /// Index of the upper link.
    pub(super) place: usize,
}

impl Least {
    const NONE: Self = Self {
        depth: f64::INFINITY,
        n: [0.0, 1.0],
        place: 0,
    };

    pub(super) fn offer(&mut self, depth: f64, n: Flat, place: usize) {
        if depth < self.depth {
            *self = Self { depth, n, place };
        }
    }
}

impl Chain {
    pub(super) fn links(&self) -> &[Link] {
        &self.links[..self.count]
    }

    /// Adds the next one from the top; of equally high ones the outermost stays, and one that is not lower is left out.
    pub(super) fn push(&mut self, link: Link, along: &Vec3) {
        if let Some(last) = self.links[..self.count].last_mut() {
            match link.height().partial_cmp(&last.height()) {
                Some(Ordering::Less) => {}
                Some(Ordering::Equal) if link.at(along)[0] > last.at(along)[0] => {
                    *last = link;
                    return;
                }
                _ => return,
            }
        }
        self.insert(self.count, link);
    }

    /// False if there is no room, or it is not between its neighbours.
    pub(super) fn insert(&mut self, place: usize, link: Link) -> bool {
        let above = place == 0 || self.links[place - 1].height() > link.height();
        let below = place == self.count || self.links[place].height() < link.height();
        let fits = above && below && self.count < LINKS_MAX;
        if fits {
            self.links[place..=self.count].rotate_right(1);
            self.links[place] = link;
            self.count += 1;
        }
        fits
    }

    /// The least of the top, the bottom, and the lines between successive links, in one plane.
    pub(super) fn least(&self, along: &Vec3) -> Least {
        let mut least = self.ends();
        for (k, [p, q]) in self.couples() {
            let (n, depth) = line(p.at(along), q.at(along));
            least.offer(depth, n, k);
        }
        least
    }

    /// What it proves for all planes of a sector.
    ///
    /// * `middle`, `ends` - directions orthogonal to the axis.
    /// * `width` - the angle between the ends.
    /// * returns - also the end at which the least occurs.
    pub(super) fn bound(&self, middle: &Vec3, ends: &[Vec3; 2], width: f64) -> (Least, usize) {
        let part = width * width / 8.0;
        let place = |link: &Link| {
            let off = link.of_other.x.hypot(link.of_other.y);
            let [one, other] = ends.each_ref().map(|along| link.at(along));
            // It bends towards the axis: a chord overestimates it only beyond the axis.
            let beyond = off * part - (one[0].min(other[0]) - link.corner[0]);
            let lost = part * beyond.clamp(0.0, off);
            [one, other].map(|[x, z]| [x - lost, z])
        };
        let (mut least, mut end) = (self.ends(), 0);
        for (k, [p, q]) in self.couples() {
            let (at_p, at_q) = (place(p), place(q));
            // A direction that is good enough for both links at both ends is so in between, too.
            let (n, _) = line(p.at(middle), q.at(middle));
            let by_one = [0, 1].map(|end| dot(at_p[end], n).min(dot(at_q[end], n)));
            let fixed = by_one[0].min(by_one[1]);
            if fixed >= least.depth {
                continue;
            }
            let lines = [0, 1].map(|end| line(at_p[end], at_q[end]));
            let turned = lines[0].1.min(lines[1].1);
            let before = least.depth;
            let at = if turned >= fixed {
                let at = usize::from(lines[1].1 < lines[0].1);
                least.offer(turned, lines[at].0, k);
                at
            } else {
                least.offer(fixed, n, k);
                usize::from(by_one[1] < by_one[0])
            };
            if least.depth < before {
                end = at;
            }
        }
        (least, end)
    }

    /// The least of the top and the bottom.
    fn ends(&self) -> Least {
        let mut least = Least::NONE;
        let links = self.links();
        if let (Some(top), Some(bottom)) = (links.first(), links.last()) {
            least.offer(top.height(), [0.0, 1.0], 0);
            least.offer(-bottom.height(), [0.0, -1.0], self.count - 1);
        }
        least
    }

    /// Each link with its successor.
    fn couples(&self) -> impl Iterator<Item = (usize, [&Link; 2])> {
        let next = self.links().iter().skip(1);
        let couples = self.links().iter().zip(next);
        couples.enumerate().map(|(k, (p, q))| (k, [p, q]))
    }
}

/// The unit normal of the line from a point to a lower one, outward, and its distance from the origin.
fn line(p: Flat, q: Flat) -> (Flat, f64) {
    // Differences first: for points close to each other they are exact.
    let across = [p[1] - q[1], q[0] - p[0]];
    let length = across[0].hypot(across[1]);
    let n = across.map(|x| x / length);
    (n, dot(p, n))
}

/// The direction orthogonal to the axis at an angle.
pub(super) fn along(angle: f64) -> Vec3 {
    let (sin, cos) = angle.sin_cos();
    Vec3::new(cos, sin, 0.0)
}

/// A vector of a plane.
pub(super) fn out(along: &Vec3, n: Flat) -> Vec3 {
    along * n[0] + Vec3::z() * n[1]
}
