"""A client beside forked children and among threads; each in a process of its own, against a live daemon.

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


THREADS = """
sys.setswitchinterval(1e-6)
told, wrong, done = [], [], [0, 0]
def work(at):
    for k in range(400):
        x = 1000.0 * (at + 1) + k
        try:
            result = step(x)
            found = result.bodies["position"][:, 0].max()
            done[at] += 1
            if found != x:
                wrong.append((found, x))
        except sweepd.SweepdError as e:
            told.append(str(e))
threads = [threading.Thread(target=work, args=(at,)) for at in range(2)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not wrong, wrong[:5]
assert told and sum(done) and all("another thread is using this client" in text for text in told), set(told)
assert step(3.0).state == "clear"

# in the midst of a wait nothing but names is told, and the wait goes on
held, go, sleep = threading.Event(), threading.Event(), c._ports.wait
def held_up(timeout_s):
    held.set()
    assert go.wait(30)
    sleep(timeout_s)
def until_held():
    while not held.is_set():
        c.wait(30)
    done.append("waited")
old = c.latest()
c._ports.wait = held_up
waits = threading.Thread(target=until_held)
waits.start()
assert held.wait(30) and c.names["cart"] and c.name_of(c.names["cart"]) == "cart"
for call in (step, c.latest, c.pause, c.close, lambda: c.request(GAP), lambda: c.rows(poses()), lambda: old.listed):
    try:
        call()
    except sweepd.SweepdError as e:
        assert "another thread is using this client" in str(e), e
    else:
        raise AssertionError("was not refused")
go.set()
waits.join()
c._ports.wait = sleep
assert done[-1] == "waited"

# one after the other they may
turn = threading.Lock()
def in_turn():
    for _ in range(50):
        with turn:
            assert step(3.0).state == "clear"
threads = [threading.Thread(target=in_turn) for _ in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_bug_a_step_beside_that_of_another_thread_never_has_its_result(started):  # noqa: F811
    run(THREADS, started(FIRST))
