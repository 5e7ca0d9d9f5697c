//! Ours beside the peers, on the same boxes, one process a run.
//!
//! `cargo run --release -- [--bodies 1000,10000,100000] [--scene gas,pile] [--method order,parry] [--frames N]
//! [--save]` in this folder; what it prints: see `benches/broad/run.rs`.

#[path = "../../../tests/common/mod.rs"]
mod common;
#[path = "../../broad/exact.rs"]
mod exact;
#[path = "../../broad/methods.rs"]
mod methods;
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
    let results = concat!(env!("CARGO_MANIFEST_DIR"), "/../results/broad.csv");
    run::main(&names, make, Some(results));
}

fn make(name: &str, scene: &Scene) -> Option<Box<dyn Runner>> {
    Some(match name {
        "parry" => Box::new(rust::Parry::default()),
        "rapier" => Box::new(rust::Rapier::new(scene.boxes.len())),
        _ => return methods::runner(name, scene),
    })
}
