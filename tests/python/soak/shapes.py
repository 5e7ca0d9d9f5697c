"""Gaps of spheres, axis-aligned boxes and half-spaces from their definitions.

A part is a box rounded by a radius, so that a sphere is one of no extents and a box one of no radius, and one formula
holds for all of them: two parts overlap where the centre of the one lies in their sum, a box rounded by both radii.
Metres; positive apart, negative the least translation that separates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Optional, Sequence, Tuple

import numpy as np

Vector = Tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Part:
    """A sphere or an axis-aligned box, at its place in the body. A box is never turned, and no body that has one."""

    half_m: Vector = ORIGIN
    radius_m: float = 0.0
    offset_m: Vector = ORIGIN

    def keys(self) -> dict[str, Any]:
        """As the scene says it."""
        place = {} if self.offset_m == ORIGIN else {"position": list(self.offset_m)}
        if self.radius_m > 0.0:
            return {"type": "sphere", "radius": self.radius_m, **place}
        return {"type": "box", "half_extents": list(self.half_m), **place}

    @property
    def is_box(self) -> bool:
        """Whether it is a box."""
        return self.radius_m == 0.0


@dataclass(frozen=True)
class Plane:
    """A half-space: all points with ``normal . x <= offset_m``; the normal is of unit length."""

    normal: Vector
    offset_m: float

    def keys(self) -> dict[str, Any]:
        """As the scene says it."""
        return {"type": "half_space", "normal": list(self.normal), "offset": self.offset_m}


def gap_of(apart: np.ndarray, half: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Gap of two parts.

    * ``apart``: from the one centre to the other, ``(.., 3)``. ``half``, ``radius``: both ones' extents together.
    """
    over = np.abs(apart) - half
    outside = np.sqrt(np.square(np.maximum(over, 0.0)).sum(axis=-1))
    return outside + np.minimum(over.max(axis=-1), 0.0) - radius


def turned(orientation: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Offsets in the body turned into the scene's frame; quaternions x, y, z, w of any length but 0, ``(n, 4)``."""
    unit = orientation / np.linalg.norm(orientation, axis=-1, keepdims=True)
    axis, real = unit[..., :3], unit[..., 3:]
    across = 2.0 * np.cross(axis, offset)
    return offset + real * across + np.cross(axis, across)


class Forms:
    """The parts of some bodies, side by side.

    * ``shapes``: of each body its parts, or its plane, whose body stands at the origin.
    """

    def __init__(self, shapes: Sequence[tuple[tuple[Part, ...], Optional[Plane]]]) -> None:
        self.count = len(shapes)
        self.planes = [(at, np.array(p.normal), p.offset_m) for at, (_, p) in enumerate(shapes) if p is not None]
        rows = [(at, part) for at, (parts, _) in enumerate(shapes) for part in parts]
        self.owner = np.array([at for at, _ in rows], np.intp)
        self.offset = np.array([part.offset_m for _, part in rows], float).reshape(-1, 3)
        self.half = np.array([part.half_m for _, part in rows], float).reshape(-1, 3)
        self.radius = np.array([part.radius_m for _, part in rows], float)
        #: Bodies with parts, and the first part of each.
        self.solids, self.first = np.unique(self.owner, return_index=True)
        # a box alone: its gap to another is a difference of coordinates
        single = {at for at, (parts, _) in enumerate(shapes) if len(parts) == 1 and parts[0].is_box}
        self.box_alone = np.array([at in single for at in range(self.count)], bool)

    def parts_of(self, body: int) -> slice:
        """Where a body's parts are."""
        at = int(np.searchsorted(self.owner, body))
        return slice(at, int(np.searchsorted(self.owner, body, side="right")))

    def centres(self, positions: np.ndarray, orientations: np.ndarray) -> np.ndarray:
        """Centre of each part, scene frame, from the poses of the bodies."""
        return positions[self.owner] + turned(orientations[self.owner], self.offset)

    def gaps(self, centres: np.ndarray) -> np.ndarray:
        """Gap of each two bodies, ``(n, n)``; infinite where there is none to tell (itself, two planes)."""
        gaps = np.full((self.count, self.count), np.inf)
        if len(centres):
            parts = gap_of(
                centres[:, None] - centres[None],
                self.half[:, None] + self.half[None],
                self.radius[:, None] + self.radius[None],
            )
            rows = np.minimum.reduceat(parts, self.first, axis=0)
            gaps[np.ix_(self.solids, self.solids)] = np.minimum.reduceat(rows, self.first, axis=1)
        for at, normal, offset_m in self.planes:
            of_parts = self.above(normal, offset_m, centres)
            of_bodies = np.minimum.reduceat(of_parts, self.first)
            gaps[at, self.solids] = gaps[self.solids, at] = of_bodies
        np.fill_diagonal(gaps, np.inf)
        return gaps

    def above(self, normal: np.ndarray, offset_m: float, centres: np.ndarray) -> np.ndarray:
        """Gap of each part to a plane; centres may have leading axes."""
        return centres @ normal - offset_m - self.half @ np.abs(normal) - self.radius

    def slack(self, centres: np.ndarray) -> float:
        """How far rounding may have put these gaps from the truth, metres."""
        far = float(np.abs(centres).max(initial=0.0) + self.half.max(initial=0.0) + self.radius.max(initial=0.0))
        return 64.0 * float(np.finfo(float).eps) * (1.0 + far)
