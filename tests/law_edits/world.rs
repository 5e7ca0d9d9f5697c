//! The test's own world: the properties of each body, its last input, and its attachment.

use std::collections::{BTreeMap, BTreeSet};

use sweepd::config::OnStale;
use sweepd::math::{Pose, relative};
use sweepd::scene::PairAction;
use sweepd::wire::BodyStatus;
use sweepd::world::{Edit, Put};

use crate::solids::Solid;

/// Timeout of the source in the scene.
const TIMEOUT_NS: u64 = 500_000_000;
/// A stale body that may have moved farther may be anywhere: the default of scenes, metres.
const STALE_REACH_M: f64 = 1.0;

pub struct Thing {
    pub solid: Solid,
    pub enabled: bool,
    pub group: u32,
    pub mask: u32,
    /// The body that it is attached to, and its pose there.
    pub hangs: Option<(u64, Pose)>,
    /// Its pose, if it is attached to none.
    pub pose: Pose,
    pub placed: bool,
    pub refused: bool,
    pub since_ns: u64,
}

/// Pose and status of a body in the last tick.
#[derive(Clone, Copy)]
pub struct Before {
    pub pose: Pose,
    pub status: BodyStatus,
}

#[derive(Default)]
pub struct World {
    pub things: BTreeMap<u64, Thing>,
    /// Rules: whether to check, and the two bodies; the last matching rule applies.
    rules: Vec<(bool, u64, u64)>,
    pub now_ns: u64,
    pub before: BTreeMap<u64, Before>,
    /// Whether anything but frame rows has changed the world since the last tick.
    pub edited: bool,
    /// The id of each name that ever had a body.
    pub ids: BTreeMap<String, u64>,
    /// Poses of bodies before a request, or as put by it.
    found: BTreeMap<u64, Pose>,
}

impl World {
    /// Stores the state after a tick as that of the last tick.
    pub fn end_tick(&mut self) {
        let now = |id: &u64| Before {
            pose: self.pose(*id),
            status: self.status(*id),
        };
        self.before = self.things.keys().map(|id| (*id, now(id))).collect();
        self.edited = false;
    }

    /// The root body that it is attached to, directly or through others, and its pose there.
    pub fn root(&self, id: u64) -> (u64, Pose) {
        let (mut at, mut pose) = (id, Pose::identity());
        while let Some((to, local)) = self.things[&at].hangs {
            pose = local * pose;
            at = to;
        }
        (at, pose)
    }

    pub fn pose(&self, id: u64) -> Pose {
        let (root, local) = self.root(id);
        self.things[&root].pose * local
    }

    pub fn moves(&self, id: u64) -> bool {
        self.things[&self.root(id).0].solid.spec.moves
    }

    pub fn status(&self, id: u64) -> BodyStatus {
        let root = &self.things[&self.root(id).0];
        let age_ns = self.now_ns - root.since_ns;
        if !self.things[&id].enabled {
            BodyStatus::Disabled
        } else if !root.solid.spec.moves {
            BodyStatus::Known
        } else if root.refused {
            BodyStatus::Rejected
        } else if !root.placed {
            BodyStatus::NotReceived
        } else if age_ns < TIMEOUT_NS {
            BodyStatus::Known
        } else {
            match root.solid.spec.on_stale.unwrap_or_default() {
                OnStale::Hold => BodyStatus::Held,
                OnStale::Remove => BodyStatus::RemovedByAge,
                OnStale::Unknown => BodyStatus::Stale,
            }
        }
    }

    /// Greatest distance from its last known position, metres.
    pub fn reach_m(&self, id: u64) -> f64 {
        let age_ns = self.now_ns - self.things[&self.root(id).0].since_ns;
        match (self.status(id), self.things[&id].solid.spec.max_speed_mps) {
            (BodyStatus::Known | BodyStatus::Held, _) => 0.0,
            (BodyStatus::Stale, Some(speed_mps)) => Some(speed_mps * age_ns as f64 * 1e-9)
                .filter(|reach_m| *reach_m < STALE_REACH_M - 1e-9)
                .unwrap_or(f64::INFINITY),
            _ => f64::INFINITY,
        }
    }

    /// Whether a pair of bodies is to be checked, regardless of their poses.
    pub fn is_checked(&self, a: u64, b: u64) -> bool {
        let (one, other) = (&self.things[&a], &self.things[&b]);
        if !(one.enabled && other.enabled)
            || !(self.moves(a) || self.moves(b))
            || (one.solid.is_half_space && other.solid.is_half_space)
        {
            return false;
        }
        let named =
            |rule: &&(bool, u64, u64)| (rule.1, rule.2) == (a, b) || (rule.1, rule.2) == (b, a);
        if let Some((check, ..)) = self.rules.iter().rev().find(named) {
            return *check;
        }
        self.root(a).0 != self.root(b).0
            && one.group & other.mask != 0
            && other.group & one.mask != 0
    }

    /// The id of a name; 0 if it never had a body: within a request a body may be attached to such a name.
    fn id_of(&self, name: &str) -> u64 {
        self.ids.get(name).copied().unwrap_or(0)
    }

