//! Couples of bodies of all kinds, and how they move.

use sweepd::config::Config;
use sweepd::ids::BodyId;
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::scene::{BodySpec, PlacedSpec, Scene, SourceSpec};
use sweepd::shape::Geometry;
use sweepd::world::PlacedShape;

use std::sync::Arc;

use crate::bends::Bend;
use crate::kinds::{BENDING, HALF_SPACE, Solid, any};
use crate::oracle::meshes::Soup;
use crate::oracle::rng::Rng;
use crate::truth::{Bounds, bounds};

pub struct Part {
    pub solid: Solid,
    pub local: Pose,
}

pub struct Body {
    pub parts: Vec<Part>,
    /// About where it is, metres.
    pub size: f64,
    pub pose: Pose,
    /// How its one mesh deforms.
    pub bend: Option<Bend>,
}

pub struct Couple {
    pub kinds: (usize, usize),
    /// By id: 2k + 1 and 2k + 2.
    pub bodies: [Body; 2],
    home: Vec3,
    mode: usize,
}

pub fn gap_of(a: &Body, b: &Body, samples: u32) -> Bounds {
    let mut least = Bounds {
        low: f64::INFINITY,
        high: f64::INFINITY,
    };
    // Seen from A's place: far from the origin sums of poses lose what their difference keeps.
    let shift = b.pose.translation.vector - a.pose.translation.vector;
    let pose_a = Pose::from_parts(Vec3::zeros().into(), a.pose.rotation);
    let pose_b = Pose::from_parts(shift.into(), b.pose.rotation);
    for one in &a.parts {
        for other in &b.parts {
            let (at_a, at_b) = (pose_a * one.local, pose_b * other.local);
            least = least.least(bounds((&one.solid, at_a), (&other.solid, at_b), samples));
        }
    }
    least
}

/// A body of a kind; one in four has a second shape. With it what a scene says.
fn any_body(rng: &mut Rng, kind: usize, s: f64, id: u64, group: u32) -> (Body, BodySpec) {
    let mut parts = Vec::new();
    let mut shapes = Vec::new();
    let several = kind != HALF_SPACE && kind < BENDING && rng.below(4) == 0;
    for place in 0..=usize::from(several) {
        let other = if place == 0 { kind } else { rng.below(8) };
        let (solid, shape) = any(rng, other, s);
        let local = if kind < BENDING && (several || rng.below(3) == 0) {
            let at = rng.vector(0.5 * s);
            rng.pose(at)
        } else {
            Pose::identity()
        };
        parts.push(Part { solid, local });
        shapes.push(PlacedSpec { shape, pose: local });
    }
    let spec = BodySpec {
        deforms: kind >= BENDING,
        source: Some(0),
        group,
        mask: group,
        report_within_m: if rng.below(3) == 0 { 0.05 * s } else { 0.0 },
        ..BodySpec::new(format!("b{id}"), BodyId(id), shapes)
    };
    (
        Body {
            parts,
            size: 2.0 * s,
            pose: Pose::identity(),
            bend: (kind >= BENDING).then(Bend::default),
        },
        spec,
    )
}

impl Couple {
    /// Places the second body anew: overlapping, within a hundredth, or anywhere near.
    pub fn place(&mut self, rng: &mut Rng) {
        let home = self.home;
        let [a, b] = &mut self.bodies;
        a.pose = Pose::from_parts((home + rng.vector(0.1 * a.size)).into(), rng.rotation());
        let rotation = rng.rotation();
        let mut away = rng.direction();
        let mut reach = a.size + b.size;
        for (one, sign) in [(&*a, 1.0), (&*b, -1.0)] {
            if let Solid::HalfSpace(n, _) = &one.parts[0].solid {
                let turned = if sign > 0.0 {
                    one.pose.rotation
                } else {
                    rotation
                };
                away = turned * (one.parts[0].local.rotation * n) * sign;
                reach = a.size.max(b.size) * 2.0;
            }
        }
        let from = a.pose.translation.vector;
        let regime = rng.below(3);
        let mut distance = if regime == 0 {
            rng.range(0.0, 0.4)
        } else {
            rng.range(0.8, 1.1)
        } * reach;
        b.pose = Pose::from_parts((from + away * distance).into(), rotation);
        if regime == 1 {
            for _ in 0..6 {
                let gap = gap_of(a, b, 60).high;
                if gap.abs() < 1e-4 * b.size.min(a.size) || gap < 0.0 {
                    break;
                }
                distance -= 0.999 * gap;
                b.pose.translation.vector = from + away * distance;
            }
            let nudge = [0.01, -0.01, 1e-4, -1e-4, 1e-7, -1e-7][rng.below(6)];
            b.pose.translation.vector += away * (nudge * rng.unit() * a.size.min(b.size));
        }
    }

