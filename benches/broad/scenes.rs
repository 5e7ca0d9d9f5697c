//! The scenes: seeded moving boxes, the same for every method. Boxes are f32, so that peers get exactly the numbers
//! that our methods get as f64.
//!
//! Lengths in metres, speeds in metres per frame. Density is 0.5 bodies per cubic metre unless stated otherwise.

use super::common::Rng;

/// A box: lower corner, upper corner.
pub type Box3 = [[f32; 3]; 2];

/// How a scene is made and moves. `Gas` and `Sheet` favour fat boxes, `OnePercent` sparse updates, `Pile` cached pairs.
/// `Pile` is hard for a sort on one axis, `Mixed` for grids, `Galaxy` for cells of one size, `Teleport` and `Fast` for
/// methods that rely on coherence, `Churn` for insertion, `Tumble` and `Redraw` for predicted motion, `Rove` for
/// sleeping sets, `Dense` and `Heap` for pair lists, `Far` for f32, `Stray` (a gas and one body 1,000 km from it) for
/// an origin and cell sizes derived from the total extent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Gas,
    OnePercent,
    Pile,
    Mixed,
    Galaxy,
    Teleport,
    Churn,
    Sheet,
    Fast,
    Tumble,
    Redraw,
    Rove,
    Dense,
    Field,
    Far,
    Heap,
    Stray,
}

impl Kind {
    pub const ALL: &'static [(Self, &'static str)] = &[
        (Self::Gas, "gas"),
        (Self::OnePercent, "static1"),
        (Self::Pile, "pile"),
        (Self::Mixed, "mixed"),
        (Self::Galaxy, "galaxy"),
        (Self::Teleport, "teleport"),
        (Self::Churn, "churn"),
        (Self::Sheet, "sheet"),
        (Self::Fast, "fast"),
        (Self::Tumble, "tumble"),
        (Self::Redraw, "redraw"),
        (Self::Rove, "rove"),
        (Self::Dense, "dense"),
        (Self::Field, "field"),
        (Self::Far, "far"),
        (Self::Heap, "heap"),
        (Self::Stray, "stray"),
    ];

    pub fn named(name: &str) -> Option<Self> {
        let found = Self::ALL.iter().find(|(_, known)| *known == name);
        found.map(|(kind, _)| *kind)
    }
}

/// One scene and its current state.
pub struct Scene {
    pub kind: Kind,
    pub boxes: Vec<Box3>,
    /// Bodies that moved in this frame; none of them is in `churned`.
    pub moved: Vec<u32>,
    /// Bodies removed and inserted at another place in this frame.
    pub churned: Vec<u32>,
    rng: Rng,
    centres: Vec<[f64; 3]>,
    halves: Vec<[f64; 3]>,
    velocities: Vec<[f64; 3]>,
    /// Rest position of each body of the pile, or centre of each cluster of the galaxy.
    homes: Vec<[f64; 3]>,
    drifts: Vec<[f64; 3]>,
    /// Per rod: its angle about z, its tilt from z, and the change of each per frame, radians.
    turns: Vec<[f64; 4]>,
    side: [f64; 3],
    frame: usize,
}

/// Bodies per cluster of the galaxy.
const CLUSTER: usize = 500;
/// Bodies of the heap that are all at the same place.
const HEAP: usize = 2000;
/// Distance from the gas to its stray body on each axis, metres.
const ASTRAY_M: f64 = 1e6;

impl Scene {
    pub fn new(kind: Kind, bodies: usize, seed: u64) -> Self {
        let mut scene = Self {
            kind,
            boxes: Vec::new(),
            moved: Vec::new(),
            churned: Vec::new(),
            rng: Rng::new(seed),
            centres: Vec::new(),
            halves: Vec::new(),
            velocities: Vec::new(),
            homes: Vec::new(),
            drifts: Vec::new(),
            turns: Vec::new(),
            side: side(kind, bodies as f64),
            frame: 0,
        };
        if kind == Kind::Galaxy {
            for _ in 0..bodies.div_ceil(CLUSTER) {
                let (home, drift) = (scene.place(), scene.way(0.08));
                scene.homes.push(home);
                scene.drifts.push(drift);
            }
        }
        for body in 0..bodies {
            scene.add(body);
        }
        scene
    }

    fn add(&mut self, body: usize) {
        let mut half: [f64; 3] = std::array::from_fn(|_| self.rng.between(0.25, 0.5));
        let mut centre = self.place();
        let mut speed = self.rng.between(0.01, 0.04);
        match self.kind {
            Kind::Pile => {
                half[2] = 0.35;
                centre[2] = 0.35 + 0.69 * (body % 5) as f64;
                if body == 0 {
                    centre = [self.side[0] / 2.0, self.side[1] / 2.0, -0.5];
                    half = [self.side[0] / 2.0, self.side[1] / 2.0, 0.51];
                }
                self.homes.push(centre);
            }
            Kind::Mixed => {
                half = [0.005 * 1000.0_f64.powf(self.rng.unit()); 3];
                speed *= half[0] / 0.375;
            }
            Kind::Galaxy => {
                let spread: [f64; 3] = std::array::from_fn(|_| 3.8 * self.normal());
                let home = self.homes[body / CLUSTER];
                centre = std::array::from_fn(|k| home[k] + spread[k]);
            }
            Kind::Field if body.is_multiple_of(100) => speed = 0.3,
            Kind::Heap if body < HEAP => {
                centre = self.side.map(|s| s / 2.0);
                half = [0.4; 3];
            }
            Kind::Stray if body == 0 => centre = [ASTRAY_M; 3],
            _ => {}
        }
        let mut velocity = self.way(speed);
        if self.kind == Kind::Heap && body < HEAP {
            velocity = [0.01, 0.005, 0.002];
        }
        let turn = std::array::from_fn(|k| {
            if k < 2 {
                self.rng.between(0.0, 6.28)
            } else {
                self.rng.between(0.02, 0.1)
            }
        });
        self.turns.push(turn);
        self.centres.push(centre);
        self.halves.push(half);
        self.velocities.push(velocity);
        self.boxes.push([[0.0; 3]; 2]);
        self.write(body);
    }

