//! Exact signs: on which side of a line or a plane a point lies, for the given f64 coordinates.
//!
//! In: points. Out: the sign of a determinant, never wrong if coordinates are 0 or at least 1e-75 in size, so that no
//! product underflows: a filter decides nearly always, expansions decide the rest.
//!
//! Source: Shewchuk 1997, Adaptive precision floating-point arithmetic and fast robust geometric predicates.

use std::cmp::Ordering;

use crate::math::{Point, ROUND};

/// Most parts of the determinant of three exact differences: 3 products of a 16-part minor with a 2-part difference,
/// each at most 64 parts.
const PARTS_MAX: usize = 192;

/// A sum of f64 that do not overlap, least first: an exact number.
struct Expansion {
    parts: [f64; PARTS_MAX],
    len: usize,
}

impl Expansion {
    fn zero() -> Self {
        Self {
            parts: [0.0; PARTS_MAX],
            len: 0,
        }
    }

    /// `a - b`, exactly.
    fn difference(a: f64, b: f64) -> Self {
        let mut all = Self::zero();
        all.grow(a);
        all.grow(-b);
        all
    }

    /// Adds one number; zero parts are left out, so that short inputs stay short.
    fn grow(&mut self, x: f64) {
        let mut carry = x;
        let mut kept = 0;
        for i in 0..self.len {
            let (sum, rest) = two_sum(carry, self.parts[i]);
            carry = sum;
            if rest != 0.0 {
                self.parts[kept] = rest;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.parts[kept] = carry;
            kept += 1;
        }
        self.len = kept;
    }

    /// Adds `sign * a * b`.
    fn add_product(&mut self, a: &Self, b: &Self, sign: f64) {
        for &x in &a.parts[..a.len] {
            for &y in &b.parts[..b.len] {
                let (high, low) = two_product(sign * x, y);
                self.grow(low);
                self.grow(high);
            }
        }
    }

    fn sign(&self) -> Ordering {
        // The last part exceeds all others together.
        let top = if self.len == 0 {
            0.0
        } else {
            self.parts[self.len - 1]
        };
        sign_of(top)
    }
}

fn sign_of(x: f64) -> Ordering {
    x.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

/// `a + b` as a rounded sum and its exact error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (sum, (a - a_part) + (b - b_part))
}

/// `a * b` as a rounded product and its exact error (Dekker; no fused operation, see the house rules).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, rest)
}

