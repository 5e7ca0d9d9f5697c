//! Compares the results of the engines with the test's own world.

use std::collections::{BTreeMap, BTreeSet};

use sweepd::math::{Interval, Point, Pose, Quat};
use sweepd::wire::{BodyStatus, Event, Outbox, PairRow, State, Verdict, pair_flags};

use crate::twins::{ENGINES, Twins};
use crate::world::World;

/// Poses sampled on the way of a pair.
const LOOKS: u32 = 24;
/// Least depth of a sampled overlap, and tolerance of intervals, relative to the coordinates.
const NOISE: f64 = 1e-9;

type Key = (u64, u64);

/// Counters so far, and per engine the collisions that have begun and not ended.
#[derive(Default)]
pub struct Seen {
    /// Number of refused and of applied edits.
    pub edits: [u64; 2],
    begun: [BTreeSet<Key>; ENGINES],
    pair_ticks: u64,
    colliding: u64,
    unknown: u64,
    on_the_way: u64,
    clear: u64,
    ends: u64,
}

impl Seen {
    pub fn report(&self) {
        println!(
            "{} pairs checked, {} overlap, {} with an unknown place, {} touched on the way only; {} ticks clear; \
             {} ends; edits taken {}, refused {}",
            self.pair_ticks,
            self.colliding,
            self.unknown,
            self.on_the_way,
            self.clear,
            self.ends,
            self.edits[1],
            self.edits[0]
        );
    }

    /// Asserts that every kind of case occurred; otherwise the test would prove nothing about it.
    pub fn assert_enough(&self, ticks: u64) {
        assert!(self.pair_ticks > 4 * ticks, "{} pairs", self.pair_ticks);
        assert!(self.colliding > ticks / 2, "{} overlap", self.colliding);
        assert!(self.unknown > ticks / 2, "{} unknown", self.unknown);
        assert!(
            self.on_the_way > ticks / 100,
            "{} on the way",
            self.on_the_way
        );
        assert!(self.clear > ticks / 50, "{} clear", self.clear);
        assert!(self.edits[1] > ticks / 3, "{:?} edits", self.edits);
    }

    /// Checks all engines after a tick.
    pub fn check(&mut self, world: &World, twins: &Twins, what: &str) {
        if world.before.is_empty() {
            self.begun = Default::default();
        }
        let ids: Vec<u64> = world.things.keys().copied().collect();
        let pairs: Vec<Pair> = ids
            .iter()
            .flat_map(|a| ids.iter().filter(move |b| a < b).map(move |b| (*a, *b)))
            .map(|key| Pair::of(world, key))
            .collect();
        for pair in &pairs {
            self.pair_ticks += u64::from(pair.is_known);
            self.colliding += u64::from(pair.overlaps());
            self.unknown += u64::from(pair.checked && !pair.is_known);
            self.on_the_way += u64::from(pair.touched_on_the_way() && !pair.overlaps());
        }
        for (at, engine) in twins.engines.iter().enumerate() {
            let what = format!("{what} engine {at}");
            compare_bodies(world, engine.world(), &what);
            let out = engine.outbox();
            let rows: BTreeMap<Key, &PairRow> = out
                .pairs
                .iter()
                .map(|row| ((row.body_a, row.body_b), row))
                .collect();
            for pair in &pairs {
                pair.compare(rows.get(&pair.key).copied(), at == 0, &what);
            }
            self.follow_events(at, out, &what);
            self.check_begun(at, &pairs, &rows, &what);
            let state = State::from_code(out.tick.header.state).unwrap();
            check_state(world, &pairs, state, at == 0, &what);
            self.clear += u64::from(at == 0 && state == State::Clear);
        }
    }

    fn follow_events(&mut self, at: usize, out: &Outbox, what: &str) {
        let begun = &mut self.begun[at];
        for row in &out.pairs {
            let key = (row.body_a, row.body_b);
            let has = |event: Event| row.events & event.bit() != 0;
            let passed = has(Event::Passed);
            if passed {
                // Any earlier contact of the pair has ended with this event.
                begun.remove(&key);
                continue;
            }
            if has(Event::End) {
                assert!(
                    begun.remove(&key),
                    "{what} {key:?}: an end of nothing: {row:?}"
                );
                self.ends += 1;
            }
            if has(Event::Begin) {
                assert!(begun.insert(key), "{what} {key:?}: begun twice: {row:?}");
            }
            if has(Event::Persist) {
                assert!(
                    begun.contains(&key),
                    "{what} {key:?}: what never began goes on: {row:?}"
                );
            }
        }
    }

