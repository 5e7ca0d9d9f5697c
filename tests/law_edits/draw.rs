//! Draws the events of a scene: bodies, edits, frames, silences.

use std::sync::Arc;

use sweepd::config::OnStale;
use sweepd::ids::BodyId;
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::scene::{PairAction, PairRule};
use sweepd::world::{Edit, Put};

use crate::check::Seen;
use crate::oracle::rng::Rng;
use crate::solids::Solid;
use crate::twins::{Sent, Twins};
use crate::world::World;

/// Number of names: few, or so many that the plan switches its broad phase back and forth.
const BODIES: [usize; 4] = [10, 10, 10, 40];
/// Number of edits per tick, drawn; with many names occasionally up to [`BURST`].
const EDITS: [usize; 8] = [0, 0, 0, 1, 1, 2, 2, 4];
const BURST: usize = 14;

/// The state of a scene.
struct Draw {
    rng: Rng,
    twins: Twins,
    world: World,
    bodies: usize,
    /// Whether more bodies are put than removed.
    grows: bool,
    /// Distance of the bodies from the scene's origin, metres.
    place_m: f64,
    /// Bits of the bodies that are not sent for some ticks.
    silent: u64,
}

/// Runs a scene for `ticks` ticks.
pub fn scene(seed: u64, ticks: u64, seen: &mut Seen) {
    let mut rng = Rng::new(seed.wrapping_mul(0x9e37_79b9) + 1);
    let place_m = [0.0, 0.0, 1e3, 1e5][rng.below(4)];
    let bodies = BODIES[rng.below(BODIES.len())];
    let mut draw = Draw {
        twins: Twins::new(&mut rng),
        rng,
        world: World::default(),
        bodies,
        grows: true,
        place_m,
        silent: 0,
    };
    draw.tick(bodies, seen, &format!("seed {seed} tick 1"));
    for tick in 2..=ticks {
        let mut edits = EDITS[draw.rng.below(EDITS.len())];
        if bodies > BODIES[0] && draw.rng.below(4) == 0 {
            draw.grows = draw.world.things.len() < 20 || draw.grows && draw.world.things.len() < 36;
            edits = draw.rng.below(BURST);
        }
        draw.tick(edits, seen, &format!("seed {seed} tick {tick}"));
    }
}

impl Draw {
    fn tick(&mut self, edits: usize, seen: &mut Seen, what: &str) {
        let step_ns = [10_000_000, 10_000_000, 90_000_000][self.rng.below(3)];
        let now_ns = self.twins.wait(step_ns);
        let drawn: Vec<(Edit, Option<Solid>)> = (0..edits)
            .flat_map(|_| {
                let drawn = self.edit();
                let released = self.release(&drawn.0);
                std::iter::once(drawn).chain(released.map(|edit| (edit, None)))
            })
            .collect();
        // Each edit in its own request, or all edits in one.
        let together = if self.rng.below(2) == 0 {
            drawn.len().max(1)
        } else {
            1
        };
        let requests: Vec<Vec<Edit>> = drawn
            .chunks(together)
            .map(|request| request.iter().map(|(edit, _)| edit.clone()).collect())
            .collect();
        if self.rng.below(6) > 0 {
            self.frame();
        }
        let taken = self.twins.tick(&requests, &mut self.rng);
        // A tick applies edits before frames.
        self.world.now_ns = now_ns;
        for (request, taken) in drawn.chunks(together).zip(taken) {
            seen.edits[usize::from(taken)] += request.len() as u64;
            if !taken {
                continue;
            }
            self.world
                .begin_request(request.iter().map(|(edit, _)| edit));
            for (edit, solid) in request {
                self.world.apply(edit, solid.clone());
            }
        }
        if let Some(sent) = self.twins.take_sent() {
            if sent.is_anew {
                self.world.reset();
            }
            for (id, pose) in &sent.rows {
                self.world.take_row(*id, pose.as_ref());
            }
        }
        let told: Vec<String> = requests.iter().flatten().map(tell).collect();
        let what = format!("{what} ({})", told.join(", "));
        seen.check(&self.world, &self.twins, &what);
        self.world.end_tick();
    }

    fn id(&mut self) -> u64 {
        1 + self.rng.below(self.bodies) as u64
    }

    fn name(&mut self) -> String {
        format!("b{}", self.id())
    }

    /// The id that a put asks for; 0: none.
    fn asked_id(&mut self, name: &str) -> u64 {
        let known = self.world.ids.get(name).copied();
        match (self.rng.below(8), known) {
            (0..=3, _) => 0,
            (4..=6, Some(known)) => known,
            // Another body usually has this id.
            _ => self.id(),
        }
    }

    /// A random pose in a space too small for all bodies.
    fn place(&mut self) -> Pose {
        let room_m = if self.bodies > BODIES[0] { 3.5 } else { 2.0 };
        let at = self.rng.vector(room_m) + Vec3::new(self.place_m, 0.0, 0.0);
        self.rng.pose(at)
    }

