//! Random convex pairs against an oracle that shares no code with the queries: support functions derived independently
//! from the shapes' definitions, directions sampled densely and improved by pattern search.
//!
//! For every unit `n`, `f(n) = -(s_A(n) + s_B(-n))` is at most the gap, so a direction with `f` above `gap.max` proves
//! the upper end unsound. The lower end must not exceed `f` of the normal and of every direction found; the closest
//! points must lie in their shapes. Limit of the method: the search can miss the best direction, so it proves intervals
//! wrong, never right; widths are asserted as well.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a test"
)]

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion};
use sweepd::math::{Point, Pose, Quat, Vec3};
use sweepd::narrow::exact::{Closest, Manifold, Warm, convex_gap, manifold};
use sweepd::shape::Convex;

/// The generator `SplitMix64`, seeded.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }
    fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(
                self.range(-1., 1.),
                self.range(-1., 1.),
                self.range(-1., 1.),
            );
            if v.norm() > 0.1 && v.norm() < 1.0 {
                return v.normalize();
            }
        }
    }
    fn rotation(&mut self) -> Quat {
        loop {
            let q = Quaternion::new(
                self.range(-1., 1.),
                self.range(-1., 1.),
                self.range(-1., 1.),
                self.range(-1., 1.),
            );
            if q.norm() > 0.1 && q.norm() < 1.0 {
                return UnitQuaternion::new_normalize(q);
            }
        }
    }
}

/// A shape as the oracle represents it.
#[derive(Clone, Debug)]
enum Solid {
    Sphere(f64),
    Cuboid(Vec3),
    Capsule(f64, f64),
    Cylinder(f64, f64),
    Cone(f64, f64),
    Points(Vec<Vec3>),
    Triangle([Vec3; 3]),
}

impl Solid {
    fn build(&self) -> Convex {
        match self {
            Self::Sphere(r) => Convex::sphere(*r),
            Self::Cuboid(h) => Convex::cuboid(*h),
            Self::Capsule(r, h) => Convex::capsule(*r, *h),
            Self::Cylinder(r, h) => Convex::cylinder(*r, *h),
            Self::Cone(r, h) => Convex::cone(*r, *h),
            Self::Points(p) => {
                let points: Vec<Point> = p.iter().map(|v| Point::from(*v)).collect();
                Convex::hull_of_any(&points).unwrap()
            }
            Self::Triangle(p) => Convex::triangle(p.map(Point::from)),
        }
    }

