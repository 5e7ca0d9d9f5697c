//! The parts that a scene does not need, and the memory that this saves.

use crate::broad::Method;
use crate::error::counted;
use crate::limits::LEGS_MAX;
use crate::world::{Leg, Path};

use super::facts::Facts;
use super::{LeftOut, Seen};

pub(super) fn of(facts: &Facts, method: Method, seen: Seen) -> Vec<LeftOut> {
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
            counted(facts.boxes, "box", "boxes"),
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
    if facts.rules == 0 {
        out("filters by name", "no rule of pairs".to_owned(), 0);
    }
    unread(seen, &mut out);
    left_out
}

/// Outputs without readers, which are not computed.
fn unread(seen: Seen, out: &mut impl FnMut(&'static str, String, u64)) {
    let readers = seen.readers;
    if !readers.bounds {
        out(
            "bounds narrower than a verdict needs, while nobody reads them",
            "computed on demand".to_owned(),
            0,
        );
    }
    if !readers.contacts {
        out(
            "contacts and manifolds, while nobody reads them",
            "computed on demand; meshes keep 30 bytes a triangle for walks over their surface"
                .to_owned(),
            0,
        );
    }
    if !readers.regions {
        out(
            "regions of contact, while nobody reads them",
            "computed on demand; meshes keep 7 bytes a triangle for their normals".to_owned(),
            0,
        );
    }
}
