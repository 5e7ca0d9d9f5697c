"""Poses from topics of common types: /tf, PoseStamped, Odometry; what they may do wrong is told."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from frames import Sender, pose
from geometry_msgs.msg import PoseStamped, TransformStamped
from parameters import set_parameter
from sweepd_msgs.msg import Contacts, Pairs, State, Tick
from tf2_msgs.msg import TFMessage
from topics import SCENE, Feeder
from visualization_msgs.msg import MarkerArray

@pytest.fixture
def fed(room):
    room.daemon(SCENE)
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    feeder = Feeder(room, node)
    room.until(lambda: states and states[-1].word == "clear", "clear: every body is known", then=feeder)
    return room, feeder, states


def bodies(room, reader, names):
    room.spin(0.05)
    result = reader.latest()
    while result is None or result.bodies is None:
        result = reader.wait()
    by_id = {int(row["body"]): row for row in result.bodies}
    return {name: by_id[reader.names[name]] for name in names}


def test_all_kinds_of_topics_move_their_bodies_and_chains_are_composed(fed):
    room, feeder, states = fed
    reader = room.client(None, listen=("bodies",))
    ticks = room.hear(Tick, "/sweepd/tick")
    # base at 0; mount 0.5 above; elbow 0.5 above that, turned a quarter about z; tip 0.5 along the turned x
    wanted = {"base": (0, 0, 0), "hand": (0, 0.5, 1.0), "person": (2, 0, 0), "cart": (3, 0, 0), "box": (4, 0, 0)}

    def arrived():
        there = bodies(room, reader, wanted)
        return all(there[name]["position"] == pytest.approx(at, abs=1e-12) for name, at in wanted.items())

    room.until(arrived, "the poses as sent", then=feeder)
    there = bodies(room, reader, wanted)
    half = math.sqrt(0.5)
    assert there["hand"]["orientation"].tolist() == pytest.approx([0, 0, half, half], abs=1e-12)
    feeder.x |= {"base": 1.95}
    state = room.until(lambda: states[-1].word == "colliding" and states[-1], "base meets person", then=feeder)
    assert {state.worst_name_a, state.worst_name_b} == {"base", "person"}
    room.until(lambda: ticks, "a tick", then=feeder)
    assert ticks[-1].receipts_undecodable == 0


def test_the_stamp_of_every_message_is_that_of_the_oldest_pose_used(fed):
    room, feeder, states = fed
    heard = {topic: room.hear(kind, f"/sweepd/{topic}", keep=lambda m: stamps(m))
             for topic, kind in (("state", State), ("tick", Tick), ("pairs", Pairs), ("contacts", Contacts), ("markers", MarkerArray))}  # fmt: skip
    # base and person touch, so that there are rows; the person's poses are 100 ms old when they are sent
    feeder.x |= {"base": 1.95}
    feeder.shift_ns = {"person": -100_000_000}

    def told():
        rows = heard["tick"][-1:]
        return rows and rows[0][2] - rows[0][1] >= 80_000_000 and all(heard[topic] for topic in heard)

    room.until(told, "a tick of poses of different ages", then=feeder)
    ranges = {oldest: newest for _, oldest, newest in heard["tick"]}
    for topic in ("state", "tick", "pairs", "contacts"):
        assert all(stamp == oldest for stamp, oldest, _ in heard[topic]), topic
    for _ in range(20):
        feeder()
        room.spin(0.02)
    shown = {stamp for stamp, *_ in heard["markers"][-3:]}
    ranges |= {oldest: newest for _, oldest, newest in heard["tick"]}
    assert shown and shown <= set(ranges), "markers too are stamped by the oldest pose of a tick"


def stamps(message):
    """The stamp of a message, and the oldest and newest of its tick, nanoseconds."""
    head = getattr(message, "tick_header", None)
    header = message.markers[0].header if head is None else message.header
    stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
    return (stamp, head.oldest_stamp_ns, head.newest_stamp_ns) if head else (stamp, None, None)


@pytest.mark.parametrize("who", ["person", "cart", "box", "base", "elbow"])
def test_a_body_whose_topic_falls_silent_is_stale_and_only_that_one(fed, who):
    room, feeder, states = fed
    feeder.skip = {who}
    state = room.until(lambda: states[-1].word == "unknown" and states[-1], f"{who} unknown", then=feeder)
    # a link of /tf that stays behind the others is out of step before it is too old
    assert {"stale", "rejected"} & set(state.reason_words) if who in ("base", "elbow") else state.reason_words == ["stale"]
    feeder.skip = set()
    room.until(lambda: states[-1].word == "clear", "clear again", then=feeder)


def test_stamps_too_far_apart_along_a_chain_make_the_body_unknown_and_are_published(fed):
    room, feeder, states = fed
    ticks = room.hear(Tick, "/sweepd/tick")
    feeder.shift_ns = {"elbow": -150_000_000}
    room.until(lambda: ticks and 0.1 < ticks[-1].tf_skew_s < 0.2, "a skew below the limit is published", then=feeder)
    assert states[-1].word == "clear"
    feeder.shift_ns = {"elbow": -400_000_000}
    room.until(lambda: states[-1].word == "unknown", "unknown above the limit", then=feeder)
    feeder.shift_ns = {}
    room.until(lambda: states[-1].word == "clear", "clear again", then=feeder)


def test_a_link_that_is_stamped_ahead_on_purpose_needs_a_wider_max_skew(room):
    """As AMCL stamps map to odom: a second ahead, by its transform_tolerance."""
    room.daemon(SCENE, ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    states, said = room.hear(State, "/sweepd/state"), room.hear(DiagnosticArray, "/diagnostics")
    feeder = Feeder(room, node)
    feeder.shift_ns = {"base": 10**9}
    room.until(lambda: any("body hand" in s.message and "stamped ahead on purpose" in s.message for m in said[-2:] for s in m.status),
               "a word on what to raise", then=feeder)  # fmt: skip
    assert states[-1].word == "unknown" and "rejected" in states[-1].reason_words
    set_parameter(room, "max_skew_ms", 1200.0)
    room.until(lambda: states[-1].word == "clear", "clear with it", then=feeder)


def test_a_source_over_shared_memory_and_sources_over_ros_2_move_bodies_of_one_scene(fed):
    room, feeder, states = fed
    feeder.skip = {"box"}
    room.until(lambda: states[-1].word == "unknown", "the box is stale", then=feeder)
    client = room.client("sim", listen=())
    at = [4.0]

    def both():
        feeder()
        client.send({"box": ((at[0], 0, 0), (0, 0, 0, 1))})

    room.until(lambda: states[-1].word == "clear", "clear: the box comes over shared memory", then=both)
    at[0] = 2.05
    state = room.until(lambda: states[-1].word == "colliding" and states[-1], "the box meets person", then=both)
    assert {state.worst_name_a, state.worst_name_b} == {"box", "person"}


def test_links_come_from_another_topic_where_the_scene_says_so(room):
    """As Gazebo's bridge sends poses of models: a TFMessage, not on /tf."""
    room.daemon('frame_id = "world"\n[run]\nrate = 50\n[[source]]\nname = "gz"\ntimeout_ms = 500\n'
                'ros2 = { type = "tf", topic = "/model/robot/pose" }\n'
                '[[body]]\nname = "robot"\nsource = "gz"\nshape = { type = "sphere", radius = 0.1 }\n')  # fmt: skip
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    reader = room.client(None, listen=("bodies",))
    ours, others = (node.create_publisher(TFMessage, topic, 10) for topic in ("/model/robot/pose", "/tf"))

    def send():
        for publisher, x in ((ours, 1.5), (others, 9.0)):
            link = TransformStamped(child_frame_id="robot")
            link.header.frame_id = "world"
            link.header.stamp = node.get_clock().now().to_msg()
            link.transform.translation.x, link.transform.rotation.w = x, 1.0
            publisher.publish(TFMessage(transforms=[link]))

    room.until(lambda: states and states[-1].word == "clear", "clear: the robot is known", then=send)
    for _ in range(20):
        send()
        assert bodies(room, reader, ["robot"])["robot"]["position"].tolist() == [1.5, 0, 0]


