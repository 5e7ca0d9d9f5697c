"""What RViz and Gazebo see: `~/markers` against poses, contacts and pairs of the same tick, and `~/collisions`."""

import itertools
import math

import numpy as np
import pytest
from conftest import LATCHED
from diagnostic_msgs.msg import DiagnosticArray
from frames import Sender
from parameters import set_parameter
from ros_gz_interfaces.msg import Contacts as GzContacts
from scenes import cloud
from sweepd_msgs.msg import Contact, Contacts, Names, Pairs, State, Tick
from visualization_msgs.msg import Marker, MarkerArray

# `edge` reaches from 0 to 1 on x in its own frame: its box is not about its origin.
SCENE = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 60000
[[body]]
name = "left"
shape = { type = "box", half_extents = [1.0, 0.5, 0.25] }
[[body]]
name = "right"
report_within_m = 0.3
shape = { type = "box", half_extents = [0.5, 0.5, 0.5] }
[[body]]
name = "edge"
shape = { type = "box", half_extents = [0.5, 0.1, 0.1], position = [0.5, 0.0, 0.0] }
[[body]]
name = "floor"
moves = false
shape = { type = "half_space", normal = [0.0, 0.0, 1.0], offset = -10.0 }
"""
HALF = {"left": (1.0, 0.5, 0.25), "right": (0.5, 0.5, 0.5), "edge": (0.5, 0.1, 0.1)}
CENTRE = {"left": (0, 0, 0), "right": (0, 0, 0), "edge": (0.5, 0, 0)}
TURN = (0.0, 0.0, math.sin(0.4), math.cos(0.4))
PLAIN = (0.0, 0.0, 0.0, 1.0)
APART = {"left": ((0, 0, 0), TURN), "right": ((5, 0, 0), PLAIN), "edge": ((0, 8, 1), TURN)}
TOUCH = APART | {"right": ((1.2, 0.2, 0.1), PLAIN)}
NEAR = APART | {"left": ((0, 0, 0), PLAIN), "right": ((1.7, 0, 0), PLAIN)}

RED, ORANGE, YELLOW, GREEN, GREY, BLUE = (
    (0.9, 0.1, 0.1), (1.0, 0.6, 0.0), (0.9, 0.9, 0.1), (0.2, 0.8, 0.3), (0.5, 0.5, 0.5), (0.2, 0.4, 1.0))  # fmt: skip


def rotated(turn, vector):
    """A vector turned by x, y, z, w."""
    axis, w = np.array(turn[:3]), turn[3]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)


def edges(name, place):
    """The twelve edges of a body's box, each as a sorted pair of rounded corners."""
    position, turn = place
    out = set()
    corners = list(itertools.product((-1, 1), repeat=3))
    world = lambda signs: tuple(np.round(np.array(position) + rotated(turn, np.array(CENTRE[name]) + np.array(signs) * HALF[name]), 6) + 0.0)  # noqa: E731
    for a, b in itertools.combinations(corners, 2):
        if sum(x != y for x, y in zip(a, b)) == 1:
            out.add(tuple(sorted((world(a), world(b)))))
    return out


def drawn(marker):
    """Its lines as sorted pairs of rounded points, with their colours."""
    at = [tuple(np.round((p.x, p.y, p.z), 6) + 0.0) for p in marker.points]
    colours = [(round(c.r, 3), round(c.g, 3), round(c.b, 3)) for c in marker.colors]
    assert len(at) % 2 == 0 and (not colours or colours[::2] == colours[1::2])
    lines = [tuple(sorted(pair)) for pair in zip(at[::2], at[1::2])]
    return dict(zip(lines, colours[::2] or [None] * len(lines)))


def seen(room, ros_args=()):
    """A daemon, its sender, and what is heard of it; the stamp tells which tick a message belongs to."""
    daemon = room.daemon(SCENE, ros_args=["-p", "ros.allow_edits:=true", *ros_args])
    node = room.node()
    heard = {"markers": room.hear(MarkerArray, "/sweepd/markers"), "contacts": room.hear(Contacts, "/sweepd/contacts"),
             "pairs": room.hear(Pairs, "/sweepd/pairs"), "state": room.hear(State, "/sweepd/state")}  # fmt: skip
    sender = Sender(node)
    room.until(lambda: all(heard.values()), "a message on each topic", then=lambda: sender.send(APART))
    return daemon, sender, heard


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def shown(room, sender, heard, poses, condition=lambda layers: True):
    """Sends poses with one stamp until markers of them come; its layers by name, contacts and pairs of that stamp."""
    stamp = 7_000_000_000 + 1000 * len(heard["markers"]) + sender.seq

    def found():
        for message in reversed(heard["markers"]):
            layers = {marker.ns: marker for marker in message.markers}
            contacts = [m for m in heard["contacts"] if stamp_of(m) == stamp]
            pairs = [m for m in heard["pairs"] if stamp_of(m) == stamp]
            if stamp_of(message.markers[0]) == stamp and contacts and pairs and condition(layers):
                return layers, contacts[-1].contacts, pairs[-1].pairs
        return None

    return room.until(found, "markers of these poses", then=lambda: sender.send(poses, stamp_ns=stamp))


