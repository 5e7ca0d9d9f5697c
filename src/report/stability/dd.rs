//! Numbers with twice the precision of f64, some 31 digits: a pair of f64, of which the second is the rounding error of
//! the first. Truths are computed in them, and so are more precise than any interval compared with them.
//!
//! In: f64, taken as exact. Out: sums, products, quotients and roots with an error of some 1e-31 of the result, and an
//! absolute one of 1e-300 where products fall below the range of f64.
//!
//! Source: Dekker 1971, A floating-point technique for extending the available precision; Hida, Li, Bailey 2001,
//! Algorithms for quad-double precision arithmetic (the source of the names of sums and products).

use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number: `hi + lo`, with `hi` the f64 nearest to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dd {
    hi: f64,
    lo: f64,
}

/// `a + b`, with its rounding error.
fn two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    let part = hi - a;
    Dd {
        hi,
        lo: (a - (hi - part)) + (b - part),
    }
}

/// The same, if `a` is not the smaller one in magnitude.
fn quick_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    Dd {
        hi,
        lo: b - (hi - a),
    }
}

/// The upper and the lower half of the digits.
fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a;
    let hi = t - (t - a);
    (hi, a - hi)
}

/// `a * b`, with its rounding error.
fn two_product(a: f64, b: f64) -> Dd {
    let hi = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    Dd {
        hi,
        lo: ((ah * bh - hi) + ah * bl + al * bh) + al * bl,
    }
}

impl Dd {
    /// Zero.
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// The nearest f64.
    #[must_use]
    pub fn near(self) -> f64 {
        self.hi
    }

    /// The difference of two f64, exact.
    #[must_use]
    pub fn between(from: f64, to: f64) -> Self {
        two_sum(to, -from)
    }

    /// The square root; 0 if the number is not above 0.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.hi <= 0.0 {
            return Self::ZERO;
        }
        let root = self.hi.sqrt();
        let off = (self - two_product(root, root)).hi;
        quick_sum(root, off / (2.0 * root))
    }

    /// The absolute value.
    #[must_use]
    pub fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// The greater of the two.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        if self < other { other } else { self }
    }

    /// The lesser of the two.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

impl From<f64> for Dd {
    fn from(value: f64) -> Self {
        Self { hi: value, lo: 0.0 }
    }
}

impl Add for Dd {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.hi, other.hi), two_sum(self.lo, other.lo));
        let s = quick_sum(s.hi, s.lo + t.hi);
        quick_sum(s.hi, s.lo + t.lo)
    }
}

impl Neg for Dd {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Sub for Dd {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Dd {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = two_product(self.hi, other.hi);
        quick_sum(p.hi, p.lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

impl Div for Dd {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let left = self - other * Self::from(first);
        let second = left.hi / other.hi;
        let left = left - other * Self::from(second);
        quick_sum(first, second) + Self::from(left.hi / other.hi)
    }
}

impl PartialOrd for Dd {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.hi.partial_cmp(&other.hi) {
            Some(Ordering::Equal) => self.lo.partial_cmp(&other.lo),
            order => order,
        }
    }
}

/// A vector of such numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V3(pub [Dd; 3]);

impl V3 {
    /// A vector of f64, taken as exact.
    #[must_use]
    pub fn from(v: [f64; 3]) -> Self {
        Self(v.map(Dd::from))
    }

    /// The scalar product.
    #[must_use]
    pub fn dot(&self, other: &Self) -> Dd {
        let [x, y, z] = self.0;
        let [u, v, w] = other.0;
        x * u + y * v + z * w
    }

    /// The vector product.
    #[must_use]
    pub fn cross(&self, other: &Self) -> Self {
        let [x, y, z] = self.0;
        let [u, v, w] = other.0;
        Self([y * w - z * v, z * u - x * w, x * v - y * u])
    }

    /// The length.
    #[must_use]
    pub fn norm(&self) -> Dd {
        self.dot(self).sqrt()
    }

    /// The product with a number.
    #[must_use]
    pub fn scaled(&self, by: Dd) -> Self {
        Self(self.0.map(|x| x * by))
    }

