"""`~/gap` against truth worked out by hand: spheres, boxes, a mesh, a half-space; and what has no gap, with the reason."""

import json
import math

import pytest
from frames import Sender, pose
from geometry_msgs.msg import Point
from parameters import set_parameter
from scenes import HANDS
from shape_msgs.msg import Mesh, MeshTriangle
from sweepd_msgs.msg import Pairs, State, Tick
from sweepd_msgs.srv import EnableBody, Gap, PutBody, RemoveBody, SetFilter

# A quarter turn about z, and one about x.
Z90 = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
X90 = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))

SCENE = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 60000
[[body]]
name = "ball"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "pea"
report_within_m = 0.3
shape = { type = "sphere", radius = 0.1 }
[[body]]
name = "brick"
shape = { type = "box", half_extents = [1.0, 0.5, 0.25] }
[[body]]
name = "cube"
shape = { type = "box", half_extents = [0.5, 0.5, 0.5] }
[[body]]
name = "pyramid"
shape = { type = "trimesh", vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]] }
[[body]]
name = "floor"
moves = false
shape = { type = "half_space", normal = [0.0, 0.0, 1.0], offset = -10.0 }
[[body]]
name = "wall"
moves = false
shape = { type = "half_space", normal = [1.0, 0.0, 0.0], offset = -20.0 }
"""
FAR = {"ball": (0, 0, 0), "pea": (10, 0, 0), "brick": (20, 0, 0), "cube": (30, 0, 0), "pyramid": (40, 0, 0)}
SLANT = math.sqrt(0.5)

# Hands that stay known while a test does something else.
PATIENT = HANDS.replace("timeout_ms = 500", "timeout_ms = 60000")

# Where two of them are: the gap, points on A and on B (None: more than one), the normal from A to B.
CASES = [
    ("ball", (0, 0, 0), "pea", (0, 2, 0), 1.4, (0, 0.5, 0), (0, 1.9, 0), (0, 1, 0)),
    ("pea", (0, 2, 0), "ball", (0, 0, 0), 1.4, (0, 1.9, 0), (0, 0.5, 0), (0, -1, 0)),
    ("ball", (0, 0, 0), "pea", (0.4, 0, 0), -0.2, (0.5, 0, 0), (0.3, 0, 0), (1, 0, 0)),
    # the brick stands on its end: its long side is along y
    ("brick", ((0, 0, 0), Z90), "cube", (1.75, 0, 0), 0.75, None, None, (1, 0, 0)),
    ("brick", (0, 0, 0), "cube", (1.3, 0, 0.1), -0.2, None, None, (1, 0, 0)),
    ("brick", (0, 0, 0), "ball", (1.5, 1.0, 0), math.sqrt(0.5) - 0.5, (1, 0.5, 0),
     (1.5 - 0.5 * SLANT, 1 - 0.5 * SLANT, 0), (SLANT, SLANT, 0)),
    # a slope of the pyramid: its plane is x + z = 1
    ("pyramid", (0, 0, 0), "ball", (1.5, 0, 1.5), 2 * SLANT - 0.5, (0.5, 0, 0.5), (1.5 - 0.5 * SLANT, 0, 1.5 - 0.5 * SLANT), (SLANT, 0, SLANT)),
    ("pyramid", (0, 0, 0), "pea", (0, 0, 1.3), 0.2, (0, 0, 1), (0, 0, 1.2), (0, 0, 1)),
    ("cube", ((0, 0, 0), X90), "floor", (0, 0, 0), 9.5, None, None, (0, 0, -1)),
    ("floor", (0, 0, 0), "pyramid", (3, 4, -9.75), 0.25, None, None, (0, 0, 1)),
]  # fmt: skip


def told(room, a, b):
    return room.call(Gap, "/sweepd/gap", Gap.Request(name_a=a, name_b=b))


def known(room, scene=SCENE, poses=FAR, ros_args=()):
    """A daemon whose bodies are all known."""
    room.daemon(scene, ros_args=ros_args)
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    room.until(lambda: states and states[-1].word != "unknown", "known bodies", then=lambda: sender.send(poses))
    return sender, ticks


def place(room, sender, ticks, poses):
    """Sends poses and returns the tick that has them."""
    seq = sender.send(poses)
    return room.until(lambda: next((t for t in ticks if t.sources and t.sources[0].seq >= seq), None), "their tick")


def at(point):
    return (point.x, point.y, point.z)


def test_gaps_are_those_worked_out_by_hand(room):
    sender, ticks = known(room)
    for a, place_a, b, place_b, gap, point_a, point_b, normal in CASES:
        moved = {name: at for name, at in ((a, place_a), (b, place_b)) if name != "floor"}
        tick = place(room, sender, ticks, FAR | moved)
        answer = told(room, a, b)
        where = f"{a} and {b}: {answer}"
        assert answer.success and answer.message == "", where
        assert answer.gap_min_m <= gap + 1e-9 and answer.gap_max_m >= gap - 1e-9, where
        assert answer.gap_max_m - answer.gap_min_m < 1e-6, where
        assert answer.gap_min_m <= answer.gap_best_m <= answer.gap_max_m, where
        near = "pea" in (a, b) and 0 < gap < 0.3
        assert answer.verdict == (Gap.Response.COLLIDING if gap < 0 else Gap.Response.NEAR if near else Gap.Response.APART), where
        assert answer.tick_header.tick >= tick.tick_header.tick and answer.tick_header.boot_id == tick.tick_header.boot_id, where
        assert answer.tick_header.newest_stamp_ns == tick.tick_header.newest_stamp_ns, where
        assert at(answer.normal) == pytest.approx(normal, abs=1e-6), where
        if point_a is not None:
            assert at(answer.point_a) == pytest.approx(point_a, abs=1e-6), where
            assert at(answer.point_b) == pytest.approx(point_b, abs=1e-6), where
        across = [q - p for p, q in zip(at(answer.point_a), at(answer.point_b))]
        assert across == pytest.approx([gap * n for n in normal], abs=1e-6), where


def test_a_mesh_that_overlaps_has_a_sound_interval_and_touching_is_told(room):
    sender, ticks = known(room)
    # the ball's centre is 0.1 outside the slope; no point of either lies deeper than 0.4 in the other
    place(room, sender, ticks, FAR | {"pyramid": (0, 0, 0), "ball": (0.5 + 0.1 * SLANT, 0, 0.5 + 0.1 * SLANT)})
    answer = told(room, "pyramid", "ball")
    assert answer.success and answer.verdict == Gap.Response.COLLIDING and not answer.touching
    assert answer.gap_min_m <= -0.4 + 1e-9 and answer.gap_max_m <= 0, answer
    # wholly inside: nothing crosses
    place(room, sender, ticks, FAR | {"pyramid": (0, 0, 0), "pea": (0, 0, 0.3)})
    answer = told(room, "pea", "pyramid")
    assert answer.success and answer.verdict == Gap.Response.COLLIDING and answer.gap_max_m < 0, answer
    # 0.5 + 0.5 in binary: they touch
    place(room, sender, ticks, FAR | {"cube": (0, 0, 0), "ball": (1, 0, 0)})
    answer = told(room, "cube", "ball")
    assert answer.success and answer.verdict == Gap.Response.COLLIDING and answer.touching, answer


def test_the_gap_is_that_of_the_pairs_and_filters_and_budgets_do_not_change_it(room):
    sender, ticks = known(room, PATIENT, {"left": (0, 0, 0), "right": (5, 0, 0)}, ["-p", "ros.allow_edits:=true"])
    pairs = room.hear(Pairs, "/sweepd/pairs")
    poses = {"left": (0, 0, 0), "right": ((1.15, 0.1, 0.2), Z90)}
    room.until(lambda: pairs and pairs[-1].pairs and pairs[-1].pairs[0].level == 3, "their row", then=lambda: sender.send(poses))
    row, answer = pairs[-1].pairs[0], told(room, "left", "right")
    assert (answer.verdict, row.verdict) == (Gap.Response.NEAR, Gap.Response.NEAR)
    assert (answer.gap_min_m, answer.gap_max_m) == pytest.approx((row.gap_min_m, row.gap_max_m), abs=1e-12)
    revision = answer.tick_header.scene_rev
    edit = SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="right", reason="test")
    assert room.call(SetFilter, "/sweepd/set_filter", edit).success
    set_parameter(room, "budget_units", 0)
    place(room, sender, ticks, poses)
    ignored = told(room, "left", "right")
    assert ignored.success and ignored.tick_header.scene_rev > revision
    assert (ignored.gap_min_m, ignored.gap_max_m) == (answer.gap_min_m, answer.gap_max_m)


def test_what_has_no_gap_is_told_with_the_reason(room):
    room.daemon(SCENE.replace("60000", "4000"), ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    room.until(lambda: states, "the node")

    def refused(a, b, *words):
        answer = told(room, a, b)
        assert not answer.success and all(word in answer.message for word in words), (a, b, answer.message)
        assert answer.verdict == Gap.Response.NONE and math.isnan(answer.gap_best_m)
        assert (answer.gap_min_m, answer.gap_max_m) == (-math.inf, math.inf)

    refused("ball", "pea", '"ball"', "not_received")
    refused("floor", "wall", '"floor"', '"wall"', "half-space")
    sender = Sender(node)
    room.until(lambda: states[-1].word != "unknown", "known bodies", then=lambda: sender.send(FAR))
    answer = told(room, "ball", "pea")
    assert answer.success, answer.message
    refused("ball", "nobody", '"nobody"', "no body")
    refused("", "ball", "a", "bytes")
    refused("ball", "x" * 200, "b", "bytes")
    refused("ball", "ball", '"ball"')
    bad = dict(FAR, pea=((10, 0, 0), (0, 0, 0, 0)))
    room.until(lambda: "rejected" in states[-1].reason_words, "a pose refused", then=lambda: sender.send(bad))
    refused("pea", "ball", '"pea"', "rejected", "bad_quaternion")
    room.until(lambda: states[-1].word != "unknown", "known again", then=lambda: sender.send(FAR))
    assert room.call(EnableBody, "/sweepd/enable_body", EnableBody.Request(name="cube", enabled=False)).success
    refused("cube", "ball", '"cube"', "disabled")
    assert room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="cube")).success
    refused("cube", "ball", '"cube"', "no body")
    room.until(lambda: "stale" in states[-1].reason_words, "stale")
    refused("ball", "pea", '"ball"', "stale")


def test_a_held_body_is_answered_with_a_word_on_it_and_a_question_needs_no_leave(room):
    scene = HANDS.replace('name = "left"', 'name = "left"\non_stale = "hold"').replace('name = "right"', 'name = "right"\non_stale = "hold"')
    known(room, scene, {"left": (0, 0, 0), "right": (5, 0, 0)})
    states = room.hear(State, "/sweepd/state")
    room.until(lambda: states and "held" in states[-1].reason_words, "held bodies")
    answer = told(room, "left", "right")
    assert answer.success and "left" in answer.message and "held" in answer.message
    assert answer.gap_best_m == pytest.approx(4.0)


def test_a_large_mesh_is_asked_for_while_ticks_go_on(room):
    """Two waves of 20,000 triangles each, one in the other: the answer takes its time, and no tick waits for it."""
    sender, ticks = known(room, PATIENT, {"left": (0, 0, 0), "right": (5, 0, 0)}, ["-p", "ros.allow_edits:=true"])
    side = 100

    def wave(shift):
        corners = [Point(x=i * 0.01, y=j * 0.01, z=0.02 * math.sin(0.9 * i + shift) * math.cos(0.7 * j)) for i in range(side) for j in range(side)]
        faces = [face for i in range(side - 1) for j in range(side - 1)
                 for face in ((i * side + j, (i + 1) * side + j, i * side + j + 1), (i * side + j + 1, (i + 1) * side + j, (i + 1) * side + j + 1))]  # fmt: skip
        return Mesh(vertices=corners, triangles=[MeshTriangle(vertex_indices=face) for face in faces])

    for name, shift, z in (("one", 0.0, 20.0), ("other", 1.3, 20.05)):
        request = PutBody.Request(name=name, moves=False, pose=pose((0, 0, z)), meshes=[wave(shift)], mesh_poses=[pose((0, 0, 0))],
                                  options_json=json.dumps({"group": 0}))  # fmt: skip
        answer = room.call(PutBody, "/sweepd/put_body", request, seconds=60)
        assert answer.success, answer.message
    start = len(ticks)
    answer = told(room, "one", "other")
    assert answer.success and answer.verdict == Gap.Response.APART, answer
    assert 0.005 < answer.gap_min_m <= answer.gap_max_m < 0.05 and answer.gap_max_m - answer.gap_min_m < 1e-6
    room.until(lambda: len(ticks) > start + 3, "ticks")
    gaps = [b.sent_ns - a.sent_ns for a, b in zip(ticks[start:], ticks[start + 1 :])]
    assert max(gaps) < 1_000_000_000, "ticks went on"