def test_boxes_stand_where_the_bodies_are_in_the_colour_of_their_verdict(room):
    _, sender, heard = seen(room)
    for poses, colours in [
        (APART, {"left": GREEN, "right": GREEN, "edge": GREEN}),
        (TOUCH, {"left": RED, "right": RED, "edge": GREEN}),
        (NEAR, {"left": YELLOW, "right": YELLOW, "edge": GREEN}),
    ]:
        layers, _, _ = shown(room, sender, heard, poses)
        lines = drawn(layers["boxes"])
        wanted = {line: colours[name] for name, place in poses.items() for line in edges(name, place)}
        assert lines == wanted
        assert layers["boxes"].header.frame_id == "world"
    # a body whose newest pose is refused is grey, where it was last
    bent = {**APART, "edge": ((0, 8, 1), (0.0, 0.0, 0.0, 0.0))}
    newest = lambda: drawn(heard["markers"][-1].markers[0])  # noqa: E731
    lines = room.until(lambda: (lambda lines: GREY in lines.values() and lines)(newest()), "a grey box", then=lambda: sender.send(bent))
    assert {line for line, colour in lines.items() if colour == GREY} == edges("edge", APART["edge"])


def test_points_and_normals_are_those_of_the_contacts(room):
    _, sender, heard = seen(room)
    for poses, kind, colour in [(TOUCH, Contact.CONTACT, RED), (NEAR, Contact.CLOSEST, YELLOW)]:
        layers, contacts, _ = shown(room, sender, heard, poses)
        assert contacts and {contact.kind for contact in contacts} == {kind}
        points = [(p.x, p.y, p.z) for p in layers["contact_points"].points]
        assert points == [(c.point_a.x, c.point_a.y, c.point_a.z) for c in contacts]
        colours = {(round(c.r, 3), round(c.g, 3), round(c.b, 3)) for c in layers["contact_points"].colors}
        assert colours == {colour} and len(layers["contact_points"].colors) == len(points)
        ends = [(p.x, p.y, p.z) for p in layers["normals"].points]
        assert ends[::2] == points
        for (sx, sy, sz), (ex, ey, ez), contact in zip(ends[::2], ends[1::2], contacts):
            along = (ex - sx) / 0.1, (ey - sy) / 0.1, (ez - sz) / 0.1
            assert along == pytest.approx((contact.normal.x, contact.normal.y, contact.normal.z), abs=1e-9)
        blue = layers["normals"].color
        assert (round(blue.r, 3), round(blue.g, 3), round(blue.b, 3)) == BLUE
    layers, contacts, _ = shown(room, sender, heard, APART)
    assert not contacts and not layers["contact_points"].points and not layers["normals"].points


def test_possible_pairs_are_lines_between_their_bodies_in_a_colour_of_their_own(room):
    _, sender, heard = seen(room)
    layers, _, pairs = shown(room, sender, heard, TOUCH)
    assert not layers["possible"].points and len(pairs) == 1
    # no unit of work: boxes that overlap are all that is known
    set_parameter(room, "budget_units", 0)
    moved = TOUCH | {"right": ((1.1, 0.3, 0.1), PLAIN), "left": ((0.05, 0, 0), TURN)}
    room.until(lambda: heard["pairs"][-1].pairs and heard["pairs"][-1].pairs[0].verdict in (3, 4), "the pair", then=lambda: sender.send(moved))
    apart = APART | {"right": ((1.35, 0.85, 0.0), PLAIN)}
    layers, _, pairs = shown(room, sender, heard, apart, lambda layers: layers["possible"].points)
    assert [pair.verdict for pair in pairs] == [3]
    (line,) = drawn(layers["possible"])
    assert line == tuple(sorted(tuple(np.round(apart[name][0], 6) + 0.0) for name in ("left", "right")))
    orange = layers["possible"].color
    assert (round(orange.r, 3), round(orange.g, 3), round(orange.b, 3)) == ORANGE
    assert {colour for colour in drawn(layers["boxes"]).values()} == {ORANGE, GREEN}