    /// Each collision that has begun must have a row, and each certified collision must have begun.
    fn check_begun(&self, at: usize, pairs: &[Pair], rows: &BTreeMap<Key, &PairRow>, what: &str) {
        let begun = &self.begun[at];
        for key in begun {
            let row = rows.get(key).copied();
            let verdict = row.and_then(said);
            let goes_on = matches!(verdict, Some(Verdict::Colliding | Verdict::Possible));
            assert!(goes_on, "{what} {key:?}: neither there nor ended: {row:?}");
            let pair = pairs.iter().find(|pair| pair.key == *key);
            assert!(
                pair.is_some_and(|pair| pair.checked),
                "{what} {key:?}: no pair, but not ended"
            );
        }
        for (key, row) in rows {
            let certified = said(row) == Some(Verdict::Colliding);
            assert!(
                !certified || begun.contains(key),
                "{what} {key:?}: no begin: {row:?}"
            );
        }
    }
}

/// The verdict of a row, if it is about this tick's poses.
fn said(row: &PairRow) -> Option<Verdict> {
    let verdict = Verdict::from_code(row.verdict).unwrap();
    (row.flags & pair_flags::GONE == 0 && verdict != Verdict::None).then_some(verdict)
}

/// A pair of bodies of the scene.
struct Pair {
    key: Key,
    checked: bool,
    /// Both poses are known or held.
    is_known: bool,
    /// At least one of the bodies has no place in the scene now.
    is_out: bool,
    reach_m: f64,
    /// Gap at this tick's poses, if the pair is checked.
    gap: Interval,
    is_mesh: bool,
    noise_m: f64,
    /// The least gap sampled on the way of this tick; infinite if no way was sampled.
    way_m: f64,
    /// The way of the pair is unknown to this test.
    any_way: bool,
}

impl Pair {
    fn of(world: &World, key: Key) -> Self {
        let (a, b) = key;
        let (one, other) = (&world.things[&a], &world.things[&b]);
        let (pose_a, pose_b) = (world.pose(a), world.pose(b));
        let status = [world.status(a), world.status(b)];
        let is = |wanted: &[BodyStatus]| status.iter().all(|status| wanted.contains(status));
        let out = |id: u64, status: BodyStatus| match status {
            BodyStatus::NotReceived | BodyStatus::Disabled | BodyStatus::RemovedByAge => true,
            BodyStatus::Rejected => !world.things[&world.root(id).0].placed,
            _ => false,
        };
        let checked = world.is_checked(a, b);
        let far = |pose: &Pose| pose.translation.vector.amax();
        let mut pair = Self {
            key,
            checked,
            is_known: checked && is(&[BodyStatus::Known, BodyStatus::Held]),
            is_out: out(a, status[0]) || out(b, status[1]),
            reach_m: world.reach_m(a) + world.reach_m(b),
            gap: Interval::UNKNOWN,
            is_mesh: one.solid.is_mesh || other.solid.is_mesh,
            noise_m: NOISE * (50.0 + far(&pose_a) + far(&pose_b)),
            way_m: f64::INFINITY,
            any_way: world.edited,
        };
        if checked {
            pair.gap = one.solid.gap(&pose_a, &other.solid, &pose_b);
        }
        if checked && !world.edited {
            pair.look_on_the_way(world);
        }
        pair
    }

    fn look_on_the_way(&mut self, world: &World) {
        let (a, b) = self.key;
        let (Some(way_a), Some(way_b)) = (Way::of(world, a), Way::of(world, b)) else {
            // One of the bodies had no known pose.
            self.any_way = true;
            return;
        };
        if !(way_a.is_swept || way_b.is_swept) {
            return;
        }
        let (one, other) = (&world.things[&a].solid, &world.things[&b].solid);
        for look in 0..=LOOKS {
            let share = f64::from(look) / f64::from(LOOKS);
            let gap = one.gap(&way_a.at(share), other, &way_b.at(share));
            if look == 0 && gap.min < self.noise_m {
                // A pair that touched at the start of the way is no new contact.
                self.any_way = true;
                return;
            }
            self.way_m = self.way_m.min(gap.max);
        }
    }

    fn overlaps(&self) -> bool {
        self.is_known && self.gap.max < -self.noise_m
    }

    fn touched_on_the_way(&self) -> bool {
        self.is_known && self.way_m < -self.noise_m
    }

