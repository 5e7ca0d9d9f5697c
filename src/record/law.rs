//! The law: a replay without a limit of time must confirm what a tick published under such a limit.
//!
//! How far a tick comes by its deadline depends on the machine, so that no replay publishes the same. What it published
//! is proved all the same: certified verdicts must agree, proved intervals must overlap, and no collision may be
//! missing if no pair was left out.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use super::differ::Spot;
use crate::wire::{Demand, MessageHeader, Outbox, PairRow, State, Verdict, pair_flags};

/// Counts of what was judged by the law so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Judged {
    /// Recorded rows whose interval or verdict was compared with the replay.
    pub rows: u64,
    /// Collisions of the replay that were looked up in the recording.
    pub collisions: u64,
    /// Of these, those that the recording left undecided.
    pub open: u64,
}

/// The pairs that the replay certified as colliding in its previous tick. A sweep from those poses finds no new touch,
/// while the recording may have left them undecided and have found its first touch after a teleport.
#[derive(Debug, Default)]
pub(super) struct Before {
    pairs: BTreeSet<(u64, u64)>,
    /// Whether rows were left out: then it may be any pair.
    cut: bool,
}

impl Before {
    /// Stores the pairs of a replayed tick, for the next one.
    pub(super) fn take(&mut self, replayed: &Outbox) {
        let colliding = live(&replayed.pairs).filter(|row| verdict(row) == Verdict::Colliding);
        self.pairs.clear();
        self.pairs
            .extend(colliding.map(|row| (row.body_a, row.body_b)));
        self.cut = !is_whole(&replayed.pairs_header);
    }

    /// Whether a recorded touch on the way is one that the replay would not report again.
    fn covers(&self, row: &PairRow) -> bool {
        let on_way = has(row, pair_flags::SWEPT_HIT) && verdict(row) != Verdict::Colliding;
        let known = || self.cut || self.pairs.contains(&(row.body_a, row.body_b));
        on_way && (is_of_before(row) || known())
    }
}

/// The first statement of a recorded tick that the law refutes.
///
/// * `demand` - readers of the recorded tick; the replayed one always has pairs.
/// * `before` - the pairs of the replay's previous tick.
pub(super) fn judge(
    recorded: &Outbox,
    replayed: &Outbox,
    demand: Demand,
    before: &Before,
    judged: &mut Judged,
) -> Option<Spot> {
    if demand.pairs {
        let (mut a, mut b) = (live(&recorded.pairs), live(&replayed.pairs));
        let whole = is_whole(&replayed.pairs_header);
        let (mut one, mut two) = (a.next(), b.next());
        loop {
            let spot = match order(one, two) {
                None => break,
                Some(Ordering::Equal) => {
                    let spot = one
                        .zip(two)
                        .and_then(|(one, two)| both(one, two, before, judged));
                    (one, two) = (a.next(), b.next());
                    spot
                }
                Some(Ordering::Less) => {
                    let spot = one.filter(|_| whole).and_then(|one| alone(one, before));
                    judged.rows += u64::from(whole);
                    one = a.next();
                    spot
                }
                Some(Ordering::Greater) => {
                    let told = is_whole(&recorded.pairs_header);
                    let missed = two.filter(|row| touches(row));
                    judged.collisions += u64::from(missed.is_some());
                    two = b.next();
                    missed
                        .filter(|row| told && !only_touches(row))
                        .map(|row| spot(row, "verdict", "no row: apart", &words(row)))
                }
            };
            if spot.is_some() {
                return spot;
            }
        }
    }
    state(recorded, replayed, before)
}

/// Rows of pairs that still exist.
fn live(rows: &[PairRow]) -> impl Iterator<Item = &PairRow> {
    rows.iter().filter(|row| !has(row, pair_flags::GONE))
}

/// Which of two rows comes first; `None`: both lists are at their end.
fn order(one: Option<&PairRow>, two: Option<&PairRow>) -> Option<Ordering> {
    let key = |row: &PairRow| (row.body_a, row.body_b);
    match (one, two) {
        (None, None) => None,
        (Some(_), None) => Some(Ordering::Less),
        (None, Some(_)) => Some(Ordering::Greater),
        (Some(one), Some(two)) => Some(key(one).cmp(&key(two))),
    }
}

/// Whether a missing row means that the pair is apart.
fn is_whole(header: &MessageHeader) -> bool {
    header.truncated == 0
}

fn has(row: &PairRow, flag: u8) -> bool {
    row.flags & flag != 0
}

fn verdict(row: &PairRow) -> Verdict {
    Verdict::from_code(row.verdict).unwrap_or(Verdict::None)
}

fn touches(row: &PairRow) -> bool {
    verdict(row) == Verdict::Colliding || has(row, pair_flags::SWEPT_HIT)
}

/// Whether the gap is 0 within rounding: then either verdict is right.
fn is_touch(row: &PairRow) -> bool {
    has(row, pair_flags::TOUCHING)
}

