//! By the law: whether what a tick said under a limit of time is borne out by what is found without one.
//!
//! How far a tick came by its deadline depends on the machine, so that no replay says the same. What it said is proved
//! all the same: a certified verdict must agree, the proved intervals must overlap, and no collision may be missing
//! where all pairs were told.

use std::cmp::Ordering;

use super::differ::Spot;
use crate::wire::{Demand, MessageHeader, Outbox, PairRow, State, Verdict, pair_flags};

/// What was held against the law so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Judged {
    /// Recorded rows whose interval or verdict was held against a replayed one.
    pub rows: u64,
    /// Collisions of the replay that were looked for in the recording.
    pub collisions: u64,
    /// Of these, told as not decided.
    pub open: u64,
}

/// The first thing that a recorded tick said wrongly.
///
/// * `demand` - who listened to the recorded one; the replayed one is filled with pairs.
pub(super) fn judge(
    recorded: &Outbox,
    replayed: &Outbox,
    demand: Demand,
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
                    let spot = one.zip(two).and_then(|(one, two)| both(one, two, judged));
                    (one, two) = (a.next(), b.next());
                    spot
                }
                Some(Ordering::Less) => {
                    let spot = one.filter(|_| whole).and_then(alone);
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
    state(recorded, replayed)
}

/// Rows of pairs that are there.
fn live(rows: &[PairRow]) -> impl Iterator<Item = &PairRow> {
    rows.iter().filter(|row| !has(row, pair_flags::GONE))
}

/// Which of two rows comes first; `None`: both are at their end.
fn order(one: Option<&PairRow>, two: Option<&PairRow>) -> Option<Ordering> {
    let key = |row: &PairRow| (row.body_a, row.body_b);
    match (one, two) {
        (None, None) => None,
        (Some(_), None) => Some(Ordering::Less),
        (None, Some(_)) => Some(Ordering::Greater),
        (Some(one), Some(two)) => Some(key(one).cmp(&key(two))),
    }
}

/// Whether absence of a row says that the pair is apart.
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

/// Whether 0 is within the rounding: then either certificate may be had.
fn is_touch(row: &PairRow) -> bool {
    has(row, pair_flags::TOUCHING)
}

/// A touch within rounding, and none on the way.
fn only_touches(row: &PairRow) -> bool {
    is_touch(row) && !has(row, pair_flags::SWEPT_HIT)
}

fn is_apart(row: &PairRow) -> bool {
    matches!(verdict(row), Verdict::Apart | Verdict::Near)
}

/// A pair that both tell of.
fn both(one: &PairRow, two: &PairRow, judged: &mut Judged) -> Option<Spot> {
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
    swept(one, two)
}

/// What is said of the way to this tick's poses.
fn swept(one: &PairRow, two: &PairRow) -> Option<Spot> {
    let (hit, open) = (pair_flags::SWEPT_HIT, pair_flags::SWEPT_OPEN);
    // Decided in the replay, and said otherwise in the recording. Who collides now has touched: that it did so on the
    // way is no news where it collided before, which one may have certified a tick earlier than the other.
    let denied = has(two, hit) && !touches(one) && !has(one, open);
    let invented = has(one, hit) && !is_of_before(one) && !touches(two) && !has(two, open);
    let apart =
        has(one, hit) && has(two, hit) && (one.toi_min > two.toi_max || two.toi_min > one.toi_max);
    let show = |row: &PairRow| match (has(row, hit), has(row, open)) {
        (true, _) => format!("touched at {:?} to {:?}", row.toi_min, row.toi_max),
        (_, true) => "open".to_owned(),
        _ => "no touch".to_owned(),
    };
    (denied || invented || apart).then(|| spot(one, "way", &show(one), &show(two)))
}

/// Whether it touched at the poses that its way begins with: the tick before may have certified that in the replay, and
/// have left it open in the recording.
fn is_of_before(row: &PairRow) -> bool {
    has(row, pair_flags::SWEPT_HIT) && row.toi_max <= 0.0 && verdict(row) != Verdict::Colliding
}

/// A pair that the recording alone tells of: the replay proved it apart, and not near.
fn alone(one: &PairRow) -> Option<Spot> {
    let wrong = touches(one) || one.gap_max_m <= 0.0;
    let wrong = wrong && !is_touch(one);
    wrong.then(|| spot(one, "verdict", &words(one), "no row: apart"))
}

