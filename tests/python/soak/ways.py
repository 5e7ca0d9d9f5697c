"""Touches on the way: the least gap of bodies that go straight from pose to pose.

The way of a continuous body is a leg a pose. The frames with poses of its source divide the tick into equal shares; a
leg takes that of its frame, and in the others the body stands. Any other body stands at its last pose. Along a stretch
on which both go straight the gap is a convex function of the share (that of a convex set to a point on a line), so a
search by thirds finds the least, and up to any share the least is there or at the share itself.
"""

from __future__ import annotations

from typing import Optional

import numpy as np

from .shapes import Forms, gap_of

#: The golden section: the bracket is 1e-13 of the stretch after so many steps.
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_STEPS = 62


class Way:
    """Of one body in one tick.

    * ``centres``: of its parts at the last tick's pose and each one since, ``(legs + 1, parts, 3)``; of a body that is
      not swept its last ones alone.
    * ``jumps``: by leg, whether it is beyond the body's ``teleport_m``.
    * ``frames``: by leg, the number of its frame in the tick, from 1; and how many frames its source sent.
    * ``source``: whose frames they are.
    """

    def __init__(
        self,
        centres: np.ndarray,
        jumps: Optional[list[bool]] = None,
        frames: Optional[tuple[list[int], int]] = None,
        source: Optional[str] = None,
    ) -> None:
        self.centres = centres
        self.legs = len(centres) - 1
        self.jumps = jumps if jumps is not None else [False] * self.legs
        self.frames, self.count = frames if frames is not None else (list(range(1, self.legs + 1)), self.legs)
        self.source = source

    def at(self, share: float) -> np.ndarray:
        """Centres at a share of the tick."""
        for leg, frame in enumerate(self.frames):
            if share * self.count < frame:
                part = max(share * self.count - (frame - 1), 0.0)
                return self.centres[leg] + (self.centres[leg + 1] - self.centres[leg]) * part
        return self.centres[-1]

    def jumps_at(self, share: float) -> bool:
        """Whether what lies about a share is a jump."""
        return any(
            jump and frame - 1 <= share * self.count < frame for jump, frame in zip(self.jumps, self.frames)
        )

    def shares(self) -> set[float]:
        """Where legs begin and end."""
        return {end / self.count for frame in self.frames for end in (frame - 1, frame)}

    def is_in_step_with(self, other: Way) -> bool:
        """Whether it is known where the one was while the other went."""
        if not (self.legs and other.legs):
            return True
        if self.source != other.source:
            return self.count <= 1 and other.count <= 1
        goes = [way._goes() for way in (self, other)]
        moved, alone = set(), False
        for frame in sorted(set(goes[0]) | set(goes[1])):
            moved |= {at for at, of in enumerate(goes) if of.get(frame, False)}
            alone |= frame not in goes[0] or frame not in goes[1]
            if frame in goes[0] and frame in goes[1]:
                if alone and len(moved) == 2:
                    return False
                moved, alone = set(), False
        return not (alone and len(moved) == 2)

    def _goes(self) -> dict[int, bool]:
        """By frame, whether it moves the body."""
        ends = zip(self.frames, self.centres, self.centres[1:])
        return {frame: not np.array_equal(begin, end) for frame, begin, end in ends}


