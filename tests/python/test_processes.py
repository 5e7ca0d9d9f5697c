"""A client beside forked children, threads and the end of the interpreter; each in a process of its own, against a live
daemon.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import os
import subprocess
import sys

import pytest
from daemons import FIRST, started  # noqa: F401
from needed import needed

needed("sweepd")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")

HEAD = """
import gc, os, sys, threading
import numpy as np
import sweepd
c = sweepd.Client(sys.argv[1], "sim", quat_order="xyzw", listen=("pairs", "bodies"), timeout_s=30)
TURN = (0, 0, 0, 1)
def poses(x=5.0):
    return {"cart": ((0, 0, 0), TURN), "post": ((x, 0, 0), TURN)}
def step(x=5.0):
    return c.step(poses(x), timeout_s=30)
GAP = {"gap": {"a": "cart", "b": "post"}}
"""

FORK = """
kept = [step(), step()]
c.request(GAP)
pid = os.fork()
if not pid:
    CHILD
_, status = os.waitpid(pid, 0)
assert status == 0, status
for k in range(20):
    assert step(0.0 if k % 2 else 5.0).state == ("colliding" if k % 2 else "clear")
    kept = kept[-1:] + [c.latest()]
assert c.request(GAP)["ok"]
"""

CHILDREN = {
    "ends": "sys.exit(0)",
    "ends at once": "os._exit(0)",
    "closes the client": "c.close(); sys.exit(0)",
    "lets go of the client and its results": "del c, kept; gc.collect(); sys.exit(0)",
    "uses the client": """
    for call in (step, c.latest, c.wait, c.pause, lambda: c.names, lambda: c.request(GAP), lambda: c.loan(2)):
        try:
            call()
        except sweepd.SweepdError as e:
            assert "make a client after the fork" in str(e), e
        else:
            raise AssertionError("was not refused")
    sys.exit(0)""",
    "makes a client": """
    with sweepd.Client(sys.argv[1], None, quat_order="xyzw", timeout_s=30) as own:
        assert own.wait(30).tick.header.tick and own.names
    sys.exit(0)""",
}


def run(program, instance):
    command = [sys.executable, "-X", "faulthandler", "-c", HEAD + program, instance]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("child", CHILDREN)
def test_bug_a_forked_child_takes_nothing_from_its_parent(started, child):  # noqa: F811
    run(FORK.replace("CHILD", CHILDREN[child]), started(FIRST))
