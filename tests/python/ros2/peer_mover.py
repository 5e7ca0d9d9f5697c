"""An rclpy sender of `~/transforms`: `peer_mover.py BODIES FRAMES`, 100 frames a second on the paths of motion.py.

Waits for the daemon, prints one line at the end: frames sent, the greatest lateness in milliseconds.
"""

import secrets
import sys
import time

import rclpy
from geometry_msgs.msg import Pose
from motion import RATE_HZ, Cloud
from sweepd_msgs.msg import BodyTransform, BodyTransforms

count, frames = int(sys.argv[1]), int(sys.argv[2])
cloud = Cloud(count)
rclpy.init()
node = rclpy.create_node("mover")
publisher = node.create_publisher(BodyTransforms, "/sweepd/transforms", 10)
while publisher.get_subscription_count() == 0:
    time.sleep(0.01)
time.sleep(0.5)
message = BodyTransforms(source="sim", session=secrets.randbits(63) + 1, flags=BodyTransforms.FULL)
message.header.frame_id = "world"
message.transforms = [BodyTransform(name=name, pose=Pose()) for name in cloud.names]
places = [body.pose.position for body in message.transforms]
late = 0.0
start = time.monotonic()
for seq in range(1, frames + 1):
    for place, at in zip(places, cloud.positions(seq).tolist()):
        place.x, place.y, place.z = at
    message.seq = seq
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
    message.sent_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    publisher.publish(message)
    wait = start + seq / RATE_HZ - time.monotonic()
    late = max(late, -wait)
    if wait > 0:
        time.sleep(wait)
print(f"sent {frames} late_ms {1000 * late:.1f}", flush=True)
time.sleep(1)
