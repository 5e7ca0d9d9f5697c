"""The Python client across a restart of the daemon with another scene: no body ever gets another one's pose.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import os
import signal
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from daemons import NO_TURN
from needed import needed

np = needed("numpy")
sweepd = needed("sweepd")
layout = needed("sweepd.layout")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
PLACES = {"left": 0.0, "right": 5.0}
TRIANGLES = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "faces": [[0, 1, 2], [1, 3, 2]]}


def scene(*names):
    """Spheres, whose ids go by their order; and a sheet."""
    text = 'frame_id = "world"\n[run]\nrate = 100\n[[source]]\nname = "sim"\n[[source]]\nname = "cloth"\n'
    for name in names:
        text += f'[[body]]\nname = "{name}"\nsource = "sim"\nshape = {{ type = "sphere", radius = 0.5 }}\n'
    shape = f'{{ type = "trimesh", solid = false, vertices = {TRIANGLES["vertices"]}, faces = {TRIANGLES["faces"]} }}'
    return text + f'[[body]]\nname = "sheet"\nsource = "cloth"\ndeforms = true\nshape = {shape}\n'


class Daemon:
    """A daemon that comes back under the same name."""

    def __init__(self, folder):
        self.instance = f"again_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
        self.path = folder / "scene.toml"
        self.process = None

    def start(self, *names):
        self.path.write_text(scene(*names))
        self.process = subprocess.Popen([SWEEPD, "--quiet", "run", str(self.path), "--instance", self.instance])

    def stop(self, number=signal.SIGINT):
        self.process.send_signal(number)
        assert self.process.wait(timeout=10) in (0, -signal.SIGKILL)


@pytest.fixture
def daemon(tmp_path):
    made = Daemon(tmp_path)
    made.start("left", "right")
    yield made
    if made.process.poll() is None:
        made.stop()


def poses():
    return {name: ((x, 0.0, 0.0), NO_TURN) for name, x in PLACES.items()}


def until_restarted(act):
    """Acts every two milliseconds until a restart is told; how often it was refused before."""
    refused, until = 0, time.monotonic() + 10
    while time.monotonic() < until:
        try:
            act()
        except sweepd.Restarted as e:
            return e, refused
        except sweepd.TimedOut as e:
            assert "has just started" in str(e)
            refused += 1
        time.sleep(0.002)
    raise AssertionError("no restart was told")


def received(reader):
    """Where the bodies are whose poses came, at the next tick."""
    while (bodies := reader.wait(5).bodies) is None:
        pass
    bodies = bodies[bodies["age_ns"] < 2**64 - 1]
    return {reader.name_of(row["body"]): row["position"][0] for row in bodies}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_source_that_only_sends_never_gives_a_body_the_pose_of_another(daemon, number):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        old, rows = client.names, client.rows(poses())
        for _ in range(20):
            client.send(rows)
            time.sleep(0.002)
        daemon.stop(number)
        daemon.start("right", "left")
        until_restarted(lambda: client.send(rows))
        assert client.names == {**old, "left": old["right"], "right": old["left"]}
        for stale in (rows, rows[:1], rows.copy()):
            with pytest.raises(sweepd.SweepdError, match="make them anew"):
                client.send(stale)
        with sweepd.Client(daemon.instance, None, quat_order="wxyz", listen=("bodies",)) as reader:
            assert received(reader) == {}, "nothing of what was sent meanwhile"
            for step in range(30):
                client.send(poses() if step % 2 else client.rows(poses()))
                assert received(reader).items() <= PLACES.items()
            assert received(reader) == PLACES


def test_bug_a_pause_after_a_restart_was_sent_to_be_refused_and_told_nobody(daemon):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        client.send(poses())
        daemon.stop()
        daemon.start("right", "left")
        told, _ = until_restarted(client.pause)
        assert told.new_boot != client.hello.boot_id
        assert client.pause() > 1


def test_bug_an_answer_was_lost_where_the_daemon_had_restarted_meanwhile(daemon):
    put = {"put": {"name": "third", "source": "sim", "shape": {"type": "sphere", "radius": 0.1}}}
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        client.step(poses(), timeout_s=5)
        old = client.names
        daemon.stop()
        daemon.start("right", "left")
        # it is there before it is asked
        with sweepd.Client(daemon.instance, None, listen=(), timeout_s=10) as reader:
            reader.wait(5)
            until = time.monotonic() + 10
            while client._ports.boot() != reader.hello.boot_id:
                assert time.monotonic() < until
                time.sleep(0.01)
            assert client.request({"edits": [put]})["ok"]
        # twice the same: the first told of no restart
        assert client.request({"edits": [put]})["ok"]
        assert client.names == old
        with pytest.raises(sweepd.Restarted):
            client.step(poses(), timeout_s=5)
        assert client.names["left"] == old["right"] and "third" in client.names


def test_a_loan_of_before_a_restart_is_refused(daemon):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz") as client:
        loan = client.loan(2)
        loan["body"] = client.names["left"], client.names["right"]
        client.send(poses())
        daemon.stop()
        daemon.start("right", "left")
        until_restarted(lambda: client.send(poses()))
        with pytest.raises(sweepd.SweepdError, match="make them anew"):
            client.send(loan)


def test_what_goes_out_before_the_restart_is_known_is_refused_by_the_new_daemon(daemon):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz") as client:
        client.send(poses())
        old, look = client.hello.boot_id, client._ports.boot
        # it stands still between its look and its sending for as long as the new daemon needs
        client._ports.boot = lambda: old
        daemon.stop()
        daemon.start("right", "left")
        with sweepd.Client(daemon.instance, None, quat_order="wxyz", listen=("bodies",), timeout_s=10) as reader:
            for _ in range(20):
                client.send(poses())
                assert received(reader) == {}
            # They are refused with the next heartbeat, the older ones of a heartbeat passed over.
            until, refused, skipped = time.monotonic() + 5, 0, 0
            while refused + skipped < 20:
                assert time.monotonic() < until, (refused, skipped)
                tick = reader.wait(5).tick
                refused = int(tick.rejects[layout.RejectReason.SESSION_OVER])
                skipped = tick.sources[0].skipped
            assert refused > 10
        client._ports.boot = look
        told, _ = until_restarted(lambda: client.send(poses()))
        assert told.old_boot == old
        assert client.step(poses(), timeout_s=5).tick.header.boot_id == told.new_boot


def test_after_a_restart_all_vertices_are_to_be_sent_again(daemon):
    with sweepd.Client(daemon.instance, "cloth", quat_order="wxyz") as client:
        vertices = np.array(TRIANGLES["vertices"], dtype=float)
        some = {"first": 0, "total": 4}
        assert client.send_vertices("sheet", vertices) == 1
        assert client.send_vertices("sheet", vertices[:1], **some) == 2
        daemon.stop()
        daemon.start("right", "left")
        until_restarted(lambda: client.send_vertices("sheet", vertices[:1], **some))
        with pytest.raises(sweepd.SweepdError, match="all of them first"):
            client.send_vertices("sheet", vertices[:1], **some)
        assert client.send_vertices("sheet", vertices) == 1


def test_a_source_that_only_sends_knows_the_body_it_has_put(daemon):
    put = {"put": {"name": "third", "source": "sim", "shape": {"type": "sphere", "radius": 0.1}}}
    place = {"third": ((0.0, 9.0, 0.0), NO_TURN)}
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as other:
            assert client.request({"edits": [put]})["ok"]
            assert "third" in client.names
            client.send({**poses(), **place})
            # one that neither asked nor waited looks when it meets the name
            assert "third" not in other.names
            assert len(other.rows(place)) == 1
            with pytest.raises(sweepd.SweepdError, match="no body 'fourth'"):
                other.rows({"fourth": place["third"]})


@pytest.mark.parametrize("is_held", [True, False])
def test_bug_a_list_asked_for_anew_while_no_daemon_is_there_comes_with_the_next_one(daemon, is_held):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=("changes",)) as client:
        client.step(poses(), timeout_s=5)
        daemon.stop()
        if not is_held:
            # as where the place was another one's
            del client._ports._readers["changes"]
        for _ in range(3):
            client._inbox._renew_list("changes")
            assert client._ports.is_open("changes") == is_held
        daemon.start("left", "right")
        until_restarted(lambda: client.send(poses()))
        close = {"left": PLACES["left"], "right": PLACES["left"] + 0.9}
        until = time.monotonic() + 10
        result = client.step({name: ((x, 0.0, 0.0), NO_TURN) for name, x in close.items()}, timeout_s=5)
        while result.listed is None or not len(result.listed):
            assert time.monotonic() < until, "the list came"
            result = client.wait(timeout_s=5)
        assert set(result.listed[0][["body_a", "body_b"]].item()) == {client.names[name] for name in close}


def test_a_topic_that_no_daemon_offers_any_more_is_told_as_one_that_is_away(daemon):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        daemon.stop()
        with pytest.raises(sweepd.TimedOut, match="no daemon runs as instance"):
            client._ports.subscribe("contacts", layout.ContactRow)


def test_bug_a_request_to_a_daemon_that_ended_was_waited_for_as_long_as_there_was_time(daemon):
    with sweepd.Client(daemon.instance, "sim", quat_order="wxyz", listen=()) as client:
        client.step(poses(), timeout_s=5)
        # It ends with the request in its queue.
        daemon.process.send_signal(signal.SIGSTOP)
        with ThreadPoolExecutor(1) as pool:
            asked = time.monotonic()
            answer = pool.submit(client.request, {"gap": {"a": "left", "b": "right"}}, timeout_s=60)
            time.sleep(0.3)
            daemon.process.send_signal(signal.SIGTERM)
            daemon.process.send_signal(signal.SIGCONT)
            try:
                # it may have come to it yet
                assert answer.result()["gap"]
            except sweepd.Refused as e:
                assert "has ended" in str(e)
            assert time.monotonic() - asked < 30
        assert daemon.process.wait(timeout=10) == 0
        asked = time.monotonic()
        with pytest.raises(sweepd.Refused, match="or none was there"):
            client.request({"gap": {"a": "left", "b": "right"}}, timeout_s=60)
        assert time.monotonic() - asked < 30