    /// Assigns ids to the names of a request: first those asked for, then the least free ones, in order.
    fn take_ids<'a>(&mut self, edits: impl Iterator<Item = &'a Edit>) {
        let (mut asked, mut others) = (Vec::new(), Vec::new());
        for edit in edits {
            if let Edit::Put(Put { body, .. }) = edit {
                match body.id.0 {
                    0 => others.push(&body.name),
                    id => asked.push((&body.name, id)),
                }
            }
        }
        for (name, id) in asked {
            let given = *self.ids.entry(name.clone()).or_insert(id);
            assert_eq!(given, id, "{name} has another id");
        }
        for name in others {
            let is_given = |id: &u64| self.ids.values().any(|given| given == id);
            let free = (1..).find(|id| !is_given(id)).unwrap();
            self.ids.entry(name.clone()).or_insert(free);
        }
        let each: BTreeSet<u64> = self.ids.values().copied().collect();
        assert_eq!(each.len(), self.ids.len(), "an id of two names");
    }

    /// Begins a request that the engines applied.
    pub fn begin_request<'a>(&mut self, edits: impl Iterator<Item = &'a Edit>) {
        self.take_ids(edits);
        let found = |id: &u64| (*id, self.pose(*id));
        self.found = self.things.keys().map(found).collect();
    }

    /// Within a request: the root that a body is attached to, and the resulting pose. If a body on the way to the root
    /// is missing, or the attachments form a cycle: no root, and the pose that follows from the last present body's
    /// pose before the request.
    fn by_now(&self, id: u64) -> (Option<u64>, Pose) {
        let (mut at, mut pose) = (id, Pose::identity());
        for _ in 0..=self.things.len() {
            let Some((to, local)) = self.things[&at].hangs else {
                return (Some(at), self.things[&at].pose * pose);
            };
            if !self.things.contains_key(&to) {
                break;
            }
            pose = local * pose;
            at = to;
        }
        (None, self.found[&at] * pose)
    }

    /// Applies an edit that the engines applied.
    pub fn apply(&mut self, edit: &Edit, solid: Option<Solid>) {
        self.edited = true;
        match edit {
            Edit::Put(Put { body, .. }) => {
                let solid = solid.unwrap();
                let id = self.id_of(&body.name);
                let to = body.attached_to.as_deref().map(|to| self.id_of(to));
                let thing = Thing {
                    enabled: body.enabled,
                    group: body.group,
                    mask: body.mask,
                    hangs: to.map(|to| (to, body.pose)),
                    pose: body.pose,
                    placed: !body.moves,
                    refused: false,
                    since_ns: 0,
                    solid,
                };
                self.found.insert(id, body.pose);
                self.things.insert(id, thing);
            }
            Edit::Remove { name } => {
                self.things.remove(&self.id_of(name));
            }
            Edit::Enable { name, enabled } => self.named(name).enabled = *enabled,
            Edit::Filter { name, group, mask } => {
                let thing = self.named(name);
                thing.group = group.unwrap_or(thing.group);
                thing.mask = mask.unwrap_or(thing.mask);
            }
            Edit::Rule(rule) => {
                let check = rule.action == PairAction::Check;
                let (a, b) = (self.id_of(&rule.a), self.id_of(&rule.b));
                self.rules.push((check, a, b));
            }
            Edit::DropRules { a, b } => {
                let (a, b) = (self.id_of(a), self.id_of(b));
                let is_of = |x: u64, y: u64| (x, y) == (a, b) || (x, y) == (b, a);
                self.rules.retain(|rule| !is_of(rule.1, rule.2));
            }
            Edit::Attach { name, to, pose } => match to {
                Some(to) => {
                    let (id, to) = (self.id_of(name), self.id_of(to));
                    let by_now = |id: u64| {
                        let (root, at) = self.by_now(id);
                        assert!(
                            pose.is_some() || root.is_none_or(|root| !self.is_too_old(root)),
                            "{name} hung where it is, which is not known"
                        );
                        at
                    };
                    let local = pose.unwrap_or_else(|| relative(&by_now(to), &by_now(id)));
                    self.named(name).hangs = Some((to, local));
                }
                None => self.detach(name, pose.as_ref()),
            },
            Edit::Reset { .. } => self.reset(),
            Edit::Margin { .. } => {}
        }
    }

    /// Whether it has been received, but its last pose is older than the timeout.
    fn is_too_old(&self, id: u64) -> bool {
        let thing = &self.things[&id];
        thing.solid.spec.moves && thing.placed && self.now_ns - thing.since_ns >= TIMEOUT_NS
    }

    fn named(&mut self, name: &str) -> &mut Thing {
        let id = self.id_of(name);
        self.things.get_mut(&id).unwrap()
    }

    fn detach(&mut self, name: &str, pose: Option<&Pose>) {
        let id = self.id_of(name);
        if self.things[&id].hangs.is_none() {
            return;
        }
        let (root, at) = self.by_now(id);
        let now_ns = self.now_ns;
        let root = root.map(|root| &self.things[&root]);
        let (placed, refused) = root.map_or((false, false), |root| (root.placed, root.refused));
        let moves = root.is_some_and(|root| root.solid.spec.moves);
        let since_ns = root.map_or(0, |root| root.since_ns);
        let thing = self.named(name);
        thing.hangs = None;
        let fixed = !thing.solid.spec.moves;
        thing.pose = pose.copied().filter(|_| fixed).unwrap_or(at);
        thing.placed = placed || fixed;
        thing.refused = refused && !fixed;
        thing.since_ns = if moves { since_ns } else { now_ns };
        let at = thing.pose;
        self.found.insert(id, at);
    }

    /// Discards all poses received in frames.
    pub fn reset(&mut self) {
        self.edited = true;
        for thing in self.things.values_mut() {
            if thing.solid.spec.moves {
                (thing.placed, thing.refused) = (false, false);
            }
        }
    }

    /// Applies a row of a frame; `None`: a row without valid numbers.
    pub fn take_row(&mut self, id: u64, pose: Option<&Pose>) {
        let now_ns = self.now_ns;
        let Some(thing) = self.things.get_mut(&id) else {
            return;
        };
        if thing.hangs.is_some() || !thing.solid.spec.moves {
            return;
        }
        thing.refused = pose.is_none();
        if let Some(pose) = pose {
            (thing.pose, thing.placed, thing.since_ns) = (*pose, true, now_ns);
        }
    }
}