    /// Support value along unit `n`, from the definition of the shape.
    fn reach(&self, n: &Vec3) -> f64 {
        let off = n.x.hypot(n.y);
        match self {
            Self::Sphere(r) => *r,
            Self::Cuboid(h) => h.x * n.x.abs() + h.y * n.y.abs() + h.z * n.z.abs(),
            Self::Capsule(r, h) => r + h * n.z.abs(),
            Self::Cylinder(r, h) => r * off + h * n.z.abs(),
            Self::Cone(r, h) => (h * n.z).max(r * off - h * n.z),
            Self::Points(p) => p.iter().map(|v| v.dot(n)).fold(f64::NEG_INFINITY, f64::max),
            Self::Triangle(p) => p.iter().map(|v| v.dot(n)).fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn size(&self) -> f64 {
        match self {
            Self::Sphere(r) => *r,
            Self::Cuboid(h) => h.norm(),
            Self::Capsule(r, h) => r + h,
            Self::Cylinder(r, h) | Self::Cone(r, h) => r.hypot(*h),
            Self::Points(p) => p.iter().map(|v| v.norm()).fold(0.0, f64::max),
            Self::Triangle(p) => p.iter().map(|v| v.norm()).fold(0.0, f64::max),
        }
    }

    fn curved(&self) -> bool {
        matches!(self, Self::Cylinder(..) | Self::Cone(..))
    }

    fn scaled(&self, s: f64) -> Self {
        match self {
            Self::Sphere(r) => Self::Sphere(r * s),
            Self::Cuboid(h) => Self::Cuboid(h * s),
            Self::Capsule(r, h) => Self::Capsule(r * s, h * s),
            Self::Cylinder(r, h) => Self::Cylinder(r * s, h * s),
            Self::Cone(r, h) => Self::Cone(r * s, h * s),
            Self::Points(p) => Self::Points(p.iter().map(|v| v * s).collect()),
            Self::Triangle(p) => Self::Triangle(p.map(|v| v * s)),
        }
    }

    /// A random shape of size 0.2 to 1.
    fn random(r: &mut Random) -> Self {
        let kind = r.below(7);
        let mut s = || r.range(0.2, 1.0);
        match kind {
            0 => Self::Sphere(s()),
            1 => Self::Cuboid(Vec3::new(s(), s(), s())),
            2 => Self::Capsule(s(), s()),
            3 => Self::Cylinder(s(), s()),
            4 => Self::Cone(s(), s()),
            5 => {
                let count = 4 + r.below(20);
                let radii = Vec3::new(r.range(0.3, 1.), r.range(0.3, 1.), r.range(0.3, 1.));
                Self::Points(
                    (0..count)
                        .map(|_| {
                            let d = r.direction() * r.range(0.7, 1.0);
                            d.component_mul(&radii)
                        })
                        .collect(),
                )
            }
            _ => Self::Triangle([0; 3].map(|_| r.direction() * r.range(0.2, 1.0))),
        }
    }

    /// A shape with an extent much smaller than another.
    fn thin(r: &mut Random) -> Self {
        let flat = 10.0_f64.powf(r.range(-6.0, -2.0));
        let s = r.range(0.2, 1.0);
        match r.below(6) {
            0 => Self::Cuboid(Vec3::new(1.0, s, flat)),
            1 => Self::Cuboid(Vec3::new(flat, flat, 1.0)),
            2 => Self::Capsule(flat, 1.0),
            3 => Self::Cylinder(1.0, flat),
            4 => Self::Cylinder(flat, 1.0),
            _ => Self::Points(
                (0..10)
                    .map(|_| r.direction().component_mul(&Vec3::new(1.0, s, flat)))
                    .collect(),
            ),
        }
    }
}

/// `f(n)`, with `n` in A's frame.
fn f(a: &Solid, b: &Solid, pos12: &Pose, n: &Vec3) -> f64 {
    let in_b = pos12.rotation.inverse_transform_vector(&-n);
    n.dot(&pos12.translation.vector) - a.reach(n) - b.reach(&in_b)
}

/// The greatest `f` that sampling and pattern search find, and its direction.
fn greatest(a: &Solid, b: &Solid, pos12: &Pose, hint: &Vec3, samples: u32) -> (f64, Vec3) {
    let mut tops: Vec<(f64, Vec3)> = (0..samples)
        .map(|k| {
            // Fibonacci sphere.
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(samples);
            let angle = f64::from(k) * 2.399_963_229_728_653;
            let off = (1.0 - z * z).sqrt();
            Vec3::new(off * angle.cos(), off * angle.sin(), z)
        })
        .chain([*hint])
        .map(|n| (f(a, b, pos12, &n), n))
        .collect();
    tops.sort_by(|x, y| y.0.total_cmp(&x.0));
    tops.truncate(6);
    for top in &mut tops {
        let mut step = 0.1;
        for _ in 0..200 {
            if step < 1e-8 {
                break;
            }
            let u = top
                .1
                .cross(&if top.1.x.abs() < 0.6 {
                    Vec3::x()
                } else {
                    Vec3::y()
                })
                .normalize();
            let v = top.1.cross(&u);
            let mut moved = false;
            for k in 0..8 {
                let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
                let n = (top.1 + (u * angle.cos() + v * angle.sin()) * step).normalize();
                let value = f(a, b, pos12, &n);
                if value > top.0 {
                    *top = (value, n);
                    moved = true;
                }
            }
            if !moved {
                step *= 0.5;
            }
        }
    }
    tops.into_iter().max_by(|x, y| x.0.total_cmp(&y.0)).unwrap()
}

/// A pose of B at which the gap is near `target`.
fn place(r: &mut Random, a: &Solid, b: &Solid, rotation: Quat, target: f64) -> Pose {
    let (ca, cb) = (a.build(), b.build());
    let mut at = r.direction() * (a.size() + b.size()) * r.range(0.0, 1.2);
    for _ in 0..3 {
        let pose = Pose::from_parts(at.into(), rotation);
        let c = convex_gap(&ca, &cb, &pose, &mut Warm::default());
        at += c.normal * (target - c.best_m);
    }
    Pose::from_parts(at.into(), rotation)
}

const CATEGORIES: [&str; 12] = [
    "generic", "near", "shallow", "deep", "parallel", "aspect", "ratio", "tiny", "huge", "same",
    "flat", "coaxial",
];

/// Two solids of revolution, the axis of one inside the other: offset and tilt from zero to a third of the size.
fn coaxial(r: &mut Random) -> (Solid, Solid, Pose) {
    let shape = |r: &mut Random| {
        let (x, y) = (r.range(0.05, 1.0), r.range(0.05, 1.0));
        match r.below(3) {
            0 => Solid::Capsule(x, y),
            1 => Solid::Cylinder(x, y),
            _ => Solid::Cone(x, y),
        }
    };
    let (a, b) = (shape(r), shape(r));
    let part = |r: &mut Random| match r.below(4) {
        0 => 0.0,
        _ => 10.0_f64.powf(r.range(-14.0, -0.5)),
    };
    let (lean, off, way) = (part(r), part(r), r.range(0.0, 6.3));
    let over = std::f64::consts::PI * r.below(2) as f64;
    let rotation = Quat::from_axis_angle(&Vec3::z_axis(), r.range(0.0, 6.3))
        * Quat::from_axis_angle(&Vec3::x_axis(), over + lean);
    let lift = (a.size() + b.size()) * r.range(-0.4, 0.4);
    let at = Vec3::new(off * way.cos(), off * way.sin(), lift);
    (a, b, Pose::from_parts(at.into(), rotation))
}

fn case(r: &mut Random, category: &str) -> (Solid, Solid, Pose) {
    let (mut a, mut b) = (Solid::random(r), Solid::random(r));
    let mut rotation = r.rotation();
    let sign = if r.below(2) == 0 { 1.0 } else { -1.0 };
    let target = match category {
        "generic" => r.range(0.1, 2.0),
        "near" => 10.0_f64.powf(r.range(-9.0, -3.0)),
        "shallow" => -(10.0_f64.powf(r.range(-9.0, -2.0))),
        "deep" => {
            let at = r.direction() * r.range(0.0, 0.3);
            return (a, b, Pose::from_parts(at.into(), rotation));
        }
        "parallel" => {
            let quarter = std::f64::consts::FRAC_PI_2;
            rotation = Quat::from_euler_angles(
                quarter * r.below(4) as f64,
                quarter * r.below(4) as f64,
                quarter * r.below(4) as f64,
            );
            sign * 10.0_f64.powf(r.range(-9.0, -1.0))
        }
        "aspect" => {
            a = Solid::thin(r);
            if r.below(2) == 0 {
                b = Solid::thin(r);
            }
            sign * 10.0_f64.powf(r.range(-7.0, -1.0))
        }
        "ratio" => {
            b = b.scaled(10.0_f64.powf(r.range(2.0, 6.0)));
            sign * 10.0_f64.powf(r.range(-4.0, -1.0))
        }
        "tiny" => {
            let s = 10.0_f64.powf(r.range(-6.0, -4.0));
            (a, b) = (a.scaled(s), b.scaled(s));
            sign * s * 10.0_f64.powf(r.range(-4.0, 0.0))
        }
        "huge" => {
            let s = 10.0_f64.powf(r.range(4.0, 8.0));
            (a, b) = (a.scaled(s), b.scaled(s));
            sign * s * 10.0_f64.powf(r.range(-4.0, 0.0))
        }
        "coaxial" => return coaxial(r),
        "same" => {
            if r.below(2) == 0 {
                b = a.clone();
            }
            if r.below(2) == 0 {
                rotation = Quat::identity();
            }
            return (a, b, Pose::from_parts(Vec3::zeros().into(), rotation));
        }
        _ => {
            a = match r.below(4) {
                0 => Solid::Triangle([Vec3::zeros(), Vec3::x() * 0.5, Vec3::x()]),
                1 => Solid::Triangle([Vec3::new(0.2, 0.1, 0.0); 3]),
                2 => Solid::Points(vec![
                    Vec3::zeros(),
                    Vec3::x(),
                    Vec3::y(),
                    Vec3::new(1., 1., 0.),
                ]),
                _ => Solid::Triangle([Vec3::zeros(), Vec3::x(), Vec3::new(1e-9, 1e-9, 0.0)]),
            };
            sign * 10.0_f64.powf(r.range(-9.0, -1.0))
        }
    };
    let pose = place(r, &a, &b, rotation, target);
    (a, b, pose)
}

#[derive(Default)]
struct Row {
    count: usize,
    widths: Vec<f64>,
    unsound: usize,
    loose: Vec<String>,
    asymmetric: f64,
}

/// Checks one answer; returns its width relative to the size, and the contradiction that the oracle found.
fn check(a: &Solid, b: &Solid, pose: &Pose, c: &Closest, samples: u32) -> (f64, Option<String>) {
    let size = a.size().max(b.size());
    let width = c.gap.width() / size;
    assert!((c.normal.norm() - 1.0).abs() < 1e-12);
    assert!(c.gap.contains(c.best_m));
    let (top, n) = greatest(a, b, pose, &c.normal, samples);
    let noise = 1e-15 * (size + pose.translation.vector.norm());
    if top > c.gap.max + noise {
        return (
            width,
            Some(format!("f({n:?}) = {top:e} above {:e}", c.gap.max)),
        );
    }
    // The lower end must be supported by the answer's own normal.
    let own = f(a, b, pose, &c.normal);
    if c.gap.min > own.max(top) + noise {
        return (
            width,
            Some(format!("gap.min {:e} above every f {top:e}", c.gap.min)),
        );
    }
    // Both points must lie in their shapes, below every support plane.
    let within = 1e-6 * (size + pose.translation.vector.norm());
    for k in 0..64 {
        let (x, y) = (f64::from(k) * 2.4, f64::from(k) / 32.0 - 1.0 + 1.0 / 64.0);
        let off = (1.0 - y * y).sqrt();
        let n = Vec3::new(off * x.cos(), off * x.sin(), y);
        let (in_a, in_b) = (n.dot(&c.point_a.coords), pose.inverse() * c.point_b);
        if in_a > a.reach(&n) + within || n.dot(&in_b.coords) > b.reach(&n) + within {
            return (
                width,
                Some(format!("a closest point outside its shape along {n:?}")),
            );
        }
    }
    (width, None)
}

fn run(seed: u64, per_category: usize, samples: u32) -> BTreeMap<&'static str, Row> {
    let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
    for (k, category) in (0_u64..).zip(CATEGORIES) {
        let mut r = Random(seed * 1000 + k);
        let row = rows.entry(category).or_default();
        for number in 0..per_category {
            let (a, b, pose) = case(&mut r, category);
            let (ca, cb) = (a.build(), b.build());
            let c = convex_gap(&ca, &cb, &pose, &mut Warm::default());
            let (width, wrong) = check(&a, &b, &pose, &c, samples);
            row.count += 1;
            row.widths.push(width);
            if let Some(wrong) = wrong {
                row.unsound += 1;
                println!("{category} {number}: {wrong}\n  {a:?}\n  {b:?}\n  {pose:?}\n  {c:?}");
            }
            let wanted = if a.curved() || b.curved() { 1e-6 } else { 1e-8 };
            if width > wanted {
                row.loose
                    .push(format!("{number}: {width:.1e} {a:?} {b:?} {:e}", c.best_m));
            }
            let back = convex_gap(&cb, &ca, &pose.inverse(), &mut Warm::default());
            let size = a.size().max(b.size());
            row.asymmetric = row.asymmetric.max((back.best_m - c.best_m).abs() / size);
            let mut m = Manifold::default();
            manifold(&ca, &cb, &pose, &c, 0.02 * size, &mut m);
            for p in m.points() {
                let off = p.point_b - p.point_a - c.normal * p.gap_m;
                assert!(
                    off.norm() <= 1e-9 * (size + pose.translation.vector.norm()),
                    "{a:?} {b:?} {pose:?} {p:?} {c:?}"
                );
                assert!(
                    p.gap_m >= c.gap.min - 1e-6 * size,
                    "{a:?} {b:?} {p:?} {c:?}"
                );
            }
            if c.best_m <= 0.02 * size {
                assert!(!m.is_empty() && m.len() <= 4);
            }
            let mut names: Vec<u32> = m.points().map(|p| p.feature).collect();
            names.dedup();
            assert_eq!(names.len(), m.len(), "{a:?} {b:?} {pose:?} {m:?}");
        }
    }
    rows
}

fn show(rows: &BTreeMap<&str, Row>) {
    println!("category   n  unsound loose  width p50  p95      p99      max      swap");
    for (name, row) in rows {
        let mut w = row.widths.clone();
        w.sort_by(f64::total_cmp);
        let q = |q: f64| w[((w.len() as f64 * q) as usize).min(w.len() - 1)];
        println!(
            "{name:8} {:5} {:5} {:5}  {:.1e}  {:.1e}  {:.1e}  {:.1e}  {:.1e}",
            row.count,
            row.unsound,
            row.loose.len(),
            q(0.5),
            q(0.95),
            q(0.99),
            q(1.0),
            row.asymmetric
        );
        for line in row.loose.iter().take(4) {
            println!("   {line}");
        }
    }
}

#[test]
fn no_direction_contradicts_an_interval_and_intervals_are_narrow() {
    let rows = run(1, 60, 300);
    show(&rows);
    for (name, row) in &rows {
        assert_eq!(row.unsound, 0, "{name}");
        assert!(row.loose.len() * 20 <= row.count, "{name}: {:?}", row.loose);
    }
}

/// Two grazing shapes: gaps from -1e-2 to 1e-2, half of the pairs aligned with axes or nearly so.
fn grazing(r: &mut Random) -> (Solid, Solid, Pose) {
    let shape = |r: &mut Random| loop {
        let solid = Solid::random(r);
        if !matches!(solid, Solid::Sphere(_) | Solid::Triangle(_)) {
            return solid;
        }
    };
    let (a, b) = (shape(r), shape(r));
    let rotation = match r.below(4) {
        0 => {
            let quarter = std::f64::consts::FRAC_PI_2;
            Quat::from_euler_angles(
                quarter * r.below(4) as f64,
                quarter * r.below(4) as f64,
                r.range(-3.0, 3.0),
            )
        }
        1 => {
            let lean = 10.0_f64.powf(r.range(-9.0, -1.0));
            Quat::from_euler_angles(lean, 0.0, r.range(-3.0, 3.0))
        }
        _ => r.rotation(),
    };
    let sign = if r.below(3) == 0 { 1.0 } else { -1.0 };
    let target = sign * 10.0_f64.powf(r.range(-7.0, -2.0));
    let pose = place(r, &a, &b, rotation, target);
    (a, b, pose)
}

/// Counts the answers to `count` grazing pairs, each cold and warm along a small motion, that are unfinished or
/// contradict each other.
fn unfinished(seed: u64, count: usize) -> usize {
    let mut r = Random(seed);
    let mut bad = 0;
    for number in 0..count {
        let (a, b, pose) = grazing(&mut r);
        let (ca, cb) = (a.build(), b.build());
        let mut warm = Warm::default();
        let (turn, shift) = (r.direction() * 1e-3, r.direction() * 1e-3);
        for step in 0..3 {
            let moved = Pose::from_parts(
                (pose.translation.vector + shift * f64::from(step)).into(),
                Quat::from_scaled_axis(turn * f64::from(step)) * pose.rotation,
            );
            let c = convex_gap(&ca, &cb, &moved, &mut warm);
            let cold = convex_gap(&ca, &cb, &moved, &mut Warm::default());
            let apart = c.gap.min > cold.gap.max || cold.gap.min > c.gap.max;
            if !c.finished || !cold.finished || apart {
                bad += 1;
                println!(
                    "{number} step {step}: {a:?} {b:?} {moved:?}\n  warm {c:?}\n  cold {cold:?}"
                );
            }
        }
    }
    bad
}

#[test]
fn grazing_pairs_are_finished_cold_and_warm_and_both_agree() {
    assert_eq!(unfinished(3, 1500), 0);
}

/// Pairs of every category that move by thousandths of their size: a warm answer must be as sound as a cold one, and
/// within the same limit of width.
#[test]
fn answers_along_a_motion_are_sound_and_agree_with_those_from_nothing() {
    let mut r = Random(41);
    let mut overlaps = 0;
    for category in CATEGORIES {
        for number in 0..60 {
            let (a, b, pose) = case(&mut r, category);
            let (ca, cb) = (a.build(), b.build());
            let mut warm = Warm::default();
            let step_m = 3e-3 * a.size().min(b.size());
            let (turn, shift) = (r.direction() * 3e-3, r.direction() * step_m);
            for step in 0..6 {
                let moved = Pose::from_parts(
                    (pose.translation.vector + shift * f64::from(step)).into(),
                    Quat::from_scaled_axis(turn * f64::from(step)) * pose.rotation,
                );
                let c = convex_gap(&ca, &cb, &moved, &mut warm);
                let cold = convex_gap(&ca, &cb, &moved, &mut Warm::default());
                let what = format!("{category} {number} step {step}: {a:?} {b:?} {moved:?}");
                let (_, wrong) = check(&a, &b, &moved, &c, 60);
                assert!(wrong.is_none(), "{what}: {wrong:?}");
                assert!(
                    c.gap.min <= cold.gap.max && cold.gap.min <= c.gap.max,
                    "{what}\n  warm {c:?}\n  cold {cold:?}"
                );
                assert!(c.finished || !cold.finished, "{what}: not finished");
                overlaps += u32::from(c.gap.max < 0.0);
            }
        }
    }
    assert!(overlaps > 1000, "{overlaps} overlap");
}

#[test]
#[ignore = "large; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn many_grazing_pairs_are_finished() {
    let seed = std::env::var("SEED").map_or(7, |s| s.parse().unwrap());
    let count = std::env::var("COUNT").map_or(100_000, |s| s.parse().unwrap());
    assert_eq!(unfinished(seed, count), 0);
}