/// What was said in one word.
fn state(recorded: &Outbox, replayed: &Outbox) -> Option<Spot> {
    let word = |out: &Outbox| State::from_code(out.tick.header.state);
    let (one, two) = (word(recorded)?, word(replayed)?);
    let is_safe = |state: State| matches!(state, State::Clear | State::Near);
    // By touches within rounding alone either word may be had.
    let by_touches = |out: &Outbox| {
        let news = |row: &&PairRow| touches(row) && !is_of_before(row);
        let mut touching = live(&out.pairs).filter(news).peekable();
        is_whole(&out.pairs_header) && touching.peek().is_some() && touching.all(only_touches)
    };
    let denied = is_safe(one) && two == State::Colliding && !by_touches(replayed);
    let of_now = |row: &&PairRow| touches(row) && !is_of_before(row);
    let of_before = recorded.pairs.iter().any(is_of_before);
    let of_before = of_before && !recorded.pairs.iter().any(|row| of_now(&row));
    let invented = one == State::Colliding && is_safe(two) && !of_before && !by_touches(recorded);
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
mod tests {
    use super::*;

    fn row(body_b: u64, verdict: Verdict, gap_min_m: f64, gap_max_m: f64) -> PairRow {
        PairRow {
            body_a: 1,
            body_b,
            gap_min_m,
            gap_max_m,
            verdict: verdict.code(),
            ..PairRow::default()
        }
    }

    fn out(pairs: Vec<PairRow>) -> Outbox {
        Outbox {
            pairs,
            ..Outbox::default()
        }
    }

    fn field(one: Vec<PairRow>, two: Vec<PairRow>) -> Option<String> {
        let demand = Demand::ALL;
        let (one, two) = (out(one), out(two));
        judge(&one, &two, demand, &mut Judged::default()).map(|spot| spot.field)
    }

    #[test]
    fn what_is_open_or_borne_out_holds() {
        let deep = row(2, Verdict::Colliding, -0.1, -0.1);
        let open = row(2, Verdict::Possible, -1.0, 0.5);
        assert_eq!(field(vec![open], vec![deep]), None);
        assert_eq!(field(vec![deep], vec![deep]), None);
        // Not decided, and apart.
        assert_eq!(field(vec![open], vec![]), None);
        // Within rounding of a touch either is right.
        let mut touch = row(2, Verdict::Colliding, -1e-16, 1e-16);
        touch.flags = pair_flags::TOUCHING;
        let near = row(2, Verdict::Near, 1e-17, 2e-16);
        for one in [vec![near], vec![]] {
            let (mut one, mut two) = (out(one), out(vec![touch]));
            one.tick.header.state = State::Clear.code();
            two.tick.header.state = State::Colliding.code();
            for (recorded, replayed) in [(&one, &two), (&two, &one)] {
                let judged = &mut Judged::default();
                assert_eq!(judge(recorded, replayed, Demand::ALL, judged), None);
            }
            // One on the way is another matter.
            two.pairs[0].flags |= pair_flags::SWEPT_HIT;
            assert!(judge(&one, &two, Demand::ALL, &mut Judged::default()).is_some());
        }
        // The last row of a pair that is gone says nothing of now.
        let mut gone = deep;
        gone.flags = pair_flags::GONE;
        assert_eq!(field(vec![gone], vec![]), None);
    }

    #[test]
    fn what_is_not_borne_out_is_found() {
        let deep = row(3, Verdict::Colliding, -0.1, -0.1);
        let near = row(3, Verdict::Near, 0.1, 0.2);
        let verdict = Some("verdict".to_owned());
        // A collision that was not told of, or none that was.
        assert_eq!(field(vec![], vec![deep]), verdict);
        assert_eq!(field(vec![deep], vec![]), verdict);
        assert_eq!(
            field(vec![near], vec![deep]),
            Some("gap interval, metres".to_owned())
        );
        let wrong = row(3, Verdict::Near, -0.2, 0.2);
        assert_eq!(field(vec![wrong], vec![deep]), verdict);
        let mut hit = near;
        hit.flags = pair_flags::SWEPT_HIT;
        hit.toi_max = 0.5;
        assert_eq!(field(vec![near], vec![hit]), Some("way".to_owned()));
        assert_eq!(field(vec![hit], vec![near]), Some("way".to_owned()));
    }

    #[test]
    fn bug_a_touch_at_the_poses_before_is_news_where_they_were_not_decided() {
        let near = row(3, Verdict::Near, 0.1, 0.2);
        let mut hit = near;
        hit.flags = pair_flags::SWEPT_HIT;
        let (mut one, mut two) = (out(vec![hit]), out(vec![near]));
        one.tick.header.state = State::Colliding.code();
        two.tick.header.state = State::Near.code();
        let judge = |one: &Outbox| judge(one, &two, Demand::ALL, &mut Judged::default());
        assert_eq!(judge(&one), None);
        // Missed in the recording it is a difference all the same, and so is one on the way.
        assert_eq!(field(vec![near], vec![hit]), Some("way".to_owned()));
        one.pairs[0].toi_max = 0.5;
        assert_eq!(judge(&one).unwrap().field, "way");
    }

    #[test]
    fn bug_a_touch_on_the_way_of_what_collides_now_is_news_in_one_tick_or_another() {
        let known = row(3, Verdict::Colliding, -0.1, -0.1);
        let mut news = known;
        news.flags = pair_flags::SWEPT_HIT;
        for toi_max in [0.0, 1.0] {
            (news.toi_min, news.toi_max) = (0.0, toi_max);
            assert_eq!(field(vec![news], vec![known]), None);
            assert_eq!(field(vec![known], vec![news]), None);
        }
        let (mut early, mut late) = (news, news);
        (early.toi_min, early.toi_max) = (0.1, 0.2);
        (late.toi_min, late.toi_max) = (0.3, 0.4);
        assert_eq!(field(vec![early], vec![late]), Some("way".to_owned()));
    }

    #[test]
    fn where_rows_were_left_out_absence_says_nothing_but_the_state_must_not_be_clear() {
        let deep = row(3, Verdict::Colliding, -0.1, -0.1);
        let (mut one, mut two) = (out(vec![]), out(vec![deep]));
        one.pairs_header.truncated = 1;
        one.tick.header.state = State::Unknown.code();
        two.tick.header.state = State::Colliding.code();
        let judge = |one: &Outbox| judge(one, &two, Demand::ALL, &mut Judged::default());
        assert_eq!(judge(&one), None);
        one.tick.header.state = State::Clear.code();
        assert_eq!(judge(&one).unwrap().field, "state");
    }
}