    fn edit(&mut self) -> (Edit, Option<Solid>) {
        let (name, other) = (self.name(), self.name());
        // Scenes with many bodies draw more puts while they grow, and more removals while they shrink.
        let kind = match self
            .rng
            .below(if self.bodies > BODIES[0] { 32 } else { 16 })
        {
            kind @ 0..16 => kind,
            _ if self.grows => 0,
            _ => 4,
        };
        let rng = &mut self.rng;
        let edit = match kind {
            0..=3 => {
                return self.put(&name);
            }
            4 => Edit::Remove { name },
            5..=7 => Edit::Enable {
                name,
                enabled: rng.below(3) > 0,
            },
            8 => Edit::Filter {
                name,
                group: (rng.below(2) > 0).then(|| 1 << rng.below(2)),
                mask: (rng.below(2) > 0).then(|| [u32::MAX, 1][rng.below(2)]),
            },
            9 => Edit::Rule(PairRule {
                action: [PairAction::Check, PairAction::Ignore][rng.below(2)],
                a: name,
                b: other,
                reason: "drawn".to_owned(),
                report_within_m: None,
            }),
            10 => Edit::DropRules { a: name, b: other },
            11..=13 => {
                let pose = (rng.below(3) > 0).then(|| {
                    let at = rng.vector(1.5);
                    rng.pose(at)
                });
                Edit::Attach {
                    name,
                    to: Some(other),
                    pose,
                }
            }
            14 => {
                let pose = (rng.below(3) == 0).then(|| self.place());
                Edit::Attach {
                    name,
                    to: None,
                    pose,
                }
            }
            _ if rng.below(4) == 0 => Edit::Reset { source: None },
            _ => Edit::Enable {
                name,
                enabled: true,
            },
        };
        (edit, None)
    }

    /// Sometimes an attached body is detached in the next edit, whether or not its pose is known.
    fn release(&mut self, edit: &Edit) -> Option<Edit> {
        match edit {
            Edit::Attach { name, to, .. } if to.is_some() && self.rng.below(3) == 0 => {
                Some(Edit::Attach {
                    name: name.clone(),
                    to: None,
                    pose: None,
                })
            }
            _ => None,
        }
    }

    fn put(&mut self, name: &str) -> (Edit, Option<Solid>) {
        let mut solid = Solid::any(&mut self.rng, name);
        solid.spec.id = BodyId(self.asked_id(name));
        let pose = self.place();
        let other = self.name();
        let rng = &mut self.rng;
        let spec = &mut solid.spec;
        spec.pose = pose;
        spec.moves = rng.below(4) > 0;
        spec.source = spec.moves.then_some(0);
        spec.continuous = !solid.is_half_space && rng.below(3) == 0;
        spec.max_speed_mps = (rng.below(2) > 0).then_some(1.0);
        spec.on_stale = [
            None,
            Some(OnStale::Unknown),
            Some(OnStale::Hold),
            Some(OnStale::Remove),
        ][rng.below(4)];
        spec.report_within_m = [0.0, 0.3][rng.below(2)];
        spec.enabled = rng.below(8) > 0;
        if rng.below(5) == 0 {
            spec.pose = Pose::translation(1.0, 0.2, 0.0) * rng.pose(Vec3::zeros());
            spec.attached_to = Some(other);
        }
        let edit = Edit::Put(Put {
            body: Arc::new(solid.spec.clone()),
            shapes: solid.shapes.clone(),
        });
        (edit, Some(solid))
    }

    fn frame(&mut self) {
        if self.rng.below(10) == 0 {
            self.silent = self.rng.bits() & self.rng.bits();
        }
        let mut rows = Vec::new();
        for id in 1..=self.bodies as u64 {
            if self.silent >> id & 1 == 1 || self.rng.below(8) == 0 {
                continue;
            }
            let Some(thing) = self.world.things.get(&id) else {
                // No body has this id yet.
                rows.push((id, Some(self.place())));
                continue;
            };
            let (placed, now) = (thing.placed, thing.pose);
            let pose = match self.rng.below(12) {
                // The pose is unchanged.
                0..=2 if placed => now,
                3..=7 if placed => {
                    let step_m = [1e-4, 0.02, 0.2][self.rng.below(3)];
                    let turn = self.rng.direction() * self.rng.range(0.0, step_m);
                    let turned = Quat::from_scaled_axis(turn) * now.rotation;
                    let at = now.translation.vector + self.rng.vector(step_m);
                    Pose::from_parts(at.into(), turned)
                }
                _ => self.place(),
            };
            rows.push((id, (self.rng.below(60) > 0).then_some(pose)));
        }
        let is_anew = self.rng.below(60) == 0;
        let full = self.rng.below(2) == 0;
        self.twins.send(Sent { is_anew, rows }, full);
    }
}

/// An edit as short text.
fn tell(edit: &Edit) -> String {
    match edit {
        Edit::Put(Put { body, .. }) => {
            format!(
                "put {} as {} on {:?}",
                body.name, body.id.0, body.attached_to
            )
        }
        Edit::Remove { name } => format!("remove {name}"),
        Edit::Enable { name, enabled } => format!("enable {name} {enabled}"),
        Edit::Filter { name, .. } => format!("filter {name}"),
        Edit::Attach { name, to, pose } => {
            format!("attach {name} to {to:?}, told where: {}", pose.is_some())
        }
        Edit::Rule(rule) => format!("rule {} {}", rule.a, rule.b),
        Edit::DropRules { a, b } => format!("drop rules {a} {b}"),
        Edit::Margin { .. } => "margin".to_owned(),
        Edit::Reset { .. } => "reset".to_owned(),
    }
}
