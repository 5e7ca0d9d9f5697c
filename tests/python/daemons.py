"""Daemons that tests start, and that end with them."""

import os
import signal
import subprocess
import time

import pytest

NO_TURN = (1.0, 0.0, 0.0, 0.0)

# The first scene of README.md.
FIRST = """
[[source]]
name = "sim"
[[body]]
name = "cart"
shape = { type = "box", half_extents = [0.3, 0.2, 0.1] }
[[body]]
name = "post"
shape = { type = "capsule", radius = 0.1, half_height = 0.5 }
"""


@pytest.fixture
def started(tmp_path):
    """Starts a daemon with a scene; the name of its instance."""
    processes = []

    def start(text):
        path = tmp_path / f"scene_{len(processes)}.toml"
        path.write_text(text)
        name = f"py_{os.getpid()}_{len(processes)}_{time.monotonic_ns() % 1_000_000}"
        processes.append(subprocess.Popen([os.environ["SWEEPD"], "--quiet", "run", str(path), "--instance", name]))
        return name

    yield start
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        assert process.wait(timeout=10) == 0
