//! Shapes far from their body's origin or with large coordinates, and large next to small ones: an overlap within
//! rounding errors is not proved apart or certain, and a large shape does not reduce the accuracy of a small one.

use std::f64::consts::FRAC_1_SQRT_2;

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::wire::{ContactKind, ContactRow, Demand, Verdict, pair_flags};

use crate::oracle::meshes::{Soup, cuboid, torus, trimesh};
use crate::rig::{ALL, Rig, body, scene};

/// A mesh as the shape of a scene file, at a position.
fn mesh_at(soup: &Soup, solid: bool, at: [f64; 3]) -> String {
    let shape = trimesh(soup, Some(solid));
    let open = shape.trim_end_matches('}');
    format!("{open}, position = {at:?} }}")
}

fn octahedron() -> Soup {
    let mut faces = Vec::new();
    for k in 0..8_u32 {
        let [x, y, z] = [k & 1, 2 + (k >> 1 & 1), 4 + (k >> 2)];
        let odd = k.count_ones() % 2 == 1;
        faces.push(if odd { [x, z, y] } else { [x, y, z] });
    }
    let ends = (0..6).map(|k| Vec3::ith(k / 2, if k % 2 == 0 { 1.0 } else { -1.0 }).into());
    Soup::new(ends.collect(), faces)
}

/// Without demand for bounds only verdicts are worked on.
fn without_bounds(bodies: &[String]) -> Rig {
    let mut rig = Rig::new(&scene("", bodies));
    rig.demand = Demand::default();
    rig
}

/// The walk ended at the root box as soon as its distance from the plane exceeded rounding errors, with an upper end of
/// a metre. Widened by the rounding error of the composed poses, the interval contained 0 and counted as a contact.
#[test]
fn bug_a_mesh_over_a_half_space_touched_it_where_its_box_all_but_did() {
    let octahedron = mesh_at(&octahedron(), true, [0.5, 0.0, 0.0]);
    let beside = "{ type = \"sphere\", radius = 0.01, position = [0.5, 0.0, 0.0] }";
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = 0.0 }\n";
    let turn = Quat::rotation_between(&Vec3::repeat(1.0), &-Vec3::z()).unwrap();
    let middle = turn * Vec3::new(0.5, 0.0, 0.0);
    for shape in [octahedron.clone(), format!("[{octahedron}, {beside}]")] {
        for step in -4..400 {
            // Heights around that at which its box rests on the plane, from below to above it by more than the rounding
            // error.
            let height = 3.0_f64.sqrt() + f64::from(step) * 1.5e-9;
            let at = Vec3::new(1e6, 0.0, height) - middle;
            let mut rig = without_bounds(&[body(1, [0.0; 3], &shape, ""), floor.to_owned()]);
            rig.place(1, &Pose::from_parts(at.into(), turn));
            rig.send(ALL);
            assert_eq!(rig.out.tick.colliding, 0, "at {height}");
        }
    }
}

/// The same for two surfaces that no plane separates: their front ended at the first proof that they are apart.
#[test]
fn bug_a_rod_in_a_ring_touched_it_where_boxes_all_but_did() {
    const FAR: f64 = 1e12;
    let at = [FAR, 0.0, 0.0];
    let ring = mesh_at(&torus(1.0, 0.3, 12, 8), true, at);
    let rod = mesh_at(&cuboid(Vec3::new(0.1, 0.1, 1.0)), true, at);
    let beside = format!("{{ type = \"sphere\", radius = 0.01, position = [{FAR}, 40.0, 0.0] }}");
    for rod in [rod.clone(), format!("[{rod}, {beside}]")] {
        let mut rig = without_bounds(&[body(1, [0.0; 3], &ring, ""), body(2, [0.0; 3], &rod, "")]);
        for step in 0..400 {
            let (aside, along) = (0.001 * f64::from(step), f64::from(step % 7) * 0.05);
            let at = [aside * FRAC_1_SQRT_2, aside * FRAC_1_SQRT_2, along];
            rig.row(2).position = at;
            rig.send(ALL);
            assert_eq!(rig.out.tick.colliding, 0, "at {at:?}");
        }
    }
}

/// The retest of a previous contact assumed that the position of a shape a million kilometres from its body's origin
/// was exact.
#[test]
fn bug_a_touch_that_goes_on_was_certain_where_rounding_hides_it() {
    const FAR: f64 = 1e9;
    let at = [FAR, 0.0, 0.0];
    let flat = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let upright = [[0.0, 0.0, -1e-6], [0.5, 0.0, 1.0], [-0.5, 0.0, 1.0]];
    let sheet = |corners: [[f64; 3]; 3]| {
        let corners = corners.map(|p| Vec3::from(p).into());
        mesh_at(&Soup::new(corners.to_vec(), vec![[0, 1, 2]]), false, at)
    };
    let beside = format!("{{ type = \"sphere\", radius = 0.01, position = [{FAR}, 40.0, 0.0] }}");
    let (one, other) = (sheet(flat), sheet(upright));
    for other in [other.clone(), format!("[{other}, {beside}]")] {
        let bodies = [body(1, [0.0; 3], &one, ""), body(2, [0.0; 3], &other, "")];
        let mut rig = without_bounds(&bodies);
        rig.demand.pairs = true;
        let turn = Quat::from_scaled_axis(Vec3::z());
        let out = Vec3::new(FAR, 0.0, 0.0);
        for tick in 0..4 {
            let mut there = Pose::from_parts((out - turn * out).into(), turn);
            there.translation.z = -1e-9 * f64::from(tick);
            rig.place(2, &there);
            rig.send(ALL);
            let row = rig.pair(1, 2).unwrap();
            assert_eq!(row.verdict, Verdict::Colliding.code());
            assert_eq!(row.flags & pair_flags::TOUCHING, pair_flags::TOUCHING);
            // 1e-6 m is less than the spacing of numbers near 1e9 m after a rotation by 1 rad.
            assert!(row.gap_max_m > 1e-6, "tick {tick}: {row:?}");
        }
    }
}

