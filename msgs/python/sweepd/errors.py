"""The errors of a client; every message says what to change."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


class SweepdError(Exception):
    """Any failure of this package."""


class TimedOut(SweepdError):
    """Nothing came within the time allowed."""


class Refused(SweepdError):
    """The daemon, its version or its files do not fit this client, no place is left for it, or the daemon refused."""


class Restarted(SweepdError):
    """The daemon restarted: every pair has ended, and the ids of bodies are no longer valid.

    ``names`` are now those of the new daemon, and the next step or send goes on with it. Make ``rows()`` anew, look up
    the ids that you keep, and send all vertices of deforming bodies again.
    """

    def __init__(self, old_boot: int, new_boot: int, ends: np.ndarray) -> None:
        # as they were given, for copies and pickles are made of these
        super().__init__(old_boot, new_boot, ends)
        self.old_boot = old_boot
        self.new_boot = new_boot
        #: ``(body_a, body_b)`` of each pair that was certified colliding when it was last heard of.
        self.ends = ends

    def __str__(self) -> str:
        return f"the daemon restarted (boot {self.old_boot:x} is over, {self.new_boot:x} began)"


class Skipped(SweepdError):
    """A tick used a newer frame of this source; this one has no result of its own."""

    def __init__(self, seq: int) -> None:
        super().__init__(seq)
        self.seq = seq

    def __str__(self) -> str:
        return (
            f"frame {self.seq} was passed over: a tick used a newer frame of the source."
            ' For a result of each frame, send one when that of the last is there, or write on_frame = "SOURCE" into [run] of the scene'
        )
