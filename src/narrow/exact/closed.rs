//! Closed forms: a point against a ball, segment, box, cylinder or cone, and two segments. With their margins these
//! cover all pairs of spheres and capsules, and a sphere against every primitive.
//!
//! In: a pair. Out: the gap of the cores, or `None` if there is no closed form.

use super::pair::{CoreGap, Held, Pair, frame, unit};
use crate::math::Vec3;
use crate::shape::Core;

/// The gap of two cores with a closed form.
pub(super) fn gap(pair: &Pair<'_>) -> Option<CoreGap> {
    let (a, b) = (pair.a.core(), pair.b.core());
    match (a, b) {
        (Core::Segment { half_m: ha }, Core::Segment { half_m: hb }) => {
            Some(segments(pair, *ha, *hb))
        }
        (_, Core::Point) => {
            let near = nearest(a, &pair.at)?;
            Some(with_lower(
                pair,
                near.outward,
                near.distance,
                near.surface,
                pair.at,
            ))
        }
        (Core::Point, _) => {
            let near = nearest(b, &-pair.to_b(&pair.at))?;
            let surface = pair.rotation * near.surface + pair.at;
            let normal = pair.rotation * -near.outward;
            Some(with_lower(
                pair,
                normal,
                near.distance,
                surface - normal * near.distance,
                surface,
            ))
        }
        _ => None,
    }
}

fn with_lower(pair: &Pair<'_>, normal: Vec3, gap: f64, point_a: Vec3, point_b: Vec3) -> CoreGap {
    let lower = normal.dot(&pair.support(&normal).w);
    CoreGap {
        lower,
        upper: gap.max(lower),
        normal,
        point_a,
        point_b,
        held: Held::default(),
    }
}

/// A point relative to a core, in the core's frame.
pub(super) struct Near {
    /// Closest point of the surface.
    surface: Vec3,
    /// Unit, outward.
    outward: Vec3,
    /// Signed: negative inside.
    pub(super) distance: f64,
}

impl Near {
    /// For a point outside whose closest point is known; `flat` is the outward direction if they coincide.
    fn outside(point: &Vec3, surface: Vec3, flat: Vec3) -> Self {
        let between = point - surface;
        Self {
            surface,
            outward: unit(&between).unwrap_or(flat),
            distance: between.norm(),
        }
    }

    fn inside(point: &Vec3, outward: Vec3, distance: f64) -> Self {
        Self {
            surface: point - outward * distance,
            outward,
            distance,
        }
    }
}

/// A point relative to a core, in the core's frame; `None` for a hull or triangle.
pub(super) fn nearest(core: &Core, point: &Vec3) -> Option<Near> {
    match core {
        Core::Point => Some(Near::outside(point, Vec3::zeros(), Vec3::z())),
        Core::Segment { half_m } => {
            let surface = Vec3::new(0.0, 0.0, point.z.clamp(-half_m, *half_m));
            Some(Near::outside(point, surface, Vec3::x()))
        }
        Core::Cuboid { half } => Some(to_cuboid(half, point)),
        Core::Cylinder { radius_m, half_m } => Some(to_cylinder(*radius_m, *half_m, point)),
        Core::Cone { radius_m, half_m } => Some(to_cone(*radius_m, *half_m, point)),
        Core::Hull(_) | Core::Triangle(_) => None,
    }
}

fn to_cuboid(half: &Vec3, point: &Vec3) -> Near {
    let clamped = Vec3::new(
        point.x.clamp(-half.x, half.x),
        point.y.clamp(-half.y, half.y),
        point.z.clamp(-half.z, half.z),
    );
    let over = point.abs() - half;
    // The nearest face: for a point inside it is the way out, for one on the surface the outward direction.
    let k = over.imax();
    let face = Vec3::ith(k, 1.0_f64.copysign(point[k]));
    if over[k] > 0.0 {
        Near::outside(point, clamped, face)
    } else {
        Near::inside(point, face, over[k])
    }
}

/// Radial unit vector of a point (x if it lies on the axis) and its distance from the axis.
fn radial(point: &Vec3) -> (Vec3, f64) {
    let radial = Vec3::new(point.x, point.y, 0.0);
    (
        unit(&radial).unwrap_or_else(Vec3::x),
        point.x.hypot(point.y),
    )
}

