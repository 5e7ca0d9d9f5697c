"""The list kept from ``changes`` as msgs/README.md says, apart from the client's own, and held against ``pairs``."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import PairFlags, Verdict

from .faults import Fault
from .told import Told, ids_of

_WAY = int(PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN)


class Listing:
    """What a reader of ``changes`` holds."""

    def __init__(self) -> None:
        #: Of the list: boot and tick; None while it is not whole.
        self.of: Optional[tuple[int, int]] = None
        self._rows: dict[tuple[int, int], tuple[np.void, int]] = {}

    def take(self, told: Told, followed: bool) -> Iterator[Fault]:
        """Applies a tick's message.

        * ``followed``: whether the tick before was taken too.
        """
        header, rows = told.changes_header, told.changes
        if header is None or rows is None:
            self.of = None
            return
        fits = self.of == (told.boot, header.base_tick)
        if header.base_tick == 0:
            self._rows = {}
        elif not fits:
            if followed and self.of is not None:
                text = f"base_tick {header.base_tick}"
                yield Fault(
                    "base", told.number, "changes", text, f"the list is that of tick {self.of[1]}, or 0 for all of it"
                )
            self.of = None
            return
        for row in rows:
            quiet = int(row["events"]) == 0 and int(row["flags"]) & _WAY == 0
            if quiet and int(row["verdict"]) in (Verdict.NONE, Verdict.APART):
                self._rows.pop(ids_of(row), None)
            else:
                self._rows[ids_of(row)] = (row.copy(), told.number)
        self.of = (told.boot, told.number)
        if len(self._rows) != header.listed:
            yield Fault(
                "listed", told.number, "changes", f"listed {header.listed}", f"{len(self._rows)} rows, once applied"
            )

    def rows(self, number: int, kind: np.dtype) -> np.ndarray:
        """The rows by ids, as they read in a tick."""
        aged = []
        for ids in sorted(self._rows):
            row, sent = self._rows[ids]
            row = row.copy()
            row["bound_age_ticks"] += number - sent
            if int(row["verdict"]) in (Verdict.NEAR, Verdict.COLLIDING):
                row["certified_tick"] += number - sent
            aged.append(row)
        return np.array(aged, kind) if aged else np.empty(0, kind)


def compare(told: Told, listing: np.ndarray) -> Iterator[Fault]:
    """The list and ``pairs`` of one tick, bit by bit."""
    pairs = told.pairs
    assert pairs is not None
    if pairs.tobytes() == listing.tobytes():
        return
    said, kept = ({ids_of(row): row for row in rows} for rows in (pairs, listing))
    for ids in sorted({*said, *kept}):
        if ids not in said or ids not in kept:
            where = "pairs alone" if ids in said else "the list alone"
            yield Fault("changes", told.number, f"pair {ids}", f"in {where}", "both hold the same pairs")
            continue
        unlike = [name for name in pairs.dtype.names or () if said[ids][name].tobytes() != kept[ids][name].tobytes()]
        if unlike:
            text = ", ".join(f"{name} {kept[ids][name]}" for name in unlike)
            truth = ", ".join(f"{name} {said[ids][name]}" for name in unlike)
            yield Fault("changes", told.number, f"pair {ids}", f"the list: {text}", f"pairs: {truth}")