def test_ids_stay_lifetimes_follow_the_rate_and_lists_are_of_the_right_kind(room):
    _, sender, heard = seen(room)
    kinds = {"boxes": Marker.LINE_LIST, "contact_points": Marker.SPHERE_LIST, "normals": Marker.LINE_LIST, "possible": Marker.LINE_LIST}

    def lifetimes():
        for _ in range(12):
            sender.send(TOUCH)
            room.spin(0.05)
        return [m.lifetime.sec + m.lifetime.nanosec / 1e9 for m in heard["markers"][-1].markers]

    # Three periods of 10 Hz, and longer where ticks were rarer than that.
    times = lifetimes()
    assert len(times) == 4 and all(0.3 - 1e-6 < time < 1.5 for time in times), times
    assert len(heard["markers"]) >= 4
    for message in heard["markers"]:
        assert [(m.ns, m.id, m.type, m.action) for m in message.markers] == [(ns, 0, kind, Marker.ADD) for ns, kind in kinds.items()]
        assert all(m.pose.orientation.w == 1.0 and m.scale.x > 0 and m.color.a > 0 for m in message.markers)
    set_parameter(room, "markers_rate_hz", 2.0)
    start = len(heard["markers"])
    times = lifetimes()
    assert len(times) == 4 and all(1.5 - 1e-6 < time < 7.5 for time in times), times
    assert 1 <= len(heard["markers"]) - start <= 4, "0.6 s at 2 Hz"
    set_parameter(room, "publish_markers", False)
    room.spin(0.6)
    start = len(heard["markers"])
    for _ in range(20):
        sender.send(TOUCH)
        room.spin(0.05)
    assert len(heard["markers"]) == start, "switched off"


# A sphere of some 500 triangles, written as a file of a scene.
def ball_mesh(rings=16, sides=16):
    top, bottom = 0, 1
    corners = [(0.0, 0.0, 0.5), (0.0, 0.0, -0.5)]
    for ring in range(1, rings):
        for side in range(sides):
            up, round_ = math.pi * ring / rings, 2 * math.pi * side / sides
            corners.append((0.5 * math.sin(up) * math.cos(round_), 0.5 * math.sin(up) * math.sin(round_), 0.5 * math.cos(up)))
    at = lambda ring, side: 2 + (ring - 1) * sides + side % sides  # noqa: E731
    faces = [(top, at(1, s), at(1, s + 1)) for s in range(sides)] + [(bottom, at(rings - 1, s + 1), at(rings - 1, s)) for s in range(sides)]
    for ring in range(1, rings - 1):
        for side in range(sides):
            a, b, c, d = at(ring, side), at(ring + 1, side), at(ring + 1, side + 1), at(ring, side + 1)
            faces += [(a, b, c), (a, c, d)]
    return f'{{ type = "trimesh", vertices = {[list(c) for c in corners]}, faces = {[list(f) for f in faces]} }}'