#[test]
#[ignore = "large; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn a_large_sweep() {
    let seed = std::env::var("SEED").map_or(7, |s| s.parse().unwrap());
    let count = std::env::var("COUNT").map_or(2000, |s| s.parse().unwrap());
    let rows = run(seed, count, 600);
    show(&rows);
    assert!(rows.values().all(|row| row.unsound == 0));
}

/// A shape whose extents along the world axes are short decimals, a rotation that maps axes to axes, and the rotated
/// extents.
fn upright(r: &mut Random) -> (Solid, Quat, Vec3) {
    let lengths = [0.05, 0.1, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0];
    let mut length = || lengths[r.below(8) as usize];
    let half = Vec3::new(length(), length(), length());
    let solid = match r.below(5) {
        0 => Solid::Cuboid(half),
        1 => {
            let corner =
                |k: u32| [0, 1, 2].map(|i| if k >> i & 1 == 0 { -half[i] } else { half[i] });
            Solid::Points((0..8).map(|k| corner(k).into()).collect())
        }
        2 => Solid::Cylinder(half.x, half.z),
        3 => Solid::Cone(half.x, half.z),
        _ => Solid::Capsule(half.x, half.z),
    };
    let half = match &solid {
        Solid::Capsule(r, h) => Vec3::new(*r, *r, r + h),
        Solid::Cylinder(r, h) | Solid::Cone(r, h) => Vec3::new(*r, *r, *h),
        _ => half,
    };
    // Quarter turns about axes and third turns about diagonals: the entries of the matrices are 0 and 1 except for
    // rounding.
    let turns = [
        [1., 0., 0., 0.],
        [1., 0., 0., 1.],
        [1., 0., 1., 0.],
        [1., 1., 0., 0.],
        [1., 1., 1., 1.],
        [1., 1., 1., -1.],
        [1., -1., 1., 1.],
        [0., 1., 1., 0.],
    ];
    let [w, i, j, k] = turns[r.below(8) as usize];
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
    let reach = turn
        .to_rotation_matrix()
        .matrix()
        .map(|x: f64| x.abs().round())
        * half;
    (solid, turn, reach)
}

