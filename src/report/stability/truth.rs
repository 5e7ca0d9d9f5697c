//! The truth of a case: the gap of two placed solids as law 3.2 defines it, computed from the engine's input in [`Dd`],
//! and accurate to some 1e-28 of the sizes. It shares no code with the engine.
//!
//! Method: `f(n)`, the distance by which planes across a direction `n` separate two convex solids, is at most their gap
//! for any `n`, and equal to it for the best one. For two polytopes with radii the best one is a face's normal, a
//! normal of two edges, or the way between two corners or between a corner and an edge: all are tried. Round solids
//! have closed forms in some cases: ball against cylinder or cone, any solid against a half-space, upright cylinders
//! and boxes, and cylinders whose centres lie on the common perpendicular of their axes. A pair without a closed form
//! is no case.

use super::dd::{Dd, Place, V3};
use super::pieces::{of_pieces, pieces};
use super::stage::{Actor, Pos};
use crate::shape::ShapeSpec;

/// Bounds of a true gap, metres; they are equal if the gap is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// The lower bound; `None`: an overlap of unknown depth.
    pub low: Option<Dd>,
    /// The upper bound.
    pub high: Dd,
}

impl Truth {
    /// A known gap.
    #[must_use]
    pub fn is(gap: Dd) -> Self {
        Self {
            low: Some(gap),
            high: gap,
        }
    }

    fn least(self, other: Self) -> Self {
        Self {
            low: self.low.zip(other.low).map(|(a, b)| a.min(b)),
            high: self.high.min(other.high),
        }
    }
}

/// The truth of two bodies: the least over their shape pairs.
///
/// * returns - `None`: there is no closed form.
#[must_use]
pub fn gap(a: &Actor, at_a: &Pos, b: &Actor, at_b: &Pos) -> Option<Truth> {
    let (place_a, place_b) = (
        Place::new(at_a.t, at_a.q, at_a.t),
        Place::new(at_b.t, at_b.q, at_a.t),
    );
    let mut least: Option<Truth> = None;
    for (one, off_a) in &a.parts {
        for (other, off_b) in &b.parts {
            let one = (one, moved(&place_a, *off_a));
            let truth = of_shapes(&one, &(other, moved(&place_b, *off_b)))?;
            least = Some(least.map_or(truth, |least| least.least(truth)));
        }
    }
    least
}

/// The pose of a part that is not rotated in its body.
fn moved(place: &Place, by: [f64; 3]) -> Place {
    let mut moved = *place;
    moved.at = place.point(&V3::from(by));
    moved
}

type At<'a> = (&'a ShapeSpec, Place);

fn of_shapes(a: &At<'_>, b: &At<'_>) -> Option<Truth> {
    use ShapeSpec::{Box, Cone, Cylinder, HalfSpace, Sphere};
    match (a.0, b.0) {
        (HalfSpace { normal, offset }, _) => over((normal, *offset), &a.1, b).map(Truth::is),
        (_, HalfSpace { normal, offset }) => over((normal, *offset), &b.1, a).map(Truth::is),
        (Sphere { radius }, Cylinder { .. } | Cone { .. }) => {
            Some(Truth::is(profile(b, &a.1.at)? - Dd::from(*radius)))
        }
        (Cylinder { .. } | Cone { .. }, Sphere { radius }) => {
            Some(Truth::is(profile(a, &b.1.at)? - Dd::from(*radius)))
        }
        (Cylinder { .. }, Cylinder { .. } | Box { .. }) | (Box { .. }, Cylinder { .. }) => {
            upright(a, b).or_else(|| crossed(a, b)).map(Truth::is)
        }
        _ => {
            let (one, other) = (pieces(a)?, pieces(b)?);
            let all = one.iter().flat_map(|p| other.iter().map(move |q| (p, q)));
            let least = all.map(|(p, q)| of_pieces(p, q)).reduce(Dd::min)?;
            let solid = is_solid_mesh(a.0) || is_solid_mesh(b.0);
            Some(Truth {
                // Where solid meshes overlap, their depth is not that of the triangles.
                low: (!solid || least >= Dd::ZERO).then_some(least),
                high: if solid { least.max(Dd::ZERO) } else { least },
            })
        }
    }
}

fn is_solid_mesh(spec: &ShapeSpec) -> bool {
    matches!(spec, ShapeSpec::Trimesh { solid, .. } if *solid != Some(false))
}

/// The gap to a half-space: the height of the shape's lowest point above the plane.
fn over((normal, offset): (&[f64; 3], f64), plane: &Place, (spec, place): &At<'_>) -> Option<Dd> {
    let up = plane.turned(&V3::from(*normal).unit()?);
    let height = up.dot(&(place.at - plane.at)) - Dd::from(offset);
    let down = place.turned_back(&up.scaled(Dd::from(-1.0)));
    Some(height - reach(spec, &down)?)
}

