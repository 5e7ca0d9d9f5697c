//! Surfaces that are not flat: corners, ridges, shelves, triangulated balls, and floors at any orientation.

use std::fmt::Write as _;

use crate::oracle::meshes::{Soup, bumpy_sphere, cuboid, height_field, trimesh};
use crate::oracle::rng::Rng;
use crate::support::{
    FLOOR, area, contacts, degrees, drive, fine_box, kinds, normal, scene, sheet, slab, tiles,
};
use sweepd::math::{Point, Pose, Quat, Vec3};
use sweepd::wire::ContactRow;

const BOX: &str = "{ type = \"box\", half_extents = [0.5, 0.35, 0.25] }";

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

/// Rows whose normal is within 0.05 degrees of a direction.
fn along(rows: &[ContactRow], first: bool, direction: &Vec3) -> Vec<ContactRow> {
    let near = |row: &&ContactRow| degrees(&normal(row, first), direction) <= 0.05;
    rows.iter().filter(near).copied().collect()
}

/// Points, depths and normals as text, one line each.
fn brief(rows: &[ContactRow]) -> String {
    let mut text = String::new();
    for r in rows {
        let _ = writeln!(
            text,
            "{:.4?} {:.2e} {:.3?} triangles {} {}",
            r.point_a, r.gap_m, r.normal, r.triangle_a, r.triangle_b
        );
    }
    text
}

/// A sheet folded up along the line x = 0: floor for x > 0, wall for x < 0.
fn corner(rng: &mut Rng, cells: usize) -> Soup {
    let mut all = sheet(rng, cells, 0.0);
    for v in &mut all.vertices {
        if v.x < 0.0 {
            *v = Point::new(0.0, v.y, -v.x);
        }
    }
    all
}

/// A sheet folded down along x = 0 by 30 degrees on each side: a ridge.
fn ridge(rng: &mut Rng, cells: usize) -> Soup {
    let mut all = sheet(rng, cells, 0.0);
    let slope = 30.0_f64.to_radians().tan();
    for v in &mut all.vertices {
        v.z = -v.x.abs() * slope;
    }
    all
}

#[test]
fn a_body_in_a_corner_has_two_patches_with_both_normals() {
    for (seed, body) in [
        BOX.to_owned(),
        trimesh(&fine_box(Vec3::new(0.5, 0.35, 0.25), 3), None),
    ]
    .iter()
    .flat_map(|body| (0..6).map(move |seed| (seed, body)))
    {
        let first = seed % 2 == 0;
        let floor = trimesh(
            &corner(&mut Rng::new(seed), 10 + 4 * usize::try_from(seed).unwrap()),
            None,
        );
        let mut drive = drive(&scene(&floor, body, first));
        for push in [0.0, 1e-4, 3e-3] {
            let rows = contacts(&mut drive, &at(0.5 - push, 0.123, 0.25 - push));
            let (floor, wall) = (
                along(&rows, first, &Vec3::z()),
                along(&rows, first, &Vec3::x()),
            );
            assert_eq!(floor.len() + wall.len(), rows.len(), "{push} {rows:?}");
            assert_eq!((floor.len(), wall.len()), (4, 4), "{seed} {push} {rows:#?}");
            assert!(area(&floor) > 0.69, "{}", area(&floor));
        }
    }
}

#[test]
fn a_convex_ridge_keeps_its_arc() {
    for seed in 0..6 {
        let first = seed % 2 == 0;
        let floor = trimesh(&ridge(&mut Rng::new(seed), 20), None);
        let mut drive = drive(&scene(&floor, BOX, first));
        for lean_deg in [0.0_f64, 10.0, 25.0, -20.0] {
            for push in [0.0, 1e-3] {
                let turn = Quat::from_scaled_axis(Vec3::y() * lean_deg.to_radians());
                let up = turn * Vec3::z();
                let pose = Pose::from_parts((up * (0.25 - push)).into(), turn);
                let rows = contacts(&mut drive, &pose);
                assert_eq!(rows.len(), 2, "{lean_deg} {push} {rows:#?}");
                assert_eq!(
                    along(&rows, first, &up).len(),
                    2,
                    "{lean_deg} {push} {}",
                    brief(&rows)
                );
                let across = (Vec3::from(rows[0].point_a) - Vec3::from(rows[1].point_a)).norm();
                assert!((across - 0.7).abs() < 1e-6, "{across}");
            }
        }
    }
}

