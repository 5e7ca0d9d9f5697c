"""The Python client against a live daemon: what a simulator's author would do, and what can go wrong.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import copy
import math
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from daemons import NO_TURN, started  # noqa: F401
from needed import needed

np = needed("numpy")
sweepd = needed("sweepd")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
ROOT = Path(__file__).resolve().parents[2]

SCENE = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 300
[[body]]
name = "left"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "right"
shape = { type = "box", half_extents = [0.5, 0.5, 0.5] }
[[body]]
name = "floor"
moves = false
shape = { type = "half_space", normal = [0.0, 0.0, 1.0], offset = -10.0 }
"""


@pytest.fixture
def daemon(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    instance = f"py_{os.getpid()}_{time.monotonic_ns() % 1_000_000}"
    started = []

    def start():
        process = subprocess.Popen([SWEEPD, "--quiet", "run", str(scene), "--instance", instance])
        started.append(process)
        return process

    start()
    yield instance, start, started
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.wait(timeout=10) in (0, -signal.SIGKILL)


@pytest.fixture
def daemon_at_a_rate(started):
    return started(SCENE.replace('on_frame = "sim"', "rate = 20"))


def poses(x, turn=NO_TURN):
    return {"left": ((0.0, 0.0, 0.0), NO_TURN), "right": ((x, 0.0, 0.0), turn)}


def test_each_step_returns_the_result_of_exactly_its_frame(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        for step in range(200):
            x = 1.2 + 0.5 * math.sin(0.1 * step)
            result = client.step(poses(x), timeout_s=5)
            if abs(x - 1.0) > 1e-9:
                assert (len(result.colliding) == 1) == (x < 1.0), (step, x)
            assert result.state in ("clear", "colliding")
            if x < 1.0 - 1e-9:
                row = result.pairs[0]
                assert row["gap_min_m"] <= x - 1.0 <= row["gap_max_m"]
                contact = result.contacts[0]
                np.testing.assert_allclose(contact["normal"], [1, 0, 0], atol=1e-9)
                np.testing.assert_allclose(contact["gap_m"], x - 1.0, atol=1e-9)


def test_regions_hold_the_contacts_and_say_that_they_are_all(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz", listen=("pairs", "contacts", "regions")) as client:
        result = client.step(poses(0.9), timeout_s=5)
        regions, contacts = result.regions, result.contacts
        assert 1 <= len(regions) <= 8 and (regions["count"] == len(regions)).all()
        assert (regions["flags"] == sweepd.layout.RegionFlags.COMPLETE).all()
        for contact in contacts:
            for point in (contact["point_a"], contact["point_b"]):
                away = np.linalg.norm(regions["centre"] - point, axis=1)
                assert (away <= regions["radius_m"] + 1e-12).any()
        np.testing.assert_allclose(regions[0]["normal"], [1, 0, 0], atol=1e-9)
        np.testing.assert_allclose(regions["depth_m"].max(), 0.1, atol=1e-9)
        assert len(client.step(poses(1.2), timeout_s=5).regions) == 0


MANY = SCENE.replace("timeout_ms = 300", "timeout_ms = 30000") + "".join(
    f'[[body]]\nname = "b{at}"\nreport_within_m = 0.5\nshape = {{ type = "sphere", radius = 0.5 }}\n' for at in range(60)
)


def crowd(step):
    """Spheres in a row, some of them a little aside in each step."""
    places = {f"b{at}": ((20 + 1.1 * at + (0.4 if (at + step) % 20 == 0 else 0.0), 0.0, 0.0), NO_TURN) for at in range(60)}
    return {**poses(1.2 + 0.5 * math.sin(0.3 * step)), **places}


def test_lists_kept_from_changes_are_what_pairs_and_contacts_say(started):
    listen = ("pairs", "changes", "contacts", "contact_changes")
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=listen) as client:
        deltas = rows = contacts = gone = 0
        for step in range(150):
            result = client.step(crowd(step), timeout_s=5)
            assert result.listed.tobytes() == result.pairs.tobytes(), step
            deltas += result.changes_header.base_tick != 0
            rows += len(result.changes)
            assert result.listed_contacts.tobytes() == result.contacts.tobytes(), step
            assert len(result.contacts) == result.contact_changes_header.listed > 0
            contacts += len(result.contact_changes)
            gone += int((result.contact_changes["kind"] == sweepd.layout.ContactKind.GONE).sum())
        assert deltas > 100 and rows < 150 * len(result.pairs)
        assert contacts < 150 * len(result.contacts) and gone > 50
        before = result
        client.step(crowd(step), timeout_s=5)
        with pytest.raises(sweepd.SweepdError, match="gone on to another tick"):
            before.listed
        with pytest.raises(sweepd.SweepdError, match="gone on to another tick"):
            before.listed_contacts


def test_contacts_are_kept_from_their_changes_alone(started):
    instance = started(MANY)
    with (
        sweepd.Client(instance, "sim", quat_order="wxyz", listen="contact_changes") as client,
        sweepd.Client(instance, None, listen="contacts") as reader,
    ):
        for step in range(40):
            result = client.step(crowd(step), timeout_s=5)
            told = reader.wait(timeout_s=5)
            while told.tick.header.tick < result.tick.header.tick:
                told = reader.wait(timeout_s=5)
            assert result.pairs is None and result.contacts is None
            assert result.listed_contacts.tobytes() == told.contacts.tobytes()


def test_a_list_that_missed_a_message_is_not_shown_until_the_whole_of_it_came(started, monkeypatch):
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=("changes",)) as client:
        for step in range(5):
            assert len(client.step(crowd(step), timeout_s=5).listed) > 0
        receive = client._ports.message
        lost = []

        def lose(topic):
            message = receive(topic)
            if topic == "changes" and message is not None and not lost:
                lost.append(message[0].message.tick)
                return receive(topic)
            return message

        monkeypatch.setattr(client._ports, "message", lose)
        result = client.step(crowd(5), timeout_s=5)
        assert lost and result.changes is None and result.listed is None
        with pytest.raises(sweepd.SweepdError, match="has not all of them yet"):
            result.colliding
        for step in range(6, 12):
            result = client.step(crowd(step), timeout_s=5)
            if result.listed is not None:
                break
        # the first that it has is the whole list, and the next build on it
        assert result.changes_header.base_tick == 0
        assert len(result.listed) == len(result.changes)
        after = client.step(crowd(12), timeout_s=5)
        assert after.changes_header.base_tick != 0 and len(after.listed) == after.changes_header.listed


@pytest.mark.parametrize("topics", [("pairs", "contacts", "regions", "bodies"), ("changes", "contact_changes", "bodies")])
def test_bug_results_may_be_kept_and_stay_as_they_are(started, topics):
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=topics) as client:
        kept = []
        for step in range(30):
            if step % 10 == 0:
                # ticks of some heartbeats are waiting
                time.sleep(0.5)
            result = client.step(crowd(step), timeout_s=5)
            arrays = [rows for topic in topics if (rows := getattr(result, topic)) is not None]
            assert len(arrays) == len(topics) or "changes" in topics
            for rows in arrays:
                with pytest.raises(ValueError, match="read-only"):
                    rows.flags.writeable or rows.__setitem__(0, rows[0])
            kept.append((result, arrays, [rows.tobytes() for rows in arrays]))
            if step == 20:
                # those over shared memory go, and new ones take their places
                del kept[:10]
        copied = [rows.base is None for _, arrays, _ in kept for rows in arrays]
        assert any(copied) and not all(copied)
    for _, arrays, told in kept:
        assert [rows.tobytes() for rows in arrays] == told


