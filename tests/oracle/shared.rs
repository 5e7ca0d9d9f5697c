//! Points shared by two sets of triangles, found by testing all pairs.

use super::{Triangle, orient};
use sweepd::math::{Point, Vec3};

fn bounds(t: &Triangle) -> (Point, Point) {
    (t[0].inf(&t[1]).inf(&t[2]), t[0].sup(&t[1]).sup(&t[2]))
}

/// Calls `take` with the ends and the middle of each segment that two triangles share.
pub fn crossings(a: &[Triangle], b: &[Triangle], mut take: impl FnMut(Point)) {
    // Only triangles that reach into the bounding box of the whole other set are tested.
    let all = |of: &[Triangle]| {
        let boxes = of.iter().map(bounds);
        boxes.reduce(|x, y| (x.0.inf(&y.0), x.1.sup(&y.1)))
    };
    let (Some(of_a), Some(of_b)) = (all(a), all(b)) else {
        return;
    };
    let apart =
        |x: &(Point, Point), y: &(Point, Point)| (0..3).any(|k| x.0[k] > y.1[k] || y.0[k] > x.1[k]);
    let b: Vec<&Triangle> = b.iter().filter(|t| !apart(&bounds(t), &of_a)).collect();
    let boxes: Vec<_> = b.iter().map(|t| bounds(t)).collect();
    for s in a.iter().filter(|t| !apart(&bounds(t), &of_b)) {
        let (low, high) = bounds(s);
        for (t, (l, h)) in b.iter().zip(&boxes) {
            if (0..3).any(|k| low[k] > h[k] || l[k] > high[k]) {
                continue;
            }
            let mut ends = Vec::new();
            pierced(s, t, &mut ends);
            pierced(t, s, &mut ends);
            let sum: Vec3 = ends.iter().map(|p| p.coords).sum();
            if !ends.is_empty() {
                #[allow(clippy::cast_precision_loss, reason = "at most six")]
                take(Point::from(sum / ends.len() as f64));
            }
            ends.into_iter().for_each(&mut take);
        }
    }
}

/// Adds the points where edges of `other` pass through `face`; the decision is exact, the position is rounded.
fn pierced(face: &Triangle, other: &Triangle, ends: &mut Vec<Point>) {
    for k in 0..3 {
        let (p, q) = (&other[k], &other[(k + 1) % 3]);
        let (x, y) = (
            orient(&face[0], &face[1], &face[2], p),
            orient(&face[0], &face[1], &face[2], q),
        );
        if x * y > 0.0 || (x == 0.0 && y == 0.0) {
            continue;
        }
        let turns: Vec<f64> = (0..3)
            .map(|i| orient(p, q, &face[i], &face[(i + 1) % 3]))
            .collect();
        if turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0) {
            ends.push(p + (q - p) * (x / (x - y)));
        }
    }
}
