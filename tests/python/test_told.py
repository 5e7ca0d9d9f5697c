"""What the Python client tells of a frame without a result or a daemon without a word: why, and what to do.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from daemons import FIRST, NO_TURN, started  # noqa: F401
from needed import needed

sweepd = needed("sweepd")

from sweepd import layout, refusals  # noqa: E402

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
SCENE = FIRST.replace('name = "sim"', 'name = "sim"\ntimeout_ms = 300')
POSES = {"cart": ((0.0, 0.0, 0.0), NO_TURN), "post": ((5.0, 0.0, 0.0), NO_TURN)}


def client(instance, source="sim", **more):
    return sweepd.Client(instance, source, quat_order="wxyz", **{"timeout_s": 10, **more})


def told(call, *args, **kwargs):
    with pytest.raises(sweepd.TimedOut) as error:
        call(*args, **{"timeout_s": 0.7, **kwargs})
    return str(error.value)


def test_each_reason_has_a_remedy():
    assert list(refusals.REMEDIES) == list(layout.RejectReason)


def test_bug_a_client_whose_source_was_taken_over_is_told_what_to_do(started):  # noqa: F811
    instance = started(SCENE)
    with client(instance) as first, client(instance) as second:
        first.step(POSES, timeout_s=10)
        time.sleep(0.5)
        second.step(POSES, timeout_s=10)
        text = told(first.step, POSES)
        assert re.search("refused as session_over .*another client has sent as `sim`.*open a new client", text), text
        with client(instance) as third:
            second.step(POSES, timeout_s=10)
            text = told(third.step, POSES, timeout_s=0.2)
            assert re.search("refused as source_taken .another client sends as `sim`: end that one", text), text
        with client(instance, "som") as stranger:
            text = told(stranger.step, POSES)
            assert re.search("no such source, it has: sim; . refused as unknown_source .name a source of the scene", text), text


def test_bug_a_frame_that_waits_for_a_scene_revision_says_so(started):  # noqa: F811
    with client(started(SCENE)) as first:
        now = first.step(POSES, timeout_s=10).tick.header.scene_rev
        text = told(first.step, POSES, scene_rev=99)
        assert f"waits for revision 99 of the scene (`scene_rev`), which is at {now}" in text
        assert first.step(POSES, timeout_s=10).state == "clear"


def test_bug_a_daemon_that_has_ended_is_told_to_who_has_not_sent_before(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    name = f"told_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
    command = [SWEEPD, "--quiet", "run", str(tmp_path / "scene.toml"), "--instance", name]
    daemon = subprocess.Popen(command)
    with client(name) as first:
        daemon.send_signal(signal.SIGINT)
        assert daemon.wait(timeout=10) == 0
        for call in (first.pause, lambda: first.send(POSES), lambda: first.request({"gap": {"a": "cart", "b": "post"}})):
            with pytest.raises(sweepd.TimedOut, match=f"no daemon runs as instance `{name}` .*--instance {name}"):
                call()
        daemon = subprocess.Popen(command)
        try:
            for _ in range(100):
                try:
                    assert first.step(POSES, timeout_s=1).state == "clear"
                    break
                except (sweepd.TimedOut, sweepd.Restarted):
                    time.sleep(0.05)
            else:
                raise AssertionError("the new daemon answered nothing")
        finally:
            daemon.send_signal(signal.SIGINT)
            assert daemon.wait(timeout=10) == 0


def test_bug_a_daemon_that_is_killed_or_stopped_is_told_with_what_to_do(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    name = f"told_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
    daemon = subprocess.Popen([SWEEPD, "--quiet", "run", str(tmp_path / "scene.toml"), "--instance", name])
    remedy = f"`sweepd doctor --instance {name}` says which, `sweepd run SCENE --instance {name}` starts a new one"
    try:
        with client(name) as first:
            first.step(POSES, timeout_s=10)
            daemon.send_signal(signal.SIGSTOP)
            assert remedy in told(first.step, POSES)
            assert remedy in told(first.wait, timeout_s=0.1)
            assert remedy in told(first.request, {"gap": {"a": "cart", "b": "post"}}, timeout_s=0.1)
            text = told(client, name, timeout_s=0.1)
            assert f"services of instance `{name}` are there, but no daemon says hello" in text and remedy in text
    finally:
        daemon.send_signal(signal.SIGCONT)
        daemon.send_signal(signal.SIGINT)
        assert daemon.wait(timeout=10) == 0
    assert f"start one with `sweepd run SCENE --instance {name}`" in told(client, name, timeout_s=0.1)


# A daemon of which a client knows no service but the one that is the same in all versions; no client wakes it.
OTHER = """
import ctypes, sys, time
import iceoryx2 as iox2
from sweepd import layout
instance, version, every_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
iox2.set_log_level_from_env_or(iox2.LogLevel.Fatal)
node = iox2.NodeBuilder.new().create(iox2.ServiceType.Ipc)
service = node.service_builder(iox2.ServiceName.new(f"{instance}/hello")).publish_subscribe(layout.Hello)
service = service.history_size(1).subscriber_max_buffer_size(8).max_subscribers(48).max_publishers(1)
publisher = service.subscriber_max_borrowed_samples(4).open_or_create().publisher_builder().create()
hello = layout.Hello(boot_id=9, wire_version=version)
for name, value in (("magic", b"sweepd"), ("sweepd_version", b"9.9.9"), ("iceoryx2_version", b"0.10.0")):
    ctypes.memmove(ctypes.addressof(hello) + getattr(layout.Hello, name).offset, value, len(value))
print("there", flush=True)
while True:
    publisher.loan_uninit().write_payload(hello).send()
    time.sleep(every_s)
"""


@pytest.fixture
def other():
    """Starts such a daemon; the name of its instance."""
    processes = []

    def start(version, every_s):
        name = f"other_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
        command = [sys.executable, "-c", OTHER, name, str(version), str(every_s)]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        assert processes[-1].stdout.readline() == "there\n"
        return name

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("every_s", [0.02, 0.4])
def test_bug_a_daemon_of_another_wire_version_was_told_as_none(other, every_s):
    instance = other(2, every_s)
    begun = time.monotonic()
    with pytest.raises(sweepd.Refused) as error:
        client(instance, timeout_s=60)
    text = str(error.value)
    for part in ("the daemon is sweepd 9.9.9 (wire version 2,", f"this client sweepd {sweepd.__version__} (wire version 1,"):
        assert part in text, text
    assert time.monotonic() - begun < 30, "told as soon as it is known"


def test_a_hello_of_our_version_without_its_services_is_no_daemon(other):
    instance = other(layout.WIRE_VERSION, 0.02)
    assert f"no daemon runs as instance `{instance}`" in told(client, instance, timeout_s=0.5)
