//! From drafts to bodies: duplicate names and ids, sources, neighbours, attachments, files.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::config::Limits;
use crate::ids::BodyId;
use crate::scene::node::Fault;
use crate::scene::read_body::BodyDraft;
use crate::scene::read_ros::check_ros;
use crate::scene::table::{mend_name, shortened};
use crate::scene::{BodySpec, SourceSpec};
use crate::shape::ShapeSpec;

/// Resolves the references of bodies to each other and to the sources.
///
/// * `base` - the folder that mesh files are relative to; `None`: mesh files are not looked for.
///
/// Cost: O(n log n).
pub(crate) fn resolve(
    mut drafts: Vec<BodyDraft>,
    sources: &[SourceSpec],
    limits: &Limits,
    base: Option<&Path>,
) -> Result<Vec<BodySpec>, Fault> {
    if let Some(extra) = drafts.get(limits.bodies) {
        let text = format!(
            "{} bodies, but the limit is {}: raise bodies in [limits], or remove some",
            drafts.len(),
            limits.bodies
        );
        return Err(within(extra, extra.places.name, text));
    }
    let by_name = check_names(&drafts)?;
    for draft in &drafts {
        check_reference(draft, &by_name, &drafts)?;
    }
    check_loops(&drafts, &by_name)?;
    drop(by_name);
    settle_ids(&mut drafts)?;
    let mut seen = BTreeSet::new();
    let mut topics = BTreeMap::new();
    for draft in &mut drafts {
        settle_source(draft, sources)?;
        check_ros(draft, sources, &mut topics)?;
        if let Some(base) = base {
            check_files(draft, base, &mut seen)?;
        }
    }
    Ok(drafts.into_iter().map(|draft| draft.spec).collect())
}

pub(crate) fn within(draft: &BodyDraft, at: Option<usize>, text: String) -> Fault {
    Fault::new(at, text).within(&format!("body \"{}\"", shortened(&draft.spec.name)))
}

fn check_names(drafts: &[BodyDraft]) -> Result<BTreeMap<String, usize>, Fault> {
    let mut by_name = BTreeMap::new();
    for (place, draft) in drafts.iter().enumerate() {
        if let Some(first) = by_name.insert(draft.spec.name.clone(), place) {
            let text = "this name is taken: give each body its own".to_owned();
            let first = drafts.get(first).and_then(|first| first.places.name);
            return Err(within(draft, draft.places.name, text).with_other(first));
        }
    }
    Ok(by_name)
}

fn check_reference(
    draft: &BodyDraft,
    by_name: &BTreeMap<String, usize>,
    drafts: &[BodyDraft],
) -> Result<(), Fault> {
    for (key, name, at) in [
        ("parent", &draft.spec.parent, draft.places.parent),
        (
            "attached_to",
            &draft.spec.attached_to,
            draft.places.attached_to,
        ),
    ] {
        let Some(name) = name else { continue };
        if *name == draft.spec.name {
            let text = format!("{key} names the body itself: name another, or remove it");
            return Err(within(draft, at, text));
        }
        if !by_name.contains_key(name) {
            let names = drafts.iter().map(|d| d.spec.name.as_str());
            // A body cannot refer to itself.
            let known: Vec<&str> = names.filter(|own| *own != draft.spec.name).collect();
            let text = format!(
                "{key} names body \"{}\", which is not there: {}",
                shortened(name),
                mend_name(name, &known, "[[body]]")
            );
            return Err(within(draft, at, text));
        }
    }
    Ok(())
}

/// Checks that neighbours and attachments form no cycles.
fn check_loops(drafts: &[BodyDraft], by_name: &BTreeMap<String, usize>) -> Result<(), Fault> {
    type Link = fn(&BodyDraft) -> Option<&String>;
    let links: [(&str, Link); 2] = [
        ("parent", |d| d.spec.parent.as_ref()),
        ("attached_to", |d| d.spec.attached_to.as_ref()),
    ];
    for (key, link) in links {
        // By body: the walk that first visited it; 0: none yet.
        let mut walk_of = vec![0_usize; drafts.len()];
        for start in 0..drafts.len() {
            let (walk, mut at) = (start + 1, start);
            while walk_of[at] == 0 {
                walk_of[at] = walk;
                match link(&drafts[at]).and_then(|name| by_name.get(name)) {
                    Some(next) => at = *next,
                    None => break,
                }
                if walk_of[at] == walk {
                    let text =
                        format!("{key} leads in a loop back to this body: remove one {key} of it");
                    let draft = &drafts[at];
                    let place = match key {
                        "parent" => draft.places.parent,
                        _ => draft.places.attached_to,
                    };
                    return Err(within(draft, place, text));
                }
            }
        }
    }
    Ok(())
}

/// Assigns ids: the given ones first, then the least free one to each other body, in order.
fn settle_ids(drafts: &mut [BodyDraft]) -> Result<(), Fault> {
    let mut taken: BTreeMap<u64, usize> = BTreeMap::new();
    for (place, draft) in drafts.iter().enumerate() {
        if draft.spec.id.0 == 0 {
            continue;
        }
        if let Some(first) = taken.insert(draft.spec.id.0, place) {
            let text = format!("id {} is taken: give each body its own", draft.spec.id.0);
            let first = drafts.get(first).and_then(|first| first.places.id);
            return Err(within(draft, draft.places.id, text).with_other(first));
        }
    }
    let mut next = 1;
    for draft in drafts.iter_mut().filter(|draft| draft.spec.id.0 == 0) {
        while taken.contains_key(&next) {
            next += 1;
        }
        draft.spec.id = BodyId(next);
        next += 1;
    }
    Ok(())
}

pub(crate) fn settle_source(draft: &mut BodyDraft, sources: &[SourceSpec]) -> Result<(), Fault> {
    let Some(name) = &draft.source else {
        if !draft.spec.moves {
            return Ok(());
        }
        draft.spec.source = match sources {
            [_] => Some(0),
            _ if draft.spec.attached_to.is_some() => None,
            [] => {
                let text = "it moves, but the scene has no source: add [[source]] name = \"..\", or write moves = false";
                return Err(within(draft, draft.places.name, text.to_owned()));
            }
            _ => {
                let text = "it moves, and the scene has several sources: write source = \"..\", or moves = false";
                return Err(within(draft, draft.places.name, text.to_owned()));
            }
        };
        return Ok(());
    };
    draft.spec.source = sources.iter().position(|source| source.name == *name);
    if draft.spec.source.is_none() {
        let known: Vec<&str> = sources.iter().map(|source| source.name.as_str()).collect();
        let text = format!(
            "source \"{}\" is not there: {}",
            shortened(name),
            mend_name(name, &known, "[[source]]")
        );
        return Err(within(draft, draft.places.source, text));
    }
    Ok(())
}

/// Checks that mesh files exist; they are read when shapes are built.
pub(crate) fn check_files(
    draft: &BodyDraft,
    base: &Path,
    seen: &mut BTreeSet<String>,
) -> Result<(), Fault> {
    for (place, placed) in draft.spec.shapes.iter().enumerate() {
        let (ShapeSpec::Convex { file, .. } | ShapeSpec::Trimesh { file, .. }) = &placed.shape
        else {
            continue;
        };
        let Some(file) = file else { continue };
        if seen.contains(file) {
            continue;
        }
        if let Err(error) = crate::shape::find_mesh(base, file) {
            let at = draft.places.shapes.get(place).copied().flatten();
            return Err(within(draft, at, error.to_string()));
        }
        seen.insert(file.clone());
    }
    Ok(())
}
