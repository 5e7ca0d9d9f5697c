//! Flat floors: tilt at most 0.05 degrees, no flips, at most four points, stable ids.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::oracle::meshes::trimesh;
use crate::oracle::rng::Rng;
use crate::support::{
    Kind, area, contacts, degrees, drive, kinds, normal, scene, sheet, slab, tiles,
};
use sweepd::math::{Pose, Quat, Vec3};

const TICKS: u32 = if cfg!(debug_assertions) { 40 } else { 200 };
const TILT_MAX_DEG: f64 = 0.05;

/// Floors of each kind: a surface, a solid slab, tiles, a height field.
fn floor(rng: &mut Rng, kind: usize, cells: usize) -> String {
    match kind {
        0 => trimesh(&sheet(rng, cells, 1.0), None),
        1 => trimesh(&slab(&sheet(rng, cells, 1.0), 0.5), None),
        2 => trimesh(&tiles(rng, cells), None),
        _ => {
            let row = format!("[{}]", vec!["0.0"; cells + 1].join(", "));
            let rows = vec![row; cells + 1].join(", ");
            format!(
                "{{ type = \"height_field\", heights = [{rows}], size = [6.0, 6.0], base_m = 0.5 }}"
            )
        }
    }
}

/// Results of a run over a floor.
#[derive(Default)]
struct Seen {
    rows: u64,
    tilt_deg: f64,
    flips: u64,
    /// Contacts of all ticks but the first, and the number of their ids that the tick before had too.
    followed: u64,
    kept: u64,
    least_points: usize,
    least_area: f64,
}

/// Slides and spins a body over a floor, which it penetrates by `depth`.
fn slide(floor: &str, kind: &Kind, floor_first: bool, depth: f64, spin: f64, seed: u64) -> Seen {
    let mut rng = Rng::new(seed);
    let mut drive = drive(&scene(floor, &kind.shape, floor_first));
    let mut seen = Seen {
        least_points: usize::MAX,
        least_area: f64::INFINITY,
        ..Seen::default()
    };
    let (from, by) = (rng.vector(1.2), rng.direction() * 0.006);
    let heading = rng.range(0.0, 6.0);
    let mut ids = BTreeSet::new();
    for tick in 0..TICKS {
        let t = f64::from(tick);
        let at = Vec3::new(from.x + by.x * t, from.y + by.y * t, kind.height - depth);
        let turn = Quat::from_scaled_axis(Vec3::z() * (heading + spin * t));
        let pose = Pose::from_parts(at.into(), turn * Quat::from_scaled_axis(kind.lying));
        let rows = contacts(&mut drive, &pose);
        for row in &rows {
            let normal = normal(row, floor_first);
            seen.rows += 1;
            seen.flips += u64::from(normal.z <= 0.0);
            seen.tilt_deg = seen.tilt_deg.max(degrees(&normal, &Vec3::z()));
            assert!(row.gap_m <= 1e-6, "{}: {row:?}", kind.name);
            assert!(row.gap_m >= -depth - 1e-6, "{}: {row:?}", kind.name);
        }
        assert!(rows.len() <= 4, "{}: {rows:?}", kind.name);
        seen.least_points = seen.least_points.min(rows.len());
        seen.least_area = seen.least_area.min(area(&rows));
        let now: BTreeSet<u64> = rows.iter().map(|row| row.id).collect();
        if tick > 0 {
            seen.followed += now.len() as u64;
            seen.kept += now.intersection(&ids).count() as u64;
        }
        ids = now;
    }
    seen
}

/// Every kind of body on every kind of floor, at several depths.
#[test]
fn on_a_flat_floor_no_normal_is_tilted_or_flipped_and_ids_stay() {
    let mut told = String::new();
    for (at, kind) in kinds().iter().enumerate() {
        let size = 2.0 * kind.height.max(0.5);
        let (mut worst, mut rows, mut flips, mut kept, mut followed) = (0.0_f64, 0, 0, 0, 0);
        let mut least = (usize::MAX, f64::INFINITY);
        for floor_kind in 0..4 {
            for (round, push) in [0.0, 1e-4, 1e-3, 1e-2].into_iter().enumerate() {
                let seed = 100 * at as u64 + 10 * floor_kind as u64 + round as u64;
                let mut rng = Rng::new(seed);
                let cells = [4, 17, 30, 45][(round + floor_kind + at) % 4];
                let floor = floor(&mut rng, floor_kind, cells);
                let spin = if round % 2 == 0 { 0.0 } else { 0.02 };
                let first = rng.below(2) == 0;
                let seen = slide(&floor, kind, first, push * size, spin, seed);
                let what = format!(
                    "{} on floor {floor_kind} of {cells}, in by {push}",
                    kind.name
                );
                assert!(seen.rows > 0, "{what}: no contact");
                assert_eq!(seen.flips, 0, "{what}");
                assert!(
                    seen.tilt_deg <= TILT_MAX_DEG,
                    "{what}: {} degrees",
                    seen.tilt_deg
                );
                worst = worst.max(seen.tilt_deg);
                rows += seen.rows;
                flips += seen.flips;
                kept += seen.kept;
                followed += seen.followed;
                least = (least.0.min(seen.least_points), least.1.min(seen.least_area));
                if kind.footprint > 0.0 {
                    assert!(
                        seen.least_points >= 3,
                        "{what}: {} points",
                        seen.least_points
                    );
                    let share = seen.least_area / kind.footprint;
                    assert!(share > 0.6, "{what}: {share} of the footprint");
                }
            }
        }
        let share = kept as f64 / followed as f64;
        let _ = writeln!(
            told,
            "{:22} {rows:6} rows, tilt {worst:.2e} deg, {flips} flips, least {} points {:.2} m2, ids kept {share:.4}",
            kind.name, least.0, least.1
        );
        assert!(share > 0.95, "{told}");
    }
    println!("{told}");
}
