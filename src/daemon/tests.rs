//! A tree that the worker cannot build; a recording on a slow disk that ends.

use std::time::Duration;

use super::*;
use crate::record::{Sink, TickRecord};
use crate::scene::Scene;
use crate::time::SystemClock;
use crate::transport::client::{Client, FrameInfo, Part, Rows};
use crate::transport::memory::{Hub, MemoryServer};
use crate::wire::{TransformRow, VertexRow};

const CELLS: u16 = 12;
const SECOND_NS: u64 = 1_000_000_000;
const LONG_NS: u64 = 60 * SECOND_NS;

fn place(k: u16) -> f32 {
    f32::from(k) / 6.0 - 1.0
}

/// A square of side 2, its middle within a box.
fn scene() -> Scene {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..=CELLS {
        for j in 0..=CELLS {
            vertices.push([place(j), place(i), 0.2]);
            if i < CELLS && j < CELLS {
                let a = i * (CELLS + 1) + j;
                let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let text = format!(
        "[run]\non_frame = \"sim\"\n[[source]]\nname = \"sim\"\ntimeout_ms = 5000\n\
         [[body]]\nname = \"cloth\"\nid = 1\ndeforms = true\n\
         shape = {{ type = \"trimesh\", vertices = {vertices:?}, faces = {faces:?} }}\n\
         [[body]]\nname = \"box\"\nid = 2\n\
         shape = {{ type = \"box\", half_extents = [0.5, 0.5, 0.5] }}\n"
    );
    Scene::parse(&text, "cloth.toml", std::path::Path::new("")).unwrap()
}

/// The cloth, twisted and stretched.
fn cloth(height: f32, stretch: f32) -> Vec<VertexRow> {
    let rows = (0..=CELLS).flat_map(|i| (0..=CELLS).map(move |j| (place(j), place(i))));
    let bent = rows.map(|(x, y)| VertexRow {
        position: [stretch * x, stretch * y, height + 0.1 * (stretch - 1.0) * x],
    });
    bent.collect()
}

#[test]
fn a_tree_that_cannot_be_built_is_told_once_and_asked_for_again_only_with_other_vertices() {
    let hub = Hub::new();
    let scene = scene();
    let shapes = build_shapes(&scene).unwrap();
    let mut door = MemoryServer::open(&hub, 7, SECOND_NS).unwrap();
    let clock = Arc::new(SystemClock);
    let mut daemon = Daemon::new(&scene, shapes, 7, clock.clone(), &mut door).unwrap();
    let link = Box::new(hub.link());
    let mut client = Client::over(link, clock, Some("sim"), SECOND_NS).unwrap();
    let at = |body| TransformRow {
        body,
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..TransformRow::default()
    };
    let poses = [at(1), at(2)];
    let mut frame = |daemon: &mut Daemon<'_>, vertices: Option<&[VertexRow]>| {
        if let Some(rows) = vertices {
            client.send_vertices(1, Part::Full, rows).unwrap();
        }
        client
            .send(&FrameInfo::default(), Rows::Poses(&poses))
            .unwrap();
        let ticks = daemon.engine().ticks();
        let started_ns = SystemClock.monotonic_ns();
        while daemon.engine().ticks() == ticks {
            assert!(SystemClock.monotonic_ns() < started_ns + LONG_NS);
            daemon.round(None).unwrap();
        }
    };
    frame(&mut daemon, Some(&cloth(0.2, 1.0)));
    let mut height = 0.2;
    while daemon.engine().worn_tree().is_none() {
        height += 0.001;
        assert!(height < 0.4, "never worn");
        frame(&mut daemon, Some(&cloth(height, 3.0)));
    }
    // As in its next round, which asks the worker, whose building fails.
    let fail = |daemon: &mut Daemon<'_>| {
        let worn = daemon.engine.worn_tree().unwrap();
        daemon.tree_asked = Some(worn.of());
        daemon.builder.build_tree(worn.spoil());
        let started_ns = SystemClock.monotonic_ns();
        while daemon.tree_asked.is_some() {
            assert!(SystemClock.monotonic_ns() < started_ns + LONG_NS);
            daemon.receive().unwrap();
        }
        assert!(daemon.engine.worn_tree().is_none());
    };
    fail(&mut daemon);
    for _ in 0..20 {
        frame(&mut daemon, None);
        assert!(daemon.tree_asked.is_none() && daemon.engine.worn_tree().is_none());
        daemon.engine.validate().unwrap();
    }
    // Other vertices are tried, two updates later if they fail too, and it is not logged again.
    frame(&mut daemon, Some(&cloth(0.21, 3.0)));
    let of = daemon.engine.worn_tree().unwrap().of();
    fail(&mut daemon);
    assert_eq!(daemon.engine.refuse_tree(of), None);
    let mut updates = 0_u16;
    while daemon.tree_asked.is_none() && daemon.engine.worn_tree().is_none() {
        updates += 1;
        frame(
            &mut daemon,
            Some(&cloth(0.2 + 0.01 * f32::from(updates), 3.0)),
        );
    }
    // The last refusal was the third.
    assert_eq!(updates, 4);
    // This one is built.
    let started_ns = SystemClock.monotonic_ns();
    frame(&mut daemon, None);
    while daemon.tree_asked.is_some() {
        assert!(SystemClock.monotonic_ns() < started_ns + LONG_NS);
        daemon.receive().unwrap();
    }
    frame(&mut daemon, None);
    assert!(daemon.engine.worn_tree().is_none());
    daemon.engine.validate().unwrap();
}

/// Accepts each tick when signalled, and all once the sender is gone.
struct Slow(std::sync::mpsc::Receiver<()>);

impl Sink for Slow {
    fn tick(&mut self, _: &TickRecord, _: bool) -> Result<()> {
        let _nobody_left = self.0.recv();
        Ok(())
    }
    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
    fn end(&mut self, _: &str) -> Result<()> {
        Ok(())
    }
}

#[test]
fn bug_the_end_of_a_recording_may_take_longer_than_the_watchdog_waits() {
    let (hub, scene) = (Hub::new(), scene());
    let shapes = build_shapes(&scene).unwrap();
    let mut door = MemoryServer::open(&hub, 7, SECOND_NS).unwrap();
    let mut daemon = Daemon::new(&scene, shapes, 7, Arc::new(SystemClock), &mut door).unwrap();
    let (let_go, may) = std::sync::mpsc::channel();
    daemon.record(Recorder::start(Box::new(Slow(may))).unwrap());
    daemon.run(&AtomicBool::new(false), Some(2)).unwrap();
    let (told, stuck) = std::sync::mpsc::channel();
    let limit = Duration::from_millis(50);
    let watchdog = Watchdog::start(limit, move || told.send(()).unwrap()).unwrap();
    daemon.watched_by(&watchdog);
    let disk = std::thread::spawn(move || {
        std::thread::park_timeout(20 * limit);
        drop(let_go);
    });
    daemon.end_record(Some(watchdog)).unwrap();
    disk.join().unwrap();
    assert!(stuck.try_recv().is_err(), "the watchdog bit");
}
