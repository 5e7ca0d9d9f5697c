"""A cloud of bodies on known paths: the same poses for whoever asks, by the number of the frame."""

import numpy as np

RATE_HZ = 100.0


class Cloud:
    """`count` bodies in a cube; each goes to and fro on its own line."""

    def __init__(self, count, side_m=15.0, seed=7):
        random = np.random.default_rng(seed)
        self.names = [f"b{n:04}" for n in range(count)]
        self._centre = random.uniform(0, side_m, (count, 3))
        self._way = random.normal(0, 1.0, (count, 3))
        self._speed = random.uniform(0.2, 2.0, (count, 1))
        self._phase = random.uniform(0, 7, (count, 1))

    def positions(self, frame):
        """`(count, 3)`, metres."""
        return self._centre + self._way * np.sin(self._phase + self._speed * frame / RATE_HZ)
