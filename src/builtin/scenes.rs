//! Scenes made from a count and a seed, as scene-file text: what they are can be read, kept and changed.

use std::fmt::Write as _;

/// A small deterministic generator (splitmix64): the same seed gives the same scene everywhere.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator for a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `0..1`.
    pub fn unit(&mut self) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let bits = (self.bits() >> 11) as f64;
        bits / 9_007_199_254_740_992.0
    }

    /// Uniform in `low..high`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A unit vector.
    #[cfg(test)]
    pub(crate) fn direction(&mut self) -> crate::math::Vec3 {
        loop {
            let mut one = || self.range(-1.0, 1.0);
            let v = crate::math::Vec3::new(one(), one(), one());
            if (0.1..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }

    /// A uniform unit quaternion x, y, z, w (Shoemake 1992, Uniform random rotations).
    pub fn quaternion(&mut self) -> [f64; 4] {
        let (u, v, w) = (self.unit(), self.unit(), self.unit());
        let (s, c) = ((1.0 - u).sqrt(), u.sqrt());
        let tau = std::f64::consts::TAU;
        [
            s * (tau * v).sin(),
            s * (tau * v).cos(),
            c * (tau * w).sin(),
            c * (tau * w).cos(),
        ]
    }
}

/// One mixed convex shape of size about 0.25 to 0.5 m, as an inline table.
fn shape(random: &mut Random, kind: usize) -> String {
    let r = random.range(0.25, 0.5);
    let h = random.range(0.25, 0.5);
    match kind % 6 {
        0 => format!("{{ type = \"sphere\", radius = {r:.6} }}"),
        1 => {
            let d = random.range(0.25, 0.5);
            format!("{{ type = \"box\", half_extents = [{r:.6}, {h:.6}, {d:.6}] }}")
        }
        2 => format!(
            "{{ type = \"capsule\", radius = {:.6}, half_height = {h:.6} }}",
            r / 2.0
        ),
        3 => format!("{{ type = \"cylinder\", radius = {r:.6}, half_height = {h:.6} }}"),
        4 => format!("{{ type = \"cone\", radius = {r:.6}, half_height = {h:.6} }}"),
        _ => {
            let mut vertices = String::new();
            for _ in 0..12 {
                let [x, y, z, _] = random.quaternion();
                let length = (x * x + y * y + z * z).sqrt().max(1e-9);
                let _ = write!(
                    vertices,
                    "[{:.6}, {:.6}, {:.6}], ",
                    r * x / length,
                    h * y / length,
                    r * z / length
                );
            }
            format!("{{ type = \"convex\", vertices = [{vertices}] }}")
        }
    }
}

fn head(source: &str) -> String {
    format!("frame_id = \"world\"\n\n[[source]]\nname = \"{source}\"\ntimeout_ms = 500\n")
}

fn body(name: &str, position: [f64; 3], q: [f64; 4], shape: &str) -> String {
    let [x, y, z] = position;
    format!(
        "\n[[body]]\nname = \"{name}\"\nposition = [{x:.6}, {y:.6}, {z:.6}]\norientation = [{:.9}, {:.9}, {:.9}, {:.9}]\n\
         moves = true\nshape = {shape}\n",
        q[0], q[1], q[2], q[3]
    )
}

/// Mixed convex bodies at random in a cube, half of a body a cubic metre: a gas of solids.
#[must_use]
pub fn pool(count: usize, seed: u64) -> String {
    let mut random = Random::new(seed);
    #[allow(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
    let side = (count as f64 / 0.5).cbrt();
    let mut text = head("feed");
    for at in 0..count {
        let place = [
            random.range(0.0, side),
            random.range(0.0, side),
            random.range(0.0, side),
        ];
        let (q, shape) = (random.quaternion(), shape(&mut random, at));
        text += &body(&format!("body_{at:05}"), place, q, &shape);
    }
    text
}

/// Mixed convex bodies in five layers on a floor half-space.
#[must_use]
pub fn pile(count: usize, seed: u64) -> String {
    let mut random = Random::new(seed);
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small counts"
    )]
    let row = ((count as f64 / 5.0).sqrt().ceil() as usize).max(1);
    let mut text = head("feed");
    text += "\n[[body]]\nname = \"floor\"\nmoves = false\nshape = { type = \"half_space\", normal = [0.0, 0.0, 1.0] }\n";
    for at in 0..count {
        let (layer, place) = (at / (row * row), at % (row * row));
        #[allow(clippy::cast_precision_loss, reason = "small counts")]
        let cell = [(place % row) as f64, (place / row) as f64, layer as f64];
        let jitter = [
            random.range(-0.05, 0.05),
            random.range(-0.05, 0.05),
            random.range(0.0, 0.02),
        ];
        let position = [
            cell[0] * 0.95 + jitter[0],
            cell[1] * 0.95 + jitter[1],
            0.45 + cell[2] * 0.85 + jitter[2],
        ];
        let (q, shape) = (random.quaternion(), shape(&mut random, at));
        text += &body(&format!("body_{at:05}"), position, q, &shape);
    }
    text
}
