//! `sweepd check`: reads a scene as the daemon does and prints the plan that the daemon would run.

use serde_json::json;

use crate::error::{Result, counted};
use crate::plan::{Kinds, Plan};
use crate::scene::Scene;
use crate::shape::Library;
use crate::time::{Clock, SystemClock};
use crate::world::{Body, World};

use super::args::CheckArgs;
use super::out::Out;
use super::progress::shapes_of;

/// Most ignored pairs that are listed.
const IGNORED_SHOWN: usize = 10_000;

/// Labels of output lines that are not choices of the plan.
const LEFT_OUT: &str = "left out";
const IGNORED: &str = "ignored pairs";

/// Prints the plan, the parts left out, ignored pairs, notes and warnings.
pub(super) fn check(args: &CheckArgs, out: &mut Out) -> Result<bool> {
    let scene = Scene::load(&args.scene)?;
    let shapes = shapes_of(&scene, Library::new())?;
    let mut warnings = scene.notes();
    warnings.extend(shapes.warnings);
    let world = World::new(&scene, shapes.bodies, SystemClock.boottime_ns())?;
    let plan = Plan::of(&world, &Kinds::of(&world), &scene.config);
    if args.json {
        let ignored = args.ignored.then(|| {
            let pairs = ignored(&world).0.into_iter();
            pairs
                .map(|(a, b, why)| json!([a, b, why]))
                .collect::<Vec<_>>()
        });
        let count = world.ignored_pairs_count();
        let listed = ignored.as_ref().map(|listed| listed.len() as u64);
        let line = json!({
            "scene": args.scene.display().to_string(),
            "frame_id": scene.frame_id,
            "bodies": scene.bodies.len(),
            "sources": scene.sources.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(),
            "plan": plan,
            "ignored_pairs": count,
            "ignored": ignored,
            "ignored_left_out": listed.map(|listed| count.saturating_sub(listed)),
            "warnings": warnings,
            "notes": shapes.notes,
        });
        out.line(&line.to_string())?;
        out.flush()?;
        return Ok(true);
    }
    out.line(&format!(
        "{}: {}, {}, frame `{}`",
        args.scene.display(),
        counted(scene.bodies.len(), "body", "bodies"),
        counted(scene.sources.len(), "source", "sources"),
        scene.frame_id
    ))?;
    tell_plan(&plan, world.ignored_pairs_count(), out)?;
    if args.ignored {
        let (listed, is_cut) = ignored(&world);
        for (a, b, why) in listed {
            out.line(&format!("    {a} - {b}: {why}"))?;
        }
        if is_cut {
            out.line(&format!(
                "    .. and no more than {IGNORED_SHOWN} are listed"
            ))?;
        }
    }
    for note in &shapes.notes {
        out.line(&format!("note: {note}"))?;
    }
    for warning in &warnings {
        out.line(&format!("warning: {warning}"))?;
    }
    out.line("the scene is fine")?;
    out.flush()?;
    Ok(true)
}

/// Prints the plan: the choices, the parts left out, and the number of ignored pairs.
fn tell_plan(plan: &Plan, ignored: u64, out: &mut Out) -> Result<()> {
    // All labels share one column, as wide as the longest label.
    let parts = plan.choices.iter().map(|choice| choice.part);
    let width = parts
        .chain([LEFT_OUT, IGNORED])
        .map(str::len)
        .max()
        .unwrap_or_default();
    for choice in &plan.choices {
        out.line(&format!(
            "  {:<width$} {}  ({})",
            choice.part, choice.chosen, choice.why
        ))?;
    }
    for part in &plan.left_out {
        let saved = if part.saved_bytes > 0 {
            format!(", {} bytes saved", part.saved_bytes)
        } else {
            String::new()
        };
        out.line(&format!(
            "  {LEFT_OUT:<width$} {}  ({}{saved})",
            part.part, part.why
        ))?;
    }
    out.line(&format!("  {IGNORED:<width$} {ignored}"))
}

/// The ignored pairs with their reasons, ordered by id, and whether there are more than the list holds.
fn ignored(world: &World) -> (Vec<(&str, &str, String)>, bool) {
    let bodies: Vec<(_, &Body)> = world.bodies().collect();
    let mut list = Vec::new();
    for (at, (slot_a, a)) in bodies.iter().enumerate() {
        for (slot_b, b) in &bodies[at + 1..] {
            let because = world.filters().decide_if_enabled(*slot_a, *slot_b);
            if because.is_ignored() {
                if list.len() == IGNORED_SHOWN {
                    return (list, true);
                }
                let rule = world
                    .filters()
                    .rule_reason(*slot_a, *slot_b)
                    .map(|r| format!(": {r}"));
                list.push((
                    a.name.as_str(),
                    b.name.as_str(),
                    format!("{}{}", because.word(), rule.unwrap_or_default()),
                ));
            }
        }
    }
    (list, false)
}
