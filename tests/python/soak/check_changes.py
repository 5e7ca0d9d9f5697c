"""The lists kept from ``changes`` and ``contact_changes`` as msgs/README.md says, apart from the client's own.

They are held against ``pairs`` and ``contacts``.
"""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import ContactKind, PairFlags, Verdict

from .faults import Fault
from .told import Told, ids_of

_WAY = int(PairFlags.SWEPT_HIT | PairFlags.SWEPT_OPEN)


class _List:
    """What a reader of a message of what is new holds."""

    #: The message.
    topic = ""

    def __init__(self) -> None:
        #: Of the list: boot and tick; None while it is not whole.
        self.of: Optional[tuple[int, int]] = None

    def take(self, told: Told, followed: bool) -> Iterator[Fault]:
        """Applies a tick's message.

        * ``followed``: whether the tick before was taken too.
        """
        header, rows = getattr(told, f"{self.topic}_header"), getattr(told, self.topic)
        if header is None or rows is None:
            self.of = None
            return
        fits = self.of == (told.boot, header.base_tick)
        if header.base_tick == 0:
            self._clear()
        elif not fits:
            if followed and self.of is not None:
                text = f"base_tick {header.base_tick}"
                yield Fault(
                    "base", told.number, self.topic, text, f"the list is that of tick {self.of[1]}, or 0 for all of it"
                )
            self.of = None
            return
        for row in rows:
            self._apply(row, told.number)
        self.of = (told.boot, told.number)
        if self._count() != header.listed:
            yield Fault(
                "listed", told.number, self.topic, f"listed {header.listed}", f"{self._count()} rows, once applied"
            )

    def _clear(self) -> None:
        raise NotImplementedError

    def _apply(self, row: np.void, number: int) -> None:
        raise NotImplementedError

    def _count(self) -> int:
        raise NotImplementedError


class Listing(_List):
    """What a reader of ``changes`` holds."""

    topic = "changes"

    def __init__(self) -> None:
        super().__init__()
        self._rows: dict[tuple[int, int], tuple[np.void, int]] = {}

    def _clear(self) -> None:
        self._rows = {}

    def _apply(self, row: np.void, number: int) -> None:
        quiet = int(row["events"]) == 0 and int(row["flags"]) & _WAY == 0
        if quiet and int(row["verdict"]) in (Verdict.NONE, Verdict.APART):
            self._rows.pop(ids_of(row), None)
        else:
            self._rows[ids_of(row)] = (row.copy(), number)

    def _count(self) -> int:
        return len(self._rows)

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


class Contacts(_List):
    """What a reader of ``contact_changes`` holds."""

    topic = "contact_changes"

    def __init__(self) -> None:
        super().__init__()
        #: Of each pair the tick that told of it last, and its contacts.
        self._rows: dict[tuple[int, int], tuple[int, list[np.void]]] = {}

    def _clear(self) -> None:
        self._rows = {}

    def _apply(self, row: np.void, number: int) -> None:
        ids = ids_of(row)
        if int(row["kind"]) == ContactKind.GONE:
            self._rows.pop(ids, None)
            return
        if self._rows.get(ids, (0, []))[0] != number:
            self._rows[ids] = (number, [])
        self._rows[ids][1].append(row.copy())

    def _count(self) -> int:
        return sum(len(rows) for _, rows in self._rows.values())

    def rows(self, kind: np.dtype) -> np.ndarray:
        """The rows in the order of ``contacts``."""
        rows = [row for ids in sorted(self._rows) for row in self._rows[ids][1]]
        return np.array(rows, kind) if rows else np.empty(0, kind)


def compare_contacts(told: Told, listing: np.ndarray) -> Iterator[Fault]:
    """The list and ``contacts`` of one tick, bit by bit."""
    assert told.contacts is not None
    said, kept = (_by_pair(rows) for rows in (told.contacts, listing))
    for ids in sorted({*said, *kept}):
        if said.get(ids) != kept.get(ids):
            text = f"the list: {len(kept.get(ids, []))} contacts, contacts: {len(said.get(ids, []))}"
            yield Fault("contact_changes", told.number, f"pair {ids}", text, "both hold the same contacts")


def _by_pair(rows: np.ndarray) -> dict[tuple[int, int], list[bytes]]:
    pairs: dict[tuple[int, int], list[bytes]] = {}
    for row in rows:
        pairs.setdefault(ids_of(row), []).append(row.tobytes())
    return pairs


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
