//! The method chosen for each part, and the reason.

use crate::broad::Method;
use crate::config::{Config, MeshSearch, Viewpoint};
use crate::error::counted;

use super::facts::Facts;
use super::{Choice, Seen};

/// From so many boxes on a search may take long enough to be shared (`limits::SHARED_TESTS_MIN`).
const SHARED_MIN: usize = 5_000;

/// What a viewpoint does to the order of work.
fn weighted_by(viewpoint: &Viewpoint) -> Choice {
    let on = viewpoint.body.as_deref();
    let on = on.unwrap_or("no body: a place of the scene");
    Choice {
        part: "viewpoint",
        chosen: format!(
            "what is in view counts up to {} times as much in the order of work",
            viewpoint.weight
        ),
        why: format!("the scene has a viewpoint, on {on}"),
    }
}

fn searched(asked: Option<MeshSearch>) -> Choice {
    let chosen = match asked.unwrap_or_default() {
        MeshSearch::Carried => {
            "certificates carried from pose to pose, depth first to a verdict, best first to bounds"
        }
        MeshSearch::Restart => "depth first to a verdict, from the roots at each pose",
        MeshSearch::BreadthFirst => "breadth-first queue, from the roots at each pose",
        MeshSearch::Priority => "priority queue, from the roots at each pose",
    };
    Choice {
        part: "search of mesh pairs",
        chosen: chosen.to_owned(),
        why: match asked {
            Some(_) => "the scene asks for it",
            None => "the least work at every speed that was measured",
        }
        .to_owned(),
    }
}

pub(super) fn of(facts: &Facts, method: Method, config: &Config, seen: Seen) -> Vec<Choice> {
    let mut choices = vec![searched_for(facts, method, config)];
    choices.extend((method == Method::SweepAndPrune).then(|| sorted_along(seen)));
    choices.extend(shared(facts, method, config));
    choices.extend(filtered(facts));
    choices.push(narrowed(facts));
    choices.extend((facts.shapes[1] > 0).then(|| searched(config.mesh_search)));
    choices.extend(config.viewpoint.as_ref().map(weighted_by));
    choices.extend((facts.continuous > 0).then(|| {
        Choice {
            part: "swept tests",
            chosen:
                "boxes around the way between two poses, time of impact by conservative advancement"
                    .to_owned(),
            why: counted(facts.continuous, "continuous body", "continuous bodies"),
        }
    }));
    choices.extend((facts.deforming > 0).then(|| {
        Choice {
            part: "deforming meshes",
            chosen:
                "boxes along the axes of the body, widened by what moved, refitted where pairs wait"
                    .to_owned(),
            why: format!(
                "{}, {}, {}",
                counted(facts.deforming, "body", "bodies"),
                counted(facts.bending[0], "triangle", "triangles"),
                counted(facts.bending[1], "vertex", "vertices")
            ),
        }
    }));
    choices.push(ordered(config));
    choices.extend(listened(seen));
    choices
}

/// The broad phase.
fn searched_for(facts: &Facts, method: Method, config: &Config) -> Choice {
    let chosen = match method {
        Method::BruteForce => "every pair of boxes",
        Method::SweepAndPrune => "sweep-and-prune, sorted ends kept across ticks",
        Method::Order => {
            "sort-and-sweep along a space-filling order, candidates of fat boxes kept across ticks"
        }
        Method::UniformGrid => "uniform grid, cells of the largest box",
        Method::SpatialHash => "spatial hash, cells of the largest box",
        Method::HierarchicalGrid => "hierarchical grid, a level of cells by size",
    };
    let boxes = counted(facts.boxes, "box", "boxes");
    let mut why = format!(
        "{boxes}, {}",
        counted(facts.moving, "body moves", "bodies move")
    );
    if let Some([least, largest]) = facts.size_m {
        why += &format!(", {least} to {largest} m across");
    }
    if config.broad_phase.is_some() {
        why += "; the scene asks for it";
    }
    Choice {
        part: "broad phase",
        chosen: chosen.to_owned(),
        why,
    }
}

/// The axes that sweep-and-prune keeps sorted.
fn sorted_along(seen: Seen) -> Choice {
    let kept = match seen.skipped_axis {
        Some(0) => "y and z",
        Some(1) => "x and z",
        Some(2) => "x and y",
        _ => "x, y and z",
    };
    let why = match seen.skipped_axis {
        Some(_) => {
            "along the other nearly all boxes overlap: its ends pass one another and tell nothing"
        }
        None => "no axis was measured to be clumped; measured again while bodies move",
    };
    Choice {
        part: "axes",
        chosen: kept.to_owned(),
        why: why.to_owned(),
    }
}

/// What decides about pairs beside groups and masks.
fn filtered(facts: &Facts) -> Option<Choice> {
    (facts.rules > 0).then(|| Choice {
        part: "filters",
        chosen: "rules by name, looked up for bodies that one speaks of".to_owned(),
        why: format!(
            "rules: {}; pairs ignored by them, as neighbours or in groups: {}",
            facts.rules, facts.ignored
        ),
    })
}

fn narrowed(facts: &Facts) -> Choice {
    let chosen = if facts.shapes[1] > 0 {
        format!(
            "exact convex queries, walks over {}",
            counted(facts.triangles, "triangle", "triangles")
        )
    } else {
        "exact convex queries".to_owned()
    };
    Choice {
        part: "narrow phase",
        chosen,
        why: format!(
            "{}, {}",
            counted(facts.shapes[0], "convex shape", "convex shapes"),
            counted(facts.shapes[1], "mesh", "meshes")
        ),
    }
}

fn ordered(config: &Config) -> Choice {
    let (chosen, why) = if config.budget.is_limited() {
        (
            "last contacts, then the oldest undecided first, weighted by priority and closing speed",
            "the budget is limited",
        )
    } else {
        (
            "as found",
            "the budget is not limited; oldest first all the same where a frame says when it must be answered",
        )
    };
    Choice {
        part: "order of work",
        chosen: chosen.to_owned(),
        why: why.to_owned(),
    }
}

/// What is computed because it has readers.
fn listened(seen: Seen) -> impl Iterator<Item = Choice> {
    let manifolds = seen.readers.contacts.then_some((
        "contacts",
        "manifolds: points, normals and depths of pairs that touch",
        "somebody reads `contacts`",
    ));
    let regions = seen.readers.regions.then_some((
        "regions",
        "regions of contact with their radius, of pairs that touch",
        "somebody reads `regions`",
    ));
    manifolds
        .into_iter()
        .chain(regions)
        .map(|(part, chosen, why)| Choice {
            part,
            chosen: chosen.to_owned(),
            why: why.to_owned(),
        })
}

/// Whether other threads help the broad phase.
fn shared(facts: &Facts, method: Method, config: &Config) -> Option<Choice> {
    let many = method == Method::Order && facts.boxes >= SHARED_MIN;
    (many && config.threads != Some(1)).then(|| Choice {
        part: "threads",
        chosen: match config.threads {
            Some(threads) => format!("{threads} at most"),
            None => "two, where the machine has them".to_owned(),
        },
        why: "a search among many boxes is shared where it takes half a millisecond".to_owned(),
    })
}
