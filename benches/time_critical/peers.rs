//! Complete queries of mesh pairs from a cold start, compared with other libraries: ours and parry3d-f64 here, the C++
//! ones in `benches/mesh_peers.py`, which starts this program once per round.
//!
//! In: a folder. Out, in that folder: the meshes and the poses for the other libraries; `rust.csv`, a row for each
//! pair, library and job. Jobs: `verdict` (do the bodies touch), `distance` (if they do not), `contacts` (if they do:
//! all of them).

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use parry3d_f64::math::{Pose as TheirPose, Rotation, Vector};
use parry3d_f64::query::{
    self, ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher,
};
use parry3d_f64::shape::TriMesh;
use sweepd::math::{Pose, Vec3, relative};
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, Search};
use sweepd::shape::{Geometry, Mesh, Shape};
use sweepd::time::{Clock, Meter, SystemClock};

use crate::SEED;
use crate::stage::{Courses, PAIRS};

fn mesh(shape: &Shape) -> &Mesh {
    let Geometry::Mesh(mesh) = &shape.geometry else {
        unreachable!("all are meshes")
    };
    mesh
}

/// File format: vertices as f64 and faces as u32, little-endian, each list after its count; and both poses of each
/// pair: position and quaternion, x y z w.
fn write_inputs(folder: &Path, shapes: &[Arc<Shape>], courses: &Courses) {
    for (k, shape) in shapes.iter().enumerate() {
        let mesh = mesh(shape);
        let mut bytes = Vec::new();
        for count in [mesh.vertices().len(), mesh.faces().len()] {
            bytes.extend(u32::try_from(count).unwrap().to_le_bytes());
        }
        let numbers = mesh.vertices().iter().flat_map(|v| [v.x, v.y, v.z]);
        bytes.extend(numbers.flat_map(f64::to_le_bytes));
        let places = mesh.faces().iter().flatten();
        bytes.extend(places.flat_map(|place| place.to_le_bytes()));
        std::fs::write(folder.join(format!("mesh{k}.bin")), bytes).unwrap();
    }
    let mut bytes = Vec::new();
    for pose in (0..PAIRS).flat_map(|pair| courses.poses(pair)) {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        let numbers = [t.x, t.y, t.z, q.x, q.y, q.z, q.w];
        bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
    }
    std::fs::write(folder.join("poses.bin"), bytes).unwrap();
}

/// The result of one job.
pub struct Found {
    pub touches: bool,
    /// An interval that holds the distance, metres.
    pub gap_m: [f64; 2],
    contacts: usize,
    /// Work units; only our library counts them.
    pub units: u64,
}

/// Our library, cold: nothing is reused from pair to pair except allocated memory.
#[derive(Default)]
pub struct Ours {
    store: FrontStore,
    front: CarriedFront,
}

impl Ours {
    pub fn ask(&mut self, a: &Shape, b: &Shape, rel: &Pose, goal: Goal) -> Found {
        let mut meter = Meter::unlimited(&SystemClock);
        self.ask_in_slices(a, b, rel, goal, u64::MAX, &mut meter)
    }

