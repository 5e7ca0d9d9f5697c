"""Bodies that deform, from the Python client over shared memory to the real daemon.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels.
"""

import os
import time
import warnings

import pytest
from daemons import NO_TURN, started  # noqa: F401
from needed import needed

np = needed("numpy")
sweepd = needed("sweepd")

from sweepd import layout  # noqa: E402

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
CELLS = 20


def sheet():
    """Vertices and faces of a square sheet of side 2 m in the plane of x and y."""
    axis = np.linspace(-1.0, 1.0, CELLS + 1)
    x, y = np.meshgrid(axis, axis)
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    faces = []
    for i in range(CELLS):
        for j in range(CELLS):
            a = i * (CELLS + 1) + j
            b, c, d = a + 1, a + CELLS + 2, a + CELLS + 1
            faces += [[a, b, c], [a, c, d]]
    return vertices, faces


def scene():
    vertices, faces = sheet()
    return f"""
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 300
[[body]]
name = "cloth"
deforms = true
position = [0.0, 0.0, 1.0]
shape = {{ type = "trimesh", solid = false, vertices = {vertices.tolist()}, faces = {faces} }}
[[body]]
name = "box"
shape = {{ type = "box", half_extents = [0.5, 0.5, 0.5] }}
"""


@pytest.fixture
def instance(started):  # noqa: F811
    return started(scene())


POSES = {"cloth": ((0.0, 0.0, 1.0), NO_TURN), "box": ((0.0, 0.0, 0.0), NO_TURN)}
LISTEN = ("pairs", "contacts", "bodies")


def dent(vertices, depth):
    """The sheet with its middle pushed down."""
    bent = vertices.copy()
    bent[:, 2] -= depth * np.exp(-4.0 * (bent[:, 0] ** 2 + bent[:, 1] ** 2))
    return bent


def status(client, result, name):
    row = result.bodies[result.bodies["body"] == client.names[name]][0]
    return layout.BodyStatus(row["status"]), layout.RejectReason(row["reject"])


def test_a_sheet_that_is_pushed_into_a_box_collides_in_just_those_steps_in_which_it_reaches_it(instance):
    vertices, _ = sheet()
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTEN) as client:
        result = client.step(POSES, timeout_s=5)
        assert result.state == "unknown", "no vertices yet"
        assert status(client, result, "cloth")[0] == layout.BodyStatus.NOT_RECEIVED
        for step in range(120):
            depth = 0.5 + 0.2 * np.sin(0.15 * step + 0.05)
            client.send_vertices("cloth", dent(vertices, depth))
            result = client.step(POSES, timeout_s=5)
            # The middle is lowest; there the box's top is 0.5 m below.
            assert result.state == ("colliding" if depth > 0.5 else "clear"), (step, depth)
            if depth > 0.5:
                assert np.all(result.contacts["gap_m"] <= 1e-6)


def test_a_range_changes_its_places_only_and_one_that_does_not_follow_is_refused(instance):
    vertices, _ = sheet()
    total = len(vertices)
    middle = total // 2
    down = vertices[middle : middle + 1] - [0.0, 0.0, 0.6]
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTEN) as client:
        with pytest.raises(sweepd.SweepdError, match="all of them first"):
            client.send_vertices("cloth", down, first=middle, total=total)
        assert client.send_vertices("cloth", vertices) == 1
        assert client.step(POSES, timeout_s=5).state == "clear"
        assert client.send_vertices("cloth", down, first=middle, total=total) == 2
        assert client.step(POSES, timeout_s=5).state == "colliding"
        client.send_vertices("cloth", vertices[middle : middle + 1], first=middle, total=total)
        assert client.step(POSES, timeout_s=5).state == "clear"
        # One is lost on the way.
        client._versions[client._inbox.boot, client.names["cloth"]] += 1
        client.send_vertices("cloth", down, first=middle, total=total)
        result = client.step(POSES, timeout_s=5)
        assert result.state == "unknown"
        told = (layout.BodyStatus.REJECTED, layout.RejectReason.VERTEX_VERSION)
        assert status(client, result, "cloth") == told
        assert result.tick.rejects[layout.RejectReason.VERTEX_VERSION] == 1
        client.send_vertices("cloth", vertices)
        assert client.step(POSES, timeout_s=5).state == "clear"


def test_vertices_that_are_not_finite_leave_the_last_good_ones_and_the_body_unknown(instance):
    vertices, _ = sheet()
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTEN) as client:
        client.send_vertices("cloth", vertices)
        assert client.step(POSES, timeout_s=5).state == "clear"
        for wrong, reason in [
            (np.where(np.arange(len(vertices))[:, None] == 7, np.nan, vertices), layout.RejectReason.NOT_FINITE),
            (vertices * 1e300, layout.RejectReason.NOT_FINITE),
            (vertices[:-1], layout.RejectReason.BAD_LAYOUT),
        ]:
            with warnings.catch_warnings(), np.errstate(all="raise"):
                warnings.simplefilter("error")
                client.send_vertices("cloth", wrong)
            result = client.step(POSES, timeout_s=5)
            assert result.state == "unknown"
            assert status(client, result, "cloth") == (layout.BodyStatus.REJECTED, reason)
            client.send_vertices("cloth", vertices)
            assert client.step(POSES, timeout_s=5).state == "clear"


def test_a_client_that_comes_after_one_that_was_killed_has_to_send_all_vertices(instance):
    vertices, _ = sheet()
    first = sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTEN)
    first.send_vertices("cloth", vertices)
    assert first.step(POSES, timeout_s=5).state == "clear"
    first.close()
    # Until its end is heard, another is refused.
    time.sleep(1.0)
    with sweepd.Client(instance, "sim", quat_order="wxyz", listen=LISTEN) as client:
        result = client.step(POSES, timeout_s=5)
        assert result.state == "unknown"
        assert status(client, result, "cloth")[0] == layout.BodyStatus.NOT_RECEIVED
        client.send_vertices("cloth", vertices)
        assert client.step(POSES, timeout_s=5).state == "clear"


TWO = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 5000
[[body]]
name = "cloth"
deforms = true
shape = { type = "trimesh", solid = false, vertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces = [[0, 1, 2]] }
[[body]]
name = "veil"
deforms = true
shape = { type = "trimesh", solid = false, vertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces = [[0, 1, 2]] }
[[body]]
name = "box"
shape = { type = "box", half_extents = [0.5, 0.5, 0.5] }
"""


def test_bug_vertices_that_the_queue_has_lost_are_never_taken_for_the_old_shape(started):  # noqa: F811
    flat = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], dtype=float)
    poses = {"cloth": ((0, 0, 2), NO_TURN), "veil": ((9, 0, 2), NO_TURN), "box": ((0, 0, 0), NO_TURN)}
    with sweepd.Client(started(TWO), "sim", quat_order="wxyz", listen=LISTEN) as client:
        lost = 0
        for _ in range(10):
            client.send_vertices("cloth", flat)
            client.send_vertices("veil", flat)
            assert client.step(poses, timeout_s=5).state == "clear"
            # The cloth reaches into the box; so many others follow that its message may go.
            client.send_vertices("cloth", flat - (0.0, 0.0, 2.0))
            for _ in range(100):
                client.send_vertices("veil", flat)
            result = client.step(poses, timeout_s=5)
            assert result.state in ("unknown", "colliding")
            if result.state == "unknown":
                lost += 1
                wrong = (layout.BodyStatus.REJECTED, layout.RejectReason.VERTEX_VERSION)
                assert status(client, result, "cloth") == wrong
                assert status(client, result, "veil")[0] == layout.BodyStatus.KNOWN
        assert lost > 0