def test_what_nobody_listens_to_is_not_computed(room):
    """All contacts of two meshes cost far more units than their verdict: the tick says what was spent."""
    ball = ball_mesh()
    room.daemon(f'[run]\non_frame = "sim"\n[[source]]\nname = "sim"\ntimeout_ms = 60000\n[[body]]\nname = "a"\nshape = {ball}\n'
                f'[[body]]\nname = "b"\nshape = {ball}\n')  # fmt: skip
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    sender = Sender(node)
    step = [0]

    def send():
        step[0] += 1
        sender.send({"a": (0, 0, 0), "b": (0.8 + 0.02 * math.sin(step[0]), 0.01 * step[0] % 0.1, 0)})

    room.until(lambda: ticks and ticks[-1].colliding == 1, "a collision", then=send)

    def spent():
        start = len(ticks)
        for _ in range(40):
            send()
            room.spin(0.02)
        units = [tick.units for tick in ticks[start:] if tick.cause == Tick.FRAME]
        return sorted(units)[len(units) // 2]

    quiet = spent()
    markers = []
    reader = node.create_subscription(MarkerArray, "/sweepd/markers", markers.append, 10)
    room.until(lambda: markers and markers[-1].markers[1].points, "markers with contacts", then=send)
    watched = spent()
    node.destroy_subscription(reader)
    room.spin(1.0)
    again = spent()
    print(f"units a tick: {quiet} unwatched, {watched} with a reader of markers, {again} after it has left")
    assert watched > 3 * quiet and again < 2 * quiet + 5
    # one that is killed says nothing: it is gone when its lease of 20 s has ended
    killed = room.python("peer_echo.py", "--seconds", 3600)
    room.until(lambda: spent() > 3 * quiet, "contacts for the reader in a process of its own", seconds=30)
    killed.kill()
    room.until(lambda: spent() < 2 * quiet + 5, "no contacts any more", seconds=60)


def test_collisions_are_off_unless_asked_and_then_those_of_the_contacts(room):
    _, sender, heard = seen(room)
    names = room.hear(Names, "/sweepd/names", LATCHED)
    collisions = room.hear(GzContacts, "/sweepd/collisions")
    for _ in range(20):
        sender.send(TOUCH)
        room.spin(0.05)
    assert not collisions, "off by default"
    set_parameter(room, "publish_collisions", True)
    stamp = 9_000_000_123

    def both():
        ours = [m for m in collisions if stamp_of(m) == stamp]
        theirs = [m for m in heard["contacts"] if stamp_of(m) == stamp]
        return ours and theirs and (ours[-1], theirs[-1].contacts)

    said, contacts = room.until(both, "collisions", then=lambda: sender.send(TOUCH, stamp_ns=stamp))
    assert said.header.frame_id == "world" and len(said.contacts) == 1, "one pair collides"
    (one,) = said.contacts
    ids = {name.name: name.body for message in names for name in message.names}
    assert [(entity.name, entity.id) for entity in (one.collision1, one.collision2)] == [(name, ids[name]) for name in ("left", "right")]
    assert len(contacts) > 1 and len(one.positions) == len(one.normals) == len(one.depths) == len(contacts)
    for contact, position, normal, depth in zip(contacts, one.positions, one.normals, one.depths):
        middle = [(getattr(contact.point_a, k) + getattr(contact.point_b, k)) / 2 for k in "xyz"]
        assert [position.x, position.y, position.z] == pytest.approx(middle, abs=1e-12)
        assert (normal.x, normal.y, normal.z) == (contact.normal.x, contact.normal.y, contact.normal.z)
        assert depth == -contact.gap_m and depth > 0
    # a near pair has closest points, and those are no collision
    stamp = 9_000_000_456
    said, contacts = room.until(both, "collisions of a near pair", then=lambda: sender.send(NEAR, stamp_ns=stamp))
    assert contacts and not said.contacts
    set_parameter(room, "publish_collisions", False)
    room.spin(0.5)
    start = len(collisions)
    for _ in range(10):
        sender.send(TOUCH)
        room.spin(0.05)
    assert len(collisions) == start


def test_what_is_not_drawn_and_what_collisions_leave_out_is_told(room):
    """Thirty spheres in one place: 435 contacts, of which 300 are shown."""
    room.daemon(cloud(100), ros_args=["-p", "publish_collisions:=true"])
    node = room.node()
    sender = Sender(node)
    together = {f"b{n:04}": (0.001 * n if n < 30 else 10.0 * n, 0, 0) for n in range(100)}
    feed = lambda: sender.send(together)  # noqa: E731
    shown = room.hear(MarkerArray, "/sweepd/markers")
    collisions, said = room.hear(GzContacts, "/sweepd/collisions"), room.hear(DiagnosticArray, "/diagnostics")
    notes = lambda: [m.text for m in shown[-1].markers if m.ns == "left_out"] if shown else []  # noqa: E731
    room.until(lambda: "300 of 435 contact points" in "".join(notes()), "a text with the contacts", then=feed)
    assert "80 of 100 boxes" in notes()[0]
    (note,) = [m for m in shown[-1].markers if m.ns == "left_out"]
    assert note.type == Marker.TEXT_VIEW_FACING and note.color.a > 0 and note.scale.z > 0
    room.until(lambda: collisions and sum(len(c.depths) for c in collisions[-1].contacts) == 300, "300 contacts", then=feed)
    room.until(lambda: any("135 contacts are left out of ~/collisions" in s.message for m in said[-2:] for s in m.status), "a word on the rest",
               then=feed)  # fmt: skip
    depths = sorted(depth for contact in collisions[-1].contacts for depth in contact.depths)
    assert depths[0] > 0.98, "spheres of 1 m within 3 cm: the deepest are kept"
