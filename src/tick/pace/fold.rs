//! Two frames of a source as one, where too many wait: none of the newest poses is lost.
//!
//! In: two frames of one session and epoch that the same tick would take, one after the other. Out: the newer one with
//! what the older one says of other bodies, each pose with its own stamp and age.

use super::held::Held;
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::{Frame, WIRE_VERSION, frame_flags};

/// Whether nothing but its rows, session and number could keep the world from taking a frame with poses.
pub(super) fn is_sound(frame: &Frame) -> bool {
    let rows = frame.transforms.len();
    let flags = frame.header.flags;
    matches!(flags, frame_flags::FULL | frame_flags::PARTIAL)
        && frame.header.schema == WIRE_VERSION
        && frame.refused.is_none()
        && (frame.velocities.is_empty() || frame.velocities.len() == rows)
        && !(frame.waited && frame.header.sent_ns == 0)
}

/// Folds the older frame into the newer one; `false`: it cannot be, and nothing is changed.
///
/// The newer one needs the later revision of the two, and stands for all that the older one would have stood for. Where
/// only one says velocities none is kept: a pose is worth more.
///
/// * `ids` - memory for the bodies of the newer one.
///
/// Cost: O((n + m) log m) for n rows of the older frame and m of the newer one.
pub(super) fn fold(older: &Held, newer: &mut Held, ids: &mut Vec<u64>) -> bool {
    if !(is_sound(&older.frame) && is_sound(&newer.frame)) {
        return false;
    }
    ids.clear();
    ids.extend(newer.frame.transforms.iter().map(|row| row.body));
    ids.sort_unstable();
    let lacks = |body: u64| ids.binary_search(&body).is_err();
    let more = older.frame.transforms.iter();
    let more = more.filter(|row| lacks(row.body)).count();
    if newer.frame.transforms.len() + more > FRAME_ROWS_MAX {
        return false;
    }
    tell_ages(newer);
    let (old, new) = (&older.frame, &mut newer.frame);
    let says_all = |frame: &Frame| frame.velocities.len() == frame.transforms.len();
    let with_speeds = says_all(old) && says_all(new);
    if !with_speeds {
        new.velocities.clear();
    }
    for (at, row) in old.transforms.iter().enumerate() {
        if lacks(row.body) {
            new.transforms.push(*row);
            new.stamps_ns.push(stamp_of(old, at));
            new.since_ns.push(since_of(older, at));
            if with_speeds {
                new.velocities.extend(old.velocities.get(at));
            }
        }
    }
    let refused = old.refused_bodies.iter();
    let refused = refused.filter(|(body, _)| lacks(*body));
    let own = new.refused_bodies.len();
    new.refused_bodies.extend(refused);
    if new.refused_bodies.len() > own {
        // Each body once, with the newer reason.
        new.refused_bodies.sort_by_key(|(body, _)| *body);
        new.refused_bodies.dedup_by_key(|(body, _)| *body);
    }
    new.header.scene_rev = new.header.scene_rev.max(old.header.scene_rev);
    if old.header.flags == frame_flags::FULL {
        new.header.flags = frame_flags::FULL;
    }
    true
}

/// Each row of a frame says its own stamp and age.
fn tell_ages(held: &mut Held) {
    let rows = held.frame.transforms.len();
    for at in held.frame.stamps_ns.len()..rows {
        let stamp_ns = stamp_of(&held.frame, at);
        held.frame.stamps_ns.push(stamp_ns);
    }
    for at in held.frame.since_ns.len()..rows {
        let since_ns = since_of(held, at);
        held.frame.since_ns.push(since_ns);
    }
}

fn stamp_of(frame: &Frame, at: usize) -> u64 {
    let own_ns = frame.stamps_ns.get(at).copied();
    own_ns.unwrap_or(frame.header.stamp_ns)
}

/// From when the age of a row counts, as the world takes it: never later than its receipt.
fn since_of(held: &Held, at: usize) -> u64 {
    let received_ns = held.whose.received_ns;
    let own_ns = held.frame.since_ns.get(at).copied();
    let sent_ns = match held.frame.header.sent_ns {
        0 => received_ns,
        sent_ns => sent_ns,
    };
    own_ns.unwrap_or(sent_ns).min(received_ns)
}
