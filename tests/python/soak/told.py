"""A tick as a reader has it, apart from the client and its shared memory: so it can be kept, and be spoilt in tests."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
from sweepd import layout


@dataclass
class Told:
    """What came with one tick; None where it was not listened to or has not come."""

    tick: layout.TickRow
    names: dict[str, int]
    pairs: Optional[np.ndarray] = None
    changes_header: Optional[layout.ChangesHeader] = None
    changes: Optional[np.ndarray] = None
    contacts: Optional[np.ndarray] = None
    contact_changes_header: Optional[layout.ChangesHeader] = None
    contact_changes: Optional[np.ndarray] = None
    regions: Optional[np.ndarray] = None
    bodies: Optional[np.ndarray] = None
    verdicts: Optional[np.ndarray] = None
    #: What a person who looks into a fault wants to know beside it.
    notes: dict[str, Any] = field(default_factory=dict)

    @property
    def boot(self) -> int:
        """Boot id."""
        return self.tick.header.boot_id

    @property
    def number(self) -> int:
        """Number of the tick."""
        return self.tick.header.tick

    @property
    def is_bare(self) -> bool:
        """Whether it is the tick that goes out alone while the tick itself takes long. Every scene here has sources."""
        return self.tick.sources_len == 0

    def copy(self) -> Told:
        """One with memory of its own."""
        return copy.deepcopy(self)


def told_of(result: Any, names: dict[str, int]) -> Told:
    """From what the client has for a tick."""
    return Told(
        result.tick,
        names,
        result.pairs,
        result.changes_header if result.changes is not None else None,
        result.changes,
        result.contacts,
        result.contact_changes_header if result.contact_changes is not None else None,
        result.contact_changes,
        result.regions,
        result.bodies,
        result.body_verdicts,
    )


def source_rows(tick: layout.TickRow) -> dict[str, layout.SourceRow]:
    """Rows of the sources by name."""
    rows = tick.sources[: tick.sources_len]
    return {bytes(row.name).split(b"\0")[0].decode(): row for row in rows}


def has(bits: int, code: int) -> bool:
    """Whether the bit of a number is set."""
    return int(bits) >> int(code) & 1 == 1


def ids_of(row: np.void) -> tuple[int, int]:
    """The pair of a row."""
    return int(row["body_a"]), int(row["body_b"])
