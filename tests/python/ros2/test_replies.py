"""Answers of services that are larger than what DDS brings to their clients: each comes, cut short, what is missing is told
on /rosout, and the same client has the next answer. Beside an interface as a VPN has it, where a network can be had.
"""

import subprocess

import pytest
from conftest import LATCHED
from frames import pose
from geometry_msgs.msg import Point
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from parameters import value
from rcl_interfaces.msg import Parameter
from rclpy.serialization import serialize_message
from scenes import HANDS
from shape_msgs.msg import Mesh, MeshTriangle
from sweepd_msgs.msg import Names
from sweepd_msgs.srv import PutBody

# What there is room for; its sender counts the strings of a value a byte less.
BYTES_MAX = 1152 * 1.2
# As many as a scene may have beside one, with the longest names.
SOURCES = "".join(f'[[source]]\nname = "a_source_with_a_long_long_na_{n:02}"\n' for n in range(15))


class Asker:
    """One client of a service, kept."""

    def __init__(self, room, kind, name):
        self._room, self._kind = room, kind
        self._client = room.nodes[0].create_client(kind, name)
        room.until(self._client.service_is_ready, name)
        room.spin(1.0)

    def ask(self, **fields):
        future = self._client.call_async(self._kind.Request(**fields))
        self._room.until(future.done, f"an answer of {self._kind.__name__} to {len(str(fields))} characters")
        answer = future.result()
        assert len(serialize_message(answer)) <= BYTES_MAX
        return answer


@pytest.fixture
def desk(room):
    if room.private:
        for words in ["link add cable type veth peer name cable2", "addr add 10.78.0.1/24 dev cable", "link set cable mtu 1280 up",
                      "link set cable2 up"]:  # fmt: skip
            subprocess.run(["ip", *words.split()], check=True)
    scene = HANDS.replace("shape = { type", 'source = "sim"\nshape = { type', 2) + SOURCES
    room.daemon(scene, ros_args=["-p", "ros.allow_edits:=true"])
    room.node()
    log = room.hear(Log, "/rosout", LATCHED)

    def told(*parts):
        said = [m for m in log if all(part in m.msg for part in parts)]
        return said and all(m.level == Log.ERROR and m.name == "sweepd" for m in said)

    return room, told


def test_bug_answers_about_many_parameters_come_cut_short_and_the_next_come_too(desk):
    room, told = desk
    get = Asker(room, GetParameters, "/sweepd/get_parameters")
    assert len(get.ask(names=["budget_ms"]).values) == 1
    values = get.ask(names=["budget_ms"] * 100).values
    assert 20 <= len(values) < 100 and all(one.type == 3 for one in values)
    room.until(lambda: told("~/get_parameters", f"the first {len(values)} of 100 values"), "the error")
    assert len(get.ask(names=["budget_ms"]).values) == 1, "the same client goes on"
    listing = Asker(room, ListParameters, "/sweepd/list_parameters")
    names = listing.ask().result.names
    assert {"budget_ms", "use_sim_time"} <= set(names) and len(names) == len(set(names)) >= 28, "all names fit"
    assert list(listing.ask(prefixes=["timeout_ms.sim"]).result.names) == ["timeout_ms.sim"]
    describe = Asker(room, DescribeParameters, "/sweepd/describe_parameters")
    asked = ["budget_ms", "markers_rate_hz", "ros_max_contacts", "mode", "ros.allow_edits", "use_sim_time", "max_skew_ms"]
    told_of = describe.ask(names=asked).descriptors
    assert [one.name for one in told_of] == asked and told_of[1].floating_point_range[0].to_value == 100.0
    room.until(lambda: told("~/describe_parameters"), "the error")
    assert describe.ask(names=["mode"]).descriptors[0].additional_constraints
    give = Asker(room, SetParameters, "/sweepd/set_parameters")
    wrong = [Parameter(name=f"no_such_parameter_{n}", value=value(1)) for n in range(20)]
    assert [one.successful for one in give.ask(parameters=wrong).results] == [False] * 20
    room.until(lambda: told("~/set_parameters", "no_such_parameter_19"), "the reasons")


def test_bug_an_edit_with_many_warnings_is_answered(desk):
    room, told = desk
    names = room.hear(Names, "/sweepd/names", LATCHED)
    put = Asker(room, PutBody, "/sweepd/put_body")
    corners = [Point(x=float(x), y=float(y)) for x in (0, 1) for y in (0, 1)]
    for number, count in enumerate([1, 40, 1]):
        open_mesh = Mesh(vertices=[*corners, Point(x=9.0)], triangles=[MeshTriangle(vertex_indices=[0, 1, 2])])
        at = [pose((50.0 + 10 * number, 0, n)) for n in range(count)]
        answer = put.ask(name=f"open{number}", moves=False, pose=pose((0, 0, 0)), meshes=[open_mesh] * count, mesh_poses=at)
        assert answer.success, answer.message
        room.until(lambda: names and any(f"open{number}" in {n.name for n in m.names} for m in names), "the body")
        if count > 1:
            assert "more: /rosout has them" in answer.warnings[-1]
            room.until(lambda: told("~/put_body", "open1"), "the warnings")


def test_the_logger_has_the_name_of_the_node_in_its_namespace(room):
    room.daemon(HANDS, ros_args=["-r", "__ns:=/cell", "-r", "__node:=sw"])
    room.node()
    log = room.hear(Log, "/rosout", LATCHED)
    room.until(lambda: [m for m in log if m.name == "cell.sw"], "a word of it")