fn to_cylinder(radius_m: f64, half_m: f64, point: &Vec3) -> Near {
    let (radial, off) = radial(point);
    let cap = Vec3::new(0.0, 0.0, 1.0_f64.copysign(point.z));
    let (over_side, over_cap) = (off - radius_m, point.z.abs() - half_m);
    let (outward, over) = if over_side > over_cap {
        (radial, over_side)
    } else {
        (cap, over_cap)
    };
    if over > 0.0 {
        let mut surface = *point;
        if over_side > 0.0 {
            surface = radial * radius_m;
        }
        surface.z = point.z.clamp(-half_m, half_m);
        Near::outside(point, surface, outward)
    } else {
        Near::inside(point, outward, over)
    }
}

fn to_cone(radius_m: f64, half_m: f64, point: &Vec3) -> Near {
    let (radial, off) = radial(point);
    // In the half plane of the point: down the slant from the apex (0, h) to (r, -h), and its outward normal.
    let length = radius_m.hypot(2.0 * half_m);
    let slant = radial * (2.0 * half_m / length) + Vec3::z() * (radius_m / length);
    let down = radial * (radius_m / length) - Vec3::z() * (2.0 * half_m / length);
    let apex = Vec3::new(0.0, 0.0, half_m);
    let over_slant = slant.dot(&(point - apex));
    let over_base = -half_m - point.z;
    let (outward, over) = if over_slant > over_base {
        (slant, over_slant)
    } else {
        (-Vec3::z(), over_base)
    };
    if over <= 0.0 {
        return Near::inside(point, outward, over);
    }
    let along = down.dot(&(point - apex)).clamp(0.0, length);
    let on_slant = Near::outside(point, apex + down * along, slant);
    let on_base = radial * off.min(radius_m) - Vec3::z() * half_m;
    let on_base = Near::outside(point, on_base, -Vec3::z());
    if on_base.distance < on_slant.distance {
        on_base
    } else {
        on_slant
    }
}

/// Two segments: A's along z, B's along the third column of the rotation.
fn segments(pair: &Pair<'_>, ha: f64, hb: f64) -> CoreGap {
    let at = &pair.at;
    let v: Vec3 = pair.rotation.column(2).into_owned();
    let flat = v.x * v.x + v.y * v.y;
    // Seen along A only the components across count: no cancellation however nearly parallel the two are.
    let (mut r, mut s);
    if flat > 1e-28 {
        s = (-(at.x * v.x + at.y * v.y) / flat).clamp(-hb, hb);
    } else {
        // Parallel: the middle of their common range.
        let low = (-ha).max(at.z - hb);
        let high = ha.min(at.z + hb);
        s = (((low + high) / 2.0 - at.z) * v.z).clamp(-hb, hb);
    }
    r = at.z + s * v.z;
    if r.abs() > ha {
        r = r.clamp(-ha, ha);
        s = (r * v.z - at.dot(&v)).clamp(-hb, hb);
        r = (at.z + s * v.z).clamp(-ha, ha);
    }
    let (point_a, point_b) = (Vec3::new(0.0, 0.0, r), at + v * s);
    let between = point_b - point_a;
    let distance = between.norm();
    // Where the segments cross, the direction orthogonal to both is exact and the difference mostly rounding.
    let crossing = unit(&Vec3::new(-v.y, v.x, 0.0)).filter(|_| flat > 1e-28);
    let straight = unit(&between);
    let mut best = (f64::NEG_INFINITY, Vec3::x());
    let crossing = crossing.unwrap_or_else(|| frame(&v).0);
    let crossing = if crossing.dot(&between) < 0.0 {
        -crossing
    } else {
        crossing
    };
    for n in [straight, Some(crossing)].into_iter().flatten() {
        let lower = n.dot(&pair.support(&n).w);
        if lower > best.0 {
            best = (lower, n);
        }
    }
    CoreGap {
        lower: best.0,
        upper: distance.max(best.0),
        normal: best.1,
        point_a,
        point_b,
        held: Held::default(),
    }
}
