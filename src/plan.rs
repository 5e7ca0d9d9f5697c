//! The plan: which methods a scene gets, and what is left out because it does not need it.
//!
//! In: the world's bodies and the configuration. Out: a [`Plan`] that `check` prints and the daemon publishes when it
//! changes. It decides again when the scene or the kind of budget changes, never in the middle of a tick.

use serde::Serialize;

use crate::broad::Method;
use crate::config::{Config, MeshSearch, Viewpoint};
use crate::ids::BodySlot;
use crate::limits::LEGS_MAX;
use crate::shape::Geometry;
use crate::world::{Body, Leg, Path, World};

/// Up to this many boxes every pair is compared: any structure costs more than it spares below it (24 bodies are 276
/// comparisons of boxes).
const BRUTE_FORCE_MAX: usize = 24;
/// With hysteresis: brute force stays until the scene has grown beyond this.
const BRUTE_FORCE_STAY_MAX: usize = 32;

/// From so many boxes on a search may take long enough to be shared (`limits::SHARED_TESTS_MIN`).
const SHARED_MIN: usize = 5_000;

/// What was chosen for a part, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// The part of the engine.
    pub part: &'static str,
    /// What it does.
    pub chosen: String,
    /// The measured reason.
    pub why: String,
}

/// What was not built, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The part of the engine.
    pub part: &'static str,
    /// The measured reason.
    pub why: String,
    /// Memory not taken, bytes.
    pub saved_bytes: u64,
}

/// Which methods a scene gets, and what is left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Plan {
    #[serde(skip)]
    method: Method,
    /// Bodies in the scene.
    pub bodies: u64,
    /// Bodies that can move.
    pub moving: u64,
    /// Shapes by kind: convex, mesh, half-space.
    pub shapes: [u64; 3],
    /// Triangles in all meshes, each shared mesh counted once a body.
    pub triangles: u64,
    /// What was chosen.
    pub choices: Vec<Choice>,
    /// What was left out.
    pub left_out: Vec<LeftOut>,
}

#[derive(Default)]
struct Facts {
    bodies: u64,
    moving: u64,
    boxes: usize,
    shapes: [u64; 3],
    triangles: u64,
    several_shapes: u64,
    stale_by_speed: u64,
    continuous: u64,
    deforming: u64,
    /// Triangles and vertices of those.
    bending: [u64; 2],
}

impl Plan {
    /// The plan for a world as it is now.
    #[must_use]
    pub fn of(world: &World, config: &Config) -> Self {
        Self::after(None, world, config)
    }

    /// The plan for a world as it is now, with hysteresis against the one in force.
    #[must_use]
    pub fn after(before: Option<&Self>, world: &World, config: &Config) -> Self {
        let facts = Facts::of(world.bodies());
        let few = match before {
            Some(Self {
                method: Method::BruteForce,
                ..
            }) => BRUTE_FORCE_STAY_MAX,
            _ => BRUTE_FORCE_MAX,
        };
        let fitting = if facts.boxes <= few {
            Method::BruteForce
        } else {
            Method::Order
        };
        let method = config.broad_phase.unwrap_or(fitting);
        Self {
            method,
            bodies: facts.bodies,
            moving: facts.moving,
            shapes: facts.shapes,
            triangles: facts.triangles,
            choices: choices(&facts, method, config),
            left_out: left_out(&facts, method),
        }
    }

    /// The broad phase.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// As JSON, one object.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

impl Facts {
    fn of<'a>(bodies: impl Iterator<Item = (BodySlot, &'a Body)>) -> Self {
        let mut facts = Self::default();
        for (_, body) in bodies {
            facts.bodies += 1;
            facts.moving += u64::from(body.moves);
            facts.boxes += usize::from(!body.unbounded);
            facts.several_shapes += u64::from(body.shapes.len() > 1);
            facts.continuous += u64::from(
                body.path
                    .as_ref()
                    .is_some_and(|path| path.is_of_continuous()),
            );
            facts.deforming += u64::from(body.vertices.is_some());
            facts.stale_by_speed += u64::from(body.max_speed_mps.is_some());
            for placed in body.shapes.iter() {
                match &placed.shape.geometry {
                    Geometry::Convex(_) => facts.shapes[0] += 1,
                    Geometry::Mesh(mesh) => {
                        facts.shapes[1] += 1;
                        facts.triangles += mesh.faces().len() as u64;
                        if mesh.is_deforming() {
                            facts.bending[0] += mesh.faces().len() as u64;
                            facts.bending[1] += mesh.vertices().len() as u64;
                        }
                    }
                    Geometry::HalfSpace { .. } => facts.shapes[2] += 1,
                }
            }
        }
        facts
    }
}

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

