"""What the Python client refuses of its arguments, and that it says so as its own error; against a live daemon.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import collections
import os
import types

import pytest
from daemons import FIRST, NO_TURN, started  # noqa: F401
from needed import needed

np = needed("numpy")
sweepd = needed("sweepd")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
POSES = {"cart": ((0.0, 0.0, 0.0), NO_TURN), "post": ((5.0, 0.0, 0.0), NO_TURN)}


@pytest.fixture
def instance(started):  # noqa: F811
    return started(FIRST)


@pytest.fixture
def client(instance):
    with sweepd.Client(instance, "sim", quat_order="wxyz") as client:
        yield client


def refused(match, call, *args, **kwargs):
    with pytest.raises(sweepd.SweepdError, match=match) as told:
        call(*args, **kwargs)
    assert told.type is sweepd.SweepdError


def test_bug_columns_that_do_not_fit_are_not_spread_over_all_bodies(client):
    ids = np.array([client.names["cart"], client.names["post"]])
    at, turn = np.array([[0.0, 0, 0], [5.0, 0, 0]]), np.array([NO_TURN] * 2)
    for wrong in (at[:1], at[:, :1], np.array(7.0), at[0], at[:, :2], at.T, at * 1j, at.astype(str), at > 0):
        refused(r"position of shape .* give real numbers of shape \(2, 3\)", client.send, (ids, wrong, turn))
    for wrong in (turn[0], turn[:1], turn[:, :3]):
        refused(r"quaternion of shape .* give real numbers of shape \(2, 4\)", client.send, (ids, at, wrong))
    refused("linear velocity of shape", client.send, (ids, at, turn, at[:1], at))
    refused("angular velocity of shape", client.send, (ids, at, turn, at, at[0]))
    refused(r"position of shape \(2, 3\) .* \(0, 3\)", client.send, ([], at, turn))
    assert client._seq == 0, "nothing that was refused went out"
    for good in (at, at.astype(np.float32), at.astype(int), at.tolist(), list(at), np.asfortranarray(at)):
        assert client.step((ids, good, turn), timeout_s=5).state == "clear"
        assert client.step((ids, good, turn, good, good), timeout_s=5).state == "clear"
    client.send(([], [], []), partial=True)


def test_bug_ids_that_are_no_whole_numbers_are_not_cut(client):
    at, turn = [(0.0, 0, 0), (5.0, 0, 0)], [NO_TURN] * 2
    some = [client.names["cart"], client.names["post"]]
    for wrong in (np.array(some) + 0.9, [float("nan"), 1], [1.0, 2], [None, 1], [1, -1], np.array([1, -1]), [1, 2**64]):
        refused(r"ids\[[01]\]=.*: give", client.send, (wrong, at, turn))
    for wrong in ([True, False], ["cart", "post"], np.array(["cart", "post"])):
        refused("ids of dtype .* by name as a dict", client.send, (wrong, at, turn))
    for wrong in (3, [[1, 2]], [some, some]):
        refused(r"ids of shape .*: give \(n,\)", client.send, (wrong, at, turn))
    assert client._seq == 0, "nothing that was refused went out"
    for good in (some, tuple(some), np.array(some), np.array(some, np.uint64), np.array(some, np.int32)):
        assert client.step((good, at, turn), timeout_s=5).state == "clear"
    assert list(client.rows(([1, 2**63], at, turn))["body"]) == [1, 2**63]
    assert list(client.rows(([2**64 - 1, 1], at, turn))["body"]) == [2**64 - 1, 1]


def test_bug_poses_by_name_were_taken_of_a_dict_alone(client):
    poses = types.MappingProxyType(POSES)
    assert client.step(poses, timeout_s=5).state == "clear"
    assert list(client.rows(poses)["body"]) == [client.names["cart"], client.names["post"]]
    refused("the scene has no body", client.send, collections.ChainMap({"cat": POSES["cart"]}, POSES))


def test_bug_a_pose_that_does_not_fit_is_told_by_the_name_of_its_body(client):
    good, far = (0.0, 0.0, 0.0), (10**400, 0.0, 0.0)
    for wrong in ((0.0, 0.0), "abc", None, far, (0.0, 0.0, "x"), (1j, 0.0, 0.0), 5.0, (10**5000, 0, 0)):
        refused("position of body 'cart' is .*: give 3 real", client.send, {**POSES, "cart": (wrong, NO_TURN)})
    for wrong in ((0.0, 0.0, 1.0), "abcd", [NO_TURN]):
        refused("quaternion of body 'post' is .*: give 4 real", client.send, {**POSES, "post": (good, wrong)})
    for wrong in (None, 3.0, {1: 2, 3: 4}, {1, 2}):
        refused("a pose is", client.send, {"cart": wrong})
    ids = list(client.names.values())
    refused("position of body 1 is", client.send, (ids, [good, good[:2]], [NO_TURN] * 2))
    for wrong in (None, 3, np.array(3.0)):
        refused("poses of type .*: give", client.step, wrong)
    for wrong in ("abc", "ab", [], np.zeros((3, 7)), np.zeros((2, 2), object), client.rows(POSES).reshape(2, 1)):
        refused(".+: give|a pose is", client.step, wrong)
    for wrong in (-1, 0.5, None, 2**40):
        refused("count=", client.loan, wrong)
    refused("time_left_ns=", client.send, POSES, time_left_ns=None)
    refused(r"step\(foo=\.\.\.\): a frame has stamp_ns, ", client.step, POSES, foo=1)
    for wrong in ([[1, 2, 3], [4, 5]], [[1j, 0, 0]], [["1", "2", "3"]], None, [1, 2, 3]):
        refused("vertices", client.send_vertices, 1, wrong)
    refused("no JSON", client.request, {"edits": [np.zeros(3)]})
    refused("no JSON", client.request, {"edits": []}, [3])
    for wrong in (float("nan"), float("inf")):
        refused("no JSON.* JSON compliant", client.request, {"touching": {"body": "cart", "within_m": wrong}})
    for wrong in ("cart", None, 1.5, [1]):
        refused("give an id", client.name_of, wrong)
    assert client.name_of(np.uint64(client.names["cart"])) == "cart"
    assert client._seq == 0, "nothing that was refused went out"
    assert client.step(POSES, timeout_s=5).state == "clear"


def test_bug_a_time_that_is_no_number_of_seconds_is_refused(client, instance):
    nan = float("nan")
    for wrong in (nan, np.float32("nan"), None, "1", 10**400, [1.0]):
        refused("timeout_s=.*: give a number of seconds", client.wait, timeout_s=wrong)
        refused("timeout_s=", client.step, POSES, timeout_s=wrong)
        refused("timeout_s=", client.request, {"gap": {"a": "cart", "b": "post"}}, timeout_s=wrong)
        refused("timeout_s=", sweepd.Client, "nobody_here", quat_order="wxyz", timeout_s=wrong)
    # below 0 one is late, and nothing else
    for late in (0, -1.0, -float("inf")):
        with pytest.raises(sweepd.TimedOut):
            for _ in range(100):
                client.wait(timeout_s=late)
    client._ports.wait(nan)
    frames = client._seq
    for call in (client.step, client.request):
        with pytest.raises(sweepd.TimedOut, match="timeout_s=-1.0: the time was over before anything was sent"):
            call(POSES, timeout_s=-1)
    assert (client._seq, client._requests) == (frames, 0)
    assert client.step(POSES, timeout_s=float("inf")).state == "clear"


def test_bug_what_a_client_is_opened_with_is_looked_at(instance):
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen="pairs") as client:
        assert client._inbox._topics == ["pairs", "names"]
        result = client.step(POSES, timeout_s=5)
        assert result.pairs is not None and result.contacts is None
    for wrong in ("pair", ["pairs", 3], None, 3, [["pairs"]]):
        refused(r"listen=\[.*\]: there are pairs, ", sweepd.Client, instance, quat_order="wxyz", listen=wrong)
    for wrong in ("", "x" * 32, 3, "\ud800", "a\0b", b"sim"):
        refused("source name", sweepd.Client, instance, wrong, quat_order="wxyz")
    refused("no file names", sweepd.Client, instance, quat_order="wxyz", prefix="a/b", timeout_s=0.1)
    with pytest.raises(sweepd.Refused, match="instance name 3"):
        sweepd.Client(3, quat_order="wxyz")


def test_bug_a_client_that_is_closed_says_so(instance):
    client = sweepd.Client(instance, "sim", quat_order="wxyz")
    client.step(POSES, timeout_s=5)
    rows = client.rows(POSES)
    client.close()
    client.close()
    calls = (
        lambda: client.step(POSES),
        lambda: client.send(rows),
        lambda: client.send_vertices("cart", [[0, 0, 0]]),
        lambda: client.request({"gap": {"a": "cart", "b": "post"}}),
        lambda: client.loan(1),
        client.pause,
        client.wait,
        client.latest,
        lambda: client.names,
        lambda: client.plan,
        lambda: client.name_of(1),
        lambda: client.rows(POSES),
    )
    for call in calls:
        refused("this client is closed", call)


def test_poses_that_the_daemon_refuses_are_counted_in_the_tick(client):
    ids = np.array(list(client.names.values()))
    rejects = client.step(POSES, timeout_s=5).tick.rejects[sweepd.layout.RejectReason.UNKNOWN_BODY]
    result = client.step((ids + 100, [POSES["cart"][0], POSES["post"][0]], [NO_TURN] * 2), timeout_s=5)
    assert result.tick.rejects[sweepd.layout.RejectReason.UNKNOWN_BODY] == rejects + 2
