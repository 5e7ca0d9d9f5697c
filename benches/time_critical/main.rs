//! The results available when time runs out: 200 pairs of meshes of 19,880 triangles, one thread, at the interface of
//! the narrow phase.
//!
//! For each method (see `subject`): a cold start (see `cold`; the cost of all verdicts, then the results as a function
//! of the budget in microseconds, in work units and in shares of the method's own total work: share of verdicts and the
//! area under it, false alarms, widths of intervals, regions of possible contact), and coherent motion of 0.1, 0.5 and
//! 2 % of the diameter per tick, without a limit and within 200 and 500 us or about as many work units: unresolved
//! pairs, pairs whose last verdict is no longer true, the longest time a pair has had no verdict, contacts reported
//! late or never, overshoot. The time starts after the motion pass, whose duration is given separately. Truth: complete
//! walks over the other trees.
//!
//! `cargo bench --bench time_critical [-- --quick] [--cold] [METHOD..]`; saved rows that are not measured again are
//! kept. `-- regions` for approximate contacts alone (see `regions`), `-- distance` for the distance of one pair, `--
//! interruptible` for the cost of interruptible work; `-- peers FOLDER` is started by `benches/mesh_peers.py`.

#![allow(
    clippy::cast_precision_loss,
    clippy::unwrap_used,
    clippy::print_stdout,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a bench"
)]

mod cold;
#[path = "../common/mod.rs"]
mod common;
mod distance;
mod interruptible;
mod moving;
#[path = "../../tests/oracle/mod.rs"]
mod oracle;
mod peers;
mod regions;
mod restart;
mod stage;
mod subject;
mod table;
mod tally;

use std::sync::Arc;

use common::{kept_rows, provenance, save};
use moving::{LIMITS, Motion, PERCENTS};
use stage::shapes;
use subject::{SUBJECTS, Subject};
use sweepd::shape::Shape;
use table::{COLUMNS, Row};

const SEED: u64 = 17;

fn main() {
    let quick = std::env::args().any(|arg| arg == "--quick");
    let only: Vec<String> = std::env::args()
        .skip(1)
        .filter(|arg| !arg.starts_with("--"))
        .collect();
    let shapes = shapes();
    if let Some(at) = only.iter().position(|name| name == "peers") {
        peers::run(&shapes, std::path::Path::new(&only[at + 1]));
        return;
    }
    if only.iter().any(|name| name == "distance") {
        distance::run(&shapes);
        return;
    }
    if only.iter().any(|name| name == "interruptible") {
        interruptible::run(&shapes, quick);
        return;
    }
    if only.iter().any(|name| name == "regions") {
        regions::run(&shapes, quick);
        return;
    }
    measure(&shapes, &only, quick);
}

/// Measures the named methods, or all if none is named.
fn measure(shapes: &[Arc<Shape>], only: &[String], quick: bool) {
    let cold_alone = std::env::args().any(|arg| arg == "--cold");
    let (ticks, rounds) = if quick { (20, 3) } else { (99, 15) };
    let is_named = |name: &str| only.is_empty() || only.iter().any(|known| known == name);
    let from = provenance();
    let columns = COLUMNS.join(",");
    let mut csv = format!("machine,commit,compiler,seed,method,{columns}\n");
    let kept = kept_rows("time_critical.csv", &csv, |cells| {
        !is_named(cells[4]) || (cold_alone && cells[5] == "moving")
    });
    csv += &kept;
    let motions: Vec<Motion> = if cold_alone {
        Vec::new()
    } else {
        let motion = |percent| Motion::new(shapes, percent, ticks);
        PERCENTS.map(motion).into()
    };
    for name in SUBJECTS.into_iter().filter(|name| is_named(name)) {
        let mut add = |row: Row| {
            let line = row.line();
            println!("{line}");
            csv += &format!("{from},{SEED},{name},{line}\n");
        };
        println!("{name}: {columns}");
        cold::profile(name, shapes, rounds, &mut add);
        if Subject::has_bounds(name) {
            cold::bounds(name, shapes, rounds, &mut add);
        }
        for motion in &motions {
            for limit in LIMITS {
                add(motion.run(name, shapes, limit));
            }
        }
    }
    save("time_critical.csv", &csv);
}