class Crossings:
    """Pairs on their ways, solved all at once."""

    def __init__(self, forms: Forms) -> None:
        self._forms = forms
        self._planes = {at: (normal, offset_m) for at, normal, offset_m in forms.planes}
        self.pairs: list[tuple[int, int]] = []
        self._rows: list[tuple[int, float, float, np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]] = []

    def add(self, a: int, b: int, way_a: Way, way_b: Way) -> None:
        """Adds a pair of bodies; of a stretch on which one jumps the ends alone, as the daemon does not ask between."""
        pair = len(self.pairs)
        self.pairs.append((a, b))
        ends = sorted({0.0, 1.0} | way_a.shares() | way_b.shares())
        for begin, end in zip(ends, ends[1:]):
            middle = 0.5 * (begin + end)
            jumps = way_a.jumps_at(middle) or way_b.jumps_at(middle)
            for stretch in [(begin, begin), (end, end)] if jumps else [(begin, end)]:
                self._add_stretch(pair, *stretch, [(way_a.at(s), way_b.at(s)) for s in stretch])

    def _add_stretch(self, pair: int, begin: float, end: float, places: list[tuple[np.ndarray, np.ndarray]]) -> None:
        a, b = self.pairs[pair]
        forms = self._forms
        if a in self._planes or b in self._planes:
            plane, other, at = (a, b, 1) if a in self._planes else (b, a, 0)
            parts = forms.parts_of(other)
            normal, offset_m = self._planes[plane]
            down = forms.half[parts] @ np.abs(normal) + forms.radius[parts]
            first, last = (place[at] @ normal - offset_m - down for place in places)
            # of a plane the gap itself goes straight: it is kept as the first coordinate
            from_to = [np.stack([gaps, 0 * gaps, 0 * gaps], axis=1) for gaps in (first, last)]
            zero = np.zeros(len(first))
            self._rows.append((pair, begin, end, *from_to, np.zeros((len(first), 3)), zero, True))
            return
        of_a, of_b = forms.parts_of(a), forms.parts_of(b)
        half = (forms.half[of_a][:, None] + forms.half[of_b][None]).reshape(-1, 3)
        radius = (forms.radius[of_a][:, None] + forms.radius[of_b][None]).reshape(-1)
        first, last = ((place[1][None] - place[0][:, None]).reshape(-1, 3) for place in places)
        self._rows.append((pair, begin, end, first, last, half, radius, False))

    def solve(self) -> None:
        """Finds where each stretch is least."""
        rows = self._rows
        lengths = [len(row[3]) for row in rows]
        spread = lambda at: np.repeat([row[at] for row in rows], lengths)  # noqa: E731
        self._pair, self._begin, self._end = spread(0).astype(np.intp), spread(1), spread(2)
        self._plane = spread(7).astype(bool)
        nothing = [np.empty((0, 3))]
        self._first, self._last, self._half = (np.concatenate([row[at] for row in rows] or nothing) for at in (3, 4, 5))
        self._radius = np.concatenate([row[6] for row in rows] or [np.empty(0)])
        low, high = np.zeros(len(self._pair)), np.ones(len(self._pair))
        for _ in range(_STEPS):
            span = (high - low) * _GOLDEN
            left, right = high - span, low + span
            down = self._gaps(left) > self._gaps(right)
            low, high = np.where(down, left, low), np.where(down, high, right)
        # the ends too: a straight line is least at one of them, and the search only comes near
        ends = np.stack([low, np.zeros_like(low), np.ones_like(low)])
        best = np.stack([self._gaps(end) for end in ends]).argmin(axis=0)
        self._least_at = np.take_along_axis(ends, best[None], axis=0)[0]

    def _gaps(self, at: np.ndarray) -> np.ndarray:
        apart = self._first + (self._last - self._first) * at[:, None]
        return np.where(self._plane, apart[:, 0], gap_of(apart, self._half, self._radius))

    def least(self, until: Optional[np.ndarray] = None, asked: bool = False) -> np.ndarray:
        """The least gap of each pair on its way up to a share of it.

        * ``asked``: only of what the daemon must ask: not of the poses at the ends of a jump. Infinite where that is
          nothing.
        """
        share = np.ones(len(self.pairs)) if until is None else until
        least = np.full(len(self.pairs), np.inf)
        length = self._end - self._begin
        part = (share[self._pair] - self._begin) / np.where(length > 0.0, length, 1.0)
        gaps = self._gaps(np.minimum(np.clip(part, 0.0, 1.0), self._least_at))
        np.minimum.at(least, self._pair, np.where((part < 0.0) | (asked & (length == 0.0)), np.inf, gaps))
        return least
