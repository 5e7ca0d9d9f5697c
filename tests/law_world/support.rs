//! Scenes of 1 m cubes, frames, and a world that validates itself after every step.

#![allow(dead_code, reason = "two test crates include this file")]

use std::sync::Arc;

use sweepd::config::Config;
use sweepd::ids::{BodyId, BodySlot, SourceSlot};
use sweepd::math::{Point, Pose};
use sweepd::scene::{BodySpec, PairAction, PairRule, PlacedSpec, Scene, SourceSpec};
use sweepd::shape::{Geometry, Mesh, Shape, ShapeSpec};
use sweepd::wire::{
    BodyStatus, EndCause, Frame, RejectReason, TransformRow, WIRE_VERSION, frame_flags, name_bytes,
};
use sweepd::world::{Admission, Body, Edit, Parts, PlacedShape, World};

pub(crate) const MS: u64 = 1_000_000;
/// Timeout of every source in these tests.
pub(crate) const TIMEOUT_NS: u64 = 500 * MS;
/// Start time of the daemon.
pub(crate) const START_NS: u64 = 10_000 * MS;

/// A centred cube of side 1 m.
pub(crate) fn cube() -> Parts {
    let corner = |k: usize| {
        let at = |bit: usize| if k & bit == 0 { -0.5 } else { 0.5 };
        Point::new(at(1), at(2), at(4))
    };
    let faces = vec![
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    let mesh = Mesh::new((0..8).map(corner).collect(), faces, Some(true)).unwrap();
    let shape = Shape {
        aabb: mesh.aabb(),
        centre: mesh.centre(),
        radius: mesh.radius(),
        geometry: Geometry::Mesh(mesh),
    };
    Parts::from([PlacedShape {
        shape: Arc::new(shape),
        pose: Pose::identity(),
    }])
}

/// An edit that puts a deforming sheet.
pub(crate) fn cloth() -> Edit {
    let mesh = ShapeSpec::Trimesh {
        vertices: vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
        ],
        faces: vec![[0, 1, 2], [1, 3, 2]],
        file: None,
        scale: None,
        solid: Some(false),
    };
    let shape = sweepd::shape::build(&mesh, std::path::Path::new(""))
        .unwrap()
        .shape;
    let shape = shape.to_deforming().unwrap();
    Edit::Put(sweepd::world::Put {
        body: Arc::new(BodySpec {
            deforms: true,
            ..moving("cloth", 0)
        }),
        shapes: Parts::from([PlacedShape {
            shape: Arc::new(shape),
            pose: Pose::identity(),
        }]),
    })
}

/// A half-space.
pub(crate) fn floor() -> Parts {
    let everywhere = Point::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let shape = Shape {
        aabb: sweepd::math::Aabb {
            min: -everywhere,
            max: everywhere,
        },
        centre: Point::origin(),
        radius: f64::INFINITY,
        geometry: Geometry::HalfSpace {
            normal: sweepd::math::Vec3::z(),
            offset: 0.0,
        },
    };
    Parts::from([PlacedShape {
        shape: Arc::new(shape),
        pose: Pose::identity(),
    }])
}

/// A moving body of the first source.
pub(crate) fn moving(name: &str, id: u64) -> BodySpec {
    let shape = ShapeSpec::Box {
        half_extents: [0.5; 3],
    };
    let placed = PlacedSpec {
        shape,
        pose: Pose::identity(),
    };
    BodySpec {
        source: Some(0),
        ..BodySpec::new(name.to_owned(), BodyId(id), vec![placed])
    }
}

/// A fixed body at `x` metres.
pub(crate) fn fixed(name: &str, id: u64, x: f64) -> BodySpec {
    BodySpec {
        moves: false,
        source: None,
        pose: Pose::translation(x, 0.0, 0.0),
        ..moving(name, id)
    }
}

pub(crate) fn rule(action: PairAction, a: &str, b: &str) -> PairRule {
    PairRule {
        action,
        a: a.to_owned(),
        b: b.to_owned(),
        reason: "test".to_owned(),
        report_within_m: None,
    }
}

/// A scene with two sources, `sim` and `robot`.
pub(crate) fn scene(bodies: Vec<BodySpec>, rules: Vec<PairRule>) -> Scene {
    let source = |name: &str| SourceSpec {
        name: name.to_owned(),
        timeout_ns: TIMEOUT_NS,
        on_stale: Default::default(),
        ros2: None,
    };
    Scene {
        frame_id: "world".to_owned(),
        config: Config::default(),
        sources: vec![source("sim"), source("robot")],
        bodies,
        rules,
        ..Scene::default()
    }
}

/// A row at `x` metres.
pub(crate) fn row(body: u64, x: f64) -> TransformRow {
    TransformRow {
        body,
        position: [x, 0.0, 0.0],
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..TransformRow::default()
    }
}