fn contacts(rig: &Rig) -> Vec<ContactRow> {
    let rows = rig.out.contacts.iter();
    let touching = rows.filter(|row| row.kind == ContactKind::Contact.code());
    touching.copied().collect()
}

fn convex(soup: &Soup) -> String {
    let vertices: Vec<[f64; 3]> = soup.vertices.iter().map(|p| p.coords.into()).collect();
    format!("{{ type = \"convex\", vertices = {vertices:?} }}")
}

/// A cube on a support: name, the two shapes, and the positions of support and cube.
fn cubes_at_rest() -> Vec<(&'static str, [String; 2], [Vec3; 2])> {
    const UTM: Vec3 = Vec3::new(4.5e5, 5e6, 0.0);
    let cube = |half: f64| format!("{{ type = \"box\", half_extents = [{half}, {half}, {half}] }}");
    let slab = "{ type = \"box\", half_extents = [5e4, 5e4, 1.0] }".to_owned();
    let ground = "{ type = \"half_space\", normal = [0, 0, 1] }".to_owned();
    let metre = || cuboid(Vec3::repeat(0.5));
    let hull = convex(&metre().moved(UTM));
    let mesh = trimesh(&metre().moved(UTM), Some(true));
    let small = trimesh(&cuboid(Vec3::repeat(0.2)), Some(true));
    let at = |z: f64| Vec3::new(0.1, 0.2, z);
    let rim = Vec3::new(4.9e4, 4.95e4, 1.0 + 0.05 - 1e-6);
    vec![
        (
            "a cube near the rim of 100 km",
            [slab, cube(0.05)],
            [Vec3::zeros(), rim],
        ),
        (
            "a millimetre on a kilometre",
            [cube(500.0), cube(5e-4)],
            [Vec3::zeros(), at(500.0005 - 1e-8)],
        ),
        (
            "a box on a hull far from its origin",
            [hull.clone(), cube(0.2)],
            [-UTM, at(0.7 - 1e-5)],
        ),
        (
            "a hull far from its origin on a half-space",
            [ground, hull],
            [Vec3::zeros(), -UTM + Vec3::z() * (0.5 - 1e-5)],
        ),
        (
            "a mesh on a mesh far from its origin",
            [mesh, small],
            [-UTM, at(0.7 - 1e-5)],
        ),
    ]
}

#[test]
fn bug_contact_points_were_one_where_the_larger_shape_or_its_numbers_were_large() {
    for (what, [under, over], [low, high]) in cubes_at_rest() {
        let is_still = under.contains("half_space");
        let under = if is_still {
            format!("name = \"b1\"\nid = 1\nmoves = false\nshape = {under}\n")
        } else {
            body(1, low.into(), &under, "")
        };
        let mut rig = Rig::new(&scene("", &[under, body(2, high.into(), &over, "")]));
        rig.send(ALL);
        let all = contacts(&rig);
        assert_eq!(all.len(), 4, "{what}: {all:#?}");
        for row in &all {
            assert!(row.normal[2] > 1.0 - 1e-9, "{what}: {row:?}");
        }
    }
}

/// The accuracy of the interval of the depth depended on the distance of the hull from its origin.
#[test]
fn bug_the_depth_of_a_small_cylinder_in_a_hull_far_from_its_origin_was_a_guess() {
    const UTM: Vec3 = Vec3::new(4.5e5, 5e6, 0.0);
    let hull = convex(&cuboid(Vec3::repeat(0.5)).moved(UTM));
    let cylinder = "{ type = \"cylinder\", radius = 0.1, half_height = 0.1 }";
    let bodies = [
        body(1, (-UTM).into(), &hull, ""),
        body(2, [0.0; 3], cylinder, ""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    for lean in [0.1, 0.3, 0.5, 0.7] {
        for depth in [0.001, 0.01, 0.03] {
            let turn = Quat::from_scaled_axis(Vec3::new(lean, 0.0, 0.0));
            let under = 0.1 * lean.cos() + 0.1 * lean.sin();
            let at = Vec3::new(0.1, 0.05, 0.5 + under - depth);
            rig.place(2, &Pose::from_parts(at.into(), turn));
            rig.send(ALL);
            let row = rig.pair(1, 2).unwrap();
            let what = format!("{lean} {depth}: {row:?}");
            assert!(
                row.gap_min_m <= -depth + 1e-8 && row.gap_max_m >= -depth - 1e-8,
                "{what}"
            );
            assert!(row.gap_max_m - row.gap_min_m < 1e-6, "{what}");
            let deepest = contacts(&rig)
                .into_iter()
                .min_by(|x, y| x.gap_m.total_cmp(&y.gap_m));
            let deepest = deepest.unwrap();
            assert!((deepest.gap_m + depth).abs() < 1e-6, "{what} {deepest:?}");
            assert!(deepest.normal[2] > 1.0 - 1e-6, "{what} {deepest:?}");
        }
    }
}