fn split(a: f64) -> (f64, f64) {
    // 2^27 + 1 splits 53 bits into two halves whose products are exact.
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// The sign of the turn a, b, c in the plane of coordinates y and z: `Greater` when counter-clockwise seen from +x.
pub(crate) fn turn_yz(a: &Point, b: &Point, c: &Point) -> Ordering {
    let left = (b.y - a.y) * (c.z - a.z);
    let right = (b.z - a.z) * (c.y - a.y);
    let det = left - right;
    // (3 + 16 u) u of the source; both products share the rounding of their differences.
    if det.abs() > 3.5 * ROUND * (left.abs() + right.abs()) {
        return sign_of(det);
    }
    let mut exact = Expansion::zero();
    let (by, cz) = (
        Expansion::difference(b.y, a.y),
        Expansion::difference(c.z, a.z),
    );
    let (bz, cy) = (
        Expansion::difference(b.z, a.z),
        Expansion::difference(c.y, a.y),
    );
    exact.add_product(&by, &cz, 1.0);
    exact.add_product(&bz, &cy, -1.0);
    exact.sign()
}

/// On which side of the plane a, b, c the point d lies: `Greater` on the side of `(b - a) x (c - a)`.
pub(crate) fn side(a: &Point, b: &Point, c: &Point, d: &Point) -> Ordering {
    let (u, v, w) = (b - a, c - a, d - a);
    let (xy, yx) = (u.x * v.y, u.y * v.x);
    let (yz, zy) = (u.y * v.z, u.z * v.y);
    let (zx, xz) = (u.z * v.x, u.x * v.z);
    let det = (yz - zy) * w.x + (zx - xz) * w.y + (xy - yx) * w.z;
    let permanent = (yz.abs() + zy.abs()) * w.x.abs()
        + (zx.abs() + xz.abs()) * w.y.abs()
        + (xy.abs() + yx.abs()) * w.z.abs();
    // (7 + 56 u) u of the source.
    if det.abs() > 7.5 * ROUND * permanent {
        return sign_of(det);
    }
    side_exact(a, b, c, d)
}

/// Whether a point lies on a triangle, its border included; the triangle may be flat.
pub(super) fn is_on(triangle: &[Point; 3], p: &Point) -> bool {
    let [a, b, c] = triangle;
    let within = |k: usize| {
        let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
        low <= p[k] && p[k] <= high
    };
    // Coplanar with it, and seen along no axis on both sides of its edges.
    let seen_on = |k: usize| {
        let turned = |q: &Point| Point::new(q[k], q[(k + 1) % 3], q[(k + 2) % 3]);
        let ([a, b, c], p) = ([a, b, c].map(turned), turned(p));
        let turns = [
            turn_yz(&a, &b, &p),
            turn_yz(&b, &c, &p),
            turn_yz(&c, &a, &p),
        ];
        !(turns.contains(&Ordering::Less) && turns.contains(&Ordering::Greater))
    };
    (0..3).all(within) && side(a, b, c, p).is_eq() && (0..3).all(seen_on)
}

#[cold]
fn side_exact(a: &Point, b: &Point, c: &Point, d: &Point) -> Ordering {
    let difference = |p: &Point, k: usize| Expansion::difference(p[k], a[k]);
    let mut total = Expansion::zero();
    for k in 0..3 {
        let (l, m) = ((k + 1) % 3, (k + 2) % 3);
        let mut minor = Expansion::zero();
        minor.add_product(&difference(b, l), &difference(c, m), 1.0);
        minor.add_product(&difference(b, m), &difference(c, l), -1.0);
        total.add_product(&minor, &difference(d, k), 1.0);
    }
    total.sign()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_one_ulp_off_a_plane_is_seen_on_its_side() {
        let (a, b, c) = (
            Point::new(0.1, 0.1, 0.1),
            Point::new(0.7, 0.3, 0.1),
            Point::new(0.2, 0.9, 0.1),
        );
        let on = Point::new(12.0, 12.0, 0.1);
        assert_eq!(side(&a, &b, &c, &on), Ordering::Equal);
        let above = Point::new(12.0, 12.0, 0.1_f64.next_up());
        assert_eq!(side(&a, &b, &c, &above), Ordering::Greater);
        let below = Point::new(12.0, 12.0, 0.1_f64.next_down());
        assert_eq!(side(&a, &b, &c, &below), Ordering::Less);
    }

    #[test]
    fn a_point_is_on_a_triangle_or_an_ulp_beside_it() {
        let p = Point::new;
        for k in 0..3 {
            let at = |x: f64, y: f64, z: f64| {
                let all = [x, y, z];
                p(all[k], all[(k + 1) % 3], all[(k + 2) % 3])
            };
            let triangle = [at(0.0, 0.0, 0.5), at(2.0, 0.0, 0.5), at(0.0, 2.0, 0.5)];
            for (x, y) in [(0.0, 0.0), (0.5, 0.0), (1.0, 1.0), (0.1, 0.7), (0.0, 2.0)] {
                assert!(is_on(&triangle, &at(x, y, 0.5)));
                assert!(!is_on(&triangle, &at(x, y, 0.5_f64.next_up())));
            }
            for (x, y) in [(1.0, 1.0_f64.next_up()), (0.5, -1e-300), (2.1, 0.0)] {
                assert!(!is_on(&triangle, &at(x, y, 0.5)));
            }
            let line = [at(0.0, 0.0, 0.0), at(1.0, 1.0, 1.0), at(3.0, 3.0, 3.0)];
            assert!(is_on(&line, &at(2.5, 2.5, 2.5)) && is_on(&line, &at(0.0, 0.0, 0.0)));
            assert!(!is_on(&line, &at(2.5, 2.5, 2.0)) && !is_on(&line, &at(3.5, 3.5, 3.5)));
        }
    }

    #[test]
    fn the_turn_of_three_points_in_line_is_none_and_changes_with_one_ulp() {
        let p = |y: f64, z: f64| Point::new(5.0, y, z);
        let (a, b) = (p(0.5, 0.5), p(12.0, 12.0));
        assert_eq!(turn_yz(&a, &b, &p(24.0, 24.0)), Ordering::Equal);
        assert_eq!(
            turn_yz(&a, &b, &p(24.0, 24.0_f64.next_up())),
            Ordering::Greater
        );
        assert_eq!(
            turn_yz(&b, &a, &p(24.0, 24.0_f64.next_up())),
            Ordering::Less
        );
    }
}
