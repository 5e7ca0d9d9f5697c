//! A disc seen face on: the best normal is its axis, where Newton's circles have no tangent.
//!
//! In: the elements of an earlier answer and its normal. Out: what Newton would converge to, in closed form, if the
//! normal lies near the axis of a disc and the other core touches the disc inside its rim.

use super::super::pair::{Held, Pair};
use super::Refined;
use super::cap::Cap;
use super::set::Set;
use crate::math::{Vec3, across_z};

/// Cosine of the angle between a normal and an axis up to which the disc is tried.
const NEAR: f64 = 0.995;

/// The local maximum of `f` at the axis of an active disc; `None` if there is none near `normal`.
pub(super) fn face_on(pair: &Pair<'_>, set: &Set, normal: &Vec3) -> Option<Refined> {
    let axis_of_b: Vec3 = pair.rotation.column(2).into_owned();
    set.actives[..set.count].iter().find_map(|x| {
        let of_a = pair.a.core().circle(x.of_a).and_then(|circle| {
            let n = Vec3::z() * circle.z_m.signum();
            touched(pair, normal, &n, true, circle.radius_m)
        });
        of_a.or_else(|| {
            let circle = pair.b.core().circle(x.of_b)?;
            let n = axis_of_b * -circle.z_m.signum();
            touched(pair, normal, &n, false, circle.radius_m)
        })
    })
}

/// The contact with a disc whose face is orthogonal to `n`.
///
/// * `is_a` - whether the disc is A's.
fn touched(pair: &Pair<'_>, normal: &Vec3, n: &Vec3, is_a: bool, radius_m: f64) -> Option<Refined> {
    if normal.dot(n) < NEAR {
        return None;
    }
    let support = pair.support(n);
    let value = n.dot(&support.w);
    // The other core's point, and the opposite one on the disc, in the disc's own frame.
    let (point_a, point_b, seen) = if is_a {
        let point = support.b - n * value;
        (point, support.b, point)
    } else {
        let point = support.a + n * value;
        (support.a, point, pair.to_b(&(point - pair.at)))
    };
    let inside_m = radius_m - across_z(&seen);
    if inside_m.is_nan() || inside_m <= pair.tiny() {
        return None;
    }
    let mut held = Held::default();
    held.push(support.of_a, support.of_b, 1.0);
    Some(Refined {
        normal: *n,
        value,
        point_a,
        point_b,
        held,
        cap: Cap::of_face(-value, inside_m, pair.tiny()),
    })
}