#[test]
fn a_plank_over_two_shelves_has_two_patches() {
    let mut rng = Rng::new(5);
    for solid in [false, true] {
        let mut shelf = |x: f64| {
            let top = sheet(&mut rng, 8, 1.0).scaled(Vec3::new(0.1, 0.3, 1.0));
            let top = if solid { slab(&top, 0.1) } else { top };
            top.moved(Vec3::new(x, 0.0, 0.0))
        };
        let shelves = shelf(-1.5).and(shelf(1.5));
        let plank = "{ type = \"box\", half_extents = [2.0, 0.2, 0.05] }";
        let mut drive = drive(&scene(&trimesh(&shelves, None), plank, true));
        let rows = contacts(&mut drive, &at(0.0, 0.0, 0.0499));
        assert_eq!(along(&rows, true, &Vec3::z()).len(), 8, "{rows:#?}");
        let left = rows.iter().filter(|row| row.point_a[0] < 0.0).count();
        assert_eq!(left, 4);
    }
}

#[test]
fn of_many_small_triangles_the_extremes_are_kept() {
    let mut rng = Rng::new(9);
    let floor = trimesh(&sheet(&mut rng, 120, 1.0), None);
    let mut drive = drive(&scene(&floor, BOX, true));
    for k in 0..10 {
        // Slightly tilted, so that all the deepest points are at one end.
        let turn = Quat::from_euler_angles(0.0, 1e-4, 0.3 * f64::from(k));
        let pose = Pose::from_parts(Vec3::new(0.1, 0.07, 0.249).into(), turn);
        let rows = contacts(&mut drive, &pose);
        assert_eq!(rows.len(), 4);
        assert!(area(&rows) > 0.699, "{}", area(&rows));
    }
}

/// Floors at any orientation, with bodies that lie on them slightly tilted: the normals are those of the floor.
#[test]
fn a_floor_that_stands_askew_is_as_flat() {
    let seeds = if cfg!(debug_assertions) { 40 } else { 400 };
    let worst = (0..seeds).map(tilt_on_askew_floor).fold(0.0, f64::max);
    println!("worst tilt {worst:.2e} degrees");
}

/// At the seams of tiles the climb stopped at a side that was level, because no neighbour was higher than its corner.
#[test]
fn bug_a_climb_over_tiles_ended_at_a_level_side() {
    assert!(tilt_on_askew_floor(337) < 1e-9);
}

