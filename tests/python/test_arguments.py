"""What the Python client refuses of its arguments, and that it says so as its own error; against a live daemon.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import os

import pytest
from daemons import started  # noqa: F401
from needed import needed

np = needed("numpy")
sweepd = needed("sweepd")

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
NO_TURN = (1.0, 0.0, 0.0, 0.0)
POSES = {"cart": ((0.0, 0.0, 0.0), NO_TURN), "post": ((5.0, 0.0, 0.0), NO_TURN)}

SCENE = """
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
def instance(started):  # noqa: F811
    return started(SCENE)


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
