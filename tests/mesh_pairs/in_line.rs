//! Solids with coplanar faces: overlaps without any crossing of faces must be distinguished from contacts.

use std::collections::{BTreeMap, BTreeSet};

use crate::oracle::meshes::Soup;
use crate::oracle::rng::Rng;
use crate::support::{convex, shape};
use sweepd::math::{Interval, Point, Pose, Quat, Vec3};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery};
use sweepd::shape::{Convex, Shape};
use sweepd::time::{ManualClock, Meter};

type Cell = [i32; 3];

/// Cubes of side 1 m along a random path in a space of 4 by 4 by 4.
fn cells(rng: &mut Rng) -> BTreeSet<Cell> {
    let mut at = [0; 3].map(|_: i32| [0, 1, 2, 3][rng.below(4)]);
    let mut all = BTreeSet::from([at]);
    for _ in 0..[0, 3, 8, 15][rng.below(4)] {
        let (axis, way) = (rng.below(3), [-1, 1][rng.below(2)]);
        if (0..4).contains(&(at[axis] + way)) {
            at[axis] += way;
        }
        all.insert(at);
    }
    all
}

/// The surface of the cells.
fn solid(cells: &BTreeSet<Cell>) -> Shape {
    let mut places: BTreeMap<Cell, u32> = BTreeMap::new();
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for cell in cells {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut beside = *cell;
                beside[axis] += 2 * side - 1;
                if cells.contains(&beside) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[along, across]| {
                    let mut corner = *cell;
                    corner[axis] += side;
                    corner[u] += along;
                    corner[v] += across;
                    *places.entry(corner).or_insert_with(|| {
                        let [x, y, z] = corner.map(f64::from);
                        vertices.push(Point::new(x, y, z));
                        u32::try_from(vertices.len()).unwrap() - 1
                    })
                });
                let [a, b, c, d] = quad;
                if side == 1 {
                    faces.extend([[a, b, c], [a, c, d]]);
                } else {
                    faces.extend([[a, c, b], [a, d, c]]);
                }
            }
        }
    }
    shape(&Soup::new(vertices, faces), Some(true))
}

/// Upper bound of the overlap of two sets of cells, in the direction of its least width, quarters of a metre; 0: no
/// inside in common.
///
/// * `off` - offset of the other set, quarters of a metre.
fn shared(one: &BTreeSet<Cell>, other: &BTreeSet<Cell>, off: Cell) -> i32 {
    let pair = |a: &Cell, b: &Cell| {
        let by = [0, 1, 2].map(|k| 4 - (4 * (b[k] - a[k]) + off[k]).abs());
        by.into_iter().min().unwrap().max(0)
    };
    let all = one.iter().flat_map(|a| other.iter().map(move |b| (a, b)));
    all.map(|(a, b)| pair(a, b)).max().unwrap()
}

/// The gap, and the units that it took.
fn asked(a: &Shape, b: &Shape, pos12: &Pose) -> (Interval, u64) {
    let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    query.start(&mut store, a, b, pos12);
    while !query.advance(&mut store, (a, b), Goal::Gap, 100, &mut meter) {}
    let gap = query.interval();
    query.release(&mut store);
    (gap, meter.spent())
}

fn gap(a: &Shape, b: &Shape, pos12: &Pose) -> Interval {
    asked(a, b, pos12).0
}

/// The depth of a point is defined in solid meshes only: if one of the two shapes is not one, no second point is tested
/// for it.
#[test]
fn bug_a_box_that_stands_on_a_solid_pays_for_no_points_that_tell_nothing() {
    let floor = solid(&BTreeSet::from([[0, 0, 0]]));
    let units = (1..20).map(|k| {
        let half = 0.03 * f64::from(k);
        let turn = Quat::from_scaled_axis(Vec3::z() * half);
        let stands = Pose::from_parts(Vec3::new(0.5, 0.5, 1.0 + half).into(), turn);
        let (found, units) = asked(&floor, &convex(Convex::cuboid(Vec3::repeat(half))), &stands);
        assert!(found.contains(0.0), "{half} {found:?}");
        units
    });
    let units: Vec<u64> = units.collect();
    // Testing all nine points would cost 8 more units each.
    assert!(units.iter().all(|units| *units <= 12), "{units:?}");
}

