"""How a Python client begins: with the first tick that has all it listens to, beside a live source that never waits for it.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import contextlib
import os
import re
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

from sweepd import inbox, layout  # noqa: E402

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
PAGE = Path(__file__).resolve().parents[2] / "msgs/README.md"
READERS = 20
SECOND_NS = 1_000_000_000
LISTS = ("pairs", "changes", "contacts", "contact_changes", "regions", "bodies", "body_verdicts")
LISTENS = [*LISTS, "plan", "names", LISTS, (*LISTS, "plan"), ()]
# As `sweepd feed` does, and a client that computes between its steps.
SOURCE = """
import math, sys, time
import sweepd
client = sweepd.Client(sys.argv[1], "sim", quat_order="wxyz", listen=())
turn, step, next_s = (1.0, 0.0, 0.0, 0.0), 0, time.monotonic()
print("there", flush=True)
while True:
    step, next_s = step + 1, next_s + 0.002
    x = 0.4 + 0.1 * math.sin(0.2 * step)
    try:
        client.send({"cart": ((x, 0.0, 0.0), turn), "post": ((0.0, 0.0, 0.0), turn)})
    except (sweepd.Restarted, sweepd.TimedOut):
        pass
    time.sleep(max(0.0, next_s - time.monotonic()))
"""


@contextlib.contextmanager
def source(instance):
    """Moves the cart in and out of the post, 500 times a second."""
    process = subprocess.Popen([sys.executable, "-c", SOURCE, instance], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "there\n"
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def fast(started):  # noqa: F811
    """An instance whose ticks come at 500 Hz."""
    instance = started('[run]\non_frame = "sim"\n' + FIRST)
    with source(instance):
        yield instance


def shown(result, topic):
    """What a result has of a topic; None: nothing."""
    return getattr(result, {"changes": "listed", "contact_changes": "listed_contacts"}.get(topic, topic))


def lacking(client, result, listen):
    """Which topics a result lacks."""
    topics = (listen,) if isinstance(listen, str) else listen
    lasting = {"plan": lambda: client.plan, "names": lambda: client.names or None}
    return [topic for topic in topics if lasting.get(topic, lambda: shown(result, topic))() is None]


@pytest.mark.parametrize("listen", LISTENS, ids=lambda listen: listen if isinstance(listen, str) else "+".join(listen) or "none")
def test_bug_the_first_results_of_a_reader_beside_a_fast_source_lacked_lists(fast, listen):
    for at in range(READERS):
        with sweepd.Client(fast, None, listen=listen) as reader:
            if at % 2:
                result = reader.wait(timeout_s=5)
            else:
                until = time.monotonic() + 5
                while (result := reader.latest()) is None:
                    assert time.monotonic() < until
            assert lacking(reader, result, listen) == [], at
            if {"pairs", "changes"} & set(listen if isinstance(listen, tuple) else [listen]):
                assert len(result.colliding) <= 1


def test_a_reader_that_has_begun_misses_no_tick(started):  # noqa: F811
    with sweepd.Client(started("[run]\nrate = 40\n" + FIRST), None) as reader:
        results = [reader.wait(timeout_s=5) for _ in range(60)]
        numbers = [result.tick.header.tick for result in results]
        # a machine that is busy with other tests may let it sleep for longer than its queue holds
        assert sum(b - a == 1 for a, b in zip(numbers, numbers[1:])) > 50
        assert sum(lacking(reader, result, ("pairs", "contacts")) == [] for result in results) > 50


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_first_result_after_a_restart_has_all_lists(tmp_path, number):
    (tmp_path / "scene.toml").write_text("[run]\nrate = 200\n" + FIRST)
    instance = f"begin_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
    command = [SWEEPD, "--quiet", "run", str(tmp_path / "scene.toml"), "--instance", instance]
    daemon = subprocess.Popen(command)
    try:
        listen = (*LISTS, "plan")
        with source(instance), sweepd.Client(instance, None, listen=listen) as reader:
            for _ in range(3):
                assert lacking(reader, reader.wait(timeout_s=5), listen) == []
                daemon.send_signal(number)
                daemon.wait(timeout=10)
                daemon = subprocess.Popen(command)
                with pytest.raises(sweepd.Restarted):
                    for _ in range(10_000):
                        reader.wait(timeout_s=5)
                result = reader.wait(timeout_s=5)
                assert lacking(reader, result, listen) == []
                assert result.tick.header.boot_id == reader._inbox.boot
    finally:
        daemon.send_signal(signal.SIGINT)
        assert daemon.wait(timeout=10) == 0


def test_the_first_steps_of_a_source_return_the_result_of_their_frame(started):  # noqa: F811
    for mode in ('on_frame = "sim"', "rate = 300"):
        instance = started(f"[run]\n{mode}\n{FIRST}")
        for _ in range(READERS):
            with sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTS) as client:
                poses = {"cart": ((0.35, 0.0, 0.0), NO_TURN), "post": ((0.0, 0.0, 0.0), NO_TURN)}
                result = client.step(poses, timeout_s=5)
                assert client._row(result.tick).seq == 1
                assert result.state == "colliding"
                # at a rate a busy machine may let newer ones overtake them: the tick is the frame's all the same
                assert mode.startswith("rate") or lacking(client, result, LISTS) == []


def tick(number, lists=(), under_way=False):
    """A tick for a client without a daemon, and the messages that come with it."""
    row = layout.TickRow(sent_ns=number * SECOND_NS)
    row.header.boot_id, row.header.tick = 7, number
    if under_way:
        row.header.state, row.reasons = layout.State.UNKNOWN, 1 << layout.Reason.UNDECIDED
    return row, {topic: (layout.MessageHeader(boot_id=7, tick=number), f"{topic} {number}") for topic in lists}


def alone(ticks):
    """A reader of pairs to which these ticks come, and no more."""
    client = sweepd.Client.__new__(sweepd.Client)
    client._turns = contextlib.nullcontext()
    queue = {}

    def come():
        if not ticks:
            return None
        row, messages = ticks.pop(0)
        queue.update(messages)
        return row

    client._inbox = inbox_of(["pairs"], boot=7, tick=come, message=lambda topic: queue.pop(topic, None))
    client._ports = SimpleNamespace(silence=lambda: "silent", close=lambda: None)
    return client


def test_a_tick_that_is_under_way_is_not_what_a_reader_begins_with():
    client = alone([tick(1), tick(2, under_way=True)])
    with pytest.raises(sweepd.TimedOut, match="no tick within 0.01 s had all .*: one is still under way; wait again"):
        client.wait(timeout_s=0.01)
    assert client.latest() is None
    client = alone([tick(1), tick(2)])
    with pytest.raises(sweepd.TimedOut, match="before the daemon knew of this client"):
        client.wait(timeout_s=0)
    with pytest.raises(sweepd.TimedOut, match="no tick within 0.0 s; silent"):
        client.wait(timeout_s=0)
    # who has begun hears of them
    client = alone([tick(1), tick(2, ["pairs"]), tick(3, under_way=True), tick(4)])
    seen = [client.wait(timeout_s=0) for _ in range(3)]
    assert [(result.tick.header.tick, result.pairs) for result in seen] == [(2, "pairs 2"), (3, None), (4, None)]


def test_bug_rows_of_a_long_tick_came_with_what_was_told_of_it_and_again_with_its_end():
    # all of it is there before the first look
    told, end = tick(3, ["pairs"], under_way=True), tick(3)
    end[0].sent_ns += 1
    client = alone([tick(2, ["pairs"]), told, end])
    seen = [client.wait(timeout_s=0) for _ in range(3)]
    assert [(result.state, result.pairs) for result in seen] == [("clear", "pairs 2"), ("unknown", None), ("clear", "pairs 3")]


def test_a_list_that_never_comes_silences_no_reader_for_ever():
    last = inbox._PASSED_MAX
    client = alone([tick(number) for number in range(1, 100)])
    assert [client.wait(timeout_s=0).tick.header.tick for _ in range(2)] == [last, last + 1]
    # looked at again and again it is one tick
    client = alone([tick(1)])
    assert [client.latest() for _ in range(100)] == [None] * 100
    # of a fast daemon for a second
    fast = [tick(number) for number in range(1, 1000)]
    for number, (row, _) in enumerate(fast, 1):
        row.sent_ns = SECOND_NS + number * SECOND_NS // 500
    assert 480 < alone(fast).wait(timeout_s=0).tick.header.tick < 520
    # those that are under way do not count, however many there are
    long = [tick(1 + at // 50, under_way=True) for at in range(100)]
    for at, (row, _) in enumerate(long):
        row.sent_ns = (1 + at) * SECOND_NS
    client = alone([*long, tick(200, ["pairs"])])
    assert client.wait(timeout_s=0).tick.header.tick == 200


class Turns:
    """True a number of times: the condition of a loop that has no end otherwise."""

    def __init__(self, count):
        self.left = count

    def __bool__(self):
        self.left -= 1
        return self.left >= 0


def test_the_loops_of_the_contracts_page_run(fast, capsys):
    (loops,) = [block for block in re.findall("```python\n(.*?)```", PAGE.read_text(), re.S) if "while reading" in block]
    exec(loops.replace('"default"', repr(fast)), {"sweepd": sweepd, "looking": Turns(20), "reading": Turns(200)})
    lines = capsys.readouterr().out.splitlines()
    states = [line for line in lines if line.startswith(("clear [", "near [", "possible [", "colliding [["))]
    events = lines[len(states) :]
    assert states and set(events) == {"BEGIN cart post", "END cart post"}, lines[-9:]
    assert all(one != next_ for one, next_ in zip(events, events[1:])), "they come by turns"
