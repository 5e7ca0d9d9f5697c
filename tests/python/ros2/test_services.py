"""Scene edits and questions over ROS 2 services."""

import json

import pytest
from conftest import LATCHED
from frames import Sender, pose
from rcl_interfaces.msg import Log
from scenes import HANDS
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from geometry_msgs.msg import Point
from sweepd_msgs.msg import Names, Pairs, State, Tick
from sweepd_msgs.srv import AttachBody, EnableBody, Gap, PutBody, RemoveBody, Reset, SetFilter, TickNow

CLOSE = {"left": (0, 0, 0), "right": (0.5, 0, 0)}
FAR = {"left": (0, 0, 0), "right": (5, 0, 0)}


@pytest.fixture
def scene(room):
    room.daemon(HANDS, ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    sender = Sender(node)
    room.until(lambda: states and states[-1].word == "colliding", "a collision", then=lambda: sender.send(CLOSE))
    return room, sender, states


def still(x, **more):
    box = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.4, 0.4, 0.4])
    return PutBody.Request(moves=False, pose=pose((x, 0, 0)), primitives=[box], primitive_poses=[pose((0, 0, 0))], **more)


def test_edits_are_refused_unless_the_scene_allows_them(room):
    room.daemon(HANDS)
    room.node()
    for kind, request in [
        (PutBody, still(0, name="crate")), (RemoveBody, RemoveBody.Request(name="left")),
        (EnableBody, EnableBody.Request(name="left")), (AttachBody, AttachBody.Request(name="left", to="right")),
        (SetFilter, SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="right")), (Reset, Reset.Request()),
    ]:  # fmt: skip
        name = "".join(("_" if c.isupper() else "") + c.lower() for c in kind.__name__).lstrip("_")
        answer = room.call(kind, f"/sweepd/{name}", request)
        assert not answer.success and "allow_edits" in answer.message, name


def test_bodies_are_put_disabled_attached_and_removed(scene):
    room, sender, states = scene
    names = room.hear(Names, "/sweepd/names", LATCHED)
    ticks = room.hear(Tick, "/sweepd/tick")
    # 0.6 away from the left hand's surface
    answer = room.call(PutBody, "/sweepd/put_body", still(-1.3, name="crate", options_json=json.dumps({"report_within_m": 0.7})))
    assert answer.success, answer.message
    room.until(lambda: names and "crate" in {n.name for n in names[-1].names}, "the name of the new body", then=lambda: sender.send(FAR))
    state = room.until(lambda: states[-1].word == "near" and states[-1], "near the crate", then=lambda: sender.send(FAR))
    assert {state.worst_name_a, state.worst_name_b} == {"crate", "left"}
    assert room.call(EnableBody, "/sweepd/enable_body", EnableBody.Request(name="crate", enabled=False)).success
    room.until(lambda: states[-1].word == "clear", "clear without it", then=lambda: sender.send(FAR))
    assert room.call(EnableBody, "/sweepd/enable_body", EnableBody.Request(name="crate", enabled=True)).success
    room.until(lambda: states[-1].word == "near", "near again", then=lambda: sender.send(FAR))
    hung = AttachBody.Request(name="crate", to="right", pose=pose((0, 0, 2)))
    answer = room.call(AttachBody, "/sweepd/attach_body", hung)
    assert answer.success, answer.message
    assert room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="crate")).success
    room.until(lambda: "crate" not in {n.name for n in names[-1].names}, "the name gone", then=lambda: sender.send(FAR))
    answer = room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="crate"))
    assert not answer.success and "crate" in answer.message
    room.until(lambda: ticks, "a tick")
    assert ticks[-1].receipts_undecodable == 0


