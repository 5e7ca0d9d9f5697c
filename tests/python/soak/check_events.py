"""Events: each pair's begins and ends balance, ends have true causes, ranges hold what happened."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import BodyStatus, EndCause, Event, PairFlags, Verdict

from .check_pairs import goes_on, said
from .faults import Fault
from .moment import Moment
from .told import has, ids_of
from .world import Change

Ids = tuple[int, int]


class Balance:
    """Which pairs' collisions were told and have not ended."""

    def __init__(self) -> None:
        self.open: set[Ids] = set()
        #: First tick since then in which a pair whose collision is not told was truly colliding, ...
        self._collided: dict[Ids, int] = {}
        #: ... and in which one whose collision is told was truly apart.
        self._parted: dict[Ids, int] = {}

    def restart(self, rows: np.ndarray) -> None:
        """Begins with the rows of a tick, whatever was before it."""
        self.open = {ids_of(row) for row in rows if row["certified_verdict"] == Verdict.COLLIDING}
        self._collided.clear()
        self._parted.clear()

    def check(self, now: Moment, before: Moment) -> Iterator[Fault]:
        """Takes the rows of the tick that follows."""
        rows = now.list
        assert rows is not None
        self._forget(now, before)
        self._note_truth(now)
        cut = now.told.tick.header.truncated > 0
        done = now.boot.changes_between(before.told.tick.header.scene_rev, now.told.tick.header.scene_rev)
        for row in rows:
            ids = ids_of(row)
            what = self._take(now, before, row, ids, done)
            if what is not None:
                yield Fault("balance", now.tick, now.who_by_ids(ids), said(row), what)
        for ids in sorted(self.open):
            row = now.by_ids.get(ids)
            if row is None and not cut:
                yield Fault(
                    "balance", now.tick, now.who_by_ids(ids), "it is not listed", "a collision that was told has no end"
                )
                self.open.discard(ids)

    def _take(self, now: Moment, before: Moment, row: np.void, ids: Ids, done: Change) -> Optional[str]:
        """Takes a row's events in their order; what is wrong with them."""
        begin, persist, end, passed = (has(row["events"], event) for event in Event)
        was = ids in self.open
        wrong = self._misfit(now, row, (begin, persist, end, passed), was)
        gone = bool(int(row["flags"]) & PairFlags.GONE)
        if end and not passed:
            wrong = wrong or self._wrong_end(now, before, ids, row, done)
        wrong = wrong or self._wrong_range(now, row, ids, begin, end)
        # whatever was wrong, from here on what the row says is taken for granted
        if gone or int(row["certified_verdict"]) != Verdict.COLLIDING:
            is_open = begin and not end and not passed
        else:
            is_open = True
        follows = begin and not passed if begin or end else was
        if wrong is None and is_open != follows:
            wrong = "the last certified verdict is colliding as long as a collision is told"
        (self.open.add if is_open else self.open.discard)(ids)
        if begin or end:
            self._collided.pop(ids, None)
            self._parted.pop(ids, None)
        return wrong

    @staticmethod
    def _misfit(now: Moment, row: np.void, events: tuple[bool, bool, bool, bool], was: bool) -> Optional[str]:
        begin, persist, end, passed = events
        # an event that found no room, or was found when its tick was out, is told later
        may_wait = now.setup.pair_rows is not None or now.setup.budget_ns is not None
        waited = may_wait and int(row["begin_last_tick"]) < now.tick
        colliding = int(row["verdict"]) == Verdict.COLLIDING
        flags = int(row["flags"])
        # the end of an older collision that found no room is in that one end
        if passed and not (begin and end and (not was or may_wait)):
            return "a collision within the way has its begin and its end, and none before it"
        if passed and not waited and (colliding or not flags & PairFlags.SWEPT_HIT):
            return "who passed has touched on the way, and does not collide"
        if end and not passed and not was:
            return "an end without a begin"
        if begin and not passed and was and not end:
            return "a second begin without an end between"
        if persist and (begin or end or not was or not colliding):
            return "what persists was begun before, and collides"
        if colliding and not (begin or persist):
            return "who collides begins or persists"
        if begin and not passed and not waited and not colliding and not flags & PairFlags.SWEPT_HIT:
            return "a begin is certified, by the poses or by the way"
        if bool(int(row["end_cause"])) != end or (not end and int(row["end_last_tick"])):
            return "a cause and ticks with an end, and none without"
        if (not begin) and int(row["begin_last_tick"]):
            return "ticks with a begin, and none without"
        return None

    def _wrong_range(self, now: Moment, row: np.void, ids: Ids, begin: bool, end: bool) -> Optional[str]:
        cut = now.setup.pair_rows is not None
        for happened, word, since in ((begin, "begin", self._collided), (end, "end", self._parted)):
            first, last = int(row[f"{word}_first_tick"]), int(row[f"{word}_last_tick"])
            if not happened:
                continue
            # what is left of a budget of time is used after the tick, and told with the next one
            late = now.setup.budget_ns is not None and last == now.tick - 1
            if not 1 <= first <= last <= now.tick or (not cut and last != now.tick and not late):
                return f"a range of ticks up to this one for its {word}"
            by_cause = word == "end" and int(row["end_cause"]) != EndCause.SEPARATED
            # of a row that found no room it is not known what it certified
            if not cut and not by_cause and first > since.get(ids, first):
                return f"a {word} in tick {since[ids]} at the latest, by the formula"
        return None

    def _wrong_end(self, now: Moment, before: Moment, ids: Ids, row: np.void, done: Change) -> Optional[str]:
        """Whether the cause of an end is none that was there."""
        cause = EndCause(int(row["end_cause"]))
        if now.setup.pair_rows is not None or int(row["end_last_tick"]) < now.tick:
            # it may have waited for its place or its tick, and its cause be over
            return None
        names = {id_: name for name, id_ in now.boot.ids.items()}
        bodies = [names.get(id_, "") for id_ in ids]
        places = [now.place.get(id_) for id_ in ids]
        status = {BodyStatus(int(now.status[at])) for at in places if at is not None}
        sources = {body.source for name in bodies if (body := now.scene.bodies.get(name)) and body.source}
        told = {name: (row.session, row.epoch) for name, row in now.sources.items()}
        was = {name: (row.session, row.epoch) for name, row in before.sources.items()}
        reset = any(told[name] != was[name] or name in done.reset for name in sources)
        there = None not in places
        causes = {
            EndCause.SEPARATED: there and int(row["verdict"]) in (Verdict.NONE, Verdict.APART, Verdict.NEAR),
            EndCause.REMOVED: any(name in done.removed for name in bodies),
            EndCause.DISABLED: BodyStatus.DISABLED in status or any(name in done.disabled for name in bodies),
            EndCause.FILTERED: there and not now.allowed[places[0], places[1]],
            EndCause.RESET: reset,
            EndCause.SOURCE_LOST: BodyStatus.REMOVED_BY_AGE in status,
        }
        if causes.get(cause, False):
            return None
        held = [cause.name.lower() for cause, holds in causes.items() if holds]
        return f"no end by {cause.name.lower()}: there were {held}"

    def _forget(self, now: Moment, before: Moment) -> None:
        """Of bodies that begin anew, or by other filters, nothing is known of before."""
        if before.told.tick.header.scene_rev != now.told.tick.header.scene_rev:
            self._collided.clear()
            self._parted.clear()
        for since in (self._collided, self._parted):
            for ids in list(since):
                if any(id_ not in now.place for id_ in ids) or not goes_on(now, before, ids):
                    since.pop(ids)

    def _note_truth(self, now: Moment) -> None:
        """Takes down since when what is true has not been told."""
        both = now.placed[:, None] & now.placed[None] & now.allowed & np.tri(len(now.names), k=-1, dtype=bool)
        with np.errstate(invalid="ignore"):
            colliding = both & (now.gaps < -now.slack_m)
        for b, a in np.argwhere(colliding):
            ids = int(now.rows["body"][a]), int(now.rows["body"][b])
            if ids not in self.open:
                self._collided.setdefault(ids, now.tick)
        for ids in self.open:
            a_b = [now.place.get(id_) for id_ in ids]
            if None in a_b:
                continue
            gap = now.gaps[a_b[0], a_b[1]]
            row = now.by_ids.get(ids)
            if gap > now.slack_m[a_b[0], a_b[1]] and now.placed[a_b].all():
                self._parted.setdefault(ids, now.tick)
            elif row is not None and int(row["verdict"]) == Verdict.COLLIDING:
                self._parted.pop(ids, None)
        for ids in list(self._collided):
            row = now.by_ids.get(ids)
            a_b = [now.place.get(id_) for id_ in ids]
            certified = row is None or int(row["verdict"]) in (Verdict.NONE, Verdict.APART, Verdict.NEAR)
            if None in a_b or (certified and not (row is not None and has(row["events"], Event.BEGIN))):
                self._collided.pop(ids)