fn choices(facts: &Facts, method: Method, config: &Config) -> Vec<Choice> {
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
    let mut why = format!("{} boxes, {} bodies move", facts.boxes, facts.moving);
    if config.broad_phase.is_some() {
        why += "; the scene asks for it";
    }
    let mut choices = vec![Choice {
        part: "broad phase",
        chosen: chosen.to_owned(),
        why,
    }];
    choices.extend(shared(facts, method, config));
    let narrow = if facts.shapes[1] > 0 {
        format!(
            "exact convex queries, walks over {} triangles",
            facts.triangles
        )
    } else {
        "exact convex queries".to_owned()
    };
    choices.push(Choice {
        part: "narrow phase",
        chosen: narrow,
        why: format!(
            "{} convex shapes, {} meshes",
            facts.shapes[0], facts.shapes[1]
        ),
    });
    if facts.shapes[1] > 0 {
        choices.push(searched(config.mesh_search));
    }
    choices.extend(config.viewpoint.as_ref().map(weighted_by));
    if facts.continuous > 0 {
        choices.push(Choice {
            part: "swept tests",
            chosen:
                "boxes around the way between two poses, time of impact by conservative advancement"
                    .to_owned(),
            why: format!("{} continuous bodies", facts.continuous),
        });
    }
    if facts.deforming > 0 {
        choices.push(Choice {
            part: "deforming meshes",
            chosen:
                "boxes along the axes of the body, widened by what moved, refitted where pairs wait"
                    .to_owned(),
            why: format!(
                "{} bodies, {} triangles, {} vertices",
                facts.deforming, facts.bending[0], facts.bending[1]
            ),
        });
    }
    let limited = config.budget.is_limited();
    choices.push(Choice {
        part: "order of work",
        chosen: if limited {
            "oldest undecided first"
        } else {
            "as found"
        }
        .to_owned(),
        why: if limited {
            "the budget is limited"
        } else {
            "the budget is not limited; oldest first all the same where a frame says when it must be answered"
        }
        .to_owned(),
    });
    choices
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

fn left_out(facts: &Facts, method: Method) -> Vec<LeftOut> {
    let mut left_out = Vec::new();
    let mut out = |part, why: String, saved_bytes| {
        left_out.push(LeftOut {
            part,
            why,
            saved_bytes,
        })
    };
    if method == Method::BruteForce {
        // Boxes in two forms, what is known of motion, candidates: about 200 bytes a body in the scenes of the bench.
        out(
            "blocks of boxes and lists of candidates",
            format!("{} boxes", facts.boxes),
            facts.boxes as u64 * 200,
        );
    }
    if facts.shapes[1] == 0 {
        out("trees and walks over meshes", "no mesh".to_owned(), 0);
    }
    if facts.shapes[2] == 0 {
        out("list of unbounded bodies", "no half-space".to_owned(), 0);
    }
    if facts.several_shapes == 0 && facts.shapes[1] == 0 {
        out(
            "resumable queries",
            "each body is one convex shape or half-space".to_owned(),
            0,
        );
    }
    if facts.continuous == 0 {
        let path = size_of::<Path>() + LEGS_MAX * size_of::<Leg>();
        out(
            "swept tests",
            "no continuous body".to_owned(),
            facts.moving * path as u64,
        );
    }
    if facts.deforming == 0 {
        // What such a mesh has beside a rigid one: a row of 16 bytes a vertex.
        out("vertex updates and refits", "no body deforms".to_owned(), 0);
    }
    if facts.moving == 0 {
        // The two numbers a body are there all the same.
        out("motion pass", "nothing can move".to_owned(), 0);
    }
    if facts.stale_by_speed == 0 {
        out(
            "reach of stale bodies",
            "no body says max_speed_mps".to_owned(),
            0,
        );
    }
    out(
        "contacts and manifolds, while nobody reads them",
        "computed on demand; meshes keep 30 bytes a triangle for walks over their surface"
            .to_owned(),
        0,
    );
    out(
        "regions of contact, while nobody reads them",
        "computed on demand; meshes keep 7 bytes a triangle for their normals".to_owned(),
        0,
    );
    left_out
}