/// How far a shape reaches along a unit direction of its own frame.
pub(super) fn reach(spec: &ShapeSpec, n: &V3) -> Option<Dd> {
    let [x, y, z] = n.0;
    let across = || (x * x + y * y).sqrt();
    let most = |points: &[[f64; 3]]| {
        let all = points.iter().map(|p| V3::from(*p).dot(n));
        all.reduce(Dd::max)
    };
    match spec {
        ShapeSpec::Sphere { radius } => Some(Dd::from(*radius)),
        ShapeSpec::Box { half_extents: h } => {
            Some(x.abs() * Dd::from(h[0]) + y.abs() * Dd::from(h[1]) + z.abs() * Dd::from(h[2]))
        }
        ShapeSpec::Capsule {
            radius,
            half_height,
        } => Some(z.abs() * Dd::from(*half_height) + Dd::from(*radius)),
        ShapeSpec::Cylinder {
            radius,
            half_height,
        } => Some(z.abs() * Dd::from(*half_height) + across() * Dd::from(*radius)),
        ShapeSpec::Cone {
            radius,
            half_height,
        } => {
            let apex = z * Dd::from(*half_height);
            Some(apex.max(across() * Dd::from(*radius) - apex))
        }
        ShapeSpec::Convex { vertices, .. } | ShapeSpec::Trimesh { vertices, .. } => most(vertices),
        ShapeSpec::Triangle { vertices } => most(vertices),
        ShapeSpec::HalfSpace { .. } | ShapeSpec::HeightField { .. } => None,
    }
}

/// Signed distance of a point from a cylinder or cone.
fn profile((spec, place): &At<'_>, point: &V3) -> Option<Dd> {
    let [x, y, z] = place.turned_back(&(*point - place.at)).0;
    let out = (x * x + y * y).sqrt();
    match spec {
        ShapeSpec::Cylinder {
            radius,
            half_height,
        } => Some(corner(
            out - Dd::from(*radius),
            z.abs() - Dd::from(*half_height),
        )),
        ShapeSpec::Cone {
            radius,
            half_height,
        } => {
            let (r, h) = (Dd::from(*radius), Dd::from(*half_height));
            let two = Dd::from(2.0);
            let length = (r * r + two * two * h * h).sqrt();
            let side = (out * two * h + (z - h) * r) / length;
            let base = -h - z;
            let inside = side.max(base);
            if inside <= Dd::ZERO {
                return Some(inside);
            }
            let to_side = segment((out, z), (Dd::ZERO, h), (r, -h));
            let to_base = segment((out, z), (Dd::ZERO, -h), (r, -h));
            Some(to_side.min(to_base))
        }
        _ => None,
    }
}

/// Distance of a point of the plane from a segment.
fn segment(p: (Dd, Dd), from: (Dd, Dd), to: (Dd, Dd)) -> Dd {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (px, py) = (p.0 - from.0, p.1 - from.1);
    let square = dx * dx + dy * dy;
    let t = ((px * dx + py * dy) / square).max(Dd::ZERO);
    let t = t.min(Dd::from(1.0));
    let (x, y) = (px - dx * t, py - dy * t);
    (x * x + y * y).sqrt()
}

/// The gap of two products of sets, from the gaps `u` and `v` of their factors.
fn corner(u: Dd, v: Dd) -> Dd {
    if u > Dd::ZERO && v > Dd::ZERO {
        (u * u + v * v).sqrt()
    } else {
        u.max(v)
    }
}

/// The gap of cylinders and boxes with exactly equal orientations; `None`: for other pairs.
fn upright(a: &At<'_>, b: &At<'_>) -> Option<Dd> {
    if !a.1.turned_as(&b.1) {
        return None;
    }
    let [x, y, z] = a.1.turned_back(&(b.1.at - a.1.at)).0;
    let (lateral, tall) = match (a.0, b.0) {
        (
            ShapeSpec::Cylinder {
                radius: ra,
                half_height: ha,
            },
            ShapeSpec::Cylinder {
                radius: rb,
                half_height: hb,
            },
        ) => {
            let out = (x * x + y * y).sqrt() - Dd::from(*ra) - Dd::from(*rb);
            (out, Dd::from(*ha) + Dd::from(*hb))
        }
        (
            ShapeSpec::Box { half_extents: h },
            ShapeSpec::Cylinder {
                radius,
                half_height,
            },
        )
        | (
            ShapeSpec::Cylinder {
                radius,
                half_height,
            },
            ShapeSpec::Box { half_extents: h },
        ) => {
            let off = corner(x.abs() - Dd::from(h[0]), y.abs() - Dd::from(h[1]));
            (
                off - Dd::from(*radius),
                Dd::from(h[2]) + Dd::from(*half_height),
            )
        }
        _ => return None,
    };
    Some(corner(lateral, z.abs() - tall))
}

/// The gap of two cylinders whose centres lie on the common perpendicular of their axes, if none is lower than wide: no
/// other direction separates them more, because each is thinnest across its axis. `None`: for other pairs.
fn crossed(a: &At<'_>, b: &At<'_>) -> Option<Dd> {
    let size = |spec: &ShapeSpec| match spec {
        ShapeSpec::Cylinder {
            radius,
            half_height,
        } if half_height >= radius => Some(Dd::from(*radius)),
        _ => None,
    };
    let (ra, rb) = (size(a.0)?, size(b.0)?);
    let between = b.1.at - a.1.at;
    let up = V3::from([0.0, 0.0, 1.0]);
    let off = |place: &Place| between.dot(&place.turned(&up)).abs();
    let limit = between.norm() * Dd::from(1e-28);
    (off(&a.1) <= limit && off(&b.1) <= limit).then(|| between.norm() - ra - rb)
}