/// Bodies that stand on a table, in contact exactly to the last bit of a decimal, are the most common contact.
#[test]
fn bug_what_touched_to_the_last_bit_was_left_undecided() {
    let mut r = Random(17);
    let mut faces = 0;
    for number in 0..8_000 {
        let ((a, turn_a, reach_a), (b, turn_b, reach_b)) = (upright(&mut r), upright(&mut r));
        let side = r.below(3) as usize;
        let mut at = Vec3::from_fn(|_, _| [0.0, 0.0, 0.05, 0.1][r.below(4) as usize]);
        at[side] = (reach_a[side] + reach_b[side]) * if r.below(2) == 0 { 1.0 } else { -1.0 };
        let pose_a = Pose::from_parts(Vec3::zeros().into(), turn_a);
        let pose = pose_a.inverse() * Pose::from_parts(at.into(), turn_b);
        let c = convex_gap(&a.build(), &b.build(), &pose, &mut Warm::default());
        let what = format!("{number}: {a:?} {b:?} {pose:?} {c:?}");
        assert!(c.finished, "{what}");
        let (_, wrong) = check(&a, &b, &pose, &c, 12);
        assert_eq!(wrong, None, "{what}");
        // The axis proves that the overlap is no deeper; cones and round sides may be apart along other directions.
        let size = a.size() + b.size();
        assert!(c.gap.max >= -1e-12 * size, "{what}");
        let flat = |of: &Solid| matches!(of, Solid::Cuboid(_) | Solid::Points(_));
        if flat(&a) && flat(&b) && (0..3).all(|k| at[k].abs() < reach_a[k] + reach_b[k] + 1e-9) {
            assert!(c.collides() && c.gap.max < 1e-12 * size, "{what}");
            faces += 1;
        }
    }
    assert!(faces > 800, "{faces} touch by faces");
}

