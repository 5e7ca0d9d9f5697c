"""What a user of the Python client may do at its limits, and what is told there; against a live daemon.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import contextlib
import gc
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from daemons import FIRST, NO_TURN, started  # noqa: F401
from needed import needed
from stand_ins import inbox_of

sweepd = needed("sweepd")

from sweepd import layout, ports  # noqa: E402
from sweepd.inbox import Inbox  # noqa: E402

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
ROOT = Path(__file__).resolve().parents[2]
STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
PLACES = {"cart": (0.0, 0.0, 0.0), "post": (5.0, 0.0, 0.0)}


@pytest.fixture
def start(started):  # noqa: F811
    """Starts a daemon with a scene; the name of its instance."""
    return lambda text=FIRST: started(text)


def poses(velocities=False, only=tuple(PLACES), x=0.0):
    return {name: ((PLACES[name][0] + x, 0.0, 0.0), NO_TURN, *(STILL if velocities else ())) for name in only}


@contextlib.contextmanager
def alarm(handler, after_s, every_s=0.0):
    """A signal once or every so often, while a client sleeps for the most part."""
    before = signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, after_s, every_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_a_signal_that_is_handled_does_not_end_a_wait(start):
    came = []
    with sweepd.Client(start(), "sim", quat_order="wxyz") as client:
        with alarm(lambda *_: came.append(1), 0.003, 0.003):
            for _ in range(5):
                assert client.step(poses(), timeout_s=5).state == "clear"
                client.wait(timeout_s=5)
                client.request({"gap": {"a": "cart", "b": "post"}})
            with pytest.raises(sweepd.TimedOut):
                sweepd.Client("nobody_here", None, quat_order="wxyz", timeout_s=0.1)
        assert len(came) > 20


def test_ctrl_c_in_a_wait_is_a_keyboard_interrupt(start):
    with sweepd.Client(start(), "sim", quat_order="wxyz") as client:
        for _ in range(10):
            # the handler that Python has for Ctrl-C
            with alarm(signal.default_int_handler, 0.05), pytest.raises(KeyboardInterrupt):
                while True:
                    client.wait(timeout_s=5)
        assert client.step(poses(), timeout_s=5).state == "clear"


def test_clients_beyond_the_limit_are_told_that_every_place_is_taken(start):
    instance = start()
    with contextlib.ExitStack() as there:
        readers = [there.enter_context(sweepd.Client(instance, None, quat_order="wxyz", listen=())) for _ in range(32)]
        with pytest.raises(sweepd.Refused, match="`names` of instance .* every place is taken") as kept:
            sweepd.Client(instance, None, quat_order="wxyz", listen=(), timeout_s=0.2)
        # who keeps the error keeps no place
        onlookers = [ports.Ports(instance, 1.0) for _ in range(16)]
        for onlooker in onlookers:
            there.callback(onlooker.close)
        with pytest.raises(sweepd.Refused, match="every place is taken"):
            sweepd.Client(instance, None, quat_order="wxyz", timeout_s=0.2)
        onlookers[0].close()
        # one waits for a place as long as for a daemon
        with alarm(lambda *_: readers[0].close(), 0.3):
            there.enter_context(sweepd.Client(instance, "sim", quat_order="wxyz", timeout_s=5))
        assert kept.type is sweepd.Refused
    with pytest.raises(sweepd.TimedOut, match="no daemon runs as instance"):
        sweepd.Client("nobody_here", None, quat_order="wxyz", timeout_s=0.1)


def test_a_frame_that_is_late_has_the_least_time_and_not_all_of_it(start, monkeypatch):
    sent = []
    with sweepd.Client(start(), "sim", quat_order="wxyz") as client:
        send = client._ports.send

        def keep(topic, row, header, rows, **more):
            sent.append((header.time_left_ns, header.stamp_ns))
            send(topic, row, header, rows, **more)

        monkeypatch.setattr(client._ports, "send", keep)
        for left in (-5, -(10**20), 0, 7, 10**9):
            client.step(poses(), timeout_s=5, time_left_ns=left, stamp_ns=3)
        assert sent == [(1, 3), (1, 3), (0, 3), (7, 3), (10**9, 3)]
        for name in ("stamp_ns", "clock_id", "scene_rev", "deadline_ns"):
            for wrong in (-1, 2**64, 0.5):
                with pytest.raises(sweepd.SweepdError, match=f"{name}="):
                    client.send(poses(), **{name: wrong})
        with pytest.raises(sweepd.SweepdError, match=r"clock_id=4294967296: give 0 to 2\^32 - 1"):
            client.send(poses(), clock_id=2**32)
        with pytest.raises(sweepd.SweepdError, match="time_left_ns="):
            client.send(poses(), time_left_ns=2**64)
        for more in ({"first": -1, "total": 9}, {"first": 0, "total": -9}):
            client._versions[client._inbox.boot, 1] = 1
            with pytest.raises(sweepd.SweepdError, match="give 0 to"):
                client.send_vertices(1, [[0, 0, 0]], **more)
        assert len(sent) == 5, "nothing that was refused went out"


def test_bug_frames_with_and_without_velocities_in_turn_are_taken_in_their_order(start):
    # few ticks: the daemon finds several frames at once
    instance = start("[run]\nrate = 10\n" + FIRST)
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=("bodies",)) as client:
        for round in range(1, 6):
            for turn, moving in enumerate((True, False, True)):
                client.send(poses(moving, x=float(10 * round + turn)))
            until = time.monotonic() + 5
            while client._row(client.wait(timeout_s=5).tick).seq < client._seq:
                assert time.monotonic() < until
            result = client.latest()
            assert result.tick.rejects[layout.RejectReason.OLD_FRAME] == 0
            assert result.bodies["position"][0][0] == 10 * round + 2


def test_a_pause_does_not_overtake_a_frame_with_velocities(start):
    instance = start("[run]\nrate = 10\n" + FIRST)
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=("bodies",)) as client:
        for x in range(1, 9):
            client.send(poses(True, x=float(x)))
            client.pause()
            until = time.monotonic() + 5
            while client._row(client.wait(timeout_s=5).tick).seq < client._seq:
                assert time.monotonic() < until
            result = client.latest()
            assert result.tick.rejects[layout.RejectReason.OLD_FRAME] == 0
            assert result.bodies["position"][0][0] == x


def test_the_smallest_example_prints_what_touches_in_the_first_scene(start):
    example = ROOT / "msgs/python/examples/minimal.py"
    command = [sys.executable, str(example), "cart", "post", "--instance", start()]
    lines = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout.splitlines()
    assert lines[0] == "0 clear []"
    assert lines[-1] == "99 colliding [('cart', 'post')]"


def test_bug_a_look_at_what_is_there_never_ended_where_ticks_came_faster_than_they_were_read():
    class Endless:
        taken = 0

        def _take(self, _tells_restart):
            self.taken += 1
            assert self.taken < 1000
            return True

    endless = Endless()
    Inbox.drain(endless)
    assert endless.taken > 8, "more than wait in any queue"


def test_bug_what_a_boot_that_came_and_went_unseen_left_was_followed_for_ever():
    ticks = [(1, 1, 10), (3, 1, 30), (2, 1, 20), (3, 2, 31)]

    def tick():
        if not ticks:
            return None
        row = layout.TickRow()
        row.header.boot_id, row.header.tick, row.sent_ns = ticks.pop(0)
        return row

    inbox = inbox_of(["names"], boot=1, tick=tick, message=lambda topic: None)
    assert inbox.next(0)
    with pytest.raises(sweepd.Restarted):
        inbox.next(0)
    assert inbox.next(0) and inbox.next(0) and not inbox.next(0)
    assert (inbox.tick.header.boot_id, inbox.tick.header.tick) == (3, 2)


def test_bug_a_message_of_a_boot_that_went_unseen_held_back_those_of_the_boot_after_it():
    def header(boot_id, tick):
        return layout.MessageHeader(boot_id=boot_id, tick=tick)

    queue = [(header(2, 5), "of a boot between"), (header(3, 1), "of the boot in force")]
    ticks = []

    def tick():
        return ticks.pop(0) if ticks else None

    inbox = inbox_of(["names"], boot=3, tick=tick, message=lambda topic: queue.pop(0) if queue else None)
    for number in range(1, 20):
        ticks.append(layout.TickRow(header=header(3, number), sent_ns=number))
        assert inbox.next(0)
        if number < 16:
            assert inbox.lasting("names") is None, "ticks of the boot between may still come"
    assert inbox.lasting("names")[1] == "of the boot in force"


@contextlib.contextmanager
def files_left(count):
    """This process may open so many more files."""
    # what other tests left would give its files back in the midst of this one
    gc.collect()
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    has = len(os.listdir("/proc/self/fd")) - 1
    resource.setrlimit(resource.RLIMIT_NOFILE, (has + count, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_bug_too_few_open_files_are_told_as_that(start):
    name = start()
    for left in (0, 3, 20, 55):
        with files_left(left), pytest.raises(sweepd.Refused, match=r"takes up to 56 more: `ulimit -n \d+`"):
            sweepd.Client(name, "sim", quat_order="wxyz")
    with files_left(56), sweepd.Client(name, "sim", quat_order="wxyz") as client:
        assert client.step(poses(), timeout_s=5).state == "clear"
    with sweepd.Client(name, "sim", quat_order="wxyz") as client:
        # its port to send by is opened with the first frame
        with files_left(1), pytest.raises(sweepd.SweepdError, match=r"cannot be sent: .*`ulimit -n \d+`"):
            client.send(poses())
        assert client.step(poses(), timeout_s=5).state == "clear"


def test_bug_a_client_without_room_in_shared_memory_is_refused_and_not_killed(start, monkeypatch):
    instance = start()
    real = os.statvfs
    full = SimpleNamespace(f_blocks=9, f_bavail=20, f_frsize=1024)
    endless = SimpleNamespace(f_blocks=0, f_bavail=0, f_frsize=1024)
    says = lambda room: monkeypatch.setattr(os, "statvfs", lambda path: room if path == "/dev/shm" else real(path))  # noqa: E731
    says(full)
    with pytest.raises(sweepd.Refused, match="20 KiB free.*make it larger"):
        sweepd.Client(instance, None)
    says(endless)
    sweepd.Client(instance, None).close()