/// A full frame of `source` in session 1, sent at `at_ns`.
pub(crate) fn frame(source: &str, seq: u64, at_ns: u64, rows: &[TransformRow]) -> Frame {
    let mut frame = Frame::default();
    frame.header.schema = WIRE_VERSION;
    frame.header.source = name_bytes(source);
    frame.header.session = 1;
    frame.header.seq = seq;
    frame.header.sent_ns = at_ns;
    frame.header.stamp_ns = at_ns;
    frame.header.flags = frame_flags::FULL;
    frame.received_ns = at_ns;
    frame.transforms.extend_from_slice(rows);
    frame
}

/// A world and its time; the structure is validated after every step.
pub(crate) struct Bench {
    pub(crate) world: World,
    pub(crate) now_ns: u64,
    pub(crate) tick: u64,
}

impl Bench {
    pub(crate) fn of(bodies: Vec<BodySpec>) -> Self {
        Self::with_rules(bodies, Vec::new())
    }

    pub(crate) fn with_rules(bodies: Vec<BodySpec>, rules: Vec<PairRule>) -> Self {
        Self::with(&scene(bodies, rules))
    }

    pub(crate) fn with(scene: &Scene) -> Self {
        let shapes = scene.bodies.iter().map(|_| cube()).collect();
        let world = World::new(scene, shapes, START_NS).unwrap();
        let mut bench = Self {
            world,
            now_ns: START_NS,
            tick: 0,
        };
        bench.tick_at(START_NS, &[], &[]);
        bench
    }

    /// Runs one tick: edits (one request each), frames, ages; then validates the structure.
    pub(crate) fn tick_at(
        &mut self,
        now_ns: u64,
        edits: &[Edit],
        frames: &[Frame],
    ) -> Vec<Admission> {
        self.tick += 1;
        self.now_ns = now_ns;
        self.world.begin_tick(self.tick, now_ns);
        for edit in edits {
            self.world.apply(std::slice::from_ref(edit)).unwrap();
        }
        let admit = |frame| self.world.admit(frame, now_ns);
        let admissions = frames.iter().map(admit).collect();
        self.world.age(now_ns);
        self.world.validate().unwrap();
        admissions
    }

    /// Runs a tick `after_ns` later with one frame received just now.
    pub(crate) fn send(
        &mut self,
        after_ns: u64,
        source: &str,
        seq: u64,
        rows: &[TransformRow],
    ) -> Admission {
        let now_ns = self.now_ns + after_ns;
        self.tick_at(now_ns, &[], &[frame(source, seq, now_ns, rows)])[0]
    }

    /// Runs a tick `after_ns` later without input.
    pub(crate) fn wait(&mut self, after_ns: u64) {
        self.tick_at(self.now_ns + after_ns, &[], &[]);
    }

    /// Runs a tick with one edit, at the current time.
    pub(crate) fn edit(&mut self, edit: Edit) {
        self.tick_at(self.now_ns, &[edit], &[]);
    }

    /// The error of a refused request; asserts that nothing has changed.
    pub(crate) fn refused(&mut self, edits: &[Edit]) -> String {
        let (rev, changes) = (
            self.world.scene_rev(),
            format!("{:?}", self.world.changes()),
        );
        let text = self.world.apply(edits).unwrap_err();
        assert_eq!(self.world.scene_rev(), rev);
        assert_eq!(format!("{:?}", self.world.changes()), changes);
        self.world.validate().unwrap();
        text
    }

    pub(crate) fn slot(&self, name: &str) -> BodySlot {
        self.world.slot_named(name).unwrap()
    }

    pub(crate) fn body(&self, name: &str) -> &Body {
        self.world.body(self.slot(name)).unwrap()
    }

    pub(crate) fn status(&self, name: &str) -> BodyStatus {
        self.body(name).status
    }

    pub(crate) fn inserted(&self, name: &str) -> bool {
        self.world.changes().inserted.contains(&self.slot(name))
    }

    /// The cause for which the body left the broad phase in this tick.
    pub(crate) fn removed(&self, name: &str) -> Option<EndCause> {
        let slot = self.slot(name);
        let removed = &self.world.changes().removed;
        removed.iter().find(|r| r.slot == slot).map(|r| r.cause)
    }

    pub(crate) fn rejects(&self, reason: RejectReason) -> u64 {
        self.world.rejects()[usize::from(reason.code())]
    }

    pub(crate) fn has_reason(&self, reason: sweepd::wire::Reason) -> bool {
        self.world.counts().reasons & reason.bit() != 0
    }
}

pub(crate) fn refused(source: u32, reason: RejectReason) -> Admission {
    Admission::Refused {
        source: Some(SourceSlot(source)),
        reason,
    }
}

pub(crate) fn admitted(source: u32, poses: u64, refused_rows: u64) -> Admission {
    Admission::Admitted {
        source: SourceSlot(source),
        poses,
        refused_rows,
    }
}