#[test]
fn bug_closest_points_on_parallel_features_lay_outside_their_shapes() {
    let pose = |q: [f64; 4], t: [f64; 3]| {
        let [i, j, k, w] = q;
        let turn = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
        Pose::from_parts(Vec3::from(t).into(), turn)
    };
    let cases = [
        (
            Solid::Cylinder(0.469_802_238_350_990_5, 0.553_721_200_655_409_8),
            Solid::Cone(0.834_541_596_697_042_2, 0.325_151_091_231_791_87),
            pose(
                [
                    -0.5,
                    -0.499_999_999_999_999_83,
                    -0.500_000_000_000_000_1,
                    0.499_999_999_999_999_94,
                ],
                [
                    0.042_312_815_293_093_16,
                    0.794_948_467_477_500_9,
                    -0.072_995_115_208_081_23,
                ],
            ),
        ),
        (
            Solid::Cuboid(Vec3::new(
                0.773_166_278_047_005_4,
                0.234_334_301_963_534_3,
                0.964_023_485_539_479_3,
            )),
            Solid::Cone(0.877_028_457_543_626, 0.527_047_192_124_946_7),
            Pose::identity(),
        ),
        (
            Solid::Cuboid(Vec3::new(
                0.778_846_028_578_467_3,
                0.916_723_254_212_308,
                0.995_606_298_120_862_9,
            )),
            Solid::Cuboid(Vec3::new(
                0.690_094_279_214_548_6,
                0.896_815_424_136_219_4,
                0.224_966_950_070_441_12,
            )),
            pose(
                [
                    -6.123_233_995_736_766e-17,
                    6.123_233_995_736_766e-17,
                    -6.123_233_995_736_766e-17,
                    1.0,
                ],
                [
                    0.148_581_558_652_011_53,
                    0.535_394_349_195_672_7,
                    -1.220_573_238_656_451_8,
                ],
            ),
        ),
    ];
    for (a, b, pose) in cases {
        let c = convex_gap(&a.build(), &b.build(), &pose, &mut Warm::default());
        let (_, wrong) = check(&a, &b, &pose, &c, 300);
        assert_eq!(wrong, None, "{a:?} {b:?} {c:?}");
    }
}