#[test]
fn bug_what_overlaps_along_faces_in_line_is_told_from_a_touch() {
    let mut rng = Rng::new(5_000_000);
    let (mut overlaps, mut told_as_touch, mut touches) = (0, 0, 0);
    for case in 0..3_000 {
        let (one, other) = (cells(&mut rng), cells(&mut rng));
        // Along each axis coplanar, or off by one, two or three quarters.
        let off = [0; 3].map(|_: i32| [0, 0, 1, 2, 3][rng.below(5)] + [-4, 0, 4][rng.below(3)]);
        let way = Vec3::from(off.map(f64::from)) / 4.0;
        let found = gap(
            &solid(&one),
            &solid(&other),
            &Pose::from_parts(way.into(), Pose::identity().rotation),
        );
        if shared(&one, &other, off) > 0 {
            overlaps += 1;
            assert!(found.min < -0.2 && found.max < 1e-12, "{case}: {found:?}");
            told_as_touch += usize::from(found.max > 0.0);
        } else {
            touches += usize::from(found.min <= 0.0);
            assert!(found.max >= 0.0, "{case}: {found:?}");
        }
    }
    println!("{told_as_touch} of {overlaps} overlaps are told as touches; {touches} touch");
    assert!(overlaps > 500 && touches > 100, "{overlaps} {touches}");
    assert!(
        300 * told_as_touch <= overlaps,
        "{told_as_touch} of {overlaps}"
    );
}

#[test]
fn bug_a_cube_within_a_row_of_cubes_overlaps_it() {
    let cube = BTreeSet::from([[0, 0, 0]]);
    let frame = [
        [0, 0, 0],
        [0, 0, 1],
        [0, 3, 1],
        [1, 0, 0],
        [1, 0, 1],
        [1, 3, 0],
        [2, 0, 0],
        [2, 0, 1],
        [2, 1, 0],
        [2, 2, 1],
        [2, 3, 0],
        [2, 3, 1],
    ];
    let crowd = [
        [0, 0, 0],
        [0, 0, 2],
        [0, 1, 3],
        [0, 2, 0],
        [0, 2, 3],
        [0, 3, 1],
        [0, 3, 2],
        [1, 0, 1],
        [1, 1, 1],
        [1, 1, 3],
        [1, 2, 1],
        [1, 3, 2],
        [2, 0, 0],
        [2, 0, 1],
        [2, 0, 2],
        [2, 1, 3],
        [2, 2, 2],
        [2, 2, 3],
        [2, 3, 1],
        [2, 3, 2],
        [3, 0, 3],
        [3, 1, 0],
        [3, 1, 1],
        [3, 2, 0],
        [3, 2, 1],
        [3, 2, 2],
        [3, 3, 3],
    ];
    let steps = [
        [0, 0, 0],
        [0, 0, 1],
        [0, 1, 0],
        [0, 1, 2],
        [1, 0, 0],
        [2, 0, 2],
        [2, 1, 0],
        [2, 1, 2],
    ];
    let two = BTreeSet::from([[0, 0, 0], [1, 1, 0]]);
    for (one, other, off) in [
        (BTreeSet::from(frame), &cube, [0, 3, 0]),
        (BTreeSet::from(crowd), &cube, [12, 5, 9]),
        (BTreeSet::from(steps), &two, [8, -1, 11]),
    ] {
        let way = Vec3::from(off.map(f64::from)) / 4.0;
        let (one, other) = (solid(&one), solid(other));
        for (a, b, way) in [(&one, &other, way), (&other, &one, -way)] {
            let found = gap(
                a,
                b,
                &Pose::from_parts(way.into(), Pose::identity().rotation),
            );
            assert!(found.max <= 0.0, "{off:?}: {found:?}");
        }
    }
}