def test_bug_kept_changes_became_those_of_later_ticks_once_the_client_had_missed_a_message(started):
    topics = ("changes", "contact_changes")
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=topics) as client:
        kept = client.step(crowd(0), timeout_s=5)
        arrays = [getattr(kept, topic) for topic in topics]
        assert all(len(rows) > 0 for rows in arrays)
        told = [rows.tobytes() for rows in arrays]
        for topic in topics:
            client._inbox._renew_list(topic)
        for step in range(1, 30):
            client.step(crowd(step), timeout_s=5)
            assert [rows.tobytes() for rows in arrays] == told


def test_a_copy_of_a_result_is_free_of_shared_memory_and_can_be_pickled(started):
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=("pairs", "changes", "bodies")) as client:
        kept = []
        for step in range(12):
            result = client.step(crowd(step), timeout_s=5)
            pairs, tick = result.pairs.copy(), result.tick.header.tick
            for copied in (copy.deepcopy(result), pickle.loads(pickle.dumps(result))):
                kept.append((copied, pairs, tick))
    for copied, pairs, tick in kept:
        assert copied.tick.header.tick == tick
        assert copied.pairs.tobytes() == copied.listed.tobytes() == pairs.tobytes()


def test_bug_errors_can_be_pickled():
    for error in (sweepd.Restarted(1, 2, np.empty((0, 2))), sweepd.Skipped(7), sweepd.TimedOut("late")):
        copied = pickle.loads(pickle.dumps(error))
        assert (type(copied), str(copied)) == (type(error), str(error))
    assert "Client" in dir(sweepd)


