//! The parts that few ticks have: edits with their files, settings, trees.

use std::sync::Arc;

use super::Taken;
use crate::record::bytes::{Damaged, Field, Take, put_count, put_run};
use crate::record::given::{Asked, Between, EditRecord, Origin, TreeMark};
use crate::shape::Contents;
use crate::world::Applied;

pub(super) fn put_between(between: &Between, to: &mut Vec<u8>) {
    let mut tree = |kind: u8, of: &TreeMark, taken: bool| {
        [kind, u8::from(taken)].put(to);
        of.body.put(to);
        of.generation.put(to);
        of.updates.put(to);
    };
    match between {
        Between::TreeAsked(of) => tree(3, of, false),
        Between::TreeBuilt(of, taken) => tree(4, of, *taken),
        Between::TreeRefused(of) => tree(5, of, false),
        Between::Skipped { source, frames } => {
            [1_u8, 0].put(to);
            source.unwrap_or(u32::MAX).put(to);
            frames.put(to);
        }
        Between::Timeout { source, timeout_ns } => {
            [2_u8, 0].put(to);
            source.put(to);
            timeout_ns.put(to);
        }
        Between::Mode(words) => {
            [6_u8, 0].put(to);
            put_run(words.as_bytes(), to);
        }
    }
}

pub(super) fn take_between(from: &mut Take<'_>) -> Taken<Between> {
    let [kind, taken] = <[u8; 2]>::take(from)?;
    let tree = |from: &mut Take<'_>| {
        Ok(TreeMark {
            body: Field::take(from)?,
            generation: Field::take(from)?,
            updates: Field::take(from)?,
        })
    };
    Ok(match kind {
        1 => {
            let (source, frames) = (u32::take(from)?, u64::take(from)?);
            Between::Skipped {
                source: (source != u32::MAX).then_some(source),
                frames,
            }
        }
        2 => Between::Timeout {
            source: Field::take(from)?,
            timeout_ns: Field::take(from)?,
        },
        3 => Between::TreeAsked(tree(from)?),
        4 => Between::TreeBuilt(tree(from)?, taken != 0),
        5 => Between::TreeRefused(tree(from)?),
        6 => Between::Mode(from.text()?),
        _ => return Err(Damaged),
    })
}

pub(super) fn put_edit(edit: &EditRecord, to: &mut Vec<u8>) {
    edit.token.put(to);
    match &edit.origin {
        Origin::Asked(asked) => {
            0_u8.put(to);
            (asked.json_len as u64).put(to);
            put_run(&asked.payload, to);
            put_files(&asked.files, to);
        }
        Origin::Margin(within_m) => {
            [1, u8::from(within_m.is_some())].put(to);
            within_m.unwrap_or(0.0).put(to);
        }
        Origin::Reset => 2_u8.put(to),
    }
    match &edit.outcome {
        Ok(applied) => {
            [0, u8::from(applied.changed)].put(to);
            applied.scene_rev.put(to);
        }
        Err(why) => {
            [1_u8, 0].put(to);
            put_run(why.as_bytes(), to);
        }
    }
}

pub(super) fn take_edit(from: &mut Take<'_>) -> Taken<EditRecord> {
    let token = u64::take(from)?;
    let origin = match u8::take(from)? {
        0 => {
            let json_len = usize::try_from(u64::take(from)?).map_err(|_| Damaged)?;
            Origin::Asked(Asked {
                json_len,
                payload: from.run()?.to_vec(),
                files: take_files(from)?,
            })
        }
        1 => {
            let given = u8::take(from)? != 0;
            let within_m = f64::take(from)?;
            Origin::Margin(given.then_some(within_m))
        }
        2 => Origin::Reset,
        _ => return Err(Damaged),
    };
    let [refused, changed] = <[u8; 2]>::take(from)?;
    let outcome = if refused == 0 {
        Ok(Applied {
            scene_rev: Field::take(from)?,
            changed: changed != 0,
        })
    } else {
        Err(from.text()?)
    };
    Ok(EditRecord {
        token,
        origin,
        outcome,
    })
}

pub(super) fn put_files(files: &Contents, to: &mut Vec<u8>) {
    put_count(files.len(), to);
    for (name, bytes) in files {
        put_run(name.as_bytes(), to);
        put_run(bytes, to);
    }
}

pub(super) fn take_files(from: &mut Take<'_>) -> Taken<Contents> {
    let mut files = Contents::new();
    for _ in 0..from.count(2 * u64::BYTES)? {
        let name = from.text()?;
        files.insert(name, Arc::from(from.run()?));
    }
    Ok(files)
}
