"""A short run in which everything happens once, in lockstep and at set steps: what the checker's own tests spoil."""

from __future__ import annotations

import signal
import time

from . import cast
from .driver import Soak
from .paths import Path
from .scene import Body, Scene, Source
from .shapes import Part, Plane
from .told import Told
from .world import Change, Setup

TOPICS = ("pairs", "changes", "contacts", "contact_changes", "regions", "bodies", "body_verdicts")
_BALL = Part(radius_m=0.25)


class Script(Soak):
    """Two daemons: one that decides everything, and one that may not work at all."""

    def draw_scene(self) -> tuple[tuple[Source, ...], Scene]:
        """Few bodies, each for something."""
        at = lambda x, y, z: Path(centre=(x, y, z))  # noqa: E731
        to_and_fro = Path(centre=(0.0, 0.0, 0.0), ramp=(1.0 / 8.0, 0.0, 0.0), period=8)
        through = Path(centre=(4.0, 0.0, 0.0), shuttle=(0.5, 0.0, 0.0))
        far = Path(centre=(8.0, 0.0, 0.0), shuttle=(2.0, 0.0, 0.0))
        bodies = [
            Body("post", parts=(_BALL,), path=at(0.75, 0.0, 0.0)),
            Body("floor", plane=Plane((0.0, 0.0, 1.0), -1.0)),
            Body("wall", parts=(Part((0.001, 1.0, 1.0)),), path=at(4.0, 0.0, 0.0)),
            # touches the post, by numbers that are exact
            Body("runner", "sim", (Part((0.25, 0.25, 0.25)),), path=to_and_fro, dyadic=True),
            Body("kerb", parts=(Part((0.25, 0.25, 0.25)),), path=at(-1.0, 0.0, 0.0), dyadic=True),
            # never more than near
            Body("shy", "sim", (_BALL,), path=at(0.75, 0.6, 0.0), report_within_m=0.3),
            Body("shot", "sim", (Part(radius_m=0.05),), path=through, continuous=True),
            Body("jumper", "sim", (Part(radius_m=0.05),), path=far, continuous=True, teleport_m=1.0),
            Body("sinker", "arm", (_BALL,), path=at(2.0, 0.0, -0.9)),
            Body("held", "arm", (_BALL,), path=at(2.0, 3.0, -0.9), on_stale="hold"),
        ]
        sources = (Source(cast.SIM, 5000), Source(cast.ARM, 400))
        return sources, Scene({body.name: body for body in bodies})

    def draw_setup(self) -> Setup:
        """The first has no limit, the next no work."""
        units = 0 if self.daemon.command else None
        return Setup(f'on_frame = "{cast.SIM}"', self.sources, lead=cast.SIM, budget_units=units)

    def start_child(self) -> None:
        """None is needed."""

    def steps(self, count: int) -> None:
        """So many frames of both sources, each with its tick."""
        for _ in range(count):
            self.step += 1
            for name in (cast.ARM, cast.SIM):
                source = self.own[name]
                poses = {body.name: body.path.at(self.step) for body in source.bodies(self.scene)}
                if time.monotonic() >= source.quiet_until_s:
                    source.send(poses, time_left_ns=1_000_000_000 * (self.step % 2))
            self.await_used(list(self.own.values()))

    def play(self) -> list[Told]:
        """Plays it; every tick that the reader had."""
        kept: list[Told] = []
        self.main.kept = kept
        self.steps(34)
        put = Body("third", "sim", (_BALL,), path=Path(centre=(0.75, 0.0, 0.3)))
        self.edit([{"put": put.keys()}], self.scene.with_body(put), put=("third",))
        self.steps(3)
        self.edit([{"remove": "third"}], self.scene.without("third"), Change(removed=frozenset(["third"])))
        self.steps(3)
        self.own[cast.ARM].quiet_until_s = time.monotonic() + 0.9
        while time.monotonic() < self.own[cast.ARM].quiet_until_s and not self.report.faults:
            self.pass_time(0.05)
            self.steps(1)
        self.steps(3)
        self.restart_daemon(signal.SIGKILL)
        self.steps(34)
        return kept