/// A touch within rounding, without a touch on the way.
fn only_touches(row: &PairRow) -> bool {
    is_touch(row) && !has(row, pair_flags::SWEPT_HIT)
}

fn is_apart(row: &PairRow) -> bool {
    matches!(verdict(row), Verdict::Apart | Verdict::Near)
}

/// Judges a pair that both ticks report.
fn both(one: &PairRow, two: &PairRow, before: &Before, judged: &mut Judged) -> Option<Spot> {
    judged.rows += 1;
    if touches(two) {
        judged.collisions += 1;
        judged.open += u64::from(!touches(one));
    }
    let overlap = one.gap_min_m <= two.gap_max_m && two.gap_min_m <= one.gap_max_m;
    if !overlap {
        let show = |row: &PairRow| format!("{:?} to {:?}", row.gap_min_m, row.gap_max_m);
        return Some(spot(one, "gap interval, metres", &show(one), &show(two)));
    }
    let touching = is_touch(one) || is_touch(two);
    let collides = |row: &PairRow| verdict(row) == Verdict::Colliding;
    let against = (collides(one) && is_apart(two)) || (is_apart(one) && collides(two));
    if against && !touching {
        return Some(spot(one, "verdict", &words(one), &words(two)));
    }
    swept(one, two, before)
}

/// Judges what the rows say of the way to this tick's poses.
fn swept(one: &PairRow, two: &PairRow, before: &Before) -> Option<Spot> {
    let (hit, open) = (pair_flags::SWEPT_HIT, pair_flags::SWEPT_OPEN);
    // Decided in the replay and contradicted by the recording. A pair that collides now has touched. A touch on the way
    // contradicts nothing if the pair collided before, which one side may have certified a tick before the other.
    let denied = has(two, hit) && !touches(one) && !has(one, open);
    let invented = has(one, hit) && !before.covers(one) && !touches(two) && !has(two, open);
    // A teleported step is not swept: the pair may have touched in it.
    let later = |one: &PairRow, two: &PairRow| {
        one.toi_min > two.toi_max && !has(one, pair_flags::TELEPORTED)
    };
    let apart = has(one, hit) && has(two, hit) && (later(one, two) || later(two, one));
    let show = |row: &PairRow| match (has(row, hit), has(row, open)) {
        (true, _) => format!("touched at {:?} to {:?}", row.toi_min, row.toi_max),
        (_, true) => "open".to_owned(),
        _ => "no touch".to_owned(),
    };
    (denied || invented || apart).then(|| spot(one, "way", &show(one), &show(two)))
}

/// Whether a touch is at the poses that the way begins with: the replay may have certified it in the previous tick,
/// which the recording left undecided.
fn is_of_before(row: &PairRow) -> bool {
    has(row, pair_flags::SWEPT_HIT) && row.toi_max <= 0.0 && verdict(row) != Verdict::Colliding
}

/// Judges a pair that only the recording reports: the replay proved it apart, and not near.
fn alone(one: &PairRow, before: &Before) -> Option<Spot> {
    let wrong = (touches(one) && !before.covers(one)) || one.gap_max_m <= 0.0;
    let wrong = wrong && !is_touch(one);
    wrong.then(|| spot(one, "verdict", &words(one), "no row: apart"))
}

/// Judges the states of the two ticks.
fn state(recorded: &Outbox, replayed: &Outbox, before: &Before) -> Option<Spot> {
    let word = |out: &Outbox| State::from_code(out.tick.header.state);
    let (one, two) = (word(recorded)?, word(replayed)?);
    let is_safe = |state: State| matches!(state, State::Clear | State::Near);
    // If all touches are within rounding, either state is right.
    let by_touches = |out: &Outbox, is_of_before: &dyn Fn(&PairRow) -> bool| {
        let news = |row: &&PairRow| touches(row) && !is_of_before(row);
        let mut touching = live(&out.pairs).filter(news).peekable();
        is_whole(&out.pairs_header) && touching.peek().is_some() && touching.all(only_touches)
    };
    let denied = is_safe(one) && two == State::Colliding && !by_touches(replayed, &is_of_before);
    let covered = |row: &PairRow| before.covers(row);
    let of_now = |row: &PairRow| touches(row) && !covered(row);
    let of_before = recorded.pairs.iter().any(covered) && !recorded.pairs.iter().any(of_now);
    let invented =
        one == State::Colliding && is_safe(two) && !of_before && !by_touches(recorded, &covered);
    (denied || invented).then(|| Spot {
        field: "state".to_owned(),
        ..Spot::whole("tick", one.word(), two.word())
    })
}

fn spot(row: &PairRow, field: &str, recorded: &str, replayed: &str) -> Spot {
    Spot {
        bodies: vec![row.body_a, row.body_b],
        field: field.to_owned(),
        ..Spot::whole("pairs", recorded, replayed)
    }
}

fn words(row: &PairRow) -> String {
    let (min, max) = (row.gap_min_m, row.gap_max_m);
    format!("{}, gap {min:?} to {max:?} m", verdict(row))
}

#[cfg(test)]
mod tests;
