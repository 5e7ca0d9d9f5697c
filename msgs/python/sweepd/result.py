"""What a tick reported: its row, and the arrays that belong to it."""

from __future__ import annotations

import time
from typing import Any, Optional

import numpy as np

from . import layout
from .errors import SweepdError
from .turns import Turns, in_turn


class Result:
    """A tick and what belongs to it.

    * ``tick`` is a structure (see ``msgs/README.md``).
    * ``pairs``, ``contacts``, ``regions`` and ``bodies`` are numpy structured arrays over shared memory, None if the
      client did not listen or a newer one overtook it. Keep as many results as you like: while three arrays of a kind
      are still there, the next one is a copy.
    * ``changes`` are the rows that changed since the tick before, or the whole list if ``base_tick`` of their
      ``changes_header`` is 0, in an array of its own. They are also None while the list is not whole (yet, or again).
    * ``contact_changes`` and ``contact_changes_header`` are the same for contacts.

    Copies (``copy.deepcopy``) and pickles are whole.
    """

    def __init__(self, tick: layout.TickRow, messages: dict[str, Any], lists: dict[str, Any], turns: Turns) -> None:
        self.tick = tick
        self._lists, self._turns = lists, turns
        self.changes_header: Optional[layout.ChangesHeader]
        self.changes: Optional[np.ndarray]
        self.changes_header, self.changes = messages.pop("changes", (None, None))
        self.contact_changes_header: Optional[layout.ChangesHeader]
        self.contact_changes: Optional[np.ndarray]
        self.contact_changes_header, self.contact_changes = messages.pop("contact_changes", (None, None))
        self.pairs: Optional[np.ndarray] = messages.get("pairs")
        self.contacts: Optional[np.ndarray] = messages.get("contacts")
        self.regions: Optional[np.ndarray] = messages.get("regions")
        self.bodies: Optional[np.ndarray] = messages.get("bodies")
        self.body_verdicts: Optional[np.ndarray] = messages.get("body_verdicts")

    @property
    def state(self) -> str:
        """The tick in one word: clear, near, possible, unknown or colliding."""
        return layout.State(self.tick.header.state).name.lower()

    @property
    def age_s(self) -> float:
        """How long ago the tick was sent, seconds: more than a few heartbeats if the daemon is gone or stuck."""
        return (time.clock_gettime_ns(time.CLOCK_BOOTTIME) - self.tick.sent_ns) * 1e-9

    @property
    @in_turn
    def listed(self) -> Optional[np.ndarray]:
        """What ``pairs`` would hold, maintained from ``changes``: an array of its own; None if ``changes`` is None.

        It is built when you ask for it, which you must do before the client goes on to the next tick.
        """
        return None if self.changes is None else self._rows("changes", "listed")

    @property
    @in_turn
    def listed_contacts(self) -> Optional[np.ndarray]:
        """What ``contacts`` would hold, maintained from ``contact_changes``; otherwise as ``listed``."""
        return None if self.contact_changes is None else self._rows("contact_changes", "listed_contacts")

    def _rows(self, topic, name):
        if not self._lists[topic].is_of(self.tick.header):
            raise SweepdError(f"the client has gone on to another tick: ask a result for `{name}` before the next step")
        return self._lists[topic].rows()

    @property
    def colliding(self) -> np.ndarray:
        """``(n, 2)`` ids of the pairs certified colliding at the poses of this tick, sorted by id."""
        rows = self.listed if self.pairs is None else self.pairs
        if rows is None:
            raise SweepdError("this client does not listen to pairs or changes, or has not all of them yet")
        gone = rows["flags"] & int(layout.PairFlags.GONE) != 0
        rows = rows[(rows["verdict"] == layout.Verdict.COLLIDING) & ~gone]
        return np.stack([rows["body_a"], rows["body_b"]], axis=1)
