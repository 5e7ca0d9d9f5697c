//! Our broad phases and those of other libraries on the same boxes, one process per run.
//!
//! `cargo run --release -- [--bodies 1000,10000,100000] [--scene gas,pile] [--method order,parry] [--frames N]
//! [--save]` in this folder; for the output see `benches/broad/run.rs`. The feature `cpp` adds the C++ libraries.

#[cfg(feature = "cpp")]
mod bullet;
#[path = "../../../tests/common/mod.rs"]
mod common;
#[path = "../../broad/exact.rs"]
mod exact;
#[cfg(feature = "cpp")]
mod jolt;
#[path = "../../broad/methods.rs"]
mod methods;
#[cfg(feature = "cpp")]
mod physx;
#[path = "../../broad/run.rs"]
mod run;
mod rust;
#[path = "../../broad/scenes.rs"]
mod scenes;

use methods::Runner;
use scenes::Scene;

fn main() {
    let mut names = methods::NAMES.to_vec();
    names.extend(["parry", "rapier"]);
    #[cfg(feature = "cpp")]
    names.extend([
        "physx-abp",
        "bullet-dbvt",
        "bullet-sap",
        "jolt",
        "jolt-active",
    ]);
    let results = concat!(env!("CARGO_MANIFEST_DIR"), "/../results/broad.csv");
    run::main(&names, make, Some(results));
}

fn make(name: &str, scene: &Scene) -> Option<Box<dyn Runner>> {
    Some(match name {
        "parry" => Box::new(rust::Parry::default()),
        "rapier" => Box::new(rust::Rapier::new(scene.boxes.len())),
        #[cfg(feature = "cpp")]
        "physx-abp" => Box::new(physx::PhysX::new(scene)),
        #[cfg(feature = "cpp")]
        "bullet-dbvt" => Box::new(bullet::Bullet::new(false, scene)),
        #[cfg(feature = "cpp")]
        "bullet-sap" => {
            if scene.boxes.len() > bullet::SWEEP_BODIES_MAX {
                eprintln!("not run above {} bodies", bullet::SWEEP_BODIES_MAX);
                std::process::exit(1);
            }
            Box::new(bullet::Bullet::new(true, scene))
        }
        #[cfg(feature = "cpp")]
        "jolt" | "jolt-active" => Box::new(jolt::Jolt::new(name == "jolt", scene)),
        _ => return methods::runner(name, scene),
    })
}
