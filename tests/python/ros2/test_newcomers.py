"""What a scene of somebody new to the node does: many topics, names with `__`, qualities of service as rclpy has them by
default, a body on a frame beside the scene's, one that is hung on another while its own topic goes on."""

import time

from conftest import LATCHED, RELIABLE
from diagnostic_msgs.msg import DiagnosticArray
from frames import pose
from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.msg import Log
from sweepd_msgs.msg import State, Tick
from sweepd_msgs.srv import AttachBody, Gap
from tf2_msgs.msg import TFMessage

HEAD = """
frame_id = "odom"
[run]
rate = 50
[[source]]
name = "poses"
timeout_ms = 2000
ros2 = { type = "pose" }
[[source]]
name = "tf"
timeout_ms = 2000
ros2 = { type = "tf" }
"""


def body(name, source, key, value):
    shape = '{ type = "sphere", radius = 0.1 }'
    return f'[[body]]\nname = "{name}"\nsource = "{source}"\n{key} = "{value}"\nshape = {shape}\n'


def stamped(message, frame="odom"):
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
    return message


def link(parent, child, x):
    out = stamped(TransformStamped(child_frame_id=child), parent)
    out.transform.translation.x = float(x)
    return TFMessage(transforms=[out])


def warnings(statuses):
    return [status.message for message in statuses[-1:] for status in message.status if status.level != b"\0"]


def test_a_scene_of_hundreds_of_topics_starts(room):
    daemon = room.daemon(HEAD + "".join(body(f"b{n}", "poses", "ros_topic", f"/b{n}/pose") for n in range(300)))
    node = room.node()
    ticks = room.hear(Tick, "/sweepd/tick")
    last = node.create_publisher(PoseStamped, "/b299/pose", 10)
    room.until(lambda: ticks, "a tick", 60)
    place = lambda: last.publish(stamped(PoseStamped(pose=pose((0, 0, 0)))))  # noqa: E731
    room.until(lambda: ticks[-1].unknown == 299, "the last topic is heard", 60, then=place)
    assert daemon.process.poll() is None


def test_names_with_two_underscores_in_a_row_are_those_of_rclpy(room):
    room.daemon(HEAD + body("p", "poses", "ros_topic", "/a__b/pose"), ros_args=["-r", "__ns:=/robot__1"])
    node = room.node("peer", namespace="/robot__1")
    ticks = room.hear(Tick, "sweepd/tick", node=node)
    sender = node.create_publisher(PoseStamped, "/a__b/pose", 10)
    place = lambda: sender.publish(stamped(PoseStamped(pose=pose((0, 0, 0)))))  # noqa: E731
    room.until(lambda: ticks and ticks[-1].unknown == 0, "its pose", then=place)
    answer = room.call(Gap, "/robot__1/sweepd/gap", Gap.Request(name_a="p", name_b="nobody"), node=node, each_s=3)
    assert "nobody" in answer.message


def test_a_volatile_publisher_of_fixed_links_is_told_until_it_goes(room):
    room.daemon(HEAD + body("p", "tf", "ros_frame", "tool"))
    node = room.node()
    statuses, logs = room.hear(DiagnosticArray, "/diagnostics"), room.hear(Log, "/rosout")
    volatile = node.create_publisher(TFMessage, "/tf_static", RELIABLE)
    wanted = "topic /tf_static: a publisher offers volatile, this node needs transient local"
    room.until(lambda: any(wanted in text for text in warnings(statuses)), "a word on /diagnostics")
    room.until(lambda: any(wanted in log.msg for log in logs), "a word on /rosout")
    node.destroy_publisher(volatile)
    node.create_publisher(TFMessage, "/tf_static", LATCHED).publish(link("odom", "tool", 1))
    told = lambda: any("offers volatile" in text for text in warnings(statuses))  # noqa: E731
    room.until(lambda: not told(), "it is over")


def test_a_frame_above_the_scenes_joins_a_body_to_it(room):
    room.daemon(HEAD + body("obstacle", "tf", "ros_frame", "obstacle"))
    node = room.node()
    ticks, reader = room.hear(Tick, "/sweepd/tick"), room.client(None, listen=("bodies",))
    tf = node.create_publisher(TFMessage, "/tf", 10)

    def send():
        tf.publish(link("map", "odom", 1))
        tf.publish(link("map", "obstacle", 4))

    room.until(lambda: ticks and ticks[-1].unknown == 0, "known", then=send)
    # The first results may be of ticks before.
    placed = lambda: reader.wait().bodies[0]["position"].tolist() == [3.0, 0.0, 0.0]  # noqa: E731
    room.until(placed, "beside the scene's frame", then=send)


def test_a_body_that_hangs_on_another_may_go_on_to_be_sent(room):
    scene = HEAD + body("cup", "poses", "ros_topic", "/cup") + body("hand", "poses", "ros_topic", "/hand")
    room.daemon(scene, ros_args=["-p", "ros.allow_edits:=true"])
    node = room.node()
    ticks, states = room.hear(Tick, "/sweepd/tick"), room.hear(State, "/sweepd/state")
    reader = room.client(None, listen=("bodies",))
    topics = {name: node.create_publisher(PoseStamped, f"/{name}", 10) for name in ("cup", "hand")}

    def send(x=0):
        topics["hand"].publish(stamped(PoseStamped(pose=pose((x, 0, 0)))))
        topics["cup"].publish(stamped(PoseStamped(pose=pose((5, 0, 0)))))

    def at(name):
        result = reader.wait()
        return next(row["position"].tolist() for row in result.bodies if int(row["body"]) == reader.names[name])

    def hang(to):
        request = AttachBody.Request(name="cup", to=to, pose=pose((0, 0, 1)))
        answer = room.call(AttachBody, "/sweepd/attach_body", request, then=send)
        assert answer.success, answer.message

    room.until(lambda: states and states[-1].word == "clear", "both known", then=send)
    hang("hand")
    room.until(lambda: at("cup") == [2.0, 0.0, 1.0], "it goes with the hand", then=lambda: send(2))
    refused = []
    for _ in range(60):
        send(2)
        room.spin(0.02)
        refused.append(ticks[-1].rejects[Tick.REJECT_NOT_STEERABLE])
    # those that were on their way when it was hung there are over by then
    assert refused[-1] == refused[20] and ticks[-1].sources[0].alive
    hang("")
    room.until(lambda: at("cup") == [5.0, 0.0, 0.0], "its own pose again", then=lambda: send(2))
