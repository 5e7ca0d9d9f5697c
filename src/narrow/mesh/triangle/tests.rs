//! Goal: leaves that are apart never touch, and what surely crosses does. Method: seeded triangles, separated by a
//! plane or placed anywhere; each cheap result is compared with the full one.

use super::*;

/// Numbers from a seed, in [-1, 1).
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        f64::from(u32::try_from(state >> 32).unwrap()) / 2_147_483_648.0 - 1.0
    }
}

/// Edges of 0.04 to 0.07 m, 2 to 4 mm apart: a peer in f32 calls such pairs intersecting.
#[test]
fn bug_triangles_a_plane_parts_by_millimetres_never_touch() {
    for seed in 0..20_000 {
        let mut next = numbers(seed);
        let mut vector = |size: f64| Vec3::new(next(), next(), next()) * size;
        let normal = vector(1.0).try_normalize(1e-3).unwrap_or(Vec3::z());
        let apart = 0.002 + 0.002 * vector(1.0).x.abs();
        let mut side = |sign: f64| {
            [(); 3].map(|()| {
                let p = vector(0.035);
                // Beyond the plane by at least half the gap; one corner exactly at it.
                let height = normal.dot(&p).abs().min(0.01);
                Point::from(p - normal * normal.dot(&p) + normal * (sign * (height + apart / 2.0)))
            })
        };
        let (a, b) = (side(-1.0), side(1.0));
        let slop = 1e-16;
        let found = gap(&a, &b, slop, f64::INFINITY).unwrap();
        assert!(
            found.gap.min >= apart * (1.0 - 1e-9),
            "seed {seed}: {found:?} for {apart}"
        );
        assert!(found.gap.width() < 1e-12, "seed {seed}: {found:?}");
        assert!(!surely_crosses(&a, &b, slop), "seed {seed}");
        let proof = gap(&a, &b, slop, 0.0).unwrap_err();
        assert!(proof > 0.0 && proof <= found.gap.max, "seed {seed}");
    }
}

/// Triangles that surely cross overlap; moved apart by that overlap, they do not.
#[test]
fn what_surely_crosses_is_found_crossing() {
    let mut crossed = 0;
    for seed in 0..20_000 {
        let mut next = numbers(seed);
        let mut corners = || [(); 3].map(|()| Point::new(next(), next(), next()));
        let (a, b) = (corners(), corners());
        let found = gap(&a, &b, 1e-15, f64::INFINITY).unwrap();
        if surely_crosses(&a, &b, 1e-15) {
            crossed += 1;
            assert!(found.gap.max <= 0.0, "seed {seed}: {found:?}");
        }
        match gap(&a, &b, 1e-15, 0.0) {
            Ok(touching) => assert_eq!(touching.gap, found.gap, "seed {seed}"),
            Err(apart) => assert!(found.gap.max >= apart, "seed {seed}: {found:?} {apart}"),
        }
    }
    assert!(crossed > 1_000, "{crossed}");
}

