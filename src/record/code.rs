//! Encodes and decodes the messages of a recording; `msgs/record` describes the format.
//!
//! Rows as on the wire, little-endian: exact for every float, as fast as a memory copy, and readable with the
//! definitions that `msgs/` has for other languages. Rare parts (edits, settings) take few bytes; without them a tick
//! stores only a count.

mod rare;

use super::bytes::{Damaged, Field, Take, put_count, put_rows, put_run, take_rows};
use super::given::{Ask, Facts, LAYOUT, Start, TickRecord};
use crate::error::{Error, Result as Outcome};
use crate::time::Budget;
use crate::wire::{
    Demand, Frame, Inbox, Outbox, RejectReason, TickCause, VertexFrame, WIRE_VERSION,
};

use rare::{put_between, put_edit, put_files, take_between, take_edit, take_files};

/// Stands for no source or no reason where these take one byte.
const NONE: u8 = u8::MAX;
/// Least bytes of a frame, which bounds the number of frames that a list may claim.
const HEAD_BYTES: usize = 32;

type Taken<T> = Result<T, Damaged>;

/// Encodes a start.
#[must_use]
pub(super) fn start_bytes(start: &Start) -> Vec<u8> {
    let mut to = Vec::new();
    let facts = serde_json::to_vec(&start.facts).unwrap_or_default();
    put_run(&facts, &mut to);
    put_run(start.scene.as_bytes(), &mut to);
    put_files(&start.files, &mut to);
    to
}

/// Decodes a start.
///
/// # Errors
/// `Error::Refused` if it is damaged, or of another layout or wire version; `Error::Io` if its facts are not the
/// expected JSON.
pub(super) fn start_of(bytes: &[u8]) -> Outcome<Start> {
    let damaged = |_| Error::Refused("the recording's start is damaged: record anew".to_owned());
    let mut from = Take(bytes);
    let facts = from.run().map_err(damaged)?;
    let facts: Facts = serde_json::from_slice(facts)
        .map_err(|e| Error::io("the recording's start says what this sweepd cannot read", e))?;
    for (what, theirs, ours) in [
        ("layout", facts.layout, LAYOUT),
        ("wire version", facts.wire_version, WIRE_VERSION),
    ] {
        if theirs != ours {
            return Err(Error::Refused(format!(
                "the recording has {what} {theirs} and this sweepd {ours}: replay it with sweepd {}",
                facts.sweepd_version
            )));
        }
    }
    let mut rest = || {
        let scene = from.text()?;
        let files = take_files(&mut from)?;
        from.end()?;
        Ok((scene, files))
    };
    let (scene, files) = rest().map_err(damaged)?;
    Ok(Start {
        facts,
        scene,
        files,
    })
}

/// Appends what the engine was given for a tick.
pub(super) fn put_input(record: &TickRecord, to: &mut Vec<u8>) {
    let ask = &record.ask;
    record.out.tick.header.tick.put(to);
    record.now_ns.put(to);
    ask.woke_ns.put(to);
    ask.budget.time_ns.unwrap_or(u64::MAX).put(to);
    ask.budget.units.unwrap_or(u64::MAX).put(to);
    let limits = u8::from(ask.budget.time_ns.is_some()) | u8::from(ask.budget.units.is_some()) << 1;
    let source = ask.cause_source.and_then(|at| u8::try_from(at).ok());
    let small = [
        limits,
        ask.cause.code(),
        source.unwrap_or(NONE),
        demand_bits(ask.demand),
    ];
    small.put(to);
    put_count(record.between.len(), to);
    record.between.iter().for_each(|b| put_between(b, to));
    put_count(record.edits.len(), to);
    record.edits.iter().for_each(|edit| put_edit(edit, to));
    put_inbox(&record.inbox, to);
}

/// Decodes what [`put_input`] appends into a record; returns the tick's number.
///
/// # Errors
/// If the bytes are no input.
pub(super) fn take_input(bytes: &[u8], into: &mut TickRecord) -> Taken<u64> {
    let mut from = Take(bytes);
    into.clear();
    let tick = u64::take(&mut from)?;
    into.now_ns = u64::take(&mut from)?;
    let woke_ns = u64::take(&mut from)?;
    let (time_ns, units) = (u64::take(&mut from)?, u64::take(&mut from)?);
    let [limits, cause, source, demand] = Field::take(&mut from)?;
    into.ask = Ask {
        demand: demand_of(demand),
        budget: Budget {
            time_ns: (limits & 1 != 0).then_some(time_ns),
            units: (limits & 2 != 0).then_some(units),
        },
        cause: TickCause::from_code(cause).ok_or(Damaged)?,
        cause_source: (source != NONE).then_some(usize::from(source)),
        woke_ns,
    };
    for _ in 0..from.count(1)? {
        into.between.push(take_between(&mut from)?);
    }
    for _ in 0..from.count(1)? {
        into.edits.push(take_edit(&mut from)?);
    }
    take_inbox(&mut from, &mut into.inbox)?;
    from.end()?;
    Ok(tick)
}

/// Appends what a tick published. The outbox of a record has no rows that lack readers.
pub(super) fn put_output(out: &Outbox, demand: Demand, to: &mut Vec<u8>) {
    let news = u8::from(out.names_changed) | u8::from(out.plan_changed) << 1;
    [demand_bits(demand), news, 0, 0].put(to);
    out.tick.put(to);
    for header in [
        &out.pairs_header,
        &out.contacts_header,
        &out.regions_header,
        &out.bodies_header,
    ] {
        header.put(to);
    }
    put_rows(&out.pairs, to);
    put_rows(&out.contacts, to);
    put_rows(&out.regions, to);
    put_rows(&out.bodies, to);
    put_rows(&out.body_verdicts, to);
    put_rows(&out.names, to);
    put_run(out.plan.as_bytes(), to);
}

