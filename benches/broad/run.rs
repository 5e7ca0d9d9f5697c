//! Runs each method in its own process; prints CSV on stdout and a table of means on stderr.
//!
//! A run: build, 40 frames to settle (the first step is reported as `first_us`), then the measured frames. In a middle
//! frame and in the last one the pairs are compared with the exact set; a run that differs is printed as `wrong` and
//! its times are void. A method that reports only pairs of moved bodies is compared with those pairs, and printed as
//! `part`. Times are CPU time of the thread, which mostly excludes other load on the machine.

use std::fmt::Write as _;
use std::process::Command;

use super::exact;
use super::methods::Runner;
use super::scenes::{Kind, Scene};

const SEED: u64 = 7;
/// Frames before the measurement; after them adaptive modes and margins have settled.
const SETTLE: usize = 40;

fn option(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|a| a != name);
    arguments.nth(1)
}

/// Makes a method by its name; `None`: there is no such method in this build.
pub type Make = fn(&str, &Scene) -> Option<Box<dyn Runner>>;

/// Runs the measurements that the command line asks for.
///
/// * `names` - the methods of a full run.
/// * `save` - where `--save` writes the CSV.
pub fn main(names: &[&str], make: Make, save: Option<&str>) {
    if let Some(name) = option("--one") {
        one(&name, make);
        return;
    }
    let list = |name: &str, default: String| -> Vec<String> {
        let text = option(name).unwrap_or(default);
        text.split(',').map(str::to_owned).collect()
    };
    let sizes = list("--bodies", "1000,10000,100000".into());
    let all: Vec<&str> = Kind::ALL.iter().map(|(_, name)| *name).collect();
    let scenes = list("--scene", all.join(","));
    let methods = list("--method", names.join(","));
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,seed,scene,bodies,method,frames,first_us,mean_us,median_us,p99_us,max_us,memory_mib,\
         pairs,verdict,told\n",
    );
    print!("{csv}");
    for bodies in &sizes {
        let mut table = format!("\nbodies {bodies}: mean us a frame (median / p99), pairs\n");
        for scene in &scenes {
            let mut rows = Vec::new();
            for method in &methods {
                let Some(row) = child(scene, bodies, method) else {
                    continue;
                };
                println!("{from},{row}");
                let _ = writeln!(csv, "{from},{row}");
                rows.push(row);
            }
            tell(&mut table, scene, &rows);
        }
        eprintln!("{table}");
    }
    if let Some(path) = save.filter(|_| std::env::args().any(|a| a == "--save")) {
        std::fs::write(path, csv).unwrap();
    }
}

/// Adds one line to the table.
fn tell(table: &mut String, scene: &str, rows: &[String]) {
    let _ = write!(table, "{scene:>9}");
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        let sound = match cells[12] {
            "exact" => "",
            "part" => " of what moved",
            _ => " WRONG",
        };
        let _ = write!(
            table,
            " | {} {} ({} / {}){sound}",
            cells[3], cells[6], cells[7], cells[8]
        );
    }
    let _ = writeln!(table);
}

/// Runs one method in its own process; returns its CSV row, `None` if it fails.
fn child(scene: &str, bodies: &str, method: &str) -> Option<String> {
    let mut command = Command::new("timeout");
    command.arg("120").arg(std::env::current_exe().unwrap());
    command.args(["--one", method, "--scene", scene, "--bodies", bodies]);
    if let Some(frames) = option("--frames") {
        command.args(["--frames", &frames]);
    }
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let row = text.lines().last().filter(|_| output.status.success());
    if row.is_none() && !output.stderr.is_empty() {
        eprintln!(
            "{method} in {scene}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    row.map(str::to_owned)
}

/// Runs one method; prints one row without the provenance columns.
fn one(name: &str, make: Make) {
    let scene_name = option("--scene").unwrap();
    let bodies: usize = option("--bodies").unwrap().parse().unwrap();
    let usual = if bodies > 200_000 { 60 } else { 200 };
    let frames: usize = option("--frames").map_or(usual, |f| f.parse().unwrap());
    let mut scene = Scene::new(Kind::named(&scene_name).unwrap(), bodies, SEED);
    let base_kib = peak_kib();
    let Some(mut runner) = make(name, &scene) else {
        eprintln!("no such method in this build");
        std::process::exit(1);
    };
    let first_ns = runner.step(&scene, true);
    let whole = runner.whole();
    let mut verdict = if whole { "exact" } else { "part" };
    let mut check = |scene: &Scene, pairs: Vec<exact::Pair>| {
        let mut wanted = exact::pairs(&scene.boxes);
        if !whole {
            let mut asked = vec![false; scene.boxes.len()];
            for body in scene.moved.iter().chain(&scene.churned) {
                asked[*body as usize] = true;
            }
            wanted.retain(|(a, b)| asked[*a as usize] || asked[*b as usize]);
        }
        if pairs != wanted {
            verdict = "wrong";
        }
        wanted.len()
    };
    // A peer that is too slow is stopped after this time; the row then covers the frames it completed.
    let mut left_ns: u64 = 20_000_000_000;
    let mut times = Vec::new();
    let mut memory_kib = 0;
    for frame in 0..SETTLE + frames {
        scene.step();
        let ns = runner.step(&scene, false);
        if frame >= SETTLE {
            times.push(ns);
        }
        left_ns = left_ns.saturating_sub(ns);
        if left_ns == 0 && times.len() >= 3 {
            break;
        }
        if frame == SETTLE + frames / 2 {
            memory_kib = peak_kib().saturating_sub(base_kib);
            check(&scene, runner.pairs(&scene));
        }
    }
    if memory_kib == 0 {
        memory_kib = peak_kib().saturating_sub(base_kib);
    }
    let pairs = check(&scene, runner.pairs(&scene));
    let told = runner.told();
    let us = |ns: u64| ns as f64 / 1e3;
    let mean = us(times.iter().sum::<u64>()) / times.len() as f64;
    times.sort_unstable();
    let at = |share: f64| us(times[((times.len() - 1) as f64 * share).round() as usize]);
    println!(
        "{SEED},{scene_name},{bodies},{name},{},{:.1},{mean:.2},{:.2},{:.2},{:.2},{:.1},{pairs},{verdict},{told}",
        times.len(),
        us(first_ns),
        at(0.5),
        at(0.99),
        at(1.0),
        memory_kib as f64 / 1024.0,
    );
}

/// The peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find(|l| l.starts_with("VmHWM:"))
        .unwrap_or("");
    let number = line.split_ascii_whitespace().nth(1).unwrap_or("0");
    number.parse().unwrap_or(0)
}

/// Machine, commit, compiler, as CSV columns.
fn provenance() -> String {
    let run = |command: &str, args: &[&str]| {
        let out = Command::new(command).args(args).output();
        out.map(|o| String::from_utf8_lossy(&o.stdout).trim().replace(',', ";"))
            .unwrap_or_default()
    };
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = cpu.lines().find(|line| line.starts_with(name));
        let value = line.and_then(|line| line.split(':').nth(1));
        value.unwrap_or_default().trim().to_owned()
    };
    format!(
        "{} family {} model {}{},{},{}",
        field("model name"),
        field("cpu family"),
        field("model\t"),
        if cpu.contains("avx512f") {
            " avx512"
        } else {
            ""
        },
        run("git", &["describe", "--always", "--dirty"]),
        run("rustc", &["--version"])
    )
}