def test_bug_who_listens_to_the_plan_is_told_it(daemon):
    with sweepd.Client(daemon[0], None, quat_order="wxyz", listen="plan") as client:
        until = time.monotonic() + 10
        while client.plan is None:
            assert time.monotonic() < until
            client.wait(timeout_s=5)
        assert client.plan["bodies"] == 3 and client.plan["left_out"]
    with sweepd.Client(daemon[0], None, quat_order="wxyz") as client:
        assert client.plan is None


def test_who_sends_says_how_it_writes_quaternions_and_who_reads_need_not(daemon):
    # a source is what a client is unless it says otherwise
    for order in ({}, {"quat_order": "zyx"}):
        with pytest.raises(sweepd.SweepdError, match="quat_order=.*say \"xyzw\" or \"wxyz\".*source=None"):
            sweepd.Client(daemon[0], **order)
    with sweepd.Client(daemon[0], source=None) as client:
        assert client.wait(timeout_s=5).state
        with pytest.raises(sweepd.SweepdError, match="a reader that makes rows says how it writes quaternions"):
            client.rows(([1], [[0.0, 0.0, 0.0]], [NO_TURN]))


def test_bug_a_list_whose_place_another_reader_took_is_asked_for_again(started, monkeypatch):
    with sweepd.Client(started(MANY), "sim", quat_order="wxyz", listen=("changes",)) as client:
        client.step(crowd(0), timeout_s=5)
        read = client._ports._read

        def taken(topic, *args):
            monkeypatch.setattr(client._ports, "_read", read)
            raise sweepd.Refused(f"`{topic}`: every place is taken")

        monkeypatch.setattr(client._ports, "_read", taken)
        with pytest.raises(sweepd.Refused, match="every place"):
            client._inbox._renew_list("changes")
        for step in range(1, 12):
            result = client.step(crowd(step), timeout_s=5)
            if result.listed is not None and result.changes_header.base_tick == 0:
                break
        assert result.changes_header.base_tick == 0 and len(result.listed) == len(result.changes)


def test_a_quaternion_is_read_in_the_order_that_was_said(daemon):
    half = math.sqrt(0.5)
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        # Turned by 45 degrees about z, the box's edge reaches out 0.707.
        eighth = (math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8))
        result = client.step(poses(1.1, eighth), timeout_s=5)
        assert len(result.colliding) == 1
        np.testing.assert_allclose(result.pairs[0]["gap_max_m"], 1.1 - 0.5 - half, atol=1e-9)


