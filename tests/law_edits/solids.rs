//! Bodies of all kinds as scene text, with convex pieces for exact gap queries.

use std::path::Path;
use std::sync::Arc;

use sweepd::daemon::build_shapes;
use sweepd::math::{Interval, Point, Pose, Vec3, relative};
use sweepd::narrow::exact::{Warm, convex_gap, half_space_gap};
use sweepd::scene::{BodySpec, Scene};
use sweepd::shape::{Geometry, Shape};
use sweepd::world::Parts;

use crate::oracle::meshes::{cuboid, trimesh};
use crate::oracle::rng::Rng;

/// A body's shapes, as the engine gets them and as the oracle queries them.
#[derive(Clone)]
pub struct Solid {
    pub spec: BodySpec,
    pub shapes: Parts,
    /// Convex shapes, or one half-space, with their poses in the body.
    pieces: Vec<(Pose, Arc<Shape>)>,
    pub is_half_space: bool,
    /// Whether it is a mesh, whose depth of overlap differs from that of its pieces.
    pub is_mesh: bool,
}

fn read(text: &str) -> (BodySpec, Parts) {
    let text =
        format!("frame_id = \"world\"\n[[source]]\nname = \"feed\"\ntimeout_ms = 500\n{text}");
    let scene = Scene::parse(&text, "scene.toml", Path::new(".")).unwrap();
    let shapes = build_shapes(&scene).unwrap().bodies.remove(0);
    (scene.bodies[0].clone(), shapes)
}

impl Solid {
    /// A body of a random kind with this name; the caller sets the other properties.
    pub fn any(rng: &mut Rng, name: &str) -> Self {
        let half = Vec3::new(
            rng.range(0.2, 0.6),
            rng.range(0.2, 0.6),
            rng.range(0.2, 0.6),
        );
        let cuboid_text = format!(
            "{{ type = \"box\", half_extents = [{:?}, {:?}, {:?}] }}",
            half.x, half.y, half.z
        );
        let ball = format!(
            "{{ type = \"sphere\", radius = {:?} }}",
            rng.range(0.2, 0.6)
        );
        let capsule = format!(
            "{{ type = \"capsule\", radius = {:?}, half_height = {:?} }}",
            rng.range(0.1, 0.3),
            rng.range(0.1, 0.5)
        );
        let kind = rng.below(8);
        let (real, twin) = match kind {
            0 => {
                let n = rng.direction();
                let plane = format!(
                    "{{ type = \"half_space\", normal = [{:?}, {:?}, {:?}] }}",
                    n.x, n.y, n.z
                );
                (plane.clone(), plane)
            }
            1 | 2 => (ball.clone(), ball),
            3 => (capsule.clone(), capsule),
            4 => (trimesh(&cuboid(half), None), cuboid_text),
            _ => (cuboid_text.clone(), cuboid_text),
        };
        let head = format!("[[body]]\nname = \"{name}\"\n");
        let far_m = if kind == 7 {
            [3.0, 40.0][rng.below(2)]
        } else {
            0.0
        };
        let text = |shape: &str| {
            if kind < 6 {
                return format!("{head}shape = {shape}\n");
            }
            // Two parts; they may be far from the body's origin.
            let at = [far_m + 0.7, 0.0, 0.1];
            let inside = shape.trim_end_matches(" }");
            format!(
                "{head}shape = [{inside}, position = {at:?} }}, {inside}, position = [{far_m:?}, 0.0, 0.0] }}]\n"
            )
        };
        let (spec, shapes) = read(&text(&real));
        let (_, twins) = read(&text(&twin));
        let pieces = twins
            .iter()
            .map(|placed| (placed.pose, Arc::clone(&placed.shape)));
        Self {
            spec,
            shapes,
            pieces: pieces.collect(),
            is_half_space: kind == 0,
            is_mesh: kind == 4,
        }
    }

    /// The least gap of two solids at these poses.
    pub fn gap(&self, at: &Pose, other: &Self, other_at: &Pose) -> Interval {
        let mut least = Interval {
            min: f64::INFINITY,
            max: f64::INFINITY,
        };
        for (on_a, a) in &self.pieces {
            for (on_b, b) in &other.pieces {
                let (pose_a, pose_b) = (at * on_a, other_at * on_b);
                let gap = piece_gap(&a.geometry, &pose_a, &b.geometry, &pose_b);
                least.min = least.min.min(gap.min);
                least.max = least.max.min(gap.max);
            }
        }
        least
    }

    /// Centre of its geometry, body frame: the middle of the bounding box of the centres of its pieces; the origin for
    /// a half-space.
    pub fn centre(&self) -> Point {
        match &self.pieces[..] {
            [_] if self.is_half_space => Point::origin(),
            [(at, shape)] => at * shape.centre,
            pieces => {
                let all: Vec<Point> = pieces.iter().map(|(at, shape)| at * shape.centre).collect();
                let low = all.iter().fold(all[0], |low, p| low.inf(p));
                let high = all.iter().fold(all[0], |high, p| high.sup(p));
                nalgebra::center(&low, &high)
            }
        }
    }
}

fn piece_gap(a: &Geometry, pose_a: &Pose, b: &Geometry, pose_b: &Pose) -> Interval {
    match (a, b) {
        (Geometry::Convex(x), Geometry::Convex(y)) => {
            convex_gap(x, y, &relative(pose_a, pose_b), &mut Warm::default()).gap
        }
        (Geometry::HalfSpace { normal, offset }, Geometry::Convex(y)) => {
            half_space_gap(normal, *offset, y, &relative(pose_a, pose_b)).gap
        }
        (Geometry::Convex(x), Geometry::HalfSpace { normal, offset }) => {
            half_space_gap(normal, *offset, x, &relative(pose_b, pose_a)).gap
        }
        _ => panic!("convex pieces, or one half-space"),
    }
}
