"""Rows that `loan()` hands out are ordinary memory: nothing done with them, or with views of them, ends the process or
changes what was sent; each in a process of its own, against a live daemon.

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
import gc, sys
import numpy as np
import sweepd
from sweepd import layout
c = sweepd.Client(sys.argv[1], "sim", quat_order="xyzw", listen=("bodies",), timeout_s=30)
TURN = (0, 0, 0, 1)
def fill(rows, x):
    rows["body"] = c.names["cart"], c.names["post"]
    rows["position"] = (x, 0, 0), (x + 50, 0, 0)
    rows["orientation"] = TURN
def step(poses):
    return c.step(poses, timeout_s=30)
def places(result):
    return [float(row["position"][0]) for row in np.sort(result.bodies, order="body")]
def refused(match, call, *args):
    try:
        call(*args)
    except sweepd.SweepdError as e:
        assert match in str(e), e
    else:
        raise AssertionError("was not refused")
"""

CASES = {
    "written after the client has gone": """
r = c.loan(2)
send = c.send
c.close()
refused("closed", send, r)
del c, send
gc.collect()
r["body"] = 7
assert list(r["body"]) == [7, 7]
""",
    "written after a larger one was asked for": """
r = c.loan(2)
r2 = c.loan(200_000)
r["body"] = 7
assert list(r["body"]) == [7, 7] and len(r2) == 200_000
""",
    "read after larger frames went out": """
r = c.loan(2)
fill(r, 1)
step(r)
for n in (1000, 100_000, 1_000_000):
    x = c.loan(n)
    c.send(x)
assert list(r["position"][:, 0]) == [1, 51]
""",
    "sent again after other frames": """
r = c.loan(2)
fill(r, 1)
assert places(step(r)) == [1, 51]
for x in range(6):
    assert places(step({"cart": ((x, 0, 0), TURN), "post": ((x + 9, 0, 0), TURN)})) == [x, x + 9]
assert places(step(r)) == [1, 51]
""",
    "a view that is kept is one of its own array": """
rows = c.loan(2)
pos = rows["position"]
for k in range(200):
    if k:
        rows = c.loan(2)
        assert np.isnan(rows["position"]).all()
    rows["body"] = c.names["cart"], c.names["post"]
    rows["orientation"] = TURN
    pos[:] = (k, 0, 0), (k + 50, 0, 0)
    result = step(rows)
    if not k:
        assert places(result) == [0, 50]
    # what was not written is no pose, and never one that was sent before
    assert places(result) == [0, 50] and result.state == ("unknown" if k else "clear"), k
assert result.tick.rejects[layout.RejectReason.NOT_FINITE] == 2 * 199
""",
    "what one writes into another one is not in this one": """
r, r2 = c.loan(2), c.loan(2)
fill(r2, 1)
r["position"] = 9
assert places(step(r2)) == [1, 51]
r["position"] = 8
assert list(r2["position"][:, 0]) == [1, 51]
fill(r, 5)
c.send(r2)
assert places(step(r)) == [5, 55]
""",
    "changed in place from frame to frame": """
for moving in (False, True):
    r = c.loan(2, velocities=moving)
    poses = r["transform"] if moving else r
    pos = poses["position"]
    if moving:
        r["linear"], r["angular"] = 0.0, 0.0
    for k in range(50):
        fill(poses, k)
        pos[:, 0] += 0.5
        assert places(step(r)) == [k + 0.5, k + 50.5]
# rows that do not lie one behind the other
fill(twice := np.repeat(c.loan(2), 2)[::2], 3)
assert places(step(twice)) == [3, 53]
refused("at most 1048576 rows", c.loan, 2**20 + 1)
""",
}


@pytest.mark.parametrize("case", CASES)
def test_bug_no_use_of_a_loan_ends_the_process_or_changes_what_was_sent(started, case):  # noqa: F811
    command = [sys.executable, "-X", "faulthandler", "-c", HEAD + CASES[case], started(FIRST)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