def test_a_pose_that_is_not_finite_makes_the_body_unknown_until_the_next_good_one(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        assert client.step(poses(3.0), timeout_s=5).state == "clear"
        result = client.step(poses(float("nan")), timeout_s=5)
        assert result.state == "unknown"
        assert client.step(poses(3.0), timeout_s=5).state == "clear"


def test_silence_is_never_clear(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        assert client.step(poses(3.0), timeout_s=5).state == "clear"
        until = time.monotonic() + 1.5
        states = []
        while time.monotonic() < until:
            states.append(client.wait(timeout_s=1).state)
        assert states[-1] == "unknown"
        assert len(states) >= 8, "a tick at least each heartbeat"
        assert "clear" not in states[states.index("unknown") :]


def test_scene_edits_are_done_whole_or_not_at_all(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        assert len(client.step(poses(0.5), timeout_s=5).colliding) == 1
        rule = {"rule": {"action": "ignore", "a": "left", "b": "right", "reason": "test"}}
        with pytest.raises(sweepd.Refused, match="nobody"):
            client.request({"edits": [rule, {"remove": "nobody"}]})
        assert len(client.step(poses(0.5), timeout_s=5).colliding) == 1
        answer = client.request({"edits": [rule]})
        assert answer["ok"]
        result = client.step(poses(0.5), timeout_s=5)
        assert len(result.colliding) == 0
        assert result.state == "clear"


def test_a_pose_is_tried_before_anything_moves(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        assert client.step(poses(5.0), timeout_s=5).state == "clear"
        there = {"body": "left", "position": [4.5, 0.0, 0.0], "within_m": 0.1}
        touching = client.request({"touching": there})["touching"]
        assert touching["complete"] and [row["b"] for row in touching["rows"]] == ["right"]
        np.testing.assert_allclose(touching["rows"][0]["gap_best_m"], -0.5, atol=1e-9)
        with pytest.raises(sweepd.Refused, match="nobody"):
            client.request({"touching": {"body": "nobody"}})
        assert client.step(poses(5.0), timeout_s=5).state == "clear"


def test_a_killed_daemon_that_comes_back_is_told_as_a_restart(daemon):
    instance, start, started = daemon
    with sweepd.Client(instance, "sim", quat_order="wxyz") as client:
        client.step(poses(0.5), timeout_s=5)
        started[0].kill()
        started[0].wait()
        start()
        with pytest.raises(sweepd.Restarted):
            for _ in range(100):
                try:
                    client.step(poses(0.5), timeout_s=0.2)
                except sweepd.TimedOut:
                    pass
        until = time.monotonic() + 10
        while time.monotonic() < until:
            try:
                assert len(client.step(poses(0.5), timeout_s=1).colliding) == 1
                return
            except sweepd.TimedOut:
                pass
        raise AssertionError("the restarted daemon answered nothing")


def test_a_frame_that_a_newer_one_overtook_is_said_to_be_skipped(daemon_at_a_rate, monkeypatch):
    with sweepd.Client(daemon_at_a_rate, "sim", quat_order="wxyz") as client:
        client.step(poses(3.0), timeout_s=5)
        send = client.send

        def twice(poses, **fields):
            first = send(poses, **fields)
            send(poses, **fields)
            return first

        monkeypatch.setattr(client, "send", twice)
        skipped = []
        for _ in range(20):
            try:
                # a tick may come between the two
                client.step(poses(3.0), timeout_s=5)
            except sweepd.Skipped as e:
                skipped.append(e)
        assert len(skipped) >= 10
        assert all(f"frame {e.seq} was passed over" in str(e) for e in skipped)
        monkeypatch.undo()
        assert client.step(poses(3.0), timeout_s=5).state == "clear"


def test_the_files_of_another_user_are_refused_and_it_is_told_whose_they_are(daemon, monkeypatch):
    owner = os.geteuid()
    sweepd.Client(daemon[0], None, quat_order="wxyz").close()
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(sweepd.Refused, match=f"belongs to user id {owner}, this process runs as {owner + 1}"):
        sweepd.Client(daemon[0], None, quat_order="wxyz")


BULLET = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 3000
[[body]]
name = "bullet"
continuous = true
shape = { type = "box", half_extents = [0.5, 0.01, 0.01] }
[[body]]
name = "post"
position = [5.0, 0.4, 0.0]
moves = false
shape = { type = "sphere", radius = 0.05 }
"""


def test_velocities_tell_of_turns_that_poses_do_not_show(started):
    """A rod that turns once round in a step touches a post that it does not touch when it does not turn."""
    turns = {"turned": (0.0, 0.0, 2 * math.pi), "slid": (0.0, 0.0, 0.0)}
    for shape in ("dict", "arrays", "loan"):
        for word, angular in turns.items():
            with sweepd.Client(started(BULLET), "sim", quat_order="wxyz") as client:
                for step, x in enumerate([0.0, 0.0, 5.0, 5.0]):
                    # the last step: at one place beside the post, one second apart, a turn
                    spin = angular if step == 3 else (0.0, 0.0, 0.0)
                    place = (x, 0.0, 0.0)
                    if shape == "dict":
                        frame = {"bullet": (place, NO_TURN, (0.0, 0.0, 0.0), spin)}
                    elif shape == "arrays":
                        frame = ([client.names["bullet"]], [place], [NO_TURN], [(0.0, 0.0, 0.0)], [spin])
                    else:
                        frame = client.loan(1, velocities=True)
                        frame["transform"]["body"] = client.names["bullet"]
                        frame["transform"]["position"] = place
                        frame["transform"]["orientation"] = (0.0, 0.0, 0.0, 1.0)
                        frame["linear"], frame["angular"] = 0.0, spin
                    result = client.step(frame, timeout_s=5, stamp_ns=(step + 1) * 1_000_000_000)
                wanted = "colliding" if word == "turned" else "clear"
                assert result.state == wanted, (shape, word)


def test_a_frame_has_velocities_of_all_its_bodies_or_of_none(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        some = poses(3.0)
        some["left"] = (*some["left"], (0, 0, 0), (0, 0, 0))
        with pytest.raises(sweepd.SweepdError, match="all its bodies, or of none"):
            client.send(some)
        with pytest.raises(sweepd.SweepdError, match="a position and a quaternion"):
            client.send({"left": ((0, 0, 0), NO_TURN, (0, 0, 0))})


def test_a_loan_is_filled_and_sent(daemon):
    with sweepd.Client(daemon[0], "sim", quat_order="wxyz") as client:
        names = client.names
        for step in range(50):
            rows = client.loan(2)
            rows["body"] = names["left"], names["right"]
            rows["position"] = (0.0, 0.0, 0.0), (0.8 if step % 2 else 1.2, 0.0, 0.0)
            rows["orientation"] = 0.0, 0.0, 0.0, 1.0
            result = client.step(rows, timeout_s=5)
            assert result.state == ("colliding" if step % 2 else "clear")


def test_the_smallest_example_runs(daemon):
    example = ROOT / "msgs/python/examples/minimal.py"
    command = [sys.executable, str(example), "left", "--instance", daemon[0], "--steps", "3"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert len(done.stdout.splitlines()) == 3
