//! Pair rules in long requests, compared with requests of one edit each and with a walk over all pairs.

use std::sync::Arc;

use sweepd::limits::PATTERN_MATCHES_MAX;
use sweepd::math::Pose;
use sweepd::scene::{BodySpec, PairAction, PairRule};
use sweepd::world::{Edit, Parts, Put, World};

use crate::support::{Bench, START_NS, cube, fixed, floor, moving, rule, scene};

struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        usize::try_from(self.0 >> 33).unwrap() % end
    }

    fn side(&mut self) -> String {
        match self.below(6) {
            0 => ["*", "b?", "b1*", "*2", "wall*", "b*3"][self.below(6)].to_owned(),
            _ => format!("b{}", self.below(40)),
        }
    }

    fn rule(&mut self) -> PairRule {
        let action = [PairAction::Check, PairAction::Ignore][self.below(2)];
        let (a, b) = (self.side(), self.side());
        PairRule {
            report_within_m: [None, Some(0.5)][self.below(2)],
            ..rule(action, &a, &b)
        }
    }
}

fn put(body: BodySpec) -> Edit {
    Edit::Put(Put {
        body: Arc::new(body),
        shapes: cube(),
    })
}

/// The number of pairs that the filters ignore, counted one by one.
fn walk(world: &World) -> u64 {
    let slots: Vec<_> = world.bodies().map(|(slot, _)| slot).collect();
    let pairs = slots.iter().enumerate().flat_map(|(at, a)| {
        let behind = slots[at + 1..].iter();
        behind.map(move |b| world.filters().decide(*a, *b).is_ignored())
    });
    pairs.map(u64::from).sum()
}

#[test]
fn bug_rules_of_one_request_mean_what_they_mean_one_by_one() {
    let mut random = Random(7);
    for round in 0..40 {
        let bodies: Vec<_> = (0..20).map(|k| moving(&format!("b{k}"), k + 1)).collect();
        let first: Vec<_> = (0..round % 5)
            .map(|_| rule(PairAction::Ignore, &random.side(), "*"))
            .collect();
        let mut single = Bench::with_rules(bodies.clone(), first.clone());
        let mut whole = Bench::with_rules(bodies, first);
        let mut request = Vec::new();
        let rev = single.world.scene_rev();
        while request.len() < 60 {
            let edit = match random.below(5) {
                0 => put(moving(&format!("b{}", random.below(40)), 0)),
                1 => Edit::Remove {
                    name: format!("b{}", random.below(40)),
                },
                2 => {
                    let (a, b) = (random.side(), random.side());
                    Edit::DropRules { a, b }
                }
                _ => Edit::Rule(random.rule()),
            };
            // An edit that is refused alone is omitted from the request.
            if single.world.apply(std::slice::from_ref(&edit)).is_ok() {
                request.push(edit);
            }
        }
        let applied = whole.world.apply(&request).unwrap();
        assert_eq!(applied.changed, single.world.scene_rev() > rev);
        for bench in [&mut single, &mut whole] {
            bench.world.age(bench.now_ns);
        }
        let (one, other) = (&single.world, &whole.world);
        for (slot_a, a) in one.bodies() {
            for (slot_b, b) in one.bodies().filter(|(_, b)| b.id < a.id) {
                let name = |body: &sweepd::world::Body| other.slot_named(&body.name).unwrap();
                let (x, y) = (name(a), name(b));
                assert_eq!(
                    one.filters().decide(slot_a, slot_b),
                    other.filters().decide(x, y)
                );
                assert_eq!(one.report_within(slot_a, slot_b), other.report_within(x, y));
            }
        }
        assert_eq!(one.ignored_pairs_count(), other.ignored_pairs_count());
        assert_eq!(one.filters().forced_pairs(), other.filters().forced_pairs());
        other.validate().unwrap();
    }
}

#[test]
fn bug_the_count_of_ignored_pairs_is_that_of_a_walk_over_all_pairs() {
    let mut random = Random(3);
    for round in 0..60 {
        let mut bodies = Vec::new();
        let mut shapes: Vec<Parts> = Vec::new();
        for k in 0..40_u64 {
            let name = format!("b{k}");
            let mut body = match random.below(5) {
                0 => fixed(&format!("wall{k}"), k + 1, 9.0),
                _ => moving(&name, k + 1),
            };
            let others = bodies.len().max(1);
            let before = |at: usize, bodies: &[BodySpec]| bodies.get(at).map(|b| b.name.clone());
            match random.below(4) {
                0 => body.rigid_group = Some(format!("g{}", random.below(4))),
                1 => body.parent = before(random.below(others), &bodies),
                _ => {}
            }
            if random.below(3) == 0 {
                body.attached_to = before(random.below(others), &bodies);
                body.pose = Pose::translation(1.0, 0.0, 0.0);
            }
            let is_floor = random.below(12) == 0;
            shapes.push(if is_floor { floor() } else { cube() });
            bodies.push(body);
        }
        let rules: Vec<_> = (0..round).map(|_| random.rule()).collect();
        let mut world = World::new(&scene(bodies, rules), shapes, START_NS).unwrap();
        assert_eq!(world.ignored_pairs_count(), walk(&world), "round {round}");
        for _ in 0..10 {
            let edit = match random.below(3) {
                0 => Edit::Rule(random.rule()),
                1 => Edit::Attach {
                    name: format!("b{}", random.below(40)),
                    to: Some(format!("b{}", random.below(40))),
                    pose: Some(Pose::identity()),
                },
                _ => put(BodySpec {
                    rigid_group: Some("g1".to_owned()),
                    ..moving(&format!("b{}", random.below(40)), 0)
                }),
            };
            let _may_be_refused = world.apply(&[edit]);
            world.age(START_NS);
            assert_eq!(world.ignored_pairs_count(), walk(&world), "round {round}");
        }
    }
}

