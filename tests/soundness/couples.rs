//! Couples of bodies of all kinds, and their motion.

use sweepd::config::Config;
use sweepd::ids::BodyId;
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::scene::{BodySpec, PlacedSpec, Scene, SourceSpec};
use sweepd::shape::Geometry;
use sweepd::world::Parts;

use crate::bends::Bend;
use crate::depth::{Search, search};
use crate::kinds::{BENDING, HALF_SPACE, NAMES, Solid, any};
use crate::oracle::meshes::Soup;
use crate::oracle::rng::Rng;
use crate::regimes::{Regime, Shares};
use crate::truth::{At, Bounds, bounds};

/// Initial directions of the oracle's search.
const SAMPLES: u32 = 240;
/// Most moves of a couple per tick towards its regime: out of each other, to the wanted gap, and once more for thin
/// shapes that were passed through.
const MOVES_MAX: usize = 3;

pub struct Part {
    pub solid: Solid,
    pub local: Pose,
}

pub struct Body {
    pub parts: Vec<Part>,
    /// Approximate size, metres.
    pub size: f64,
    pub pose: Pose,
    /// The deformation of its only mesh.
    pub bend: Option<Bend>,
}

pub struct Couple {
    pub kinds: (usize, usize),
    /// Their ids are 2k + 1 and 2k + 2.
    pub bodies: [Body; 2],
    /// The truth for each pair of their parts, in order of the first body's parts.
    pub gaps: Vec<Bounds>,
    home: Vec3,
    mode: usize,
    regime: Regime,
}

/// The truth for two bodies.
pub fn gap_of(a: &Body, b: &Body, samples: u32) -> Bounds {
    least(&gaps_of(a, b, samples))
}

fn least(gaps: &[Bounds]) -> Bounds {
    gaps.iter()
        .fold(Bounds::FAR, |least, gap| least.least(*gap))
}

/// Whether two bodies overlap by at least `depth`, metres: whether two of their parts do.
pub fn depth_of(a: &Body, b: &Body, depth: f64) -> Search {
    let mut all = Search::Refuted;
    for (one, other) in placed(a, b) {
        match search(one, other, depth) {
            Search::Found => return Search::Found,
            Search::Open => all = Search::Open,
            Search::Refuted => {}
        }
    }
    all
}

/// The truth for each pair of their parts.
fn gaps_of(a: &Body, b: &Body, samples: u32) -> Vec<Bounds> {
    let parts = placed(a, b).into_iter();
    parts.map(|(a, b)| bounds(a, b, samples)).collect()
}

/// Each pair of their parts, with poses in one frame.
fn placed<'a>(a: &'a Body, b: &'a Body) -> Vec<(At<'a>, At<'a>)> {
    let mut pairs = Vec::new();
    // Relative to A's position: far from the origin sums of poses lose digits that their difference keeps.
    let shift = b.pose.translation.vector - a.pose.translation.vector;
    let pose_a = Pose::from_parts(Vec3::zeros().into(), a.pose.rotation);
    let pose_b = Pose::from_parts(shift.into(), b.pose.rotation);
    for one in &a.parts {
        for other in &b.parts {
            let (at_a, at_b) = (pose_a * one.local, pose_b * other.local);
            pairs.push(((&one.solid, at_a), (&other.solid, at_b)));
        }
    }
    pairs
}