def test_fixed_links_that_were_sent_before_the_daemon_came_are_taken(room):
    node = room.node()
    feeder = Feeder(room, node)
    feeder()
    room.spin(1.0)
    room.daemon(SCENE)
    states = room.hear(State, "/sweepd/state")
    # the hand hangs on a link that is said once, before
    room.until(lambda: states and states[-1].word == "clear", "clear: every body is known", then=feeder)


def test_a_pose_in_another_frame_than_the_scenes_is_refused_and_told(fed):
    room, feeder, states = fed
    said = room.hear(DiagnosticArray, "/diagnostics")
    feeder.skip = {"person"}

    def lost():
        feeder()
        message = PoseStamped(pose=pose((2, 0, 0)))
        message.header.frame_id = "somewhere"
        feeder.stamp(message.header, "person")
        feeder.person.publish(message)

    room.until(lambda: states[-1].word == "unknown", "unknown", then=lost)
    room.until(lambda: any("somewhere" in str(message) for message in said), "a word on the frame", then=lost)


@pytest.mark.parametrize("run", ['on_frame = "tf"', 'on_frame = "poses"'])
def test_lockstep_on_topics_body_by_body_is_refused_with_the_reason(room, run):
    daemon = room.daemon(SCENE.replace("rate = 50", run))
    assert daemon.refusal() == 2
    assert "on_frame" in daemon.log and "whole frame" in daemon.log
