//! The law on rows made by hand, for which the right judgement is known.

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
    let before = Before::default();
    judge(&one, &two, demand, &before, &mut Judged::default()).map(|spot| spot.field)
}

#[test]
fn what_is_open_or_borne_out_holds() {
    let deep = row(2, Verdict::Colliding, -0.1, -0.1);
    let open = row(2, Verdict::Possible, -1.0, 0.5);
    assert_eq!(field(vec![open], vec![deep]), None);
    assert_eq!(field(vec![deep], vec![deep]), None);
    // Undecided in the recording, and apart.
    assert_eq!(field(vec![open], vec![]), None);
    // Within rounding of a touch either verdict is right.
    let mut touch = row(2, Verdict::Colliding, -1e-16, 1e-16);
    touch.flags = pair_flags::TOUCHING;
    let near = row(2, Verdict::Near, 1e-17, 2e-16);
    for one in [vec![near], vec![]] {
        let (mut one, mut two) = (out(one), out(vec![touch]));
        one.tick.header.state = State::Clear.code();
        two.tick.header.state = State::Colliding.code();
        let judge = |recorded: &Outbox, replayed: &Outbox| {
            let (before, judged) = (Before::default(), &mut Judged::default());
            judge(recorded, replayed, Demand::ALL, &before, judged)
        };
        for (recorded, replayed) in [(&one, &two), (&two, &one)] {
            assert_eq!(judge(recorded, replayed), None);
        }
        // A touch on the way is a difference.
        two.pairs[0].flags |= pair_flags::SWEPT_HIT;
        assert!(judge(&one, &two).is_some());
    }
    // The last row of a pair that is gone says nothing of the present.
    let mut gone = deep;
    gone.flags = pair_flags::GONE;
    assert_eq!(field(vec![gone], vec![]), None);
}

#[test]
fn what_is_not_borne_out_is_found() {
    let deep = row(3, Verdict::Colliding, -0.1, -0.1);
    let near = row(3, Verdict::Near, 0.1, 0.2);
    let verdict = Some("verdict".to_owned());
    // A collision that was not reported, and a reported one that there is not.
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
    let judge = |one: &Outbox| {
        let (before, judged) = (Before::default(), &mut Judged::default());
        judge(one, &two, Demand::ALL, &before, judged)
    };
    assert_eq!(judge(&one), None);
    // If the recording misses it, that is still a difference, and so is an invented touch in the middle of the way.
    assert_eq!(field(vec![near], vec![hit]), Some("way".to_owned()));
    one.pairs[0].toi_max = 0.5;
    assert_eq!(judge(&one).unwrap().field, "way");
}

/// A tick earlier the replay certified a collision that the recording left undecided. After a teleport the recording
/// then found its first touch, which the replay does not report, since it is not the first there.
#[test]
fn bug_a_touch_behind_a_jump_is_no_news_where_the_replay_certified_one_a_tick_earlier() {
    let mut hit = row(3, Verdict::Near, 0.1, 0.2);
    hit.flags = pair_flags::SWEPT_HIT | pair_flags::TELEPORTED;
    (hit.toi_min, hit.toi_max) = (0.5, 0.5);
    let mut known = Before::default();
    known.take(&out(vec![row(3, Verdict::Colliding, -0.1, -0.1)]));
    let mut one = out(vec![hit]);
    one.tick.header.state = State::Colliding.code();
    for replayed in [vec![row(3, Verdict::Near, 0.1, 0.2)], vec![]] {
        let mut two = out(replayed);
        two.tick.header.state = State::Clear.code();
        let judge =
            |before: &Before| judge(&one, &two, Demand::ALL, before, &mut Judged::default());
        assert_eq!(judge(&known), None);
        assert!(judge(&Before::default()).is_some());
    }
    // The next tick forgets the pair; if rows were left out, any pair may have been among them.
    let mut next = out(vec![]);
    known.take(&next);
    assert!(!known.covers(&hit));
    next.pairs_header.truncated = 1;
    known.take(&next);
    assert!(known.covers(&hit));
    // A teleport does not rule out an earlier touch.
    let mut early = hit;
    (early.toi_min, early.toi_max) = (0.0, 0.0);
    assert_eq!(field(vec![hit], vec![early]), None);
    hit.flags = pair_flags::SWEPT_HIT;
    early.flags = pair_flags::SWEPT_HIT;
    assert_eq!(field(vec![hit], vec![early]), Some("way".to_owned()));
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
    let judge = |one: &Outbox| {
        let (before, judged) = (Before::default(), &mut Judged::default());
        judge(one, &two, Demand::ALL, &before, judged)
    };
    assert_eq!(judge(&one), None);
    one.tick.header.state = State::Clear.code();
    assert_eq!(judge(&one).unwrap().field, "state");
}