def test_each_field_of_an_edit_does_what_it_says(scene):
    room, sender, states = scene
    ticks = room.hear(Tick, "/sweepd/tick")
    place = {**FAR}
    feed = lambda: sender.send(place)  # noqa: E731
    room.until(lambda: states[-1].word == "clear" and ticks, "clear", then=feed)

    def edit(kind, name, request, warned=()):
        """Until a tick has it; the answer."""
        # a source that is silent meanwhile has no bodies whose place is known
        answer = room.call(kind, f"/sweepd/{name}", request, then=feed)
        assert answer.success and answer.message == "", answer.message
        assert len(answer.warnings) == len(warned) and all(word in text for word, text in zip(warned, answer.warnings)), answer.warnings
        room.until(lambda: ticks[-1].tick_header.scene_rev >= answer.scene_rev, "its revision", then=feed)
        return answer.scene_rev

    def gap(a, b, wanted):
        """Until the two are so far apart: the shape, and where it stands. A source that is silent has no gaps."""
        ask = lambda: room.call(Gap, "/sweepd/gap", Gap.Request(name_a=a, name_b=b), then=feed).gap_best_m  # noqa: E731
        room.until(lambda: abs(ask() - wanted) < 1e-9, f"{wanted} m between {a} and {b}", then=feed)

    def primitive(name, kind, dimensions, at, warned=()):
        shape = SolidPrimitive(type=kind, dimensions=dimensions)
        request = PutBody.Request(name=name, moves=False, pose=pose(at), primitives=[shape], primitive_poses=[pose((0, 0, 0))])
        return edit(PutBody, "put_body", request, warned)

    # the hands are balls of 0.5 m; heights and radii are not mixed up, and the cone's tip is up
    revisions = [primitive("ball", SolidPrimitive.SPHERE, [0.25], (0, 0, 3))]
    gap("left", "ball", 2.25)
    revisions.append(primitive("drum", SolidPrimitive.CYLINDER, [1.0, 0.3], (0, 3, 0)))
    gap("left", "drum", 2.2)
    revisions.append(primitive("hat", SolidPrimitive.CONE, [0.8, 0.4], (0, 0, -3)))
    gap("left", "hat", 2.1)
    assert revisions == sorted(set(revisions))
    assert primitive("hat", SolidPrimitive.CONE, [0.8, 0.4], (0, 0, -3)) == revisions[-1], "the same content again changes nothing"
    primitive("grain", SolidPrimitive.SPHERE, [2e-4], (0, 9, 0), warned=["grain"])
    # hung where it is, it goes along; hung at a pose, it stands there; let go, it stays
    edit(AttachBody, "attach_body", AttachBody.Request(name="drum", to="right", keep_pose=True, pose=pose((7, 7, 7))))
    gap("left", "drum", 2.2)
    place["right"] = (5, 1, 0)
    gap("left", "drum", 3.2)
    edit(AttachBody, "attach_body", AttachBody.Request(name="hat", to="right", pose=pose((0, 0, 2))))
    gap("right", "hat", 1.1)
    edit(AttachBody, "attach_body", AttachBody.Request(name="hat", to="", pose=pose((0, 0, -3))))
    # a rule behind all others wins
    place["right"] = (0.5, 0, 0)
    room.until(lambda: states[-1].word == "colliding", "a collision", then=feed)
    edit(SetFilter, "set_filter", SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="r*", reason="test"))
    room.until(lambda: states[-1].word == "clear", "ignored", then=feed)
    edit(SetFilter, "set_filter", SetFilter.Request(action=SetFilter.Request.CHECK, a="left", b="right", reason="test"))
    room.until(lambda: states[-1].word == "colliding", "checked again", then=feed)
    assert ticks[-1].receipts_undecodable == 0


def test_each_edit_is_logged_done_or_refused(scene):
    room, _, _ = scene
    logs = room.hear(Log, "/rosout")
    said = lambda level, *words: any(log.name == "sweepd" and log.level == level and all(w in log.msg for w in words) for log in logs)  # noqa: E731
    room.until(lambda: not room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="nobody")).success
               and said(Log.WARN, "was refused", "nobody"), "a line on a refused edit")  # fmt: skip
    hung = AttachBody.Request(name="right", to="left", pose=pose((0, 0, 2)))
    ignore = SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="right", reason="test")
    for kind, request, words in [
        (PutBody, still(-1.3, name="crate"), ("put", "crate")), (EnableBody, EnableBody.Request(name="crate"), ("enable", "crate")),
        (SetFilter, ignore, ("left", "right")), (Reset, Reset.Request(source="sim"), ("reset", "sim")),
        (AttachBody, hung, ("attach", "right")), (RemoveBody, RemoveBody.Request(name="crate"), ("remove", "crate")),
    ]:  # fmt: skip
        name = "".join(("_" if c.isupper() else "") + c.lower() for c in kind.__name__).lstrip("_")
        answer = room.call(kind, f"/sweepd/{name}", request)
        assert answer.success, (name, answer.message)
        room.until(lambda: said(Log.INFO, "edit over ROS 2", *words), f"a line on {words}")