/// Boxes and the hulls of their corners must agree.
#[test]
fn bug_overlapping_boxes_nearly_in_line_had_an_interval_ten_times_too_wide() {
    let corners = |half: &Vec3| {
        let cells =
            (0..8_u32).map(|k| Vec3::from_fn(|axis, _| f64::from(k >> axis & 1) * 2.0 - 1.0));
        Solid::Points(cells.map(|side| side.component_mul(half)).collect())
    };
    let (one, other) = (Vec3::new(0.5, 0.4, 0.3), Vec3::new(0.3, 0.5, 0.4));
    let mut r = Random(23);
    for number in 0..4_000 {
        let tilt = 10.0_f64.powf(r.range(-12.0, -3.0));
        let lean = match number % 4 {
            0 => Vec3::new(3.0, 2.0, 1.0).normalize(),
            1 => Vec3::ith(r.below(3) as usize, 1.0),
            _ => r.direction(),
        };
        let mut at = Vec3::new(0.1, 0.05, 0.65);
        if number % 3 > 0 {
            // In these cases two edges are closest, not two faces.
            let depth = r.range(1e-9, 0.1);
            at = Vec3::new(
                r.range(-0.3, 0.3),
                0.9 - depth,
                0.7 - depth * r.range(0.9, 1.1),
            );
        }
        let pose = Pose::from_parts(at.into(), UnitQuaternion::from_scaled_axis(lean * tilt));
        let (a, b) = (Solid::Cuboid(one), Solid::Cuboid(other));
        let boxes = convex_gap(&a.build(), &b.build(), &pose, &mut Warm::default());
        let (hull_a, hull_b) = (corners(&one).build(), corners(&other).build());
        let hulls = convex_gap(&hull_a, &hull_b, &pose, &mut Warm::default());
        let what = format!("{number}, tilt {tilt}: {boxes:?} {hulls:?}");
        assert!(boxes.gap.max - boxes.gap.min < 1e-11, "{what}");
        assert!(boxes.finished && boxes.gap.max >= hulls.gap.min, "{what}");
        assert!(boxes.gap.min <= hulls.gap.max, "{what}");
        let (_, wrong) = check(&a, &b, &pose, &boxes, 12);
        assert_eq!(wrong, None, "{what}");
    }
}

