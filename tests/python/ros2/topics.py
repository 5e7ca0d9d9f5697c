"""A scene whose bodies are moved by topics of common types, and who sends on them."""

import math
import time

from conftest import LATCHED
from frames import Sender, pose
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
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
            self.sim.send({"box": (self.x["box"], 0.0, 0.0)}, stamp_ns=time.time_ns() + self.shift_ns.get("box", 0))