/// Decodes what [`put_output`] appends.
///
/// # Errors
/// If the bytes are no output.
pub(super) fn take_output(bytes: &[u8], out: &mut Outbox) -> Taken<()> {
    let mut from = Take(bytes);
    let [_, news, ..] = <[u8; 4]>::take(&mut from)?;
    (out.names_changed, out.plan_changed) = (news & 1 != 0, news & 2 != 0);
    out.tick = Field::take(&mut from)?;
    for header in [
        &mut out.pairs_header,
        &mut out.contacts_header,
        &mut out.regions_header,
        &mut out.bodies_header,
    ] {
        *header = Field::take(&mut from)?;
    }
    take_rows(&mut from, &mut out.pairs)?;
    take_rows(&mut from, &mut out.contacts)?;
    take_rows(&mut from, &mut out.regions)?;
    take_rows(&mut from, &mut out.bodies)?;
    take_rows(&mut from, &mut out.body_verdicts)?;
    take_rows(&mut from, &mut out.names)?;
    out.plan = from.text()?;
    from.end()
}

fn demand_bits(demand: Demand) -> u8 {
    u8::from(demand.pairs)
        | u8::from(demand.contacts) << 1
        | u8::from(demand.regions) << 2
        | u8::from(demand.bodies) << 3
        | u8::from(demand.body_verdicts) << 4
        | u8::from(demand.changes) << 5
        | u8::from(demand.changes_anew) << 6
        | u8::from(demand.contact_changes) << 7
}

fn demand_of(bits: u8) -> Demand {
    Demand {
        pairs: bits & 1 != 0,
        contacts: bits & 2 != 0,
        regions: bits & 4 != 0,
        bodies: bits & 8 != 0,
        body_verdicts: bits & 16 != 0,
        changes: bits & 32 != 0,
        changes_anew: bits & 64 != 0,
        contact_changes: bits & 128 != 0,
    }
}

fn put_inbox(inbox: &Inbox, to: &mut Vec<u8>) {
    put_count(inbox.frames().len(), to);
    for frame in inbox.frames() {
        frame.header.put(to);
        frame.received_ns.put(to);
        let cut = u8::from(frame.cut);
        [u8::from(frame.waited), reason_code(frame.refused), cut, 0].put(to);
        frame.first_seq.put(to);
        put_rows(&frame.transforms, to);
        put_rows(&frame.velocities, to);
        put_rows(&frame.stamps_ns, to);
        put_rows(&frame.since_ns, to);
        put_count(frame.refused_bodies.len(), to);
        for (body, reason) in &frame.refused_bodies {
            body.put(to);
            reason.code().put(to);
        }
    }
    put_count(inbox.vertices().len(), to);
    for frame in inbox.vertices() {
        frame.header.put(to);
        frame.received_ns.put(to);
        [u8::from(frame.waited), reason_code(frame.refused), 0, 0].put(to);
        put_rows(&frame.rows, to);
    }
    put_rows(inbox.ended(), to);
}

fn take_inbox(from: &mut Take<'_>, inbox: &mut Inbox) -> Taken<()> {
    for _ in 0..from.count(HEAD_BYTES)? {
        take_frame(from, inbox.push())?;
    }
    for _ in 0..from.count(HEAD_BYTES)? {
        let frame: &mut VertexFrame = inbox.push_vertices();
        frame.header = Field::take(from)?;
        frame.received_ns = Field::take(from)?;
        (frame.waited, frame.refused, _) = take_marks(from)?;
        take_rows(from, &mut frame.rows)?;
    }
    let mut ended = Vec::new();
    take_rows(from, &mut ended)?;
    ended
        .into_iter()
        .for_each(|session| inbox.end_session(session));
    Ok(())
}

fn take_frame(from: &mut Take<'_>, frame: &mut Frame) -> Taken<()> {
    frame.header = Field::take(from)?;
    frame.received_ns = Field::take(from)?;
    (frame.waited, frame.refused, frame.cut) = take_marks(from)?;
    frame.first_seq = Field::take(from)?;
    take_rows(from, &mut frame.transforms)?;
    take_rows(from, &mut frame.velocities)?;
    take_rows(from, &mut frame.stamps_ns)?;
    take_rows(from, &mut frame.since_ns)?;
    for _ in 0..from.count(u64::BYTES + u8::BYTES)? {
        let (body, code) = (u64::take(from)?, u8::take(from)?);
        let reason = RejectReason::from_code(code).ok_or(Damaged)?;
        frame.refused_bodies.push((body, reason));
    }
    Ok(())
}

fn reason_code(reason: Option<RejectReason>) -> u8 {
    reason.map_or(NONE, RejectReason::code)
}

fn take_marks(from: &mut Take<'_>) -> Taken<(bool, Option<RejectReason>, bool)> {
    let [waited, reason, cut, _] = <[u8; 4]>::take(from)?;
    let refused = match reason {
        NONE => None,
        code => Some(RejectReason::from_code(code).ok_or(Damaged)?),
    };
    Ok((waited != 0, refused, cut != 0))
}

#[cfg(test)]
mod tests;
