//! Intersections of rays with shapes, by formulas.

use sweepd::math::Vec3;

const FACES: [[usize; 3]; 6] = [
    [0, 2, 1],
    [0, 3, 2],
    [0, 1, 4],
    [1, 2, 4],
    [2, 3, 4],
    [3, 0, 4],
];
const CORNERS: [[f64; 3]; 5] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
];
/// A sheet that is not a solid.
const SHEET: [[f64; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.2], [0.0, 1.0, 0.0]];

/// The shape of each kind, as scene text.
pub(super) fn shape(kind: usize) -> String {
    match kind {
        0 => "{ type = \"sphere\", radius = 0.7 }".to_owned(),
        1 => "{ type = \"box\", half_extents = [0.5, 0.8, 0.3] }".to_owned(),
        2 => "{ type = \"capsule\", radius = 0.3, half_height = 0.6 }".to_owned(),
        3 => "{ type = \"cylinder\", radius = 0.4, half_height = 0.5 }".to_owned(),
        4 => "{ type = \"cone\", radius = 0.6, half_height = 0.5 }".to_owned(),
        5 => format!("{{ type = \"trimesh\", vertices = {CORNERS:?}, faces = {FACES:?} }}"),
        6 => format!("{{ type = \"convex\", vertices = {CORNERS:?} }}"),
        7 => format!("{{ type = \"triangle\", vertices = {SHEET:?} }}"),
        _ => "[{ type = \"sphere\", radius = 0.3, position = [-1, 0, 0] }, { type = \"sphere\", radius = 0.4, position = [1, 0, 0] }]".to_owned(),
    }
}

/// Roots of `a t^2 + 2 b t + c`.
fn roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let disc = b * b - a * c;
    if a == 0.0 || disc < 0.0 {
        return Vec::new();
    }
    let root = disc.sqrt();
    vec![(-b - root) / a, (-b + root) / a]
}

fn of_ball(o: &Vec3, d: &Vec3, at: Vec3, radius: f64) -> Vec<f64> {
    let from = o - at;
    roots(
        d.norm_squared(),
        from.dot(d),
        from.norm_squared() - radius * radius,
    )
}

fn of_triangle(o: &Vec3, d: &Vec3, [a, b, c]: [Vec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(&(c - a));
    let t = (a - o).dot(&normal) / d.dot(&normal);
    let p = o + d * t;
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(p1, p2)| (p2 - p1).cross(&(p - p1)).dot(&normal) >= 0.0);
    inside.then_some(t)
}

/// Whether the ray begins inside, and its intersections with the faces.
fn of_box(o: &Vec3, d: &Vec3, half: Vec3) -> (bool, Vec<f64>) {
    let faces = (0..3).flat_map(|k| [(k, half[k]), (k, -half[k])]);
    let on = |t: f64, but: usize| (0..3).all(|k| k == but || (o + d * t)[k].abs() <= half[k]);
    let met = faces
        .map(|(k, at)| (k, (at - o[k]) / d[k]))
        .filter(|(k, t)| on(*t, *k));
    let is_in = (0..3).all(|k| o[k].abs() < half[k]);
    (is_in, met.map(|(_, t)| t).collect())
}

/// The same for a cone of radius 0.6 at z = -0.5 with its apex at z = 0.5.
fn of_cone(o: &Vec3, d: &Vec3) -> (bool, Vec<f64>) {
    // The radius at height z is k (h - z).
    let (k, h) = (0.6, 0.5);
    let across = |v: &Vec3| (v.x * v.x + v.y * v.y).sqrt();
    let (z, dz) = (k * (h - o.z), -k * d.z);
    let all = roots(
        d.x * d.x + d.y * d.y - dz * dz,
        o.x * d.x + o.y * d.y - z * dz,
        o.x * o.x + o.y * o.y - z * z,
    );
    let on = |t: &f64| (o + d * *t).z.abs() <= h;
    let mut met: Vec<f64> = all.into_iter().filter(on).collect();
    let base = (-h - o.z) / d.z;
    met.extend(Some(base).filter(|t| across(&(o + d * *t)) <= 0.6));
    (across(o) < z && o.z.abs() < h, met)
}

/// First intersection of a ray with a shape, in the shape's frame: the least of all formula results that lie on it.
pub(super) fn truth(kind: usize, o: &Vec3, d: &Vec3) -> Option<f64> {
    let side = |t: f64| o + d * t;
    let across = |v: &Vec3| (v.x * v.x + v.y * v.y).sqrt();
    let caps = |h: f64, r: f64| -> Vec<f64> {
        let at = [h, -h].map(|z| (z - o.z) / d.z);
        at.into_iter().filter(|t| across(&side(*t)) <= r).collect()
    };
    let tube = |r: f64, h: f64| -> Vec<f64> {
        let all = roots(
            d.x * d.x + d.y * d.y,
            o.x * d.x + o.y * d.y,
            o.x * o.x + o.y * o.y - r * r,
        );
        all.into_iter().filter(|t| side(*t).z.abs() <= h).collect()
    };
    let corner = |k: usize| Vec3::from(CORNERS[k]);
    let (is_in, mut met) = match kind {
        0 => (o.norm() < 0.7, of_ball(o, d, Vec3::zeros(), 0.7)),
        1 => of_box(o, d, Vec3::new(0.5, 0.8, 0.3)),
        2 => {
            let mut met = tube(0.3, 0.6);
            met.extend(of_ball(o, d, Vec3::z() * 0.6, 0.3));
            met.extend(of_ball(o, d, Vec3::z() * -0.6, 0.3));
            let near = Vec3::new(0.0, 0.0, o.z.clamp(-0.6, 0.6));
            ((o - near).norm() < 0.3, met)
        }
        3 => {
            let mut met = tube(0.4, 0.5);
            met.extend(caps(0.5, 0.4));
            (across(o) < 0.4 && o.z.abs() < 0.5, met)
        }
        4 => of_cone(o, d),
        5 | 6 => {
            let faces = FACES.map(|face| face.map(corner));
            let met = faces
                .iter()
                .filter_map(|face| of_triangle(o, d, *face))
                .collect();
            let below = |f: &[Vec3; 3]| (o - f[0]).dot(&(f[1] - f[0]).cross(&(f[2] - f[0]))) < 0.0;
            (faces.iter().all(below), met)
        }
        7 => (
            false,
            of_triangle(o, d, SHEET.map(Vec3::from))
                .into_iter()
                .collect(),
        ),
        _ => {
            let mut met = of_ball(o, d, Vec3::x() * -1.0, 0.3);
            met.extend(of_ball(o, d, Vec3::x(), 0.4));
            (
                (o + Vec3::x()).norm() < 0.3 || (o - Vec3::x()).norm() < 0.4,
                met,
            )
        }
    };
    met.retain(|t| *t >= 0.0);
    if is_in {
        return Some(0.0);
    }
    met.into_iter().reduce(f64::min)
}
