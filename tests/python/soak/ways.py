"""Touches on the way: the least gap of bodies that go straight from pose to pose.

The way of a continuous body is a leg a pose, legs take equal shares of the tick; any other body stands at its last
pose. Along a stretch on which both go straight the gap is a convex function of the share (that of a convex set to a
point on a line), so a search by thirds finds the least, and up to any share the least is there or at the share itself.
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
    """

    def __init__(self, centres: np.ndarray, jumps: Optional[list[bool]] = None) -> None:
        self.centres = centres
        self.legs = len(centres) - 1
        self.jumps = jumps if jumps is not None else [False] * self.legs

    def at(self, share: float) -> np.ndarray:
        """Centres at a share of the tick."""
        if self.legs == 0:
            return self.centres[0]
        leg = min(int(share * self.legs), self.legs - 1)
        part = share * self.legs - leg
        return self.centres[leg] + (self.centres[leg + 1] - self.centres[leg]) * part

    def jumps_at(self, share: float) -> bool:
        """Whether what lies about a share is a jump."""
        return self.legs > 0 and self.jumps[min(int(share * self.legs), self.legs - 1)]

    def shares(self) -> set[float]:
        """Where legs begin and end."""
        return {leg / self.legs for leg in range(1, self.legs)}


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