/// A request with as many rules as bodies, and one body enabled among many pairs of attached bodies.
#[test]
#[ignore = "timing; SWEEPD_CI_SLOW=1 .ci/run runs it"]
#[allow(clippy::disallowed_methods, reason = "a timing")]
fn long_requests_of_rules_and_many_groups_take_no_longer_than_reading_them() {
    let mut bodies: Vec<_> = (0..5000).map(|k| moving(&format!("b{k}"), k + 1)).collect();
    let mut bench = Bench::of(bodies.clone());
    let rules: Vec<_> = (0..5000)
        .map(|k| {
            let (a, b) = (format!("b{k}"), format!("b{}*", (k * 7) % 5000));
            Edit::Rule(rule(PairAction::Ignore, &a, &b))
        })
        .collect();
    let start = std::time::Instant::now();
    bench.world.apply(&rules).unwrap();
    bench.world.age(START_NS);
    let took = start.elapsed();
    println!("5,000 rules: {took:?}");
    assert!(took.as_millis() < 1000);

    let more = (0..95_000).map(|k| BodySpec {
        attached_to: (k % 2 == 1).then(|| format!("c{}", k - 1)),
        ..moving(&format!("c{k}"), k + 5001)
    });
    bodies.extend(more);
    let mut bench = Bench::of(bodies);
    let start = std::time::Instant::now();
    let disable = Edit::Enable {
        name: "b0".to_owned(),
        enabled: false,
    };
    bench.world.apply(&[disable]).unwrap();
    bench.world.age(START_NS);
    let took = start.elapsed();
    println!("47,500 attached pairs: {took:?}");
    assert_eq!(bench.world.ignored_pairs_count(), 47_500);
    assert!(took.as_millis() < 1000);
}

/// The matches of a pattern are stored for each rule. Beyond a limit a request is refused as a whole, whether it adds
/// rules or names, and so is a scene. Without the limit a request that fits in a message could block the daemon for
/// minutes.
#[test]
fn bug_what_pair_rules_with_patterns_match_was_without_bound() {
    const NAMES: u64 = 3000;
    let ignore = |k: u64| rule(PairAction::Ignore, "*", &format!("b{k}"));
    let rules = |count: u64| (1..=count).map(ignore);
    let edits = |count: u64| rules(count).map(Edit::Rule).collect::<Vec<_>>();
    let bodies = || -> Vec<BodySpec> { (1..=NAMES).map(|k| moving(&format!("b{k}"), k)).collect() };
    let mut world = Bench::with_rules(bodies(), Vec::new()).world;
    // Each rule matches every name once, and one name twice.
    let most = PATTERN_MATCHES_MAX as u64 / (NAMES + 1);
    let rev = world.scene_rev();
    let why = world.apply(&edits(most + 1)).unwrap_err();
    assert!(why.contains("write fewer rules"), "{why}");
    assert_eq!((world.scene_rev(), world.filters().rules_count()), (rev, 0));
    let mut steps = 0;
    let applied = world.apply_stepwise(&edits(most), &mut || steps += 1);
    assert!(applied.unwrap().changed);
    // Each rule takes four steps: check, count, apply, compile. Each different side takes one, the search for bodies.
    let sides = most + 1;
    assert_eq!(steps, 4 * most + sides);
    // There is room for one more name that all these rules match.
    let more = |k: u64| put(moving(&format!("more{k}"), 0));
    assert!(
        world
            .apply(&[more(1), more(2)])
            .unwrap_err()
            .contains("fewer rules")
    );
    world.apply(&[more(1)]).unwrap();
    assert!(world.apply(&[more(2)]).unwrap_err().contains("fewer rules"));
    // The same request may drop some of these rules.
    let drop = |k: u64| Edit::DropRules {
        a: "*".to_owned(),
        b: format!("b{k}"),
    };
    world.apply(&[more(2), drop(1), drop(2)]).unwrap();

    let scene = scene(bodies(), rules(most + 1).collect());
    let shapes = scene.bodies.iter().map(|_| cube()).collect();
    let why = World::new(&scene, shapes, START_NS)
        .unwrap_err()
        .to_string();
    assert!(why.contains("write fewer rules"), "{why}");
}
