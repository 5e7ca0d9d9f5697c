//! Deforming bodies, over the wire and in the daemon: a cloth on a box, and a tree that is rebuilt.

use std::sync::Arc;

use sweepd::daemon::{Daemon, build_shapes};
use sweepd::scene::Scene;
use sweepd::time::SystemClock;
use sweepd::transport::client::{Client, FrameInfo, Part, Rows};
use sweepd::transport::memory::{Hub, MemoryServer};
use sweepd::wire::{BodyStatus, RejectReason, State, VertexRow};

use crate::live::{Desk, LONG, SECOND_NS, at, state, step};

const CELLS: usize = 12;

/// A square cloth of side 2 m in the x-y plane, one metre above a box.
fn scene() -> String {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..=CELLS {
        for j in 0..=CELLS {
            let place = |k: usize| f64::from(u32::try_from(k).unwrap()) / 6.0 - 1.0;
            vertices.push([place(j), place(i), 1.0]);
            if i < CELLS && j < CELLS {
                let a = i * (CELLS + 1) + j;
                let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    format!(
        "[run]\non_frame = \"sim\"\n[[source]]\nname = \"sim\"\ntimeout_ms = 5000\n\
         [[body]]\nname = \"cloth\"\nid = 1\ndeforms = true\n\
         shape = {{ type = \"trimesh\", vertices = {vertices:?}, faces = {faces:?} }}\n\
         [[body]]\nname = \"box\"\nid = 2\n\
         shape = {{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }}\n"
    )
}

/// The cloth stretched by a factor, with its middle pushed down to a height.
fn cloth(height: f32, stretch: f32) -> Vec<VertexRow> {
    let place = |k: usize| f32::from(u8::try_from(k).unwrap()) / 6.0 - 1.0;
    let rows = (0..=CELLS).flat_map(|i| (0..=CELLS).map(move |j| (place(j), place(i))));
    let bent = rows.map(|(x, y)| {
        let down = (1.0 - height) * (-4.0 * (x * x + y * y)).exp();
        VertexRow {
            position: [stretch * x, stretch * y, 1.0 - down],
        }
    });
    bent.collect()
}

#[test]
fn a_cloth_that_sinks_onto_a_box_is_told_over_shared_memory_in_each_step() {
    let desk = Desk::new();
    let _daemon = desk.run(&scene(), &[]);
    let mut client = desk.source("sim");
    let poses = [at(1, 0.0), at(2, 0.0)];
    step(&mut client, &poses);
    assert_eq!(state(client.view().tick()), State::Unknown, "no vertices");
    let total = u32::try_from((CELLS + 1) * (CELLS + 1)).unwrap();
    for k in 0..60_u8 {
        let height = 0.5 + 0.2 * (0.3 * f32::from(k)).cos();
        let rows = cloth(height, 1.0);
        if k % 2 == 0 {
            client.send_vertices(1, Part::Full, &rows).unwrap();
        } else {
            // All vertices except for the first, a corner that does not move.
            let part = Part::Range { first: 1, total };
            client.send_vertices(1, part, &rows[1..]).unwrap();
        }
        step(&mut client, &poses);
        let wanted = if height < 0.5 {
            State::Colliding
        } else {
            State::Clear
        };
        assert_eq!(state(client.view().tick()), wanted, "step {k} at {height}");
    }
    let mut wrong = cloth(0.9, 1.0);
    wrong[5].position[1] = f32::NAN;
    client.send_vertices(1, Part::Full, &wrong).unwrap();
    step(&mut client, &poses);
    let tick = *client.view().tick();
    assert_eq!(state(&tick), State::Unknown);
    let counted = tick.rejects[usize::from(RejectReason::NotFinite.code())];
    let row = client.view().bodies().unwrap().rows[0];
    assert_eq!((counted, row.reject), (1, RejectReason::NotFinite.code()));
    assert_eq!(row.status, BodyStatus::Rejected.code());
    // A new client is accepted once the daemon knows that the old one is gone, and must send all vertices again.
    drop(client);
    let mut client = desk.source("sim");
    let info = FrameInfo::default();
    let started = std::time::Instant::now();
    while client.step(&info, Rows::Poses(&poses), SECOND_NS).is_err() {
        assert!(started.elapsed() < LONG);
    }
    let row = client.view().bodies().unwrap().rows[0];
    assert_eq!(row.status, BodyStatus::NotReceived.code());
    client
        .send_vertices(1, Part::Full, &cloth(0.9, 1.0))
        .unwrap();
    step(&mut client, &poses);
    assert_eq!(state(client.view().tick()), State::Clear);
}

#[test]
fn the_tree_of_a_cloth_that_is_stretched_is_built_anew_while_ticks_go_on() {
    let hub = Hub::new();
    let scene = Scene::parse(&scene(), "cloth.toml", std::path::Path::new("")).unwrap();
    let shapes = build_shapes(&scene).unwrap();
    let mut door = MemoryServer::open(&hub, 7, SECOND_NS).unwrap();
    let clock = Arc::new(SystemClock);
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let link = Box::new(hub.link());
    let mut client = Client::over(link, clock, Some("sim"), SECOND_NS).unwrap();
    let poses = [at(1, 0.0), at(2, 0.0)];
    let started = std::time::Instant::now();
    let (mut worn, mut ticks) = (false, 0_u16);
    while !(worn && ticks > 20 && daemon.engine().worn_tree().is_none()) {
        assert!(started.elapsed() < LONG, "{ticks} ticks, worn: {worn}");
        // The middle of the cloth enters and leaves the box, so that its pair always needs work.
        let height = if ticks % 2 == 0 { 0.4 } else { 0.6 };
        let stretch = if ticks < 5 { 1.0 } else { 3.0 };
        client
            .send_vertices(1, Part::Full, &cloth(height, stretch))
            .unwrap();
        let info = FrameInfo::default();
        client.send(&info, Rows::Poses(&poses)).unwrap();
        daemon.round(None).unwrap();
        worn |= daemon.engine().worn_tree().is_some();
        daemon.engine().validate().unwrap();
        let colliding = daemon.engine().outbox().tick.header.state == State::Colliding.code();
        if daemon.engine().outbox().tick.sources[0].frames > u64::from(ticks) {
            assert_eq!(colliding, height < 0.5, "tick {ticks}");
            ticks += 1;
        }
    }
}
