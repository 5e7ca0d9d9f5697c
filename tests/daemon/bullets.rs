//! Continuous bodies over the wire: a bullet through a thin wall is reported, with its time of impact.

use sweepd::wire::{Event, Reason, State, Verdict, pair_flags};

use crate::edits::done;
use crate::live::{Desk, at, send, state, step, tick_until};

const WALL: &str = r#"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 5000
[[body]]
name = "wall"
id = 1
moves = false
shape = { type = "box", half_extents = [0.0005, 2.0, 2.0] }
[[body]]
name = "bullet"
id = 2
source = "sim"
continuous = true
teleport_m = 150.0
shape = { type = "sphere", radius = 0.004 }
"#;

#[test]
fn a_bullet_through_a_wall_is_told_with_its_time_and_a_teleport_is_no_bullet() {
    let desk = Desk::new();
    let _daemon = desk.run(WALL, &[]);
    let mut client = desk.source("sim");
    let mut seen = Vec::new();
    for x in [-40.0, 60.0, 61.0, -41.0, 160.0] {
        step(&mut client, &[at(2, x)]);
        let tick = *client.view().tick();
        let rows = &client.view().pairs().expect("listened to").rows;
        let hit = rows
            .iter()
            .find(|row| row.flags & pair_flags::SWEPT_HIT != 0);
        if let Some(row) = hit {
            assert_eq!((row.body_a, row.body_b), (1, 2));
            assert_eq!(row.verdict, Verdict::Apart.code());
            for event in [Event::Begin, Event::End, Event::Passed] {
                assert_ne!(row.events & event.bit(), 0, "{row:?}");
            }
            assert_eq!(state(&tick), State::Colliding);
            assert_ne!(tick.reasons & Reason::Swept.bit(), 0);
            assert!(row.toi_max - row.toi_min <= 1e-6, "{row:?}");
        }
        let jumped = tick.reasons & Reason::Teleported.bit() != 0;
        seen.push((x, hit.map(|row| row.toi_min), jumped));
    }
    let toi: Vec<_> = seen.iter().map(|(_, toi, _)| *toi).collect();
    let there = (40.0 - 0.0045) / 100.0;
    let back = (61.0 - 0.0045) / 102.0;
    assert!((toi[1].unwrap() - there).abs() < 1e-6, "{seen:?}");
    assert!((toi[3].unwrap() - back).abs() < 1e-6, "{seen:?}");
    assert!(
        toi[0].is_none() && toi[2].is_none() && toi[4].is_none(),
        "{seen:?}"
    );
    let jumps: Vec<_> = seen.iter().map(|(.., jumped)| *jumped).collect();
    assert_eq!(jumps, [false, false, false, false, true]);
}

#[test]
fn a_bullet_that_is_back_before_a_tick_looks_has_hit_the_wall() {
    let desk = Desk::new();
    let (wall, bullet) = WALL.rsplit_once("[[body]]").unwrap();
    let scene = wall.replace("on_frame = \"sim\"", "rate = 4");
    assert!(bullet.contains("bullet"));
    let _daemon = desk.run(&scene, &[]);
    let mut client = desk.source("sim");
    let put = r#"{"put": {"name": "bullet", "id": 2, "source": "sim", "continuous": true,
                          "shape": {"type": "sphere", "radius": 0.004}}}"#;
    let rev = done(&mut client, put);
    tick_until(&mut client, "the edit", |tick| tick.header.scene_rev >= rev);
    send(&mut client, &[at(2, -40.0)]);
    tick_until(&mut client, "where it starts", |tick| tick.unknown == 0);
    // Right after a tick: the next tick gets all three frames, and the last one has the bullet back at its start.
    for x in [-40.0, 60.0, -40.0] {
        send(&mut client, &[at(2, x)]);
    }
    let hit = tick_until(&mut client, "a hit on the way", |tick| {
        tick.reasons & Reason::Swept.bit() != 0
    });
    assert_eq!(state(&hit), State::Colliding);
    let rows = &client.view().pairs().expect("listened to").rows;
    let row = rows
        .iter()
        .find(|row| row.flags & pair_flags::SWEPT_HIT != 0)
        .expect("the hit");
    assert_eq!(row.verdict, Verdict::Apart.code());
}