/// A small curved shape close to a large one, at a known gap of a millionth of the large one's size or less. The
/// direction of the gap is perpendicular to a face or side of the large shape, nearly so, or arbitrary.
fn before_large(r: &mut Random) -> (Solid, Solid, Pose, f64) {
    let curved = |r: &mut Random, size: f64| match r.below(3) {
        0 => Solid::Capsule(size * r.range(0.1, 1.0), size),
        1 => Solid::Cylinder(size * r.range(0.1, 1.0), size),
        _ => Solid::Cone(size * r.range(0.1, 1.0), size),
    };
    let large = match r.below(4) {
        0 => Solid::Cuboid(Vec3::new(r.range(1.0, 9.0), r.range(1.0, 9.0), 5.0) * 10.0),
        _ => curved(r, 50.0),
    };
    let size = 10.0_f64.powf(r.range(-4.0, -1.0));
    let small = curved(r, size);
    let lean = match r.below(3) {
        0 => 0.0,
        _ => 10.0_f64.powf(r.range(-8.0, -2.0)),
    };
    let dir = match r.below(3) {
        0 => Vec3::z() + Vec3::x() * lean,
        1 => Vec3::x() + Vec3::z() * lean + Vec3::y() * r.range(-1.0, 1.0),
        _ => r.direction(),
    };
    let normal = dir.normalize();
    let gap_m = 10.0_f64.powf(r.range(-7.5, -4.2));
    let rotation = r.rotation();
    let (a, b) = (large.build(), small.build());
    let on_large = a.support(&normal).coords;
    let inward = rotation.inverse() * -normal;
    let on_small = rotation * b.support(&inward).coords;
    let at = on_large + normal * gap_m - on_small;
    let pose = Pose::from_parts(at.into(), rotation);
    // Both shapes have this support plane, so the gap equals the distance of the two support points.
    let apart_m = f(&large, &small, &pose, &normal);
    assert!(
        (apart_m - gap_m).abs() < 1e-12,
        "{apart_m} {gap_m} {large:?} {small:?}"
    );
    (large, small, pose, gap_m)
}

#[test]
fn bug_a_small_curved_body_apart_from_a_large_one_by_a_millionth_of_its_size_collided() {
    let mut r = Random(31);
    let mut open = Vec::new();
    for _ in 0..20_000 {
        let (a, b, pose, gap_m) = before_large(&mut r);
        let (ca, cb) = (a.build(), b.build());
        for (one, other, pose) in [(&ca, &cb, pose), (&cb, &ca, pose.inverse())] {
            let mut warm = Warm::default();
            let cold = convex_gap(one, other, &pose, &mut warm);
            let again = convex_gap(one, other, &pose, &mut warm);
            for c in [cold, again] {
                assert!(c.gap.min <= gap_m + 1e-12 && c.gap.max >= gap_m - 1e-12);
                if c.gap.min <= 0.0 {
                    open.push((c.gap, gap_m, a.clone(), b.clone()));
                }
            }
        }
    }
    let first = &open[..open.len().min(3)];
    assert!(open.is_empty(), "{} of 80,000: {first:?}", open.len());
}