def test_the_end_of_a_removed_bodys_pair_has_both_names(scene):
    room, sender, _ = scene
    pairs = room.hear(Pairs, "/sweepd/pairs")
    room.until(lambda: pairs and any(p.verdict == p.COLLIDING for p in pairs[-1].pairs), "the pair", then=lambda: sender.send(CLOSE))
    assert room.call(RemoveBody, "/sweepd/remove_body", RemoveBody.Request(name="left")).success
    ends = lambda: [p for m in pairs for p in m.pairs if p.events & p.END]  # noqa: E731
    (end,) = room.until(ends, "its end", then=lambda: sender.send({"right": (0.5, 0, 0)}))
    assert (end.name_a, end.name_b, end.end_cause) == ("left", "right", end.END_REMOVED)


def test_a_mesh_is_put_and_wrong_shapes_are_refused_with_the_reason(scene):
    room, sender, states = scene
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    mesh = Mesh(vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in corners],
                triangles=[MeshTriangle(vertex_indices=face) for face in faces])  # fmt: skip
    request = PutBody.Request(name="wedge", moves=False, pose=pose((4.7, 0, -0.2)), meshes=[mesh], mesh_poses=[pose((0, 0, 0))])
    answer = room.call(PutBody, "/sweepd/put_body", request)
    assert answer.success, answer.message
    room.until(lambda: states[-1].word == "colliding" and {states[-1].worst_name_a, states[-1].worst_name_b} == {"right", "wedge"},
               "the wedge is met", then=lambda: sender.send(FAR))  # fmt: skip
    bad = [
        (dict(primitives=[SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[1.0, 2.0])], primitive_poses=[pose((0, 0, 0))]), "dimensions"),
        (dict(primitives=[SolidPrimitive(type=SolidPrimitive.PRISM, dimensions=[1.0])], primitive_poses=[pose((0, 0, 0))]), "prism"),
        (dict(primitives=[SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[1.0])]), "primitive_poses"),
        (dict(), "shape"),
        (dict(options_json="{"), "options_json"),
        (dict(options_json='{"name": "x"}'), "name"),
    ]
    for fields, word in bad:
        answer = room.call(PutBody, "/sweepd/put_body", PutBody.Request(name="bad", moves=False, **fields))
        assert not answer.success and word in answer.message.lower(), (fields, answer.message)


def test_filters_and_reset_end_pairs_with_their_causes(scene):
    room, sender, states = scene
    pairs = room.hear(Pairs, "/sweepd/pairs")
    room.until(lambda: pairs and pairs[-1].pairs, "the pair", then=lambda: sender.send(CLOSE))
    ignore = SetFilter.Request(action=SetFilter.Request.IGNORE, a="left", b="right", reason="test")
    assert room.call(SetFilter, "/sweepd/set_filter", ignore).success
    room.until(lambda: any(p.end_cause == p.END_FILTERED for m in pairs for p in m.pairs), "an end with cause filtered",
               then=lambda: sender.send(CLOSE))  # fmt: skip
    room.until(lambda: states[-1].word == "clear", "clear", then=lambda: sender.send(CLOSE))
    drop = SetFilter.Request(action=SetFilter.Request.DROP, a="left", b="right")
    assert room.call(SetFilter, "/sweepd/set_filter", drop).success
    room.until(lambda: states[-1].word == "colliding", "colliding again", then=lambda: sender.send(CLOSE))
    masks = SetFilter.Request(action=SetFilter.Request.MASKS, a="left", group=2, mask=2)
    assert room.call(SetFilter, "/sweepd/set_filter", masks).success
    room.until(lambda: states[-1].word == "clear", "clear by masks", then=lambda: sender.send(CLOSE))
    masks.group, masks.mask = 1, 2**32 - 1
    assert room.call(SetFilter, "/sweepd/set_filter", masks).success
    room.until(lambda: states[-1].word == "colliding", "colliding again", then=lambda: sender.send(CLOSE))
    assert room.call(Reset, "/sweepd/reset", Reset.Request(source="sim")).success
    room.until(lambda: any(p.end_cause == p.END_RESET for m in pairs for p in m.pairs), "an end with cause reset")
    assert not room.call(Reset, "/sweepd/reset", Reset.Request(source="nobody")).success


def test_a_tick_is_made_and_answered_at_once(scene):
    room, _, states = scene
    first = room.call(TickNow, "/sweepd/tick_now")
    second = room.call(TickNow, "/sweepd/tick_now")
    assert first.success and second.tick_header.tick > first.tick_header.tick
    assert second.word in ("colliding", "unknown")
    room.until(lambda: any(s.tick_header.tick == second.tick_header.tick for s in states), "that tick is published too")