/// Ten poses of a random body on a random floor; returns the greatest tilt of a normal, degrees.
fn tilt_on_askew_floor(seed: u64) -> f64 {
    let mut worst = 0.0_f64;
    let mut rng = Rng::new(seed);
    let all = kinds();
    let kind = &all[rng.below(all.len())];
    let frame = Pose::from_parts(rng.vector(5.0).into(), rng.rotation());
    let cells = 3 + rng.below(25);
    let sheet = sheet(&mut rng, cells, 1.0);
    let mut top = match rng.below(3) {
        0 => sheet,
        1 => slab(&sheet, 0.3),
        _ => tiles(&mut rng, cells),
    };
    for v in &mut top.vertices {
        *v = frame * *v;
    }
    let first = rng.below(2) == 0;
    let mut drive = drive(&scene(&trimesh(&top, None), &kind.shape, first));
    let up = frame.rotation * Vec3::z();
    for _ in 0..10 {
        let askew = Quat::from_scaled_axis(rng.vector(0.004));
        let turn = Quat::from_scaled_axis(Vec3::z() * rng.range(0.0, 6.0));
        let push = 10.0_f64.powf(rng.range(-4.0, -2.0)) + 0.003;
        let place = rng.vector(1.5);
        let on = Vec3::new(place.x, place.y, kind.height - push);
        let turn = askew * turn * Quat::from_scaled_axis(kind.lying);
        let rows = contacts(&mut drive, &(frame * Pose::from_parts(on.into(), turn)));
        assert!(
            !rows.is_empty() && rows.len() <= 4,
            "{} {}",
            kind.name,
            rows.len()
        );
        for row in &rows {
            let tilt = degrees(&normal(row, first), &up);
            worst = worst.max(tilt);
            assert!(tilt <= 0.05, "{seed} {}: {tilt} {row:?}", kind.name);
        }
    }
    worst
}

/// A triangulated ball pushed into a flat floor of small triangles: the deepest point is found although its triangles
/// cross none of the floor.
#[test]
fn a_ball_of_triangles_pushed_into_a_floor_has_its_deepest_point() {
    let ball = bumpy_sphere(24, 30, 0.0);
    let lowest = ball.vertices.iter().map(|v| v.z).fold(0.0, f64::min);
    for (seed, cells) in [(1, 12), (2, 60), (3, 150)] {
        let floor = trimesh(&sheet(&mut Rng::new(seed), cells, 1.0), None);
        let first = seed % 2 == 0;
        let mut drive = drive(&scene(&floor, &trimesh(&ball, None), first));
        for push in [1e-3, 1e-2] {
            let rows = contacts(&mut drive, &at(0.11, 0.23, -lowest - push));
            assert_eq!(
                along(&rows, first, &Vec3::z()).len(),
                rows.len(),
                "{}",
                brief(&rows)
            );
            let deepest = rows.iter().map(|row| row.gap_m).fold(0.0, f64::min);
            assert!((deepest + push).abs() < 1e-9, "{deepest} for {push}");
        }
    }
}

/// A long beam on a short one: no corner of one is inside the other, and the manifold is at the crossings of their
/// edges.
#[test]
fn beams_that_cross_share_four_points() {
    let (along_x, along_y) = (Vec3::new(2.0, 0.3, 0.1), Vec3::new(0.2, 2.0, 0.1));
    for cells in [1, 4] {
        let (one, other) = (fine_box(along_x, cells), fine_box(along_y, cells));
        for first in [true, false] {
            let mut drive = drive(&scene(&trimesh(&one, None), &trimesh(&other, None), first));
            for push in [0.0, 1e-3] {
                let rows = contacts(&mut drive, &at(0.05, 0.02, 0.2 - push));
                assert_eq!(
                    along(&rows, first, &Vec3::z()).len(),
                    4,
                    "{cells} {push} {}",
                    brief(&rows)
                );
                assert!((area(&rows) - 0.24).abs() < 1e-6, "{}", area(&rows));
            }
        }
    }
}

/// On rough ground the exact manifold is unknown: points lie on both surfaces, few per patch, and normals point out.
#[test]
fn on_rough_ground_points_lie_on_both_and_normals_lead_out() {
    let mut counts = [0_usize; 3];
    for seed in 0..20 {
        let mut rng = Rng::new(seed);
        let ground = height_field(&mut rng, 12, 1.0).scaled(Vec3::new(3.0, 3.0, 0.3));
        let all = kinds();
        let kind = &all[rng.below(all.len())];
        let mut drive = drive(&scene(&trimesh(&ground, None), &kind.shape, true));
        let mut height = 2.0;
        // Lowers the body until it touches, and a little further.
        while contacts(&mut drive, &at(0.1, 0.1, height)).is_empty() && height > -3.0 {
            height -= 0.01;
        }
        let rows = contacts(&mut drive, &at(0.1, 0.1, height - 0.005));
        assert!(!rows.is_empty(), "{} {seed}", kind.name);
        counts[0] += rows.len();
        for row in &rows {
            let normal = normal(row, true);
            let across = Vec3::from(row.point_b) - Vec3::from(row.point_a);
            counts[1] += usize::from(normal.z > 0.3);
            assert!((across - normal * row.gap_m).norm() < 1e-6, "{row:?}");
            counts[2] += usize::from(row.gap_m > -0.05);
        }
    }
    println!(
        "{} rows, {} lead up, {} shallow",
        counts[0], counts[1], counts[2]
    );
    assert!(
        counts[1] == counts[0] && counts[2] == counts[0],
        "{counts:?}"
    );
}

