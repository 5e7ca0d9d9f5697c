"""Poses from topics of common types: /tf, PoseStamped, Odometry; what they may do wrong is told."""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from conftest import LATCHED
from frames import Sender, pose
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from sweepd_msgs.msg import BodyTransforms, State, Tick
from tf2_msgs.msg import TFMessage

SCENE = """
frame_id = "world"
[run]
rate = 50
[[source]]
name = "tf"
timeout_ms = 500
ros2 = { type = "tf", max_skew_ms = 200 }
[[source]]
name = "poses"
timeout_ms = 500
ros2 = { type = "pose" }
[[source]]
name = "odom"
timeout_ms = 500
ros2 = { type = "odometry" }
[[source]]
name = "sim"
timeout_ms = 500
[[body]]
name = "base"
source = "tf"
shape = { type = "sphere", radius = 0.1 }
[[body]]
name = "hand"
source = "tf"
ros_frame = "arm_tip"
shape = { type = "sphere", radius = 0.1 }
[[body]]
name = "person"
source = "poses"
ros_topic = "/tracker/person"
shape = { type = "sphere", radius = 0.1 }
[[body]]
name = "cart"
source = "odom"
ros_topic = "/cart/odom"
shape = { type = "sphere", radius = 0.1 }
[[body]]
name = "box"
source = "sim"
shape = { type = "sphere", radius = 0.1 }
"""


def ns(clock):
    return clock.sec * 10**9 + clock.nanosec


class Feeder:
    """Sends a set of poses on all four kinds of topics; each can be bent or left out."""

    def __init__(self, room, node):
        self.room, self.node = room, node
        self.tf = node.create_publisher(TFMessage, "/tf", 10)
        self.fixed = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        self.person = node.create_publisher(PoseStamped, "/tracker/person", 10)
        self.cart = node.create_publisher(Odometry, "/cart/odom", 10)
        self.sim = Sender(node)
        self.x = {"base": 0.0, "person": 2.0, "cart": 3.0, "box": 4.0}
        self.skip = set()
        self.shift_ns = {}
        self.fixed.publish(TFMessage(transforms=[self.link("mount", "base", (0.0, 0.0, 0.5), stamp_ns=0),
                                                 self.link("arm_tip", "elbow", (0.5, 0.0, 0.0), stamp_ns=0)]))  # fmt: skip

    def link(self, child, parent, at, turn=(0.0, 0.0, 0.0, 1.0), stamp_ns=None):
        out = TransformStamped(child_frame_id=child)
        out.header.frame_id = parent
        self.stamp(out.header, child, stamp_ns)
        placed = pose(at, turn)
        out.transform.translation.x, out.transform.translation.y, out.transform.translation.z = at
        out.transform.rotation = placed.orientation
        return out

    def stamp(self, header, who, stamp_ns=None):
        stamp_ns = time.time_ns() + self.shift_ns.get(who, 0) if stamp_ns is None else stamp_ns
        header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 10**9)

    def __call__(self):
        half = math.sqrt(0.5)
        links = [
            self.link("base", "world", (self.x["base"], 0.0, 0.0)),
            self.link("elbow", "mount", (0.0, 0.0, 0.5), (0.0, 0.0, half, half)),
        ]
        self.tf.publish(TFMessage(transforms=[one for one in links if one.child_frame_id not in self.skip]))
        if "person" not in self.skip:
            message = PoseStamped(pose=pose((self.x["person"], 0.0, 0.0)))
            message.header.frame_id = "world"
            self.stamp(message.header, "person")
            self.person.publish(message)
        if "cart" not in self.skip:
            message = Odometry(child_frame_id="cart_link")
            message.header.frame_id = "world"
            message.pose.pose = pose((self.x["cart"], 0.0, 0.0))
            message.twist.twist.linear.x = 1.5
            self.stamp(message.header, "cart")
            self.cart.publish(message)
        if "box" not in self.skip:
            self.sim.send({"box": (self.x["box"], 0.0, 0.0)})


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


def test_a_loop_in_tf_makes_the_body_unknown_and_is_told(fed):
    room, feeder, states = fed
    said = room.hear(DiagnosticArray, "/diagnostics")
    feeder.skip = {"elbow"}

    def looped():
        feeder()
        feeder.tf.publish(TFMessage(transforms=[feeder.link("elbow", "arm_tip", (0.0, 0.0, 0.5))]))

    room.until(lambda: states[-1].word == "unknown", "unknown", then=looped)
    room.until(lambda: any("loop" in str(message) for message in said[-3:]), "a word on the loop", then=looped)
    feeder.skip = set()
    room.until(lambda: states[-1].word == "clear", "clear again", then=feeder)


def test_a_frame_that_never_appears_is_told(room):
    room.daemon(SCENE)
    node = room.node()
    states = room.hear(State, "/sweepd/state")
    said = room.hear(DiagnosticArray, "/diagnostics")
    feeder = Feeder(room, node)
    feeder.skip = {"elbow"}
    room.until(lambda: any("hand" in str(m) or "arm_tip" in str(m) for m in said), "a word on the missing frame", then=feeder)
    assert "clear" not in {state.word for state in states} and "not_received" in states[-1].reason_words


def test_a_quaternion_of_zeros_is_refused_and_the_body_unknown(fed):
    room, feeder, states = fed
    ticks = room.hear(Tick, "/sweepd/tick")
    feeder.skip = {"person"}

    def bent():
        feeder()
        message = PoseStamped(pose=pose((2, 0, 0), (0, 0, 0, 0)))
        message.header.frame_id = "world"
        feeder.stamp(message.header, "person")
        feeder.person.publish(message)

    room.until(lambda: states[-1].word == "unknown" and "rejected" in states[-1].reason_words, "unknown: rejected", then=bent)
    room.until(lambda: ticks and ticks[-1].rejects[Tick.REJECT_BAD_QUATERNION], "counted by its reason", then=bent)
    feeder.skip = set()
    room.until(lambda: states[-1].word == "clear", "clear again", then=feeder)


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


def test_a_body_fed_by_two_topics_is_told_and_its_own_source_wins(fed):
    room, feeder, states = fed
    ticks = room.hear(Tick, "/sweepd/tick")
    other = Sender(feeder.node)

    def both():
        feeder()
        other.session = feeder.sim.session
        other.seq = feeder.sim.seq
        feeder.sim.seq += 1
        other.send({"person": (4.0, 0.0, 0.0)}, flags=BodyTransforms.PARTIAL)

    before = ticks[-1].rejects[Tick.REJECT_WRONG_SOURCE] if ticks else 0
    room.until(lambda: ticks and ticks[-1].rejects[Tick.REJECT_WRONG_SOURCE] > before, "refused: wrong source", then=both)
    assert states[-1].word == "clear"


@pytest.mark.parametrize("run", ['on_frame = "tf"', 'on_frame = "poses"'])
def test_lockstep_on_topics_body_by_body_is_refused_with_the_reason(room, run):
    daemon = room.daemon(SCENE.replace("rate = 50", run))
    assert daemon.process.wait(timeout=15) == 2
    assert "on_frame" in daemon.log and "whole frame" in daemon.log