    /// The same in slices of this many units, with one meter for all slices.
    pub fn ask_in_slices(
        &mut self,
        a: &Shape,
        b: &Shape,
        rel: &Pose,
        goal: Goal,
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> Found {
        let Self { store, front } = self;
        front.start(store, a, b, rel, Search::Carried);
        while !front.advance(store, a, b, goal, slice_units, meter) {
            assert!(meter.open());
        }
        let gap = self.front.interval();
        Found {
            touches: gap.max <= 0.0,
            gap_m: [gap.min, gap.max],
            contacts: self.front.contacts(&self.store).len(),
            units: meter.spent(),
        }
    }

    /// Normal from the first body to the second at the nearest points of the last query, unit length, in the first's
    /// frame.
    pub fn normal(&self) -> Option<Vec3> {
        self.front.witness().map(|leaf| leaf.closest.normal)
    }
}

pub fn theirs(shape: &Shape) -> TriMesh {
    let mesh = mesh(shape);
    let vertices = mesh.vertices().iter().map(|v| Vector::new(v.x, v.y, v.z));
    TriMesh::new(vertices.collect(), mesh.faces().to_vec()).unwrap()
}

pub fn ask_parry(a: &TriMesh, b: &TriMesh, rel: &Pose, goal: Goal) -> Found {
    let (t, q) = (rel.translation.vector, rel.rotation.coords);
    let there = TheirPose {
        rotation: Rotation::from_xyzw(q.x, q.y, q.z, q.w),
        translation: Vector::new(t.x, t.y, t.z),
    };
    let here = TheirPose::IDENTITY;
    let touches;
    let (mut gap_m, mut contacts) = ([f64::NAN; 2], 0);
    match goal {
        Goal::Verdict => {
            touches = query::intersection_test(&here, a, &there, b)
                .unwrap()
                .intersecting;
        }
        Goal::Gap => {
            gap_m = [query::distance(&here, a, &there, b).unwrap().distance; 2];
            touches = gap_m[0] <= 0.0;
        }
        Goal::Contacts => {
            let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
            let asked = DefaultQueryDispatcher.contact_manifolds(
                &there,
                a,
                b,
                0.0,
                &mut manifolds,
                &mut None,
            );
            asked.unwrap();
            let touching = |m: &ContactManifold<(), ()>| {
                m.points.iter().filter(|point| point.dist <= 0.0).count()
            };
            contacts = manifolds.iter().map(touching).sum();
            touches = contacts > 0;
        }
    }
    Found {
        touches,
        gap_m,
        contacts,
        units: 0,
    }
}

pub fn run(shapes: &[Arc<Shape>], folder: &Path) {
    let courses = Courses::new(0.0, SEED);
    write_inputs(folder, shapes, &courses);
    let meshes: Vec<TriMesh> = shapes.iter().map(|shape| theirs(shape)).collect();
    let mut ours = Ours::default();
    let mut csv = String::from("pair,library,job,ns,touches,gap_min_m,gap_max_m,contacts\n");
    // One round is not recorded: it brings memory and caches into the same state as in the other libraries.
    let mut every: Vec<(usize, Pose, bool)> = Vec::new();
    for pair in 0..PAIRS {
        let [a, b] = courses.poses(pair);
        let rel = relative(&a, &b);
        let [one, other] = [0, 1].map(|k| &*shapes[(pair + k) % shapes.len()]);
        let touches = ours.ask(one, other, &rel, Goal::Verdict).touches;
        every.push((pair, rel, touches));
    }
    // One library completes before the next starts, as in C++: parry's traversal would evict our data from the caches.
    let clock = SystemClock;
    for library in ["sweepd", "parry3d-f64"] {
        for &(pair, rel, touches) in &every {
            let [x, y] = [0, 1].map(|k| (pair + k) % shapes.len());
            let last = if touches { Goal::Contacts } else { Goal::Gap };
            for goal in [Goal::Verdict, last] {
                let from_ns = clock.thread_cpu_ns();
                let found = if library == "sweepd" {
                    ours.ask(&shapes[x], &shapes[y], &rel, goal)
                } else {
                    ask_parry(&meshes[x], &meshes[y], &rel, goal)
                };
                let ns = clock.thread_cpu_ns() - from_ns;
                let job = match goal {
                    Goal::Verdict => "verdict",
                    Goal::Gap => "distance",
                    Goal::Contacts => "contacts",
                };
                let [low, high] = found.gap_m;
                let (touches, contacts) = (u8::from(found.touches), found.contacts);
                writeln!(
                    csv,
                    "{pair},{library},{job},{ns},{touches},{low},{high},{contacts}"
                )
                .unwrap();
            }
        }
    }
    std::fs::write(folder.join("rust.csv"), csv).unwrap();
}
