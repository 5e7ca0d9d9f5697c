//! The answer of the sectors: the best direction refined by Newton, and the closest points along it.
//!
//! In: the best direction known, and the proved bound. Out: the gap of the cores.

use super::super::closed::nearest;
use super::super::newton::{self, Refined};
use super::super::pair::{CoreGap, Held};
use super::{Around, Best};
use crate::math::Vec3;

/// Distance from the best normal at which its features are queried.
const FEATURES_ASIDE: f64 = 1e-2;

impl Around<'_> {
    /// Four small displacements from the best direction: in its plane, and out of it.
    fn ways(&self, best: &Best) -> [Vec3; 4] {
        let (along, [x, z]) = (best.along, best.n);
        let up = self.normal(&(along * -z + Vec3::z() * x)) * FEATURES_ASIDE;
        let side = self.normal(&Vec3::new(-along.y, along.x, 0.0)) * FEATURES_ASIDE;
        [up, -up, side, -side]
    }

    /// Runs Newton on the features around the best direction, if a plane showed it.
    pub(super) fn refine(&self, best: &mut Best) {
        if best.refined.is_some() {
            return;
        }
        let mut found: Option<Refined> = None;
        let ways = self.ways(best);
        for two in [[ways[0], ways[1]], [ways[2], ways[3]]] {
            let features = two.map(|way| self.pair.support(&(best.normal + way)));
            let one = newton::solve(self.pair, &features, &[0.5, 0.5], &best.normal);
            found = match (found, one) {
                (Some(f), Some(o)) if f.value >= o.value => Some(f),
                (found, one) => one.or(found),
            };
        }
        if let Some(found) = found {
            best.take(&found, self.pair.tiny());
        }
    }

    pub(super) fn answer(&self, best: &Best, upper: f64) -> CoreGap {
        let (point_a, point_b, held) = match &best.refined {
            Some(found) => (found.point_a, found.point_b, found.held),
            None => {
                let (a, b) = self.witnesses(best);
                (a, b, Held::default())
            }
        };
        CoreGap {
            lower: best.value,
            upper: upper.max(best.value),
            normal: best.normal,
            point_a,
            point_b,
            held,
        }
    }

    /// Opposite points: among those of the other core's feature, the one nearest to both surfaces.
    fn witnesses(&self, best: &Best) -> (Vec3, Vec3) {
        let pair = self.pair;
        let (out, round) = if self.a_is_round {
            (-best.normal, pair.a)
        } else {
            (pair.to_b(&best.normal), pair.b)
        };
        let across = out * -best.value;
        let side = Vec3::new(-out.y, out.x, 0.0);
        let half_m = self.corners[0][1];
        let corner = self.farthest(&out);
        let mut shown = [corner; 5];
        for (point, way) in shown[1..].iter_mut().zip(self.ways(best)) {
            let normal = best.normal + way;
            *point = self.farthest(&if self.a_is_round {
                -normal
            } else {
                pair.to_b(&normal)
            });
        }
        let mut least = (f64::INFINITY, corner);
        for (k, one) in shown.iter().enumerate() {
            for other in &shown[k..] {
                let (from, way) = (one - across, other - one);
                let height = from.z.clamp(-half_m, half_m) - from.z;
                // The first, the middle, where they cross the plane, and where they are as high as the round core.
                for part in [0.0, 0.5, -from.dot(&side) / way.dot(&side), height / way.z] {
                    let point = one + way * part.clamp(0.0, 1.0);
                    let near = nearest(round.core(), &(point - across));
                    let off = near.map_or(f64::INFINITY, |near| near.distance.abs());
                    let off = off.max(out.dot(&(corner - point)));
                    if off < least.0 {
                        least = (off, point);
                    }
                }
            }
        }
        let (of_other, of_round) = (least.1, least.1 - across);
        if self.a_is_round {
            (of_round, of_other)
        } else {
            let placed = |p: Vec3| pair.rotation * p + pair.at;
            (placed(of_other), placed(of_round))
        }
    }
}