/// Bodies that hang over the rim of a floor: the normal is the floor's as long as more than the depth lies on it.
#[test]
fn over_the_rim_of_a_floor_the_normal_is_the_floors() {
    let mut text = String::new();
    for seed in 0..12 {
        let mut rng = Rng::new(seed);
        let top = sheet(&mut rng, 6 + usize::try_from(seed).unwrap(), 1.0);
        let floor = if seed % 2 == 0 { slab(&top, 0.4) } else { top };
        let first = seed % 3 == 0;
        for (name, body) in [
            ("box", BOX.to_owned()),
            ("mesh", trimesh(&cuboid(Vec3::new(0.5, 0.35, 0.25)), None)),
        ] {
            let mut drive = drive(&scene(&trimesh(&floor, None), &body, first));
            for push in [0.0, 1e-3] {
                let rows = contacts(&mut drive, &at(FLOOR - 0.1, 0.3, 0.25 - push));
                let good = along(&rows, first, &Vec3::z());
                if good.len() != rows.len() || rows.len() != 4 || (area(&rows) - 0.42).abs() > 1e-6
                {
                    let _ = writeln!(
                        text,
                        "{name} {seed} {push}: {} of {}, {}\n{}",
                        good.len(),
                        rows.len(),
                        area(&rows),
                        brief(&rows)
                    );
                }
            }
        }
    }
    assert!(text.is_empty(), "{text}");
}

/// The points of a pair are chosen by their spread: even with four points in total a corner has both its normals.
#[test]
fn with_room_for_few_points_each_surface_has_one() {
    let floor = trimesh(&corner(&mut Rng::new(3), 16), None);
    let text = scene(&floor, BOX, true).replace("contacts_per_pair = 16", "contacts_per_pair = 4");
    let mut drive = drive(&text);
    let rows = contacts(&mut drive, &at(0.499, 0.123, 0.249));
    assert_eq!(rows.len(), 4);
    for normal in [Vec3::x(), Vec3::z()] {
        assert!(!along(&rows, true, &normal).is_empty(), "{}", brief(&rows));
    }
}

#[test]
fn a_mesh_on_a_half_space_rests_on_its_outermost_corners() {
    let body = trimesh(&fine_box(Vec3::new(0.5, 0.35, 0.25), 12), None);
    let floor = "{ type = \"half_space\", normal = [0.0, 0.0, 1.0] }";
    let mut drive = drive(&scene(floor, &body, true));
    let mut ids = Vec::new();
    for k in 0..20 {
        let turn = Quat::from_euler_angles(0.0, 1e-5, 0.1 * f64::from(k));
        let pose = Pose::from_parts(Vec3::new(0.1 * f64::from(k), 0.0, 0.249).into(), turn);
        let mut rows = contacts(&mut drive, &pose);
        assert_eq!(rows.len(), 4);
        assert!(area(&rows) > 0.699);
        rows.sort_by_key(|row| row.id);
        let now: Vec<u64> = rows.iter().map(|row| row.id).collect();
        assert!(k == 0 || now == ids, "{now:?} {ids:?}");
        ids = now;
    }
}