    /// * `done` - whether the engine had no limit.
    fn compare(&self, row: Option<&PairRow>, done: bool, what: &str) {
        let verdict = row.and_then(said);
        let tell = |fault: &str| -> String {
            let (key, gap, way_m) = (self.key, self.gap, self.way_m);
            format!(
                "{what} {key:?}: {fault}: truth {gap:?}, reach {:e} m, on the way {way_m:e}, said {row:?}",
                self.reach_m
            )
        };
        if !self.checked || self.is_out {
            assert!(verdict.is_none(), "{}", tell("no pair"));
            return;
        }
        let open = matches!(verdict, Some(Verdict::Colliding | Verdict::Possible));
        if !self.is_known {
            let within = self.gap.min < self.reach_m && self.reach_m.is_finite();
            assert!(!within || open, "{}", tell("within reach"));
            let certified = verdict == Some(Verdict::Colliding);
            let for_sure = self.gap.max + self.reach_m < self.noise_m;
            assert!(!certified || for_sure, "{}", tell("certified, but unknown"));
            return;
        }
        assert!(!self.overlaps() || open, "{}", tell("missed"));
        let flags = row.map_or(0, |row| row.flags);
        let on_the_way = flags & (pair_flags::SWEPT_HIT | pair_flags::SWEPT_OPEN) != 0;
        assert!(
            !self.touched_on_the_way() || open || on_the_way,
            "{}",
            tell("missed on the way")
        );
        let made_up = verdict == Some(Verdict::Colliding) && self.gap.min > self.noise_m;
        assert!(!made_up, "{}", tell("made up"));
        let told_apart = self.gap.min > self.noise_m || self.gap.max < -self.noise_m;
        assert!(
            !(done && told_apart && verdict == Some(Verdict::Possible)),
            "{}",
            tell("left open")
        );
        if let (Some(_), Some(row)) = (verdict, row) {
            // The depth of a mesh is measured differently, and is never greater than that of its convex twin.
            let shallow = if self.is_mesh {
                self.gap.max.max(0.0)
            } else {
                self.gap.max
            };
            assert!(row.gap_min_m <= shallow + self.noise_m, "{}", tell("above"));
            assert!(
                row.gap_max_m >= self.gap.min - self.noise_m,
                "{}",
                tell("below")
            );
        }
    }
}

/// The motion of a body from its pose in the last tick.
struct Way {
    from: Pose,
    to: Pose,
    /// Pose in the frame of the root that the body is attached to.
    local: Pose,
    pivot: Point,
    is_swept: bool,
}

impl Way {
    /// `None` if the pose was not known in the last tick, or is not now.
    fn of(world: &World, id: u64) -> Option<Self> {
        let (root, local) = world.root(id);
        let before = world.before.get(&id)?;
        let known = |status: BodyStatus| status == BodyStatus::Known;
        if !known(before.status) || !known(world.status(id)) {
            return None;
        }
        Some(Self {
            from: world.before.get(&root)?.pose,
            to: world.pose(root),
            local,
            pivot: world.things[&root].solid.centre(),
            is_swept: world.things[&id].solid.spec.continuous,
        })
    }

    /// A body that is not continuous is at its final pose all the time.
    fn at(&self, share: f64) -> Pose {
        if !self.is_swept {
            return self.to * self.local;
        }
        let turn = (self.to.rotation * self.from.rotation.inverse()).scaled_axis();
        let turned = Quat::from_scaled_axis(turn * share) * self.from.rotation;
        let (from, to) = (self.from * self.pivot, self.to * self.pivot);
        let at = from + (to - from) * share - turned * self.pivot.coords;
        Pose::from_parts(at.coords.into(), turned) * self.local
    }
}

fn compare_bodies(world: &World, told: &sweepd::world::World, what: &str) {
    let mut count = 0;
    for (_, body) in told.bodies() {
        count += 1;
        let id = body.id.0;
        let name = &body.name;
        assert_eq!(world.ids.get(name), Some(&id), "{what}: the id of {name}");
        assert_eq!(body.status, world.status(id), "{what}: body {id}");
        if !world.things[&world.root(id).0].placed {
            continue;
        }
        let pose = world.pose(id);
        let off = (pose.translation.vector - body.pose.translation.vector).norm();
        let turn = pose.rotation.angle_to(&body.pose.rotation);
        let large = 50.0 + pose.translation.vector.amax();
        assert!(
            off < 1e-12 * large && turn < 1e-7,
            "{what}: body {id} is elsewhere by {off:e} m"
        );
    }
    assert_eq!(count, world.things.len(), "{what}");
}

fn check_state(world: &World, pairs: &[Pair], state: State, done: bool, what: &str) {
    let mut statuses = world.things.keys().map(|id| world.status(*id));
    let unsure = statuses.any(|s| !matches!(s, BodyStatus::Known | BodyStatus::Disabled));
    let touch = pairs
        .iter()
        .any(|pair| pair.overlaps() || pair.touched_on_the_way());
    if unsure || touch || world.things.is_empty() {
        assert!(
            state != State::Clear && state != State::Near,
            "{what}: {state:?}"
        );
    }
    if !done {
        return;
    }
    if pairs.iter().any(Pair::overlaps) {
        assert_eq!(state, State::Colliding, "{what}");
    }
    let apart = |pair: &Pair| {
        let way_is_free = !pair.any_way && pair.way_m > 0.5;
        !pair.checked || pair.is_out || pair.gap.min > pair.noise_m && way_is_free
    };
    let takes_part = pairs.iter().any(|pair| pair.checked && !pair.is_out);
    if !unsure && takes_part && pairs.iter().all(apart) {
        assert!(
            matches!(state, State::Clear | State::Near),
            "{what}: {state:?}"
        );
    }
}
