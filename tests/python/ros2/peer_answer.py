"""An rclpy node that answers each tick it hears with a frame on `~/transforms`, until it is ended: `peer_answer.py`.

The frames of its source go on only while it hears the daemon and the daemon hears it.
"""

import rclpy
from frames import Sender
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from sweepd_msgs.msg import Tick

rclpy.init()
node = rclpy.create_node("peer_answer")
sender = Sender(node)
node.create_subscription(Tick, "/sweepd/tick", lambda _: sender.send({"left": (0, 0, 0), "right": (5, 0, 0)}), 10)
try:
    rclpy.spin(node)
except (ExternalShutdownException, KeyboardInterrupt, RCLError):  # asked to end
    pass