/// Corners that are collinear up to rounding give a normal of noise, and with it weights of any point.
#[test]
fn bug_a_face_that_is_flat_by_rounding_reaches_no_farther_than_its_edges() {
    let face = |corners: [[f64; 3]; 3]| corners.map(Point::from);
    let cases = [
        (
            face([[0.0; 3], [0.1, 0.3, 0.0], [0.06, 0.18, 0.0]]),
            face([[0.4, 1.2, 0.0], [-5.5, 2.4, 0.0], [-2.8, 0.4, 0.0]]),
        ),
        (
            face([[0.0; 3], [0.1, 1.1, 0.0], [0.07, 0.77, 0.0]]),
            face([
                [3.0 * 0.1, 3.0 * 1.1, 0.5],
                [0.4, 3.3, 1.0],
                [0.3, 3.4, 1.2],
            ]),
        ),
    ];
    for (flat, other) in cases {
        // The triangle is just its longest edge.
        let line = [flat[0], flat[1], flat[1]];
        let truth = gap(&line, &other, 1e-15, f64::INFINITY).unwrap().gap;
        assert!(truth.width() < 1e-12, "{truth:?}");
        for found in [
            gap(&flat, &other, 1e-15, f64::INFINITY).unwrap(),
            gap(&other, &flat, 1e-15, f64::INFINITY).unwrap(),
        ] {
            let told = found.gap.widened(1e-13);
            assert!(told.contains(truth.min), "{found:?} {truth:?}");
            assert!(found.gap.width() < 1e-12, "{found:?}");
        }
    }
    // And in any direction.
    for seed in 0..20_000 {
        let mut next = numbers(seed);
        let mut vector = || Vec3::new(next(), next(), next());
        let (along, share) = (vector(), vector().x);
        let flat = [0.0, 1.0, share].map(|k| Point::from(along * k));
        let shares = [share.min(0.0), share.max(1.0)];
        let line = [shares[0], shares[1], shares[1]].map(|k| Point::from(along * k));
        let other = [(); 3].map(|()| Point::from(vector() * 3.0));
        let truth = gap(&line, &other, 1e-15, f64::INFINITY).unwrap().gap;
        let found = gap(&flat, &other, 1e-15, f64::INFINITY).unwrap().gap;
        assert!(
            found.max >= truth.min - 1e-13 && found.min <= truth.max + 1e-13,
            "seed {seed}: {found:?} {truth:?}"
        );
    }
}

/// A needle 5 nm wide has a normal that is off by more than a billionth.
#[test]
fn bug_what_is_all_on_one_side_of_a_needle_does_not_surely_cross_it() {
    let needle = [
        [0.0; 3],
        [0.572025131883096, 0.4852362573120345, 0.6613115930360935],
        [
            0.28579295599098065,
            0.24243184046799168,
            0.33040191551755255,
        ],
    ]
    .map(Point::from);
    let other = [
        [0.2857929603454697, 0.2424318358773694, 0.33040191511934264],
        [0.28579295852794606, 0.24243183931214218, 0.3304019141712161],
        [0.2857930057835601, 0.24243175000805015, 0.3304019388225059],
    ]
    .map(Point::from);
    assert!(!crossing(&needle, &other));
    assert!(!surely_crosses(&needle, &other, 0.0));
}

/// For any rounding of the corners: needles of all widths, met near their edges by triangles of all sizes.
#[test]
fn what_surely_crosses_does_so_wherever_rounding_puts_the_corners() {
    let (mut sure, mut crossed) = (0, 0);
    for seed in 0..200_000 {
        let mut next = numbers(seed);
        let mut vector = |size: f64| Vec3::new(next(), next(), next()) * size;
        let exponents = vector(5.0) - Vec3::repeat(5.0);
        let [width, size, near] = [0, 1, 2].map(|k| 10.0_f64.powf(exponents[k]));
        let (along, share) = (vector(1.0), vector(1.0).x);
        let needle = [
            Point::origin(),
            Point::from(along),
            Point::from(along * share + vector(width)),
        ];
        let middle = along * (0.5 * share) + vector(near);
        let other = [(); 3].map(|()| Point::from(middle + vector(size)));
        let slop = near * 1e-3;
        crossed += i32::from(crossing(&needle, &other));
        if surely_crosses(&needle, &other, 0.0) {
            assert!(crossing(&needle, &other), "seed {seed}");
        }
        if surely_crosses(&needle, &other, slop) {
            sure += 1;
            for _ in 0..4 {
                let mut off = |t: &Triangle| t.map(|p| p + vector(1.0).normalize() * slop);
                let moved = (off(&needle), off(&other));
                assert!(crossing(&moved.0, &moved.1), "seed {seed}");
            }
        }
    }
    assert!(crossed > 1_000 && sure > crossed / 4, "{sure} of {crossed}");
}
