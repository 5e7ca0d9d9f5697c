"""Rows of pairs: what each says of itself, and against the true gap at the tick's poses."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import BodyStatus, ContactKind, Event, Level, PairFlags, Verdict

from .faults import Fault
from .moment import Moment
from .told import has, ids_of

#: Ages are told in whole nanoseconds, and reaches rounded up, metres.
_REACH_SLACK = 1e-8
_ACTIVE = (Verdict.NEAR, Verdict.POSSIBLE, Verdict.COLLIDING)


def said(row: np.void) -> str:
    """A row in words."""
    flags = [flag.name for flag in PairFlags if int(row["flags"]) & flag]
    events = [event.name for event in Event if has(row["events"], event)]
    text = (
        f"{Verdict(int(row['verdict'])).name.lower()}, gap {float(row['gap_min_m'])!r} to {float(row['gap_max_m'])!r} m"
    )
    certified = Verdict(int(row["certified_verdict"])).name.lower()
    text += (
        f", level {Level(int(row['level'])).name.lower()}, certified {certified} in tick {int(row['certified_tick'])}"
    )
    text += f", flags {flags}, events {events}"
    if events:
        text += f", begin {int(row['begin_first_tick'])} to {int(row['begin_last_tick'])}"
        text += f", end {int(row['end_first_tick'])} to {int(row['end_last_tick'])} by cause {int(row['end_cause'])}"
    if int(row["flags"]) & (PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN):
        text += f", first touch {float(row['toi_min'])!r} to {float(row['toi_max'])!r}"
    return text


def check_rows(now: Moment) -> Iterator[Fault]:
    """Each row by itself, and their order."""
    rows = now.list
    if rows is None:
        return
    keys = [ids_of(row) for row in rows]
    if keys != sorted(set(keys)):
        yield Fault("rows", now.tick, "the list", f"pairs {keys}", "by ids, each pair once")
    limit = now.setup.pair_rows
    if limit is not None and len(rows) > limit:
        yield Fault("rows", now.tick, "the list", f"{len(rows)} rows", f"the limit is {limit}")
    for row, ids in zip(rows, keys):
        what = _of_itself(now, row, ids)
        if what is not None:
            yield Fault("row", now.tick, now.who_by_ids(ids), said(row), what)


def _of_itself(now: Moment, row: np.void, ids: tuple[int, int]) -> Optional[str]:
    """What does not fit in a row, whatever the truth is."""
    low, high, best = float(row["gap_min_m"]), float(row["gap_max_m"]), float(row["gap_best_m"])
    verdict, flags = Verdict(int(row["verdict"])), int(row["flags"])
    if ids[0] >= ids[1]:
        return "the smaller id stands first"
    if not low <= high or not (np.isnan(best) or low <= best <= high):
        return f"an interval with the best estimate ({best!r}) in it"
    if flags & PairFlags.GONE:
        gone = verdict == Verdict.NONE and int(row["events"]) != 0
        return None if gone else "a pair that is gone has its last event and no verdict"
    if any(id_ not in now.place for id_ in ids):
        return "a pair that is not gone has two bodies of the scene"
    touching = bool(flags & PairFlags.TOUCHING)
    finished = touching and low <= 0.0 <= high
    report_m = float(now.report_m[now.place[ids[0]], now.place[ids[1]]])
    fits = {
        Verdict.NONE: False,
        Verdict.APART: low > 0.0 and low >= report_m,
        Verdict.NEAR: 0.0 < low < report_m,
        Verdict.POSSIBLE: low <= 0.0 < high and not finished,
        Verdict.COLLIDING: high <= 0.0 or finished,
    }
    if not fits[verdict]:
        return f"the verdict that the interval calls for, within {report_m} m of a report"
    swept = flags & (PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN)
    if verdict == Verdict.APART and not int(row["events"]) and not swept:
        return "who is apart and has no news is not listed"
    certified = verdict in (Verdict.NEAR, Verdict.COLLIDING)
    if certified and (int(row["certified_verdict"]), int(row["certified_tick"])) != (verdict, now.tick):
        return f"certified in this tick, {now.tick}"
    if int(row["certified_tick"]) > now.tick or (int(row["certified_tick"]) == 0) != (
        int(row["certified_verdict"]) == 0
    ):
        return "a verdict that was certified before, or none in tick 0"
    exact = int(row["level"]) == Level.EXACT
    if exact == bool(flags & PairFlags.ESTIMATE):
        return "exact, or an estimate"
    toi = float(row["toi_min"]), float(row["toi_max"])
    if bool(swept) != (0.0 <= toi[0] <= toi[1] <= 1.0) or (not swept and not np.isnan(toi).all()):
        return "shares of the way with a touch on it, and without one none"
    return _of_bodies(now, ids, flags)


def _of_bodies(now: Moment, ids: tuple[int, int], flags: int) -> Optional[str]:
    a, b = (now.place[id_] for id_ in ids)
    status = {BodyStatus(int(now.status[at])) for at in (a, b)}
    held = BodyStatus.HELD in status
    unknown = bool(status - {BodyStatus.KNOWN, BodyStatus.HELD, BodyStatus.TRUNCATED})
    if held != bool(flags & PairFlags.HELD_BODY) or unknown != bool(flags & PairFlags.UNKNOWN_BODY):
        return f"flags of what is known of its bodies: {sorted(one.name.lower() for one in status)}"
    if not now.there[a] or not now.there[b]:
        return "a body whose place nobody knows is in no pair"
    if not now.allowed[a, b]:
        return "the filters do not let it be checked"
    return None


def check_truth(now: Moment) -> Iterator[Fault]:
    """Proved intervals hold the true gap, and who is not listed is truly apart."""
    rows = now.list
    if rows is None:
        return
    which, a, b = now.at_rows
    reach = now.reach_m[a] + now.reach_m[b]
    slack = now.slack_m[a, b] + _REACH_SLACK * (reach > 0.0)
    gap = now.gaps[a, b]
    low, high = rows["gap_min_m"][which], rows["gap_max_m"][which]
    with np.errstate(invalid="ignore"):
        # who goes away by its reach is farther by all of it; who comes nearer at least touches
        nearest = np.maximum(gap - reach, np.minimum(gap, 0.0))
        wrong = np.isfinite(reach) & ((low > nearest + slack) | (high < gap + reach - slack))
    for at in np.flatnonzero(wrong):
        truth = (
            f"the gap is {float(gap[at])!r} m, give or take {float(slack[at])!r}, and a reach of {float(reach[at])!r} m"
        )
        yield Fault("interval", now.tick, now.who(int(a[at]), int(b[at])), said(rows[which[at]]), truth)
    if now.told.tick.header.truncated == 0:
        yield from _check_unlisted(now)


def _check_unlisted(now: Moment) -> Iterator[Fault]:
    """Who has no row, or one that says apart, is farther than what is reported, wherever in its reach it is."""
    count = len(now.names)
    bounded = np.isfinite(now.reach_m) & now.there
    asked = now.allowed & ~now.listed & bounded[:, None] & bounded[None] & np.tri(count, k=-1, dtype=bool)
    reach = now.reach_m[:, None] + now.reach_m[None]
    slack = now.slack_m + _REACH_SLACK * (reach > 0.0)
    with np.errstate(invalid="ignore"):
        gap = now.gaps - reach
        # touching collides: of gaps that are exact 0 is too little
        missed = asked & (np.where(slack == 0.0, gap <= 0.0, gap < -slack) | (gap < now.report_m - slack))
    for b, a in np.argwhere(missed):
        row = now.by_ids.get((int(now.rows["body"][a]), int(now.rows["body"][b])))
        told = "it is not listed: plainly apart" if row is None else said(row)
        truth = f"the gap is {float(now.gaps[a, b])!r} m, reach {float(now.reach_m[a] + now.reach_m[b])} m,"
        truth += f" to be reported within {float(now.report_m[a, b])} m"
        yield Fault("missed", now.tick, now.who(int(a), int(b)), told, truth)


def check_decided(now: Moment) -> Iterator[Fault]:
    """Where nothing limits the work, every pair of bodies that are placed is decided, and has what is asked for."""
    rows = now.list
    if rows is None or not now.is_unlimited:
        return
    which, a, b = now.at_rows
    for at in np.flatnonzero(now.placed[a] & now.placed[b] & (rows["verdict"][which] == Verdict.POSSIBLE)):
        yield Fault(
            "undecided", now.tick, now.who(int(a[at]), int(b[at])), said(rows[which[at]]), "no limit of work was set"
        )
    contacts = now.told.contacts
    if contacts is None or now.told.tick.header.truncated:
        return
    there = {(ids_of(row), int(row["kind"])) for row in contacts}
    kinds = {Verdict.COLLIDING: ContactKind.CONTACT, Verdict.NEAR: ContactKind.CLOSEST}
    for at, verdict in zip(which, rows["verdict"][which]):
        kind = kinds.get(verdict)
        if kind is not None and (ids_of(rows[at]), kind) not in there:
            truth = f"a row of kind {kind.name.lower()}: no limit of work was set"
            yield Fault("undecided", now.tick, now.who_by_ids(ids_of(rows[at])), "no contact", truth)


def check_unbounded(now: Moment, before: Moment) -> Iterator[Fault]:
    """Pairs of a body that may be anywhere are possible, as long as it is so, if they were listed before."""
    if now.list is None or now.told.tick.header.truncated:
        return
    lost = now.there & np.isinf(now.reach_m)
    which, a, b = now.at_rows
    either = lost[a] | lost[b]
    for at in np.flatnonzero(either & (now.list["verdict"][which] != Verdict.POSSIBLE)):
        row = now.list[which[at]]
        if int(row["events"]) == 0:
            yield Fault(
                "unbounded", now.tick, now.who(int(a[at]), int(b[at])), said(row), "a body of it may be anywhere"
            )
    for ids, row in before.by_ids.items():
        if int(row["verdict"]) not in _ACTIVE or ids in now.by_ids:
            continue
        a_b = [now.place.get(id_) for id_ in ids]
        if None in a_b or not goes_on(now, before, ids):
            continue
        i, j = a_b
        if (lost[i] or lost[j]) and now.there[i] and now.there[j] and now.allowed[i, j]:
            yield Fault(
                "unbounded", now.tick, now.who(i, j), "it is not listed any more", f"in the tick before: {said(row)}"
            )


def goes_on(now: Moment, before: Moment, ids: tuple[int, int]) -> bool:
    """Whether both bodies are those of the tick before, and were not forgotten since."""
    for id_ in ids:
        at, was = now.place[id_], before.place.get(id_)
        if was is None or not before.there[was] or now.rows["generation"][at] != before.rows["generation"][was]:
            return False
        body = now.body(at)
        if body is None:
            return False
        if body.source is not None:
            new, old = now.sources[body.source], before.sources[body.source]
            if (new.session, new.epoch) != (old.session, old.epoch):
                return False
            change = now.boot.changes_between(before.told.tick.header.scene_rev, now.told.tick.header.scene_rev)
            if body.source in change.reset or body.name in change.disabled | change.removed:
                return False
    return True