    /// Advances all bodies by one frame.
    pub fn step(&mut self) {
        self.frame += 1;
        self.moved.clear();
        self.churned.clear();
        for (home, drift) in self.homes.iter_mut().zip(&mut self.drifts) {
            advance(home, drift, &self.side);
        }
        for body in 0..self.boxes.len() {
            if !self.moves(body) {
                continue;
            }
            match self.kind {
                Kind::Churn if self.rng.once_in(100) => {
                    self.centres[body] = self.place();
                    self.churned.push(body as u32);
                    self.write(body);
                    continue;
                }
                Kind::Teleport if self.rng.once_in(20) => self.centres[body] = self.place(),
                _ => self.fly(body),
            }
            self.write(body);
            self.moved.push(body as u32);
        }
    }

    fn moves(&self, body: usize) -> bool {
        match self.kind {
            Kind::OnePercent | Kind::Field => body.is_multiple_of(100),
            Kind::Rove => body % 100 == self.frame % 100,
            Kind::Pile | Kind::Stray => body != 0,
            _ => true,
        }
    }

    fn fly(&mut self, body: usize) {
        match self.kind {
            Kind::Pile => {
                let home = self.homes[body];
                self.centres[body] =
                    std::array::from_fn(|k| home[k] + self.rng.between(-0.002, 0.002));
                return;
            }
            Kind::Galaxy => {
                let (home, drift) = (self.homes[body / CLUSTER], self.drifts[body / CLUSTER]);
                for k in 0..3 {
                    let away = self.centres[body][k] - home[k];
                    if away.abs() > 11.4 {
                        self.velocities[body][k] = -away.signum() * self.velocities[body][k].abs();
                    }
                    self.centres[body][k] += drift[k] + self.velocities[body][k];
                }
                return;
            }
            Kind::Fast => {
                let far = self.rng.between(0.0, 0.5);
                self.velocities[body] = self.way(far);
            }
            Kind::Redraw => {
                let far = self.rng.between(0.01, 0.04);
                self.velocities[body] = self.way(far);
            }
            Kind::Tumble => {
                let turn = &mut self.turns[body];
                turn[0] += turn[2];
                turn[1] += turn[3];
            }
            _ => {}
        }
        advance(
            &mut self.centres[body],
            &mut self.velocities[body],
            &self.side,
        );
    }

    fn write(&mut self, body: usize) {
        let (c, mut h) = (self.centres[body], self.halves[body]);
        if self.kind == Kind::Tumble {
            // A rod of radius 0.09 m and total length 1.8 m: the box of its axis segment, enlarged by the radius.
            let [about, tilt, ..] = self.turns[body];
            let axis = [
                tilt.sin() * about.cos(),
                tilt.sin() * about.sin(),
                tilt.cos(),
            ];
            h = axis.map(|a| 0.09 + 0.81 * a.abs());
        }
        self.boxes[body] = [
            std::array::from_fn(|k| (c[k] - h[k]) as f32),
            std::array::from_fn(|k| (c[k] + h[k]) as f32),
        ];
    }

    fn place(&mut self) -> [f64; 3] {
        let side = self.side;
        side.map(|s| self.rng.between(0.0, s.max(1e-9)))
    }

    fn way(&mut self, length: f64) -> [f64; 3] {
        let v: [f64; 3] = std::array::from_fn(|_| self.rng.between(-1.0, 1.0));
        let norm = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt().max(1e-3);
        v.map(|x| x * length / norm)
    }

    /// A sum of twelve uniform numbers: approximately normal with mean 0 and standard deviation 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.rng.unit()).sum::<f64>() - 6.0
    }
}

fn advance(centre: &mut [f64; 3], velocity: &mut [f64; 3], side: &[f64; 3]) {
    for k in 0..3 {
        centre[k] += velocity[k];
        if !(0.0..=side[k]).contains(&centre[k]) {
            velocity[k] = -velocity[k];
            centre[k] = centre[k].clamp(0.0, side[k]);
        }
    }
}

fn side(kind: Kind, n: f64) -> [f64; 3] {
    match kind {
        Kind::Pile => [(n / 5.0).sqrt(), (n / 5.0).sqrt(), 3.5],
        Kind::Mixed => [(n / 0.02).cbrt(); 3],
        Kind::Galaxy => [60.0 * (n / CLUSTER as f64).max(1.0).cbrt(); 3],
        Kind::Sheet => [(n / 0.6).sqrt(), (n / 0.6).sqrt(), 0.5],
        Kind::Dense => [(n / 11.5).cbrt(); 3],
        _ => [(n / 0.5).cbrt(); 3],
    }
}
