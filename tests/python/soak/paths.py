"""Where a body is at each step: a formula, the same in every process."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Mapping, Tuple

from .shapes import ORIGIN, Vector

#: Position, metres, and orientation x, y, z, w.
Pose = Tuple[Vector, Tuple[float, float, float, float]]
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Path:
    """``centre + swing cos(a) + sway sin(a) + shuttle (+-1) + ramp tri(step)``, with ``a = rate step + phase``.

    The shuttle goes there and back from step to step; the ramp goes by whole numbers from ``-period`` to ``period`` and
    back, so that one of few binary places comes to exact places. The body turns about z by ``spin`` radians a step.
    """

    centre: Vector = ORIGIN
    swing: Vector = ORIGIN
    sway: Vector = ORIGIN
    rate: float = 0.0
    phase: float = 0.0
    shuttle: Vector = ORIGIN
    ramp: Vector = ORIGIN
    period: int = 1
    spin: float = 0.0

    def at(self, step: int) -> Pose:
        """The pose at a step."""
        angle = self.rate * step + self.phase
        cos, sin = math.cos(angle), math.sin(angle)
        side = 1.0 if step % 2 else -1.0
        tri = float(triangle(step, self.period))
        lanes = zip(self.centre, self.swing, self.sway, self.shuttle, self.ramp)
        x, y, z = (c + a * cos + b * sin + s * side + r * tri for c, a, b, s, r in lanes)
        if self.spin == 0.0:
            return (x, y, z), UPRIGHT
        half = 0.5 * self.spin * step
        return (x, y, z), (0.0, 0.0, math.sin(half), math.cos(half))

    def keys(self) -> dict[str, Any]:
        """As JSON, for another process."""
        return asdict(self)

    @staticmethod
    def read(keys: Mapping[str, Any]) -> Path:
        """From JSON."""
        return Path(**{key: tuple(value) if isinstance(value, list) else value for key, value in keys.items()})


def triangle(step: int, period: int) -> int:
    """Whole numbers from ``-period`` up to ``period`` and down again, one a step."""
    at = step % (4 * period)
    return at - period if at < 2 * period else 3 * period - at