/// A body of a kind, with a second shape in one of four cases; and its scene text.
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
    /// The truth for the two.
    pub fn gap(&self) -> Bounds {
        least(&self.gaps)
    }

    /// The size of the larger body, metres.
    pub fn large(&self) -> f64 {
        self.bodies[0].size.max(self.bodies[1].size)
    }

    /// The size of the smaller body, metres.
    pub fn small(&self) -> f64 {
        self.bodies[0].size.min(self.bodies[1].size)
    }

    /// Greatest error of the truth, metres: from rounding, and because the search for directions progresses slowly
    /// along the ridges of circular shapes.
    pub fn missed(&self) -> f64 {
        let mut parts = self.bodies.iter().flat_map(|body| &body.parts);
        let curved = |solid: &Solid| matches!(solid, Solid::Cylinder(..) | Solid::Cone(..));
        if parts.any(|part| curved(&part.solid)) {
            1e-6 * self.large()
        } else {
            self.noise()
        }
    }

    /// Greatest rounding error, metres.
    pub fn noise(&self) -> f64 {
        1e-11 * self.large()
    }

    /// Kinds and sizes of the two, as text.
    pub fn names(&self) -> String {
        let ((one, other), [a, b]) = (self.kinds, &self.bodies);
        let (one, other) = (NAMES[one], NAMES[other]);
        format!("{one} - {other} sizes {} {}", a.size, b.size)
    }

    /// Sets the initial poses.
    pub fn begin(&mut self, rng: &mut Rng) {
        self.place(rng);
        self.settle(rng, true);
    }

    /// Places both again: one deep in the other, or near first contact.
    fn place(&mut self, rng: &mut Rng) {
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
        // Some couples that are to be close are so in a hole or a cavity.
        let deep = match self.regime {
            Regime::Overlapping => true,
            Regime::Close => rng.below(4) == 0,
            Regime::Free => rng.below(3) == 0,
        };
        let distance = if deep {
            rng.range(0.0, 0.4)
        } else {
            rng.range(0.8, 1.1)
        } * reach;
        let at = a.pose.translation.vector + away * distance;
        b.pose = Pose::from_parts(at.into(), rotation);
    }

    /// Moves the second body into the couple's regime, and stores the truth there.
    ///
    /// One move suffices for two bodies that are apart: an approach by less than their distance causes no contact, and
    /// the nearest points stay the nearest.
    ///
    /// * `moved` - whether either body has moved or deformed since the last call.
    fn settle(&mut self, rng: &mut Rng, moved: bool) {
        let small = self.small();
        let [a, b] = &mut self.bodies;
        if moved {
            self.gaps = gaps_of(a, b, SAMPLES);
        }
        for _ in 0..MOVES_MAX {
            let gap = least(&self.gaps);
            if self.regime.holds(&gap, small) {
                return;
            }
            let (from, at) = (a.pose.translation.vector, b.pose.translation.vector);
            let to = match gap.way {
                Some(way) => at + way * (self.regime.gap(rng, small) - gap.high),
                // Separates the two, whatever their shapes.
                None => {
                    let out = (at - from).try_normalize(1e-9);
                    from + out.unwrap_or_else(|| rng.direction()) * (a.size + b.size)
                }
            };
            b.pose.translation.vector = to;
            self.gaps = gaps_of(a, b, SAMPLES);
        }
    }

    /// One tick of motion; then moves the second body into the couple's regime.
    ///
    /// * `shares` - shares of the regimes in the scene so far.
    pub fn step(&mut self, rng: &mut Rng, shares: &Shares) {
        if rng.below(6) == 0 {
            self.mode = rng.below(7);
            self.regime = shares.lacking();
        }
        let small = self.small();
        let mut moved = self.mode != 0;
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
                moved = true;
            }
            if self.mode != 0 {
                body.pose.rotation = Quat::new_normalize(body.pose.rotation.into_inner());
            }
        }
        self.settle(rng, moved);
    }
}

/// A couple for each pair of kinds, and the scene of all couples.
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
            10.0_f64.powf(rng.range(2.0, 6.0))
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
            gaps: Vec::new(),
            home,
            mode: rng.below(7),
            regime: Regime::of(k),
        });
    }
    let scene = Scene {
        frame_id: "world".to_owned(),
        config: Config::default(),
        sources: vec![SourceSpec {
            name: "feed".to_owned(),
            timeout_ns: 1 << 40,
            on_stale: Default::default(),
            ros2: None,
        }],
        bodies: specs,
        ..Scene::default()
    };
    (couples, scene)
}

/// Replaces meshes by the built ones: that of a height field is made in the build, and shells may have been inverted.
pub fn take_meshes(couples: &mut [Couple], built: &[Parts]) {
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