    /// One tick of motion.
    pub fn step(&mut self, rng: &mut Rng) {
        if rng.below(6) == 0 {
            self.mode = rng.below(7);
        }
        let small = self.bodies[0].size.min(self.bodies[1].size);
        match self.mode {
            0 => {}
            1 => {
                for body in &mut self.bodies {
                    body.pose.translation.vector += rng.vector(5e-4 * small);
                }
            }
            2 => {
                let to =
                    self.bodies[0].pose.translation.vector - self.bodies[1].pose.translation.vector;
                let step = to.try_normalize(1e-9).unwrap_or(Vec3::x()) * 0.02 * small;
                self.bodies[1].pose.translation.vector += step;
            }
            3 => {
                let turn = Quat::from_scaled_axis(rng.vector(0.05));
                self.bodies[1].pose.rotation = turn * self.bodies[1].pose.rotation;
            }
            4 => self.place(rng),
            5 => {
                let turn = Quat::from_scaled_axis(rng.direction() * std::f64::consts::PI);
                self.bodies[1].pose.rotation = turn * self.bodies[1].pose.rotation;
            }
            _ => {
                let turn = Quat::from_scaled_axis(rng.vector(0.1));
                let (centre, by) = (self.home, rng.vector(0.2 * small));
                for body in &mut self.bodies {
                    let from = body.pose.translation.vector - centre;
                    body.pose = Pose::from_parts(
                        (centre + turn * from + by).into(),
                        turn * body.pose.rotation,
                    );
                }
            }
        }
        for body in &mut self.bodies {
            if let (Some(bend), [part]) = (&mut body.bend, &mut body.parts[..])
                && let Solid::Mesh(soup, _) = &mut part.solid
            {
                bend.step(rng, soup, 0.5 * body.size);
            }
            body.pose.rotation = Quat::new_normalize(body.pose.rotation.into_inner());
        }
    }
}

/// A couple for each pair of kinds, and the scene of them all.
pub fn any_scene(rng: &mut Rng, kinds: &[(usize, usize)]) -> (Vec<Couple>, Scene) {
    let origin = if rng.below(4) == 0 {
        rng.vector(1e7)
    } else {
        Vec3::zeros()
    };
    let mut couples = Vec::new();
    let mut specs = Vec::new();
    for (k, &(one, other)) in kinds.iter().enumerate() {
        let ratio = if rng.below(5) == 0 {
            10.0_f64.powf(rng.range(2.0, 3.5))
        } else {
            1.0
        };
        let id = 2 * k as u64 + 1;
        let swap = rng.below(2) == 0;
        let order = if swap { (other, one) } else { (one, other) };
        let (a, spec_a) = any_body(rng, order.0, 1.0, id, 1 << k);
        let (b, spec_b) = any_body(rng, order.1, ratio, id + 1, 1 << k);
        specs.extend([spec_a, spec_b]);
        let home = origin + Vec3::new(3.0 * k as f64, 0.0, 0.0);
        couples.push(Couple {
            kinds: (one, other),
            bodies: [a, b],
            home,
            mode: rng.below(7),
        });
    }
    let scene = Scene {
        frame_id: "world".to_owned(),
        config: Config::default(),
        sources: vec![SourceSpec {
            name: "feed".to_owned(),
            timeout_ns: 1 << 40,
            ros2: None,
        }],
        bodies: specs,
        ..Scene::default()
    };
    (couples, scene)
}

/// Takes over the meshes that were built: a height field's is made there, and shells may be turned round.
pub fn take_meshes(couples: &mut [Couple], built: &[Arc<[PlacedShape]>]) {
    for (at, shapes) in built.iter().enumerate() {
        for (part, placed) in couples[at / 2].bodies[at % 2]
            .parts
            .iter_mut()
            .zip(shapes.iter())
        {
            if let (Solid::Mesh(soup, filled), Geometry::Mesh(mesh)) =
                (&mut part.solid, &placed.shape.geometry)
            {
                assert_eq!(*filled, mesh.is_solid());
                *soup = Soup::new(mesh.vertices().to_vec(), mesh.faces().to_vec());
            }
        }
    }
}
