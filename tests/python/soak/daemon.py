"""The real daemon as a process that is started, stopped and killed."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path as File
from typing import Optional

from .scene import Scene
from .world import Setup


class Daemon:
    """One instance, started as often as one likes."""

    def __init__(self, folder: File) -> None:
        self.instance = f"soak_{os.getpid()}_{time.monotonic_ns() % 1_000_000_000}"
        self._folder = folder
        self._process: Optional[subprocess.Popen[bytes]] = None
        self._starts = 0
        #: How it was started last, to be started again by hand.
        self.command: list[str] = []

    def start(self, setup: Setup, scene: Scene) -> None:
        """Starts it."""
        self._starts += 1
        run = [f"heartbeat_ms = {setup.heartbeat_ms}", setup.mode]
        limits = {} if setup.pair_rows is None else {"pair_rows": setup.pair_rows}
        path = self._folder / f"scene_{self._starts}.toml"
        path.write_text(scene.toml(run, limits, setup.sources))
        self.command = [os.environ["SWEEPD"], "--quiet", "run", str(path), "--instance", self.instance]
        if setup.budget_ns is not None:
            self.command += ["--budget", f"{setup.budget_ns / 1e6}ms"]
        if setup.budget_units is not None:
            self.command += ["--budget-units", str(setup.budget_units)]
        with open(self._folder / f"daemon_{self._starts}.log", "wb") as log:
            self._process = subprocess.Popen(self.command, stderr=log)

    def end(self, number: signal.Signals) -> Optional[str]:
        """Ends it; what is wrong with how it ended."""
        assert self._process is not None
        early = self._process.poll()
        if early is not None:
            return f"it had ended with {early}: {self.log()}"
        self._process.send_signal(number)
        try:
            code = self._process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return f"it went on for 30 s after signal {number.name}: {self.log()}"
        wanted = -signal.SIGKILL if number == signal.SIGKILL else 0
        if code == wanted and not any(word in self.log() for word in ("panic", "ERROR")):
            return None
        return f"it ended with {code}: {self.log()}"

    @property
    def ended(self) -> bool:
        """Whether it is not running, or was never."""
        return self._process is None or self._process.poll() is not None

    def log(self) -> str:
        """What it said on stderr, the last of it."""
        return (self._folder / f"daemon_{self._starts}.log").read_text(errors="replace")[-2000:]
