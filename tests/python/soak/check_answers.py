"""Answers to questions, at the poses of the tick that they name."""

from __future__ import annotations

from typing import Any, Iterator, Mapping

import numpy as np
from sweepd.layout import Verdict

from .faults import Fault
from .moment import Moment


def check_gap(now: Moment, names: tuple[str, str], answer: Mapping[str, Any]) -> Iterator[Fault]:
    """The proved gap of two bodies, whatever the filters say."""
    a, b = (now.names.index(name) for name in names)
    if not (now.placed[a] and now.placed[b]) or np.isinf(now.gaps[a, b]):
        return
    gap, slack = float(now.gaps[a, b]), float(now.slack_m[a, b])
    low, high, verdict = answer["gap_min_m"], answer["gap_max_m"], answer["verdict"]
    told = f"gap {low} to {high} m, verdict {verdict}"
    if low is None or high is None or not low <= gap + slack or not high >= gap - slack:
        yield Fault("answer_gap", now.tick, now.who(a, b), told, f"the gap is {gap!r} m, give or take {slack!r}")
    if verdict == Verdict.POSSIBLE:
        yield Fault("answer_gap", now.tick, now.who(a, b), told, "a second is enough for two such bodies")


def check_touching(now: Moment, name: str, within_m: float, answer: Mapping[str, Any]) -> Iterator[Fault]:
    """What a body touches where it is: all that is no farther has a row, or is told as unknown."""
    a = now.names.index(name)
    if not now.placed[a]:
        return
    rows = {row["b"]: row for row in answer["rows"]}
    unknown = {row["body"] for row in answer["unknown"]}
    for b in np.flatnonzero(now.allowed[a]):
        other, gap, slack = now.names[b], float(now.gaps[a, b]), float(now.slack_m[a, b])
        row = rows.get(other)
        if not now.placed[b]:
            continue
        if row is None and answer["complete"] and other not in unknown and gap < within_m - slack:
            told = f"no row, and complete within {within_m} m"
            yield Fault("answer_touching", now.tick, now.who(a, int(b)), told, f"the gap is {gap!r} m")
        if row is not None and not row["gap_min_m"] - slack <= gap <= row["gap_max_m"] + slack:
            told = f"gap {row['gap_min_m']!r} to {row['gap_max_m']!r} m"
            yield Fault("answer_touching", now.tick, now.who(a, int(b)), told, f"the gap is {gap!r} m")