    /// The unit vector; `None`: the length is 0 or not finite.
    #[must_use]
    pub fn unit(&self) -> Option<Self> {
        // Scaled first, so that no square falls below the range of f64.
        let largest = self.0.iter().fold(Dd::ZERO, |most, x| most.max(x.abs()));
        if !(largest.near() > 0.0 && largest.near().is_finite()) {
            return None;
        }
        // By a power of two, which is exact and keeps the quotients within the range.
        let by = Dd::from(2.0_f64.powi(-exponent(largest.near())));
        let scaled = self.scaled(by);
        let length = scaled.norm();
        Some(Self(scaled.0.map(|x| x / length)))
    }
}

/// Exponent of the greatest power of two that is not above a positive number, clamped so that its inverse is finite.
fn exponent(x: f64) -> i32 {
    #[allow(clippy::cast_possible_truncation, reason = "at most 1100")]
    let power = x.log2().floor() as i32;
    power.clamp(-1000, 1000)
}

impl Add for V3 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let ([x, y, z], [u, v, w]) = (self.0, other.0);
        Self([x + u, y + v, z + w])
    }
}

impl Sub for V3 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        let ([x, y, z], [u, v, w]) = (self.0, other.0);
        Self([x - u, y - v, z - w])
    }
}

/// A pose: the position of a body's frame relative to a nearby origin, and its orientation.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Position of the frame's origin.
    pub at: V3,
    /// x, y, z, w, of any length but 0.
    turn: [Dd; 4],
}

impl Place {
    /// A pose relative to `origin`; the difference of the two positions is exact.
    ///
    /// * `xyzw` - of any length but 0, as a sender writes it before it is normalised.
    #[must_use]
    pub fn new(position: [f64; 3], xyzw: [f64; 4], origin: [f64; 3]) -> Self {
        let [x, y, z] = [0, 1, 2].map(|k| Dd::between(origin[k], position[k]));
        Self {
            at: V3([x, y, z]),
            turn: xyzw.map(Dd::from),
        }
    }

    /// Rotates a direction from the body's frame.
    #[must_use]
    pub fn turned(&self, v: &V3) -> V3 {
        self.with_axis(v, false)
    }

    /// Rotates a direction into the body's frame.
    #[must_use]
    pub fn turned_back(&self, v: &V3) -> V3 {
        self.with_axis(v, true)
    }

    /// Maps a point from the body's frame.
    #[must_use]
    pub fn point(&self, p: &V3) -> V3 {
        self.turned(p) + self.at
    }

    /// `v + 2 q x (q x v + w v) / |q|^2`.
    fn with_axis(&self, v: &V3, back: bool) -> V3 {
        let [x, y, z, w] = self.turn;
        let w = if back { -w } else { w };
        let q = V3([x, y, z]);
        let square = q.dot(&q) + w * w;
        let inner = q.cross(v) + v.scaled(w);
        *v + q.cross(&inner).scaled(Dd::from(2.0) / square)
    }

    /// Whether another pose has exactly the same quaternion.
    #[must_use]
    pub fn turned_as(&self, other: &Self) -> bool {
        self.turn == other.turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_products_quotients_and_roots_keep_what_f64_rounds_off() {
        let third = Dd::from(1.0) / Dd::from(3.0);
        let left = third * Dd::from(3.0) - Dd::from(1.0);
        assert!(left.near().abs() < 1e-31, "{left:?}");
        let two = Dd::from(2.0);
        let off = two.sqrt() * two.sqrt() - two;
        assert!(off.near().abs() < 1e-30, "{off:?}");
        let sum = Dd::from(1e16) + Dd::from(1.0) - Dd::from(1e16);
        assert_eq!(sum, Dd::from(1.0));
        assert!(Dd::from(1.0) + Dd::from(1e-25) > Dd::from(1.0));
    }

    #[test]
    fn a_quarter_turn_turns_and_is_undone_whatever_the_length_of_its_quaternion() {
        let s = 0.5_f64.sqrt();
        for length in [1.0, 0.99, 3.0] {
            let xyzw = [0.0, 0.0, s * length, s * length];
            let place = Place::new([0.0; 3], xyzw, [0.0; 3]);
            let turned = place.turned(&V3::from([1.0, 2.0, 3.0]));
            let off = turned - V3::from([-2.0, 1.0, 3.0]);
            assert!(off.norm().near() < 1e-30, "{turned:?}");
            let back = place.turned_back(&turned) - V3::from([1.0, 2.0, 3.0]);
            assert!(back.norm().near() < 1e-30);
        }
    }

    #[test]
    fn directions_have_length_1_however_short_they_were() {
        for scale in [1e-300, 1e-10, 1.0, 1e200] {
            let unit = V3::from([3.0 * scale, 0.0, 4.0 * scale]).unit().unwrap();
            assert!((unit.norm() - Dd::from(1.0)).near().abs() < 1e-30);
            assert!((unit.0[0] - Dd::from(3.0) / Dd::from(5.0)).near().abs() < 1e-15);
        }
        assert!(V3::from([0.0; 3]).unit().is_none());
    }
}
